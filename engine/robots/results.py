"""The numbers that a march of robots on rails reports, and how far two marches differ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.kernels.robots.layout import (
    ELEMENTS,
    FIRST,
    HOLDS,
    MODES,
    MOVES,
    SEEN_ACTUAL,
    SEEN_PHASE,
    SEEN_PLANNED,
    START,
    STEADY,
    SUNK,
    UP,
    WORKS,
)
from engine.robots.stress import is_told, largest_stress
from results_schema.arrays import Array, Counts
from results_schema.status import Status

if TYPE_CHECKING:
    from engine.kernels.robots.layout import Record
    from engine.robots.model import RobotModel

VERTICAL = 2  # of a wrench and of a motion: its part along z
DOING = {"moving": MOVES, "working": WORKS, "holding": HOLDS}
KEPT = 800  # stations of a history


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a variant reports by one march: numbers by name, over robots (R,), components (R, 3) or rails (B,); at all
    S stations: times (S,), planned tool centre points and their errors (S, R, 3), rails under robots (S, R, 2)."""

    numbers: dict[str, Array]
    times: Array
    planned: Array
    error: Array
    sunk: Array
    coordinates: Array
    status: Status


def outcome(model: RobotModel, record: Record, status: Status, zero: str) -> Outcome:
    """The numbers of a march; zero: what errors count from, "start" (what they are at time 0) or "unloaded" rails."""
    seen, bodies = record.robots, model.system.body
    planned = seen[:, :, SEEN_PLANNED : SEEN_PLANNED + 3]
    error = seen[:, :, SEEN_ACTUAL : SEEN_ACTUAL + 3] - planned
    at_start = error[0].copy()
    if zero == "start":
        error = error - at_start
    phase, size = seen[:, :, SEEN_PHASE], np.linalg.norm(error, axis=2)
    times, sunk = record.coordinates[:, 0, 3], record.grips[:, :, :, SUNK]
    numbers = {
        "cycle_time": model.done.max(),
        "error_at_start": at_start,
        "error_largest": np.abs(error).max(axis=0),
        "error_largest_time": times[np.argmax(size, axis=0)],
        "deflection_largest": np.array([sunk[:, bodies == b].max() for b in range(len(model.rails))]),
        "stress_largest": largest_stress(model, record).max(axis=0),
        "rail_force_largest": record.grips[:, :, :, VERTICAL].max(axis=(0, 2)),
    }
    numbers |= {f"error_{name}": largest(np.where(phase == doing, size, np.nan)) for name, doing in DOING.items()}
    return Outcome(numbers, times, planned, error, sunk, record.coordinates[:, : model.modes, 0], status)


def beyond_rest(found: Outcome, record: Record, resting: Record, tolerance: float) -> Outcome:
    """The same with the largest lengths of what tools are off from where they would rest, and for which part of the
    time that is within a tolerance of the largest error."""
    own, other = (one.robots[:, :, SEEN_ACTUAL : SEEN_ACTUAL + 3] for one in (record, resting))
    size, phase = np.linalg.norm(own - other, axis=2), record.robots[:, :, SEEN_PHASE]
    more = {f"beyond_rest_{name}": largest(np.where(phase == k, size, np.nan)) for name, k in DOING.items()}
    close = size <= tolerance * np.linalg.norm(found.error, axis=2).max(axis=0)
    more["at_rest"] = np.diff(found.times) @ close[1:] / np.ptp(found.times)
    return replace(found, numbers=found.numbers | more)


def without_values(found: Outcome) -> Outcome:
    """The same of a variant that has no values, histories too."""
    fields = ("planned", "error", "sunk", "coordinates")
    nothing = {name: np.full_like(getattr(found, name), np.nan) for name in fields}
    return replace(found, numbers={name: np.full_like(n, np.nan) for name, n in found.numbers.items()}, **nothing)


def largest(sizes: Array) -> Array:
    """(R,) over stations, NaN where there are none."""
    most = np.max(np.nan_to_num(sizes, nan=-1.0), axis=0)
    return np.asarray(np.where(most < 0.0, np.nan, most), dtype=np.float64)


def results_of(model: RobotModel) -> list[str]:
    """What an error is told of, in the order of `differences`."""
    found = [*(f"error of {name}" for name in model.robots), *(f"deflection of {name}" for name in model.rails)]
    return found + [f"stress of {name}" for name, rail in model.rails.items() if is_told(rail.bending)]


def differences(model: RobotModel, one: Outcome, other: Outcome) -> Array:
    """(results,) how far two marches are apart at any station, over the largest length of each robot's error or the
    largest deflection, and of stresses the largest, which alone are reported; NaN where ``other`` has none, infinite
    where ``one`` has none."""
    count = len(results_of(model))
    if not (one.status.values_kept and other.status.values_kept):
        return np.full(count, np.inf if other.status.values_kept else np.nan)
    apart = np.linalg.norm(one.error - other.error, axis=2).max(axis=0)
    size = np.linalg.norm(other.error, axis=2).max(axis=0)
    sunk, bodies = np.abs(one.sunk - other.sunk), model.system.body
    gaps = [sunk[:, bodies == b].max() for b in range(len(model.rails))]
    told = np.array([is_told(rail.bending) for rail in model.rails.values()])
    largest_one, largest_other = (each.numbers["stress_largest"][told] for each in (one, other))
    apart = np.concatenate([apart, gaps, np.abs(largest_one - largest_other)])
    size = np.concatenate([size, other.numbers["deflection_largest"], largest_other])
    found: Array = np.divide(apart, size, out=np.where(apart > 0.0, np.inf, 0.0), where=size > 0.0)
    return found


def stations(found: Outcome) -> Counts:
    """Those of a history, as many of every variant; of a short one some more than once."""
    return np.linspace(0, found.times.size - 1, KEPT).round().astype(np.int64)


def deflections(model: RobotModel, found: Outcome, kept: Counts) -> Array:
    """(stations, B, E + 1) m by which rails are down at the ends of their elements, by their modes; NaN beyond."""
    shape = (kept.size, len(model.rails), int(model.system.tracks[:, ELEMENTS].max()) + 1)
    down = np.full(shape, np.nan)
    for b, rail in enumerate(model.rails.values()):
        first, count = model.system.tracks[b, FIRST], model.system.tracks[b, MODES]
        down[:, b, : rail.ends.size] = -found.coordinates[kept, first : first + count] @ rail.moved[:, VERTICAL].T
    return down


class Way(NamedTuple):
    """A move: the number of its robot, its own number from 1, and when it begins and ends, s."""

    robot: int
    number: int
    start: float
    end: float


def ways(model: RobotModel) -> Iterator[Way]:
    """All moves of all robots in which a joint moves."""
    for r in range(len(model.robots)):
        for m, move in enumerate(model.system.moves[r]):
            length = 2.0 * move[UP] + move[STEADY]
            if np.isfinite(move[START]) and length > 0.0:
                yield Way(r, m + 1, float(move[START]), float(move[START] + length))


def moving_at(model: RobotModel, time: float) -> list[str]:
    """Robots and the numbers of their moves (from 1) that are under way at a time (s)."""
    return [f"move {way.number} of {model.robots[way.robot]}" for way in ways(model) if way.start <= time <= way.end]
