"""Figures of a passage: the largest values, their amplification, the contact force, the response on the way."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

from studies.findings.amplification import largest, size_errors, sizes
from studies.findings.theory import body_mass
from studies.pictures.common import figures as look
from studies.pictures.common.figures import Figure, colour_bar, draw, legend_of_all, shades, zero_line
from studies.pictures.common.sweep_view import (
    DAMPING,
    SPEEDS,
    Curve,
    View,
    along_axis,
    draw_curves,
    draw_map,
    one_legend,
    ratio_above,
    view,
)
from studies.pictures.common.traces import over_way, picked
from studies.results.findings_common import LOOSE, in_words
from studies.results.formatting import listed, number, percent, quantity, scale_for
from studies.results.results import Index, Results, chosen, extreme

MOST_SENSORS = 4
MOST_HISTORIES = 4
CURVES = (".mass", *DAMPING, ".force")  # by what they tell: a force multiplies all that it does by the same factor
MANY = 6  # values of the second axis from which on a map says more than curves
FLAT = 0.1  # a map of ratios that vary less shows nothing
LEFT = 0.02  # of the way: what is recorded beyond it is free vibration
DOWN = "Displacements point down, as the body hangs."


def pictures(results: Results) -> list[Figure]:
    """All figures that the sweep and the kept histories allow."""
    sensors = list(chosen([name for name in results.sensors if np.isfinite(sizes(results, name)).any()], MOST_SENSORS))
    if not sensors:
        return []
    top = largest(results, sizes(results, sensors[0]))
    assert top is not None
    seen, found = view(results, SPEEDS, CURVES, top), []
    if seen.x is not None:
        found.append(_largest(seen, sensors, top))
        if seen.y is not None and len(seen.y.values) > MANY and _varies(seen, _gain(results, sensors[0])):
            found.append(_map(seen, sensors[0]))
        found += [_contact(seen, name) for name in results.study.carriage if _has_contact(seen, name)]
    size = np.where(results.with_values, sizes(results, sensors[0]), np.nan)
    shown = picked(results, size, MOST_HISTORIES)
    return [*found, *([_response(results, sensors, shown, top)] if shown else [])]


def _gain(results: Results, sensor: str) -> Any:
    return results.of_sensor("dynamic_amplification", sensor)


def _varies(seen: View, values: Any) -> bool:
    """Whether ratios differ over the shown part of the sweep by more than an eye sees in colours."""
    known = seen.plane(values)
    known = known[np.isfinite(known)]
    return bool(known.size and np.ptp(known) > FLAT)


def _has_contact(seen: View, carriage: str) -> bool:
    """Whether there is a force of a carriage that varies; what is the same everywhere the findings say."""
    inertial = seen.results.study.carriage[carriage].inertial
    has = inertial and f"{carriage}_contact_force_min" in seen.results.dataset
    return has and _varies(seen, _relative_force(seen, carriage))


def _speed_ratio(axes: Any, seen: View) -> None:
    ratio_above(axes, seen, seen.results.dataset.coords.get("speed_ratio"), "speed over the critical speed ω₁ L/π")


def _largest(seen: View, sensors: list[str], top: Index) -> Figure:
    results, first = seen.results, sensors[0]
    amplified = any(np.isfinite(seen.plane(_gain(results, sensor))).any() for sensor in sensors)
    value = quantity(float(sizes(results, first)[top]), results.sensors[first])
    title = f"The largest {results.noun(first)} {results.place(first)} is {value},{in_words(results, top)}"
    hang = " Displacements point down." if any(map(results.hangs, sensors)) else ""
    held = " While the contact holds the answer counts; lines go on beyond." if not results.held.all() else ""
    loose = [sensor.replace("_", " ") for sensor in sensors if _is_loose(seen, sensor)]
    dashed = f" Dashed: {listed(loose)} estimated to within more than {percent(LOOSE)}." if loose else ""
    right = "; right: over the largest absolute static value of the same model" if amplified else ""
    caption = seen.caption(f"{'Left: l' if amplified else 'L'}argest absolute values{right}.{dashed}{hang}{held}")
    height = 0.9 + 1.9 * len(sensors)
    return draw("largest", title, caption, height, partial(_draw_largest, seen, sensors, 1 + amplified))


def _is_loose(seen: View, sensor: str) -> bool:
    """Whether curves of a sensor's largest values are dashed anywhere; sampled points are not."""
    return not seen.is_sampled and any((curve.y > LOOSE).any() for curve in seen.curves(_errors(seen, sensor)))


