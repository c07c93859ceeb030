"""How far sensors swing about their static values after all carriages have come to rest or left, in sentences."""

from collections.abc import Sequence
from itertools import product
from math import prod
from typing import NamedTuple

import numpy as np

from engine.march.rest import settling
from engine.march.settling import names_of_times
from engine.scene.study import Study
from results_schema.arrays import Array, Mask
from studies.findings.absolute_errors import absolute_errors, told_error
from studies.findings.amplification import only_rounding, sizes
from studies.findings.beyond import LIMITED, AskedOfRest, Limits, in_turns, out_of_reach, where_beyond
from studies.findings.effects import best_choice, by_effect, of_absorbers, told_both_ways, told_effects
from studies.results.axes import DIRECTION, VARIANT, Axis
from studies.results.findings_common import in_words, while_held
from studies.results.formatting import ROUNDING, counted, listed, once, quantity
from studies.results.places import Index, chosen, extreme
from studies.results.results import Results

MOST_SENSORS = 4
ALIKE = 1e-3  # of a time: by so much the best motion may differ and count as the same
MOST_BEST = 4  # values of a swept number of which each is told its best motion
LAST = 8  # values along a swept number that are looked at: where it is swept too coarsely most of them turn
FEWEST = 6  # of these
NEVER = "no motion has settled when the run ends"
LEAST_STEP = 0.1  # of the largest value: smaller ones do not count as up or down


def check_residual(study: Study, asked: AskedOfRest) -> None:
    """Refuse residual vibrations of statics, and limits of them and of settling times that are not told. Raises
    BadInput."""
    if study.output.residual and study.solver.fidelity == "static":
        what, expected = "statics do not swing on, so that nothing is known of residual vibrations", '"auto", or none'
        raise study.source.fault("solver.fidelity", what, expected=expected, received="static")
    if any(asked.residual.limit(name) is not None for name in LIMITED) and not study.output.residual:
        what = "a limit of residual vibrations, which this study does not tell"
        raise study.source.fault("question.residual", what, expected="[output] residual = true beside it")
    if asked.settling_time is not None and not settling(study):
        what = "a limit of settling times, of which no sensor has one"
        raise study.source.fault("question.settling_time", what, expected="a settling_band of a sensor")


def residual_of(results: Results, sensor: str) -> Array:
    """The residual vibration of a sensor, in the sweep's shape; NaN where it does not count."""
    values = results.dataset[f"{sensor}_residual"].transpose(*results.dims).values
    return np.where(results.with_values, values, np.nan)


def settling_of(results: Results, name: str) -> Array:
    """A settling time, or time of move and settling, in the sweep's shape; NaN where a sensor has not settled."""
    values = results.dataset[name].transpose(*results.dims).values
    return np.where(results.with_values, values, np.nan)


class Times(NamedTuple):
    """Times of move and settling and their errors, in the sweep's shape; NaN where something has not settled."""

    values: Array
    errors: Array

    @classmethod
    def until_all(cls, results: Results, sensors: Sequence[str]) -> "Times":
        """Until the last of some sensors has settled."""
        names = [names_of_times(sensor)[1] for sensor in sensors]
        values = np.stack([settling_of(results, name) for name in names])
        errors = np.stack([absolute_errors(results, name) for name in names])
        last = np.argmax(values, axis=0)[None]
        return cls(values.max(axis=0), np.take_along_axis(errors, last, axis=0)[0])


def crosses(results: Results) -> bool:
    """Whether there is nothing but carriages that leave their bodies, so that there is no stop."""
    study = results.study
    return bool(study.carriage) and not study.frame and all(one.motion.passes for one in study.carriage.values())


def since(results: Results) -> str:
    """The event from which on vibrations count as residual, in words."""
    return "the last carriage has left" if crosses(results) else "the stop"


def settle_together(results: Results) -> list[str]:
    """Sensors with a time of move and settling, where motions differ in these; none where that is one's alone."""
    found = [name for name in banded(results) if moves_differ(results, name) and not has_whole(results, name)]
    return found if len(found) > 1 else []


def banded(results: Results) -> list[str]:
    """Sensors of which it is told when they have settled."""
    return [name for name in results.sensors if results.study.sensor[name].settling_band is not None]


def moves_differ(results: Results, sensor: str) -> bool:
    """Whether variants come to rest at different times, so that the shortest settling is not the shortest time."""
    if crosses(results):
        return False
    settling, whole = (settling_of(results, name) for name in names_of_times(sensor))
    stops = (whole - settling)[np.isfinite(whole)]
    return bool(stops.size > 1 and np.ptp(stops) > ROUNDING * stops.max())


