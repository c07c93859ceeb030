"""Bodies of a study as whole finite-element models: sparse matrices and the rows of places on their tracks.

What the march of modes leaves out by reduction is all here. A uniform beam is cut into elements for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from engine.bodies.beam.beam import Beam, Spring
from engine.bodies.frame.assembly import Assembly, assemble
from engine.bodies.frame.body import frame_modes, kept_modes
from engine.bodies.frame.frame import Frame
from engine.bodies.frame.gauges import point_loads
from engine.bodies.frame.geometry import unit
from engine.bodies.frame.pushes import side_lines
from engine.bodies.frame.track import Line, track_of
from engine.bodies.modal.description import AUTO_MODES, Body
from engine.bodies.modal.flexibility import Flexibility, factorised
from engine.bodies.modal.modal_body import Direction
from engine.bodies.rigid.rigid import Rigid
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.unreduced.gauges import FullGauge, FullRead, full_gauge
from engine.unreduced.track import SIDE_TRACKS, AlongTrack, FrameTrack, Rows, no_rows
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.lazy_imports import sparse

BEAM_ELEMENTS = 64
MOST_SUPPORTS = 50


@dataclass(frozen=True)
class RigidTrack:
    """Heave (m) and pitch (rad) about the centre of mass at `centre`, m; otherwise as `FrameTrack`."""

    centre: float

    def rows(self, s: Array, derivative: int = 0) -> Rows:
        found = no_rows(len(s))
        found.values[:, 0] = float(derivative == 0)
        found.values[:, 1] = s - self.centre if derivative == 0 else float(derivative == 1)
        found.freedoms[:, 1] = 1
        return found

    def within(self, x: Array, s: Array, quantity: str = "displacement") -> Array:
        return np.zeros(np.broadcast_shapes(x.shape, s.shape))

    def inside(self, s: Array) -> tuple[Array, Array]:
        return s, np.ones(len(s))

    def under_weight(self, x: Array, quantity: str = "displacement") -> Array:
        return np.zeros(len(x))

    def sections(self, quantity: str, x: Array) -> tuple[Rows, Rows]:
        raise BadInput("a rigid body has no section forces", where="quantity", received=quantity)


Track = FrameTrack | AlongTrack | RigidTrack


class Damping(NamedTuple):
    """C = viscous + loads diag(rates) loads^T: (n, n) sparse; (n, k) and (k,) of modes."""

    viscous: sparse.csc_array
    loads: Array
    rates: Array


@dataclass(frozen=True, eq=False)
class FullBody:
    """A body with all its n degrees of freedom.

    rigid (n, r): rigid-body motions of unit mass; pull (n,): own weight per unit gravity; flexibility: the elastic
    answer to loads, None where nothing bends; points: rows (n,) by name; sides: its track in other
    directions than its loads', where it moves so; lines: their elements, and those of the track; gauges: by the names
    of sensors; gravity_share: of gravity along the track's direction.
    """

    name: str
    length: float
    stiffness: sparse.csc_array
    mass: sparse.csc_array
    rigid: Array
    pull: Array
    damping: Damping
    flexibility: Flexibility | None
    track: FrameTrack | RigidTrack
    points: dict[str, Array]
    sides: Mapping[Direction, AlongTrack | FrameTrack] = field(default_factory=dict)
    lines: Mapping[Direction, Line] = field(default_factory=dict)
    gauges: Mapping[str, FullGauge] = field(default_factory=dict)
    gravity_share: float = 1.0

    @property
    def size(self) -> int:
        """Degrees of freedom."""
        return int(self.pull.size)


def full_body(study: Study, name: str) -> FullBody:
    """The whole model of a body of a study. Raises BadInput for one that has none."""
    whole = study.body[name].whole
    if whole is not None:
        return _FULL[whole.kind](study, name, whole)
    what = "this body has no whole finite-element model to compare with"
    received = f'"{study.value(f"body.{name}.kind")}"'
    raise study.source.fault(f"body.{name}.kind", what, expected='"frame", "beam" or "rigid"', received=received)


def _full_beam(study: Study, name: str, beam: Beam) -> FullBody:
    frame = frame_of_beam(study, name, beam)
    return _assembled(study, name, frame, _only_bending(assemble(frame)))


def _full_frame(study: Study, name: str, frame: Frame) -> FullBody:
    """The reduced body must be a reduction of this very model."""
    given = {"mass_matrix": frame.mass_matrix, "rigid_body_modes": frame.rigid_body_modes}
    for key, wanted in (("mass_matrix", "consistent"), ("rigid_body_modes", "keep")):
        if given[key] != wanted:
            what = "the unreduced model cannot be marched so"
            raise study.source.fault(f"body.{name}.{key}", what, expected=f'"{wanted}"', received=f'"{given[key]}"')
    return _assembled(study, name, frame, assemble(frame))


def frame_of_beam(study: Study, name: str, beam: Beam) -> Frame:
    """A uniform beam as a plane frame with nodes at its supports and about `BEAM_ELEMENTS` elements."""
    if len(beam.springs) > MOST_SUPPORTS:
        what, expected = "too many supports for the unreduced model", f"at most {MOST_SUPPORTS}"
        raise study.source.fault(f"body.{name}.supports", what, expected=expected, received=str(len(beam.springs)))
    places = sorted({0.0, beam.length, *(spring.at for spring in beam.springs)})
    number = {place: f"n{index}" for index, place in enumerate(places)}
    members = {
        f"m{index}": {
            "nodes": [number[before], number[after]],
            "section": "all",
            "elements": max(1, round(BEAM_ELEMENTS * (after - before) / beam.length)),
        }
        for index, (before, after) in enumerate(pairwise(places))
    }
    held = {"pinned": ["x", "z"], "clamped": ["x", "z", "ry"], "free": ["x"]}
    keys = ("area", "second_moment", "youngs_modulus", "density", "fibre_distance")
    left, right = beam.ends
    return Frame.model_validate(
        {
            "kind": "frame",
            "plane": "xz",
            "node": {number[place]: [place, 0.0] for place in places},
            "section": {"all": {key: getattr(beam, key) for key in keys if getattr(beam, key) is not None}},
            "member": members,
            "supports": {number[0.0]: held[left], number[beam.length]: held[right]},
            "spring": {f"s{index}": _spring(spring, number[spring.at]) for index, spring in enumerate(beam.springs)},
            "track": {"members": list(members)},
            "modes": beam.modes,
        }
    )


def _spring(spring: Spring, node: str) -> dict[str, Any]:
    return {
        "node": node,
        "stiffness": [0.0, 0.0, spring.stiffness],
        "rotational": [0.0, spring.rotational, 0.0],
        "damping": [0.0, 0.0, spring.damping],
    }


def _only_bending(assembly: Assembly) -> Assembly:
    """Without the motions along a straight beam, which no load on it excites."""
    keep = np.flatnonzero(assembly.free % 6 != 0)
    moved = assembly.rigid[keep]
    return replace(
        assembly,
        free=assembly.free[keep],
        stiffness=assembly.stiffness[keep][:, keep].tocsc(),
        mass=assembly.mass[keep][:, keep].tocsc(),
        drag=assembly.drag[keep],
        rigid=moved[:, np.abs(moved).max(axis=0, initial=0.0) > 0.0],
    )


def _assembled(study: Study, name: str, frame: Frame, assembly: Assembly) -> FullBody:
    flexibility = factorised(assembly.stiffness, assembly.mass, assembly.rigid)
    track, ends = track_of(frame, assembly.mesh)
    gravity, sides = unit(frame.gravity), side_lines(frame, track)
    spread = track.spread_weight(gravity)
    numbers, loads = point_loads(frame, assembly)
    read = FullRead(frame, assembly, track, ends)
    return FullBody(
        name=name,
        length=frame.length,
        stiffness=assembly.stiffness,
        mass=assembly.mass,
        rigid=flexibility.rigid,
        pull=assembly.drag @ gravity,
        damping=_damping(study, name, frame, assembly, flexibility),
        flexibility=flexibility,
        track=FrameTrack.of(track, ends, assembly, spread),
        points={word: loads[:, number] for word, number in numbers.items()},
        sides={way: SIDE_TRACKS[way](line, ends, assembly, spread) for way, line in sides.items()},
        lines={"load": track, **sides},
        gauges={sensor: full_gauge(read, spot) for sensor, spot in study.spots(name)},
        gravity_share=float(track.direction @ gravity),
    )


def _damping(study: Study, name: str, frame: Frame, assembly: Assembly, flexibility: Flexibility) -> Damping:
    """The damping of the reduced body: of the modes that it keeps, none of the others, or Rayleigh's; and dampers."""
    body: Body = study.body[name]
    values = VariantValues(study, {}, 1)
    numbers, loads = point_loads(frame, assembly)
    points = [(loads[:, numbers[str(at)]], rate) for _, at, rate in frame.dampers() if rate > 0.0]
    rows = np.array([row for row, _ in points]).reshape(len(points), len(assembly.free))
    rates = np.array([rate for _, rate in points])
    wide = sparse.csc_array(rows)
    viscous = (wide.T * rates[None, :]) @ wide if points else sparse.csc_array(assembly.stiffness.shape)
    if body.rayleigh is not None:
        by_mass, by_stiffness = body.rayleigh.rayleigh
        viscous = viscous + by_mass * assembly.mass + by_stiffness * assembly.stiffness
        return Damping(sparse.csc_array(viscous), np.zeros((len(assembly.free), 0)), np.zeros(0))
    omega, shapes = _kept(body, frame, assembly, flexibility)
    rates = values.damping_rates(name, omega)[:, 0]
    damped = rates > 0.0
    return Damping(sparse.csc_array(viscous), assembly.mass @ shapes[:, damped], rates[damped])


