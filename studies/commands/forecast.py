"""What a run will take, from some seconds of it: how some variants converge, and pilots of a large sweep."""

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from engine.accuracy.groups import ConvergingGroup, Group
from engine.accuracy.jobs import NOBODY, Job
from engine.accuracy.pilots import PILOTS, pilots_of, scenes_of_pilots, usual_pilots
from engine.batch.audit import TABLES, audit_seconds, audited
from engine.batch.execution import warm_up
from engine.batch.executors import Place, Shared, in_processes, place
from engine.batch.plan import Plan
from engine.kernels.compiling import clock_without_compiling
from engine.linear_algebra import one_thread
from engine.march.stepper import Halted
from results_schema.arrays import Counts
from results_schema.cores import cores
from studies.commands import planned_numerics as chosen
from studies.results.formatting import counted
from studies.results.places import spread

SECONDS = 3.0  # that measuring may take
PATIENCE = 10.0  # the same until the first pilots are measured, or variants have converged: nothing is known before
ROUNDS = (16, 64, PILOTS)  # pilots, as long as the next round is expected to end in time
FIRST = 4  # pilots before these, where there are several scenes: of one to four
# What is said of the next five was measured with the built-in studies on two threads; the spread is over these.
BROKEN_OFF = 2.5  # times the seconds after which some pilots were broken off that all of them take: 2 to 3
AUDIT = 1.7  # times the convergence of some variants that an audit takes, one level beyond it: 1.1 to 4.3
UNFINISHED = 2.0  # times the seconds in which variants did not converge that they take
AROUND = 1.6  # times loading and planning: gathering and writing take about half as much
LONGER = 2.5  # times a round that the next one takes: four times the pilots by the same tables
TOGETHER = 32  # variants of a scene that converge together: by 2, 8 and 32 the crane's 5.5 s were told as 3.2, 3.6, 3.8
TIMED = 1024  # variants by which the pace of the march is measured
#: Times the expected seconds that a march takes at most, on processors that are slow: more is what the shortest one
#: takes, 18 ms in place of 7 us, which made 8 minutes of 9 seconds where scenes have one variant each.
SLOWEST = 4.0


class Forecast(NamedTuple):
    """plan: with its choice, where there was time for it. title, rows: the table of what variants are computed with.
    seconds: expected. remark: what could not be measured or held, or ""."""

    plan: Plan
    title: str
    rows: Sequence[tuple[str, ...]]
    seconds: float
    remark: str = ""


class Time(NamedTuple):
    """Until when there is time to measure, usually and for what must be known, by a clock."""

    usual: float
    last: float
    clock: Callable[[], float]


class Looked(NamedTuple):
    """What some variants converged with; seconds that a few of a scene take, in the mean of all that are at work at the
    same time; start: seconds until these are at work; together: how many these few are, in the mean."""

    parts: list[chosen.Part]
    seconds: float
    start: float
    together: float


@one_thread()
def forecast(
    plan: Plan,
    threads: int,
    seconds: float = SECONDS,
    rounds: Sequence[int] = ROUNDS,
    patience: float = PATIENCE,
    compiled: float = 0.0,
) -> Forecast:
    """What is measured within so many seconds: as many pilots as there is time for, or how some variants converge;
    first of all there is more ``patience``. That kernels are compiled does not count; compiled: seconds of that
    before."""
    around = AROUND * (time.process_time() - compiled)
    warm_up(plan)
    with clock_without_compiling() as clock:
        until = Time(clock() + seconds, clock() + patience, clock)
        with _where_it_runs(plan, threads) as here:
            if plan.converges:
                found = _of_convergence(plan, _converge(plan, here, until), here.slots)
            else:
                found = _choose(plan, here, until, rounds)
    return found._replace(seconds=found.seconds + around)


def _where_it_runs(plan: Plan, threads: int) -> AbstractContextManager[Place]:
    """Where a run does its jobs, on so many threads or cores."""
    return in_processes({}) if plan.many_scenes and threads == cores() else place(threads)


