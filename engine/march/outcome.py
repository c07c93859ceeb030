"""From what a march observed to the numbers of each variant: extremes, places, statuses, the study's own reduction."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from engine.kernels import layout
from engine.kernels.schemes import Scheme
from engine.march.contact_forces import contact_forces
from engine.march.envelopes import MOST_KEPT, envelope_names
from engine.march.march import Marched
from engine.march.rest import counts_settling, elapsed, residuals, seconds_at, settling_times
from engine.march.richardson import march_scheme
from engine.march.step_rules import between_stations
from engine.march.tables import SceneTables
from engine.model.lane_table import in_whole_blocks, loads_of, static_loads, weights
from engine.model.scene_model import SceneModel
from engine.model.strikes import Strikes
from engine.model.timeline import Window
from engine.observation.contact_forces import contacts_that_react
from engine.observation.cycle_reduction import Cycle, Reduction
from engine.observation.histories import counts_reduced
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.gravest_status import lost
from results_schema.status import Fidelity, SchemeUsed, Status

if TYPE_CHECKING:
    from engine.scene.study import Study

NOWHERE: Counts = np.zeros(0, dtype=np.int64)
STILL = 1e-6  # of the usual reading on its body: a static reading below, as on a support, is rounding (1e-12 at most)

Flat = dict[str, NDArray[Any]]
ENDS = (("max", layout.LARGEST, layout.LARGEST_AT), ("min", layout.SMALLEST, layout.SMALLEST_AT))


@dataclass(frozen=True, eq=False)
class Asked:
    """What a study reports of a variant. accelerated: whether its kind keeps the carriages' accelerations."""

    study: Study
    reduction: Reduction | None
    window: Window
    accelerated: bool
    strikes: Strikes

    @property
    def keeps_histories(self) -> bool:
        """Whether histories of the sensors are a result."""
        return self.study.output.histories != "none"

    @property
    def least_fidelity(self) -> Fidelity:
        """The lowest model that tells these results: statics have no accelerations, and nothing that only motion
        makes, as dynamic parts and what swings on after a stop."""
        moving = self.accelerated or self.study.output.residual
        if moving or any(sensor.is_dynamic_part for sensor in self.study.sensor.values()):
            return Fidelity.FORCE
        return Fidelity.STATIC if self.reduction is None else self.reduction.least_fidelity


@dataclass(frozen=True, eq=False)
class Outcome:
    """What V variants report by one march: numbers (V, ...) by name, histories (H, S, V) of all signals at the stations
    that were asked for, statuses and the first diverged steps (V,), (V, J) what errors of the sensors are divided by,
    infinite for those that read but rounding, and (V,) of `between_stations`. other_bands: by sensor (V, 2, ...) the
    settling times by which the errors of its own are told. shown: histories (V, H) as archives keep them, by name; none
    where they were not asked for."""

    numbers: Flat
    history: Array
    status: NDArray[np.int8]
    diverged_step: Counts
    scale: Array
    between: Array
    other_bands: dict[str, Array] = field(default_factory=dict)
    shown: dict[str, Array] = field(default_factory=dict)

    def of(self, lanes: Counts | NDArray[np.bool_]) -> Outcome:
        """Some of the variants."""
        numbers = {name: array[lanes] for name, array in self.numbers.items()}
        rest = self.status[lanes], self.diverged_step[lanes], self.scale[lanes], self.between[lanes]
        bands = {name: array[lanes] for name, array in self.other_bands.items()}
        return Outcome(numbers, self.history[..., lanes], *rest, bands)

    def replaced(self, lanes: Counts, other: Outcome) -> Outcome:
        """The same with the outcome of other marches for some of the variants, at the same stations."""
        found = deepcopy(self)
        for own, given in ((found.numbers, other.numbers), (found.other_bands, other.other_bands)):
            for name, array in own.items():
                array[lanes] = given[name]
        found.history[..., lanes] = other.history
        found.status[lanes], found.diverged_step[lanes] = other.status, other.diverged_step
        found.scale[lanes], found.between[lanes] = other.scale, other.between
        return found


