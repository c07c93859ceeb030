"""Figures of robots on rails: cycle time against accuracy, errors of tools over what is swept and over time, the rails
bent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
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
    legend_beside,
    legend_of_all,
    limit_line,
    logarithmic,
    zero_line,
)
from studies.pictures.common.sweep_view import View, along_axis
from studies.pictures.moving_shapes import played
from studies.results.formatting import listed, percent, quantity, scale_for
from studies.results.places import Index, extreme
from studies.results.results import Results
from studies.robots.findings import accuracy, of_front
from studies.robots.limits import Limit, limits, longest_axis, words_of
from studies.robots.tolerance_missed import model_of

MOST_ROBOTS, MOST_SHAPES, MOST_NAMES, MOST_FRAMES, MOST_MARKED = 6, 4, 3, 40, 12
SIZE = 0.4  # of the distance between rails as drawn: how large the largest deflection is drawn at most
ROWS_APART = 0.07  # of the longest rail, between two as drawn
COMPONENTS, UP = ("x", "y", "z"), 2
UNSEEN = 1e-4  # of the largest error: components of it that are no panel
ALIKE = 0.01  # of the longest: times that are one


def pictures(results: Results) -> list[Figure]:
    """The front of a sweep and errors along it, one variant over time, its rails where errors are longest and in its
    worst move."""
    found = [_front_of(results)] if results.size > 1 and of_front(results).size else []
    found += [*_along_sweep(results), *_by_modes(results)]
    traced = results.traced()
    if not traced:
        return found
    chosen = of_front(results)
    best = results.index_of(int(chosen[0])) if chosen.size else traced[0]
    shown = best if best in traced else traced[0]
    worst = _worst_move(results, shown)
    return [*found, _strip(results, shown), _shapes(results, shown), *([worst] if worst else [])]


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


def _along_sweep(results: Results) -> list[Figure]:
    """What tools are off their plan over the swept number with the most values, with limits; [] without a sweep."""
    axis, limited = longest_axis(results), {limit.name: limit for limit in limits(results)}
    works = np.isfinite(results.dataset["error_working"]).any()
    asked = dict.fromkeys(("error_moving", "error_working" if works else "error_holding", *limited))
    rows = {name: limited.get(name) for name in asked if np.isfinite(results.dataset[name]).any()}
    if axis is None or not rows:
        return []
    off = {name: results.dataset[name].max("robot") for name in rows}
    top = extreme(off[next(iter(rows))].transpose(*results.dims))
    assert top is not None
    held = {dim: place for dim, place in zip(results.dims, top, strict=True) if dim != axis.dim}
    told = [f"{quantity(float(off[name].max()), 'm')} {words_of(name)}" for name in rows if name.startswith("error")]
    names = [f"{limit.say(limit.value, 6)} {limit.words}" for limit in limited.values()]
    dashed = f"Dashed: the limit{'s' if len(names) > 1 else ''} of {listed(names)}." if names else ""
    seen = View(results, axis, None, held)
    caption = seen.caption("Every tool at its worst.", *([dashed] if dashed else []))
    title = f"Tools are off their plan by up to {listed(told)}"
    return [draw("errors", title, caption, 0.8 + 1.8 * len(rows), partial(_draw_along, seen, rows))]


def _draw_along(seen: View, rows: Mapping[str, Limit | None], drawing: Drawing) -> None:
    assert seen.x is not None
    dataset, every = seen.results.dataset, drawing.subplots(len(rows), 1, squeeze=False, sharex=True)[:, 0]
    for axes, (name, limit) in zip(every, rows.items(), strict=True):
        most = max(float(seen.cut(dataset[name]).max()), limit.value if limit else 0.0)
        scale = scale_for(most, "m") if limit is None or limit.typed is None else limit.typed
        for r, robot in enumerate(list(seen.results.study.robot)[:MOST_ROBOTS]):
            values, colour = seen.plane(dataset[name].sel(robot=robot)), DISTINCT[r % len(DISTINCT)]
            line = "" if seen.is_sampled else "-"
            marker = "o" if seen.is_sampled or len(values) <= MOST_MARKED else ""
            axes.plot(
                seen.along(seen.x), values * scale.factor, line, marker=marker, markersize=3, color=colour, label=robot
            )
        if limit is not None:
            axes.axhline(limit.value * scale.factor, color=MUTED, linestyle="--", linewidth=1.0)
        axes.set_ylabel(f"off {'plan' if name.startswith('error') else 'rest'} {words_of(name)}\n({scale.unit})")
        axes.set_ylim(0.0, None)
    along_axis(every[-1], seen)
    drawing.align_ylabels()
    legend_of_all(drawing, every[0])


def _at(results: Results, index: Index) -> str:
    """The variant that a figure shows, as the first sentence of its caption."""
    at = results.at(index)
    return f"At {at}. " if at else ""


def _strip(results: Results, index: Index) -> Figure:
    largest = results.dataset["error_moving"].values[index]
    worst = int(np.nanargmax(np.nan_to_num(largest, nan=-1.0)))
    name = list(results.study.robot)[worst]
    title = f"The tool of {name} is off by up to {quantity(float(largest[worst]), 'm')} while it moves"
    error = np.abs(results.row(results.dataset["tool_centre_point_error"], index))
    most = np.nanmax(error, axis=(0, 1))
    shown = [place for place, own in enumerate(most) if own > UNSEEN * most.max()] or [0, 1, 2]
    still = [COMPONENTS[place] for place in range(len(COMPONENTS)) if place not in shown]
    less = f" Errors of {listed(still)} are less than {percent(UNSEEN)} of the largest." if still else ""
    caption = (
        f"{_at(results, index)}Planned places of the tools, and how far they are off these; up: a payload is "
        f"picked up, down: put down; thick: at work.{less}"
    )
    height = 0.6 + 1.6 * len(shown)
    return draw("over time", title, caption, height, partial(_draw_strip, results, index, shown))


def _draw_strip(results: Results, index: Index, shown: list[int], drawing: Drawing) -> None:
    from engine.robots.results import handled, works

    dataset, model = results.dataset, model_of(results, index)
    times = results.row(dataset["elapsed"], index)
    planned, error = (results.row(dataset[name], index) for name in ("tool_centre_point", "tool_centre_point_error"))
    scale = scale_for(float(np.nanmax(np.abs(error))), "m")
    every = drawing.subplots(len(shown), 2, squeeze=False, sharex=True)
    for r, name in enumerate(model.robots[:MOST_ROBOTS]):
        colour, own = DISTINCT[r % len(DISTINCT)], [way for way in works(model) if way.robot == r]
        at_work = np.any([(times >= way.start) & (times <= way.end) for way in own], axis=0) if own else times < 0.0
        own_rows = zip(every, planned[:, r, shown].T, error[:, r, shown].T * scale.factor, strict=True)
        for (place, off), values, wrong in own_rows:
            place.plot(times, values, color=colour, linewidth=1.0, label=name)
            off.plot(times, wrong, color=colour, linewidth=0.7)
            off.plot(times, np.where(at_work, wrong, np.nan), color=colour, linewidth=2.0)
        for robot, time, picks_up in handled(model):
            if robot == r and time <= times[-1] and shown[-1] == UP:
                height = np.interp(time, times, planned[:, r, UP])
                every[-1, 0].plot(time, height, "^" if picks_up else "v", color=colour, markersize=5)
    for (place, off), row in zip(every, shown, strict=True):
        place.set_ylabel(f"planned {COMPONENTS[row]} (m)")
        off.set_ylabel(f"error of {COMPONENTS[row]} ({scale.unit})")
        zero_line(off)
    for axes in every[-1]:
        axes.set_xlabel("time (s)")
    drawing.align_ylabels()
    legend_of_all(drawing, every[0, 0])


def _by_modes(results: Results) -> list[Figure]:
    """What numbers of modes change; [] where none was asked for."""
    if "error_by_modes" not in results.dataset:
        return []
    off, doubt = (float(results.dataset[f"error_by_modes{end}"].max()) for end in ("", "_doubt"))
    title = f"Too few modes of every rail change errors of tools by up to {percent(off)}"
    caption = f"Beside as many as the tolerance asks for, with which errors are estimated to within {percent(doubt)}."
    return [draw("modes", title, caption, 3.0, partial(_draw_modes, results))]


def _draw_modes(results: Results, drawing: Drawing) -> None:
    axes, off = drawing.subplots(), results.dataset["error_by_modes"]
    for r, name in enumerate(list(results.study.robot)[:MOST_ROBOTS]):
        values, colour = 100.0 * off.sel(robot=name).values, DISTINCT[r % len(DISTINCT)]
        axes.plot(off["mode_count"].values, values, "o-", markersize=4, color=colour, label=name)
    logarithmic(axes.yaxis)
    limit_line(axes, 100.0 * results.study.solver.tolerance, "tolerance", "right")
    axes.set_xticks(off["mode_count"].values)
    axes.set_xlabel("modes of every rail")
    axes.set_ylabel("change of the error,\nover its largest (%)")
    legend_beside(axes)


@dataclass(frozen=True, eq=False)
class _View:
    """How rails are drawn, one below another: places along them (B, E + 1) and how far they are down (S, B, E + 1), m,
    at times (S,); apart: m between two; exaggeration of deflections."""

    times: Array
    places: Array
    down: Array
    apart: float
    exaggeration: float

    @classmethod
    def of(cls, results: Results, index: Index) -> _View:
        times, down = (results.row(results.dataset[name], index) for name in ("elapsed", "rail_deflection"))
        places = results.dataset["rail_place"].values
        apart = ROWS_APART * float(np.nanmax(places))
        most = SIZE * apart / max(float(np.nanmax(np.abs(down))), 1e-12)
        power = 10.0 ** np.floor(np.log10(most))
        return cls(times, places, down, apart, power * max(step for step in (1.0, 2.0, 5.0) if step * power <= most))

    def station(self, time: float) -> int:
        return int(np.nanargmin(np.abs(self.times - time)))

    def line(self, station: int | None, rail: int) -> Array:
        """(P, 2) a rail at a station, or without load."""
        known = np.isfinite(self.places[rail])
        down = 0.0 if station is None else self.down[station, rail][known]
        height = np.broadcast_to(-rail * self.apart - self.exaggeration * down, known.sum())
        return np.stack([self.places[rail][known], height], axis=1)

    def in_words(self) -> str:
        rails = f"{len(self.places)} rails one below another, " * (len(self.places) > 1)
        return f"{rails}deflections {self.exaggeration:,.0f} times as large"


def _marked(results: Results, index: Index) -> dict[float, list[str]]:
    """Times of the longest errors, each once, in order, with the robots whose error is longest then."""
    times = results.dataset["error_largest_time"].values[index]
    found = dict[float, list[str]]()
    for r in np.argsort(times):
        if np.isfinite(times[r]):
            alike = [time for time in found if times[r] - time <= ALIKE * np.nanmax(times)]
            found.setdefault(alike[0] if alike else float(times[r]), []).append(list(results.study.robot)[r])
    return dict(list(found.items())[:MOST_SHAPES])


def _shapes(results: Results, index: Index) -> Figure:
    marked, view = _marked(results, index), _View.of(results, index)
    under = float(np.nanmax(results.row(results.dataset["deflection_largest"], index)))
    largest = max(under, float(np.nanmax(np.abs(view.down))))
    title = f"The rails bend by up to {quantity(largest, 'm')}"
    caption = (
        f"{_at(results, index)}At the times of the longest errors: {view.in_words()}. Bars are robots on their rails, "
        "at their tools."
    )
    rows = {time: f"{time:.3g} s: {listed(names)} off the most" for time, names in marked.items()}
    height = 0.6 + (0.3 + 6.0 * ROWS_APART * len(view.places)) * len(rows)
    return draw("rails", title, caption, height, partial(_draw_rows, results, index, view, rows))


def _draw_rows(results: Results, index: Index, view: _View, rows: Mapping[float, str], drawing: Drawing) -> None:
    largest = float(np.nanmax(np.abs(view.down)))
    scale, end = scale_for(largest, "m"), float(np.nanmax(view.places))
    planned = results.row(results.dataset["tool_centre_point"], index)
    every = drawing.subplots(len(rows), 1, squeeze=False, sharex=True)[:, 0]
    for axes, (time, words) in zip(every, rows.items(), strict=True):
        station = view.station(time)
        for b, name in enumerate(results.dataset["rail"].values):
            rest, points = view.line(None, b), view.line(station, b)
            axes.plot(rest[:, 0], rest[:, 1], color=MUTED, linewidth=0.4)
            lines = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)), cmap=SEQUENTIAL, linewidths=2.2)
            lines.set_array(np.abs(rest - points)[:-1, 1] / view.exaggeration * scale.factor)
            lines.set_clim(0.0, largest * scale.factor)
            axes.add_collection(lines)
            axes.text(end, -b * view.apart, f"  {name}", va="center", color=MUTED)
        for r, foot in enumerate(_feet(results, view)):
            x, colour = planned[station, r, 0], DISTINCT[r % len(DISTINCT)]
            axes.plot([x, x], foot, color=colour, linewidth=1.2)
            name = list(results.study.robot)[r]
            axes.text(x, _beside(foot), f" {name}", va="center", fontsize=7, color=colour)
        axes.set_aspect("equal")
        axes.set_xlim(-0.02 * end, 1.1 * end)
        axes.set_ylim((0.5 - len(view.places)) * view.apart, 0.5 * view.apart)
        axes.set_yticks([])
        axes.set_title(words)
    colour_bar(list(every), lines, f"deflection ({scale.unit})", fraction=0.04, aspect=30)
    every[-1].set_xlabel("along the rails (m)")


def _feet(results: Results, view: _View) -> list[tuple[float, float]]:
    """Of every robot the heights between which it is drawn: from rail to rail, or below its only one."""
    rails, found = list(results.dataset["rail"].values), []
    for robot in results.study.robot.values():
        rows = [-rails.index(name) * view.apart for name in robot.rails]
        found.append((max(rows), min(rows) if len(rows) > 1 else rows[0] - 0.7 * view.apart))
    return found


def _beside(foot: tuple[float, float]) -> float:
    """The height of a robot's name."""
    return 0.3 * foot[0] + 0.7 * foot[1]


