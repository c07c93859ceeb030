"""Marches with more modes of rails, where these are open, or more steps, whichever leaves the larger error, until what
they report stays where it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.accuracy.reference import LEFT_BY_ELEMENTS
from engine.kernels.layout import Newmark
from engine.kernels.schemes import SCHEMES, NewmarkScheme
from engine.march.halting import stop_if_asked
from engine.robots.march import march, rest, stretches
from engine.robots.model import build
from engine.robots.modes import (
    MODES,
    MOST_MISSED,
    MOST_TIMES,
    missed_part,
    open_bodies,
    with_finer_bodies,
    with_modes,
    with_open_modes,
)
from engine.robots.results import (
    are_held,
    are_largest,
    are_of_drives,
    differences,
    of_histories,
    outcome,
    results_of,
    times_apart,
    without_values,
)
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.gravest_status import gravest
from results_schema.status import Status

if TYPE_CHECKING:
    from engine.kernels.robots.layout import Record, Stretch
    from engine.robots.model import RobotModel
    from engine.robots.results import Outcome
    from engine.scene.study import Study

#: Steps per first period of the rails, doubled so often at most. 12 leave 1e-3 to 3e-2 there, 24 an eighth of that.
FIRST_STEPS, REFINED, MOST_STEPS = 12, 6, 2_000_000
#: Of a change, at least told to be left after it: twice the modes left 0.17 to 0.6 of the largest there (0.96 from 10
#: on), twice the steps 0.08 to 0.18. Changes of single results are small by chance, so that 0.7 were left; they count
#: as so much of the largest at least.
LEFT_BY_MODES, LEFT_BY_STEPS, ALIKE = 1.0, 0.5, 0.5
#: The same of steps that a study fixes, which may be too long: with 0.5 one error of 1,000 steps was told 0.64 times.
LEFT_BY_FIXED_STEPS = 1.0
#: So many times more of what drives exert, whose largest values converge by the first power of modes and steps, blows
#: of payloads by less: of 459 errors of 120 random scenes 23 % are told too small, half with 1. With 3.2 one was told
#: 0.18 that is 0.01.
LEFT_OF_DRIVES = 2.5
MOST_ALIKE = 0.75  # ratio of two changes in a row by which the rest is told
WORTH = 0.1  # of the tolerance: what no march is taken to be rid of
LEAST_BETA = 1.0 / 12.0  # of Fox-Goodwin: below, the phase is worse again


class Rung(NamedTuple):
    """How many times modes and steps are refined."""

    modes: int
    steps: int


class Level(NamedTuple):
    """A model, the stretches of its march, and where all would rest at its stations."""

    model: RobotModel
    times: Stretch
    resting: Record


@dataclass(frozen=True, eq=False)
class Ladder:
    """Levels from coarse to fine over a time (s); step: the longest of the coarsest (s); times: so many times `MODES`.
    Stations are the same on all levels."""

    study: Study
    coarsest: RobotModel
    duration: float
    step: float
    times: int = 1

    @classmethod
    def of(cls, study: Study, duration: float | None, after: float) -> Ladder:
        """For a duration, or until all is done and some time ``after`` (s). Raises BadInput."""
        model, fixed = build(with_open_modes(study)), study.solver.steps
        until = float(model.done.max()) + after if duration is None else duration
        step = 2.0 * np.pi / model.first_omega / FIRST_STEPS if fixed == "auto" else until / int(fixed)
        ladder = cls(study, model, until, step)
        while open_bodies(study) and ladder.times < MOST_TIMES and ladder.missed_by(ladder.coarsest) > MOST_MISSED:
            times = 2 * ladder.times
            ladder = replace(ladder, coarsest=build(with_open_modes(study, times * MODES[0])), times=times)
        return ladder

    @property
    def most(self) -> Rung:
        """How often modes and steps may be refined."""
        by_room = int(np.log2(MOST_STEPS * self.step / self.duration).clip(0, REFINED))
        return Rung(int(bool(open_bodies(self.study))), by_room if self.study.solver.steps == "auto" else 1)

    def level(self, rung: Rung) -> Level:
        """The march of a rung."""
        model, every = self.coarsest, 2**rung.steps
        if rung.modes:
            model = build(with_open_modes(self.study, self.times * MODES[rung.modes]))
        return Level(model, stretches(model, self.duration, self.step / every, every), self.resting[0])

    @cached_property
    def resting(self) -> tuple[Record, Status]:
        """Where all would rest, at the stations of all levels, by the coarsest model: what modes miss at rest is
        added."""
        return rest(self.coarsest, stretches(self.coarsest, self.duration, self.step, 1))

    def missed_by(self, model: RobotModel) -> float:
        """Of what robots at rest bend, the part that the modes of a model miss."""
        return missed_part(model, self.resting[0])

    def finer(self, rung: Rung, told: tuple[float, float]) -> Rung | None:
        """The next rung by the errors told of modes and of steps: the larger one is refined where it can be, else the
        other, unless that is in vain. Steps go first until they hold the tolerance: where they are too long, changes by
        modes are five times as large, and are not measured again."""
        tolerance = self.study.solver.tolerance
        too_long = told[1] > tolerance and rung.steps < self.most.steps
        for axis in (1, 0) if too_long else sorted((1, 0), key=lambda number: -told[number]):
            if told[axis] <= WORTH * tolerance:
                return None
            if rung[axis] < self.most[axis]:
                return Rung(rung.modes + (axis == 0), rung.steps + (axis == 1))
            if told[axis] > tolerance:
                return None
        return None


@dataclass(frozen=True, eq=False)
class Converged:
    """What a variant reports: its outcome with the model, the error of every result, and the time (s) at which that
    changed the most by what the larger part of its error is told of, but for what the study fixes; steps, its rung;
    status, which elements and fixed modes leave as it is."""

    model: RobotModel
    outcome: Outcome
    error: Array
    when: Array
    steps: int
    rung: Rung
    status: Status

    @property
    def worst(self) -> float:
        """The largest error of what is held."""
        return float(self.error[are_held(results_of(self.model))].max())


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


def converge(study: Study, duration: float | None, after: float, zero: str) -> Converged:
    """March a study without sweep level by level, for a duration (s), or until all is done and some time ``after``.
    Raises Halted."""
    return climb(Ladder.of(study, duration, after), zero)


def climb(ladder: Ladder, zero: str) -> Converged:
    """March rung by rung until what is held stays. Raises Halted."""
    rung = Rung(0, 0)
    tolerance = ladder.study.solver.tolerance
    level = ladder.level(rung)
    first = now = marched(level, zero)
    names = results_of(level.model)
    held, unknown = are_held(names), np.full(len(names), np.nan)
    by_choice = LEFT_BY_STEPS if ladder.study.solver.steps == "auto" else LEFT_BY_FIXED_STEPS
    times = np.where(are_of_drives(names), LEFT_OF_DRIVES, 1.0)
    least = LEFT_BY_MODES, by_choice
    when, change, told = (
        [unknown, unknown],
        [unknown, unknown],
        [unknown if ladder.most.modes else np.zeros(unknown.size), unknown],
    )
    while not (told[0] + told[1] + now.missed)[held].max() <= tolerance:
        parts = told[0], told[1] + now.missed
        by_modes, by_steps = (float(np.nan_to_num(part[held], nan=np.inf).max()) for part in parts)
        finer = ladder.finer(rung, (by_modes if now.status.values_kept else 0.0, by_steps))
        if finer is None:
            break
        stop_if_asked()
        axis, before, level = int(finer.steps > rung.steps), now, ladder.level(finer)
        now = marched(level, zero)
        apart = alike(differences(level.model, before, now), names)
        told[axis] = times * left(apart, change[axis], least[axis])
        if axis == 0:
            told[0] = np.maximum(told[0], ladder.missed_by(level.model))
        rung, change[axis], when[axis] = finer, apart, times_apart(level.model, before, now)
    error = told[0] + told[1] + now.missed
    judged = Status.UNRESOLVED
    if np.isfinite(error[held]).all():
        judged = Status.OK if error[held].max() <= tolerance else Status.TOLERANCE_MISSED
    whole = Status(int(gravest(Status(int(gravest(judged, now.status))), ladder.resting[1])))
    reported, times = now if whole.values_kept else without_values(now), np.where(told[0] > told[1], *when)
    error = error + by_fixed(ladder, first, zero)
    largest = are_largest(names)
    error[largest] = np.minimum(error[largest], error[of_histories(names)])
    return Converged(level.model, reported, error, times, int(level.times.steps.sum()), rung, whole)


def by_fixed(ladder: Ladder, first: Outcome, zero: str) -> Array:
    """(results,) the error by what a study fixes of its rails, at the ``first`` rung: what twice the elements, and
    twice the modes where it fixes these, change, and what the modes miss. Raises Halted."""
    stop_if_asked()
    study = with_finer_bodies(ladder.study)
    finer = replace(ladder, study=study, coarsest=build(with_open_modes(study, ladder.times * MODES[0])))
    level = finer.level(Rung(0, 0))
    names = results_of(level.model)
    changed = alike(differences(level.model, first, marched(level, zero)), names)
    fixes_modes = len(open_bodies(study)) < len(study.body)
    times = np.where(are_of_drives(names), LEFT_OF_DRIVES, LEFT_BY_ELEMENTS)
    return times * changed + (finer.missed_by(level.model) if fixes_modes else 0.0)


def alike(apart: Array, names: Sequence[str]) -> Array:
    """(results,) changes of a march, those of what is held and of largest values raised to a part of the largest of
    these."""
    raised = apart.copy()
    for own in (are_held(names), are_largest(names)):
        raised[own] = np.maximum(apart[own], ALIKE * apart[own].max())
    return raised


def by_mode_counts(
    study: Study, counts: Sequence[int], duration: float | None, after: float, zero: str
) -> tuple[Array, Array]:
    """(C, R) by how much so many modes of every rail change the errors of tools from what `converge` finds, over the
    longest of each, and (R,) what is told of that. Raises Halted."""
    ladder = Ladder.of(study, duration, after)
    found, robots = climb(ladder, zero), len(study.robot)
    rows = []
    for count in counts:
        stop_if_asked()
        fixed = replace(ladder, coarsest=build(with_modes(study, count))).level(Rung(0, found.rung.steps))
        rows.append(differences(found.model, marched(fixed, zero), found.outcome)[:robots])
    return np.stack(rows), found.error[:robots]


def left(change: Array, before: Array, least: float) -> Array:
    """(results,) what is left of results after a change by twice as many modes or steps, and one before (NaN: none);
    least: of the change."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.nan_to_num(change / before).clip(0.0, MOST_ALIKE)
    return np.where(np.isinf(change), np.nan, change * np.maximum(least, ratio / (1.0 - ratio)))


def marched(level: Level, zero: str) -> Outcome:
    """The march of a level."""
    scheme = scheme_of(level.model.study)
    record, status = march(level.model, level.times, Newmark(scheme.beta, scheme.gamma))
    return outcome(level.model, level.times, record, level.resting, status, zero)


def observed(study: Study, duration: float | None, after: float, zero: str) -> tuple[Array, Array] | None:
    """What a study without sweep reports, beside one level beyond: how far each result (results,) is off, and the error
    told of it; None where there are no values. Raises Halted."""
    ladder = Ladder.of(study, duration, after)
    found = climb(ladder, zero)
    if not found.status.values_kept:
        return None
    beyond = ladder.level(Rung(found.rung.modes + ladder.most.modes, found.rung.steps + 1))
    apart = differences(found.model, found.outcome, marched(beyond, zero))
    return (apart, found.error) if np.isfinite(apart).all() else None