def outcome(
    asked: Asked,
    tables: SceneTables,
    values: VariantValues,
    stations: Counts,
    halted: Callable[[], bool] = lambda: False,
    shown: Counts = NOWHERE,
) -> Outcome:
    """March variants with some tables; ``stations``: of which histories are wanted, by their count; ``shown``: of which
    they are kept in archives. Raises Halted."""
    own = counts_reduced(tables.timeline, asked.reduction.stations) if asked.reduction is not None else stations[:0]
    watched = (counts_settling(tables), *(side.counts for side in tables.kinks))
    counts = np.unique(np.concatenate([own, stations, shown, *watched]))
    lanes, size = in_whole_blocks(values), values.size
    marched = march_scheme(tables, lanes, counts, size, halted, len(tables.signals) if stations.size else None)
    _silence(tables, marched)
    history = marched.history[np.searchsorted(counts, stations)]
    reduction = marched.history[np.searchsorted(counts, own), : len(asked.study.sensor)]
    settling = settling_times(tables, values, counts, marched.history)
    numbers = {
        **_extremes(tables, values, marched, counts),
        **residuals(tables, values, marched),
        **settling.times,
        **contact_forces(tables, values, marched),
        **_envelopes(tables, lanes, size, halted),
        **_statics(tables, values),
        **_reduced(asked.reduction, tables, values, own, reduction),
    }
    status, diverged_step = _status(tables.model, marched)
    nothing = lost(status)
    for array in numbers.values():
        if array.dtype == np.float64:
            array[nothing] = np.nan
    kept = _described(tables, values, shown, marched, counts) if shown.size else {}
    scale, between = _scale(tables, values, numbers), between_stations(tables.model, values, tables.steps)
    return Outcome(numbers, history, status, diverged_step, scale, between, settling.other_bands, kept)


USED = ("fidelity_used", "scheme_used", "modes_used", "steps_used")  # what a variant is marched again by


def used(tables: SceneTables, size: int) -> Flat:
    """What so many variants were computed with, by the names of the archive."""
    marched = 0 if _rests(tables) else tables.steps
    knows_all = _rests(tables) and tables.model.numerics.static_correction  # statics of the whole body
    return {
        "fidelity_used": np.full(size, int(tables.model.fidelity), dtype=np.int8),
        "scheme_used": np.full(size, int(number_of(tables.model.scheme)), dtype=np.int8),
        "modes_used": np.full(size, 0 if knows_all else tables.model.body_modes, dtype=np.int32),
        "steps_used": np.full(size, marched, dtype=np.int32),
        "work": np.full(size, float(marched * tables.model.body_modes)),
    }


def number_of(scheme: Scheme) -> SchemeUsed:
    """A scheme as archives number it."""
    return SchemeUsed.__members__.get(scheme.name.upper().replace("-", "_"), SchemeUsed.OTHER)


def _rests(tables: SceneTables) -> bool:
    """Whether nothing is marched."""
    return tables.model.fidelity is Fidelity.STATIC


def _silence(tables: SceneTables, marched: Marched) -> None:
    """Let sensors that read nothing but rounding read 0."""
    for j in tables.silent:
        marched.history[:, j] = np.where(np.isfinite(marched.history[:, j]), 0.0, marched.history[:, j])
        for statistics in (part[j] for part in (marched.statistics, marched.resting) if len(part)):
            for mark in (layout.LARGEST, layout.SMALLEST, layout.SQUARES):
                statistics[mark] = np.where(np.isfinite(statistics[mark]), 0.0, statistics[mark])


def _extremes(tables: SceneTables, values: VariantValues, marched: Marched, counts: Counts) -> Flat:
    """Largest and smallest value of every sensor, where the first carriage was then, when that was if it is asked for,
    and the root mean square."""
    found: Flat = {}
    for side in tables.kinks:
        reading = np.tensordot(side.weights, marched.history[np.searchsorted(counts, side.counts), side.sensor], 1)
        _include(marched.statistics[side.sensor], reading, side.at)
    for j, sensor in enumerate(tables.sensors[: len(tables.model.study.sensor)]):
        statistics = marched.statistics[j]
        seen = np.isfinite(statistics[layout.LARGEST]) | np.isnan(statistics[layout.LARGEST])
        for end, value, at in ENDS:
            found[f"{sensor.name}_{end}"] = np.where(seen, statistics[value], np.nan)
            found[f"{sensor.name}_{end}_position"] = tables.timeline.positions(0, statistics[at])
            if tables.model.study.output.times:
                found[f"{sensor.name}_{end}_time"] = seconds_at(tables, statistics[at], values.scene_time_scale)
        found[f"{sensor.name}_rms"] = np.sqrt(
            statistics[layout.SQUARES] / np.where(statistics[layout.SECONDS] > 0.0, statistics[layout.SECONDS], 1.0)
        )
    return found


