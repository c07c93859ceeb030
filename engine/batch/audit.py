"""The audit of a study: some of its variants, none of them a pilot, beside marches of one level more than the
references of pilots have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from engine.accuracy.climb import REFERENCE_PART
from engine.accuracy.grids import SceneGrid
from engine.accuracy.groups import PACE
from engine.accuracy.jobs import Crashed, Halted, Job, Share, over_scenes
from engine.accuracy.pilots import usual_pilots
from engine.accuracy.reference import (
    IN_TURN,
    Beyond,
    Converged,
    Marches,
    converge,
    in_full,
    is_last,
    passages,
    usual_work,
)
from engine.accuracy.results import differences, results_of
from engine.batch.chunk import told_errors
from engine.batch.plan import Plan
from engine.kernels.layout import LANES
from engine.march.outcome import USED, Flat
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts, Mask
from results_schema.gravest_status import lost

SEED = 7717  # of the variants that are drawn; pilots have another
PART, FEWEST, MOST = 0.01, 16, 256  # of all variants, where their number is left open: 256 show a miss in a hundred
MOST_TIME, FREE_SECONDS = 0.3, 2.0  # of the run's expected time; and what may be spent whatever that is
AT_ONCE, LOOKED_AT = 2**18, 64  # variants whose work is estimated at once; scenes, of many
TABLES = 30  # variants at PACE that take as long as the tables of a march: 29 to 49 with 32 and 16 modes
#: Modes x steps at PACE of the tables of all levels, and the work of an audit over that of the references of pilots:
#: ten audits of 64 took 0.3 to 1.7 times as long as by these two.
TABLES_OF_AUDITS, FURTHER = 5e8, 5.0
#: Work of an audit over that of the march beside which it goes a level further, with twice the modes and four times the
#: steps: of variants of 48 scenes, each by itself, eight in ten took 0.3 to 5 times as long as by this, by the levels
#: that most take 0.2 to 6 times.
BEYOND = 14.0
#: Modes x steps over the whole time of a variant, some ten milliseconds, from which on it takes no level more than it
#: needs to be known.
DEAR = 1e7
NUMBERS_ALONE = 0.0  # of what histories differ by: what is judged are the numbers that are told
_NONE = np.zeros((0, 0)), np.zeros((0, 0))


class Audit(NamedTuple):
    """n variants that were audited, by their flat numbers: observed and told errors, and those of the truth itself (R,
    n); variants whose truth is not known are left out."""

    variants: Counts
    observed: Array
    told: Array
    doubt: Array
    left_out: int

    @classmethod
    def of_each(cls, found: Mapping[int, tuple[Array, Array] | None]) -> Audit:
        """Observed and told errors (R,) of every variant; None where they are not known."""
        known = {variant: pair for variant, pair in sorted(found.items()) if pair is not None}
        observed, told = (np.stack([pair[k] for pair in known.values()], axis=1) for k in (0, 1)) if known else _NONE
        variants = np.array(list(known), dtype=np.int64)
        return cls(variants, observed, told, np.full_like(observed, np.nan), len(found) - len(known))


def sampled(plan: Plan, used: Flat | None = None) -> Counts:
    """The variants to audit, drawn at random by the study alone: where their number is left open 1 % of them, 16 to
    256, as many as take 30 % of the run's time or 2 s. used: what all variants took, where that is known."""
    pilots = np.zeros(0, dtype=np.int64) if plan.choice is None else plan.choice.pilots
    return drawn(plan.size, audited(plan, used), pilots)


def audited(plan: Plan, used: Flat | None = None) -> int:
    """How many variants are audited."""
    wanted = plan.study.solver.audit
    return audit_size(plan, used) if wanted == "auto" else min(int(wanted), plan.size)


def drawn(size: int, count: int, but: Counts | tuple[()] = ()) -> Counts:
    """So many of ``size`` variants, none of some of them."""
    first = np.random.default_rng(SEED).permutation(size)[: count + len(but)]
    return np.sort(first[~np.isin(first, but)][:count])