def quiet(results: Results, sensor: str) -> bool:
    """Whether what is left of a sensor's vibration is rounding, or all of its reading is."""
    left, scale = (float(np.nanmax(of(results, sensor), initial=0.0)) for of in (residual_of, sizes))
    return only_rounding(results, sensor) or left <= ROUNDING * scale


def ringing(results: Results, limits: Limits) -> list[str]:
    """Sensors whose residual vibration is told, in the order of `in_turns`; none where the study does not tell it. At
    rest a dynamic part swings as the whole does: one beside it is left out."""
    if not results.study.output.residual:
        return []
    size = {name: np.nanmax(residual_of(results, name), initial=0.0) for name in results.sensors}
    return [name for name in in_turns(results, limits, size) if not has_whole(results, name)]


def asks_of_rest(study: Study, asked: AskedOfRest) -> bool:
    """Whether the question is about the time after a stop first: by a limit of it, or a band to settle within."""
    limited = any(asked.residual.limit(name) is not None for name in LIMITED) or asked.settling_time is not None
    return limited or any(sensor.settling_band is not None for sensor in study.sensor.values())


def has_whole(results: Results, name: str) -> bool:
    """Whether a sensor reads the dynamic part of what another one reads, whose settling is told if its own is."""
    known, settles = results.study.sensor, results.study.sensor[name].settling_band is not None
    same = [other for other in known if known[other].quantity == known[name].quantity and other != name]
    wholes = [other for other in same if not known[other].is_dynamic_part]
    wholes = [other for other in wholes if known[other].settling_band is not None or not settles]
    return known[name].is_dynamic_part and results.place(name) in map(results.place, wholes)


def residuals(results: Results, asked: AskedOfRest) -> list[str]:
    """The shortest times of move and settling, the largest residual vibration of sensors, and where limits are
    exceeded."""
    sensors = ringing(results, asked.residual)[:MOST_SENSORS]
    said = [_residual(results, sensor, asked) for sensor in sensors]
    for axis in results.axes:
        said = once(_up_and_down(axis), said)
    if sensors and not quiet(results, sensors[0]):
        doubt = absolute_errors(results, f"{sensors[0]}_residual")
        effects = told_effects(results, residual_of(results, sensors[0]), "the largest such swing", doubt)
        said[0] += f" {effects}" if effects else ""
    return [*until_settled(results, sensors), *said]


def until_settled(results: Results, sensors: Sequence[str]) -> list[str]:
    """The shortest times until all sensors that have a band have settled, else the first of some, as a sentence; none
    where motions come to rest at the same time."""
    if together := settle_together(results):
        return [f"{_until(results, together)}."]
    own = banded(results)
    alone = next((name for name in sensors if name in own and moves_differ(results, name)), None)
    return [f"{_until(results, [alone])}."] if alone else []


def _until(results: Results, sensors: Sequence[str]) -> str:
    """The shortest times until all of some sensors have settled."""
    shortest, names = _shortest(results, sensors), listed(sensors)
    if shortest.startswith(NEVER):
        return f"{names}: {shortest}"
    lost = int((np.isnan(Times.until_all(results, sensors).values) & results.with_values).sum())
    of = counted(int(results.with_values.sum()), "variant")
    rest = f"; {lost:,} of {of} {'have' if lost > 1 else 'has'} not settled when the run ends"
    until = f"{while_held(results)}until {f'all of {names} have' if len(sensors) > 1 else f'{names} has'} settled, "
    return f"{until[0].upper()}{until[1:]}{shortest}{rest if lost else ''}"


def most_ringing(results: Results) -> list[Index]:
    """For every sensor whose residual vibration is told the variant with the largest."""
    places = [extreme(residual_of(results, sensor)) for sensor in ringing(results, Limits())]
    return [place for place in places if place is not None]


def _residual(results: Results, sensor: str, asked: AskedOfRest) -> str:
    units, values = results.sensors[sensor], residual_of(results, sensor)
    place = extreme(values)
    if place is None:
        rides = results.study.sensor[sensor].rides
        if rides is not None:
            return f"{sensor}: it is not read once {rides} has left, so that no residual vibration is told."
        return f"{sensor}: no variant has a residual vibration."
    size = float(values[place])
    if quiet(results, sensor):
        return f"{sensor}: after {since(results)} it does not swing."
    doubt = absolute_errors(results, f"{sensor}_residual")
    error = float(doubt[place])  # parts of a static value mislead here
    said = (
        f"{sensor}: {while_held(results)}after {since(results)} it still swings by up to {quantity(size, units)}"
        f"{told_error(error, size, units)}{in_words(results, place)}{_told_least(results, values, units)}"
    )
    axis = next(iter(by_effect(results, values)), None)
    limit = asked.residual.of(results.study.sensor[sensor])
    settled = "".join(f"; {one}" for one in told_settling(results, sensor, asked.settling_time, axis))
    between = told_both_ways(results, values, "that swing", units, doubt) + _told_between(results, values, place)
    if limit is None:
        return f"{said}{settled}.{between}"
    over = f"over {axis.noun} " if axis is not None and axis.dim != VARIANT else ""
    beyond = f"{quantity(limit, units)}{out_of_reach(limit, size)} {where_beyond(results, values, limit, axis)}"
    return f"{said}; {over}it exceeds {beyond}{settled}.{between}"


