"""The errors of marched variants, from what changes when they are marched with other steps and other modes.

Differences are of what the study reports, extremes and what its kind makes of histories, but no less than a part of
what the whole histories differ by at common stations (mechanics section 6: two extremes alone may agree by chance).
Where both marches resolve every mode that rings noticeably (`resolution`), one misses the part of such a difference
that `checking` tells; elsewhere nothing but the whole difference bounds its error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.bucket import Bucket
from engine.checking import Checks, can_be_marched
from engine.choice import fixed_steps
from engine.cycles import counts_sampled, reduced
from engine.kernels.layout import LARGEST, SMALLEST
from engine.lanes import LaneValues, padded
from engine.march import Marched
from engine.plan import Plan, reads_accelerations
from engine.reduction import Compared
from engine.resolution import RESOLVED, phase_errors
from engine.richardson import march_chosen
from engine.scene import Study
from engine.tables import SceneTables
from results_schema.status import Fidelity, Status

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

HISTORY_PART = 0.5  # of what histories differ by that extremes may be off without differing
DOUBTED = 1.5  # times what the ratio that is told beforehand makes of a difference of modes
LEAST_PART, COUPLED_PART = 0.1, 0.6  # of such a difference that is missed at least, without and with a mass


class Errors(NamedTuple):
    """Estimates (V,) of the parts of a relative error; NaN where nobody can tell."""

    fidelity: Array
    modes: Array
    steps: Array

    @property
    def total(self) -> Array:
        """(V,) all parts together."""
        return self.fidelity + self.modes + self.steps

    def left_open(self, study: Study, values: LaneValues, chosen: tuple[str, ...]) -> Array:
        """(V,) error of what the study leaves open; chosen: bodies whose modes are so."""
        none = np.zeros_like(self.total)
        ours = (self.fidelity if study.solver.fidelity == "auto" else none) + (self.modes if chosen else none)
        return np.asarray(ours + (none if fixed_steps(study, values) else self.steps))

    def status(self, study: Study, values: LaneValues, chosen: tuple[str, ...]) -> NDArray[np.int8]:
        """(V,) whether that holds the tolerance."""
        ours = self.left_open(study, values, chosen)
        found = np.where(ours > values.of("solver.tolerance"), Status.TOLERANCE_MISSED, Status.OK)
        return np.asarray(np.where(np.isnan(self.total), Status.UNRESOLVED, found), dtype=np.int8)


def pair_errors(tables: SceneTables, values: LaneValues, gap: Array, scale: Array) -> Array:
    """(V,) the largest of the errors ``gap`` (J, V) that a Richardson pair tells of its sensors, over their ``scale``
    (V, J); NaN where it is not resolved."""
    worst = np.max(gap.T / scale, axis=1, initial=0.0)
    return np.where(phase_errors(tables, values) <= RESOLVED, worst, np.nan)


def extremes_of(tables: SceneTables, marched: Marched) -> Array:
    """(V, J, 2) largest and smallest value of every sensor; 0 where it never counts."""
    found = marched.marks[: len(tables.sensors)][:, [LARGEST, SMALLEST]]
    return np.ascontiguousarray(np.where(np.isinf(found), 0.0, found).transpose(2, 0, 1))


@dataclass(frozen=True, eq=False)
class Observed:
    """What a march of V variants left: histories (H, J, V) at stations (H,) by their count, extremes (V, J, 2), results
    (V, ...)."""

    tables: SceneTables
    counts: Counts
    history: Array
    extremes: Array
    results: dict[str, NDArray[np.generic]]


def _of_difference(decay: Array, checks: Checks, fidelity: Fidelity) -> Array:
    """(V,) the part of a difference of modes that a march misses: e of e' - e, by the ratio that is told beforehand, as
    far as it may be believed: a mass couples modes, so that errors alternate and fall slower."""
    if checks.modes_missed > 1.0:
        return np.full_like(decay, checks.modes_missed)
    part = DOUBTED * decay / np.maximum(1.0 - decay, 1e-12)
    return np.asarray(np.clip(part, LEAST_PART if fidelity <= Fidelity.FORCE else COUPLED_PART, 1.0))


@dataclass(frozen=True, eq=False)
class Estimator:
    """Estimates of a chunk of variants. scale (V, J): what differences of every sensor are divided by, infinite for
    those that read but rounding; halted: asked between two segments of a march."""

    plan: Plan
    bucket: Bucket
    variants: Counts
    scale: Array
    halted: Callable[[], bool]

    def errors(self, own: Observed, missed: Array | None) -> Errors:
        """All parts for a march. missed: (V,) what a Richardson pair has told of its steps. Raises Halted."""
        told, checks = self.bucket.told.of(self.bucket.of(self.variants)), self.bucket.checks
        none = np.zeros(self.variants.size)
        if checks is None:
            known = self.bucket.scene.study.solver.static_correction  # else statics know the kept modes alone
            return Errors(told.error_fidelity, none if known else none + np.nan, none)
        other, steps = own, missed
        if checks.steps is not None:
            other = self._march(checks.steps, own)
            coarser = min(checks.steps, own.tables, key=lambda tables: tables.steps)
            resolved = phase_errors(coarser, self._values, told.felt) <= RESOLVED
            steps = self._apart(own, other) * np.where(resolved, checks.missed, max(1.0, checks.missed))
        assert steps is not None
        modes = np.full(self.variants.size, np.nan)
        if checks.modes is not None:
            part = _of_difference(told.decay, checks, own.tables.model.fidelity)
            modes = self._off(checks.modes, own, other) * part
        return Errors(self._fidelity(told.error_fidelity, own, other), modes, steps)

    def _fidelity(self, told: Array, own: Observed, other: Observed) -> Array:
        """(V,) what a simpler model leaves out of this march: its difference to the carriages' own model, or what is
        told beforehand where that would want more steps."""
        model = self.bucket.checks.model if self.bucket.checks is not None else None
        if model is None:
            return told
        sound = can_be_marched(model.model, self._values, model.steps)
        return np.where(sound, self._off(model, own, other), told) if sound.any() else told

    def _off(self, tables: SceneTables, own: Observed, other: Observed) -> Array:
        """(V,) difference of another march to that one of two which has as many steps."""
        partner = other if other.tables.steps == tables.steps else own
        return self._apart(partner, self._march(tables, own))

    @property
    def _values(self) -> LaneValues:
        return self.plan.values(self.bucket, self.variants)

    def _march(self, tables: SceneTables, own: Observed) -> Observed:
        """One of the marches that are compared with."""
        if self.plan.reduction is not None:
            counts = counts_sampled(self.plan, tables)
        else:
            counts = own.counts * tables.timeline.steps // own.tables.timeline.steps
        lanes = self.plan.values(self.bucket, padded(self.variants))
        values = LaneValues(tables.model.study, lanes.columns, lanes.size)
        marched, _ = march_chosen(tables, values, counts, self.variants.size, self.halted)
        values = LaneValues(tables.model.study, self._values.columns, self.variants.size)
        results = reduced(self.plan, tables, values, counts, marched.history)
        return Observed(tables, counts, marched.history, extremes_of(tables, marched), results)

    def _apart(self, one: Observed, other: Observed) -> Array:
        """(V,) the largest difference of extremes and results, no less than a part of that of histories (all of it if
        they are the result). NaN where one is no number, and without sensors."""
        if not self.scale.shape[1]:
            return np.full(self.variants.size, np.nan)
        finer, coarser = (one, other) if one.tables.steps >= other.tables.steps else (other, one)
        ratio = finer.tables.timeline.steps // coarser.tables.timeline.steps
        _, here, there = np.intersect1d(finer.counts, coarser.counts * ratio, return_indices=True)
        with np.errstate(invalid="ignore"):  # of those that have diverged
            gap = np.abs(finer.history[here] - coarser.history[there])
        off = np.isnan(finer.history[here]) & np.isnan(coarser.history[there])  # of a sensor that moves along
        part = 1.0 if reads_accelerations(self.plan.study) else HISTORY_PART
        found = [part * np.max(np.where(off, 0.0, gap), axis=0).T / self.scale]
        found.append(np.max(np.abs(one.extremes - other.extremes), axis=2) / self.scale)
        if self.plan.reduction is not None:
            compared = Compared(one.results, other.results, self.scale, self._values)
            differences = self.plan.reduction.differences(compared).values()
            found += [np.where(np.isinf(self.scale), 0.0, part) for part in differences]
        return np.asarray(np.max(np.stack(found), axis=(0, 2)))