def _errors(seen: View, sensor: str) -> Any:
    return seen.results.dataset["status"].copy(data=size_errors(seen.results, sensor))


def _curves(seen: View, sensor: str, values: Any) -> list[Curve]:
    """Curves of a sensor's largest values, or of what is proportional to them."""
    pairs = zip(seen.curves(values), seen.curves(_errors(seen, sensor)), strict=True)
    return [curve._replace(loose=error.y > LOOSE) for curve, error in pairs]


def _draw_largest(seen: View, sensors: list[str], columns: int, drawing: Drawing) -> None:
    results = seen.results
    grid = drawing.subplots(len(sensors), columns, squeeze=False, sharex=True)
    for row, sensor in zip(grid, sensors, strict=True):
        units, size = results.sensors[sensor], seen.results.dataset["status"].copy(data=sizes(results, sensor))
        scale = scale_for(float(np.nanmax(seen.plane(size), initial=0.0)), units)
        draw_curves(row[0], seen, [curve._replace(y=curve.y * scale.factor) for curve in _curves(seen, sensor, size)])
        row[0].set_ylabel(results.label(sensor, scale.unit, "largest"))
        row[0].set_title(sensor.replace("_", " "))
        row[0].set_ylim(0.0, None)
        if results.hangs(sensor):
            row[0].invert_yaxis()
        if columns == 1:
            continue
        if np.isfinite(seen.plane(_gain(results, sensor))).any():
            draw_curves(row[1], seen, _curves(seen, sensor, _gain(results, sensor)))
            row[1].set_ylabel(f"dynamic amplification\n{results.place(sensor)}")
        else:
            row[1].set_visible(False)
    one_legend([axes for row in grid for axes in row[::-1]])
    for column in grid.T:
        lowest = [axes for axes in column if axes.get_visible()][-1]
        lowest.tick_params(labelbottom=True)
        along_axis(lowest, seen)
    for axes in grid[0]:
        _speed_ratio(axes, seen)
    drawing.align_ylabels()


def _map(seen: View, sensor: str) -> Figure:
    results = seen.results
    best = extreme(seen.cut(_gain(results, sensor)))
    assert best is not None
    peak = float(seen.cut(_gain(results, sensor)).values[best])
    title = f"{sensor.replace('_', ' ')}: statics are exceeded {number(peak)} times at most"
    return draw("amplification-map", title, seen.caption(), 3.4, partial(_draw_map, seen, sensor))


def _draw_map(seen: View, sensor: str, drawing: Drawing) -> None:
    axes = drawing.subplots()
    mesh = draw_map(axes, seen, _gain(seen.results, sensor), cmap="viridis")
    _speed_ratio(axes, seen)
    colour_bar(axes, mesh, "dynamic amplification")


def _contact(seen: View, carriage: str) -> Figure:
    force = _relative_force(seen, carriage)
    line = "; the line is where that begins" if _has_line(seen, force) else ""
    caption = seen.caption(
        "Smallest contact force over the weight, without the last 2 % of a way towards a held end.",
        f"Below zero the carriage would lift off{line}.",
    )
    least = float(np.nanmin(seen.plane(force)))
    title = f"{carriage} keeps its contact, with at least {number(least, 2)} of its weight"
    if least < 0.0:
        title = f"{carriage} would lift off{_from(seen, force)}"
    elif float(np.nanmin(force)) < 0.0:
        title = f"{carriage} keeps its contact in this part of the sweep, and would lift off in another"
    height = 3.4 if seen.y is not None else 2.8
    return draw(f"contact-{carriage}", title, caption, height, partial(_draw_contact, seen, carriage))


def _from(seen: View, force: Any) -> str:
    """From which value of the horizontal axis on a force turns negative anywhere in the shown part."""
    assert seen.x is not None
    grid = seen.plane(force)
    opened = (np.nan_to_num(grid) < 0.0).reshape(len(grid), -1).any(axis=1)
    first = float(seen.along(seen.x)[opened].min())
    return f" from {seen.x.noun} {seen.x.in_words(first / seen.x.factor)} on"


