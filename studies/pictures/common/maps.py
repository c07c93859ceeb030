"""Figures of one result over two swept numbers of many values each, beside each other for few values of a third."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array
from studies.findings.effects import by_effect
from studies.pictures.common.figures import SEQUENTIAL, VERMILION, Figure, colour_bar, draw
from studies.pictures.common.sweep_view import View, draw_map, view
from studies.results.formatting import quantity, scale_for
from studies.results.places import extreme
from studies.results.results import Results

MANY = 6  # values of each of both axes from which on a map says more than curves
LEVEL = 0.02  # of the largest value: what varies less is one colour
STRIPES = 0.1  # of the range of values: a map of what varies less along either axis has stripes
MOST_PANELS = 3
HEIGHT = 3.2


class Mapped(NamedTuple):
    """What a map shows: values in the sweep's shape, their unit, what stands beside the colours in a unit, and a limit.

    best: words on the smallest value of every panel, which is marked then; "" where none is looked for.
    """

    values: Array
    units: str
    label: Callable[[str], str]
    limit: float | None = None
    best: str = ""


def maps(results: Results, mapped: Mapped, name: str, title: str, *sentences: str) -> list[Figure]:
    """A map along the two swept numbers of many values that change a result most; none where curves say as much."""
    axes = [axis for axis in by_effect(results, mapped.values) if axis.values.size > MANY]
    place = extreme(-mapped.values if mapped.best else mapped.values)
    if len(axes) < 2 or place is None:
        return []
    first, second = sorted(axes[:2], key=results.axes.index)
    seen = view(results, first.paths, second.paths, place)
    if not _tells(seen, mapped):
        return []
    panels = _panels(seen)
    limited = mapped.limit is not None and any(_crossed(one, mapped) for one in panels)
    told = (
        *sentences,
        f"Orange line: the limit of {quantity(mapped.limit or 0.0, mapped.units)}." if limited else "",
        f"Ring: {mapped.best}{' of each panel' if len(panels) > 1 else ''}." if mapped.best else "",
    )
    # What panels differ in stands above them.
    apart = (*told, replace(seen, held={}).missing) if len(panels) > 1 else (seen.caption(*told),)
    return [draw(f"{name}-map", title, " ".join(filter(None, apart)), HEIGHT, partial(_draw, panels, mapped))]


def _tells(seen: View, mapped: Mapped) -> bool:
    """Whether values vary, along both axes, by more than an eye takes for one colour or for stripes."""
    like = _cells(seen, mapped)
    known = seen.plane(like)
    known = known[np.isfinite(known)]
    span = float(np.ptp(known)) if known.size else 0.0
    axes = [axis for axis in (seen.x, seen.y) if axis is not None]
    varied = span > LEVEL * float(np.abs(known).max(initial=0.0))
    return varied and len(axes) == 2 and all(seen.most_along(axis, like) > STRIPES * span for axis in axes)


def _panels(seen: View) -> list[View]:
    """A view for each value of the one other swept number where these are few, else the one where it is held."""
    others = [axis for axis in seen.results.axes if axis.values.size > 1 and axis.dim in seen.held]
    if len(others) != 1 or others[0].values.size > MOST_PANELS:
        return [seen]
    return [replace(seen, held={**seen.held, others[0].dim: place}) for place in np.argsort(others[0].values).tolist()]


def _cells(seen: View, mapped: Mapped) -> Any:
    """The values as an array with the sweep's names of dimensions."""
    return seen.results.dataset["status"].transpose(*seen.results.dims).copy(data=mapped.values)


def _crossed(seen: View, mapped: Mapped) -> bool:
    """Whether the line of the limit runs through a panel."""
    known = seen.plane(_cells(seen, mapped))
    known = known[np.isfinite(known)]
    low, high = known.min(initial=np.inf), known.max(initial=-np.inf)
    return not seen.is_sampled and mapped.limit is not None and bool(low < mapped.limit < high)


def _draw(panels: list[View], mapped: Mapped, drawing: Drawing) -> None:
    grids = [one.plane(_cells(one, mapped)) for one in panels]
    low, high = (float(end([end(grid) for grid in grids])) for end in (np.nanmin, np.nanmax))
    scale = scale_for(high, mapped.units)
    own = mapped._replace(values=mapped.values * scale.factor)
    bounds = {"vmin": low * scale.factor, "vmax": high * scale.factor, "cmap": SEQUENTIAL}
    row = drawing.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    for axes, seen in zip(row, panels, strict=True):
        mesh = draw_map(axes, seen, _cells(seen, own), **bounds)
        if len(panels) > 1:
            axes.set_title(_held_alone(seen))
        _mark(axes, seen, mapped)
        axes.label_outer()
    colour_bar(list(row), mesh, mapped.label(scale.unit))


def _held_alone(seen: View) -> str:
    """The swept number that differs from one panel to another, and its value."""
    (axis,) = (axis for axis in seen.results.axes if axis.values.size > 1 and axis.dim in seen.held)
    return axis.at(seen.held[axis.dim])


def _mark(axes: Axes, seen: View, mapped: Mapped) -> None:
    """The line at the limit, and a ring around the smallest value where that is looked for."""
    assert seen.x is not None and seen.y is not None
    x, y, grid = seen.along(seen.x), seen.along(seen.y), seen.plane(_cells(seen, mapped))
    if _crossed(seen, mapped):
        axes.contour(x, y, grid.T, [mapped.limit], colors=VERMILION, linewidths=1.5)
    least = extreme(-grid)
    if mapped.best and least is not None:
        at = (x[least[0]], y[least[-1]])
        axes.plot(*at, marker="o", markersize=9.0, markerfacecolor="none", markeredgecolor="white", markeredgewidth=2.6)
        axes.plot(
            *at, marker="o", markersize=9.0, markerfacecolor="none", markeredgecolor=VERMILION, markeredgewidth=1.3
        )
