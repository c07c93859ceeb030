"""The numbers that a march of robots on rails reports, and how far two marches differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.kernels.robots.layout import (
    ELEMENTS,
    FIRST,
    HOLDS,
    JOINTS,
    MODES,
    MOVES,
    OF_GRIP,
    OFF,
    PASSED,
    PASSED_GRIPS,
    SEEN_ACTUAL,
    SEEN_PLANNED,
    SLIDES,
    START,
    STEADY,
    SUNK,
    UP,
    VERTICAL,
    WORKS,
)
from engine.robots.march import doing
from engine.robots.peaks import Steps, peaks
from engine.robots.shortening import beyond_linear
from engine.robots.stress import is_told, stress_at_steps
from results_schema.arrays import Array, Counts, Mask
from results_schema.status import Status

if TYPE_CHECKING:
    from engine.kernels.robots.layout import Record, Stretch
    from engine.robots.model import RobotModel

DOING = {"moving": MOVES, "working": WORKS, "holding": HOLDS}
OF_DRIVES = {"drive_force_largest": "drive force", "drive_torque_largest": "drive torque"}
OF_TOOLS = [f"{what}_{doing}" for what in ("error", "beyond_rest") for doing in DOING]
LARGEST = "largest "  # before the name of what has a history
KEPT = 800  # stations of a history


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a variant reports by one march: numbers by name, over robots (R,), components (R, 3) or rails (B,); missed
    (results,): by how much what each error is told of may be larger between steps, over the largest; at all S
    stations: times (S,), planned tool centre points and their errors (S, R, 3), rails under robots (S, R, 2)."""

    numbers: dict[str, Array]
    missed: Array
    times: Array
    planned: Array
    error: Array
    sunk: Array
    drives: Array
    coordinates: Array
    status: Status


def outcome(model: RobotModel, cut: Stretch, record: Record, resting: Record, status: Status, zero: str) -> Outcome:
    """The numbers of a march; resting: at the same stations, where all would rest; zero: what errors count from,
    "start" (what they are at time 0) or "unloaded" rails."""
    steps, at_start = Steps.of(cut), _off(record)[0].copy()
    zero_at = at_start if zero == "start" else np.zeros_like(at_start)
    tools, of_tools = _tools(model, record, resting, steps, doing(model, cut)[steps.stretch], zero_at)
    rails, of_rails = _rails(model, steps, record)
    longest = np.fmax.reduce([tools[f"error_{doing}"] for doing in DOING])
    pressed = peaks(record.passed[:, :, PASSED_GRIPS + VERTICAL : PASSED : OF_GRIP], steps.stretch).value.max(axis=1)
    numbers = {"cycle_time": model.done.max(), "error_at_start": at_start, "rail_force_largest": pressed}
    drives, of_drives = _drives(model, steps, record)
    numbers["beyond_linear"] = beyond_linear(model, record, longest)
    return Outcome(
        numbers | tools | rails | drives,
        np.concatenate([of_tools, *of_rails, of_drives, of_tools, of_rails[0]]),
        record.coordinates[:, 0, 3],
        record.robots[:, :, SEEN_PLANNED : SEEN_PLANNED + 3],
        _off(record) - zero_at,
        record.grips[:, :, :, SUNK],
        record.drive,
        record.coordinates[:, : model.modes, 0],
        status,
    )


def _off(record: Record) -> Array:
    """(S, R, 3) actual less planned tool centre points at stations."""
    actual, planned = (record.robots[:, :, first : first + 3] for first in (SEEN_ACTUAL, SEEN_PLANNED))
    return np.asarray(actual - planned)


def _tools(
    model: RobotModel, record: Record, resting: Record, steps: Steps, done: Counts, zero_at: Array
) -> tuple[dict[str, Array], Array]:
    """The numbers of tools, and what is missed of them (R,) over the longest error: what they are off, what they are
    off from where they would rest, and for which part of the time that is within a tolerance of the longest error."""
    off = record.passed[:, :, OFF : OFF + 3]
    sizes = {
        "error": np.linalg.norm(off - zero_at, axis=2),
        "beyond_rest": np.linalg.norm(off - steps.between_stations(_off(resting)), axis=2),
    }
    found = {
        f"{name}_{doing}": peaks(size, steps.stretch, done == phase)
        for name, size in sizes.items()
        for doing, phase in DOING.items()
    }
    longest = sizes["error"].max(axis=0)
    close = sizes["beyond_rest"] <= model.study.solver.tolerance * longest
    numbers = {name: one.value for name, one in found.items()} | {
        "error_largest": peaks(np.abs(off - zero_at), steps.stretch).value,
        "error_largest_time": steps.times[np.argmax(sizes["error"], axis=0)],
        "at_rest": np.diff(steps.times) @ close[1:] / np.ptp(steps.times),
    }
    return numbers, over(np.max([one.missed for one in found.values()], axis=0), longest)


