"""How large does it get? Extremes of every sensor and of the contact force, and the dynamic amplification."""

from __future__ import annotations

from functools import partial

import numpy as np

from engine.scene.study import Study
from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variables import MARCH, declare
from studies.findings.absolute_errors import errors_of_size, uncertainty
from studies.findings.amplification import (
    DYNAMIC_AMPLIFICATION,
    beside,
    largest,
    only_rounding,
    sizes,
    told_amplification,
    with_amplification,
    with_own_weight,
)
from studies.findings.beyond import (
    LIMIT,
    MOST_TOLD,
    AskedOfPassages,
    check_least_contact,
    check_limits,
    largest_size,
    ranked,
    told_limit,
    where_beyond,
)
from studies.findings.contacts import told_contacts, told_low_contacts, told_uplift
from studies.findings.effects import (
    best_choice,
    by_effect,
    hardly_changed,
    of_absorbers,
    told_both_ways,
    told_effects,
    unchanged,
)
from studies.findings.envelopes import beyond_sensors, sizes_along, told_along
from studies.findings.in_step import told_between_speeds, told_in_step, told_pulsation
from studies.findings.residual import asks_of_rest, check_residual, crosses, most_ringing, residuals
from studies.protocol.study import Kind, question_of
from studies.results.axes import PACES, VARIANT
from studies.results.findings_common import check_sensors, first_carriage, in_words, told_statuses, while_held
from studies.results.formatting import listed, number, once, percent, quantity, times
from studies.results.places import Index
from studies.results.results import Results

MOST_SENSORS = 6
#: Of the largest value: so much less beside it is told. A parabola that falls by it is 0.4 % higher between two values;
#: where 6, 12 and 30 % less was beside the largest value of three bridges, 2.6, 4.8 and 4.2 % more lay between.
LEAST_BESIDE = 0.03
#: A table whose tool is 15 um off its static way is told an amplification of 1.01.
OF_LARGEST = (
    'It compares largest values; a sensor with part = "dynamic" reads how far it is from statics on the way, and what '
    "has the other sign, such as an uplift, may be amplified more."
)

declare("passage", *MARCH, DYNAMIC_AMPLIFICATION)


class Passage(Kind):
    """The kind "passage"."""

    name = "passage"
    summary = "largest and smallest of every sensor and of the contact force, dynamic amplification"
    question = "How large does the response get, and does the contact hold?"
    settings = AskedOfPassages
    names_limits = True
    drawn_by = "studies.pictures.passage"

    def check(self, study: Study) -> None:
        """Something moves and something is measured."""
        first_carriage(study)
        check_sensors(study)
        check_limits(study, question_of(study, AskedOfPassages))
        check_least_contact(study, question_of(study, AskedOfPassages))
        check_residual(study, question_of(study, AskedOfPassages))

    def summarise(self, dataset: xr.Dataset, study: Study) -> xr.Dataset:
        return with_amplification(dataset, study)

    def findings(self, results: Results) -> list[str]:
        envelopes, sensors = _told(results)
        told = (_largest, _amplified, _limited, partial(told_uplift, of=sensors))
        said = [told_along(results, name) for name in envelopes]
        said += [
            _nothing(results, sensor)
            if only_rounding(results, sensor)
            else "".join(tell(results, sensor) for tell in told)
            for sensor in sensors
        ]
        said = once(OF_LARGEST, _with_remark(said, told_between_speeds(results)))
        if sensors:  # of which those after the first may be cut
            first = sensors[0]
            said[len(envelopes)] += _limited_besides(results, first) + _amplified_besides(results, first)
        said[0] += _effects(results, envelopes, sensors) + _in_step(results, envelopes, sensors)
        lifted, kept = told_contacts(results)
        asked = question_of(results.study, AskedOfPassages)
        residual, low = residuals(results, asked), told_low_contacts(results, asked.least_contact)
        if crosses(results):  # what swings on then is beside the question
            return [*said[:1], *residual[:1], *low, *lifted, *said[1:], *residual[1:], *kept, *told_statuses(results)]
        both = [*residual[:1], *said[:1]] if asks_of_rest(results.study, asked) else [*said[:1], *residual[:1]]
        return [*both, *low, *lifted, *residual[1:], *said[1:], *kept, *told_statuses(results)]

    def named(self, results: Results) -> list[Index]:
        """For every sensor of the answer the variants with the largest value and the largest amplification, and those
        that swing on most; those of envelopes that it begins with."""
        envelopes, sensors = _told(results)
        places = [largest(results, sizes_along(results, name)) for name in envelopes]
        places += [place for sensor in sensors for place in _extremes(results, sensor)]
        return [*(place for place in places if place is not None), *most_ringing(results)]


KIND = Passage()


