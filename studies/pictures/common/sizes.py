"""Figures of largest values over a sweep, one for each quantity, with the limit that the study names for it."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array
from studies.findings.amplification import largest, only_rounding, size_errors, sizes, told_amplification
from studies.findings.effects import HARDLY, hardly_changed
from studies.findings.in_step import WITH_MASSES, InStep, masses_ride, trains_in_step
from studies.pictures.common.figures import FLAT, INK, Figure, draw, limit_far, limit_line, telling_limits
from studies.pictures.common.sweep_view import UNSEEN, Curve, View, along_axis, draw_curves, one_legend, ratio_above
from studies.results.findings_common import LOOSE, in_words, told_hanging
from studies.results.formatting import counted, listed, number, percent, quantity, scale_for, spanned
from studies.results.places import Index
from studies.results.results import Results

MOST_SENSORS = 4  # of one quantity
MOST_MARKED = 4  # speeds of a train
IN_STEP = "axles in step with a frequency"
DOTTED: Any = {"color": INK, "linewidth": 0.9, "linestyle": ":", "zorder": 1.6}
NEAR = 0.2  # of the largest value: curves within less are drawn on an axis of their own range
ROOM = 0.1  # of that range, beyond its ends
FAR = 2.0  # times the largest value: a limit beyond is told in words, as curves would be flat under it


def gain(results: Results, sensor: str) -> Any:
    """The dynamic amplification of a sensor, over the sweep; NaN where it is not told."""
    known = "dynamic_amplification" in results.dataset
    own = told_amplification(results, sensor) if known else np.full(results.shape, np.nan)
    return results.dataset["status"].transpose(*results.dims).copy(data=own)


def speed_ratio(axes: Any, seen: View) -> None:
    """A scale above of the speed over the critical one, where that is known and says something."""
    if seen.results.study.has_critical_speed:
        ratio_above(axes, seen, seen.results.dataset.coords.get("speed_ratio"), "speed over the critical speed ω₁ L/π")


def sizes_of(seen: View, sensors: list[str], limit: float | None, top: Index) -> Figure:
    """The largest absolute values of sensors of one quantity, those with the largest where they are many, beside their
    amplification where statics know it. top: the variant with the largest value of the first sensor."""
    results = seen.results
    varied = [name for name in sensors if not _is_flat(seen, name)] or sensors
    shown = sorted(varied, key=lambda name: -peak(results, name))[:MOST_SENSORS]
    shown = [name for name in sensors if name in shown]
    fewer = len(varied) - len(shown)
    amplified = any(_has_gain(seen, sensor) for sensor in shown)
    loose = [sensor.replace("_", " ") for sensor in shown if _is_loose(seen, sensor)]
    caption = seen.caption(
        f"{'Left: l' if amplified else 'L'}argest absolute values"
        f"{'; right: over the largest absolute static value of the same model' if amplified else ''}.",
        f"Dashed: {listed(loose)} estimated to within more than {percent(LOOSE)}." if loose else "",
        _told_near(seen, shown, limit),
        told_hanging(results, shown),
        "While the contact holds the answer counts; lines go on beyond." if not results.held.all() else "",
        f"{counted(fewer, 'more sensor')} with smaller values." if fewer else "",
        *(_told_flat(seen, name) for name in sensors if name not in varied),
        *(_told_gain(seen, name) for name in shown),
        _told_in_step(seen),
    )
    fill = partial(_draw, seen, shown, limit, 1 + amplified)
    name = f"largest-{results.noun(shown[0])}"
    return telling_limits(draw(name, _title(results, sensors[0], limit, top), caption, 0.9 + 1.9 * len(shown), fill))


def told_flat(seen: View, sensors: list[str], limit: float | None) -> str:
    """The sizes of sensors, and their amplification, as sentences, where a figure of them would have no more than level
    lines; "" where it shows something."""
    if limit is not None or not all(_is_flat(seen, name) and not _has_gain(seen, name) for name in sensors):
        return ""
    told = (text for name in sensors for text in (_told_flat(seen, name), _told_gain(seen, name)))
    return " ".join(filter(None, told))


def _is_flat(seen: View, sensor: str) -> bool:
    """Whether the sizes of a sensor change along the horizontal axis by no more than an eye sees, not of samples, or
    are rounding."""
    assert seen.x is not None
    if only_rounding(seen.results, sensor):
        return True
    size = seen.results.dataset["status"].copy(data=sizes(seen.results, sensor))
    top = float(np.nanmax(seen.plane(size), initial=0.0))
    return not seen.is_sampled and 0.0 < top * UNSEEN >= seen.most_along(seen.x, size)


def _near(seen: View, sensor: str, limit: float | None) -> tuple[float, float] | None:
    """Ends of the axis of a sensor's sizes, and of its limit where that is drawn, where they differ by little beside
    what they are; None where it begins at 0."""
    known = seen.plane(seen.results.dataset["status"].copy(data=sizes(seen.results, sensor)))
    known = known[np.isfinite(known)]
    low, high = float(known.min(initial=np.inf)), float(known.max(initial=0.0))
    high = high if limit is None or limit > FAR * high else max(high, limit)
    if not 0.0 < (1.0 - NEAR) * high < low:
        return None
    room = max(ROOM * (high - low), FLAT * high * (high - low < UNSEEN * high))
    return low - room, high + room


def _told_near(seen: View, sensors: list[str], limit: float | None) -> str:
    """Of which sensors the axis does not begin at 0, as a sentence; "" where all do."""
    names = [name.replace("_", " ") for name in sensors if _near(seen, name, limit) is not None]
    axes = "axis" if len(names) == 1 else "axes"
    return f"The {axes} of {listed(names)} {'does' if len(names) == 1 else 'do'} not begin at 0." if names else ""


def _has_gain(seen: View, sensor: str) -> bool:
    """Whether the amplification of a sensor is known and is more than a line at one height."""
    known = seen.plane(gain(seen.results, sensor))
    known = known[np.isfinite(known)]
    return bool(known.size and not _is_level(seen, sensor, known))


def _is_level(seen: View, sensor: str, known: Array) -> bool:
    """Whether amplifications of a sensor are a line at one height; of dynamic parts, which may be small, beside the
    largest."""
    part = seen.results.study.sensor[sensor].is_dynamic_part
    return bool(np.ptp(known) <= HARDLY * (float(known.max()) if part else 1.0))


def _told_gain(seen: View, sensor: str) -> str:
    """The amplification of a sensor that is the same all over, as a sentence; "" where it is drawn, or unknown."""
    known = seen.plane(gain(seen.results, sensor))
    known = known[np.isfinite(known)]
    if not known.size or not _is_level(seen, sensor, known):
        return ""
    part = seen.results.study.sensor[sensor].is_dynamic_part
    said = "Dynamic part over the largest static value" if part else "Dynamic amplification"
    return f"{said} of {sensor.replace('_', ' ')}: {number(float(known.max()))} throughout."


def _told_flat(seen: View, sensor: str) -> str:
    """The sizes of a sensor that are no panel, as they hardly change along the horizontal axis."""
    assert seen.x is not None
    if only_rounding(seen.results, sensor):
        return f"Not drawn: {sensor.replace('_', ' ')}, {quantity(0.0, seen.results.sensors[sensor])} but for rounding."
    known = seen.plane(seen.results.dataset["status"].copy(data=sizes(seen.results, sensor)))
    ends = spanned(known[np.isfinite(known)], partial(quantity, units=seen.results.sensors[sensor]))
    same = f"the same within {percent(UNSEEN)} for {seen.x.noun} {seen.x.span}"
    return f"Not drawn: {sensor.replace('_', ' ')}, {ends}, {same}."


def peak(results: Results, sensor: str) -> float:
    """The largest value of a sensor that has values."""
    values = sizes(results, sensor)
    top = largest(results, values)
    assert top is not None
    return float(values[top])


def _title(results: Results, sensor: str, limit: float | None, top: Index) -> str:
    units, size = results.sensors[sensor], peak(results, sensor)
    against = ""
    if limit is not None:
        against = f", {'beyond' if size > limit else 'within'} the limit of {quantity(limit, units)}"
    said = f"The largest {results.noun(sensor)} {results.place(sensor)} is {quantity(size, units)}"
    level = hardly_changed(results, sizes(results, sensor), partial(quantity, units=units))
    return f"{said}{against}" if level else f"{said}{against},{in_words(results, top)}"


def _is_loose(seen: View, sensor: str) -> bool:
    """Whether curves of a sensor's largest values are dashed anywhere."""
    return any((curve.y > LOOSE).any() for curve in _errors(seen, sensor))