def _kept(body: Body, frame: Frame, assembly: Assembly, flexibility: Flexibility) -> tuple[Array, Array]:
    """omega (k,) and shapes (n, k) of the modes that the reduced body has."""
    if body is frame:
        omega, shapes = frame_modes(frame, assembly, flexibility)
        kept = kept_modes(frame, omega)
        return omega[kept], shapes[:, kept]
    count = AUTO_MODES if body.modes == "auto" else int(body.modes)
    omega, shapes = flexibility.modes(min(count, len(assembly.free)))
    return omega[:count], shapes[:, :count]


def _full_rigid(study: Study, name: str, body: Rigid) -> FullBody:
    rates = VariantValues(study, {}, 1).damping_rates(name, np.zeros(2))[:, 0]
    mass = np.array([body.mass, body.inertia])
    nothing: Any = sparse.csc_array((2, 2))
    return FullBody(
        name=name,
        length=body.length,
        stiffness=nothing,
        mass=sparse.csc_array(np.diag(mass)),
        rigid=np.diag(1.0 / np.sqrt(mass)),
        pull=np.array([body.mass, 0.0]),
        damping=Damping(sparse.csc_array(np.diag(rates * mass)), np.zeros((2, 0)), np.zeros(0)),
        flexibility=None,
        track=RigidTrack(body.centre_of_mass),
        points={},
    )


#: How the whole model of each kind of body is made.
_FULL: Mapping[str, Callable[[Study, str, Any], FullBody]] = {
    "beam": _full_beam,
    "frame": _full_frame,
    "rigid": _full_rigid,
}