def _relative_force(seen: View, carriage: str) -> Any:
    """Smallest contact force over the weight; of a body that rides, over its weight without sweep."""
    spec = seen.results.study.carriage[carriage]
    mass = sum(seen.results.parameter(f"carriage.{carriage}.{key}") for key in spec.masses)
    if spec.riding_body is not None:
        mass = body_mass(seen.results, spec.riding_body)
    return seen.results.dataset[f"{carriage}_contact_force_min"] / (mass * seen.results.parameter("gravity"))


def _has_line(seen: View, force: Any) -> bool:
    """Whether a map of the force has a line of zero: on a grid, where both signs occur."""
    grid = seen.plane(force)
    known = grid[np.isfinite(grid)]
    on_grid = seen.y is not None and not seen.is_sampled and min(grid.shape) >= 2
    return bool(on_grid and known.size and known.min() < 0.0 < known.max())


def _draw_contact(seen: View, carriage: str, drawing: Drawing) -> None:
    force = _relative_force(seen, carriage)
    axes = drawing.subplots()
    if seen.y is None:
        draw_curves(axes, seen, seen.curves(force))
        zero_line(axes)
        along_axis(axes, seen)
        axes.set_ylabel("smallest contact force / weight")
    else:
        mesh = draw_map(axes, seen, force, cmap="PuOr", vmin=-1.0, vmax=1.0)
        colour_bar(axes, mesh, "smallest contact force / weight", extend="both")
    _speed_ratio(axes, seen)
    if seen.y is not None and seen.x is not None and _has_line(seen, force):
        x, y = seen.along(seen.x), seen.along(seen.y)
        axes.contour(x, y, seen.plane(force).T, [0.0], colors=look.VERMILION, linewidths=1.8)
        line = Line2D([], [], color=look.VERMILION, linewidth=1.8)
        axes.legend([line], ["contact opens"], loc="lower right", framealpha=0.85, frameon=True)


def _response(results: Results, sensors: list[str], shown: list[Index], top: Index) -> Figure:
    first, own = sensors[0], shown[-1]
    way = over_way(results, first, own)
    at = int(np.argmax(np.abs(way.values)))
    value = quantity(float(way.values[at]), results.sensors[first])
    where = quantity(float(way.position[at]), "m")
    title = f"{first.replace('_', ' ')} reaches {value} when {results.carriage_name} has come to {where}"
    whose = "the variant of the answer" if own == top else "the kept history with the largest value"
    errors = {sensor: results.error_at(sensor, own) for sensor in sensors}
    loose = [f" {name.replace('_', ' ')}: estimated to within {percent(e)}." for name, e in errors.items() if e > LOOSE]
    hang = f" {DOWN}" if any(map(results.hangs, sensors)) else ""
    caption = (
        (f"Brightest line: {whose}. " if len(shown) > 1 else "")
        + f"Over the way of {results.carriage_name}; grey: it has left, and would have come so far."
        + hang
        + "".join(loose)
    )
    height = 0.8 + 1.9 * len(sensors)
    return draw("response", title, caption, height, partial(_draw_response, results, sensors, shown))


def _draw_response(results: Results, sensors: list[str], shown: list[Index], drawing: Drawing) -> None:
    rows = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0]
    for axes, sensor in zip(rows, sensors, strict=True):
        ways = [over_way(results, sensor, index) for index in shown]
        scale = scale_for(max(float(np.abs(way.values).max(initial=0.0)) for way in ways), results.sensors[sensor])
        for index, way, colour in zip(shown, ways, shades(len(shown)), strict=True):
            axes.plot(
                way.position, way.values * scale.factor, color=colour, label=results.at(index).replace(", ", "\n")
            )
        zero_line(axes)
        _shade_left(axes, results, shown[-1], max(float(way.position.max(initial=0.0)) for way in ways))
        if results.hangs(sensor):
            axes.invert_yaxis()
        axes.set_ylabel(results.label(sensor, scale.unit))
        axes.set_title(sensor.replace("_", " "))
    if len(shown) > 1:
        legend_of_all(drawing, rows[0])
    rows[-1].set_xlabel(f"way of {results.carriage_name} (m)")
    drawing.align_ylabels()


def _shade_left(axes: Any, results: Results, index: Index, end: float) -> None:
    """Grey where the first carriage has left its body; at most its way on it beyond where the last one has left too,
    for the slow are soon still."""
    first = results.trace(f"{results.carriage_name}_position", index)
    on = np.flatnonzero(np.isfinite(first.values))
    if on.size < 2 or first.values[on[-1]] <= first.values[on[0]]:
        return
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