def _errors(seen: View, sensor: str) -> list[Curve]:
    """Curves of the errors of a sensor's largest values; none of sampled points, which are never dashed."""
    if seen.is_sampled:
        return []
    return seen.curves(seen.results.dataset["status"].copy(data=size_errors(seen.results, sensor)))


def _curves(seen: View, sensor: str, values: Any) -> list[Curve]:
    """Curves of a sensor's largest values, or of what is proportional to them."""
    curves, errors = seen.curves(values), _errors(seen, sensor)
    if not errors:
        return curves
    return [curve._replace(loose=error.y > LOOSE) for curve, error in zip(curves, errors, strict=True)]


def _draw(seen: View, sensors: list[str], limit: float | None, columns: int, drawing: Drawing) -> None:
    results = seen.results
    grid = drawing.subplots(len(sensors), columns, squeeze=False, sharex=True)
    for row, sensor in zip(grid, sensors, strict=True):
        _draw_sizes(row[0], seen, sensor, limit)
        if columns == 1:
            continue
        if _has_gain(seen, sensor):
            draw_curves(row[1], seen, _curves(seen, sensor, gain(results, sensor)))
            part = results.study.sensor[sensor].is_dynamic_part
            said = "dynamic part over\nthe largest static value" if part else "dynamic amplification"
            row[1].set_ylabel(f"{said}\n{results.place(sensor)}")
        else:
            row[1].set_visible(False)
    one_legend([axes for row in grid for axes in row[::-1]])
    for column in grid.T:
        lowest = [axes for axes in column if axes.get_visible()][-1]
        lowest.tick_params(labelbottom=True)
        along_axis(lowest, seen)
    for axes in grid[0]:
        speed_ratio(axes, seen)
    drawing.align_ylabels()
    lines = [axes.axvline(x, **DOTTED) for x, _, _ in _in_step(seen) for axes in grid.flat]
    if lines:
        drawing.legend(lines[:1], [IN_STEP], loc="outside lower right")


