"""One chunk of variants from start to end: initial state, segment after segment, what was observed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.kernels import layout
from engine.kernels.layout import Record
from engine.kernels.stepping.march import march_many, march_one
from engine.kernels.stepping.start import solve_initial_acceleration, strike, watch_start
from engine.march.initial_state import initial_state
from engine.march.stepper import go
from engine.model.lane_table import from_blocks, lane_table
from engine.model.track import tabulate_blow, ties_with_inertia
from engine.observation.contact_forces import contacts_that_react
from engine.observation.histories import rows_sampled
from results_schema.arrays import Array, Counts
from results_schema.status import Status

if TYPE_CHECKING:
    from engine.kernels.layout import Lanes, Observation, State, Ties
    from engine.march.stepper import Codes
    from engine.march.tables import SceneTables, SegmentTable
    from engine.model.lane_table import LaneTable
    from engine.model.timeline import Segment
    from engine.scene.variants import VariantValues


MEANINGLESS = 1e6  # times its static value a signal counts as diverged
#: Status of a variant by the code that the kernels return of its lane.
STATUS = np.array([Status.OK, Status.NOT_CONVERGED, Status.DIVERGED], dtype=np.int8)


@dataclass(frozen=True, eq=False)
class Marched:
    """What a march of V variants leaves: statistics (J, STATISTICS, V) of all signals over the recorded part, of the
    contact forces before it (C, STATISTICS, V), of all signals over the part of it in which all carriages rest (none
    where the study does not ask for it), the samples of the first signals (H, S, V), and how it went (V,)."""

    statistics: Array
    unrecorded: Array
    resting: Array
    history: Array
    status: NDArray[np.int8]


class Observed(NamedTuple):
    """What is observed along a segment, and where it is kept."""

    watch: Observation
    record: Record


@dataclass(frozen=True, eq=False)
class March:
    """The stepper of bodies in modal coordinates: variants of one scene in blocks, and what is kept of them. ending (C,
    N): how fast modal forces grew at the end of the segment that was stepped last."""

    tables: SceneTables
    lanes: LaneTable
    counts: Counts
    state: State
    statistics: Array
    unrecorded: Array
    resting: Array
    history: Array
    ending: Array

    def go(self, halted: Callable[[], bool] = lambda: False) -> Codes:
        """All segments, once. Raises Halted."""
        return go(self, self.tables.timeline.segments, halted)

    def tabulate(self, segment: Segment) -> SegmentTable:
        """The table of a segment, built again each time where there are many."""
        return self.tables.table(segment)

    def observe(self, segment: Segment, table: SegmentTable) -> Observed:
        """What is observed along a segment, and where it is kept."""
        if not segment.recorded:
            record = Record(self.unrecorded, rows_sampled(segment, self.counts[:0]), self.history)
            return Observed(table.unrecorded, record)
        record = Record(self.statistics_along(segment), rows_sampled(segment, self.counts), self.history)
        return Observed(table.watch, record)

    def statistics_along(self, segment: Segment) -> Array:
        """The statistics that a segment counts in."""
        if not segment.recorded:
            return self.unrecorded
        return self.resting if segment.rests and self.resting.shape[1] else self.statistics

    def start(self, segment: Segment, table: SegmentTable, observed: Observed, before: Segment | None) -> None:
        """The impulse and the new accelerations of a segment's event, and its first station, seen with all modes' own
        masses."""
        model, stepped = self.tables.model, self.stepped(segment, table)
        if before is None and model.pulsating:
            self.state.v[:, model.pulses] *= self._velocity_part(segment)[:, model.pulses]
        swinging = self.state.v.copy()
        if self.unseen(segment, before):
            whole = self.lanes.steps_of(self.step_size(segment), table.numbers)
            if segment.strikes:
                self._board(segment)
                struck = ties_with_inertia(model, segment.active)
                if struck.size:
                    blow = tabulate_blow(model, segment, struck, self.lanes.mass.take(struck, 1), self.lanes.time_scale)
                    strike(blow, self.lanes.gravity, stepped.inverse_modal_mass, self.state)
            if segment.fresh:
                solve_initial_acceleration(table.ties, whole, self.state)
            watch_start(table.ties, whole, self.state, *observed, segment.first)
        if self.is_rescaled(segment, before):
            self._change_step(segment, table, before, swinging)
            solve_initial_acceleration(table.ties, stepped, self.state)

    def _change_step(self, segment: Segment, table: SegmentTable, before: Segment | None, swinging: Array) -> None:
        """Velocities of the scheme, which are no derivatives, become those of a segment's step and loads: what was
        ``swinging`` freely (blocks, N, LANES), before anything struck, goes on as far as it did, whatever the steps
        are, and about what the loads push on."""
        model, struck = self.tables.model, self.state.v - swinging
        if before is not None:
            kept = self._velocity_part(segment) / self._velocity_part(before)
            kept[:, model.residuals] = 1.0
            swinging = (swinging - self._beyond_derivatives(before, self.ending)) * kept
        self.state.v[...] = swinging + struck + self._beyond_derivatives(segment, table.rates[0])

    def _velocity_part(self, segment: Segment) -> Array:
        """(blocks, N, LANES) velocities of the scheme over those of what swings freely."""
        return np.asarray(self.tables.model.scheme.velocity_part(self.lanes.turned(self.step_size(segment))))

    def _beyond_derivatives(self, segment: Segment, rates: Array) -> Array:
        """(blocks, N, LANES) what velocities of the scheme are beyond derivatives by rates of `force_rates`."""
        model, step = self.tables.model, self.step_size(segment)[:, None]
        loads = np.einsum("bcj,ck->bkj", self.lanes.weight[:, : len(model.carriages)], rates)
        return np.asarray(loads * step * model.scheme.velocity_at_kinks(model.omega[:, None] * step))

    def unseen(self, segment: Segment, before: Segment | None) -> bool:
        """Whether the first station of a segment was not observed as the last one of the segment before."""
        return segment.fresh or (segment.recorded and not (before is not None and before.recorded))

    def is_rescaled(self, segment: Segment, before: Segment | None) -> bool:
        """Whether accelerations are those of other masses of fast modes than a segment's step has."""
        if math.isinf(self.tables.model.scheme.scaled_from):
            return False
        if segment.fresh or before is None:
            return True
        return segment.free is not before.free or not math.isclose(segment.step, before.step)

    def stepped(self, segment: Segment, table: SegmentTable) -> Lanes:
        """The lanes with the step of a segment."""
        return self.lanes.steps_of(self.step_size(segment), table.numbers, self.tables.model.scheme.scaled_from)

    def step(self, segment: Segment, table: SegmentTable, observed: Observed) -> Codes:
        """The steps of a segment, from its station 0, which is settled and seen."""
        stepped = self.stepped(segment, table)
        scheme = self.tables.scheme
        if table.rates.size:
            self.ending[...] = table.rates[1]
        return step_kernel(table.ties)(table.ties, stepped, self.state, *observed, scheme, segment.first)

    def step_size(self, segment: Segment) -> Array:
        """(blocks, LANES) step of a segment in s; free vibration lasts some first periods of the body."""
        if not segment.free:
            return self.lanes.time_scale * segment.step
        steps = sum(part.steps for part in self.tables.timeline.segments if part.free)
        return np.full_like(self.lanes.time_scale, self.tables.free_seconds / steps)

    def _board(self, segment: Segment) -> None:
        """Sprung masses that arrive were at rest on level ground, whatever they did where they did not matter."""
        arriving = {blow.rider for blow in segment.strikes if blow.arrives}
        for spring in self.tables.model.sprung:
            if spring.carriage in arriving:
                self.state.q[:, spring.mode], self.state.v[:, spring.mode] = 0.0, 0.0

    def result(self, codes: Codes, size: int) -> Marched:
        """What the march of the first ``size`` variants left, whose lanes went by these codes."""
        statistics, unrecorded, resting, history = (
            from_blocks(part, size) for part in (self.statistics, self.unrecorded, self.resting, self.history)
        )
        if len(resting):
            statistics = _both(statistics, resting)
        return Marched(statistics, unrecorded, resting, history, STATUS[codes].reshape(-1)[:size])