def _include(statistics: Array, reading: Array, at: float) -> None:
    """Let a reading (V,) at a moment, given by its count, count among a sensor's extremes."""
    for (_, value, place), beyond in zip(ENDS, (np.greater, np.less), strict=True):
        more = beyond(reading, statistics[value])
        statistics[value] = np.where(more, reading, statistics[value])
        statistics[place] = np.where(more, at, statistics[place])


def _envelopes(own: SceneTables, values: VariantValues, size: int, halted: Callable[[], bool]) -> Flat:
    """(V, places) largest and smallest values of every envelope, from marches that watch its places alone."""
    found: dict[str, list[Array]] = {name: [] for name in envelope_names(own.model.study)}
    nothing = np.zeros(0, dtype=np.int64)
    for tables in own.companions:
        marched = march_scheme(tables, values, nothing, size, halted)
        for j, place in enumerate(tables.sensors):
            for end, value, _ in ENDS:
                found[f"{place.name}_envelope_{end}"].append(marched.statistics[j, value])
        if len(own.companions) > MOST_KEPT:
            tables.forget()
    return {name: np.stack(readings, axis=1) for name, readings in found.items()}


def _status(model: SceneModel, marched: Marched) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Status of every variant, and the first step at which it had diverged, or -1."""
    bad = np.concatenate([marched.statistics[:, layout.DIVERGED_AT], marched.unrecorded[:, layout.DIVERGED_AT]])
    first = np.min(np.where(bad >= 0.0, bad, np.inf), axis=0)
    sensors = len(marched.statistics) - len(marched.unrecorded)
    lifting = [number for number, force in enumerate(contacts_that_react(model)) if model.may_lift(force.carriage)]
    both = marched.statistics[[sensors + c for c in lifting]], marched.unrecorded[lifting]
    below = np.concatenate([part[:, layout.BELOW_AT] for part in both])
    separated = (below >= 0.0).any(axis=0)
    status = np.where(separated, np.int8(Status.SEPARATED), np.int8(Status.OK))
    status = np.where(marched.status != Status.OK, marched.status, status).astype(np.int8)
    return status, np.where(np.isfinite(first), first, -1.0).astype(np.int64)


def _statics(tables: SceneTables, values: VariantValues) -> Flat:
    """The largest absolute static reading of every sensor while the carriages go their way, by the same model; 0 where
    that is rounding."""
    unit, loads, least = tables.statics.over_window, static_loads(tables.model, values), _least_static(tables, values)
    found: Flat = {}
    for j, sensor in enumerate(tables.sensors[: len(tables.model.study.sensor)]):
        read = np.flatnonzero(np.any(unit[:, j] != 0.0, axis=0))
        if read.size == 1:
            static = np.abs(unit[:, j, read[0]]).max() * np.abs(loads[read[0]])
        else:
            static = _largest_static(unit[:, j, read], loads[read])
        found[f"{sensor.name}_static"] = np.where((static > least[:, j]) & (j not in tables.silent), static, 0.0)
    return found


def _least_static(tables: SceneTables, values: VariantValues) -> Array:
    """(V, sensors) the least static reading that is more than rounding; of a rate in its unit."""
    return np.outer(np.abs(weights(tables.model, values)).sum(axis=0), STILL * tables.static_scales)


def _largest_static(unit: Array, loads: Array) -> Array:
    """(V,) largest |sum of unit readings (H, L) times loads (L, V)|, in pieces of variants."""
    found = np.empty(loads.shape[1])
    for first in range(0, found.size, 1024):
        part = slice(first, first + 1024)
        found[part] = np.abs(_of_loads(unit[:, None], loads[:, part])[:, 0]).max(axis=0)
    return found


def _scale(tables: SceneTables, values: VariantValues, numbers: Flat) -> Array:
    """(V, J) the largest static value of every sensor; its own largest where that is none, as of a rate, or where
    something pushes its body that statics do not look at, and no less than statics that are rounding;
    infinite where nothing is but rounding."""
    columns, least = [], _least_static(tables, values)
    count = len(tables.model.study.sensor)
    for j, sensor in enumerate(tables.sensors[:count]):
        static = np.asarray(numbers[f"{sensor.name}_static"], dtype=np.float64)
        own = np.maximum(*(np.abs(np.asarray(numbers[f"{sensor.name}_{end}"])) for end in ("max", "min")))
        if not sensor.offset_order:
            pushed = tables.model.exceeds_statics(sensor.body)
            own = np.maximum(least[:, j], np.where(pushed | (static == 0.0), np.maximum(static, own), static))
        columns.append(own)
    found = np.stack(columns, axis=1) if columns else np.zeros((values.size, 0))
    found[:, tables.silent] = np.inf
    return np.where(found > 0.0, found, np.inf)


def histories(
    tables: SceneTables, values: VariantValues, counts: Counts, halted: Callable[[], bool]
) -> dict[str, Array]:
    """(V, H) histories of the sensors and of the carriages' ways at stations by their count."""
    marched = march_scheme(tables, in_whole_blocks(values), counts, values.size, halted)
    _silence(tables, marched)
    return _described(tables, values, counts, marched, counts)


