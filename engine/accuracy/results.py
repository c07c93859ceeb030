"""Every number that a study reports of a variant, the tolerance that it is held to, and how far two marches differ.

Results come in families (`FAMILIES`); a family names its results, and what tells by how much each differs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from engine.march.envelopes import envelope_names
from engine.march.settling import names_of_times
from engine.model.lane_table import weights
from engine.observation.contact_forces import contacts_that_react
from engine.observation.cycle_reduction import HISTORY_PART, Compared
from results_schema.arrays import Array
from results_schema.gravest_status import lost
from results_schema.quantities import QUANTITIES
from results_schema.variables import WHERE_OR_WHEN

if TYPE_CHECKING:
    from engine.march.outcome import Asked, Outcome
    from engine.model.scene_model import SceneModel
    from engine.scene.sensors import Envelope, Sensor
    from engine.scene.study import Study
    from engine.scene.variants import VariantValues


ENDS = ("max", "min")
#: Of `HISTORY_PART`, what root mean squares may be off by, in which errors of either sign cancel. With 1 15 % of 141
#: told errors in 40 sweeps at 1e-3 were more than 30 times the true ones, with 0.4 1 %, and as few below these; with
#: 0.2 three times as many were below.
OF_MEAN_SQUARES = 0.4


class Result(NamedTuple):
    """A reported number. of: the sensor, carriage or envelope that it is read of. tolerance: that of its own, NaN where
    its error is only told; follows: whether it is `solver.tolerance`, which a sweep may set; slow: whether its error
    falls only by the number of modes, or slower still."""

    name: str
    of: str
    tolerance: float = np.nan
    follows: bool = False
    slow: bool = False


@dataclass(frozen=True, eq=False)
class Pair:
    """Two outcomes of the same variants of a scene. apart (S, V): the largest difference of the histories of every
    signal at common stations, usually (S, V): what all but a few stations differ by at most. part: of the latter that
    values on histories are off by at least. Its methods tell by how much a result differs, (V,), over the scale that
    the second has.
    """

    asked: Asked
    model: SceneModel
    values: VariantValues
    one: Outcome
    other: Outcome
    apart: Array
    usually: Array
    part: float = HISTORY_PART

    def gap(self, name: str) -> Array:
        """|difference| of a result; 0 where neither has a number, infinite where only one has."""
        left, right = self.one.numbers[name], self.other.numbers[name]
        gap: Array = np.where(np.isnan(left) & np.isnan(right), 0.0, np.abs(left - right))
        return np.where(np.isnan(gap), np.inf, gap)

    def extreme(self, name: str, sensor: int) -> Array:
        """An extreme of a sensor, no less than a part of what its histories differ by."""
        gap = np.maximum(self.gap(name), self.part * self.usually[sensor])
        return np.asarray(gap / self.other.scale[:, sensor])

    def mean_square(self, name: str, sensor: int) -> Array:
        """A root mean square of a sensor, likewise."""
        gap = np.maximum(self.gap(name), OF_MEAN_SQUARES * self.part * self.usually[sensor])
        return np.asarray(gap / self.other.scale[:, sensor])

    def place(self, name: str) -> Array:
        """A place, over the length of the first carriage's track."""
        return self.gap(name) / self.model.riders[0].length

    def instant(self, name: str) -> Array:
        """The time of an extreme, over that of one passage or cycle."""
        return np.asarray(self.gap(name) / self.values.scene_time_scale)

    def duration(self, name: str) -> Array:
        """A time that something takes, over itself."""
        return _over(self.gap(name), np.abs(self.other.numbers[name]))

    def history(self, sensor: int) -> Array:
        """A kept history."""
        return np.asarray(self.apart[sensor] / self.other.scale[:, sensor])

    def acceleration(self, signal: int) -> Array:
        """The history of a carriage's acceleration, over its largest."""
        return _over(self.apart[signal], np.nanmax(np.abs(self.other.history[:, signal]), axis=0, initial=0.0))

    def contact_force(self, name: str, carriage: int) -> Array:
        """An extreme of a contact force, over the weight; of a force that pulsates over its own largest value."""
        forces = contacts_that_react(self.model)
        histories = self.usually[len(self.usually) - len(forces) :]
        apart = histories[[force.carriage == carriage for force in forces]].max(axis=0, initial=0.0)
        scale = np.abs(self._weights[carriage])
        if carriage in self.model.pulsating:
            stem, _, _ = name.rpartition("_")
            scale = np.maximum(*(np.abs(self.other.numbers[f"{stem}_{end}"]) for end in ENDS))
        return _over(np.maximum(self.gap(name), self.part * apart), scale)

    def envelope(self, name: str) -> Array:
        """Extremes along a body, over the largest anywhere."""
        return _over(np.max(self.gap(name), axis=1), np.max(np.abs(self.other.numbers[name]), axis=1))

    def cycle(self, name: str, sensor: int) -> Array:
        """What the kind of study makes of the history of a cycle."""
        return np.asarray(np.where(np.isinf(self.other.scale), 0.0, self._cycles[name])[:, sensor])

    @cached_property
    def _weights(self) -> Array:
        return weights(self.model, self.values)

    @cached_property
    def _cycles(self) -> Mapping[str, Array]:
        assert self.asked.reduction is not None
        apart = self.apart[: len(self.asked.study.sensor)]
        compared = Compared(self.one.numbers, self.other.numbers, self.other.scale, apart, self.values, self.part)
        return self.asked.reduction.differences(compared)


