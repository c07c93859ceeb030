"""One march of robots on rails, and what is observed of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from engine.kernels.layout import SOUND, Newmark
from engine.kernels.robots.layout import (
    FALLS_OVER,
    HOLDS,
    MOVES,
    OBSERVED,
    OF_GRIP,
    PASSED,
    START,
    STEADY,
    UP,
    WHOLE,
    WORKS,
    Record,
    Stretch,
)
from engine.kernels.robots.march import march as march_kernel
from engine.kernels.robots.march import rest as rest_kernel
from engine.march.halting import flagged
from results_schema.arrays import Array, Counts
from results_schema.status import Status

if TYPE_CHECKING:
    from engine.robots.model import RobotModel

SAME = 1e-9  # of the whole time: closer events are one, as a move that begins where another ends, but for rounding
NEWTON = 1e-4  # of the tolerance: what is left of a step's corrections, over the largest motion


def stretches(model: RobotModel, duration: float, step: float, every: int) -> Stretch:
    """The time (s) cut where a robot begins or ends a move or its work, into steps no longer than ``step`` (s) of which
    ``every`` th is observed; the same events and stations whatever ``every`` is where step/every stays."""
    events = _events(model, duration)
    lengths = np.diff([*events, duration])
    steps = np.maximum(1, np.ceil(lengths / (step * every) - 1e-9)).astype(np.int64) * every
    return Stretch(events, lengths / steps, steps, every, (NEWTON * model.study.solver.tolerance) ** 2)


def _events(model: RobotModel, duration: float) -> Array:
    """s: time 0 and when moves begin or end, or work ends, without ends at which another begins."""
    moves, until = model.system.moves, model.system.stays[:, 1:, -1]
    starts = np.unique(np.concatenate([[0.0], moves[:, :, START].ravel()]))
    arrivals = moves[:, :, START] + 2.0 * moves[:, :, UP] + moves[:, :, STEADY]
    ends = np.sort(np.concatenate([arrivals[np.isfinite(arrivals)], until[np.isfinite(until)]]))
    ends = ends[np.diff(ends, append=np.inf) > SAME * duration]
    apart = np.abs(ends[:, None] - starts[np.isfinite(starts)]).min(axis=1) > SAME * duration
    events = np.concatenate([starts, ends[apart]])
    return np.sort(events[events < duration * (1.0 - SAME)])


def doing(model: RobotModel, cut: Stretch) -> Counts:
    """(P, R) what robots do in each stretch of time: MOVES, WORKS or HOLDS."""
    moves, stays = model.system.moves, model.system.stays
    middle = cut.start + 0.5 * cut.step * cut.steps
    found = np.full((middle.size, len(moves)), HOLDS)
    for r, own in enumerate(moves):
        begun = np.searchsorted(own[:, START], middle)  # moves that are none begin at infinity
        lengths = np.append(0.0, 2.0 * own[:, UP] + own[:, STEADY])[begun]
        since = middle - np.append(-np.inf, own[:, START])[begun]
        found[middle <= stays[r, begun, -1], r] = WORKS
        found[since < lengths, r] = MOVES
    return found


def march(model: RobotModel, times: Stretch, scheme: Newmark) -> tuple[Record, Status]:
    """What robots and rails do over all stretches of time. Raises Halted."""
    with flagged() as stop:
        record = _empty(model, times, int(np.sum(1 + times.steps)), stop)
        return record, _status(march_kernel(model.system, times, scheme, record))


def rest(model: RobotModel, times: Stretch) -> tuple[Record, Status]:
    """Where robots and rails would rest at the same stations, with joints held where they are told to be then. Raises
    Halted."""
    counts = model.system.counts.copy()
    counts[:, WHOLE] = 0
    with flagged() as stop:
        record = _empty(model, times, 0, stop)
        return record, _status(rest_kernel(model.system._replace(counts=counts), times, record))


def _empty(model: RobotModel, times: Stretch, passed: int, stop: Counts) -> Record:
    S = int(np.sum(1 + times.steps // times.every))
    (R, J), N = model.system.coordinate.shape, len(model.system.springs)
    return Record(
        np.full((S, N, 4), math.nan),
        np.full((S, R, OBSERVED), math.nan),
        np.zeros((S, R, J)),
        np.zeros((S, R, 2, OF_GRIP)),
        np.full((passed, R, PASSED + J), math.nan),
        np.full((passed, model.modes), math.nan),
        stop,
    )


def _status(code: int) -> Status:
    if code == FALLS_OVER:
        return Status.FALLS_OVER
    return Status.OK if code == SOUND else Status.NOT_CONVERGED