def _described(
    tables: SceneTables, values: VariantValues, counts: Counts, marched: Marched, sampled: Counts
) -> dict[str, Array]:
    """The same of what was marched and ``sampled`` at these stations and others."""
    time_scale, places = values.scene_time_scale, np.searchsorted(sampled, counts)
    arrays: dict[str, Array] = {"elapsed": elapsed(tables, counts, time_scale)}
    for j, sensor in enumerate(tables.sensors):
        arrays[sensor.name] = marched.history[places, j].T
    for c, carriage in enumerate(tables.model.carriages):
        path = tables.timeline.motion(c, counts.astype(np.float64))
        arrays[f"{carriage.name}_position"] = np.repeat(path.S[None, :], values.size, axis=0)
        arrays[f"{carriage.name}_speed"] = path.dS / time_scale[:, None]
        arrays[f"{carriage.name}_acceleration_along"] = path.ddS / time_scale[:, None] ** 2
    nothing = lost(_status(tables.model, marched)[0])
    for name, array in arrays.items():
        if name != "elapsed":
            array[nothing] = np.nan
    return {name: np.ascontiguousarray(array) for name, array in arrays.items()}


def _reduced(
    reduction: Reduction | None, tables: SceneTables, values: VariantValues, counts: Counts, history: Array
) -> Flat:
    """The study's own results (V, ...) from histories (H, J, V) of its cycle; none where it has no such."""
    if reduction is None:
        return {}
    tau = tables.timeline.moments(counts)[1]
    cycle = Cycle(
        phase=(tau - tau[0]) / (tau[-1] - tau[0]),
        position=tables.timeline.positions(0, counts.astype(np.float64)),
        history=history,
        motion=tables.model.clock,
        find_static=lambda: _static_histories(tables, values, counts),
        find_slope=lambda: _static_slopes(tables, values, counts),
    )
    return dict(reduction(cycle))


def _static_histories(tables: SceneTables, values: VariantValues, counts: Counts) -> Array:
    """(H, J, V) static readings of the sensors at stations by their count."""
    return _of_loads(tables.statics.at(counts), static_loads(tables.model, values))


def _static_slopes(tables: SceneTables, values: VariantValues, counts: Counts) -> Array:
    """(H, J, V) their derivative by the position of the first carriage, as far as its own weight makes it."""
    loads = weights(tables.model, values)
    loads[1:] = 0.0
    return _of_loads(tables.statics.slope_at(counts)[:, :, :-1], loads_of(tables.model, values, loads))


def _of_loads(unit: Array, loads: Array) -> Array:
    """(H, J, V) readings (H, J, L) per unit of loads (L, V) under all of them."""
    found = np.zeros((*unit.shape[:2], loads.shape[1]))
    for number, load in enumerate(loads):
        found += unit[:, :, number, None] * load
    return found


#: Of the largest static value: where less vibrates, the logarithm of errors does not follow it. With 1e-4 7 % of the
#: estimated errors of a sweep were too small, with 2e-4 to 5e-4 2 %, with 1e-3 more of another missed near resonances.
QUIET = 3e-4


def vibration(tables: SceneTables, values: VariantValues, counts: Counts, found: Outcome) -> Array:
    """(V,) logarithm of how much histories (H, S, V) at stations by their count vibrate about statics: the largest
    second difference over the largest static value, which leaves out what follows the load slowly."""
    sensors = len(tables.model.study.sensor)
    off = (found.history[:, :sensors] - _static_histories(tables, values, counts)) / found.scale.T
    largest = np.max(np.abs(np.diff(off, n=2, axis=0)), axis=(0, 1), initial=0.0)
    return np.asarray(np.log(np.fmax(largest, QUIET)))
