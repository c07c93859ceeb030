"""What rails leave out that do not grow shorter as they bend: their motion is linear in their modes.

Robots take the whole rotation of their base, so that this is all that is left out of second order: a rail would pull
its robots along by half the integral of the squares of its slopes, and what presses or pulls along it would bend it
more or less.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.kernels.robots.layout import FIRST, GRIP, MODES
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.kernels.robots.layout import Record
    from engine.robots.model import RobotModel

PITCH, YAW = 4, 5  # motions of a track's axis
LOOKED_AT = 200  # stations, evenly


def beyond_linear(model: RobotModel, record: Record, longest: Array) -> Array:
    """(R,) of the longest error of each tool (R,), m, how much that leaves out: the way by which its rails would grow
    shorter at most, and the part that the work of forces along a rail on that way is of what bends it."""
    some = np.linspace(0, len(record.coordinates) - 1, LOOKED_AT).astype(np.int64)
    ways, parts = np.zeros(len(model.rails)), np.zeros(len(model.rails))
    for b, rail in enumerate(model.rails.values()):
        first, count = model.system.tracks[b, FIRST], model.system.tracks[b, MODES]
        y = record.coordinates[some, first : first + count, 0]
        squares = 0.5 * sum((y @ rail.moved[:, turn].T) ** 2 for turn in (PITCH, YAW))
        way = np.trapezoid(squares, rail.ends, axis=1)
        force = rail.pull * way
        for r, g in np.argwhere(model.system.body == b):
            force = force + np.abs(record.grips[some, r, g, GRIP])
        energy = np.sum((y * rail.omega) ** 2, axis=1)
        ways[b] = way.max()
        parts[b] = 2.0 * np.max(force * way) / max(energy.max(), np.finfo(float).tiny)
    ridden = model.system.body
    ways, parts = (np.where(ridden >= 0, part[ridden], 0.0).max(axis=1) for part in (ways, parts))
    return np.asarray(parts + np.divide(ways, longest, out=np.full(longest.shape, np.nan), where=longest > 0.0))