def _told_least(results: Results, values: Array, units: str) -> str:
    """At which motions, delays or absorbers it swings least, behind where most; "" where `best_choice` finds none."""
    free = [axis for axis in results.axes if axis.sets_motion and not axis.sets(DIRECTION)]
    found = best_choice(results, values, [*free, *of_absorbers(results)])
    return f", and least, by up to {quantity(found.value, units)}{found.end}, at {found.where}" if found else ""


def _told_between(results: Results, values: Array, place: Index) -> str:
    """That peaks may be higher between swept values where one is large and the next small, as a sentence behind
    another; place: of the largest, through which each swept number is followed. "" where none does that."""
    axes = [axis for axis in by_effect(results, values) if axis.dim != VARIANT]
    for axis in axes:
        line = results.along(axis, values, place)
        steps = np.diff(line[-LAST:])
        steps = np.sign(steps[np.abs(steps) > LEAST_STEP * np.nanmax(line)])
        turns = np.count_nonzero(np.diff(steps))
        if line.size >= FEWEST and turns > (min(line.size, LAST) - 2) / 2:
            return f" {_up_and_down(axis)}"
    return ""


def _up_and_down(axis: Axis) -> str:
    return (
        f"From one {axis.noun} to the next it goes up and down, so peaks between them may be higher: sweep them more "
        "closely."
    )


def told_settling(results: Results, sensor: str, limit: float | None, axis: Axis | None) -> list[str]:
    """How long a sensor takes to settle at most, where along a swept number that is longer than a limit (s), and how
    many variants have not by the end of their runs, as parts of a sentence; none where it has no band."""
    band = results.study.sensor[sensor].settling_band
    if band is None:
        return []
    values = settling_of(results, names_of_times(sensor)[0])
    unknown = results.with_values & np.isnan(values)
    quiet = unknown & _never_out(results, sensor, band)
    left = int(np.count_nonzero(unknown))
    place, units, said = extreme(values), results.sensors[sensor], list[str]()
    known = int(np.count_nonzero(np.isfinite(values)))
    within = f"within {quantity(band, units)} of its static value"
    among = f"in {known:,} of {counted(known + left, 'variant')} " if left else ""
    at = f"when {since(results)}" if crosses(results) else since(results)
    if place is not None and float(values[place]) == 0.0:
        said.append(f"{among}it is {within} from {at} on")
    elif place is not None:
        took, error = float(values[place]), float(absolute_errors(results, names_of_times(sensor)[0])[place])
        when = f"{quantity(took, 's')}{told_error(error, took, 's')} after {since(results)} at the latest"
        said.append(f"{among}it has settled {within} {when}{in_words(results, place)}")
    if limit is not None:
        longer = where_beyond(results, np.where(unknown & ~quiet, np.inf, values), limit, axis)
        said.append(f"it takes longer than {quantity(limit, 's')} {longer}")
    if (out := unknown & ~quiet).any():
        have = f"{counted(int(out.sum()), 'variant')} {'have' if out.sum() > 1 else 'has'} not settled by the end"
        late = "of the run, or too late to tell that it is for good"
        said.append(f"{have} {late}{_over(results, out, axis)}: a longer rest tells when")
    if quiet.any():
        stay = f"{counted(int(quiet.sum()), 'variant')} {'stay' if quiet.sum() > 1 else 'stays'} {within}"
        said.append(f"{stay}{_over(results, quiet, axis)}, but the rest is too short to tell that it is for good")
    return said


def _never_out(results: Results, sensor: str, band: float) -> Mask:
    """Whether what is seen of a sensor after the stop stays within its band, in the sweep's shape; nowhere where that
    is not told."""
    name = f"{sensor}_residual"
    if name not in results.dataset:
        return np.zeros(results.with_values.shape, dtype=np.bool_)
    return np.asarray(settling_of(results, name) <= band)


def _over(results: Results, which: Mask, axis: Axis | None) -> str:
    """Along which values of a swept number variants are such."""
    along = axis is not None and axis.dim != VARIANT
    return f", over {axis.noun} {where_beyond(results, which.astype(float), 0.5, axis)}" if axis and along else ""


