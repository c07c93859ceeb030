"""The response of a passage on the way: histories of sensors of every quantity, with limits that the study names."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from studies.findings.beyond import Limits
from studies.pictures.common import figures as look
from studies.pictures.common.figures import (
    Figure,
    draw,
    legend_of_all,
    limit_far,
    limit_line,
    shades,
    telling_limits,
    zero_line,
)
from studies.pictures.common.traces import over_way
from studies.results.findings_common import LOOSE, told_hanging
from studies.results.formatting import counted, percent, quantity, scale_for
from studies.results.places import Index
from studies.results.results import Results

MOST_SENSORS = 4
REACHED = 0.5  # of a limit: what stays below has no line, beside which it would be flat
LEFT = 0.02  # of the way: what is recorded beyond it is free vibration


def response(results: Results, ranked: list[str], limits: Limits, shown: list[Index], top: Index) -> Figure:
    """Some variants over the way of the first carriage.

    ranked: sensors, the most telling first. top: the variant of the answer."""
    sensors = ranked[:MOST_SENSORS]
    first, own = sensors[0], shown[-1]
    value, place = _reached(results, first, own)
    said, where = quantity(value, results.sensors[first]), quantity(place, "m")
    title = f"{first.replace('_', ' ')} reaches {said} when {results.carriage_name} has come to {where}"
    whose = "the variant of the answer" if own == top else "the kept history with the largest value"
    errors = {sensor: results.error_at(sensor, own) for sensor in sensors}
    loose = [f" {name.replace('_', ' ')}: estimated to within {percent(e)}." for name, e in errors.items() if e > LOOSE]
    caption = (
        (f"Brightest line: {whose}. " if len(shown) > 1 else "")
        + f"Over the way of {results.carriage_name}."
        + (f" {hang}" if (hang := told_hanging(results, sensors)) else "")
        + "".join(loose)
        + (f" {counted(fewer, 'more sensor')} in the archive." if (fewer := len(ranked) - len(sensors)) else "")
    )
    height = 0.8 + 1.9 * len(sensors)
    figure = draw("response", title, caption, height, partial(_draw, results, sensors, limits, shown))
    if any(axes.patches for axes in figure.drawing.axes):
        grey = f"Grey: {results.carriage_name} has left, and the axis goes on at its last speed."
        figure = replace(figure, caption=f"{figure.caption} {grey}")
    return telling_limits(figure)


def _reached(results: Results, sensor: str, index: Index) -> tuple[float, float]:
    """The value of largest size of one variant, of all steps, and the place of the first carriage then: where it has
    left its body, that of the history."""
    ends = {end: float(results.row(results.dataset[f"{sensor}_{end}"], index)) for end in ("max", "min")}
    side = max(ends, key=lambda end: abs(ends[end]))
    place = float(results.row(results.dataset[f"{sensor}_{side}_position"], index))
    if not np.isfinite(place):
        way = over_way(results, sensor, index)
        place = float(way.position[np.argmin(np.abs(way.values - ends[side]))])
    return ends[side], place


def _draw(results: Results, sensors: list[str], limits: Limits, shown: list[Index], drawing: Drawing) -> None:
    rows = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0]
    for axes, sensor in zip(rows, sensors, strict=True):
        _draw_row(axes, results, sensor, limits.of(results.study.sensor[sensor]), shown)
    if len(shown) > 1:
        legend_of_all(drawing, rows[0])
    rows[-1].set_xlabel(f"way of {results.carriage_name} (m)")
    drawing.align_ylabels()


def _draw_row(axes: Axes, results: Results, sensor: str, limit: float | None, shown: list[Index]) -> None:
    """The histories of one sensor."""
    ways = [over_way(results, sensor, index) for index in shown]
    low, high = (pick([float(pick(way.values, initial=0.0)) for way in ways]) for pick in (np.min, np.max))
    scale = scale_for(max(-low, high), results.sensors[sensor])
    for index, way, colour in zip(shown, ways, shades(len(shown)), strict=True):
        axes.plot(way.position, way.values * scale.factor, color=colour, label=results.at(index).replace(", ", "\n"))
    zero_line(axes)
    _shade_left(axes, results, shown[-1], max(float(way.position.max(initial=0.0)) for way in ways))
    if results.hangs(sensor):
        axes.invert_yaxis()
    axes.set_ylabel(results.label(sensor, scale.unit))
    axes.set_title(sensor.replace("_", " "))
    if limit is not None:
        said = f"limit {quantity(limit, results.sensors[sensor])}"
        sides = [side for side in (-limit, limit) if side * (low if side < 0.0 else high) >= REACHED * limit**2]
        for side in sides:
            limit_line(axes, side * scale.factor, said if side == sides[-1] else "", "right")
        if not sides:
            limit_far(axes, f"{said}, beyond this panel")


def _shade_left(axes: Axes, results: Results, index: Index, end: float) -> None:
    """Grey where the first carriage has left its body; at most its way on it beyond where the last one has left too,
    for the slow are soon still."""
    first = results.trace(f"{results.carriage_name}_position", index)
    on = np.flatnonzero(np.isfinite(first.values))
    if on.size < 2 or first.values[on[-1]] <= first.values[on[0]] or first.values[on[-1]] == first.values[on[-2]]:
        return  # it came back, or stands where it stopped
    start, left = first.values[on[0]], first.values[on[-1]]
    speed = (left - first.values[on[-2]]) / (first.times[on[-1]] - first.times[on[-2]])
    last = max(_last_time(results, carriage, index) for carriage in results.study.carriage)
    end = min(end, left + speed * (last - first.times[on[-1]]) + left - start)
    if end > left + LEFT * (left - start):
        axes.axvspan(left, end, color=look.HAIR, alpha=0.45, linewidth=0.0, zorder=0.5)
        axes.set_xlim(start, end)


def _last_time(results: Results, carriage: str, index: Index) -> float:
    """When a carriage was last on its body."""
    trace = results.trace(f"{carriage}_position", index)
    return float(trace.times[np.isfinite(trace.values)].max(initial=-np.inf))
