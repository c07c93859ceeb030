"""Figures of a double peak: the cycle, the map of peaks with its resonances, amplification, harmonics."""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from studies.findings import theory
from studies.findings.two_peaks import first_break
from studies.pictures.common import figures as look
from studies.pictures.common.figures import Figure, colour_bar, draw, legend_beside, logarithmic, shades
from studies.pictures.common.sweep_view import (
    MASSES,
    SPEEDS,
    View,
    alone,
    along_axis,
    draw_curves,
    draw_map,
    one_legend,
    per_shown,
    ratio_above,
    view,
)
from studies.pictures.common.traces import picked
from studies.results.findings_common import while_held
from studies.results.formatting import counted, listed, number, scale_for
from studies.results.places import Index, chosen, extreme
from studies.results.results import Results

MOST_SENSORS = 3
MOST_CYCLES = 3
ALIKE = 1e-3  # odd over even harmonics below which there is nothing to show
LITTLE = 0.1  # of what an axis changes: another that changes less has no curves
LEAST_RATIO = 1e-6  # below, ratios are rounding
RATIOS = {  # file name, title, words on the axis and caption of the figure of each
    "dynamic_amplification": (
        "amplification",
        "The dynamic {what} is up to {value} times the static one",
        "dynamic amplification",
        "Largest absolute value in the last cycle over the largest absolute static value.",
    ),
    "odd_even_ratio": (
        "odd-even",
        "Odd harmonics of the {what} are up to {value} times the even ones",
        "odd over even harmonics",
        "Rms of the odd over rms of the even harmonics of the last cycle: 0 where its two halves are alike.",
    ),
}
PEAK_BANDS = (0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5)
PEAK_COLOURS = ("#56b4e9", "#eef0f3", "#e69f00", "#0072b2", "#cc79a7", "#d55e00")


def pictures(results: Results) -> list[Figure]:
    """All figures that the sweep and the kept histories allow."""
    sensors = list(chosen(list(results.sensors), MOST_SENSORS))
    top = extreme(results.counting("dynamic_amplification", sensors[0]))
    shown = _typical(results, sensors[0])
    found = [_cycle(results, sensors, shown)] if shown else []
    seen = view(results, SPEEDS, MASSES, top)
    if seen.x is not None:
        for sensor in sensors:
            axis = results.deciding_axis("peaks_per_cycle", sensor)
            own = view(results, SPEEDS, axis.paths, top) if axis is not None else seen
            if np.unique(_counts(own, sensor)).size > 1:
                found.append(_map(own, sensor) if _is_map(own, sensor) else _count(own, sensor))
        found += _ratio(seen, "dynamic_amplification", sensors)
        if float(np.nanmax(results.dataset["odd_even_ratio"].values, initial=0.0)) > ALIKE:
            found += _ratio(_odd_view(results, sensors), "odd_even_ratio", sensors)
    return [*found, *([_harmonics(results, sensors[0], shown)] if shown else [])]


def _odd_view(results: Results, sensors: list[str]) -> View:
    """The sweep where odd harmonics are largest over even ones, along what changes this ratio most."""
    ratios = {sensor: _counting(results, "odd_even_ratio", sensor) for sensor in sensors}
    best = max(sensors, key=lambda sensor: float(np.nan_to_num(ratios[sensor].values).max()))
    top, axis = extreme(ratios[best]), results.deciding_axis("odd_even_ratio", best)
    seen = view(results, SPEEDS, MASSES, top)
    if axis is None or seen.x is None or seen.is_sampled:
        return seen
    other = view(results, axis.paths, SPEEDS, top)
    assert other.x is not None
    most = other.most_along(other.x, ratios[best])
    if most < seen.most_along(seen.x, ratios[best]):
        return seen
    return alone(other) if other.y is not None and other.most_along(other.y, ratios[best]) < LITTLE * most else other


def _is_map(seen: View, sensor: str) -> bool:
    """Whether numbers of peaks change along both axes of a view: a map of stripes is steps along one."""
    counts = seen.results.of_sensor("peaks_per_cycle", sensor)
    if seen.is_sampled:
        return seen.y is not None
    return seen.y is not None and all(seen.most_along(axis, counts) > 0.0 for axis in (seen.x, seen.y) if axis)


def _counts(seen: View, sensor: str) -> Array:
    """The numbers of peaks that occur in a view, as often as they do."""
    counts = seen.plane(seen.results.of_sensor("peaks_per_cycle", sensor))
    return counts[np.isfinite(counts)]


