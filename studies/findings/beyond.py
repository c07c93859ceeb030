"""Where in a sweep values are beyond a limit, and the limits of sensors that a table [question] may name."""

from collections.abc import Collection, Mapping
from functools import reduce
from typing import Annotated, cast

import numpy as np
from pydantic import Field

from engine.scene.sensors import Sensor
from engine.scene.study import Study
from engine.study_file.spec import Spec
from engine.study_file.units import Acceleration, Angle, Dimensionless, Force, Length, Pressure, Speed, Time, Torque
from results_schema.arrays import Array, Mask
from studies.findings.amplification import largest, sizes
from studies.protocol.study import kind_named, question_of
from studies.results.axes import DIRECTION, PACES, VARIANT, Axis
from studies.results.findings_common import LOOSE
from studies.results.formatting import counted, listed, number, percent, quantity
from studies.results.results import Results

MOST_PARTS = 8  # of a sweep that are told one by one
MOST_APART = 3  # of them that are told each with what else is swept
MOST_TOLD = 4  # values of another swept number that are told one by one
GAP = 3.0  # times the usual distance of two values of a sweep
SHARED = 50  # variants from which on a part of them is told too: of fewer one is more than 2 %
MOST_SHARES, FEWEST_SAMPLES = 6, 10  # values of a swept number that are told with the part of their variants
NEARLY, CLOSE = 0.9, 0.99  # of a limit that is exceeded nowhere, or not beside: between swept values it may well be
UNLIKE = 1e-4  # of a limit: what stays below is a limit in another unit, such as 3 for 3 um
LIMIT = " Its absolute value exceeds "
LIMITED = (
    *("displacement", "rotation", "velocity", "acceleration", "bending_moment", "shear_force", "axial_force", "stress"),
    *("support_reaction", "support_moment", "contact_force", "suspension_force", "position_error"),
    *("drive_torque", "drive_force", "joint_angle", "joint_displacement"),
)


class Limits(Spec):
    """Of sensors' readings, by their quantity."""

    displacement: Annotated[Length, Field(gt=0)] | None = None
    rotation: Annotated[Angle, Field(gt=0)] | None = None
    velocity: Annotated[Speed, Field(gt=0)] | None = None
    acceleration: Annotated[Acceleration, Field(gt=0)] | None = None
    bending_moment: Annotated[Torque, Field(gt=0)] | None = None
    shear_force: Annotated[Force, Field(gt=0)] | None = None
    axial_force: Annotated[Force, Field(gt=0)] | None = None
    stress: Annotated[Pressure, Field(gt=0)] | None = None
    support_reaction: Annotated[Force, Field(gt=0)] | None = None
    support_moment: Annotated[Torque, Field(gt=0)] | None = None
    contact_force: Annotated[Force, Field(gt=0)] | None = None
    suspension_force: Annotated[Force, Field(gt=0)] | None = None

    def limit(self, name: str) -> float | None:
        """What is named for a quantity."""
        return getattr(self, name, None) if name in LIMITED else None

    def of(self, sensor: Sensor) -> float | None:
        """What is named for what a sensor reads: of wholes."""
        return None if sensor.is_dynamic_part else self.limit(sensor.quantity)


class LimitsAtRest(Limits):
    """The same of residual vibrations, in which a dynamic part swings as the whole does."""

    def of(self, sensor: Sensor) -> float | None:
        return self.limit(sensor.quantity)


class AskedOfRest(Spec):
    """What a table [question] asks of the time after all carriages have come to rest or left. residual: limits of
    residual vibrations, settling_time: of how long sensors take to settle, of which is told where they are exceeded."""

    residual: LimitsAtRest = LimitsAtRest()
    settling_time: Annotated[Time, Field(gt=0)] | None = None


class AskedOfPassages(Limits, AskedOfRest):
    """The table [question] of a passage. amplification: dynamic over static, of which is told at which speeds it is
    exceeded; the limits: of absolute values, of which the same is told for every sensor of that quantity; dynamic_part:
    of sensors that read no more than that; least_contact: part of its weight, of which is told where a contact force
    falls below it."""

    amplification: Annotated[Dimensionless, Field(gt=0)] = 1.1
    least_contact: Annotated[Dimensionless, Field(gt=0, lt=1)] | None = None
    dynamic_part: Limits = Limits()

    def of(self, sensor: Sensor) -> float | None:
        return self.dynamic_part.limit(sensor.quantity) if sensor.is_dynamic_part else super().of(sensor)


