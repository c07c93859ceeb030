"""Marches with more and more steps, and modes of rails where these are open, until what they report stays where it
is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.accuracy.reference import left_over
from engine.kernels.layout import Newmark
from engine.kernels.schemes import SCHEMES, NewmarkScheme
from engine.march.stepper import Halted
from engine.robots.march import march, rest, stretches
from engine.robots.model import build
from engine.robots.results import beyond_rest, differences, outcome
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.status import Status
from results_schema.statuses import gravest

if TYPE_CHECKING:
    from engine.kernels.robots.layout import Record, Stretch
    from engine.robots.model import RobotModel
    from engine.robots.results import Outcome
    from engine.scene.study import Study

#: Steps per first period of the rails on the coarsest level, and modes of each rail where these are open; both double.
#: Three levels of the portal take 84 steps a period from 12 on, 112 from 16 on, 120 from 8 on (tolerance 1e-2).
FIRST_STEPS, FIRST_MODES = 12, 6
LEVELS, MOST_MODES, MOST_STEPS = 7, 64, 2_000_000
ENOUGH = 0.5  # of the tolerance, as in marches of bodies that stand
LEAST_BETA = 1.0 / 12.0  # of Fox-Goodwin: below, the phase is worse again


class Level(NamedTuple):
    """A model, and the stretches of its march."""

    model: RobotModel
    times: Stretch


@dataclass(frozen=True, eq=False)
class Ladder:
    """Levels from coarse to fine over a time (s); step: the longest of the coarsest (s). Stations are the same on all
    levels."""

    study: Study
    coarsest: RobotModel
    duration: float
    step: float

    @classmethod
    def of(cls, study: Study, duration: float | None, after: float) -> Ladder:
        """For a duration, or until all is done and some time ``after`` (s). Raises BadInput."""
        model, fixed = build(with_open_modes(study, FIRST_MODES)), study.solver.steps
        until = float(model.done.max()) + after if duration is None else duration
        step = 2.0 * np.pi / model.first_omega / FIRST_STEPS if fixed == "auto" else until / int(fixed)
        return cls(study, model, until, step)

    @property
    def count(self) -> int:
        """How many levels there are to converge on."""
        return LEVELS if self.study.solver.steps == "auto" else 2

    def level(self, number: int) -> Level | None:
        """A level from 0; None where it would take too many steps or modes."""
        model, every = self.coarsest, 2**number
        is_open = any(body.modes == "auto" for body in self.study.body.values())
        if self.duration / self.step * every > MOST_STEPS or (is_open and FIRST_MODES * every > MOST_MODES):
            return None
        if is_open and number:
            model = build(with_open_modes(self.study, FIRST_MODES * every))
        return Level(model, stretches(model, self.duration, self.step / every, every))


@dataclass(frozen=True, eq=False)
class Converged:
    """What a variant reports: its outcome with the model, the error of every result, steps, the number of its level,
    status."""

    model: RobotModel
    outcome: Outcome
    error: Array
    steps: int
    level: int
    status: Status


def scheme_of(study: Study) -> NewmarkScheme:
    """The scheme of the march: of Newmark's family, whose limit of the step is lifted as joints are stiff; Fox-Goodwin
    where it is left open. Raises BadInput."""
    scheme = SCHEMES["fox-goodwin"]({}) if study.solver.scheme == "auto" else study.solver.integration
    if isinstance(scheme, NewmarkScheme) and scheme.stride == 1 and scheme.beta >= LEAST_BETA:
        return scheme
    raise BadInput(
        "this scheme does not march robots",
        where=study.source.where("solver.scheme"),
        expected="auto, fox-goodwin, average-acceleration, or newmark with beta >= 1/12",
        received=study.solver.scheme,
    )


def with_open_modes(study: Study, count: int) -> Study:
    """The study with so many modes of all bodies whose number is open."""
    is_open = [name for name, body in study.body.items() if body.modes == "auto"]
    return study.with_values({f"body.{name}.modes": min(count, MOST_MODES) for name in is_open}) if is_open else study


def converge(
    study: Study, duration: float | None, after: float, zero: str, halted: Callable[[], bool] = lambda: False
) -> Converged:
    """March a study without sweep level by level, for a duration (s), or until all is done and some time ``after``.
    Raises Halted."""
    return climb(Ladder.of(study, duration, after), zero, halted)


def climb(ladder: Ladder, zero: str, halted: Callable[[], bool] = lambda: False) -> Converged:
    """March level by level until what is held stays. Raises Halted."""
    tolerance = ladder.study.solver.tolerance
    found: Converged | None = None
    change = np.zeros(0)
    for number in range(ladder.count):
        level = ladder.level(number)
        if level is None:
            break
        if halted():
            raise Halted
        record, now = marched(level, zero)
        model, steps = level.model, int(level.times.steps.sum())
        if found is None:
            change = np.full(len(model.robots) + len(model.rails), np.nan)
            found, times = Converged(model, now, change, steps, number, Status.UNRESOLVED), level.times
            continue
        apart = differences(model, found.outcome, now)
        error = left_over(apart, change)
        change, times = apart, level.times
        known = bool(np.isfinite(error).all())
        held = known and bool(error.max() <= tolerance)
        judged = Status.OK if held else Status.TOLERANCE_MISSED if known else Status.UNRESOLVED
        found = Converged(model, now, error, steps, number, Status(int(gravest(judged, now.status))))
        if known and error.max() <= ENOUGH * tolerance:
            break
    assert found is not None
    resting, status = rest(found.model, times)
    whole = Status(int(gravest(found.status, status)))
    return replace(found, outcome=beyond_rest(found.outcome, record, resting), status=whole)


def marched(level: Level, zero: str) -> tuple[Record, Outcome]:
    """The march of a level."""
    scheme = scheme_of(level.model.study)
    record, status = march(level.model, level.times, Newmark(scheme.beta, scheme.gamma))
    return record, outcome(level.model, record, status, zero)


def observed(
    study: Study, duration: float | None, after: float, zero: str, halted: Callable[[], bool] = lambda: False
) -> tuple[Array, Array] | None:
    """What a study without sweep reports, beside one level beyond: how far each result (results,) is off, and the error
    told of it; None where there is no such level, or no values. Raises Halted."""
    ladder = Ladder.of(study, duration, after)
    found = climb(ladder, zero, halted)
    beyond = ladder.level(found.level + 1)
    if beyond is None or not found.status.values_kept:
        return None
    apart = differences(found.model, found.outcome, marched(beyond, zero)[1])
    return (apart, found.error) if np.isfinite(apart).all() else None