def _worst_move(results: Results, index: Index) -> Figure | None:
    """The move in which a tool of its robot is off the most, in motion; None where nothing moves."""
    from engine.robots.results import ways

    model, view = model_of(results, index), _View.of(results, index)
    planned, error = (
        results.row(results.dataset[name], index) for name in ("tool_centre_point", "tool_centre_point_error")
    )
    size = np.linalg.norm(error, axis=2)
    during = {way: np.flatnonzero((view.times >= way.start) & (view.times <= way.end)) for way in ways(model)}
    most = {way: float(size[stations, way.robot].max()) for way, stations in during.items() if stations.size > 1}
    if not most:
        return None
    way = max(most, key=most.__getitem__)
    shown = during[way][np.unique(np.linspace(0, during[way].size - 1, MOST_FRAMES).round().astype(int))]
    rails, name = range(len(view.places)), model.robots[way.robot]
    frames = [[view.line(station, b) for b in rails] for station in (None, *shown.tolist())]
    heights = [_beside(foot) for foot in _feet(results, view)]
    marks = {
        robot: np.stack([planned[shown, r, 0], np.full(shown.size, heights[r])], axis=1)
        for r, robot in enumerate(model.robots)
    }
    of_all_steps = float(results.row(results.dataset["error_moving"].sel(robot=name), index))
    off = quantity(max(of_all_steps, most[way]), "m")
    title = f"In move {way.number} of {name} its tool is off by up to {off}"
    caption = f"{_at(results, index)}That move again and again, at its own pace: {view.in_words()}. Points are tools."
    at = {float(view.times[during[way][np.argmax(size[during[way], way.robot])]]): f"move {way.number} of {name}"}
    still = draw("worst move", title, caption, 2.2, partial(_draw_rows, results, index, view, at))
    return replace(still, moving=played(frames, marks, way.end - way.start, title))
