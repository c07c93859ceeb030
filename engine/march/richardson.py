"""Richardson pairs: average acceleration with the steps h and 2h, an answer of fourth order, and an error estimate.

Both marches go segment by segment side by side, so only one segment's histories are in memory. The stations of the
coarser one are every second station of the finer one (`SceneTables.coarser`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.kernels.layout import LANES, LARGEST, SMALLEST, Observation, Record
from engine.kernels.stepping.richardson_pairs import extrapolate, integrate, survey
from engine.march.march import Halted, March, Marched, march, prepare
from engine.march.quasistatic import quasistatic_extremes
from engine.march.tables import SceneTables, SegmentTable
from engine.model.timeline import Segment
from engine.model.variant_values import VariantValues, from_blocks
from engine.observation.histories import rows_sampled
from results_schema.status import Fidelity

Array = NDArray[np.float64]
Counts = NDArray[np.int64]


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
    fine, coarse = (_whole_histories(part, values, counts, sampled) for part in (tables, tables.coarser))
    pair = _Pair(fine, coarse, *_blank(fine))
    for short, long in zip(fine.tables.timeline.segments, coarse.tables.timeline.segments, strict=True):
        pair.along(short, long)
        if halted():
            raise Halted
    return fine.result(size), from_blocks(pair.gap, size)[: len(tables.sensors)]


@dataclass(frozen=True, eq=False)
class _Histories(March):
    """A march that hands over the histories of all its signals, segment by segment."""

    def along(self, segment: Segment) -> tuple[Array, Observation]:
        """March a segment: its signals (blocks, S, signals, LANES) at all stations, and what was observed."""
        table = self.tables.table(segment)
        watch = _watched(segment, table)
        history = np.empty((self.statistics.shape[0], segment.steps + 1, watch.offset.shape[1], LANES))
        replace(self, history=history)._segment(segment, table, True)
        return history, watch

    def _observed(self, segment: Segment, table: SegmentTable) -> tuple[Observation, Record]:
        watch = _watched(segment, table)
        statistics = np.zeros_like(self.statistics[:, : watch.offset.shape[1]])
        statistics[:, :, LARGEST], statistics[:, :, SMALLEST] = (
            np.inf,
            -np.inf,
        )  # nothing is news: `survey` looks for extremes
        record = Record(statistics, np.arange(segment.steps + 1), self.history)
        everywhere, nowhere = np.ones_like(watch.counted), np.zeros_like(watch.summed)  # `survey` sums squares
        return watch._replace(counted=everywhere, summed=nowhere), record


def _watched(segment: Segment, table: SegmentTable) -> Observation:
    """What is observed along a segment."""
    return table.watch if segment.recorded else table.unrecorded


def _whole_histories(tables: SceneTables, values: VariantValues, counts: Counts, sampled: int | None) -> _Histories:
    """A march that is ready to go."""
    ready = prepare(tables, values, counts, sampled)
    return _Histories(ready.tables, ready.lanes, counts, ready.state, ready.statistics, ready.unrecorded, ready.history)


def _blank(fine: March) -> tuple[Array, Array]:
    """What a pair carries over from segment to segment before the first."""
    blocks, signals = fine.statistics.shape[:2]
    return np.zeros((blocks, signals, 3, LANES)), np.zeros((blocks, signals, LANES))


@dataclass(eq=False)
class _Pair:
    """A pair under way. carry: the values before a segment (blocks, signals, 3, LANES); gap (blocks, signals, LANES):
    the largest estimated errors so far; before: the segment before."""

    fine: _Histories
    coarse: _Histories
    carry: Array
    gap: Array
    before: Segment | None = None

    def along(self, segment: Segment, coarse_segment: Segment) -> None:
        """One segment of both, extrapolated and observed."""
        (fine, watch), (coarse, _) = self.fine.along(segment), self.coarse.along(coarse_segment)
        counted, signals = watch.counted, fine.shape[2]
        gap = self.gap if segment.recorded else np.zeros_like(self.gap[:, :signals])
        extrapolate(fine, coarse, counted, gap)
        statistics = self.fine.statistics if segment.recorded else self.fine.unrecorded
        carry = np.ascontiguousarray(self.carry[:, :signals])
        survey(fine, counted, statistics, carry, _joined(self.before, segment), segment.first)
        integrate(fine, watch.summed, statistics, self.fine.step(segment))
        self.carry[:, :signals] = carry
        self.before = segment
        if segment.recorded:
            rows = rows_sampled(segment, self.fine.counts)
            here, sensors = np.flatnonzero(rows >= 0), self.fine.history.shape[2]
            found = np.where(counted[here, :sensors, None], fine[:, here, :sensors], np.nan)
            self.fine.history[:, rows[here]] = found


def _joined(before: Segment | None, segment: Segment) -> bool:
    """Whether a segment goes on at an equal step where another ends, without an event between them."""
    if before is None or segment.fresh or before.recorded != segment.recorded:
        return False
    return abs(before.step - segment.step) <= 1e-9 * segment.step
