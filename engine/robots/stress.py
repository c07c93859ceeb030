"""Bending stresses of rails under robots, in their extreme fibres.

Bending moments are those of the frame's elements by displacements and rotations of their ends: of the kept modes, and
of what these miss at rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.frame.sections import forces_from_ends
from engine.kernels.robots.layout import FIRST, MODES
from engine.kernels.robots.stress import Bending
from engine.kernels.robots.stress import largest_stress as of_rail
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.bodies.frame.track import TrackBeams
    from engine.kernels.robots.layout import Record
    from engine.robots.model import RobotModel

MOMENTS = slice(4, 6)  # of section forces: M_y and M_z


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


def largest_stress(model: RobotModel, record: Record) -> Array:
    """(S, B) Pa: the largest at any place of a rail; NaN where a section has no fibre distances."""
    found = np.full((len(record.coordinates), len(model.rails)), np.nan)
    for b, rail in enumerate(model.rails.values()):
        if is_told(rail.bending):
            first = model.system.tracks[b, FIRST]
            y = record.coordinates[:, first : first + model.system.tracks[b, MODES], 0]
            r, g = np.nonzero((model.system.body == b) & model.study.solver.static_correction)
            found[:, b] = of_rail(rail.bending, np.ascontiguousarray(y), record.grips[:, r, g])
    return found
