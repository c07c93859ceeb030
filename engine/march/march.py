"""One chunk of variants from start to end: initial state, segment after segment, what was observed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.kernels.layout import (
    BELOW_AT,
    BOUND,
    DIVERGED_AT,
    LANES,
    LARGEST,
    LARGEST_AT,
    SMALLEST,
    SMALLEST_AT,
    STATISTICS,
    Lanes,
    Observation,
    Record,
    State,
    Ties,
)
from engine.kernels.stepping.march import march_many, march_one
from engine.kernels.stepping.start import solve_initial_acceleration, strike, watch_start
from engine.march.initial_state import initial_state
from engine.march.tables import SceneTables, SegmentTable
from engine.model.timeline import Segment
from engine.model.track import tabulate_blow
from engine.model.variant_values import LaneTable, VariantValues, from_blocks, lane_table
from engine.observation.contact_forces import contact_forces
from engine.observation.histories import rows_sampled

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

DIVERGED = 1e6  # times its static value a signal has left every meaning


@dataclass(frozen=True, eq=False)
class Marched:
    """What a march of V variants leaves: statistics (J, STATISTICS, V) of all signals over the recorded part, of the
    contact forces before it (C, STATISTICS, V), the samples of the first signals (H, S, V), and whether the final state
    is finite (V,)."""

    statistics: Array
    unrecorded: Array
    history: Array
    finite: NDArray[np.bool_]


class Halted(Exception):
    """The march was asked to stop between two segments."""


@dataclass(frozen=True, eq=False)
class March:
    """A march that is ready to go: variants of one scene in blocks, their state and what is kept of them."""

    tables: SceneTables
    lanes: LaneTable
    counts: Counts
    state: State
    statistics: Array
    unrecorded: Array
    history: Array

    def go(self, halted: Callable[[], bool] = lambda: False) -> None:
        """All segments, once. ``halted`` is asked after each; raises Halted when it says so."""
        before = False
        for segment in self.tables.timeline.segments:
            table = self.tables.table(segment)  # built again each time where there are many
            self._segment(segment, table, segment.fresh or (segment.recorded and not before))
            before = segment.recorded
            if halted():
                raise Halted

    def _segment(self, segment: Segment, table: SegmentTable, unseen: bool) -> None:
        """The impulse and the new accelerations of a segment's event, its first station, its steps."""
        model = self.tables.model
        watch, record = self._observed(segment, table)
        stepped = self.lanes.steps_of(self.step(segment))
        if segment.strikes:
            active = np.zeros(model.ties, dtype=np.bool_)
            active[: len(model.carriages)] = segment.active[: len(model.carriages)]
            mass = np.where(active[:, None], self.lanes.mass, 0.0)
            self._board(segment)
            strike(tabulate_blow(model, segment, mass, self.lanes.time_scale), self.lanes.gravity, self.state)
        if segment.fresh:
            solve_initial_acceleration(table.ties, stepped, self.state)
        if unseen:
            watch_start(table.ties, stepped, self.state, watch, record, segment.first)
        self._steps(segment, table.ties, stepped, watch, record)

    def step(self, segment: Segment) -> Array:
        """(blocks, LANES) step of a segment in s; free vibration lasts some first periods of the body."""
        if not segment.free:
            return self.lanes.time_scale * segment.step
        steps = sum(part.steps for part in self.tables.timeline.segments if part.free)
        return np.full_like(self.lanes.time_scale, self.tables.free_seconds / steps)

    def _board(self, segment: Segment) -> None:
        """Sprung masses that arrive were at rest on level ground, whatever they did where they did not matter."""
        arriving = {blow.rider for blow in segment.strikes if blow.kind == "arrival"}
        for spring in self.tables.model.sprung:
            if spring.carriage in arriving:
                self.state.q[:, spring.mode], self.state.v[:, spring.mode] = 0.0, 0.0

    def _observed(self, segment: Segment, table: SegmentTable) -> tuple[Observation, Record]:
        """What is observed along a segment, and where it is kept."""
        if not segment.recorded:
            return table.unrecorded, Record(self.unrecorded, rows_sampled(segment, self.counts[:0]), self.history)
        return table.watch, Record(self.statistics, rows_sampled(segment, self.counts), self.history)

    def _steps(self, segment: Segment, ties: Ties, stepped: Lanes, watch: Observation, record: Record) -> None:
        """The steps of a segment, from its station 0, which is settled and seen."""
        kernel = march_one if self.tables.model.ties == 1 else march_many
        kernel(ties, stepped, self.state, watch, record, self.tables.scheme, segment.first)

    def result(self, size: int) -> Marched:
        """What the march of the first ``size`` variants left."""
        finite = np.isfinite(self.state.q).all(axis=1) & np.isfinite(self.state.v).all(axis=1)
        statistics, unrecorded, history = (
            from_blocks(part, size) for part in (self.statistics, self.unrecorded, self.history)
        )
        return Marched(statistics, unrecorded, history, finite.reshape(-1)[:size])


