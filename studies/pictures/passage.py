"""Figures of a passage: amplification, contact force with the line of separation, the response on the way."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

from results_schema.arrays import Array
from studies.findings.theory import body_mass
from studies.pictures.common.figures import VERMILION, Figure, colour_bar, draw, legend_of_all, shades, zero_line
from studies.pictures.common.sweep_view import (
    DAMPING,
    MASSES,
    SPEEDS,
    View,
    along_axis,
    along_x,
    along_y,
    draw_curves,
    draw_map,
    view,
)
from studies.pictures.common.traces import over_position, picked
from studies.results.formatting import scale_for
from studies.results.results import Index, Results, chosen, extreme

MOST_SENSORS = 3
MANY = 6  # values of the second axis from which on a map says more than curves


def pictures(results: Results) -> list[Figure]:
    """All figures that the sweep and the kept histories allow."""
    sensors = list(chosen(list(results.sensors), MOST_SENSORS))
    found = []
    seen = view(results, SPEEDS, (*MASSES, *DAMPING))
    if seen.x is not None:
        found.append(_amplification(seen, sensors))
        if seen.y is not None and len(seen.y.values) > MANY and _amplified(results, sensors[0]):
            found.append(_map(seen, sensors[0]))
        found += [_contact(seen, name) for name in results.study.carriage if _has_contact(results, name)]
    shown = picked(results, _rank(results, sensors), 4)
    return [*found, *([_response(results, sensors, shown)] if shown else [])]


def _rank(results: Results, sensors: list[str]) -> Array | None:
    """Amplification of the first sensor that has one, of the variants whose contact holds where there are such."""
    for sensor in sensors:
        if _amplified(results, sensor):
            gain = np.asarray(results.of_sensor("dynamic_amplification", sensor).values, dtype=np.float64)
            held = np.where(results.held, gain, np.nan)
            return held if np.isfinite(held).any() else gain
    return None


def _amplified(results: Results, sensor: str) -> bool:
    return extreme(results.of_sensor("dynamic_amplification", sensor)) is not None


def _has_contact(results: Results, carriage: str) -> bool:
    name = f"{carriage}_contact_force_min"
    inertial = results.study.carriage[carriage].inertial
    return inertial and name in results.dataset and extreme(results.dataset[name]) is not None


def _ratio(seen: View) -> tuple[Any, str]:
    return along_x(seen, seen.results.dataset.coords.get("speed_ratio"), "speed ratio v/(ω₁ L/π)")


def _amplification(seen: View, sensors: list[str]) -> Figure:
    caption = seen.caption("Largest absolute value over the largest absolute static value of the same model.")
    height = 0.6 + 2.2 * len(sensors)
    return draw("amplification", "Dynamic amplification", caption, height, partial(_draw_amplification, seen, sensors))


def _draw_amplification(seen: View, sensors: list[str], drawing: Drawing) -> None:
    rows = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0]
    way, title = _ratio(seen)
    for axes, sensor in zip(rows, sensors, strict=True):
        name = "dynamic_amplification" if _amplified(seen.results, sensor) else f"{sensor}_max"
        values = seen.results.dataset[name]
        curves = seen.curves(values.sel(sensor=sensor) if "sensor" in values.dims else values, way)
        draw_curves(axes, seen, curves)
        axes.set_ylabel(f"{sensor}, max/static" if name == "dynamic_amplification" else f"{sensor}, max")
        if axes is not rows[0] and axes.get_legend() is not None:
            axes.get_legend().remove()
    along_axis(rows[-1], seen, title, curves[0].x)


def _map(seen: View, sensor: str) -> Figure:
    caption = seen.caption("Dynamic amplification over the plane of both.")
    title = f"Where it is amplified: {sensor}"
    return draw("amplification-map", title, caption, 3.2, partial(_draw_map, seen, sensor))


def _draw_map(seen: View, sensor: str, drawing: Drawing) -> None:
    axes = drawing.subplots()
    ways, titles = zip(_ratio(seen), along_y(seen), strict=True)
    mesh = draw_map(axes, seen, seen.results.of_sensor("dynamic_amplification", sensor), ways, cmap="viridis")
    axes.set(xlabel=titles[0], ylabel=titles[1])
    colour_bar(axes, mesh, f"{sensor}, max/static")


def _contact(seen: View, carriage: str) -> Figure:
    line = "; the line is where that begins" if _has_line(seen, _relative_force(seen, carriage)) else ""
    caption = seen.caption(
        "Smallest contact force on 0-98 % of the span over the weight.",
        "Below zero the carriage would lift off."
        if seen.y is None
        else f"Where it is negative the carriage would lift off{line}.",
    )
    title = f"Contact force: {carriage}"
    height = 3.2 if seen.y is not None else 2.6
    return draw(f"contact-{carriage}", title, caption, height, partial(_draw_contact, seen, carriage))


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
        way, title = _ratio(seen)
        draw_curves(axes, seen, seen.curves(force, way))
        zero_line(axes)
        along_axis(axes, seen, title)
        axes.set_ylabel("smallest contact force / weight")
        return
    ways, titles = zip(_ratio(seen), along_y(seen), strict=True)
    mesh = draw_map(axes, seen, force, ways, cmap="PuOr", vmin=-1.0, vmax=1.0)
    axes.set(xlabel=titles[0], ylabel=titles[1])
    colour_bar(axes, mesh, "smallest contact force / weight", extend="both")
    if not _has_line(seen, force):
        return
    x, y = (seen.along(axis, way) for axis, way in zip((seen.x, seen.y), ways, strict=True) if axis is not None)
    axes.contour(x, y, seen.plane(force).T, [0.0], colors=VERMILION, linewidths=1.8)
    line = Line2D([], [], color=VERMILION, linewidth=1.8)
    axes.legend([line], ["contact opens"], loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.1)


def _response(results: Results, sensors: list[str], shown: list[Index]) -> Figure:
    caption = (
        "Kept histories over the position of the carriage, up to the one with the largest amplification while the "
        "contact holds. Displacements point down, as the body hangs."
    )
    height = 0.8 + 2.0 * len(sensors)
    return draw("response", "Response on the way", caption, height, partial(_draw_response, results, sensors, shown))


def _draw_response(results: Results, sensors: list[str], shown: list[Index], drawing: Drawing) -> None:
    rows = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0]
    for axes, sensor in zip(rows, sensors, strict=True):
        ways = [over_position(results, sensor, index) for index in shown]
        scale = scale_for(max(float(np.abs(way.values).max(initial=0.0)) for way in ways), results.sensors[sensor])
        factors, label = [scale.factor] * len(shown), f"{sensor} ({scale.unit})" if scale.unit else sensor
        if _amplified(results, sensor) and len(shown) > 1:
            factors, label = [1.0 / _static(results, sensor, index) for index in shown], f"{sensor} / static"
        for index, way, factor, colour in zip(shown, ways, factors, shades(len(shown)), strict=True):
            axes.plot(way.position, way.values * factor, color=colour, label=results.at(index).replace(", ", "\n"))
        zero_line(axes)
        if results.sensors[sensor] == "m":
            axes.invert_yaxis()
        axes.set_ylabel(label)
    if len(shown) > 1:
        legend_of_all(drawing, rows[0])
    rows[-1].set_xlabel(f"position of {results.carriage_name} (m)")


def _static(results: Results, sensor: str, index: Index) -> float:
    """Largest absolute static value of one variant, from its amplification."""
    largest = max(abs(float(results.dataset[f"{sensor}_{side}"].values[index])) for side in ("max", "min"))
    return largest / float(np.asarray(results.of_sensor("dynamic_amplification", sensor).values)[index])