def _peaks_title(seen: View, sensor: str) -> str:
    """Up to where the most frequent number of peaks holds, and what follows."""
    assert seen.x is not None
    counts, grid = _counts(seen, sensor), seen.plane(seen.results.of_sensor("peaks_per_cycle", sensor))
    usual, name = int(Counter(counts.tolist()).most_common(1)[0][0]), sensor.replace("_", " ")
    if (first := set(np.atleast_1d(grid[0])[np.isfinite(np.atleast_1d(grid[0]))].tolist())) and len(first) == 1:
        usual = int(*first)
    broken = (np.isfinite(grid) & (grid != usual)).reshape(len(grid), -1).any(axis=1)
    fine = np.flatnonzero(np.cumsum(broken) == 0)
    if seen.is_sampled or not fine.size:
        return f"{name} has {counts.min():.0f} to {counts.max():.0f} peaks per cycle, most often {usual}"
    until = seen.x.in_words(float(seen.along(seen.x)[fine[-1]]) / seen.x.factor)
    others = listed([f"{count:.0f}" for count in np.unique(counts) if count != usual])
    also = "also " if (grid[fine[-1] + 1 :] == usual).any() else ""
    return f"{name} has {counted(usual, 'peak')} per cycle up to {until}; beyond, {also}{others}"


def _typical(results: Results, sensor: str) -> list[Index]:
    """At most three variants with a history: where two peaks end, the one with the largest amplification, one of each
    number of peaks, and others; from slow to fast."""
    ratio = results.everywhere(theory.frequency_ratio(results))
    counts = results.numbers("peaks_per_cycle", sensor)
    traced = sorted(results.traced(), key=lambda index: float(ratio[index]))
    groups: dict[float, list[Index]] = {}
    for index in traced:
        groups.setdefault(float(counts[index]), []).append(index)
    largest = sorted(groups.values(), key=len, reverse=True)
    found = [group[len(group) // 2] for group in largest[:MOST_CYCLES]]
    gain = results.counting("dynamic_amplification", sensor)
    broken = first_break(results, sensor)
    named = [index for index in traced if index == broken]
    found = list(dict.fromkeys([*named, *picked(results, gain, results.size)[-1:], *found]))[:MOST_CYCLES]
    rest = [index for index in picked(results, ratio, MOST_CYCLES) if index not in found]
    return sorted([*found, *rest[: MOST_CYCLES - len(found)]], key=lambda index: float(ratio[index]))


def _cycle(results: Results, sensors: list[str], shown: list[Index]) -> Figure:
    caption = (
        "The last cycle of kept histories, from slow to fast; dots: the peaks that count (prominence above 2 % of the "
        "cycle's range)."
    )
    if results.carriage.motion.is_harmonic:
        caption += " The carriage is at the centre at phase 0 and 0.5, at its ends at the grey lines."
    height = 0.7 + 1.9 * len(sensors)
    counts = [float(results.of_sensor("peaks_per_cycle", sensors[0]).values[index]) for index in shown]
    told = [f"{count:.0f}" for count in counts if np.isfinite(count)]
    each = listed(told if len(set(told)) > 1 else told[:1]) or "no"
    peaks = "peak" if each == "1" else "peaks"
    title = f"{sensors[0].replace('_', ' ')} has {each} {peaks} per cycle{', from slow to fast' * (len(set(told)) > 1)}"
    return draw("cycle", title, caption, height, partial(_draw_cycle, results, sensors, shown))


def _draw_cycle(results: Results, sensors: list[str], shown: list[Index], drawing: Drawing) -> None:
    grid = drawing.subplots(len(sensors), len(shown), squeeze=False, sharex=True)
    for row, sensor in zip(grid, sensors, strict=True):
        for axes, index in zip(row, shown, strict=True):
            _draw_one_cycle(axes, results, sensor, index)
        row[0].set_ylabel(results.label(sensor, row[0].get_ylabel()))
    for axes, index in zip(grid[0], shown, strict=True):
        axes.set_title(results.at(index).replace(", ", "\n") or " ")
    for axes in grid[-1]:
        axes.set_xlabel("phase of the cycle")
        axes.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0], ["0", "0.25", "0.5", "0.75", "1"])


def _draw_one_cycle(axes: Axes, results: Results, sensor: str, index: Index) -> None:
    trace = results.trace(sensor, index)
    kept = np.isfinite(trace.values)
    values = np.append(trace.values[kept], trace.values[kept][:1])
    scale = scale_for(float(np.abs(values).max()), results.sensors[sensor])
    axes.plot(np.linspace(0.0, 1.0, len(values)), values * scale.factor, color=look.BLUE)
    place = dict(zip(results.dims, index, strict=True))
    phase, peak = (results.of_sensor(name, sensor).isel(place).values for name in ("peak_phase", "peak_value"))
    axes.plot(phase, peak * scale.factor, "o", color=look.VERMILION, zorder=3)
    if results.carriage.motion.is_harmonic:
        for end in (0.25, 0.75):
            axes.axvline(end, color=look.MUTED, linewidth=0.7, zorder=1)
    axes.set_xlim(0.0, 1.0)
    if results.hangs(sensor):
        axes.invert_yaxis()
    axes.set_ylabel(scale.unit)