READINGS, RESIDUAL = {"max": Pair.extreme, "min": Pair.extreme, "rms": Pair.mean_square}, {"residual": Pair.extreme}
Entry = tuple[Result, Callable[[Pair], Array]]  # and how far it is apart


def _of_sensors(asked: Asked) -> Iterator[Entry]:
    for j, (name, sensor) in enumerate(asked.study.sensor.items()):
        extreme, history = _held_of(asked, sensor, "extreme"), _held_of(asked, sensor, "history")
        slow = _is_slow(asked, sensor)
        for end, apart in (READINGS | RESIDUAL if asked.study.output.residual else READINGS).items():
            yield Result(f"{name}_{end}", name, *extreme, slow), partial(apart, name=f"{name}_{end}", sensor=j)
        for own in (f"{name}_{end}_position" for end in ENDS):
            yield Result(own, name), partial(Pair.place, name=own)
        for own in (f"{name}_{end}_time" for end in ENDS * asked.study.output.times):
            yield Result(own, name), partial(Pair.instant, name=own)
        if sensor.settling_band is not None:
            for own in names_of_times(name):
                yield Result(own, name), partial(Pair.duration, name=own)
        if asked.keeps_histories:
            yield Result(name, name, *history, slow), partial(Pair.history, sensor=j)


#: Orders of derivatives of which extremes, and histories, converge well with modes where a load comes at an instant
#: onto a place that gives way, as it strikes every mode. Of 96 variants on springs the estimated errors of moments with
#: 64 modes were 9 times the true ones (of extremes 1e-8 to 3e-5), of reactions 10 to 1,000 times.
MOST_ORDERS = {"extreme": 2, "history": 1}


def _held_of(asked: Asked, sensor: Sensor, sort: Literal["extreme", "history"]) -> tuple[float, bool]:
    """The tolerance of a sensor's readings, and whether it is the study's; none where they hardly converge: so do
    histories of accelerations at the instants when an unsprung mass comes onto a body or over a support."""
    hardly = asked.strikes.arrive and sensor.reads.order > MOST_ORDERS[sort]
    struck = asked.strikes.unsprung and sensor.reads.rate > 1 and sort == "history"
    if sensor.tolerance is None and (hardly or struck):
        return np.nan, False
    return _held(asked.study, sensor, sensor.tolerance)


def _is_slow(asked: Asked, sensor: Sensor) -> bool:
    """Whether a sensor's readings converge no faster than the number of modes grows: forces of masses that come at once
    to where a body gives way, and accelerations there. With 64 modes of 120 of a girder on springs the errors of these
    were told 2 to 79 times too small by the last changes alone, as an extreme happens to stay."""
    if sensor.reads.of_contact and not sensor.reads.of_suspension:
        return asked.strikes.masses_arrive
    struck = asked.strikes.arrive or asked.strikes.leave
    return struck and sensor.reads.rate > 1 and sensor.frequency_limit is None


def _of_accelerations(asked: Asked) -> Iterator[Entry]:
    for j, name in enumerate(asked.study.carriage if asked.accelerated else (), start=len(asked.study.sensor)):
        yield Result(f"{name}_acceleration_across", name), partial(Pair.acceleration, signal=j)


def _of_contact_forces(asked: Asked) -> Iterator[Entry]:
    slow = asked.strikes.masses_arrive
    for c, name in enumerate(asked.study.carriage):
        for own in (f"{name}_contact_force_{end}" for end in ENDS):
            yield Result(own, name, slow=slow), partial(Pair.contact_force, name=own, carriage=c)
        own = f"{name}_contact_force_min_position"
        yield Result(own, name), partial(Pair.place, name=own)


def _of_envelopes(asked: Asked) -> Iterator[Entry]:
    for name in envelope_names(asked.study):
        own = name.rpartition("_envelope_")[0]
        held = _held(asked.study, asked.study.envelope[own], None)
        yield Result(name, own, *held), partial(Pair.envelope, name=name)


def _of_cycles(asked: Asked) -> Iterator[Entry]:
    for result in () if asked.reduction is None else asked.reduction.compared:
        for j, (name, sensor) in enumerate(asked.study.sensor.items()):
            held = _held(asked.study, sensor, sensor.tolerance)
            yield Result(f"{result} {name}", name, *held), partial(Pair.cycle, name=result, sensor=j)