def _told(results: Results) -> tuple[list[str], list[str]]:
    """The envelopes with a limit that say more than sensors do, and the sensors that the answer is about."""
    limits, envelopes = question_of(results.study, AskedOfPassages), beyond_sensors(results)
    told = {results.study.envelope[name].quantity for name in envelopes}
    return envelopes, ranked(results, limits, told)[:MOST_SENSORS]


def _nothing(results: Results, sensor: str) -> str:
    """Of a sensor that reads nothing, why."""
    if not results.study.sensor[sensor].is_dynamic_part:
        return f"{sensor}: it reads nothing but rounding."
    if results.study.solver.fidelity == "static":
        return f"{sensor}: statics have no dynamic part."
    off = float(np.nanmax(errors_of_size(results, sensor), initial=0.0))
    return f"{sensor}: statics hold the tolerance: the dynamic part is 0 ± {quantity(off, results.sensors[sensor], 2)}."


def _extremes(results: Results, sensor: str) -> tuple[Index | None, Index | None]:
    """The variants with the largest value and with the largest amplification of one sensor."""
    gain = told_amplification(results, sensor)
    return largest(results, sizes(results, sensor)), largest(results, gain)


def _largest(results: Results, sensor: str) -> str:
    """The largest value and the largest amplification of one sensor, and where they are, while the contact holds."""
    gain, (top, best) = told_amplification(results, sensor), _extremes(results, sensor)
    if top is None:
        return f"{sensor}: no variant has values."
    between = _between(results, sizes(results, sensor), top)
    value = _value(results, sensor, top)
    said = f"{sensor}: {while_held(results)}the largest {results.noun(sensor)} {results.place(sensor)} is {value}"
    if same := unchanged(results, sizes(results, sensor)):
        return f"{said} and {same}."
    where = f"{in_words(results, top)}{_at_the_end(results, top)}"
    level = hardly_changed(results, sizes(results, sensor), partial(quantity, units=results.sensors[sensor]))
    where = f" and {level}" if level else where
    best = top if best is not None and hardly_changed(results, gain, number) else best
    if best is None:
        return f"{said}{where}{between}."
    size = float(sizes(results, sensor)[best])
    whole, static = (quantity(one, results.sensors[sensor]) for one in (size, size / float(gain[best])))
    digits = 4 if whole != static and number(gain[best]) == "1" else 3  # not "54.7 mm, as large as the static 54.6 mm"
    amplified = times(float(gain[best]), f"the static {static}", digits)
    amplified += with_own_weight(results.study, sensor)
    there = f"{in_words(results, best)}{_at_the_end(results, best)}"
    if best == top or there == where:
        return f"{said}, {amplified}{where and f',{where}'}{between}."
    loosely = uncertainty(results, f"dynamic_amplification {sensor}", best)
    return f"{said}{where}{between}; relative to statics it is largest{there}: {amplified}{loosely}."


def _effects(results: Results, envelopes: list[str], sensors: list[str]) -> str:
    """What every swept number does to what the answer begins with, where there are several; "" else."""
    error: Array | float = 0.0
    if envelopes:
        name = envelopes[0]
        what, values = (
            f"{results.noun_along(name)} along {results.study.envelope[name].body}",
            sizes_along(results, name),
        )
        units = results.envelopes[name]
    else:
        what, values = results.noun(sensors[0]), sizes(results, sensors[0])
        error, units = errors_of_size(results, sensors[0]), results.sensors[sensors[0]]
        if hardly_changed(results, values, partial(quantity, units=units)):
            return told_both_ways(results, values, f"the largest {what}", units, error)
    best = best_choice(results, values, of_absorbers(results))
    least = f" The largest {what} is least, {quantity(best.value, units)}{best.end}, at {best.where}." if best else ""
    said = told_effects(results, values, f"the largest {what}", error)
    ways = told_both_ways(results, values, f"the largest {what}", units, error)
    return f"{least} {said}{ways}" if said else f"{least}{ways}"


def _in_step(results: Results, envelopes: list[str], sensors: list[str]) -> str:
    """Where axles or a pulsation push in step, as seen from where what the answer begins with is largest."""
    values = sizes_along(results, envelopes[0]) if envelopes else sizes(results, sensors[0])
    top = largest(results, values)
    return "" if top is None else told_in_step(results, top) + told_pulsation(results, top)


def _amplified(results: Results, sensor: str) -> str:
    """Where statics are exceeded by as much as the question names; "" without anything to compare."""
    gain, study = told_amplification(results, sensor), results.study
    known = np.isfinite(np.where(results.with_values, gain, np.nan)).any()
    says_nothing = study.sensor[sensor].is_dynamic_part or study.solver.fidelity == "static"
    if says_nothing or results.size < 2 or not known:
        return ""
    threshold = question_of(results.study, AskedOfPassages).amplification
    where = where_beyond(results, gain, threshold, results.axis(*PACES))
    said = f" The dynamic amplification exceeds {number(threshold)} {where}."
    parts = any(one.is_dynamic_part for one in study.sensor.values())
    return said if parts or not where.startswith("nowhere") else f"{said} {OF_LARGEST}"


