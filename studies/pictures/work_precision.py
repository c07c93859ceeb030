"""Figures of work and precision: error against cost and against steps, and the front of modes and steps together."""

from __future__ import annotations

from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator

from results_schema.lazy_imports import xr
from studies.pictures.common import figures as look
from studies.pictures.common.figures import Figure, draw, legend_beside, logarithmic, shades
from studies.precision import findings as advice
from studies.precision.findings import scheme_words, short_time
from studies.precision.pareto import automatic_choices, choices
from studies.precision.variables import QUANTITIES
from studies.results.formatting import number

COLUMNS = 2
WANTED = 1e-3  # the error that the first figure's title speaks of
LARGEST_SHOWN = 1.0
TIME = "time per variant"
DIAMOND: Any = {"color": look.VERMILION, "marker": "D", "markersize": 5.0, "markeredgecolor": "white", "linewidth": 0.0}
DASHES = ((4, 2), (1, 1.5), (6, 1.5, 1, 1.5), (2, 2), (8, 2), (3, 1, 1, 1))


def pictures(dataset: xr.Dataset) -> list[Figure]:
    """All figures."""
    panels = -(-dataset.sizes["scene"] // COLUMNS)
    height = 1.0 + 2.6 * panels
    orders = (
        "Every point is one number of steps. Along a line of order 2, twice the steps leave a quarter of the error; "
        "of order 1 half, of order 4 a sixteenth. Grey slopes show these three. Lines end where a scheme blows up. "
        "Dashed: for comparison only."
    )
    cost = (
        "Lower and further left is better: less error for less time. The march computes many variants at once; SciPy's "
        "solvers take one after another on the same equations."
    )
    both = (
        "Every point is a scheme, a number of steps and a number of modes; hollow ones are without static correction. "
        "The line is the best there is: whoever wants an error takes the first point of the line below it. Points that "
        "are good by luck, as finer steps are worse, count as these. In the grey band the reference cannot tell."
    )
    if "automatic_error" in dataset:
        both += (
            " A diamond is what the program chooses by itself in a sweep around the scene, the bar above it the error "
            "asked: where the bar is at the line, the choice costs as little as can be."
        )
    found = [
        _panels(dataset, ("trade", _first_clause(advice.lead(dataset, WANTED))), both, height, _draw_trade),
        _panels(dataset, ("cost", _cost_title(dataset)), cost, height, _draw_cost),
    ]
    if np.isfinite(dataset["fitted_order"].sel(quantity="history")).any():
        low = 0.9 + 0.24 * dataset.sizes["scheme"]
        found.append(draw("orders", _orders_title(dataset), ORDERS, low, partial(_orders, dataset)))
    for quantity in map(str, dataset["quantity"].values):
        title = _steps_title(dataset, quantity)
        drawn = partial(_draw_steps, quantity=quantity)
        extra = EXTRA.get(quantity, "")
        found.append(_panels(dataset, (f"steps-{quantity}", title), f"{orders}{extra}", height, drawn))
    return found


def _first_clause(text: str) -> str:
    """A sentence up to its first colon, without its full stop."""
    return text.partition(": ")[0].rstrip(".")


def _cost_title(dataset: xr.Dataset) -> str:
    """The longest and shortest time of a variant."""
    times = dataset["seconds_per_variant"].values
    ends = [short_time(float(end)) for end in (np.nanmin(times), np.nanmax(times))]
    return f"With equal modes a variant takes {ends[0]} to {ends[1]}, and more steps err less"


def _orders_title(dataset: xr.Dataset) -> str:
    """The range of the fitted orders of histories."""
    orders = dataset["fitted_order"].sel(quantity="history").values
    low, high = (number(float(end), 2) for end in (np.nanmin(orders), np.nanmax(orders)))
    return f"Errors of whole histories fall with order {low}{'' if low == high else f' to {high}'} of the steps"


def _steps_title(dataset: xr.Dataset, quantity: str) -> str:
    """The smallest error that steps alone come to."""
    errors = dataset["error"].sel(quantity=quantity).values
    known = errors[np.isfinite(errors) & (errors > 0.0)]
    least = f" to {number(float(known.min()), 2)} at best" if known.size else ""
    return f"The error of {QUANTITIES[quantity]} falls with the steps{least}"


ORDERS = (
    "The power with which the error of whole histories falls with the number of steps: the slopes of the lines in the "
    "figures below, fitted where they are straight. No mark: there is no such part, or the scheme blew up."
)
EXTRA = {
    "extremes": " A largest value is taken over the stations of the march and lies between two of them in truth, so no "
    "scheme does better than order 2 in the end.",
    "contact_force": " Of the weight, on 0\N{EN DASH}98 % of the span.",
}


def _panels(dataset: xr.Dataset, name: tuple[str, str], caption: str, height: float, fill: Any) -> Figure:
    return draw(*name, caption, height, partial(_fill, dataset, fill))


def _fill(dataset: xr.Dataset, fill: Any, drawing: Drawing) -> None:
    """One panel per scene with common axes, and one legend."""
    scenes = [str(name) for name in dataset["scene"].values]
    columns = min(COLUMNS, len(scenes))
    grid = drawing.subplots(-(-len(scenes) // columns), columns, squeeze=False, sharex=True, sharey=True)
    places = grid.ravel()
    handles: dict[str, Any] = {}
    for axes, scene in zip(places, scenes, strict=False):
        handles |= fill(axes, dataset.sel(scene=scene), scene)
        axes.set_title(scene)
    for axes in places[len(scenes) :]:
        axes.set_visible(False)
    is_time = places[0].get_xlabel() == TIME
    for axes in grid[:, 0]:
        axes.set_ylabel("error")
    for place, axes in enumerate(places[: len(scenes)]):
        if place + columns >= len(scenes):
            axes.xaxis.set_tick_params(labelbottom=True)
        else:
            axes.set_xlabel("")
    first = places[0]
    first.set_ylim(first.get_ylim()[0], min(max(axes.dataLim.y1 for axes in places), LARGEST_SHOWN) * 1.5)
    for axes in places[: len(scenes)]:
        for axis in (axes.xaxis, axes.yaxis):
            logarithmic(axis)
            axis.set_major_locator(LogLocator(subs=(1.0,), numticks=7 if axis is axes.yaxis else 4))
        if is_time:
            axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: short_time(value)))
    drawing.legend(list(handles.values()), list(handles), loc="outside right upper", alignment="left")


def _orders(dataset: xr.Dataset, drawing: Drawing) -> None:
    """Fitted orders of histories, one row per scheme, one mark per scene."""
    axes = drawing.subplots()
    schemes, scenes = ([str(name) for name in dataset[dim].values] for dim in ("scheme", "scene"))
    rows = np.arange(len(schemes))
    for scene, colour, marker in zip(scenes, cycle(look.DISTINCT), cycle("os^Dv<>")):
        order = dataset["fitted_order"].sel(scene=scene, quantity="history").values
        label = scene if np.isfinite(order).any() else "_none"
        axes.plot(order, rows, marker=marker, color=colour, linewidth=0.0, alpha=0.8, label=label)
    only = dataset["comparison_only"].values
    names = [f"{scheme_words(name)}{' *' * bool(c)}" for name, c in zip(schemes, only, strict=True)]
    axes.set_yticks(rows, names)
    axes.set(ylim=(len(schemes) - 0.5, -0.5), xlim=(0.0, 5.0), xlabel="order (* for comparison only)")
    legend_beside(axes)


def _styles(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Look of every scheme: colours for those of the march, dashed greys for the others."""
    found: dict[str, dict[str, Any]] = {}
    colours, dashes = iter((*look.DISTINCT, look.INK)), iter(DASHES)
    for scheme, compared in zip(map(str, dataset["scheme"].values), dataset["comparison_only"].values, strict=True):
        if compared:
            found[scheme] = {"color": look.MUTED, "dashes": next(dashes, (4, 2)), "linewidth": 1.0}
        else:
            found[scheme] = {"color": next(colours, look.INK), "marker": "o", "markersize": 3.0, "linewidth": 1.3}
    return found


def _draw_lines(axes: Axes, own: xr.Dataset, x: xr.DataArray, quantity: str) -> dict[str, Any]:
    handles: dict[str, Any] = {}
    for scheme, style in _styles(own).items():
        error = own["error"].sel(scheme=scheme, quantity=quantity).values
        along = np.broadcast_to(x.sel(scheme=scheme).values if "scheme" in x.dims else x.values, error.shape)
        shown = np.isfinite(error) & (error > 0.0)
        (line,) = axes.plot(along[shown], error[shown], zorder=2 if "dashes" in style else 3, **style)
        if shown.any():
            handles[scheme_words(scheme)] = line
    axes.set(xscale="log", yscale="log")
    return handles


def _draw_cost(axes: Axes, own: xr.Dataset, scene: str) -> dict[str, Any]:
    cost = own["seconds_per_variant"]
    handles = _draw_lines(axes, own, cost, "history")
    for marker, method in (("s", "DOP853"), ("^", "Radau")):
        chosen = [str(name) for name in own["solver"].values if str(name).startswith(method)]
        error = own["solver_error"].sel(solver=chosen, quantity="history").values
        seconds = own["solver_seconds_per_variant"].sel(solver=chosen).values
        (line,) = axes.plot(seconds, error, marker=marker, color=look.MUTED, markerfacecolor="white", linewidth=0.8)
        handles[f"SciPy {method}"] = line
    if "jax_error" in own:
        (line,) = axes.plot(
            own["jax_seconds_per_variant"], own["jax_error"], marker="x", color=look.MUTED, linewidth=0.8
        )
        handles["jax.vmap"] = line
    axes.set_xlabel(TIME)
    return handles


def _draw_steps(axes: Axes, own: xr.Dataset, scene: str, quantity: str) -> dict[str, Any]:
    handles = _draw_lines(axes, own, own["step_count"], quantity)
    steps = own["step_count"].values.astype(np.float64)
    shown = own["error"].sel(quantity=quantity).values
    known = shown[np.isfinite(shown) & (shown > 0.0)]
    if known.size and steps.size > 1:
        for order in (1, 2, 4):
            line = min(LARGEST_SHOWN, float(known.max())) * (steps / steps[0]) ** -order
            axes.plot(steps, np.where(line > known.min(), line, np.nan), color=look.HAIR, linewidth=3.0, zorder=1)
    axes.set_xlabel("steps over one passage or cycle")
    return handles


def _draw_trade(axes: Axes, own: xr.Dataset, scene: str) -> dict[str, Any]:
    points = [point for point in choices(own.expand_dims(scene=[scene]), scene, "history") if point.error > 0.0]
    counts = [int(count) for count in own["mode_count"].values]
    handles: dict[str, Any] = {}
    for count, colour in zip(counts, shades(len(counts)), strict=True):
        faces: tuple[Any, Any] = (colour, "none")
        for corrected, face in zip((True, False), faces, strict=True):
            mine = [p for p in points if p.modes == count and p.corrected is corrected and p.error < LARGEST_SHOWN]
            x, y = [point.seconds for point in mine], [point.error for point in mine]
            axes.scatter(x, y, s=7.0, facecolors=face, edgecolors=[colour], linewidths=0.5)
        name = f"{count} mode{'s' if count > 1 else ''}"
        handles[name] = Line2D([], [], color=colour, marker="o", markersize=3.5, linewidth=0.0)
    hollow: Any = {"marker": "o", "markersize": 3.5, "markerfacecolor": "none"}
    handles["hollow: without\nstatic correction"] = Line2D([], [], color=look.MUTED, linewidth=0.0, **hollow)
    best = np.minimum.accumulate([point.error for point in points]) if points else np.zeros(0)
    times = [point.seconds for point in points]
    (handles["best there is"],) = axes.plot(
        times, best, color=look.INK, linewidth=1.2, drawstyle="steps-post", zorder=4
    )
    handles |= _draw_automatic(axes, own.expand_dims(scene=[scene]))
    known = float(own["total_reference_error"].sel(quantity="history"))
    axes.axhspan(1e-16, known, color=look.HAIR, alpha=0.5, zorder=0)
    if len(best):
        axes.set_ylim(0.5 * min(best.min(), known), None)
    axes.set(xscale="log", yscale="log", xlabel=TIME)
    return handles


def _draw_automatic(axes: Axes, own: xr.Dataset) -> dict[str, Any]:
    """The program's own choices of one scene, each below the error asked."""
    if "automatic_error" not in own:
        return {}
    found = [point for asked in own["asked_tolerance"].values for point in automatic_choices(own, float(asked))]
    for point in found:
        axes.plot([point.seconds] * 2, [point.error, point.asked], color=look.VERMILION, linewidth=1.0, zorder=5)
        axes.plot(point.seconds, point.asked, marker="_", markersize=9.0, color=look.VERMILION, zorder=5)
        axes.plot(point.seconds, point.error, zorder=6, **DIAMOND)
    return {"automatic choice,\nbar: error asked": Line2D([], [], **DIAMOND)} if found else {}