def _shortest(results: Results, sensors: Sequence[str]) -> str:
    """The shortest time of move and settling until the last of some sensors has settled: for each of a few values of
    what is none of the motion's to choose, such as the mass or the way, that first which changes it most, at the worst
    of what else does."""
    times = Times.until_all(results, sensors)
    values = times.values
    given = [axis for axis in results.axes if axis.values.size > 1 and (axis.sets(DIRECTION) or not axis.sets_motion)]
    if VARIANT in results.dims or not given:
        return f"move and settling take {_least(results, times, ' at least')}"
    change = {axis: _changes_best(results, values, given, axis) for axis in given}
    felt = sorted((axis for axis in given if change[axis] > ALIKE), key=lambda axis: -change[axis])
    each = felt[: max(1, sum(prod(a.values.size for a in felt[: n + 1]) <= MOST_BEST for n in range(len(felt))))]
    rest = tuple(results.dims.index(axis.dim) for axis in given if axis not in each)
    longest = np.where(np.isnan(values), np.inf, values).max(axis=rest, keepdims=True)
    values, rows = np.where((values == longest) & np.isfinite(longest), values, np.nan), dict[str, list[str]]()
    settled = {axis: _settled(results, values, axis) for axis in each}
    for own in product(*(chosen(settled[axis], MOST_BEST) for axis in each)):
        pairs = list(zip(each, own, strict=True))
        here = [results.everywhere(results.dataset[axis.name]) == value for axis, value in pairs]
        among = np.where(np.all(here, axis=0), values, np.nan) if here else values
        least = _least(results, times._replace(values=among), known=given) if np.isfinite(among).any() else ""
        rows.setdefault(least, []).append(", ".join(f"{axis.noun} {axis.in_words(value)}" for axis, value in pairs))
    never = listed(rows.pop("", []))
    found = [f"{least} ({listed(where)})" if where[0] else least for least, where in rows.items()]
    worst, same = ([axis.noun for axis in part if axis not in each] for part in (felt, set(given) - set(felt)))
    end = f", at the worst {listed(worst)}" * bool(worst) + f", whatever {listed(sorted(same))}" * bool(same)
    if not found:
        return f"{NEVER}{end}"
    others = [f"{axis.values.size - len(own)} other values of {axis.noun}" for axis, own in settled.items()]
    never = listed([*filter(None, [never]), *(word for word in others if not word.startswith("0 "))])
    return f"move and settling take at least {listed(found)}{end}{f'; {NEVER} at {never}' * bool(never)}"


def _settled(results: Results, values: Array, axis: Axis) -> list[float]:
    """The values of a swept number, or of many those alone at which something has settled, if any."""
    own = np.sort(axis.values)
    along = results.everywhere(results.dataset[axis.name])
    known = [value for value in own.tolist() if np.isfinite(values[along == value]).any()]
    return known if known and own.size > MOST_BEST else own.tolist()


def _changes_best(results: Results, values: Array, given: Sequence[Axis], axis: Axis) -> float:
    """How many times, less one, the time of the best motion is longer over a swept number that is given, at most."""
    motion = tuple(n for n, dim in enumerate(results.dims) if all(dim != one.dim for one in given))
    best = np.where(np.isnan(values), np.inf, values).min(axis=motion, keepdims=True)
    along = results.dims.index(axis.dim)
    low, high = best.min(axis=along), best.max(axis=along)
    return float(np.divide(high, low, out=np.ones_like(low), where=np.isfinite(low)).max() - 1.0)


def _least(results: Results, times: Times, words: str = "", known: Sequence[Axis] = ()) -> str:
    """The smallest of times with its error, words, and where in the sweep it is, of which some numbers are known."""
    place = extreme(-times.values)
    assert place is not None
    took, error = float(times.values[place]), float(times.errors[place])
    names = {axis.name for axis in known}
    axes = [axis for axis in results.axes if axis.values.size > 1 and axis.name not in names]
    where = f" at {', '.join(axis.at(place[results.dims.index(axis.dim)]) for axis in axes)}" if axes else ""
    ends = [axis.noun for axis in axes if axis.sets_motion and _at_an_end(axis, place[results.dims.index(axis.dim)])]
    end = f", {'an end' if len(ends) == 1 else 'ends'} of the swept {listed(ends)}" if ends else ""
    return f"{quantity(took, 's')}{told_error(error, took, 's')}{words}{where}{end}"


def _at_an_end(axis: Axis, entry: int) -> bool:
    """Whether a value is the smallest or largest of more than two, beyond which there may be better ones."""
    return axis.values.size > 2 and axis.values[entry] in (axis.values.min(), axis.values.max())