def _amplified_besides(results: Results, told: str) -> str:
    """Which sensors besides that one exceed statics by as much as the question names, the most first."""
    wholes = [name for name in results.sensors if name != told and not results.study.sensor[name].is_dynamic_part]
    gains = {name: np.where(results.with_values, told_amplification(results, name), np.nan) for name in wholes}
    most = {name: float(np.nanmax(gain)) for name, gain in gains.items() if np.isfinite(gain).any()}
    threshold = question_of(results.study, AskedOfPassages).amplification
    beyond = sorted((name for name, gain in most.items() if gain > threshold), key=lambda name: -most[name])
    if results.size < 2 or not beyond:
        return ""
    digits = {name: 3 if number(most[name]) != number(threshold) else 5 for name in beyond}  # not "1.1 exceeds 1.1"
    words = [f"{name} (up to {number(most[name], digits[name])})" for name in beyond[:MOST_TOLD]]
    words += [f"{len(beyond) - MOST_TOLD} more"] * (len(beyond) > MOST_TOLD)
    exceed = f"exceed{'s' * (len(beyond) == 1)} a dynamic amplification of {number(threshold)}"
    return f" Of the other sensors {listed(words)} {exceed}."


def _limited(results: Results, sensor: str) -> str:
    """Where a sensor is beyond what the question names for its quantity; "" where that names nothing."""
    limit = question_of(results.study, AskedOfPassages).of(results.study.sensor[sensor])
    if limit is None:
        return ""
    values, error = sizes(results, sensor), errors_of_size(results, sensor)
    axis = results.axis(*PACES) or next(iter(by_effect(results, values)), None)
    return told_limit(results, values, limit, results.sensors[sensor], axis, error)


def _limited_besides(results: Results, told: str) -> str:
    """Which sensors besides that one are beyond their limits, those by the most first."""
    limits, most = question_of(results.study, AskedOfPassages), dict[str, float]()
    for name in results.sensors:
        limit, size = limits.of(results.study.sensor[name]), largest_size(results, name)
        if name != told and limit is not None and size > limit:
            most[name] = size / limit
    if not most:
        return ""
    order = sorted(most, key=lambda name: -most[name])
    words = [f"{one} (up to {quantity(largest_size(results, one), results.sensors[one])})" for one in order[:MOST_TOLD]]
    words += [f"{len(order) - MOST_TOLD} more"] * (len(order) > MOST_TOLD)
    exceed = "exceeds its limit" if len(order) == 1 else "exceed their limits"
    return f" Of the other sensors {listed(words)} {exceed}."


def _with_remark(said: list[str], remark: str) -> list[str]:
    """Sentences with a remark behind the first that says of a limit that it is exceeded nowhere."""
    unbroken = [place for place, text in enumerate(said) if "nowhere" in text.partition(LIMIT)[2]]
    return [text + remark if place in unbroken[:1] else text for place, text in enumerate(said)]


def _between(results: Results, values: Array, place: Index) -> str:
    """That peaks between swept paces may be higher than the largest value, where one beside it is much less."""
    axis = results.axis(*PACES)
    if axis is None or axis.dim == VARIANT:
        return ""
    less = 1.0 - float(beside(results, values, place, axis).min(initial=values[place]) / values[place])
    said = f" ({percent(less)} less at a {axis.noun} beside it: peaks between may be higher)"
    return said if less > LEAST_BESIDE else ""


def _at_the_end(results: Results, place: Index) -> str:
    """That a variant lies at an end of the swept pace, beyond which there may be more; "" where it does not."""
    axis = results.axis(*PACES)
    if axis is None or axis.dim == VARIANT:
        return ""
    value = axis.values[place[results.dims.index(axis.dim)]]
    return f", an end of the swept {axis.noun}" if value in (axis.values.min(), axis.values.max()) else ""


def _value(results: Results, sensor: str, place: Index) -> str:
    """The extreme of larger size of one variant, and where the carriage is then."""
    sides = {side: float(results.dataset[f"{sensor}_{side}"].values[place]) for side in ("max", "min")}
    side = max(sides, key=lambda name: abs(sides[name]))
    at = float(results.dataset[f"{sensor}_{side}_position"].values[place])
    place_then = f"at {quantity(at, 'm')}" if np.isfinite(at) else "off its body"
    then = f" with {results.carriage_name} {place_then}"
    if (when := f"{sensor}_{side}_time") in results.dataset:
        then = f" after {quantity(float(results.dataset[when].values[place]), 's')}{then}"
    loosely = uncertainty(results, f"{sensor}_{side}", place)
    upward = " (largest in magnitude)" * (sides[side] < 0.0)
    brackets = f"{upward}{loosely}".replace(") (", ", ")
    return f"{quantity(sides[side], results.sensors[sensor])}{brackets}{then}"
