"""Richardson pairs: average acceleration with the steps h and 2h, an answer of fourth order, and an error estimate.

Both marches go segment by segment side by side, so only one segment's histories are in memory. The stations of the
coarser one are every second station of the finer one (`SceneTables.coarser`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from engine.kernels.layout import DIVERGED, DIVERGED_AT, LANES, LARGEST, SMALLEST, SOUND, STATISTICS, Record
from engine.kernels.stepping.richardson_pairs import extrapolate, integrate, survey
from engine.march.march import March, Marched, Observed, march, prepare
from engine.march.quasistatic import quasistatic_extremes
from engine.march.stepper import Codes, go
from engine.march.tables import SceneTables, SegmentTable
from engine.model.lane_table import from_blocks
from engine.model.timeline import Segment
from engine.observation.histories import rows_sampled
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.status import Fidelity


def march_scheme(
    tables: SceneTables,
    values: VariantValues,
    counts: Counts,
    size: int,
    halted: Callable[[], bool] = lambda: False,
    sampled: int | None = None,
) -> Marched:
    """March by the model's scheme, or rest at every place; sampled: so many signals, or the sensors. Raises Halted."""
    if tables.model.fidelity is Fidelity.STATIC:
        return quasistatic_extremes(tables, values, counts, size, sampled)
    if tables.model.scheme.stride == 1:
        return march(tables, values, counts, size, halted, sampled)
    return march_pair(tables, values, counts, size, halted, sampled)[0]


def march_pair(
    tables: SceneTables,
    values: VariantValues,
    counts: Counts,
    size: int,
    halted: Callable[[], bool] = lambda: False,
    sampled: int | None = None,
) -> tuple[Marched, Array]:
    """March with the tables' steps, whose refinement is even, and with half of them.

    Returns what `march` does of the extrapolated histories, extremes also from between stations, and (sensors, V) the
    largest estimated error of the finer march over its whole recorded history. Raises Halted.
    """
    pair = _Pair(*(_Histories(**vars(prepare(part, values, counts, sampled))) for part in (tables, tables.coarser)))
    codes = go(pair, zip(tables.timeline.segments, tables.coarser.timeline.segments, strict=True), halted)
    return pair.fine.result(codes, size), from_blocks(pair.gap, size)[: len(tables.sensors)]


@dataclass(frozen=True, eq=False)
class _Histories(March):
    """A march whose signals are all kept, of one segment at a time."""

    def unseen(self, segment: Segment, before: Segment | None) -> bool:
        """Every segment has a history of its own, from its first station on."""
        return True

    def observe(self, segment: Segment, table: SegmentTable) -> Observed:
        """The histories of all signals; no extremes and no sums, which `survey` and `integrate` find."""
        watch = table.watch if segment.recorded else table.unrecorded
        blocks, signals = self.statistics.shape[0], watch.offset.shape[1]
        statistics = np.zeros((blocks, signals, STATISTICS, LANES))
        statistics[:, :, LARGEST], statistics[:, :, SMALLEST], statistics[:, :, DIVERGED_AT] = np.inf, -np.inf, -1.0
        history = np.full((blocks, segment.steps + 1, signals, LANES), np.nan)  # what is not observed shows
        everywhere, nowhere = np.ones_like(watch.counted), np.zeros_like(watch.summed)
        record = Record(statistics, np.arange(segment.steps + 1), history)
        return Observed(watch._replace(counted=everywhere, summed=nowhere), record)


class _Both(NamedTuple):
    """Segments, tables or what is observed of the finer and of the coarser march."""

    fine: Any
    coarse: Any


class _Pair:
    """The stepper of a pair. carry: the values before a segment (blocks, signals, 3, LANES); gap (blocks, signals,
    LANES): the largest estimated errors so far."""

    def __init__(self, fine: _Histories, coarse: _Histories) -> None:
        blocks, signals = fine.statistics.shape[:2]
        self.fine, self.coarse = fine, coarse
        self.carry, self.gap = np.zeros((blocks, signals, 3, LANES)), np.zeros((blocks, signals, LANES))
        self.joined = False

    def tabulate(self, segments: tuple[Segment, Segment]) -> _Both:
        """The tables of both."""
        return _Both(*map(SceneTables.table, (self.fine.tables, self.coarse.tables), segments))

    def observe(self, segments: tuple[Segment, Segment], tables: _Both) -> _Both:
        """The histories of both."""
        return _Both(*map(_Histories.observe, (self.fine, self.coarse), segments, tables))

    def start(
        self,
        segments: tuple[Segment, Segment],
        tables: _Both,
        observed: _Both,
        before: tuple[Segment, Segment] | None,
    ) -> None:
        """The event in both; the first station is always observed."""
        self.joined = before is not None and _joined(before[0], segments[0])
        self.fine.start(segments[0], tables.fine, observed.fine, None)
        self.coarse.start(segments[1], tables.coarse, observed.coarse, None)

    def step(self, segments: tuple[Segment, Segment], tables: _Both, observed: _Both) -> Codes:
        """One segment of both, extrapolated and observed."""
        codes = self.fine.step(segments[0], tables.fine, observed.fine)
        codes = np.maximum(codes, self.coarse.step(segments[1], tables.coarse, observed.coarse))
        segment, fine = segments[0], observed.fine.record.history
        own = tables.fine.watch if segment.recorded else tables.fine.unrecorded
        signals = fine.shape[2]
        gap = self.gap if segment.recorded else np.zeros_like(self.gap[:, :signals])
        extrapolate(fine, observed.coarse.record.history, own.counted, gap)
        statistics = self.fine.statistics_along(segment)
        carry = np.ascontiguousarray(self.carry[:, :signals])
        survey(fine, own.counted, statistics, carry, self.joined, segment.first)
        integrate(fine, own.summed, statistics, self.fine.step_size(segment))
        self.carry[:, :signals] = carry
        if segment.recorded:
            rows = rows_sampled(segment, self.fine.counts)
            here, sensors = np.flatnonzero(rows >= 0), self.fine.history.shape[2]
            found = np.where(own.counted[here, :sensors, None], fine[:, here, :sensors], np.nan)
            self.fine.history[:, rows[here]] = found
        beyond = (statistics[:, :, DIVERGED_AT] >= 0.0).any(axis=1)
        return np.maximum(codes, np.where(beyond, np.int8(DIVERGED), np.int8(SOUND)))


def _joined(before: Segment, segment: Segment) -> bool:
    """Whether a segment goes on at an equal step where another ends, without an event between them."""
    if segment.fresh or before.recorded != segment.recorded:
        return False
    return abs(before.step - segment.step) <= 1e-9 * segment.step
