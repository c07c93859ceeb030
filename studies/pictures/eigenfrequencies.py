"""Figures of coupled natural frequencies: over the position, over the sweep, shapes, and how many modes they take."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array
from studies.at_rest.findings import FREQUENCY_WANTED, frequency_errors, moves_no_track
from studies.pictures import at_rest
from studies.pictures.common.figures import HAIR, INK, MUTED, Figure, draw, legend_of_all, shades, widen
from studies.pictures.common.sweep_view import View
from studies.results.formatting import ALIKE, listed, number, ordinal, quantity
from studies.results.results import Results

SWEPT_MODES = 3  # with a panel over the sweep
SHAPES = 4  # modes whose shapes are drawn
GAP = 1.3  # of the largest amplitude, between a body that rides and what it rides


def pictures(results: Results) -> list[Figure]:
    """All figures that the dataset allows."""
    found = [_over_position(results)]
    seen = at_rest.swept(results)
    if seen is not None and not seen.is_sampled:
        found.append(_over_sweep(seen))
    found.append(_shapes(results))
    if "frequency_by_mode_count" in results.dataset:
        error, against = frequency_errors(results)
        counts = [int(count) for count in results.dataset["mode_count"].values]
        modes = results.dataset.sizes["mode"]
        words = f"Largest relative error of the frequencies up to the {ordinal(modes)}, against {against}."
        if np.isnan(error).any():
            words += " Where there is no point, modes are too few to have them all."
        found.append(at_rest.error_figure(results, [at_rest.Errors("", counts, error)], FREQUENCY_WANTED, words))
    return found


def _over_position(results: Results) -> Figure:
    unreduced = "frequency_unreduced" in results.dataset
    caption = "Every line is one of the frequencies in their order, so lines may come close but do not cross." + (
        " Circles are the unreduced finite-element model." if unreduced else ""
    )
    if results.size > 1:
        caption += " Of the scene without its sweep."
    base = results.dataset["base_frequency"]
    title = _changing(np.asarray(base.values, dtype=np.float64))
    if base.sizes["position"] == 1:
        lowest, at = number(float(base[0, 0]), 4), quantity(float(base["position"][0]), "m")
        title = f"The lowest natural frequency is {lowest} Hz with {results.carriage_name} at {at}"
    return draw("frequencies", title, caption, 4.2, partial(_draw_over_position, results))


def _changing(frequencies: Array) -> str:
    """Which of the frequencies (position, mode) changes most along the way."""
    low, high = np.nanmin(frequencies, axis=0), np.nanmax(frequencies, axis=0)
    change = (high - low) / np.where(high > 0.0, high, 1.0)
    mode = int(np.nanargmax(change))
    if change[mode] < ALIKE:
        return "The natural frequencies are the same all along the way"
    ends = f"{number(float(low[mode]), 4)} to {number(float(high[mode]), 4)} Hz"
    return f"Frequency {mode + 1} changes most along the way, between {ends}".replace(" to ", " and ")


def _draw_over_position(results: Results, drawing: Drawing) -> None:
    axes, base = drawing.subplots(), results.dataset["base_frequency"]
    colours = shades(base.sizes["mode"])
    for mode, colour in enumerate(colours):
        axes.plot(base["position"], base.isel(mode=mode), color=colour)
        axes.annotate(
            str(mode + 1),
            (float(base["position"][-1]), float(base.isel(mode=mode)[-1])),
            xytext=(5, 0),
            textcoords="offset points",
            va="center",
            color=colour,
        )
        if "frequency_unreduced" in results.dataset:
            full = results.dataset["frequency_unreduced"].isel(mode=mode)
            axes.plot(full["unreduced_position"], full, "o", markersize=4.5, markerfacecolor="none", color=INK)
    axes.set_ylim(0.0, None)
    axes.set(xlabel=at_rest.position_title(results), ylabel="natural frequency (Hz)")


def _over_sweep(seen: View) -> Figure:
    assert seen.x is not None
    shown = min(SWEPT_MODES, seen.results.dataset.sizes["mode"])
    caption = " ".join(
        text for text in (f"One panel for each of the lowest {shown}.", at_rest.held_words(seen)) if text
    )
    lowest = seen.results.dataset["frequency"].isel(mode=0).values
    ends = [number(float(end), 4) for end in (np.nanmin(lowest), np.nanmax(lowest))]
    title = f"The lowest frequency lies between {ends[0]} and {ends[1]} Hz over position and {seen.x.noun}"
    return draw("sweep", title, caption, 0.7 + 1.9 * shown, partial(_draw_over_sweep, seen, shown))


def _draw_over_sweep(seen: View, shown: int, drawing: Drawing) -> None:
    rows = drawing.subplots(shown, 1, squeeze=False, sharex=True)[:, 0]
    for mode, axes in enumerate(rows):
        curves = at_rest.sweep_curves(seen, seen.results.dataset["frequency"].isel(mode=mode))
        for curve, colour in zip(curves, shades(len(curves)), strict=True):
            axes.plot(curve.x, curve.y, color=colour, label=f"{seen.x.noun if seen.x else ''} {curve.label}")
        widen(axes, [curve.y for curve in curves])
        axes.set_ylabel(f"frequency {mode + 1} (Hz)")
    rows[-1].set_xlabel(at_rest.position_title(seen.results))
    legend_of_all(drawing, rows[0])


def _shapes(results: Results) -> Figure:
    count, carriages = min(SHAPES, results.dataset.sizes["mode"]), results.study.carriage.values()
    several = results.dataset.sizes["position"] > 1
    where = "at the beginning, in the middle and at the end of its way" if several else "where it stands"
    caption = (
        f"The lowest {count} shapes with the carriage {where}, each "
        "scaled to its own largest motion along the loads, which alone is drawn: what sways beside them does not show. "
        "Grey: at rest."
        + (" What rides is drawn above what it rides." if any(c.riding_body for c in carriages) else "")
    )
    height = 0.4 + 1.35 * count
    base = results.dataset["base_frequency"]
    at = quantity(float(base["position"][0]), "m")
    told = listed([number(float(value), 4) for value in base.values[0, :count]])
    title = f"With {results.carriage_name} at {at} the system vibrates at {told} Hz"
    return draw("shapes", title, caption, height, partial(_draw_shapes, results, count))


def _draw_shapes(results: Results, count: int, drawing: Drawing) -> None:
    base, shape = results.dataset["base_frequency"], results.dataset["mode_shape"]
    size = base.sizes["position"]
    columns = sorted({0, size // 2, size - 1})
    grid = drawing.subplots(count, len(columns), squeeze=False, sharex=True, sharey=True)
    bodies, still = at_rest.places(results), moves_no_track(results)
    riding = {carriage.riding_body for carriage in results.study.carriage.values()}
    for mode in range(count):
        for column, place in enumerate(columns):
            axes, position = grid[mode, column], float(base["position"][place])
            lines = np.asarray(shape.isel(position=place, mode=mode).values)
            scale = 0.0 if still[place, mode] else 1.0 / float(np.nanmax(np.abs(lines)))
            for body, line, colour in zip(bodies, lines, shades(len(bodies)), strict=True):
                x, level = body.at(position), -GAP if body.name in riding else 0.0
                axes.plot(x, np.full_like(x, level), color=HAIR, linewidth=1.0, zorder=1.5)
                axes.plot(x, level + scale * line, color=colour, label=body.name)
                if body.name == results.carriage.on:
                    at_rest.carriage_marks(axes, results, position, scale * float(np.interp(position, x, line)))
            across = "" if scale else ", across the loads"
            axes.set_title(f"{number(float(base[place, mode]), 4)} Hz{across}", color=MUTED, fontsize=8.0, pad=2.0)
            axes.set_yticks([])
            axes.grid(visible=False)
            if mode == 0:
                axes.annotate(
                    f"{results.carriage_name} at {quantity(position, 'm')}",
                    (0.0, 1.0),
                    xytext=(0, 14),
                    xycoords="axes fraction",
                    textcoords="offset points",
                )
        grid[mode, 0].set_ylabel(f"mode {mode + 1}")
    grid[0, 0].invert_yaxis()
    for axes in grid[-1]:
        axes.set_xlabel(at_rest.way_title(results))
    if len(bodies) > 1:
        legend_of_all(drawing, grid[0, 0])