def _past(end: float, clock: Callable[[], float]) -> bool:
    return clock() > end


def _converge(plan: Plan, here: Place, until: Time) -> Looked:
    """Some variants, a few of each of some scenes, as they converge where a run computes them."""
    share = Shared(here, partial(_past, until.last, until.clock))
    jobs, parts, started, done = _samples(plan, 2 * here.slots), list[chosen.Part](), until.clock(), 0
    Shared(here)(plan, [Job(_awake, NOBODY)] * here.slots)
    awake, started = until.clock() - started, until.clock()
    try:  # modes of bodies, which all scenes of a process share: a run computes them once
        share(plan, [Job(jobs[0].function, jobs[0].lanes[:1])] * here.slots)
    except Halted:
        return Looked([], 0.0, awake + UNFINISHED * (until.clock() - started), 1.0)
    first, started = until.clock() - started, until.clock()
    for some in (jobs[::2], jobs[1::2]):
        if done and (until.clock() - started > until.usual - until.clock() or not some):
            break
        try:
            parts += [part for found in share(plan, some) for part in found]
        except Halted:
            took = UNFINISHED * (until.clock() - started) / len(some)
            return Looked(parts, took, awake, len(parts) / max(done, 1))
        done += len(some)
    took = (until.clock() - started) / done
    return Looked(parts, took, awake + max(0.0, first - took * here.slots), len(parts) / done)