def limits_of(study: Study) -> Limits:
    """The limits that a study's table [question] names; none where its kind knows none of readings."""
    kind = kind_named(study.kind)
    if not kind.names_limits or kind.settings is None:
        return Limits()
    return cast(Limits, question_of(study, kind.settings))


def check_limits(study: Study, asked: AskedOfPassages) -> None:
    """Refuse limits of what nothing reads. Raises BadInput."""
    wholes = {one.quantity for one in study.sensor.values() if not one.is_dynamic_part}
    parts = {one.quantity for one in study.sensor.values() if one.is_dynamic_part}
    along = {one.quantity for one in study.envelope.values()}
    for key, limits, read in (
        ("", asked, wholes | along),
        ("dynamic_part.", asked.dynamic_part, parts),
        ("residual.", asked.residual, wholes | parts),
    ):
        for name in LIMITED:
            if limits.limit(name) is not None and name not in read:
                what = f"a limit of {name.replace('_', ' ')}, which nothing here reads"
                part = ' and part = "dynamic"' * key.startswith("dynamic")
                remedy = f'a sensor with quantity = "{name}"{part}, or no such limit'
                raise study.source.fault(f"question.{key}{name}", what, remedy=remedy)


def check_least_contact(study: Study, asked: AskedOfPassages) -> None:
    """Refuse a limit of contact forces where none reacts or has a weight. Raises BadInput."""
    if asked.least_contact is None:
        return
    if not (study.gravity and any(one.inertial for one in study.carriage.values())):
        what = "a limit of contact forces, where no carriage has a weight that it presses with"
        remedy = 'a carriage of the kind "mass", "oscillator" or "body", and gravity'
        raise study.source.fault("question.least_contact", what, remedy=remedy)


def told_limit(
    results: Results, values: Array, limit: float, units: str, axis: Axis | None = None, error: Array | float = 0.0
) -> str:
    """In which part of the sweep largest absolute values (in its shape) exceed a limit: a sentence behind another;
    along a swept number, the pace if none is given. error: of the values, which may be too loose to say."""
    along = axis or results.axis(*PACES)
    said = where_beyond(results, values, limit, along)
    loose = np.where(error > LOOSE * values, error, 0.0)
    either = [where_beyond(results, values + sign * loose, limit, along) for sign in (-1.0, 1.0)]
    surely, perhaps = (_where_alone(results, values + sign * loose, limit, along) for sign in (-1.0, 1.0))
    doubt = f"; with its estimated error perhaps {perhaps}, surely {surely}" if either != [said, said] else ""
    top = float(np.nanmax(np.where(results.with_values, values, np.nan), initial=0.0))
    near = f"; at most it is {quantity(top, units)}" if said.startswith("nowhere") and top > NEARLY * limit else ""
    near = near or _comes_close(results, values, limit, along)
    named, opened = f"{quantity(limit, units)}{out_of_reach(limit, top)}", _told_opened(results, values > limit)
    return f"{LIMIT}{named} {said}{near}{doubt}{opened}."


def out_of_reach(limit: float, top: float) -> str:
    """A doubt about a limit's unit where the largest value is nothing beside it; "" elsewhere.

    >>> out_of_reach(3.0, 2e-6), out_of_reach(3e-6, 2e-6)
    (' (1.5e6 times the largest value: is its unit right?)', '')
    """
    return f" ({number(limit / top)} times the largest value: is its unit right?)" if 0.0 < top < limit * UNLIKE else ""


def _told_opened(results: Results, beyond: Mask) -> str:
    """In how many of the variants that do not count, as their contact opens, a limit is exceeded; "" in none."""
    opened = results.kept.values & ~results.with_values
    if not (beyond & opened).any():
        return ""
    many = f"{int((beyond & opened).sum()):,} of {counted(int(opened.sum()), 'variant')}"
    return f"; it does in {many} whose contact opens"


