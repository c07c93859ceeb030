"""Figures of residual vibrations: how large they are over a sweep, and how they ring on after the stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from engine.march.settling import names_of_times
from results_schema.arrays import Array
from studies.findings.absolute_errors import absolute_errors
from studies.findings.beyond import AskedOfRest, Limits
from studies.findings.effects import by_effect
from studies.findings.residual import MOST_SENSORS, moves_differ, quiet, residual_of, ringing, settling_of, since
from studies.pictures.common.figures import (
    BLUE,
    Figure,
    draw,
    legend_of_all,
    limit_far,
    limit_line,
    shades,
    telling_limits,
)
from studies.pictures.common.maps import Mapped, maps
from studies.pictures.common.sizes import FAR
from studies.pictures.common.sweep_view import View, along_axis, coincide, draw_curves, one_legend, view
from studies.pictures.common.traces import coarse, per_period, picked, since_rest
from studies.results.findings_common import in_words, told_hanging
from studies.results.formatting import counted, listed, number, quantity, scale_for
from studies.results.places import Index, extreme
from studies.results.results import Results

MOST_HISTORIES = 3
PER_SWING = 8  # stations to a period of what rings: of fewer the farthest may stand an eighth short of it
MOST_BARS = 100  # of points with one each: more hide the points
BAND = 0.3  # of their colour that bands have together


class Row(NamedTuple):
    """A panel over the sweep: values and estimated errors in the sweep's shape, their unit, what stands beside the axis
    in a unit, a limit of the values, where the axis begins (None: where they do), what the smallest value is called
    where it is looked for, and what no value can be less than, whatever its error."""

    sensor: str
    values: Array
    errors: Array
    units: str
    label: Callable[[str], str]
    limit: float | None = None
    base: float | None = 0.0
    best: str = ""
    least: Array | float = 0.0


def pictures(results: Results, asked: AskedOfRest) -> list[Figure]:
    """Over the sweep and over time, of sensors that swing on, and how long they take to settle; none where the study
    does not tell it."""
    known = (sensor for sensor in ringing(results, asked.residual) if np.isfinite(residual_of(results, sensor)).any())
    told = [sensor for sensor in known if not quiet(results, sensor)]
    if not told:
        return []
    sensors, values = told[:MOST_SENSORS], residual_of(results, told[0])
    shown = picked(results, values, MOST_HISTORIES)
    over_sweep = _residuals(results, sensors, asked.residual, len(told) - len(sensors))
    over_time = [_over_time(results, sensors, shown)] if shown else []
    return [*over_sweep, *settling(results, sensors, asked.settling_time), *over_time]


def _residuals(results: Results, sensors: list[str], limits: Limits, fewer: int) -> list[Figure]:
    """Residual vibrations over the sweep."""
    rows = []
    for sensor in sensors:
        errors, label = absolute_errors(results, f"{sensor}_residual"), partial(results.label, sensor, of="residual")
        limit = limits.of(results.study.sensor[sensor])
        rows.append(Row(sensor, residual_of(results, sensor), errors, results.sensors[sensor], label, limit))
    size, units, limit = float(np.nanmax(rows[0].values)), rows[0].units, rows[0].limit
    against = ""
    if limit is not None:
        against = f", {'beyond' if size > limit else 'within'} the limit of {quantity(limit, units)}"
    swings = f"still swings by up to {quantity(size, units)} after {since(results)}"
    caption = (
        "Largest difference from the static value after all carriages have come to rest or left.",
        f"{counted(fewer, 'more sensor')} in the archive." if fewer else "",
    )
    return _over_sweep(results, "residual", rows, f"{sensors[0].replace('_', ' ')} {swings}{against}", caption)


def settling(results: Results, sensors: list[str], asked: float | None) -> list[Figure]:
    """How long sensors take to settle, of those that have a band and do not all settle at once: since the beginning
    where they come to rest at different times; asked: a limit (s) of the time after the stop."""
    known = results.study.sensor
    told = [sensor for sensor in sensors if known[sensor].settling_band is not None]
    told = [one for one in told if np.nanmax(settling_of(results, names_of_times(one)[0]), initial=0.0) > 0.0]
    if not told:
        return []
    with_move = any(moves_differ(results, sensor) for sensor in told)
    begun = "the beginning" if with_move else since(results)
    label = "time of move and settling ({})" if with_move else "settling time ({})"
    rows, bands = list[Row](), list[str]()
    for sensor in told:
        name = names_of_times(sensor)[with_move]
        limit, base = (None, None) if with_move else (asked, 0.0)
        errors, values = absolute_errors(results, name), settling_of(results, name)
        best = "the shortest" if with_move else ""
        stop = values - settling_of(results, names_of_times(sensor)[0])
        rows.append(Row(sensor, values, errors, "s", label.format, limit, base, best, stop))
        bands.append(f"{sensor.replace('_', ' ')} {quantity(float(known[sensor].settling_band or 0.0), 'm')}")
    found = quantity(float((np.nanmin if with_move else np.nanmax)(rows[0].values)), "s")
    caption = (
        f"Time since {begun} until the reading stays within the band of its static value: {listed(bands)}.",
        "Gaps: not settled by the end of the run, or too late to tell that it is for good."
        if any(np.isnan(row.values).any() for row in rows)
        else "",
    )
    first = told[0].replace("_", " ")
    if with_move:
        title = f"move and settling of {first} take at least {found}"
        return _over_sweep(results, "settling", rows, title, caption, np.nanargmin)
    return _over_sweep(results, "settling", rows, f"{first} takes up to {found} to settle", caption)


def _over_sweep(
    results: Results, name: str, rows: list[Row], title: str, words: Sequence[str], by: Any = np.nanargmax
) -> list[Figure]:
    """Rows against the swept number that changes those of the first most, others as where `by` picks one of its values;
    none without such a number."""
    top = extreme(rows[0].values, by)
    assert top is not None
    first, *others = [axis.paths for axis in by_effect(results, rows[0].values)] or [()]
    if not first:
        return []
    seen = view(results, first, [path for paths in others for path in paths], top)
    said, *more = words
    caption = seen.caption(said, _told_errors(seen, rows[0]), *more)
    height = 0.9 + 1.9 * len(rows)
    curves = draw(name, f"{title},{in_words(results, top)}", caption, height, partial(_draw_sweep, seen, rows))
    return [telling_limits(curves), *_map(results, name, rows[0], said)]


def _told_errors(seen: View, row: Row) -> str:
    """What is seen of estimated errors, or how large they are where they would hide the points."""
    if not seen.is_sampled:
        return "Bands: the estimated error."
    if _has_bars(seen):
        return "Bars: the estimated error."
    most = quantity(float(np.nanmax(row.errors, initial=0.0)), row.units, 2)
    return f"Estimated errors of {row.sensor.replace('_', ' ')}: at most {most}."


def _has_bars(seen: View) -> bool:
    return seen.is_sampled and seen.points.size <= MOST_BARS


def _map(results: Results, name: str, row: Row, said: str) -> list[Figure]:
    """The first row over two swept numbers, where these have many values."""
    ends = extreme(row.values), extreme(-row.values)
    assert ends[0] is not None and ends[1] is not None
    place, told = (ends[1], "shortest") if row.best else (ends[0], "largest")
    value = quantity(float(row.values[place]), row.units)
    what = row.label("").replace("\n", " ").replace(" ()", "")
    title = f"{row.sensor.replace('_', ' ')}: the {told} {what} is {value},{in_words(results, place)}"
    return maps(results, Mapped(row.values, row.units, row.label, row.limit, row.best), name, title, said)


def _draw_sweep(seen: View, rows: list[Row], drawing: Drawing) -> None:
    panels = drawing.subplots(len(rows), 1, squeeze=False, sharex=True)[:, 0]
    for axes, row in zip(panels, rows, strict=True):
        _draw_row(axes, seen, row)
    one_legend(list(panels))
    along_axis(panels[-1], seen)
    drawing.align_ylabels()


def _draw_row(axes: Axes, seen: View, row: Row) -> None:
    """The values of one sensor with their errors, and its limit."""
    like, limit = seen.results.dataset["status"], row.limit
    largest = float(np.nanmax(seen.plane(like.copy(data=row.values)), initial=0.0))
    scale = scale_for(largest, row.units)
    curves = seen.curves(like.copy(data=row.values * scale.factor))
    below = np.minimum(row.errors, row.values - row.least)
    bounds = [[one.y for one in seen.curves(like.copy(data=off * scale.factor))] for off in (below, row.errors)]
    draw_curves(axes, seen, curves)
    bands = list(zip(curves, *bounds, shades(len(curves)), strict=True))
    if seen.y is not None and coincide(curves):
        bands = [(curves[-1], bounds[0][-1], bounds[1][-1], BLUE)]
    for curve, low, off, colour in bands:
        if _has_bars(seen):
            at, ends = seen.points, np.stack([low, off])
            axes.errorbar(curve.x[at], curve.y[at], ends[:, at], fmt="none", ecolor=colour, alpha=0.5, linewidth=0.7)
        elif not seen.is_sampled:
            axes.fill_between(
                curve.x, curve.y - low, curve.y + off, color=colour, alpha=BAND / len(bands), linewidth=0.0
            )
    axes.set_ylabel(row.label(scale.unit))
    axes.set_title(row.sensor.replace("_", " "))
    said = f"limit {quantity(limit, row.units)}" if limit is not None else ""
    if limit is not None and limit <= FAR * largest:
        limit_line(axes, limit * scale.factor, said, "left")
    elif limit is not None:
        limit_far(axes, f"{said}, beyond this panel")
    axes.set_ylim(row.base, None)


def _over_time(results: Results, sensors: list[str], shown: list[Index]) -> Figure:
    """Some variants over the time since the stop, the one that swings most of those with a history last."""
    seconds, _ = since_rest(results, sensors[0], shown[-1])
    size = quantity(float(residual_of(results, sensors[0])[shown[-1]]), results.sensors[sensors[0]])
    moves = f"{sensors[0].replace('_', ' ')} swings by up to {size} about its static value after {since(results)}"
    caption = (
        "Readings from the moment on at which all carriages have come to rest or left."
        + (" Brightest line: the kept history that swings most." if len(shown) > 1 else "")
        + (f" {hang}" if (hang := told_hanging(results, sensors)) else "")
        + (coarse(results, seconds) or _few(results, sensors, shown))
    )
    title = ",".join(text for text in (moves, in_words(results, shown[-1])) if text)
    return draw("ringing", title, caption, 0.8 + 1.7 * len(sensors), partial(_draw_time, results, sensors, shown))


def _few(results: Results, sensors: list[str], shown: list[Index]) -> str:
    """Which sensors swing faster than stations show, as a sentence behind another; "" where none does."""
    each = {name: min(per_period(since_rest(results, name, index)[1]) for index in shown) for name in sensors}
    fast = {name: count for name, count in each.items() if count < PER_SWING}
    if not fast:
        return ""
    names, count = listed([name.replace("_", " ") for name in fast]), number(min(fast.values()), 2)
    return (
        f" Stations are too few for {names}, {count} to a period: between them it swings farther than is drawn; "
        '[output] histories = "all" keeps every step.'
    )


def _draw_time(results: Results, sensors: list[str], shown: list[Index], drawing: Drawing) -> None:
    rows = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0]
    for axes, sensor in zip(rows, sensors, strict=True):
        lines = [since_rest(results, sensor, index) for index in shown]
        scale = scale_for(_largest([values for _, values in lines]), results.sensors[sensor])
        for index, (seconds, values), colour in zip(shown, lines, shades(len(shown)), strict=True):
            label = results.at(index).replace(", ", "\n")
            axes.plot(seconds, values * scale.factor, color=colour, label=label, linewidth=1.3)
        axes.set_ylabel(results.label(sensor, scale.unit))
        axes.set_title(sensor.replace("_", " "))
        if results.hangs(sensor):
            axes.invert_yaxis()
    if len(shown) > 1:
        legend_of_all(drawing, rows[0])
    rows[-1].set_xlabel(f"time after {since(results)} (s)")
    drawing.align_ylabels()


def _largest(rows: list[Array]) -> float:
    return max(float(np.abs(values[np.isfinite(values)]).max(initial=0.0)) for values in rows)