def _told_in_step(seen: View) -> str:
    """What stands at the dotted lines, as a sentence; "" where there are none."""
    assert seen.x is not None
    told = [
        f"{seen.x.in_words(x / seen.x.factor)} ({name}, every {quantity(one.way, 'm')} with {number(one.frequency)} Hz)"
        for x, name, one in sorted(_in_step(seen))
    ]
    return f"Dotted: {IN_STEP} of the body{WITH_MASSES * _rides(seen)}, {listed(told)}." if told else ""


def _rides(seen: View) -> bool:
    """Whether masses of a train that is marked move with its body."""
    return any(masses_ride(seen.results.study, name) for _, name, _ in _in_step(seen))


def _in_step(seen: View) -> list[tuple[float, str, InStep]]:
    """Speeds, as along the horizontal axis, at which axles of trains push in step, with their train, the strongest of
    each, whatever the figure reads; none where curves are of several trains."""
    assert seen.x is not None
    between, sensors = (seen.x.values.min().item(), seen.x.values.max().item()), seen.results.study.sensor.values()
    found = list[tuple[float, str, InStep]]()
    for name, told in trains_in_step(seen.results, seen.x, seen.held, between, sensors).items():
        strongest = sorted(told, key=lambda one: one[1].swing)[-MOST_MARKED:]
        found += [(speed * seen.x.factor, name, one) for speed, one in strongest]
    return found


def _draw_sizes(axes: Axes, seen: View, sensor: str, limit: float | None) -> None:
    """The largest values of a sensor, and its limit."""
    results = seen.results
    size = results.dataset["status"].copy(data=sizes(results, sensor))
    largest_shown = float(np.nanmax(seen.plane(size), initial=0.0))
    scale = scale_for(largest_shown, results.sensors[sensor])
    draw_curves(axes, seen, [curve._replace(y=curve.y * scale.factor) for curve in _curves(seen, sensor, size)])
    axes.set_ylabel(results.label(sensor, scale.unit, "largest"))
    axes.set_title(sensor.replace("_", " "))
    if limit is not None and limit <= FAR * largest_shown:
        limit_line(axes, limit * scale.factor, f"limit {quantity(limit, results.sensors[sensor])}", "left")
    elif limit is not None:
        limit_far(axes, f"limit {quantity(limit, results.sensors[sensor])}, beyond this panel")
    near = _near(seen, sensor, limit)
    axes.set_ylim(*((0.0, None) if near is None else np.multiply(near, scale.factor)))
    if results.hangs(sensor):
        axes.invert_yaxis()
