"""Frames as rails: how the axis of a track moves in all six directions per mode, and what the kept modes miss."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.frame.assembly import Assembly, Content, assemble
from engine.bodies.frame.body import frame_modes
from engine.bodies.frame.geometry import unit
from engine.bodies.frame.track import TrackBeams, TrackPoints, track_of
from engine.bodies.modal.flexibility import Flexibility, factorised, solving
from engine.kernels.robots.stress import Bending
from engine.robots.stress import bending_of
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame

LEVEL = 1e-9  # sine of the angle that a track may be off x, and gravity off -z


@dataclass(frozen=True, eq=False)
class Rail:
    """A track as robots see it.

    start (3,): m, where it begins; ends (E + 1,): m, the ends of its elements along it; omega (n,); shapes
    (E, 4, 6, n): cubics (spline, C2) of the motion of its axis per mode, constant first; moved (E + 1, 6, n): that
    motion at the ends; missed (6 (E + 1), 6 (E + 1)): motion of the ends per unit load that the modes miss;
    pull: N/m, what its supports pull at it per metre that it would grow shorter; bending: its stresses by these.
    """

    start: Array
    ends: Array
    omega: Array
    shapes: Array
    moved: Array
    missed: Array
    pull: float
    bending: Bending


@dataclass(frozen=True, eq=False)
class _Whole:
    """What does not depend on how many modes are kept; soft: motion of the ends per unit load on them."""

    assembly: Assembly
    flexibility: Flexibility
    track: TrackBeams
    points: TrackPoints
    soft: Array

    @property
    def pull(self) -> float:
        """N/m, at a track that would grow shorter: nothing where an end is free, as stiff as itself between walls."""
        own = 1.0 / float(np.sum(self.track.beams.length / self.track.beams.axial))
        ends = self.soft[np.ix_([0, -6], [0, -6])]
        return own * (1.0 - own * float(ends[0, 0] + ends[1, 1] - ends[0, 1] - ends[1, 0]))


def rail(frame: Frame) -> Rail:
    """A frame as a rail; the last few are remembered. Raises BadInput, with the key within the body as its place."""
    _check(frame)
    return _rail(Content.of(frame))


def _check(frame: Frame) -> None:
    tangent = frame.line.tangent
    if np.linalg.norm(tangent - np.array([1.0, 0.0, 0.0])) > LEVEL:
        raise BadInput("a rail under robots runs along x", where="track", expected="nodes in the order of growing x")
    if np.linalg.norm(unit(frame.gravity) - np.array([0.0, 0.0, -1.0])) > LEVEL:
        raise BadInput("gravity acts along -z under robots", where="gravity_direction", expected="[0, 0, -1]")
    if any(frame.track.offset):
        raise BadInput("robots are beside a track by their own offset", where="track.offset", expected="no offset")
    if frame.own_weight:
        what = "under robots deflections count from the state without them"
        raise BadInput(what, where="own_weight", expected="false")
    if any(coefficient > 0.0 for _, _, coefficient in frame.dampers()):
        what = "dampers at nodes are not built under robots"
        raise BadInput(what, where="spring", expected="damping_ratio of the body")


@lru_cache(maxsize=16)
def _whole(content: Content) -> _Whole:
    assembly = assemble(content.frame)
    if assembly.rigid.shape[1]:
        raise BadInput("nothing holds this rail", where="supports", expected="supports or springs against all motions")
    flexibility = factorised(assembly.stiffness, assembly.mass, assembly.rigid)
    track, points = track_of(content.frame, assembly.mesh)
    loads = points.loads(np.eye(6), np.arange(len(track.places)), 6 * len(assembly.mesh.points))
    found = points.of(assembly.whole(flexibility.solve(loads[assembly.free])))
    return _Whole(assembly, flexibility, track, points, found.reshape(loads.shape[1], -1))


@lru_cache(maxsize=16)
def _rail(content: Content) -> Rail:
    from scipy.interpolate import CubicSpline

    what = "the stiffnesses, masses or lengths of this frame differ too much to be solved"
    with solving(what, "section", "numbers of one scale") as demand_finite:
        whole = _whole(Content.of(content.frame, without=("modes", "leave_out", "rigid_body_modes")))
        omega, shapes = frame_modes(content.frame, whole.assembly, whole.flexibility)
        moved = whole.points.of(whole.assembly.whole(shapes))
        spline = CubicSpline(whole.track.places, moved, axis=0).c[::-1]
        flat = moved.reshape(-1, omega.size)
        missed = whole.soft - (flat / omega**2) @ flat.T
        demand_finite(omega, moved, missed)
    start = whole.assembly.mesh.points[whole.points.points[0]] + whole.points.arms[0]
    bending = bending_of(whole.track, flat, missed)
    return Rail(start, whole.track.places, omega, np.moveaxis(spline, 0, 1), moved, missed, whole.pull, bending)