def _rails(model: RobotModel, steps: Steps, record: Record) -> tuple[dict[str, Array], tuple[Array, Array]]:
    """Deflections and stresses of rails (B,), and what is missed of deflections and of stresses that are told, over
    them."""
    sunk, bodies = peaks(record.passed[:, :, PASSED_GRIPS + SUNK : PASSED : OF_GRIP], steps.stretch), model.system.body
    down, missed = (np.array([part[bodies == b].max() for b in range(len(model.rails))]) for part in sunk)
    stresses = [stress_at_steps(model, b, steps, record) for b in range(len(model.rails))]
    stress = peaks(np.stack(stresses, axis=1), steps.stretch)
    told = np.array([is_told(rail.bending) for rail in model.rails.values()])
    numbers = {"deflection_largest": down, "stress_largest": stress.value}
    return numbers, (over(missed, down), over(stress.missed, stress.value)[told])


def _drives(model: RobotModel, steps: Steps, record: Record) -> tuple[dict[str, Array], Array]:
    """(R, J) the largest force or torque of drives, NaN where a joint is of the other sort or is none, and what is
    missed of them, as `by_drives` has it."""
    largest, missed = peaks(np.abs(record.passed[:, :, PASSED:]), steps.stretch)
    numbers, parts = (
        {name: np.where(own, each, np.nan) for name, own in _joints(model).items()} for each in (largest, missed)
    )
    return numbers, by_drives(model, parts, numbers)


def _joints(model: RobotModel) -> dict[str, Mask]:
    """(R, J) whose drives exert forces, and whose torques."""
    slides = model.system.chain[:, :, SLIDES] > 0.0
    there = np.arange(slides.shape[1]) < model.system.counts[:, JOINTS, None]
    return dict(zip(OF_DRIVES, (slides & there, ~slides & there), strict=True))


def by_drives(model: RobotModel, parts: Mapping[str, Array], largest: Mapping[str, Array]) -> Array:
    """(drives,) the largest part (R, J) of what the drives of a robot exert over the largest of that sort, of the
    robots that have joints of that sort."""
    found = []
    for name, own in _joints(model).items():
        has = own.any(axis=1)
        found.append(over(*(np.fmax.reduce(each[name][has], axis=1) for each in (parts, largest))))
    return np.concatenate(found)


def over(part: Array, whole: Array) -> Array:
    """A part of a whole; infinite, or 0 with the part, where that is nothing."""
    return np.divide(part, whole, out=np.where(part > 0.0, np.inf, 0.0), where=whole > 0.0)


def without_values(found: Outcome) -> Outcome:
    """The same of a variant that has no values, histories too."""
    fields = ("missed", "planned", "error", "sunk", "drives", "coordinates")
    nothing = {name: np.full_like(getattr(found, name), np.nan) for name in fields}
    return replace(found, numbers={name: np.full_like(n, np.nan) for name, n in found.numbers.items()}, **nothing)


def results_of(model: RobotModel) -> list[str]:
    """What an error is told of, in the order of `differences`: over all of the time and, of what has histories, of the
    largest values alone."""
    moving = [*(f"error of {name}" for name in model.robots), *(f"deflection of {name}" for name in model.rails)]
    found = moving + [f"stress of {name}" for name, rail in model.rails.items() if is_told(rail.bending)]
    some = {name: np.flatnonzero(own.any(axis=1)) for name, own in _joints(model).items()}
    found += [f"{OF_DRIVES[name]} of {model.robots[r]}" for name, own in some.items() for r in own]
    return found + [f"{LARGEST}{name}" for name in moving]


def are_held(results: Sequence[str]) -> Mask:
    """(results,) what is held to the tolerance: all but drives, and largest values apart from their histories."""
    return ~are_of_drives(results) & ~are_largest(results)