def _both(before: Array, after: Array) -> Array:
    """Statistics (J, STATISTICS, V) of two parts of a run, one after the other, as those of both."""
    found = after.copy()
    for value, at, beyond in (
        (layout.LARGEST, layout.LARGEST_AT, np.less),
        (layout.SMALLEST, layout.SMALLEST_AT, np.greater),
    ):
        later = beyond(before[:, value], after[:, value]) | np.isnan(after[:, value])
        for column in (value, at):
            found[:, column] = np.where(later, after[:, column], before[:, column])
    for first in (layout.BELOW_AT, layout.DIVERGED_AT):
        found[:, first] = np.where(before[:, first] >= 0.0, before[:, first], after[:, first])
    for total in (layout.SQUARES, layout.SECONDS):
        found[:, total] += before[:, total]
    return found


def step_kernel(ties: Ties) -> Callable[..., Codes]:
    """The kernel that marches a segment with so many ties."""
    return march_one if ties.rows.shape[2] == 1 else march_many


def prepare(tables: SceneTables, values: VariantValues, counts: Counts, sampled: int | None = None) -> March:
    """Set up variants whose number is a multiple of LANES, with signals sampled at ``counts``: the first ``sampled``
    of the tables' signals, or the sensors."""
    lanes = lane_table(tables.model, values)
    blocks = lanes.gravity.shape[0]
    sensors, signals = len(tables.sensors), len(tables.signals)
    guarded = sensors if signals > sensors else 0  # where no contacts are read, all signals stand guard
    statistics, unrecorded = _blank_statistics(blocks, signals), _blank_statistics(blocks, signals - guarded)
    bounds = _bounds(tables, lanes)
    statistics[:, :, layout.BOUND], unrecorded[:, :, layout.BOUND] = bounds, bounds[:, guarded:]
    resting = statistics.copy() if tables.watches_rest else statistics[:, :0]
    history = np.full((blocks, counts.size, sensors if sampled is None else sampled, layout.LANES), np.nan)
    state, ending = initial_state(tables.model, lanes), np.zeros((len(tables.model.carriages), tables.model.omega.size))
    return March(tables, lanes, counts, state, statistics, unrecorded, resting, history, ending)


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
    return prepared.result(prepared.go(halted), size)


