"""Bending stresses of rails under robots, in their extreme fibres.

Bending moments are those of the frame's elements by displacements and rotations of their ends: of the kept modes, and
of what these miss at rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.frame.sections import forces_from_ends
from engine.kernels.robots.layout import FIRST, MODES, OF_GRIP, PASSED, PASSED_GRIPS
from engine.kernels.robots.stress import Bending
from engine.kernels.robots.stress import largest_stress as of_rail
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.bodies.frame.track import TrackBeams
    from engine.kernels.robots.layout import Record
    from engine.robots.model import RobotModel
    from engine.robots.peaks import Steps

MOMENTS = slice(4, 6)  # of section forces: M_y and M_z
NEAR = 0.9  # of the largest at stations: where steps between these are looked at


def bending_of(track: TrackBeams, moved: Array, missed: Array) -> Bending:
    """By modes' motion of the ends of elements (6 (E + 1), n), and by that under loads there, which modes miss."""
    E, beams = len(track.places) - 1, track.beams
    element = np.repeat(np.arange(E), 24)
    at = np.repeat(np.stack([np.zeros(E), beams.length], axis=1).reshape(-1), 12)
    forces = forces_from_ends(track, element, at, np.tile(np.eye(12), (2 * E, 1)))
    modulus, stiff = beams.axial / track.area, np.stack([beams.bending_z, beams.bending_y], axis=1)
    per_moment = modulus[:, None] * track.fibres[:, ::-1] / stiff
    stresses = forces[:, MOMENTS].reshape(E, 2, 12, 2) * per_moment[:, None, None]
    ends = 6 * np.arange(E)[:, None] + np.arange(12)
    modes, rest = (
        np.einsum("eskp,ekc->cesp", stresses, part[ends]).reshape(part.shape[1], -1) for part in (moved, missed)
    )
    return Bending(modes, rest, track.places, np.ascontiguousarray(track.axes[:, 1:]), per_moment)


def is_told(bending: Bending) -> bool:
    """Whether all sections have fibre distances."""
    return bool(np.isfinite(bending.per_moment).all())


def largest_stress(model: RobotModel, b: int, y: Array, grips: Array) -> Array:
    """(S,) Pa: the largest at any place of rail b, by coordinates of all modes y (S, n) under robots with ``grips``
    (S, R, 2, OF_GRIP); NaN where a section has no fibre distances."""
    bending, first = list(model.rails.values())[b].bending, model.system.tracks[b, FIRST]
    if not is_told(bending):
        return np.full(len(y), np.nan)
    r, g = np.nonzero((model.system.body == b) & model.study.solver.static_correction)
    own = np.ascontiguousarray(y[:, first : first + model.system.tracks[b, MODES]])
    return np.asarray(of_rail(bending, own, grips[:, r, g]))


def stress_at_steps(model: RobotModel, b: int, steps: Steps, record: Record) -> Array:
    """(T,) Pa, the same at all steps: those at which it is not near its largest go straight from station to station."""
    stations = largest_stress(model, b, record.coordinates[:, : model.modes, 0], record.grips)
    found, before = steps.between_stations(stations), steps.station.astype(np.int64)
    high = np.maximum(stations[before], stations[np.minimum(before + 1, len(stations) - 1)])
    near = high >= NEAR * stations.max()
    grips = record.passed[near, :, PASSED_GRIPS:PASSED].reshape(-1, len(model.robots), 2, OF_GRIP)
    found[near] = largest_stress(model, b, record.bent[near], grips)
    return found