def audit_size(plan: Plan, used: Flat | None = None) -> int:
    """How many variants are audited where the study leaves that open."""
    if plan.choice is None:
        works = _works_of_some(plan) if used is None else _works_beyond(plan, used)
        return enough(plan.size, plan.seconds, partial(_seconds, plan, works))
    # What pilots and their references took, in the mean, is known.
    pilots = usual_pilots(plan.size) * plan.choice.measured.work / plan.choice.pilots.size
    return enough(plan.size, plan.seconds + _units(plan) * pilots / PACE, partial(_by_references, plan))


def audit_seconds(plan: Plan) -> float:
    """Expected time at PACE, on one thread, of the audit of a plan whose pilots are measured."""
    count = audited(plan)
    return _by_references(plan, count) if count else 0.0


def _by_references(plan: Plan, count: int) -> float:
    """The same of so many variants, by what the references of pilots took."""
    assert plan.choice is not None
    further = FURTHER * float(plan.choice.measured.spent.mean())
    return (TABLES_OF_AUDITS + _units(plan) * further * count) / PACE


def _units(plan: Plan) -> float:
    """Passages or cycles of a march, in the mean of the scenes."""
    return float(np.mean([passages(grid) for grid in plan.grids]))


def enough(size: int, whole: float, seconds: Callable[[int], float]) -> int:
    """How many of ``size`` variants are audited in a run that takes some time (s); seconds: of an audit of so many."""
    count = int(np.clip(np.rint(PART * size), min(FEWEST, size), MOST))
    while count and seconds(count) > max(MOST_TIME * whole, FREE_SECONDS):
        count //= 2
    return count


def _dear(plan: Plan) -> float:
    """Modes x steps from which on a reference needs no further level. Variants that converge may have come as far, so
    that only a further level is a second source of them."""
    return math.inf if plan.converges else DEAR


