"""Modal bodies with a track of beams (frames) to files and back."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from engine.bodies.frame.elements import Beams
from engine.bodies.frame.points import FramePoints
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.shapes import ModeForces, TrackShapes
from engine.bodies.frame.statics import TrackStatics
from engine.bodies.frame.track import TrackBeams
from engine.bodies.modal.description import Modes
from engine.bodies.modal.modal_body import Array, ModalBody
from results_schema.errors import BadInput
from results_schema.store.bodies import StoredBody, read_body, write_body

# The element's properties in the order of `Beams`, by their names in the file.
_BEAMS = (
    "element_length", "axial_stiffness", "torsional_stiffness", "bending_stiffness_y", "bending_stiffness_z",
    "shear_stiffness_y", "shear_stiffness_z", "mass_per_length", "twist_inertia", "turn_inertia_y", "turn_inertia_z",
)  # fmt: skip


def save_body(body: ModalBody, path: Path | str) -> None:
    """Write a reduced frame to a netCDF-4 file. Raises BadInput for another kind of body or place, OutputFailed."""
    sections = body.sections
    if not (isinstance(body.shapes, TrackShapes) and isinstance(sections, TrackSections)):
        raise BadInput("only bodies with a track of beams are saved", where=str(path), expected="a frame")
    arrays = {"omega": body.omega, "participation": body.participation, "wave_number": body.wave_number}
    arrays |= _of_shapes(body.shapes, sections) | _of_statics(sections.statics)
    numbers = {
        "length": body.length,
        "mass": body.mass,
        "bending_stiffness": body.bending_stiffness,
        "rigid_modes": sections.statics.rigid,
        "gravity_share": body.gravity_share,
    }
    names: tuple[str, ...] = ()
    if isinstance(body.points, FramePoints):
        names, points = tuple(body.points.numbers), body.points
        arrays |= {
            "point_shape": points.shapes,
            "point_flexibility": points.flexibility,
            "point_response": points.response,
            "point_weight": points.weight,
        }
    write_body(path, StoredBody(arrays, numbers, names))


def _of_shapes(shapes: TrackShapes, sections: TrackSections) -> dict[str, Array]:
    return {
        "place": shapes.places,
        "shape": shapes.values,
        "shape_slope": shapes.slopes,
        "shape_curvature": shapes.curvatures,
        "section_force": sections.modes.forces,
        "section_force_change": sections.modes.changes,
    }


def _of_statics(statics: TrackStatics) -> dict[str, Array]:
    track = statics.track
    found = {name: getattr(track.beams, field.name) for name, field in zip(_BEAMS, fields(Beams), strict=True)}
    return found | {
        "pattern": statics.patterns,
        "flexibility": statics.flexibility,
        "weight_response": statics.weight,
        "spread_weight": statics.spread,
        "axes": track.axes,
        "area": track.area,
        "fibre_distance": track.fibres,
        "direction": track.direction,
        "offset": track.offset,
    }


def load_body(path: Path | str, modes: Modes = "auto") -> ModalBody:
    """The body of a file, with all of its modes or the lowest so many. Raises BadInput and ArchiveError."""
    stored = read_body(path)
    found, numbers = stored.arrays, stored.numbers
    track = TrackBeams(
        places=found["place"],
        axes=found["axes"],
        beams=Beams(*(found[name] for name in _BEAMS)),
        area=found["area"],
        fibres=found["fibre_distance"],
        direction=found["direction"],
        offset=found["offset"],
    )
    statics = TrackStatics(
        track=track,
        patterns=found["pattern"],
        flexibility=found["flexibility"],
        weight=found["weight_response"],
        spread=found["spread_weight"],
        rigid=int(numbers["rigid_modes"]),
    )
    forces = ModeForces(found["section_force"], found["section_force_change"])
    sections = TrackSections(statics, forces)
    whole = ModalBody(
        length=numbers["length"],
        mass=numbers["mass"],
        omega=found["omega"],
        participation=found["participation"],
        wave_number=found["wave_number"],
        bending_stiffness=numbers["bending_stiffness"],
        dampers=(),
        shapes=TrackShapes(found["place"], found["shape"], found["shape_slope"], found["shape_curvature"]),
        statics=statics,
        gravity_share=numbers["gravity_share"],
        sections=sections,
        points=_points(stored, sections) if stored.points else None,
    )
    return whole if modes == "auto" else _lowest(whole, int(modes))


def _points(stored: StoredBody, sections: TrackSections) -> FramePoints:
    found = stored.arrays
    return FramePoints(
        numbers={name: number for number, name in enumerate(stored.points)},
        shapes=found["point_shape"],
        flexibility=found["point_flexibility"],
        response=found["point_response"],
        weight=found["point_weight"],
        sections=sections,
    )


def _lowest(body: ModalBody, count: int) -> ModalBody:
    """The body with its lowest modes alone."""
    if count > len(body.omega):
        expected = f"at most the {len(body.omega)} modes of the file"
        raise BadInput("more modes than the file has", where="modes", expected=expected, received=str(count))
    assert isinstance(body.shapes, TrackShapes) and isinstance(body.sections, TrackSections)
    shapes, forces = body.shapes, body.sections.modes
    values, slopes, curvatures = (_cut(part, count) for part in (shapes.values, shapes.slopes, shapes.curvatures))
    kept = ModeForces(_cut(forces.forces, count), _cut(forces.changes, count))
    points = body.points
    if isinstance(points, FramePoints):
        points = replace(points, shapes=_cut(points.shapes, count))
    return replace(
        body,
        points=points,
        omega=body.omega[:count],
        participation=body.participation[:count],
        wave_number=body.wave_number[:count],
        shapes=TrackShapes(shapes.places, values, slopes, curvatures),
        sections=TrackSections(body.sections.statics, kept),
    )


def _cut(values: Array, count: int) -> Array:
    return np.ascontiguousarray(values[..., :count])