def _samples(plan: Plan, count: int) -> list[Job[list[chosen.Part]]]:
    """So many jobs or a few more, each that some variants of a scene converge, of scenes far apart."""
    scenes, jobs = spread(len(plan.grids), count), list[Job[list[chosen.Part]]]()
    each = -(-count // len(scenes))
    for scene in scenes:
        some = plan.members[scene][spread(plan.members[scene].size, each * TOGETHER)]
        own = partial(_converged, scene=int(scene))
        jobs += [Job(own, part) for part in np.array_split(some, each) if part.size]
    return jobs


def _converged(plan: Plan, lanes: Counts, halted: Callable[[], bool], scene: int) -> list[chosen.Part]:
    """What some variants of a scene converge with."""
    group = ConvergingGroup(plan.grids[scene], plan.members[scene])
    values = plan.values(group, lanes)
    return list(chosen.converged(plan, group.found(values, lanes, None, halted), values.tighter))


def _of_convergence(plan: Plan, looked: Looked, threads: int) -> Forecast:
    """A study whose variants all converge by themselves, each chunk with tables of its own."""
    chunks = sum(1 for _ in plan.chunks(None, None))
    filled = looked.together * chunks / plan.size  # chunks, by as many variants as were looked at together
    at_once, in_turns = looked.seconds * threads / max(filled, 1.0), -(-chunks // threads)
    more = max(0.0, 1.0 - filled)
    seconds = looked.start + at_once * in_turns + more * plan.seconds / min(threads, chunks)
    if not looked.parts:
        less = f"{PATIENCE:.0f} seconds were not enough for a variant to converge: this may take longer"
        return Forecast(plan, "", (), max(seconds, _at_least(plan, threads)), less)
    seconds += AUDIT * at_once * -(-min(len(plan.grids), audited(plan)) // threads)
    title = f"What {counted(len(looked.parts), 'variant')} converged with; in a run every variant does by itself"
    return _told(plan, title, looked.parts, seconds)


def _told(plan: Plan, title: str, parts: Sequence[chosen.Part], seconds: float) -> Forecast:
    return Forecast(plan, title, chosen.rows(plan, parts), seconds, chosen.told_missed(plan, parts))


def _at_least(plan: Plan, threads: int) -> float:
    """Seconds that the marches of a plan are expected to take, with tables of the largest, where none was measured."""
    each = [group.seconds_per_variant for group in plan.groups]
    return (plan.seconds + TABLES * max(each, default=0.0)) / threads


def _without_pilots(plan: Plan, tried: float, threads: int) -> Forecast:
    """A study whose pilots take longer than there is time; tried: seconds after which the first of them, of one scene
    or of a few, were broken off, 0 where there was no time to begin."""
    pilots = pilots_of(plan.cases, plan.members).size
    scenes = scenes_of_pilots(len(plan.grids), plan.size, usual_pilots(plan.size))
    few = scenes_of_pilots(len(plan.grids), plan.size, FIRST)
    more = "there was no time for pilots, variants that are measured first"
    remark = f"{more}: a run has {pilots} of them, and takes what they show to be enough; this may take longer"
    seconds = max(BROKEN_OFF * tried * scenes / few, _at_least(plan, threads))
    return Forecast(plan, "", (), seconds, remark)


def _choose(plan: Plan, here: Place, until: Time, rounds: Sequence[int]) -> Forecast:
    """More and more pilots, as many as there is time for."""
    found, start, tried = None, 0.0, 0.0
    for pilots in (*(FIRST,) * (len(plan.grids) > 1), *rounds):
        trial, started = replace(plan), until.clock()
        end, expected = (until.last, 0.0) if found is None else (until.usual, LONGER * found.took)
        if started + expected > end:
            break
        share = Shared(here, partial(_past, end, until.clock))
        try:
            if found is None:
                share(plan, [Job(_awake, NOBODY)] * here.slots)
                start, started = until.clock() - started, until.clock()
            trial.choose(share, pilots)
        except Halted:
            tried = until.clock() - started
            break
        found = _Round(trial, pilots, until.clock() - started)
    if found is None:
        return _without_pilots(plan, tried, here.slots)
    return _of_pilots(found, here.slots, start, until.clock)


def _awake(plan: Plan, lanes: Counts, halted: Callable[[], bool]) -> None:
    """A job that loads the kernels."""
    warm_up(plan)


class _Round(NamedTuple):
    """Pilots that were measured: the plan with what they chose, how many were wanted, and their seconds."""

    trial: Plan
    pilots: int
    took: float


def _of_pilots(found: _Round, threads: int, start: float, clock: Callable[[], float]) -> Forecast:
    """A study of which some pilots are measured; start: seconds until its processes have started."""
    plan, usual = found.trial, usual_pilots(found.trial.size)
    measured, drawn = (pilots_of(plan.cases, plan.members, count).size for count in (found.pilots, PILOTS))
    scenes, more_scenes = (
        scenes_of_pilots(len(plan.grids), plan.size, count) for count in (found.pilots, max(usual, found.pilots))
    )
    more = "" if measured >= drawn else f"; a run measures {drawn} and knows better"
    title = f"What variants are computed with, by the measured errors of {measured} pilots{more}"
    group = max(plan.groups, key=lambda group: group.seconds_per_variant * group.variants.size)
    pace, tables = _pace(plan, group, clock)
    march = plan.seconds * pace + tables * len(plan.groups)
    # Of one scene more pilots march by the same tables.
    assert plan.choice is not None
    marched = plan.choice.measured.work * group.seconds_per_variant / group.work * pace
    again = max(0.0, drawn / measured - more_scenes / scenes) * marched
    pilots = found.took * more_scenes / scenes + again / threads
    march += audit_seconds(plan) * pace
    return _told(plan, title, chosen.chosen(plan), start + pilots + march / threads)


def _pace(plan: Plan, group: Group, clock: Callable[[], float]) -> tuple[float, float]:
    """Time of the march of a group over the expected, and seconds that its tables take, and what a march takes however
    short it is."""
    variants, took = group.variants[:TIMED], list[float]()
    for _ in ("makes the tables", "marches"):
        started = clock()
        group.found(plan.values(group, variants), variants, plan.choice, lambda: False)
        took.append(clock() - started)
    expected, tables = group.seconds_per_variant * variants.size, max(0.0, took[0] - took[1])
    pace = min(took[1] / expected, SLOWEST) if expected > 0.0 else 1.0
    return pace, tables + took[1] - pace * expected