def ranked(results: Results, limits: Limits, told: Collection[str] = ()) -> list[str]:
    """Sensors by what they say, as `in_turns` has them, by their largest absolute values."""
    return in_turns(results, limits, {name: largest_size(results, name) for name in results.sensors}, told)


def in_turns(results: Results, limits: Limits, size: Mapping[str, float], told: Collection[str] = ()) -> list[str]:
    """Sensors by how large they get: the largest of every quantity, first those with a limit, by the part of it that
    they reach; then all others with a limit, then the second largest of every other quantity, and so on.

    told: quantities of which something larger is told before. A carriage's own sprung mass is not compared with bodies
    under it.
    """
    alike: dict[tuple[str, bool], list[str]] = {}
    for name, sensor in results.study.sensor.items():
        alike.setdefault((sensor.words, sensor.carriage is None), []).append(name)
    order: dict[str, tuple[bool, bool, int, float, int]] = {}
    for place, ((read, of_body), names) in enumerate(alike.items()):
        limit, first = limits.of(results.study.sensor[names[0]]), int(of_body and read in told)
        for turn, name in enumerate(sorted(names, key=lambda name: -size[name]), first):
            free, part = limit is None, 0.0 if limit is None else size[name] / limit
            order[name] = (turn > 0, free, turn if free else 0, -part, place)
    return sorted(order, key=order.__getitem__)


def largest_size(results: Results, sensor: str) -> float:
    """The largest absolute value of a sensor; negative where it has none."""
    values = sizes(results, sensor)
    top = largest(results, values)
    return -1.0 if top is None else float(values[top])


def of_every_quantity(results: Results, most: int) -> list[str]:
    """So many sensors: the largest of every quantity, in the order of the file, then the second largest, and so on."""
    return ranked(results, Limits())[:most]


def where_beyond(results: Results, values: Array, threshold: float, axis: Axis | None) -> str:
    """In which part of the sweep values (in its shape) exceed a threshold: along one swept number, for each value of
    another where these are few; without one in how many variants."""
    return where(results, np.nan_to_num(np.where(results.with_values, values, np.nan)) > threshold, axis)


def where(results: Results, beyond: Mask, axis: Axis | None) -> str:
    """In which part of the sweep variants are beyond something, as of `where_beyond`; along what is swept alone too."""
    axis = results.axes[0] if axis is None and len(results.axes) == 1 else axis
    if not beyond.any() and sum(one.values.size > 1 for one in results.axes) > 1:
        known = int(np.count_nonzero(results.with_values))
        return "nowhere in the sweep" if known == results.size else f"nowhere in the {known:,} variants that count"
    if axis is not None and VARIANT in results.dims and _has_samples(results, axis):
        return _in_parts(results, axis, beyond)
    if axis is None or axis.dim == VARIANT:
        return _share(results, beyond) if beyond.any() else "nowhere"
    others = [other for other in results.axes if other.name != axis.name]
    if len(others) != 1 or not 1 < others[0].values.size <= MOST_TOLD:
        return _along(results, axis, beyond)
    own = results.everywhere(results.dataset[others[0].name])
    told = {float(value): _along(results, axis, beyond, own == value) for value in np.unique(own)}
    alike = {text: [others[0].in_words(value) for value in told if told[value] == text] for text in told.values()}
    if len(alike) == 1:
        return next(iter(alike))
    last = sorted(alike.items(), key=lambda item: item[0].startswith("nowhere"))
    return "; ".join(f"{text} ({others[0].noun} {listed(values)})" for text, values in last)


def _share(results: Results, beyond: Mask) -> str:
    """How many variants are beyond something, of those that speak for all where no other one is."""
    known = beyond | results.with_values
    part = f" ({percent(float(beyond[known].mean()))})" if known.sum() >= SHARED else ""
    those = f"the {known.sum():,} that count" if known.sum() < results.size else f"{results.size:,}"
    return f"in {counted(int(beyond.sum()), 'variant')} of {those}{part}"


def _everywhere(axis: Axis) -> str:
    if axis.sets(DIRECTION):
        return "both ways"
    return f"everywhere from {'' if axis.units else f'{axis.noun} '}{axis.span}"


