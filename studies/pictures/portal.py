"""Figures of robots on rails: cycle time against accuracy, places and errors of their tools, the rails bent."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array
from studies.pictures.common.figures import (
    DISTINCT,
    MUTED,
    SEQUENTIAL,
    VERMILION,
    Figure,
    colour_bar,
    draw,
    legend_of_all,
)
from studies.results.formatting import quantity, scale_for
from studies.results.results import Index, Results
from studies.robots.findings import accuracy, of_front

MOST_ROBOTS, MOST_SHAPES, MOST_NAMES = 6, 4, 3
SIZE = 0.25  # of the gauge between rails: how large the largest deflection is drawn


def pictures(results: Results) -> list[Figure]:
    """The front of a sweep, one variant over time, its rails where errors are longest."""
    found = [_front_of(results)] if results.size > 1 and of_front(results).size else []
    traced = results.traced()
    if not traced:
        return found
    chosen = of_front(results)
    best = results.index_of(int(chosen[0])) if chosen.size else traced[0]
    shown = best if best in traced else traced[0]
    return [*found, _strip(results, shown), _shapes(results, shown)]


def _front_of(results: Results) -> Figure:
    words, error = accuracy(results)
    chosen, cycle = of_front(results), results.dataset["cycle_time"].values.reshape(-1)
    ends = [quantity(float(cycle[number]), "s", 3) for number in (chosen[0], chosen[-1])]
    off = [quantity(float(error.reshape(-1)[number]), "m") for number in (chosen[0], chosen[-1])]
    title = f"The fastest cycle takes {ends[0]}, with tools {off[0]} off from rest {words}"
    if chosen.size > 1:
        title += f"; {ends[1]} bring that to {off[1]}"
    caption = (
        f"Every point is a variant: the time at which all robots are done, and what any tool is off {words} "
        "from where it would rest. No variant beats those on the line in both."
    )
    return draw("front", title, caption, 3.6, partial(_draw_front, results, words, error.reshape(-1), cycle))


def _draw_front(results: Results, words: str, error: Array, cycle: Array, drawing: Drawing) -> None:
    axes, chosen = drawing.subplots(), of_front(results)
    scale = scale_for(float(np.nanmax(error)), "m")
    axis = max(results.axes, key=lambda one: len(one.values))
    along = axis.shown.reshape([-1 if dim == axis.dim else 1 for dim in results.dims])
    swept = np.broadcast_to(along, results.shape).reshape(-1)
    points = axes.scatter(cycle, error * scale.factor, c=swept, cmap=SEQUENTIAL, s=16, linewidths=0)
    colour_bar(axes, points, axis.title)
    axes.plot(cycle[chosen], error[chosen] * scale.factor, color=VERMILION, linewidth=1.2, label="best")
    for number in chosen[np.unique(np.linspace(0, chosen.size - 1, MOST_NAMES).round().astype(int))]:
        at = results.at(results.index_of(int(number))).replace(", ", "\n")
        place = (cycle[number], error[number] * scale.factor)
        axes.annotate(at, place, xytext=(6, 6), textcoords="offset points", color=MUTED, fontsize=7)
    axes.set_xlabel("cycle time (s)")
    axes.set_ylabel(f"off from rest {words} ({scale.unit})")
    axes.set_ylim(bottom=0.0)


def _strip(results: Results, index: Index) -> Figure:
    largest = results.dataset["error_moving"].values[index]
    worst = int(np.nanargmax(np.nan_to_num(largest, nan=-1.0)))
    name = list(results.study.robot)[worst]
    title = f"The tool of {name} is off by up to {quantity(float(largest[worst]), 'm')} while it moves"
    at = results.at(index)
    caption = f"{f'At {at}. ' if at else ''}Above the planned places of the tools, below how far they are off."
    return draw("over time", title, caption, 5.4, partial(_draw_strip, results, index))


def _draw_strip(results: Results, index: Index, drawing: Drawing) -> None:
    dataset = results.dataset
    times = results.row(dataset["elapsed"], index)
    planned, error = (results.row(dataset[name], index) for name in ("tool_centre_point", "tool_centre_point_error"))
    size = np.linalg.norm(error, axis=2)
    scale = scale_for(float(np.nanmax(size)), "m")
    rows = drawing.subplots(4, 1, sharex=True)
    for r, name in enumerate(list(results.study.robot)[:MOST_ROBOTS]):
        colour = DISTINCT[r % len(DISTINCT)]
        for axis, label in enumerate(("x", "y", "z")):
            rows[axis].plot(times, planned[:, r, axis], color=colour, linewidth=1.0, label=name)
            rows[axis].set_ylabel(f"planned {label}\n(m)")
        rows[3].plot(times, size[:, r] * scale.factor, color=colour, linewidth=0.9)
    rows[3].set_ylabel(f"error\n({scale.unit})")
    rows[3].set_xlabel("time (s)")
    drawing.align_ylabels()
    legend_of_all(drawing, rows[0])


def _marked(results: Results, index: Index) -> Array:
    """Times of the longest errors of the robots, each once, in order."""
    times = np.sort(results.dataset["error_largest_time"].values[index])
    times = times[np.isfinite(times)]
    apart = np.diff(times, prepend=-np.inf) > 0.01 * max(float(times.max(initial=0.0)), 1e-9)
    return np.asarray(times[apart][:MOST_SHAPES])


def _shapes(results: Results, index: Index) -> Figure:
    marked = _marked(results, index)
    rails = results.dataset["rail"].values
    down = results.row(results.dataset["rail_deflection"], index)
    gap = 1.0
    factor = SIZE * gap / max(float(np.nanmax(np.abs(down))), 1e-12)
    words = quantity(float(np.nanmax(np.abs(down))), "m")
    title = f"The rails bend by up to {words} where errors are longest"
    caption = (
        f"The {len(rails)} rails one above another, as they bend at the times of the longest errors; the largest "
        f"deflection of the run is drawn as a quarter of the distance between two."
    )
    return draw("rails", title, caption, 1.0 + 1.5 * marked.size, partial(_draw_shapes, results, index, marked, factor))


def _draw_shapes(results: Results, index: Index, marked: Array, factor: float, drawing: Drawing) -> None:
    dataset = results.dataset
    times, down = results.row(dataset["elapsed"], index), results.row(dataset["rail_deflection"], index)
    planned = results.row(dataset["tool_centre_point"], index)
    scale = scale_for(float(np.nanmax(np.abs(down))), "m")
    largest = float(np.nanmax(np.abs(down))) * scale.factor
    for axes, time in zip(drawing.subplots(marked.size, 1, squeeze=False, sharex=True)[:, 0], marked, strict=True):
        station = int(np.nanargmin(np.abs(times - time)))
        for b, name in enumerate(dataset["rail"].values):
            x, bent = dataset["rail_place"].values[b], down[station, b]
            known = np.isfinite(x) & np.isfinite(bent)
            points = np.stack([x[known], -b - factor * bent[known]], axis=1)
            axes.axhline(-b, color=MUTED, linewidth=0.4)
            lines = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)), cmap=SEQUENTIAL, linewidths=2.2)
            lines.set_array(np.abs(bent[known][:-1]) * scale.factor)
            lines.set_clim(0.0, largest)
            axes.add_collection(lines)
            axes.text(x[known][-1], -b, f"  {name}", va="center", color=MUTED)
        for r, name in enumerate(results.study.robot):
            axes.text(planned[station, r, 0], 0.35, name, ha="center", fontsize=7, color=DISTINCT[r % len(DISTINCT)])
        axes.set_ylim(-len(dataset["rail"]) + 0.4, 0.7)
        axes.set_yticks([])
        axes.set_title(f"{time:.3g} s")
        colour_bar(axes, lines, f"({scale.unit})")
    axes.set_xlabel("along the rails (m)")
