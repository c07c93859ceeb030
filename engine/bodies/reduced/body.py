"""Modal bodies with a track of beams (frames) to files and back."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from engine.bodies.frame.elements import Beams
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.shapes import ModeForces, TrackShapes
from engine.bodies.frame.statics import TrackStatics
from engine.bodies.frame.track import TrackBeams
from engine.bodies.modal.description import Modes
from engine.bodies.modal.modal_body import Array, ModalBody, Points
from results_schema.errors import BadInput
from results_schema.store.bodies import NUMBERS, StoredBody, read_body, write_body

#: Where a body has the arrays of its file, by their names there.
_ARRAYS = {
    "omega": "omega",
    "participation": "participation",
    "wave_number": "wave_number",
    "place": "shapes.places",
    "shape": "shapes.values",
    "shape_slope": "shapes.slopes",
    "shape_curvature": "shapes.curvatures",
    "section_force": "sections.modes.forces",
    "section_force_change": "sections.modes.changes",
    "pattern": "statics.patterns",
    "flexibility": "statics.flexibility",
    "weight_response": "statics.weight",
    "spread_weight": "statics.spread",
    "axes": "statics.track.axes",
    "area": "statics.track.area",
    "fibre_distance": "statics.track.fibres",
    "direction": "statics.track.direction",
    "offset": "statics.track.offset",
    "element_length": "statics.track.beams.length",
    "axial_stiffness": "statics.track.beams.axial",
    "torsional_stiffness": "statics.track.beams.torsion",
    "bending_stiffness_y": "statics.track.beams.bending_y",
    "bending_stiffness_z": "statics.track.beams.bending_z",
    "shear_stiffness_y": "statics.track.beams.shear_y",
    "shear_stiffness_z": "statics.track.beams.shear_z",
    "mass_per_length": "statics.track.beams.mass",
    "twist_inertia": "statics.track.beams.twist_inertia",
    "turn_inertia_y": "statics.track.beams.turn_inertia_y",
    "turn_inertia_z": "statics.track.beams.turn_inertia_z",
}
_POINT_ARRAYS = {
    "point_shape": "points.shapes",
    "point_flexibility": "points.flexibility",
    "point_response": "points.response",
    "point_weight": "points.weight",
}


def save_body(body: ModalBody, path: Path | str) -> None:
    """Write a reduced frame to a netCDF-4 file. Raises BadInput for another kind of body or place, OutputFailed."""
    if not isinstance(body.statics, TrackStatics):
        raise BadInput("only bodies with a track of beams are saved", where=str(path), expected="a frame")
    places = _ARRAYS | (_POINT_ARRAYS if body.points is not None else {})
    arrays = {name: attrgetter(place)(body) for name, place in places.items()}
    numbers = {name: getattr(body, name) for name in NUMBERS} | {"rigid_modes": body.statics.rigid}
    write_body(path, StoredBody(arrays, numbers, () if body.points is None else tuple(body.points.numbers)))


def load_body(path: Path | str, modes: Modes = "auto") -> ModalBody:
    """The body of a file, with all of its modes or the lowest so many. Raises BadInput and ArchiveError."""
    stored = read_body(path)
    arrays, numbers = _lowest(stored, modes), dict[str, Any](stored.numbers)
    rigid = int(numbers.pop("rigid_modes"))

    def parts(owner: str) -> dict[str, Any]:
        places = ((name, place.rpartition(".")) for name, place in (_ARRAYS | _POINT_ARRAYS).items())
        return {own: arrays[name] for name, (whose, _, own) in places if whose == owner}

    beams = Beams(**parts("statics.track.beams"))
    track = TrackBeams(places=arrays["place"], beams=beams, **parts("statics.track"))
    statics = TrackStatics(track=track, loads=track, rigid=rigid, **parts("statics"))
    sections = TrackSections(statics, ModeForces(**parts("sections.modes")))
    points = None
    if stored.points:
        names = {name: number for number, name in enumerate(stored.points)}
        response = arrays["point_response"]
        points = Points(
            names, section_response=response, rigid=rigid, statics=statics, sections=sections, **parts("points")
        )
    return ModalBody(
        **numbers,
        **parts(""),
        dampers=(),
        joints=tuple(arrays["place"][1:-1].tolist()),  # of which the file does not know the ends of members
        shapes=TrackShapes(**parts("shapes")),
        statics=statics,
        sections=sections,
        points=points,
    )


def _lowest(stored: StoredBody, modes: Modes) -> dict[str, Array]:
    """The arrays of a file with its lowest modes alone."""
    known = stored.arrays["omega"].size
    count = known if modes == "auto" else int(modes)
    if count > known:
        expected = f"at most the {known} modes of the file"
        raise BadInput("more modes than the file has", where="modes", expected=expected, received=str(count))
    return {
        one.name: np.ascontiguousarray(stored.arrays[one.name][..., : count if one.dims[-1] == "mode" else None])
        for one in stored.variables
    }