def _has_samples(results: Results, axis: Axis) -> bool:
    """Whether there are many variants at each of the few values of a swept number."""
    few = np.unique(axis.values).size
    return 1 < few <= MOST_SHARES and results.size >= FEWEST_SAMPLES * few


def _in_parts(results: Results, axis: Axis, beyond: Mask) -> str:
    """At each value of a swept number, in which part of its variants values are beyond a threshold."""
    own, known = results.everywhere(results.dataset[axis.name]), results.with_values
    parts = {float(value): beyond[(own == value) & known].mean() for value in np.unique(own[known])}
    if {*parts.values()} == {1.0}:
        return _everywhere(axis)
    told = [f"at {axis.in_words(value)} in {percent(part)}" for value, part in parts.items()]
    return f"{listed(told)} of the variants"


def _comes_close(results: Results, values: Array, limit: float, axis: Axis | None) -> str:
    """Where along a swept number values are just below a limit, and none there or beside them is above it; "" nowhere,
    and of samples, of which it is told in which part they are above."""
    if axis is None or axis.dim == VARIANT or (VARIANT in results.dims and _has_samples(results, axis)):
        return ""
    line = np.moveaxis(np.where(results.with_values, values, 0.0), results.dims.index(axis.dim), 0)
    line = line[np.argsort(axis.values)]
    over = np.pad(line > limit, [(1, 1)] + [(0, 0)] * (line.ndim - 1))
    close = (line > CLOSE * limit) & ~(over[:-2] | over[1:-1] | over[2:])
    there, beyond = (of.reshape(len(line), -1).any(axis=1) for of in (close, line > limit))
    places = np.sort(axis.values)[there & ~beyond]
    if not places.size:
        return ""
    return (
        f"; within {percent(1.0 - CLOSE)} of it, so perhaps beyond between the swept values, it comes at "
        + listed([axis.in_words(float(place)) for place in places[:MOST_APART]])
        + " and more" * (places.size > MOST_APART)
    )


def _where_alone(results: Results, values: Array, threshold: float, axis: Axis | None) -> str:
    """The same along one swept number, whatever the others are; of samples in which part of them."""
    if axis is None or axis.dim == VARIANT or (VARIANT in results.dims and _has_samples(results, axis)):
        return where_beyond(results, values, threshold, axis)
    beyond = np.nan_to_num(np.where(results.with_values, values, np.nan)) > threshold
    return _along(results, axis, beyond, results.with_values)


def _along(results: Results, axis: Axis, beyond: Mask, among: Mask | None = None) -> str:
    """The parts of a swept number in which any variant (among some) is beyond a threshold, and which these are. A part
    ends where the number leaves out more than `GAP` times its usual distance: nothing was computed there."""
    beyond = beyond if among is None else beyond & among
    places = np.unique(axis.values)
    over = np.isin(places, _values_of(results, axis, beyond))
    if not over.any():
        if axis.sets(DIRECTION):
            return "neither way"
        return f"nowhere {_known_along(results, axis, results.with_values if among is None else among)}"
    steps = _steps(places)
    apart = np.flatnonzero(over[:-1] & over[1:] & (steps > GAP * np.median(steps)))
    if over.all() and not apart.size:
        return f"{_everywhere(axis)}{_common(results, axis, beyond) if among is None else ''}"
    turns = np.flatnonzero(np.diff(over, prepend=False, append=False))
    bounds = np.sort(np.concatenate([turns, apart + 1, apart + 1]))
    parts = [places[first:end] for first, end in zip(bounds[::2], bounds[1::2], strict=True)]
    beside = [_common(results, axis, beyond & _having(results, axis, part)) if among is None else "" for part in parts]
    end = float(places[-1])
    if len(set(beside)) > 1 and len(parts) <= MOST_APART:
        return listed([f"{_at(axis, [part], end)}{own}" for part, own in zip(parts, beside, strict=True)])
    whole = _common(results, axis, beyond) if among is None else ""
    if len(parts) <= MOST_PARTS:
        return f"{_at(axis, parts, end)}{whole}"
    first, last = (_at(axis, [part], end) for part in (parts[0], parts[-1]))
    return f"in {len(parts)} parts of the sweep, first {first}, last {last}{whole}"