def _blank_statistics(blocks: int, signals: int) -> Array:
    statistics = np.zeros((blocks, signals, layout.STATISTICS, layout.LANES))
    statistics[:, :, layout.LARGEST], statistics[:, :, layout.SMALLEST] = -np.inf, np.inf
    statistics[:, :, [layout.LARGEST_AT, layout.SMALLEST_AT, layout.BELOW_AT, layout.DIVERGED_AT]] = -1.0
    return statistics


def _bounds(tables: SceneTables, lanes: LaneTable) -> Array:
    """(blocks, signals, LANES) magnitudes beyond which a signal has diverged; infinite where no scale is known."""
    model = tables.model
    own = sum(part.modal.mass for part in model.bodies if part.own_weight)
    weight = np.abs(lanes.weight[:, : len(model.carriages)]).sum(axis=1) + own * lanes.gravity
    scale = tables.static_scales * MEANINGLESS
    contact = MEANINGLESS * np.abs(lanes.weight[:, [force.carriage for force in contacts_that_react(model)]])
    sensors = scale[None, :, None] * weight[:, None]
    loose = [model.bodies[sensor.body].modal.rigid_modes > 0 for sensor in tables.sensors]
    sensors = np.where(np.array(loose)[None, :, None], np.inf, sensors)  # a rigid body may go anywhere
    found = np.concatenate([sensors, contact], axis=1)[:, : len(tables.signals)]
    return np.where(found > 0.0, found, np.inf)