def _ratios(seen: View) -> tuple[float | None, float | None]:
    """Frequency ratio per unit of the horizontal axis and mass ratio per unit of the vertical one, where they follow
    from these axes alone."""
    mass = seen.results.dataset.coords.get("mass_ratio")
    return per_shown(seen, seen.x, theory.frequency_ratio(seen.results)), per_shown(seen, seen.y, mass)


def _frequency_ratio(axes: Axes, seen: View) -> None:
    ratio_above(axes, seen, theory.frequency_ratio(seen.results), "frequency ratio Ω/ω₁")


def _map(seen: View, sensor: str) -> Figure:
    ways = _ratios(seen)
    lines = ways[0] is not None and _held_mass(seen, ways[1]) is not None
    caption = seen.caption(
        "Number of peaks in the last cycle.",
        "Lines: where a harmonic of the cycle meets the natural frequency of the loaded body, n Ω = ωₑ; near them "
        "the pattern of two peaks breaks."
        if lines
        else "",
    )
    return draw(f"peaks-{sensor}", _peaks_title(seen, sensor), caption, 3.4, partial(_draw_map, seen, sensor, ways))


def _draw_map(seen: View, sensor: str, ways: tuple[Any, Any], drawing: Drawing) -> None:
    assert seen.x is not None and seen.y is not None
    axes = drawing.subplots()
    colours, norm = ListedColormap(PEAK_COLOURS), BoundaryNorm(PEAK_BANDS, len(PEAK_COLOURS))
    counts = seen.results.of_sensor("peaks_per_cycle", sensor).clip(1.0, float(len(PEAK_COLOURS)))
    mesh = draw_map(axes, seen, counts, cmap=colours, norm=norm)
    bar = colour_bar(axes, mesh, "peaks per cycle", ticks=range(1, len(PEAK_COLOURS) + 1))
    bar.ax.set_yticklabels(["0-1", "2", "3", "4", "5", "6 +"])
    if ways[0] is not None:
        _draw_resonances(axes, seen, *ways)
    else:
        _frequency_ratio(axes, seen)


def _draw_resonances(axes: Axes, seen: View, frequency: float, mass: float | None) -> None:
    """Lines n Ω = ωₑ over the mass; upright where the mass is not on the vertical axis. frequency, mass: ratios per
    unit of the axes."""
    results, held = seen.results, _held_mass(seen, mass)
    left, right = axes.get_xlim()
    low, high = axes.get_ylim()
    if held is None:
        return
    along = np.linspace(max(low, 0.0), high, 100) if mass is not None else np.array([low, high])
    own = along * mass if mass is not None else np.full(2, held)
    for order in theory.ORDERS:
        ratio = theory.breakdown(results, own, order) / frequency
        if ratio.max() < left or ratio.min() > right:
            continue
        axes.plot(ratio, along, color="white", linewidth=2.6, alpha=0.8)
        axes.plot(ratio, along, color=look.INK, linewidth=1.1)
        if left < ratio[-1] < right:
            above: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "bottom"}
            axes.annotate(f"{order} Ω", (ratio[-1], along[-1]), (0, 2), **above)
    axes.set(xlim=(left, right), ylim=(low, high))


def _held_mass(seen: View, mass: float | None) -> float | None:
    """The one mass ratio of a view (any number where it stands on an axis); None where there is none."""
    if mass is not None:
        return 0.0
    found = seen.results.dataset.coords.get("mass_ratio")
    held = np.unique(seen.cut(found).values) if found is not None else np.zeros(0)
    return float(held[0]) if held.size == 1 else None


def _count(seen: View, sensor: str) -> Figure:
    """Steps along the one axis that changes the number of peaks."""
    counts = seen.results.of_sensor("peaks_per_cycle", sensor)
    shown, alike = seen, ""
    if seen.y is not None and not seen.is_sampled:
        striped = [axis for axis in (seen.x, seen.y) if axis is not None]
        flat, along = sorted(striped, key=lambda axis: seen.most_along(axis, counts))
        alike = f"The same for {flat.noun} {flat.span}."
        shown = View(seen.results, along, None, {**seen.held, flat.dim: 0})
    lines = "; lines: where a harmonic meets the natural frequency, n Ω = ωₑ" if _ratios(shown)[0] is not None else ""
    caption = seen.caption(f"Number of peaks in the last cycle{lines}.", alike)
    return draw(f"peaks-{sensor}", _peaks_title(shown, sensor), caption, 2.4, partial(_draw_count, shown, sensor))


