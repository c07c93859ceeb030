"""How large does it get? Extremes of every sensor and of the contact force, and the dynamic amplification."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from engine.scene.study import Study
from engine.study_file.spec import Spec
from engine.study_file.units import Dimensionless
from results_schema.arrays import Mask
from results_schema.late import xr
from results_schema.variables import MARCH, declare
from studies.findings.amplification import DYNAMIC_AMPLIFICATION, largest, sizes, with_amplification
from studies.protocol.study import Kind, question_of
from studies.results.findings_common import check_sensors, exceeds, first_carriage, in_words, told_statuses, uncertainty
from studies.results.formatting import counted, listed, number, quantity
from studies.results.results import PACES, VARIANT, Axis, Index, Results, chosen, extreme

MOST_SENSORS = 4
MOST_GROUPS = 5
MOST_PARTS = 3  # of a sweep that are told one by one
BEYOND = "The equations assume contact: beyond, they say no more."

declare("passage", *MARCH, DYNAMIC_AMPLIFICATION)


class Asked(Spec):
    """The table [question]. amplification: dynamic over static, of which is told from which speed on it is exceeded."""

    amplification: Annotated[Dimensionless, Field(gt=0)] = 1.1


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
        said = [f"{_largest(results, sensor)}{_amplified(results, sensor)}" for sensor in _told(results)]
        said += [text for carriage in results.study.carriage for text in _contact(results, carriage)]
        return [*said, *told_statuses(results)]

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
    shown = "while the contact holds, " if not results.held.all() and results.held.any() else ""
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
    gain = np.where(results.with_values, results.numbers("dynamic_amplification", sensor), np.nan)
    if results.size < 2 or not np.isfinite(gain).any():
        return ""
    threshold, axis = question_of(results.study, Asked).amplification, results.axis(*PACES)
    if axis is None or axis.dim == VARIANT:
        return f" The dynamic amplification {exceeds(results, gain, threshold, number)}."
    beyond = np.nan_to_num(gain) > threshold
    return f" The dynamic amplification exceeds {number(threshold)} {_paces(results, axis, beyond)}."


def _paces(results: Results, axis: Axis, beyond: Mask) -> str:
    """The parts of a swept pace in which any variant is beyond a threshold, and which variants these are."""
    along = results.everywhere(results.dataset[axis.name])
    paces = np.unique(along)
    over = np.isin(paces, along[beyond])
    if not over.any():
        return f"nowhere from {axis.span}"
    if over.all():
        return f"everywhere from {axis.span}{_common(results, axis, beyond)}"
    turns = np.flatnonzero(np.diff(over, prepend=False, append=False))
    parts = [paces[first:end] for first, end in zip(turns[::2], turns[1::2], strict=True)]
    told = [f"at {replace(axis, values=part).span}" for part in parts]
    if over[-1]:
        told[-1] = f"from {axis.in_words(float(parts[-1][0]))} on"
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


def _contact(results: Results, carriage: str) -> list[str]:
    """Where the contact force turns negative first, for each mass."""
    if f"{carriage}_contact_force_min" not in results.dataset:
        return []
    force = np.asarray(results.dataset[f"{carriage}_contact_force_min"].values, dtype=np.float64)
    known = np.isfinite(force)
    if not known.any() or not results.study.carriage[carriage].inertial:
        return []
    opened = known & (force < 0.0)
    if not opened.any():
        least = extreme(-force)
        assert least is not None
        return [
            f"{carriage} keeps its contact everywhere; the smallest contact force is "
            f"{quantity(float(force[least]), 'N')}{uncertainty(results, f'{carriage}_contact_force_min', least)}"
            f"{in_words(results, least)}."
        ]
    return [_onset(results, carriage, opened, known)]


def _onset(results: Results, carriage: str, opened: Mask, known: Mask) -> str:
    """From which speed on the contact opens, for up to five masses."""
    shown = f"{carriage} would lift off in {int(opened.sum()):,} of {counted(int(known.sum()), 'variant')}"
    speed, group = results.axis(".motion.speed", ".motion.frequency"), results.axis(".mass")
    if speed is None:
        return f"{shown}. {BEYOND}"
    if VARIANT in (speed.dim, speed.dim if group is None else group.dim):
        return f"{shown}; {_worst(results, carriage, opened)}. {BEYOND}"
    if group is None:
        return f"{shown}, {_first_speed(results, speed, opened)}. {BEYOND}"
    along = results.everywhere(results.dataset[group.name])
    opening = sorted(set(along[opened].tolist()))
    told = [
        f"at {group.in_words(value)} {_first_speed(results, speed, opened & (along == value))}"
        for value in chosen(opening, MOST_GROUPS)
    ]
    calm = group.values[group.values < opening[0]]
    below = f"; up to {group.in_words(float(calm.max()))} never" if calm.size else ""
    return f"{shown}: {', '.join(told)}{below}. {BEYOND}"


def _worst(results: Results, carriage: str, opened: Mask) -> str:
    """The variant whose smallest force is the most negative part of its weight: what points off a grid can tell."""
    weight = results.parameter(f"carriage.{carriage}.mass") * results.parameter("gravity")
    ratio = results.everywhere(results.dataset[f"{carriage}_contact_force_min"] / weight)
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