def _works_of_some(plan: Plan) -> list[tuple[Array, Counts]]:
    """What `_works` finds of some scenes, each for as many as there are, with what a tie more takes."""
    some = plan.grids[:: -(-len(plan.grids) // LOOKED_AT)]
    found = [(grid.scene.ties**1.2, *_works(grid, _dear(plan))) for grid in some]
    return [(len(plan.grids) / len(some) * ties * work, number) for ties, work, number in found]


def _works_beyond(plan: Plan, used: Flat) -> list[tuple[Array, Counts]]:
    """The same by what the variants took."""
    each = np.nan_to_num(used["modes_used"] * np.asarray(used["steps_used"], dtype=np.float64))
    some = list(zip(plan.grids, plan.members, strict=True))[:: -(-len(plan.grids) // LOOKED_AT)]
    found = []
    for grid, members in some:
        work, number = np.unique(each[members], return_counts=True)
        times = len(plan.grids) / len(some) * BEYOND * grid.scene.ties**1.2 * passages(grid)
        found.append((times * work, number))
    return found


def _seconds(plan: Plan, works: Sequence[tuple[Array, Counts]], count: int) -> float:
    """Expected time of an audit on one thread."""
    share, found = min(1.0, count / plan.size), 0.0
    for work, number in works:
        # each march has its tables, and whole blocks
        own = share * number
        lanes = np.maximum(own, LANES * np.minimum(1.0, own)) + TABLES * np.minimum(1.0, own)
        found += float(work @ lanes) / PACE
    return found


def _works(grid: SceneGrid, dear: float) -> tuple[Array, Counts]:
    """The different modes x steps of a scene's audits, and how many variants have them."""
    found = []
    for first in range(0, grid.values.size, AT_ONCE):
        some = np.arange(first, min(first + AT_ONCE, grid.values.size))
        found.append(np.unique(usual_work(grid, grid.values.part(some), dear), return_counts=True))
    works, numbers = (np.concatenate(column) for column in zip(*found, strict=True))
    work, place = np.unique(works, return_inverse=True)
    return work, np.bincount(place, numbers).astype(np.int64)


def may_go_further(plan: Plan, variants: Counts, used: Flat) -> Mask:
    """Which of some variants were computed (``used``, by the names of the archive) with less than audits have at most:
    of the others no march is finer."""
    found = np.ones(variants.size, dtype=np.bool_)
    for grid, members in zip(plan.grids, plan.members, strict=True):
        own = np.flatnonzero(_among(variants, members, plan.size))
        if own.size:
            values = VariantValues.of(grid.scene.study, plan.cases, variants[own])
            found[own] = ~is_last(grid, values, in_full(grid), {name: used[name][own] for name in USED})
    return found


def audit(plan: Plan, variants: Counts, share: Share = IN_TURN) -> Audit:
    """Compute some variants again, by jobs that ``share`` does: the marches of a single scene, or scenes as wholes.
    Raises Halted, and Crashed by flat numbers of variants."""
    parts = [variants[_among(variants, members, plan.size)] for members in plan.members]
    found = over_scenes(share, plan, _of_scene, parts)
    return joined([one for ones in found for one in ones], plan, variants.size)


def _among(some: Counts, variants: Counts, size: int) -> Mask:
    """Which of a few variants are among others, which may be millions: these are not sorted."""
    held = np.zeros(size, dtype=np.bool_)
    held[variants] = True
    return np.asarray(held[some])


def _of_scene(plan: Plan, own: Counts, share: Share, scene: int) -> list[Audit]:
    """The audit of some variants of a scene, group by group."""
    grid = plan.grids[scene]
    values = VariantValues.of(grid.scene.study, plan.cases, own)
    try:
        truth = converge(Marches(grid, values, in_full(grid)), REFERENCE_PART, Beyond(1, _dear(plan)), share)
        groups = [number for number, group in enumerate(plan.groups) if group.grid is grid]
        among = ((number, _among(own, plan.groups[number].variants, plan.size)) for number in groups)
        parts = [(number, np.flatnonzero(held)) for number, held in among]
        jobs = [Job(partial(_Audited.compared, group=number), lanes) for number, lanes in parts if lanes.size]
        return list(share(_Audited(plan, own, truth), jobs))
    except Crashed as crashed:
        raise Crashed(own[crashed.lanes]) from None


class _Audited(NamedTuple):
    """Variants of a scene that are audited, and their truth."""

    plan: Plan
    variants: Counts
    truth: Converged

    def compared(self, lanes: Counts, halted: Halted, group: int) -> Audit:
        """Those of them, whose truth is known, that belong to a group."""
        plan, own, of = self.plan, self.variants[lanes], self.plan.groups[group]
        values, true = plan.values(of, own), self.truth.outcome.of(lanes)
        archived = of.found(values, own, plan.choice, halted, "histories")
        known = ~lost(true.status) & ~lost(archived.outcome.status)
        same = [self.truth.used[name][lanes] == archived.used[name] for name in USED]
        known &= ~np.all(same, axis=0)  # a march is no second source of itself
        observed = differences(plan.asked, of.scene, values, archived.outcome, true, NUMBERS_ALONE)
        told = told_errors(archived, plan.asked)
        return Audit(own[known], observed[:, known], told[:, known], self.truth.error[:, lanes[known]], 0)


def joined(audits: Sequence[Audit], plan: Plan, asked: int) -> Audit:
    """Audits of some of the variants that were asked for as one, ascending."""
    none = np.zeros((len(results_of(plan.asked)), 0))
    parts = [Audit(np.zeros(0, dtype=np.int64), none, none, none, 0), *audits]
    order = np.argsort(np.concatenate([one.variants for one in parts]))
    variants, observed, told, doubt = (
        np.concatenate(column, axis=-1)[..., order] for column in zip(*(one[:4] for one in parts), strict=True)
    )
    return Audit(variants, observed, told, doubt, asked - order.size)
