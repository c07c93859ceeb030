"""Figures of residual vibrations: how large they are over a sweep, and how they ring on after the stop."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array
from studies.findings.absolute_errors import absolute_errors
from studies.findings.beyond import Limits
from studies.findings.effects import by_effect
from studies.findings.residual import MOST_SENSORS, residual_of, ringing
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
from studies.pictures.common.sizes import FAR
from studies.pictures.common.sweep_view import View, along_axis, coincide, draw_curves, one_legend, view
from studies.pictures.common.traces import coarse, picked, since_rest
from studies.results.findings_common import in_words, told_hanging
from studies.results.formatting import counted, quantity, scale_for
from studies.results.places import Index, extreme
from studies.results.results import Results

MOST_HISTORIES = 3
BAND = 0.3  # of their colour that bands have together


def pictures(results: Results, limits: Limits) -> list[Figure]:
    """Over the sweep and over time, of sensors that swing on; none where the study does not tell it."""
    told = [sensor for sensor in ringing(results, limits) if np.isfinite(residual_of(results, sensor)).any()]
    if not told:
        return []
    sensors, values = told[:MOST_SENSORS], residual_of(results, told[0])
    shown = picked(results, values, MOST_HISTORIES)
    over_sweep = _over_sweep(results, sensors, limits, len(told) - len(sensors))
    return [*over_sweep, *([_over_time(results, sensors, shown)] if shown else [])]


def _over_sweep(results: Results, sensors: list[str], limits: Limits, fewer: int) -> list[Figure]:
    """Residual vibrations against the swept number that changes those of the first sensor most; none without one."""
    values = residual_of(results, sensors[0])
    top = extreme(values)
    assert top is not None
    first, *others = [axis.paths for axis in by_effect(results, values)] or [()]
    if not first:
        return []
    seen = view(results, first, [path for paths in others for path in paths], top)
    units, size = results.sensors[sensors[0]], float(values[top])
    limit = limits.limit(results.study.sensor[sensors[0]].quantity)
    against = ""
    if limit is not None:
        against = f", {'beyond' if size > limit else 'within'} the limit of {quantity(limit, units)}"
    swings = f"{sensors[0].replace('_', ' ')} still swings by up to {quantity(size, units)} at rest"
    caption = seen.caption(
        "Largest difference from the static value after all carriages have come to rest or left.",
        f"{'Bars' if seen.is_sampled else 'Bands'}: the estimated error.",
        f"{counted(fewer, 'more sensor')} in the archive." if fewer else "",
    )
    fill = partial(_draw_sweep, seen, sensors, limits)
    title, height = f"{swings}{against},{in_words(results, top)}", 0.9 + 1.9 * len(sensors)
    return [telling_limits(draw("residual", title, caption, height, fill))]


def _draw_sweep(seen: View, sensors: list[str], limits: Limits, drawing: Drawing) -> None:
    rows = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0]
    for axes, sensor in zip(rows, sensors, strict=True):
        _draw_row(axes, seen, sensor, limits.limit(seen.results.study.sensor[sensor].quantity))
    one_legend(list(rows))
    along_axis(rows[-1], seen)
    drawing.align_ylabels()


def _draw_row(axes: Axes, seen: View, sensor: str, limit: float | None) -> None:
    """The residual vibrations of one sensor with their errors, and its limit."""
    results, units = seen.results, seen.results.sensors[sensor]
    like = results.dataset["status"]
    values, errors = residual_of(results, sensor), absolute_errors(results, f"{sensor}_residual")
    largest = float(np.nanmax(seen.plane(like.copy(data=values)), initial=0.0))
    scale = scale_for(largest, units)
    curves = seen.curves(like.copy(data=values * scale.factor))
    bounds = [curve.y for curve in seen.curves(like.copy(data=errors * scale.factor))]
    draw_curves(axes, seen, curves)
    bands = list(zip(curves, bounds, shades(len(curves)), strict=True))
    if seen.y is not None and coincide(curves):
        bands = [(curves[-1], bounds[-1], BLUE)]
    for curve, off, colour in bands:
        if seen.is_sampled:
            at = seen.points
            axes.errorbar(curve.x[at], curve.y[at], off[at], fmt="none", ecolor=colour, alpha=0.5, linewidth=0.7)
        else:
            axes.fill_between(
                curve.x, curve.y - off, curve.y + off, color=colour, alpha=BAND / len(bands), linewidth=0.0
            )
    axes.set_ylabel(results.label(sensor, scale.unit, "residual"))
    axes.set_title(sensor.replace("_", " "))
    said = f"limit {quantity(limit, units)}" if limit is not None else ""
    if limit is not None and limit <= FAR * largest:
        limit_line(axes, limit * scale.factor, said, "left")
    elif limit is not None:
        limit_far(axes, f"{said}, beyond this panel")
    axes.set_ylim(0.0, None)


def _over_time(results: Results, sensors: list[str], shown: list[Index]) -> Figure:
    """Some variants over the time since the stop, the one that swings most of those with a history last."""
    seconds, values = since_rest(results, sensors[0], shown[-1])
    low, high = (quantity(float(end), results.sensors[sensors[0]]) for end in (values.min(), values.max()))
    moves = f"{sensors[0].replace('_', ' ')} moves between {low} and {high} after the stop"
    caption = (
        "Readings from the moment on at which all carriages have come to rest or left."
        + (" Brightest line: the kept history that swings most." if len(shown) > 1 else "")
        + (f" {hang}" if (hang := told_hanging(results, sensors)) else "")
        + coarse(results, seconds)
    )
    title = ",".join(text for text in (moves, in_words(results, shown[-1])) if text)
    return draw("ringing", title, caption, 0.8 + 1.7 * len(sensors), partial(_draw_time, results, sensors, shown))


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
    rows[-1].set_xlabel("time after the stop (s)")
    drawing.align_ylabels()


def _largest(rows: list[Array]) -> float:
    return max(float(np.abs(values[np.isfinite(values)]).max(initial=0.0)) for values in rows)
