"""Variants whose error turned out too large for their tolerance, and what they are marched again with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.bodies.body import MAX_MODES
from engine.bucket import Bucket
from engine.choice import FINER, LEVELS, MOST_CHOSEN, MOST_SIMPLER, USUAL, fixed_steps, true_steps
from engine.estimates import Errors
from engine.fidelity import safe_steps
from engine.lanes import LaneValues
from engine.model import simplified
from engine.plan import Plan
from engine.resonance import spring_steps, vibrates_freely
from results_schema.status import Status

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

ENOUGH = 0.7  # of the tolerance: a larger estimate may be of an error that misses it
PART = 0.3  # of what the model leaves of the tolerance, for steps and for modes each
LEAST_PART = 0.05  # of the tolerance itself, likewise
MOST_COST = 10.0  # times the full model's at a tolerance of 1e-3 or more: what still misses it says so
COST_ORDER = 1.5  # by which that grows with 1/tolerance below: modes k ring by 1/k^2 to 1/k^3, marches cost k^3
ROUNDS = 4  # of improving
AT_ONCE = 8  # times the steps before the next look
NOT_LEFT = -1  # to be improved by modes or steps
NEXT = (*LEVELS, 32, 48, MAX_MODES)  # numbers of modes to go on with


def improvements(
    plan: Plan, bucket: Bucket, variants: Counts, flat: Mapping[str, NDArray[Any]]
) -> Iterator[tuple[Bucket, Counts]]:
    """Buckets with more modes or steps, and which of the variants (numbers below V) they are for."""
    done = bucket.rounds >= ROUNDS or bucket.checks is None or bucket.scene.scheme.stride > 1
    if done or not plan.study.sensor:  # without any nothing can be known
        return
    wanting = _wanting(plan, bucket, variants, flat)
    if not wanting.size:
        return
    values = plan.values(bucket, variants[wanting])
    tolerance = values.of("solver.tolerance")
    allowed = np.maximum(PART * (tolerance - flat["error_fidelity"][wanting]), LEAST_PART * tolerance)
    modes = _modes(bucket, flat["error_modes"][wanting] / allowed)
    coarse = flat["error_fidelity"][wanting] > MOST_SIMPLER * tolerance
    if plan.study.solver.fidelity == "auto" and coarse.any():
        modes[coarse] = NOT_LEFT  # more of anything else is of no use
        yield from _with_own_model(plan, bucket, variants, wanting[coarse])
    steps = np.ones(wanting.size, dtype=np.int64)
    if not fixed_steps(plan.study, values):
        steps = _times(np.sqrt(flat["error_steps"][wanting] / allowed))
    for more, fewer in pairwise([*(more for more in NEXT[::-1] if more > _now(bucket)), 0, 0]):
        lanes = np.flatnonzero(modes == more)
        if not lanes.size:
            continue
        own, most = variants[wanting[lanes]], _most_times(bucket, more, plan, variants[wanting[lanes]])
        by = np.maximum(np.minimum(steps[lanes], most), _safe(plan, bucket, more, own))
        modes[lanes[by > most]] = fewer  # what is not worth its cost may still take some modes more, or steps alone
        for times in np.unique(by[by <= most]):
            if more or times > 1:
                yield bucket.finer(more, int(times)), wanting[lanes[by == times]]


def _wanting(plan: Plan, bucket: Bucket, variants: Counts, flat: Mapping[str, NDArray[Any]]) -> Counts:
    """Variants (numbers below V) whose error is unknown or not small enough; none of those that have no result."""
    values = plan.values(bucket, variants)
    errors = Errors(*(flat[f"error_{part}"] for part in Errors._fields))
    large = errors.left_open(plan.study, values, bucket.chosen) > ENOUGH * values.of("solver.tolerance")
    status = flat["status"]
    return np.flatnonzero((large & (status <= Status.TOLERANCE_MISSED)) | (status == Status.UNRESOLVED))


def _with_own_model(plan: Plan, bucket: Bucket, variants: Counts, lanes: Counts) -> Iterator[tuple[Bucket, Counts]]:
    """Buckets with the carriages' own model for variants that a simpler one does not tell well enough, with the steps
    that it needs whatever its accuracy; only those for which it is worth that."""
    model = simplified(bucket.scene, {"solver.fidelity": "full"})
    free = any(vibrates_freely(carriage) for carriage in model.carriages)
    if model.fidelity == bucket.scene.fidelity or (free and np.isfinite(model.scheme.stability_limit)):
        return
    values = LaneValues(model.study, plan.cases.columns_of(variants[lanes]), lanes.size)
    rules = safe_steps(model, values.time_scale(model.carriages[0].name), FINER)
    rules |= spring_steps(model, values, true_steps(values, model.scheme), FINER)
    by = _power_of_two(np.max([*rules.values()], axis=0) / bucket.steps)
    worth = by <= (1 if fixed_steps(model.study, values) else _most_times(bucket, 0, plan, variants[lanes]))
    for times in np.unique(by[worth]):
        yield bucket.with_own_model(int(times)), lanes[worth & (by == times)]


def _power_of_two(ratio: Array) -> Counts:
    """(V,) the next powers of two, from 1 on."""
    return np.asarray(np.exp2(np.ceil(np.log2(np.maximum(ratio, 1.0)) - 1e-9)), dtype=np.int64)


def _most_times(bucket: Bucket, modes: int, plan: Plan, variants: Counts) -> Counts:
    """(V,) powers of two by which the steps may grow, with so many modes, for what that is worth; 0 where not even as
    many as now are."""
    tighter = np.maximum(1.0, USUAL / plan.values(bucket, variants).of("solver.tolerance"))
    worth = MOST_COST * tighter**COST_ORDER
    grown = max(1.0, modes * len(bucket.chosen) / bucket.scene.body_modes)
    ratio = worth * bucket.full_cost[bucket.of(variants)] / (bucket.cost * grown)
    ratio = np.minimum(ratio, MOST_CHOSEN / bucket.steps)
    return np.where(ratio < 1.0, 0, np.exp2(np.floor(np.log2(np.maximum(ratio, 1.0)) + 1e-9))).astype(np.int64)


def _times(ratio: Array) -> Counts:
    """(V,) powers of two that are no less than these ratios, up to `AT_ONCE`; 2 where they are unknown."""
    known = np.clip(np.where(np.isnan(ratio), 2.0, ratio), 1.0, AT_ONCE)
    return _power_of_two(known)


def _modes(bucket: Bucket, ratio: Array) -> Counts:
    """(V,) the next number of modes that such a ratio of error to what is allowed asks for; 0: as many as now."""
    if not bucket.chosen:
        return np.zeros(ratio.size, dtype=np.int64)
    now = _now(bucket)
    wanted = now * np.clip(np.sqrt(np.where(np.isnan(ratio), 1.0, ratio)), 1.0, 4.0)
    place = np.minimum(np.searchsorted(NEXT, np.where(ratio > 1.0, np.maximum(wanted, now + 1), now)), len(NEXT) - 1)
    found = np.asarray(NEXT)[place]
    return np.asarray(np.where((ratio > 1.0) & (found > now), found, 0), dtype=np.int64)


def _now(bucket: Bucket) -> int:
    """Modes of the bodies whose modes are chosen; more than any where there are none."""
    sizes = [part.modal.omega.size for part in bucket.scene.bodies if part.name in bucket.chosen]
    return max(sizes, default=MAX_MODES)


def _safe(plan: Plan, bucket: Bucket, modes: int, variants: Counts) -> Counts:
    """(V,) times the steps that so many modes need whatever their accuracy."""
    if not modes:
        return np.ones(variants.size, dtype=np.int64)
    model = simplified(bucket.scene, {f"body.{name}.modes": modes for name in bucket.chosen})
    values = LaneValues(model.study, plan.cases.columns_of(variants), variants.size)
    if fixed_steps(model.study, values):
        return np.ones(variants.size, dtype=np.int64)
    least = np.max([*safe_steps(model, values.time_scale(model.carriages[0].name), FINER).values()], axis=0)
    return _power_of_two(least / bucket.steps)