def are_of_drives(results: Sequence[str]) -> Mask:
    """(results,) what drives exert."""
    return np.array([name.startswith("drive") for name in results])


def of_histories(results: Sequence[str]) -> Counts:
    """(largest,) the places of histories, in the order of their largest values."""
    names = list(results)
    return np.array([names.index(name.removeprefix(LARGEST)) for name in names if name.startswith(LARGEST)])


def are_largest(results: Sequence[str]) -> Mask:
    """(results,) the largest values of what has histories."""
    return np.array([name.startswith(LARGEST) for name in results])


def differences(model: RobotModel, one: Outcome, other: Outcome) -> Array:
    """(results,) how far two marches are apart at any station and in the largest values that are reported, and in these
    alone, over the largest length of each robot's error, the largest deflection or the largest of its drives, and of
    stresses the largest, which alone are reported; NaN where ``other`` has none, infinite where ``one`` has none."""
    count = len(results_of(model))
    if not (one.status.values_kept and other.status.values_kept):
        return np.full(count, np.inf if other.status.values_kept else np.nan)
    own, finer = one.numbers, other.numbers
    tools = [np.abs(own[name] - finer[name]) for name in OF_TOOLS]  # what a robot never does has no number
    tools.append(np.abs(own["error_largest"] - finer["error_largest"]).max(axis=1))
    down = np.abs(own["deflection_largest"] - finer["deflection_largest"])
    largest = np.concatenate([np.fmax.reduce(tools), down])
    sunk, bodies = np.abs(one.sunk - other.sunk), model.system.body
    rails = [sunk[:, bodies == b].max() for b in range(len(model.rails))]
    moving = np.concatenate([np.linalg.norm(one.error - other.error, axis=2).max(axis=0), rails])
    size = np.concatenate([np.linalg.norm(other.error, axis=2).max(axis=0), finer["deflection_largest"]])
    told = np.array([is_told(rail.bending) for rail in model.rails.values()])
    stress, other_stress = (each["stress_largest"][told] for each in (own, finer))
    at_stations = np.abs(one.drives - other.drives).max(axis=0)
    drives = {n: np.maximum(at_stations, abs(own[n] - finer[n])) for n in OF_DRIVES}
    return np.concatenate(
        [
            over(np.maximum(moving, largest), size),
            over(np.abs(stress - other_stress), other_stress),
            by_drives(model, drives, finer),
            over(largest, size),
        ]
    )


def times_apart(model: RobotModel, one: Outcome, other: Outcome) -> Array:
    """(results,) s: when two marches are apart the most; NaN for stresses, of which the largest alone are compared, and
    for drives."""
    if not (one.status.values_kept and other.status.values_kept):
        return np.full(len(results_of(model)), np.nan)
    tools, sunk = np.linalg.norm(one.error - other.error, axis=2), np.abs(one.sunk - other.sunk)
    rails = [sunk[:, model.system.body == b].max(axis=1) for b in range(len(model.rails))]
    apart = np.concatenate([tools, np.stack(rails, axis=1)], axis=1)
    found = np.full(len(results_of(model)), np.nan)
    found[: apart.shape[1]] = one.times[np.argmax(apart, axis=0)]
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


def works(model: RobotModel) -> Iterator[Way]:
    """When robots work, after which moves."""
    for r in range(len(model.robots)):
        for m, move in enumerate(model.system.moves[r]):
            arrived, until = float(move[START] + 2.0 * move[UP] + move[STEADY]), float(model.system.stays[r, m + 1, -1])
            if until > arrived:
                yield Way(r, m + 1, arrived, until)


def handled(model: RobotModel) -> Iterator[tuple[int, float, bool]]:
    """Robots, the times (s) of payloads that they are told to pick up or put down, and whether they pick them up."""
    for r, robot in enumerate(model.study.robot.values()):
        carried = robot.payload
        for move, start in zip(robot.moves, model.system.moves[r, :, START], strict=False):
            now = carried if move.payload is None else move.payload
            if now != carried:
                yield r, float(start), now > carried
            carried = now


def moving_at(model: RobotModel, time: float) -> list[str]:
    """Robots and the numbers of their moves (from 1) that are under way at a time (s)."""
    return [f"move {way.number} of {model.robots[way.robot]}" for way in ways(model) if way.start <= time <= way.end]
