"""The lowest rung: every carriage so slow that nothing moves but the loads. Static readings stand for a march.

What is read anywhere is exact for the model, as influence lines are; nothing is stepped, so a variant costs next to
nothing and has neither lag nor vibration.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.kernels import layout
from engine.march.march import Marched
from engine.model.lane_table import static_loads
from engine.model.station_path import standing
from engine.statics.static_response import static_readings
from results_schema.arrays import Array, Counts, Mask
from results_schema.status import Status

if TYPE_CHECKING:
    from engine.march.tables import SceneTables
    from engine.model.station_path import Along
    from engine.observation.signals import Signal
    from engine.scene.variants import VariantValues

MOST_READINGS = 2**22  # stations x signals x variants at a time


def quasistatic_extremes(
    tables: SceneTables, values: VariantValues, counts: Counts, size: int, sampled: int | None = None
) -> Marched:
    """What a march of the first ``size`` variants would leave if it were infinitely slow: statistics, and histories of
    the first ``sampled`` signals, or of the sensors, at stations by their count."""
    model, signals = tables.model, tables.signals
    loads = static_loads(model, values)[:, :size]
    at = tables.statics.counts
    unit, counted = _unit(tables, at), _counted(tables, signals, standing(tables.timeline, at))
    distinct, inverse = np.unique(loads, axis=1, return_inverse=True)  # pace and damping do not count
    statistics = np.zeros((len(signals), layout.STATISTICS, distinct.shape[1]))
    piece = max(1, MOST_READINGS // unit[:, :, 0].size)
    for first in range(0, distinct.shape[1], piece):
        part = slice(first, first + piece)
        statistics[:, :, part] = _statistics(np.einsum("sjl,lv->sjv", unit, distinct[:, part]), counted, at)
    statistics = statistics[:, :, inverse.reshape(-1)]
    sensors = len(tables.sensors)
    time_scale = values.scene_time_scale[:size]
    statistics[:sensors, layout.SQUARES], statistics[:sensors, layout.SECONDS] = _squares(tables, loads, time_scale)
    unrecorded = np.full((len(signals) - sensors, layout.STATISTICS, size), -1.0)
    shown = sensors if sampled is None else sampled
    history = np.zeros((counts.size, shown, size))
    if counts.size:
        here = _sampled(tables, signals[:shown], counts)[:, :, None]
        found = np.einsum("sjl,lv->sjv", _unit(tables, counts)[:, :shown], loads)
        history = np.where(here, found, np.nan)
    resting = statistics[:0]
    if tables.watches_rest:
        here = _counted(tables, signals, standing(tables.timeline, tables.at_rest))
        resting = _statistics(np.einsum("sjl,lv->sjv", _unit(tables, tables.at_rest), loads), here, tables.at_rest)
    return Marched(statistics, unrecorded, resting, history, np.full(size, Status.OK, dtype=np.int8))


def _unit(tables: SceneTables, counts: Array | Counts) -> Array:
    """(S, J, L) readings of all signals per unit of each of the loads."""
    model = tables.model
    readers = [signal.as_sensor(model) for signal in tables.signals]
    return static_readings(model, readers, standing(tables.timeline, counts))


def _counted(tables: SceneTables, signals: tuple[Signal, ...], along: Along) -> Mask:
    """(S, J) where each signal reads anything."""
    found = []
    for signal in signals:
        rider, counts = signal.rides(tables.model), signal.counted(tables.model, along)
        here = None if rider is None else along[rider].here
        found.append(counts if here is None else counts & here)
    return np.stack(found, axis=1)


def _sampled(tables: SceneTables, signals: tuple[Signal, ...], counts: Counts) -> Mask:
    """(S, J) where histories have each signal: as those of marches not of what leaves at that station."""
    found = _counted(tables, signals, standing(tables.timeline, counts))
    for column, signal in enumerate(signals):
        rider, segments = signal.rides(tables.model), tables.timeline.segments
        if rider is not None:
            left = [segment.first for segment in segments if segment.recorded and not segment.active[rider]]
            found[np.isin(counts, left), column] = False
    return found


def _statistics(readings: Array, counted: Mask, at: Array) -> Array:
    """(J, STATISTICS, V) of readings (S, J, V) at stations by their count (S,)."""
    found = np.full((readings.shape[1], layout.STATISTICS, readings.shape[2]), -1.0)  # none has diverged
    seen = counted[:, :, None]
    for value, where, sign in ((layout.LARGEST, layout.LARGEST_AT, 1.0), (layout.SMALLEST, layout.SMALLEST_AT, -1.0)):
        signed = np.where(seen, sign * readings, -np.inf)
        place = np.argmax(signed, axis=0)
        found[:, value] = sign * np.take_along_axis(signed, place[None], axis=0)[0]
        found[:, where] = np.where(np.asarray(counted.any(axis=0))[:, None], at[place], -1.0)
    below: Mask = np.logical_and(seen, readings < 0.0)
    found[:, layout.BELOW_AT] = np.where(np.any(below, axis=0), at[np.argmax(below, axis=0)], -1.0)
    return found


def _squares(tables: SceneTables, loads: Array, time_scale: Array) -> tuple[Array, Array]:
    """(J, V) integrals over time of the sensors' squared readings, and the time in which they count, s.

    Between two of the stations nothing jumps, so the driven part is summed over the middles between them; in free
    vibration all stand where they stopped. Readings are linear in the loads (L, V), so their squares are loads Q loads
    with one matrix Q for all variants, which differ in their pace.
    """
    at, timeline, sensors = tables.statics.counts, tables.timeline, len(tables.sensors)
    parts = [(0.5 * (at[:-1] + at[1:]), np.diff(timeline.moments(at)[1]), time_scale)]
    parked = [segment for segment in timeline.segments if segment.free and segment.recorded]
    if parked:
        parts.append((np.array([parked[0].first + 0.5]), np.ones(1), np.full_like(time_scale, tables.free_seconds)))
    squares, seconds = np.zeros((sensors, time_scale.size)), np.zeros((sensors, time_scale.size))
    for counts, lengths, scale in parts:
        weight = _counted(tables, tables.signals[:sensors], standing(tables.timeline, counts)) * lengths[:, None]
        unit = _unit(tables, counts)[:, :sensors]
        products = np.einsum("sj,sjl,sjm->jlm", weight, unit, unit, optimize=True)
        for row, load in zip(np.moveaxis(products, 1, 0), loads, strict=True):
            squares += (row @ loads) * load * scale
        seconds += weight.sum(axis=0)[:, None] * scale
    return np.maximum(squares, 0.0), seconds