def _draw_count(seen: View, sensor: str, drawing: Drawing) -> None:
    axes = drawing.subplots()
    (curve,) = seen.curves(seen.results.of_sensor("peaks_per_cycle", sensor))
    order = np.argsort(curve.x)
    axes.plot(curve.x[order], curve.y[order], "o-", color=look.BLUE, drawstyle="steps-mid", markersize=3)
    axes.set_ylim(0.0, max(5.0, float(np.nanmax(curve.y, initial=0.0)) + 1.0))
    along_axis(axes, seen)
    axes.set_ylabel("peaks per cycle")
    if (frequency := _ratios(seen)[0]) is not None:
        _draw_resonances(axes, seen, frequency, None)


def _ratio(seen: View, variable: str, sensors: list[str]) -> list[Figure]:
    """A ratio over the sweep; without a static response there is no amplification."""
    tops = {}
    for sensor in sensors:
        plane = seen.plane(seen.results.of_sensor(variable, sensor))
        if np.isfinite(plane).any():
            held = seen.plane(_counting(seen.results, variable, sensor))
            tops[sensor] = float(np.nanmax(held if np.isfinite(held).any() else plane))
    if not tops:
        return []
    name, title, _, caption = RATIOS[variable]
    best = max(tops, key=lambda sensor: tops[sensor])
    what = f"{seen.results.noun(best)} {seen.results.place(best)}"
    top = title.format(value=number(tops[best]), what=what)
    height, fill = 0.6 + 2.2 * len(tops), partial(_draw_rows, seen, list(tops), variable)
    opened = "While the contact holds the title counts; lines go on beyond." if while_held(seen.results) else ""
    return [draw(name, top, seen.caption(caption, opened), height, fill)]


def _counting(results: Results, variable: str, sensor: str) -> xr.DataArray:
    """A result over the sweep, NaN where a variant does not speak for all."""
    return results.of_sensor(variable, sensor).copy(data=results.counting(variable, sensor))


def _draw_rows(seen: View, sensors: list[str], variable: str, drawing: Drawing) -> None:
    rows = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0]
    words = RATIOS[variable][2]
    for axes, sensor in zip(rows, sensors, strict=True):
        curves = seen.curves(seen.results.of_sensor(variable, sensor))
        draw_curves(axes, seen, curves)
        values = np.concatenate([curve.y[curve.y > LEAST_RATIO] for curve in curves])
        if values.size and values.max() > 30.0 * values.min():
            logarithmic(axes.yaxis)
            axes.set_ylim(bottom=0.5 * float(values.min()))
        axes.set_title(sensor.replace("_", " "))
        axes.set_ylabel(f"{words}\n{seen.results.place(sensor)}")
    one_legend(list(rows))
    along_axis(rows[-1], seen)
    _frequency_ratio(rows[0], seen)


def _harmonics(results: Results, sensor: str, shown: list[Index]) -> Figure:
    name = sensor.replace("_", " ")
    caption = f"Amplitudes 2|c_k| of the last cycle of {name}, in the variants of the first figure."
    stored = results.of_sensor("harmonic", sensor).transpose(*results.dims, ...).values
    strongest = [str(int(np.argmax(np.nan_to_num(stored[index])[1:])) + 1) for index in shown]
    title = f"Harmonic {strongest[0]} of the cycle is the largest in {name}"
    if len(set(strongest)) > 1:
        title = f"The largest harmonics of the cycle in {name} are {listed(strongest)}, from slow to fast"
    return draw("harmonics", title, caption, 2.4, partial(_draw_harmonics, results, sensor, shown))


def _draw_harmonics(results: Results, sensor: str, shown: list[Index], drawing: Drawing) -> None:
    axes = drawing.subplots()
    stored = results.of_sensor("harmonic", sensor)
    order = results.dataset["harmonic_number"].values[1:]
    rows = [stored.isel(dict(zip(results.dims, index, strict=True))).values[1:] for index in shown]
    scale = scale_for(float(np.nanmax(rows)), results.sensors[sensor])
    width = 0.8 / len(shown)
    for i, (index, row, colour) in enumerate(zip(shown, rows, shades(len(shown)), strict=True)):
        places = order + (i - 0.5 * (len(shown) - 1)) * width
        axes.bar(places, row * scale.factor, width, color=colour, label=results.at(index).replace(", ", "\n"))
    axes.set_xticks(order)
    axes.grid(visible=False, axis="x")
    axes.set(xlabel="harmonic k", ylabel=results.label(sensor, scale.unit, "amplitude of"))
    if np.nanmax(rows) > 0.0:
        logarithmic(axes.yaxis)
        axes.set_ylim(bottom=1e-4 * float(np.nanmax(rows)) * scale.factor)
    if results.at(shown[0]):
        legend_beside(axes)
    axes.axhline(0.0, color=look.HAIR)
