"""What sensors do after all carriages have come to rest or left: how far they swing on, and how long until they have
settled."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.kernels import layout
from engine.march.settling import STILL, names_of_times, parts_of_bands, split
from engine.model.lane_table import static_loads
from engine.model.scene_model import with_numerics
from engine.model.station_path import standing
from engine.observation.histories import counts_at_rest
from engine.observation.signals import build_sensors
from engine.statics.coupled_modes import CoupledModes, coupled_modes
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.march.march import Marched
    from engine.march.tables import SceneTables
    from engine.model.scene_model import SceneModel
    from engine.scene.study import Study
    from engine.scene.variants import VariantValues

# What is said of the next four was measured on a girder whose trolley's load hangs on a rope, and on a portal's head.
SWINGS = 2.0  # that may come together, each as large as what is seen of them
BEATS = 2.0  # that have to be seen: after one 3.1 s were told where 4.5 are true
#: Modes of the scene whose periods and beats count: 3 to 8 told the same; and of each body that tell them, with static
#: correction: their frequencies were within 6e-4 of those of 64.
LOWEST, FEW = 4, 8
ALIKE = 0.02  # of a frequency, by which modes beat that are no further apart, too slowly: 0.01 to 0.05 told the same
READ = 0.01  # of the reading of the mode that a sensor reads most of: 0.001 told the same, 0.1 left the load's mode out
MOST_STATIONS = 4097  # of a rest on which it is looked for when sensors have settled: 16 of each of 256 swings


def residuals(tables: SceneTables, values: VariantValues, marched: Marched) -> dict[str, Array]:
    """By how much every sensor is off its static value at most, while all carriages rest."""
    if not len(marched.resting):
        return {}
    found, names = dict[str, Array](), list(tables.model.study.sensor)
    for name, static, watched in zip(names, _static(tables, values), marched.resting, strict=False):
        off = np.maximum(watched[layout.LARGEST] - static, static - watched[layout.SMALLEST])
        found[f"{name}_residual"] = np.where(np.isneginf(off), np.nan, off)
    return found


def settling(study: Study) -> list[str]:
    """The sensors of which it is told how long they take to settle."""
    return [name for name, sensor in study.sensor.items() if sensor.settling_band is not None]


def most_settling(study: Study) -> int:
    """So many of these stations at most."""
    return MOST_STATIONS if study.output.residual and settling(study) else 0


def counts_settling(tables: SceneTables) -> Counts:
    """Stations by their count at which it is looked for when sensors have settled; none where that is not told."""
    if not (settling(tables.model.study) and tables.watches_rest):
        return np.zeros(0, dtype=np.int64)
    return counts_at_rest(tables.timeline, MOST_STATIONS)


class Settling(NamedTuple):
    """When sensors have settled. times (V,) by result: how long after all carriages have come to rest or left a sensor
    is off its static value by more than its band, s, and since time 0; NaN where it still is within a period, or two
    beats, of the end, as it may swing out of it again. other_bands (V, 2, `WIDER`) by sensor: the former in bands that
    are wider and narrower than its own by parts of it; what its readings may be off lies between them."""

    times: dict[str, Array]
    other_bands: dict[str, Array]


def settling_times(tables: SceneTables, values: VariantValues, counts: Counts, history: Array) -> Settling:
    """The same by histories (H, J, V) of the sensors at stations by their count."""
    found = Settling({}, {})
    for rest in _rests(tables, values, counts, history):
        settling_time, move_and_settle_time = names_of_times(rest.sensor)
        own, found.other_bands[rest.sensor] = split(rest.settled_within(parts_of_bands()))
        found.times[settling_time], found.times[move_and_settle_time] = own, rest.begins + own
    return found


class Rest(NamedTuple):
    """A sensor at rest: by how much it is off its static value (H, V) and seconds since the stop (H, V), when that is,
    the longest period and the longest swing (V,), and its band."""

    sensor: str
    off: Array
    seconds: Array
    begins: Array
    period: Array
    longest: Array
    band: float

    def settled_within(self, parts: Array) -> Array:
        """(B, V) s after the stop: when it has settled within parts (B,) of its band. What has not left it for a period
        grows by a beat to no more than the sine of the part of it that is seen lets."""
        bands = (parts * self.band)[:, None]
        when, largest = last_beyond(self.off, bands[:, 0], self.seconds), np.fmax.reduce(self.off, axis=0)
        with np.errstate(divide="ignore"):
            grown = np.sin(np.pi * np.minimum(0.5, self.seconds[-1] / self.longest))
        leaves = (self.seconds[-1] < self.period) | (SWINGS * largest > grown * bands)
        may_swing = (largest > STILL * bands) & ((when > 0.0) | np.isnan(when) | leaves)
        return np.where(may_swing & (self.seconds[-1] - when < self.longest), np.nan, when)


def _rests(tables: SceneTables, values: VariantValues, counts: Counts, history: Array) -> Iterator[Rest]:
    """The sensors of which it is told how long they take to settle; history (H, J, V) at stations by their count."""
    own = counts_settling(tables)
    if not own.size:
        return
    readings, seconds = history[np.searchsorted(counts, own)], elapsed(tables, own, values.scene_time_scale).T
    model, along = _of_few_modes(tables.model), standing(tables.timeline, tables.at_rest)
    sensors, modes = build_sensors(model), coupled_modes(model, values, along, LOWEST)
    for j, (name, static) in enumerate(zip(tables.model.study.sensor, _static(tables, values), strict=True)):
        band = tables.model.study.sensor[name].settling_band
        if band is not None:
            off = np.abs(readings[:, j] - static)
            longest = _longest_swings(modes, sensors[j].reads_whole.loose(model, along)[-1])
            yield Rest(name, off, seconds - seconds[0], seconds[0], *longest, band)


def _longest_swings(modes: CoupledModes, row: Array) -> tuple[Array, Array]:
    """(V,) s twice: the longest period of what a sensor's row (N,) reads of the lowest modes of the scene with its
    carriages where they rest, and that or two beats of neighbours among these; 0 where it reads none."""
    omega, shapes = modes
    read = np.abs(np.einsum("n,vnk->vk", row, np.nan_to_num(shapes[:, 0])))
    own = np.where(read > READ * read.max(axis=1, keepdims=True), omega[:, 0], np.nan)
    ordered = np.sort(own, axis=1)  # NaN at the end
    beats = np.diff(ordered, axis=1)
    slowest = np.concatenate([own, np.where(beats > ALIKE * ordered[:, 1:], beats / BEATS, np.nan)], axis=1)
    period, longest = (2.0 * np.pi / np.fmin.reduce(some, axis=1, initial=np.inf) for some in (own, slowest))
    return period, longest


@lru_cache(maxsize=32)
def _of_few_modes(model: SceneModel) -> SceneModel:
    """The same scene with few modes, and with all the masses that the study gives it."""
    own, wanted = model.numerics, model.study.solver.fidelity
    few = own._replace(modes=FEW if own.modes else 0, fidelity=wanted, static_correction=True)
    return with_numerics(model, few)


def last_beyond(off: Array, bands: Array, seconds: Array) -> Array:
    """(B, V) when what is off (H, V) at times (H, V) comes within bands (B,) for good, between stations along a line.

    >>> last_beyond(np.array([[3.0, 0.1], [1.0, 0.2]]), np.array([2.0]), np.array([[0.0, 0.0], [1.0, 1.0]])).tolist()
    [[0.5, 0.0]]
    """
    stations, lanes = len(off), np.arange(off.shape[1])
    largest_from_end = np.maximum.accumulate(np.where(np.isnan(off), np.inf, off)[::-1])
    within = [np.searchsorted(largest_from_end[:, lane], bands, side="right") for lane in lanes]
    last = stations - 1 - np.stack(within, axis=1)  # -1 where none is beyond
    here, after = np.clip(last, 0, stations - 2), np.clip(last + 1, 0, stations - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        part = (off[here, lanes] - bands[:, None]) / (off[here, lanes] - off[after, lanes])
        when = seconds[here, lanes] + part * (seconds[after, lanes] - seconds[here, lanes])
    return np.asarray(np.where(last < 0, 0.0, np.where(last == stations - 1, np.nan, when)))


def _static(tables: SceneTables, values: VariantValues) -> Array:
    """(J, V) static readings of the sensors where all carriages rest."""
    unit, count = tables.statics.at(tables.at_rest), len(tables.model.study.sensor)
    return np.asarray(unit[0, :count] @ static_loads(tables.model, values))


def elapsed(tables: SceneTables, counts: Counts, time_scale: Array) -> Array:
    """(V, H) seconds since time 0 of stations by their count."""
    return seconds_at(tables, counts.astype(np.float64), time_scale[:, None])


def seconds_at(tables: SceneTables, counts: Array, time_scale: Array) -> Array:
    """Seconds since time 0 of stations by their count, by the time scale of each; NaN where the count is negative."""
    timeline = tables.timeline
    index, tau = timeline.moments(counts)
    found = np.where(counts >= 0.0, tau, np.nan) * time_scale
    free = np.array([segment.free for segment in timeline.segments])[index]
    if free.any():
        start = next(segment.first for segment in timeline.segments if segment.free)
        steps = timeline.steps - start
        rest = (counts - start) * (tables.free_seconds / steps)
        found = found + np.where(free, rest, 0.0)
    return found
