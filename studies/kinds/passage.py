"""How large does it get? Extremes of every sensor and of the contact force, and the dynamic amplification."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from engine.scene.study import Study
from engine.study_file.spec import Spec
from engine.study_file.units import Acceleration, Dimensionless, Length, Pressure, Speed, Torque
from results_schema.arrays import Array, Mask
from results_schema.late import xr
from results_schema.variables import MARCH, declare
from studies.findings.amplification import DYNAMIC_AMPLIFICATION, largest, sizes, with_amplification
from studies.protocol.study import Kind, question_of
from studies.results.findings_common import check_sensors, first_carriage, in_words, told_statuses, uncertainty
from studies.results.formatting import counted, listed, number, quantity
from studies.results.results import PACES, VARIANT, Axis, Index, Results, chosen, extreme

MOST_SENSORS = 4
MOST_GROUPS = 5
MOST_PARTS = 3  # of a sweep that are told one by one
MOST_TOLD = 3  # values of another swept number that are told one by one
GAP = 3.0  # times the usual distance of two values of a sweep
BEYOND = "The equations assume contact: beyond, they say no more."

declare("passage", *MARCH, DYNAMIC_AMPLIFICATION)


LIMITED = ("displacement", "velocity", "acceleration", "bending_moment", "stress")


class Asked(Spec):
    """The table [question]. amplification: dynamic over static, of which is told at which speeds it is exceeded; the
    others: absolute values, of which the same is told for every sensor of that quantity."""

    amplification: Annotated[Dimensionless, Field(gt=0)] = 1.1
    displacement: Annotated[Length, Field(gt=0)] | None = None
    velocity: Annotated[Speed, Field(gt=0)] | None = None
    acceleration: Annotated[Acceleration, Field(gt=0)] | None = None
    bending_moment: Annotated[Torque, Field(gt=0)] | None = None
    stress: Annotated[Pressure, Field(gt=0)] | None = None

    def limit(self, name: str) -> float | None:
        """What is named for a quantity."""
        return getattr(self, name) if name in LIMITED else None


class Passage(Kind):
    """The kind "passage"."""

    name = "passage"
    summary = "largest and smallest of every sensor and of the contact force, dynamic amplification"
    question = "How large does the response get, and does the contact hold?"
    settings = Asked
    drawn_by = "studies.pictures.passage"

    def check(self, study: Study) -> None:
        """Something moves and something is measured."""
        first_carriage(study)
        check_sensors(study)

    def summarise(self, dataset: xr.Dataset, study: Study) -> xr.Dataset:
        return with_amplification(dataset, study)

    def findings(self, results: Results) -> list[str]:
        told = (_largest, _amplified, _limited)
        said = ["".join(tell(results, sensor) for tell in told) for sensor in _told(results)]
        opened = _opened(results)
        lifted = [_lifted(results, opened)] if opened else []
        kept = [_closed(results, name, force) for name, force in _contact_forces(results) if name not in opened]
        return [*said[:1], *lifted, *said[1:], *kept, *told_statuses(results)]

    def named(self, results: Results) -> list[Index]:
        """For every sensor of the answer the variants with the largest value and the largest amplification."""
        places = (place for sensor in _told(results) for place in _extremes(results, sensor))
        return [place for place in places if place is not None]


KIND = Passage()


def _told(results: Results) -> list[str]:
    """The sensors that the answer is about."""
    return list(results.sensors)[:MOST_SENSORS]


def _extremes(results: Results, sensor: str) -> tuple[Index | None, Index | None]:
    """The variants with the largest value and with the largest amplification of one sensor."""
    gain = results.numbers("dynamic_amplification", sensor)
    return largest(results, sizes(results, sensor)), largest(results, gain)


def _largest(results: Results, sensor: str) -> str:
    """The largest value and the largest amplification of one sensor, and where they are, while the contact holds."""
    gain, (top, best) = results.numbers("dynamic_amplification", sensor), _extremes(results, sensor)
    if top is None:
        return f"{sensor}: no variant has values."
    opened = "while the contact holds, " if results.held.any() else "with a contact that opens in every variant, "
    shown = "" if results.held[results.kept.values].all() else opened
    said = f"{sensor}: {shown}the largest {results.noun(sensor)} is {_value(results, sensor, top)}"
    where = f"{in_words(results, top)}{_at_the_end(results, top)}"
    if best is None:
        return f"{said}{where}."
    static = sizes(results, sensor)[best] / gain[best]
    amplified = f"{number(float(gain[best]))} times the static {quantity(float(static), results.sensors[sensor])}"
    if best == top:
        return f"{said}, {amplified},{where}."
    loosely = uncertainty(results, f"dynamic_amplification {sensor}", best)
    return (
        f"{said}{where}; relative to statics it is largest{in_words(results, best)}{_at_the_end(results, best)}: "
        f"{amplified}{loosely}."
    )


def _amplified(results: Results, sensor: str) -> str:
    """Where statics are exceeded by as much as the question names; "" without anything to compare."""
    gain = results.numbers("dynamic_amplification", sensor)
    if results.size < 2 or not np.isfinite(np.where(results.with_values, gain, np.nan)).any():
        return ""
    threshold = question_of(results.study, Asked).amplification
    return f" The dynamic amplification exceeds {number(threshold)} {_where(results, gain, threshold)}."


def _limited(results: Results, sensor: str) -> str:
    """Where a sensor is beyond what the question names for its quantity; "" where that names nothing."""
    limit = question_of(results.study, Asked).limit(results.study.sensor[sensor].quantity)
    if limit is None:
        return ""
    said = quantity(limit, results.sensors[sensor])
    return f" Its absolute value exceeds {said} {_where(results, sizes(results, sensor), limit)}."


def _where(results: Results, values: Array, threshold: float) -> str:
    """In which part of the sweep values exceed a threshold: of a swept pace, for each value of another number where
    these are few."""
    beyond = np.nan_to_num(np.where(results.with_values, values, np.nan)) > threshold
    axis = results.axis(*PACES)
    if axis is None or axis.dim == VARIANT:
        return f"in {counted(int(beyond.sum()), 'variant')} of {results.size:,}"
    others = [other for other in results.axes if other.name != axis.name]
    if len(others) != 1 or not 1 < others[0].values.size <= MOST_TOLD:
        return _paces(results, axis, beyond)
    own = results.everywhere(results.dataset[others[0].name])
    told = {float(value): _paces(results, axis, beyond, own == value) for value in np.unique(own)}
    if len(set(told.values())) == 1:
        return next(iter(told.values()))
    return "; ".join(f"{text} ({others[0].noun} {others[0].in_words(value)})" for value, text in told.items())


def _paces(results: Results, axis: Axis, beyond: Mask, among: Mask | None = None) -> str:
    """The parts of a swept pace in which any variant (among some) is beyond a threshold, and which variants these are.
    A part ends where the pace leaves out more than `GAP` times its usual distance: nothing was computed there."""
    beyond = beyond if among is None else beyond & among
    along = results.everywhere(results.dataset[axis.name])
    paces = np.unique(along)
    over = np.isin(paces, along[beyond])
    if not over.any():
        return f"nowhere from {axis.span}"
    steps = np.diff(paces)
    apart = np.flatnonzero(over[:-1] & over[1:] & (steps > GAP * np.median(steps)))
    if over.all() and not apart.size:
        return f"everywhere from {axis.span}{_common(results, axis, beyond) if among is None else ''}"
    turns = np.flatnonzero(np.diff(over, prepend=False, append=False))
    bounds = np.sort(np.concatenate([turns, apart + 1, apart + 1]))
    parts = [paces[first:end] for first, end in zip(bounds[::2], bounds[1::2], strict=True)]
    told = [f"at {replace(axis, values=part).span}" for part in parts]
    if over[-1] and parts[-1].size > 1:
        told[-1] = f"from {axis.in_words(float(parts[-1][0]))} to the end of the sweep, {axis.in_words(paces[-1])}"
    if among is None:
        told = [told[i] + _common(results, axis, beyond & np.isin(along, parts[i])) for i in range(len(parts))]
    return listed(told) if len(told) <= MOST_PARTS else f"first {told[0]}, last {told[-1]}"


def _common(results: Results, pace: Axis, which: Mask) -> str:
    """What else is swept and has not all of its values among some variants, in brackets."""
    others = [axis for axis in results.axes if axis.name != pace.name]
    values = [np.unique(results.everywhere(results.dataset[axis.name])[which]) for axis in others]
    pairs = zip(others, values, strict=True)
    told = [f"{axis.noun} {replace(axis, values=own).span}" for axis, own in pairs if own.size < axis.values.size]
    return f" ({', '.join(told)})" if told else ""


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
    then = f" with {results.carriage_name} at {quantity(at, 'm')}" if np.isfinite(at) else ""
    loosely = uncertainty(results, f"{sensor}_{side}", place)
    return f"{quantity(sides[side], results.sensors[sensor])}{loosely}{then}"


def _contact_forces(results: Results) -> Iterator[tuple[str, Array]]:
    """Carriages with their smallest contact forces, where these are known and tell of lifting off."""
    for carriage, spec in results.study.carriage.items():
        if f"{carriage}_contact_force_min" in results.dataset and spec.inertial:
            force = np.asarray(results.dataset[f"{carriage}_contact_force_min"].values, dtype=np.float64)
            if np.isfinite(force).any():
                yield carriage, force


def _opened(results: Results) -> dict[str, tuple[Mask, Mask]]:
    """Where contact forces turn negative and where they are known, by carriage: most variants first."""
    masks = {name: (np.isfinite(force) & (force < 0.0), np.isfinite(force)) for name, force in _contact_forces(results)}
    found = [(name, both) for name, both in masks.items() if both[0].any()]
    return dict(sorted(found, key=lambda one: -np.count_nonzero(one[1][0])))


def _lifted(results: Results, opened: dict[str, tuple[Mask, Mask]]) -> str:
    """Which carriages would lift off, and where the first of them begins to."""
    (first, masks), *others = opened.items()
    more = [f"{name} in {int(np.count_nonzero(mask)):,}" for name, (mask, _) in others[:MOST_TOLD]]
    if left := others[MOST_TOLD:]:
        more.append(f"{len(left)} more")
    also = f" So would {listed(more)}." if more else ""
    return f"{_onset(results, first, *masks)}{also} {BEYOND}"


def _closed(results: Results, carriage: str, force: Array) -> str:
    """The smallest of contact forces that are all positive, and whether that is certain."""
    least, name = extreme(-force), f"{carriage}_contact_force_min"
    assert least is not None
    smallest = f"the smallest contact force is {quantity(float(force[least]), 'N')}"
    weighs = results.study.carriage[carriage].moving_mass > 0.0
    off = results.everywhere(_weight(results, carriage))[least] * results.error_at(name, least) if weighs else np.nan
    if off > force[least]:
        known = f"with an estimated error of {quantity(float(off), 'N')}"
        return f"Whether {carriage} keeps its contact is not certain: {smallest}, {known}{in_words(results, least)}."
    loosely = uncertainty(results, name, least)
    return f"{carriage} keeps its contact everywhere; {smallest}{loosely}{in_words(results, least)}."


def _weight(results: Results, carriage: str) -> xr.DataArray | float:
    """Of all masses of a carriage, N."""
    masses = [results.parameter(f"carriage.{carriage}.{key}") for key in results.study.carriage[carriage].masses]
    return sum(masses) * results.parameter("gravity")


def _onset(results: Results, carriage: str, opened: Mask, known: Mask) -> str:
    """From which speed on the contact opens, for up to five masses."""
    shown = f"{carriage} would lift off in {int(opened.sum()):,} of {counted(int(known.sum()), 'variant')}"
    speed, group = results.axis(".motion.speed", ".motion.frequency"), results.axis(".mass")
    if speed is None:
        return f"{shown}."
    if VARIANT in (speed.dim, speed.dim if group is None else group.dim):
        return f"{shown}; {_worst(results, carriage, opened)}."
    if group is None:
        return f"{shown}, {_first_speed(results, speed, opened)}."
    along = results.everywhere(results.dataset[group.name])
    opening = sorted(set(along[opened].tolist()))
    told = [
        f"at {group.in_words(value)} {_first_speed(results, speed, opened & (along == value))}"
        for value in chosen(opening, MOST_GROUPS)
    ]
    calm = group.values[group.values < opening[0]]
    below = f"; up to {group.in_words(float(calm.max()))} never" if calm.size else ""
    return f"{shown}: {', '.join(told)}{below}."


def _worst(results: Results, carriage: str, opened: Mask) -> str:
    """The variant whose smallest force is the most negative part of its weight: what points off a grid can tell."""
    ratio = results.everywhere(results.dataset[f"{carriage}_contact_force_min"] / _weight(results, carriage))
    place = extreme(-np.where(opened, ratio, np.nan))
    assert place is not None
    return f"worst is {number(float(ratio[place]))} times the weight{in_words(results, place)}"


def _first_speed(results: Results, speed: Axis, opened: Mask) -> str:
    """The lowest speed at which the contact opens, with its ratio to the critical speed where that is known."""
    along = results.everywhere(results.dataset[speed.name])
    first = float(along[opened].min())
    text = f"first at {speed.in_words(first)}"
    if "speed_ratio" not in results.dataset.coords:
        return text
    ratio = results.everywhere(results.dataset["speed_ratio"])
    return f"{text} ({number(float(ratio[opened & (along == first)].min()), 2)} of the critical speed)"
