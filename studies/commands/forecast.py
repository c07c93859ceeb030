"""What a run will take, from about a second of it: pilots of a large sweep, or some variants of a small one."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from engine.accuracy.choice import MOST_SCENES, PILOTS, usual_pilots
from engine.accuracy.groups import ConvergingGroup, Group
from engine.batch.execution import run_jobs, warm_up
from engine.batch.plan import Plan
from engine.kernels.layout import LANES
from engine.linear_algebra import one_thread
from engine.march.stepper import Halted
from studies.commands import planned_numerics as chosen
from studies.results.formatting import counted
from studies.results.results import spread

SECONDS = 1.0  # that measuring may take
ROUNDS = (16, 64, PILOTS)  # pilots, as long as the next round is expected to end in time
CLIMB = 5.0  # times the convergence of a few variants that as many pilots take on the ladder
LONGER = 2.5  # times a round that the next one takes: four times the pilots by the same tables
CONVERGED, SCENES = 8, 3  # variants that converge, and scenes that they are of
TIMED = 1024  # variants by which the pace of the march is measured


class Forecast(NamedTuple):
    """plan: with its choice, where there was time for it. title, rows: the table of what variants are computed with.
    seconds: expected. remark: what could not be measured, or ""."""

    plan: Plan
    title: str
    rows: Sequence[tuple[str, ...]]
    seconds: float
    remark: str = ""


class Looked(NamedTuple):
    """What some variants converged with, and the seconds that 16 of a scene take."""

    parts: list[chosen.Part]
    seconds: float


@one_thread()
def forecast(plan: Plan, threads: int, seconds: float = SECONDS, rounds: Sequence[int] = ROUNDS) -> Forecast:
    """What is measured within about a second: how some variants converge, then as many pilots as there is time for."""
    warm_up(plan)
    end = time.perf_counter() + seconds
    groups = [ConvergingGroup(*scene) for scene in zip(plan.grids, plan.members, strict=True)]
    looked = _converge(plan, groups, partial(_past, end))
    if plan.converges:
        return _of_convergence(plan, looked, threads)
    found = _choose(plan, threads, looked, end, rounds)
    return _without_pilots(plan, looked) if found is None else found


def _past(end: float) -> bool:
    return time.perf_counter() > end


def _converge(plan: Plan, groups: Sequence[Group], halted: Callable[[], bool]) -> Looked:
    """Some variants of a few scenes, as they converge."""
    parts: list[chosen.Part] = []
    seconds, some = 0.0, [groups[place] for place in spread(len(groups), SCENES)]
    with suppress(Halted):
        for group in some:
            variants, started = group.variants[spread(group.variants.size, CONVERGED // len(some))], time.perf_counter()
            parts += chosen.converged(plan, group.found(plan.values(group, variants), variants, None, halted))
            seconds = max(seconds, time.perf_counter() - started)
    return Looked(parts, seconds)


def _of_convergence(plan: Plan, looked: Looked, threads: int) -> Forecast:
    """A study whose variants all converge by themselves."""
    blocks = sum(-(-members.size // LANES) for members in plan.members)  # one takes as long as a few variants
    if not looked.parts:
        less = "a second was not enough for a variant to converge: this may take longer"
        return Forecast(plan, "", (), max(plan.seconds, SECONDS * blocks) / min(threads, blocks), less)
    title = f"What {counted(len(looked.parts), 'variant')} converged with; in a run every variant does by itself"
    return Forecast(plan, title, chosen.rows(looked.parts), looked.seconds * blocks / min(threads, blocks))


def _without_pilots(plan: Plan, looked: Looked) -> Forecast:
    """A study whose pilots take longer than there is time."""
    pilots = usual_pilots(plan.size)
    less = f"a second was not enough for pilots: a run measures {pilots}, and takes what they show to be enough"
    climbs = CLIMB * max(min(len(plan.grids), MOST_SCENES), pilots // 64)
    if not looked.parts:
        return Forecast(plan, "", (), climbs * SECONDS, f"{less}; this may take longer")
    title = f"What {counted(len(looked.parts), 'variant')} converged with; a run takes no more than it needs"
    return Forecast(plan, title, chosen.rows(looked.parts), climbs * looked.seconds, less)


def _choose(plan: Plan, threads: int, looked: Looked, end: float, rounds: Sequence[int]) -> Forecast | None:
    """More and more pilots, as many as there is time for; None where there is none."""
    found, took = None, CLIMB * looked.seconds / LONGER
    for pilots in rounds:
        trial, started = replace(plan), time.perf_counter()
        if not looked.parts or started + LONGER * took > end:
            break
        try:
            trial.choose(partial(run_jobs, threads=threads), partial(_past, end), pilots)
        except Halted:
            break
        took = time.perf_counter() - started
        found = trial, pilots, took
    if found is None:
        return None
    trial, pilots, took = found
    usual = usual_pilots(plan.size)
    more = "" if pilots >= usual else f"; a run measures {usual} and knows better"
    title = f"What variants are computed with, by the measured errors of {min(pilots, usual)} pilots{more}"
    seconds = took * max(1.0, usual / pilots) ** 0.5 + trial.seconds * _pace(trial) / threads
    return Forecast(trial, title, chosen.rows(chosen.chosen(trial)), seconds)


def _pace(plan: Plan) -> float:
    """Time of the march over the expected, by the group that takes most of it."""
    group = max(plan.groups, key=lambda group: group.seconds_per_variant * group.variants.size)
    variants, took = group.variants[:TIMED], 0.0
    for _ in ("makes the tables", "marches"):
        started = time.perf_counter()
        group.found(plan.values(group, variants), variants, plan.choice, lambda: False)
        took = time.perf_counter() - started
    expected = group.seconds_per_variant * variants.size
    return took / expected if expected > 0.0 else 1.0
