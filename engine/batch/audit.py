"""The audit of a study: some of its variants, none of them a pilot, beside marches of one level more than the
references of pilots have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from engine.accuracy.grids import SceneGrid
from engine.accuracy.groups import PACE, USED, Group
from engine.accuracy.ladder import REFERENCE_PART
from engine.accuracy.reference import (
    DEAR,
    Beyond,
    Converged,
    Halted,
    Share,
    across_and_within,
    converge,
    in_full,
    in_turn,
    usual_work,
)
from engine.accuracy.results import differences, results_of
from engine.batch.chunk import told_errors
from engine.batch.plan import Plan
from engine.kernels.layout import LANES
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.statuses import lost

SEED = 7717  # of the variants that are drawn; pilots have another
PART, FEWEST, MOST = 0.01, 16, 256  # of all variants, where their number is left open: 256 show a miss in a hundred
MOST_TIME, FREE_SECONDS = 0.3, 2.0  # of the run's expected time; and what may be spent whatever that is
TABLES = 30  # variants at PACE that take as long as the tables of a march: 29 to 49 with 32 and 16 modes


class Audit(NamedTuple):
    """n variants that were audited, by their flat numbers: observed and told errors, and those of the truth itself (R,
    n); variants whose truth is not known are left out."""

    variants: Counts
    observed: Array
    told: Array
    doubt: Array
    left_out: int


def sampled(plan: Plan) -> Counts:
    """The variants to audit, drawn at random by the study alone: where their number is left open 1 % of them, 16 to
    256, as many as take 30 % of the run's time or 2 s."""
    wanted = plan.study.solver.audit
    if wanted == 0:
        return np.zeros(0, dtype=np.int64)
    pilots = np.zeros(0, dtype=np.int64) if plan.choice is None else plan.choice.pilots
    drawn = np.random.default_rng(SEED).permutation(plan.size)
    others = drawn[~np.isin(drawn, pilots)]
    count = audit_size(plan) if wanted == "auto" else int(wanted)
    return np.sort(others[:count])


def audit_size(plan: Plan) -> int:
    """How many variants are audited where the study leaves that open."""
    count = int(np.clip(np.rint(PART * plan.size), min(FEWEST, plan.size), MOST))
    allowed = max(MOST_TIME * plan.seconds, FREE_SECONDS)
    while count and _seconds(plan, count) > allowed:
        count //= 2
    return count


def _dear(plan: Plan) -> float:
    """Modes x steps from which on a reference needs no further level. Variants that converge may have come as far, so
    that only a further level is a second source of them."""
    return math.inf if plan.converges else DEAR


def _seconds(plan: Plan, count: int) -> float:
    """Expected time of an audit on one thread."""
    share, found = min(1.0, count / plan.size), 0.0
    for grid in plan.grids:
        # each march has its tables, and whole blocks
        work, number = np.unique(usual_work(grid, _dear(plan)), return_counts=True)
        own = share * number
        lanes = np.maximum(own, LANES * np.minimum(1.0, own)) + TABLES * np.minimum(1.0, own)
        found += float(work @ lanes) * grid.scene.ties**1.2 / PACE
    return found


def audit(plan: Plan, variants: Counts, halted: Halted, share: Share = in_turn) -> Audit:
    """Compute some variants again, by jobs that ``share`` does. Raises Halted."""
    parts = [variants[np.isin(variants, members)] for members in plan.members]
    of_scenes = [(grid, own) for grid, own in zip(plan.grids, parts, strict=True) if own.size]
    across, within = across_and_within(share, len(of_scenes))
    found: list[Audit] = []

    def of_scene(grid: SceneGrid, own: Counts) -> None:
        values = VariantValues.of(grid.scene.study, plan.cases, own)
        truth = converge(
            grid, values, in_full(grid), REFERENCE_PART, beyond=Beyond(1, _dear(plan)), halted=halted, share=within
        )
        groups = [g for g in plan.groups if g.grid is grid and np.isin(own, g.variants).any()]
        within([partial(compare, group, own, truth) for group in groups])

    def compare(group: Group, own: Counts, truth: Converged) -> None:
        found.append(_compared(plan, group, own, truth, halted))

    across([partial(of_scene, *scene) for scene in of_scenes])
    return joined(found, plan, variants.size)


def _compared(plan: Plan, group: Group, variants: Counts, truth: Converged, halted: Halted) -> Audit:
    """Those of some variants (n,), whose truth is known, that belong to a group."""
    lanes = np.flatnonzero(np.isin(variants, group.variants))
    own, true = variants[lanes], truth.outcome.of(lanes)
    values = plan.values(group, own)
    archived = group.found(values, own, plan.choice, halted, "histories")
    known = ~lost(true.status) & ~lost(archived.outcome.status)
    same = [truth.used[name][lanes] == archived.used[name] for name in USED]
    known &= ~np.all(same, axis=0)  # a march is no second source of itself
    observed = differences(plan.asked, group.scene, values, archived.outcome, true)
    told = told_errors(archived, results_of(plan.asked))
    return Audit(own[known], observed[:, known], told[:, known], truth.error[:, lanes[known]], 0)


def joined(audits: Sequence[Audit], plan: Plan, asked: int) -> Audit:
    """Audits of some of the variants that were asked for as one, ascending."""
    none = np.zeros((len(results_of(plan.asked)), 0))
    parts = [Audit(np.zeros(0, dtype=np.int64), none, none, none, 0), *audits]
    order = np.argsort(np.concatenate([one.variants for one in parts]))
    variants, observed, told, doubt = (
        np.concatenate(column, axis=-1)[..., order] for column in zip(*(one[:4] for one in parts), strict=True)
    )
    return Audit(variants, observed, told, doubt, asked - order.size)