def _known_along(results: Results, axis: Axis, among: Mask) -> str:
    """Along which values of a swept number anything counts: "from 8 to 20 m/s"."""
    places = np.unique(axis.values)
    told = np.isin(places, _values_of(results, axis, among & results.with_values))
    if told.all() or not told.any():
        return f"from {axis.span}"
    turns = np.flatnonzero(np.diff(told, prepend=False, append=False))
    parts = [places[first:end] for first, end in zip(turns[::2], turns[1::2], strict=True)]
    each = [f"{'from' if part.size > 1 else 'at'} {axis.spans([part])}" for part in parts]
    return f"{listed(each) if len(each) <= MOST_PARTS else f'from {axis.span}'}, where it is known"


def _values_of(results: Results, axis: Axis, which: Mask) -> Array:
    """The values of a swept number that some variants have, ascending."""
    others = tuple(number for number, dim in enumerate(results.dims) if dim != axis.dim)
    return np.unique(axis.values[which.any(axis=others)])


def _having(results: Results, axis: Axis, values: Array) -> Mask:
    """Which variants have one of some values of a swept number, to be spread over the sweep."""
    return np.isin(axis.values, values).reshape([-1 if dim == axis.dim else 1 for dim in results.dims])


def _steps(places: Array) -> Array:
    """How far ascending values of a sweep are apart: by difference or by ratio, whichever is the more even.

    >>> _steps(np.array([1.0, 2.0, 3.0, 10.0, 11.0])), _steps(np.array([0.1, 1.0, 10.0, 1000.0])) / np.log(10.0)
    (array([1., 1., 7., 1.]), array([1., 1., 2.]))
    """
    ways = [np.diff(places), *([np.diff(np.log(places))] if places[0] > 0.0 else [])]
    return min(ways, key=lambda steps: float(np.median(np.abs(steps / np.median(steps) - 1.0))) if steps.size else 0.0)


def _at(axis: Axis, parts: list[Array], end: float) -> str:
    """Parts of a swept number in few words; one of several values that reaches the end of the sweep stays open.

    >>> speed = Axis("speed", "speed", {}, np.arange(1.0, 10.0), "m s-1")
    >>> _at(speed, [speed.values[:1], speed.values[2:4], speed.values[8:]], 9.0)
    'at 1, 3 to 4 and 9 m/s'
    >>> _at(speed, [speed.values[:1], speed.values[2:4], speed.values[6:]], 9.0)
    'at 1 and 3 to 4 m/s, and from 7 m/s to the end of the sweep, 9 m/s'
    """
    closed = [part for part in parts if part.size == 1 or part[-1] != end]
    told = [f"at {axis.spans(closed)}"] if closed else []
    if len(closed) < len(parts):
        told.append(f"from {axis.in_words(float(parts[-1][0]))} to the end of the sweep, {axis.in_words(end)}")
    return (", and " if len(closed) > 1 else " and ").join(told)


def _common(results: Results, along: Axis, which: Mask) -> str:
    """What else is swept and has not all of its values among some variants, in brackets; "not throughout", or "not with
    every" where it has all, where not every combination of these with the values of ``along`` is among them."""
    others = [axis for axis in results.axes if axis.name != along.name and axis.values.size > 1]
    own = {axis.name: _values_of(results, axis, which) for axis in (along, *others)}
    told = [
        f"{axis.noun} {_spans(axis, own[axis.name])}"
        for axis in others
        if own[axis.name].size < np.unique(axis.values).size
    ]
    among = reduce(np.logical_and, [_having(results, axis, own[axis.name]) for axis in (along, *others)])
    full = not (among & results.with_values & ~which).any()
    if told:
        return f" ({', '.join(told)}{'' if full else ', not throughout'})"
    return "" if full else f" (not with every {listed([axis.noun for axis in others])})"


def _spans(axis: Axis, own: Array) -> str:
    """Some ascending values of a swept number: from the first to the last, but for one or two that lie between."""
    places = np.searchsorted(np.unique(axis.values), own)
    parts = np.split(own, np.flatnonzero(np.diff(places) > 1) + 1)
    return axis.spans(parts if len(parts) <= MOST_APART else [own])