def prepare(tables: SceneTables, values: VariantValues, counts: Counts, sampled: int | None = None) -> March:
    """Set up variants whose number is a multiple of LANES, with signals sampled at ``counts``: the first ``sampled``
    of the tables' signals, or the sensors."""
    lanes = lane_table(tables.model, values)
    blocks = lanes.gravity.shape[0]
    sensors, signals = len(tables.sensors), len(tables.signals)
    guarded = sensors if signals > sensors else 0  # where no contacts are read, all signals stand guard
    statistics, unrecorded = _blank_statistics(blocks, signals), _blank_statistics(blocks, signals - guarded)
    bounds = _bounds(tables, lanes)
    statistics[:, :, BOUND], unrecorded[:, :, BOUND] = bounds, bounds[:, guarded:]
    history = np.full((blocks, counts.size, sensors if sampled is None else sampled, LANES), np.nan)
    return March(tables, lanes, counts, initial_state(tables.model, lanes), statistics, unrecorded, history)


def march(
    tables: SceneTables,
    values: VariantValues,
    counts: Counts,
    size: int,
    halted: Callable[[], bool] = lambda: False,
    sampled: int | None = None,
) -> Marched:
    """Prepare, go, and return the result of the first ``size`` variants. Raises Halted."""
    prepared = prepare(tables, values, counts, sampled)
    prepared.go(halted)
    return prepared.result(size)


def _blank_statistics(blocks: int, signals: int) -> Array:
    statistics = np.zeros((blocks, signals, STATISTICS, LANES))
    statistics[:, :, LARGEST], statistics[:, :, SMALLEST] = -np.inf, np.inf
    statistics[:, :, [LARGEST_AT, SMALLEST_AT, BELOW_AT, DIVERGED_AT]] = -1.0
    return statistics


def _bounds(tables: SceneTables, lanes: LaneTable) -> Array:
    """(blocks, signals, LANES) magnitudes beyond which a signal has diverged; infinite where no scale is known."""
    model = tables.model
    own = sum(part.modal.mass for part in model.bodies if part.own_weight)
    weight = np.abs(lanes.weight[:, : len(model.carriages)]).sum(axis=1) + own * lanes.gravity
    scale = tables.static_scales * DIVERGED
    contact = DIVERGED * np.abs(lanes.weight[:, [force.carriage for force in contact_forces(model)]])
    sensors = scale[None, :, None] * weight[:, None]
    loose = [model.bodies[sensor.body].modal.rigid_modes > 0 for sensor in tables.sensors]
    sensors = np.where(np.array(loose)[None, :, None], np.inf, sensors)  # a rigid body may go anywhere
    found = np.concatenate([sensors, contact], axis=1)[:, : len(tables.signals)]
    return np.where(found > 0.0, found, np.inf)