FAMILIES = (_of_sensors, _of_accelerations, _of_contact_forces, _of_envelopes, _of_cycles)


def results_of(asked: Asked) -> tuple[Result, ...]:
    """All results of a study whose error is measured, in the order of `differences`."""
    return tuple(result for family in FAMILIES for result, _ in family(asked))


def between_peaks(asked: Asked, own: Outcome) -> Array:
    """(R, V) what a march may miss of extremes between stations, over the scale of each result: marches of twice the
    steps may have the same stations, and then tell nothing of it."""
    sensors = {f"{name}_{end}": j for j, name in enumerate(asked.study.sensor) for end in ENDS}
    found = np.zeros((len(results_of(asked)), own.between.size))
    for r, result in enumerate(results_of(asked) if own.between.any() else ()):
        if result.name in sensors:
            size = np.nan_to_num(np.abs(own.numbers[result.name]))
            found[r] = own.between * size / own.scale[:, sensors[result.name]]
    return found


def differences(
    asked: Asked, model: SceneModel, values: VariantValues, one: Outcome, other: Outcome, part: float = HISTORY_PART
) -> Array:
    """(R, V) how far two outcomes of the same variants are apart, by result: over the scale of each that ``other`` has;
    values on histories by ``part`` of what these differ by, at least. Infinite where only ``one`` has diverged, NaN
    where the other has."""
    with np.errstate(invalid="ignore", over="ignore"):  # of those that have diverged
        pair = Pair(asked, model, values, one, other, *_apart(one, other), part)
        found = np.stack([apart(pair) for family in FAMILIES for _, apart in family(asked)])
    found[:, lost(one.status)] = np.inf
    found[:, lost(other.status)] = np.nan
    return found


def _held(study: Study, reads: Sensor | Envelope, own: float | str | None) -> tuple[float, bool]:
    """The tolerance of what a sensor or an envelope reads, and whether it is the study's: accelerations that count the
    modes up to a limit converge."""
    if own is None:
        told = QUANTITIES[reads.quantity].told and reads.frequency_limit is None
        return (np.nan, False) if told else (study.solver.tolerance, True)
    return (np.nan if own == "told" else float(own), False)


def deciding(results: tuple[Result, ...], tolerance: float) -> tuple[Result, ...]:
    """The results by which it is decided what is computed with: those that are held, else all as if they were held to
    ``tolerance``, but for places and times of settling, which jump, and contact forces beside anything else."""
    if any(np.isfinite(result.tolerance) for result in results):
        return results
    jump = (*WHERE_OR_WHEN, *names_of_times(""))
    left_out = (*jump, *(f"_contact_force_{end}" for end in ENDS))
    left_out = jump if all(result.name.endswith(left_out) for result in results) else left_out
    return tuple(r if r.name.endswith(left_out) else r._replace(tolerance=tolerance, follows=True) for r in results)


def tolerances(results: tuple[Result, ...]) -> Array:
    """(R,) tolerances; NaN where the error is only told."""
    return np.array([result.tolerance for result in results])


def worst_held(errors: Array, results: tuple[Result, ...], tighter: Array | float = 1.0) -> Array:
    """(V, ...) the largest of errors (R, V, ...) over their tolerances, NaN where one that is held is not known; -inf
    where none is held. tighter (V,): `solver.tolerance` of each variant over the study's."""
    found = np.full(errors.shape[1:], -np.inf)
    for result, error in zip(results, errors, strict=True):
        if np.isfinite(result.tolerance):
            found = np.maximum(found, error / (result.tolerance * (tighter if result.follows else 1.0)))
    return found


#: Of common stations: of 33 all, of 85 all but two (with 0.95 a moment was told a tenth too small). Where a wheel comes
#: onto a support forces jump, and two marches are far apart at a few of them, but not in their extremes: on a runway
#: with two wheels the errors of reactions were told ten times too large.
NOT_A_FEW = 0.97


def _apart(one: Outcome, other: Outcome) -> tuple[Array, Array]:
    """(S, V) the largest difference of the histories of every signal at common stations, and what all but a few of
    these differ by at most."""
    left, right = one.history, other.history
    gap = np.where(np.isnan(left) & np.isnan(right), 0.0, np.abs(left - right))  # of a sensor that moves along
    gap = np.where(np.isnan(gap), np.inf, gap)
    if not gap.size:
        nothing = np.zeros(gap.shape[1:])
        return nothing, nothing
    place = int(np.ceil(NOT_A_FEW * (len(gap) - 1)))
    return gap.max(axis=0), np.partition(gap, place, axis=0)[place]


def _over(gap: Array, scale: Array) -> Array:
    """A gap over its scale; 0 where there is none."""
    return np.asarray(np.divide(gap, scale, out=np.where(gap > 0.0, np.inf, 0.0), where=scale > 0.0))
