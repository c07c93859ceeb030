"""Which model, modes and steps were used where in the sweep, and what that cost beside the full model."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm
from matplotlib.figure import Figure as Drawing
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from results_schema.status import Fidelity
from studies.choices import COST, MODEL, MODES, NAMES, STEPS, by_changes, is_marched, known, models, of_variants
from studies.figures import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SEQUENTIAL,
    SKY,
    VERMILION,
    Figure,
    colour_bar,
    draw,
    is_logarithmic,
    logarithmic,
    printed,
    shades,
)
from studies.results import PACES, Results, spread
from studies.views import DAMPING, MASSES, View, along_axis, draw_map, view
from studies.words import counted, listed, percent

Array = NDArray[np.float64]

NOTHING = "#bcc3cb"  # where no step was marched
COLOURS = {
    Fidelity.STATIC: NOTHING,
    Fidelity.FORCE: SKY,
    Fidelity.MASS_WITHOUT_CONVECTIVE: GREEN,
    Fidelity.MASS: BLUE,
    Fidelity.TIED: PURPLE,
    Fidelity.FRAME: ORANGE,
}
NOUNS = {MODEL: "model", MODES: "modes", STEPS: "steps"}
AGAINST = "cost over the full model's"
FEW_LEVELS, MOST_TICKS = 6, 4
MANY_POINTS = 60
VECTOR_CELLS = 1000  # of one map


class Scale(NamedTuple):
    """Colours of numbers: options of the map, and where its bar has ticks with which words."""

    style: dict[str, Any]
    ticks: list[float]
    labels: list[str]


def pictures(results: Results) -> list[Figure]:
    """The choice over the sweep and what it cost; none of what is the same in all variants."""
    if not is_marched(results):
        return []
    seen = chosen_view(results)
    if seen.x is None:
        return []
    varied = [name for name in NOUNS if np.unique(known(of_variants(results, name))).size > 1]
    cost = known(of_variants(results, COST))
    return [
        *([_choice(seen, varied)] if varied else []),
        *([_cost(seen, cost)] if np.unique(cost).size > 1 else []),
    ]


def chosen_view(results: Results) -> View:
    """Along the pace, and along the other axis on which the choice changes most often."""
    ranked = [f".{axis.paths[0]}" for axis in by_changes(results)]
    return view(results, (*PACES, *ranked), (*ranked, *MASSES, *DAMPING))


def _choice(seen: View, varied: list[str]) -> Figure:
    alike = [_alike(seen.results, name) for name in NOUNS if name not in varied]
    what = f"{listed([NOUNS[name] for name in varied])} of every variant shown".capitalize()
    same = f"All: {listed(alike)}." if alike else ""
    height = 3.4 if seen.y is not None else 0.6 + 1.35 * len(varied)
    fill = partial(_draw_choice if seen.y is not None else _draw_lines, seen, varied)
    return draw("choice", "What was used where", seen.caption(f"{what}.", same), height, fill)


def _alike(results: Results, name: str) -> str:
    """What is the same in all variants, in words."""
    value = int(known(of_variants(results, name))[0])
    return NAMES[Fidelity(value)] if name == MODEL else counted(value, NOUNS[name].removesuffix("s"))


def _draw_choice(seen: View, varied: list[str], drawing: Drawing) -> None:
    """One map beside the other, the keys above."""
    assert seen.y is not None
    row = drawing.subplots(1, len(varied), squeeze=False, sharex=True, sharey=True)[0]
    for axes, name in zip(row, varied, strict=True):
        if name == MODEL:
            _draw_models(drawing, axes, seen)
        else:
            values = of_variants(seen.results, name)
            _draw_scaled(axes, seen, values, NOUNS[name], "top" if len(varied) > 1 else "right")
        axes.set_xlabel(seen.x.title if seen.x is not None else "")
    row[0].set_ylabel(seen.y.title)


def _draw_models(drawing: Drawing, axes: Axes, seen: View) -> None:
    used = models(seen.results)
    places = np.searchsorted(used, of_variants(seen.results, MODEL).clip(max=max(used)))
    values = np.where(np.isfinite(of_variants(seen.results, MODEL)), places, np.nan)
    _in_colours(axes, seen, values, [COLOURS[model] for model in used])
    axes.set_title("model")
    keys = [Patch(color=COLOURS[model], label=NAMES[model]) for model in used]
    drawing.legend(handles=keys, loc="outside upper left", ncols=len(keys), handlelength=1.0, columnspacing=1.4)


def _in_colours(axes: Axes, seen: View, values: Array, colours: list[str]) -> None:
    """A map of the numbers 0, 1, ... in these colours."""
    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    _map(axes, seen, values, {"cmap": ListedColormap(colours), "norm": norm})


def _map(axes: Axes, seen: View, values: Array, style: dict[str, Any]) -> Any:
    """A map of numbers in the sweep's shape; large ones are pictures, as there are several in one figure."""
    mesh = draw_map(axes, seen, _over(seen, values), **style)
    mesh.set_rasterized(np.size(mesh.get_array()) > VECTOR_CELLS)
    return mesh


def _over(seen: View, values: Array) -> Any:
    """Numbers in the sweep's shape with its dimensions named."""
    return seen.results.dataset["status"].copy(data=values)


def _broken(name: str) -> str:
    return name.replace(" without", "\nwithout")


def _draw_scaled(axes: Axes, seen: View, values: Array, label: str, side: str) -> None:
    """A map of positive numbers with its bar; grey where they are 0, as nothing was marched."""
    values = _grey_where_nothing(axes, seen, values)
    scale = _scale(known(values))
    mesh = _map(axes, seen, values, scale.style)
    bar = colour_bar(axes, mesh, label, location=side)
    bar.set_ticks(scale.ticks, labels=scale.labels)


def _grey_where_nothing(axes: Axes, seen: View, values: Array) -> Array:
    """The values without those that are 0, where the map becomes grey."""
    if (values == 0.0).any():
        _in_colours(axes, seen, np.where(values == 0.0, 0.0, np.nan), [NOTHING])
    return np.where(values > 0.0, values, np.nan)


def _scale(values: Array) -> Scale:
    """Colours of their own for few different numbers, else a logarithmic scale."""
    levels = np.unique(values)
    if levels.size > FEW_LEVELS:
        ticks = _round_numbers(float(levels[0]), float(levels[-1]))
        norm = LogNorm(float(levels[0]), float(levels[-1]))
        return Scale({"cmap": SEQUENTIAL, "norm": norm}, ticks, [printed(tick) for tick in ticks])
    between = 0.5 * (levels[1:] + levels[:-1])
    edges = np.concatenate([0.5 * levels[:1], between, 1.5 * levels[-1:]])
    middles = 0.5 * (edges[1:] + edges[:-1])
    colours = ListedColormap(shades(levels.size))
    style = {"cmap": colours, "norm": BoundaryNorm(edges, levels.size)}
    return Scale(style, list(middles), [printed(level) for level in levels])


def _round_numbers(low: float, high: float) -> list[float]:
    """At most four of 1, 2, 5, 10, 20 ... from low to high; the ends where there are none.

    >>> _round_numbers(800.0, 9600.0), _round_numbers(6.0, 9.0)
    ([1000.0, 2000.0, 5000.0], [6.0, 9.0])
    """
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    inside = [d * 10.0**power for power in decades for d in (1.0, 2.0, 5.0) if low <= d * 10.0**power <= high]
    return [inside[place] for place in spread(len(inside), MOST_TICKS)] if len(inside) > 1 else [low, high]


def _draw_lines(seen: View, varied: list[str], drawing: Drawing) -> None:
    """One row below the other along the one axis there is."""
    rows = drawing.subplots(len(varied), 1, squeeze=False, sharex=True)[:, 0]
    assert seen.x is not None
    along = seen.along(seen.x)
    for axes, name in zip(rows, varied, strict=True):
        values = seen.plane(_over(seen, of_variants(seen.results, name)))
        if name == MODEL:
            used = models(seen.results)
            values = np.where(np.isfinite(values), np.searchsorted(used, np.nan_to_num(values)), np.nan)
            axes.set_yticks(range(len(used)), [_broken(NAMES[model]) for model in used])
            axes.set_ylim(-0.5, len(used) - 0.5)
        _line(axes, seen, along, values)
        axes.set_ylabel("" if name == MODEL else NOUNS[name])
        if name == MODES:
            axes.yaxis.set_major_locator(MaxNLocator(nbins=4, integer=True))
        if name != MODEL and is_logarithmic(values[values > 0.0]) and not (values == 0.0).any():
            logarithmic(axes.yaxis)
    along_axis(rows[-1], seen)


def _line(axes: Axes, seen: View, along: Array, values: Array) -> None:
    """Steps between points, or points alone where the axis is sampled or there are few."""
    if seen.is_sampled:
        axes.plot(along, values, "o", color=BLUE, markersize=3.0)
        return
    marker = "o" if along.size <= MANY_POINTS else ""
    axes.plot(along, values, color=BLUE, drawstyle="steps-mid", marker=marker, markersize=3.0, linewidth=1.0)


def _cost(seen: View, cost: Array) -> Figure:
    free = int((cost == 0.0).sum())
    spread_out = f"on average {percent(float(cost.mean()))}, median {percent(float(np.median(cost)))}"
    caption = seen.caption(
        "Modes × steps that each variant took, its checks included, over those of the full model with 20 modes and the "
        f"steps that all its rules ask for. Right all {counted(cost.size, 'variant')}: {spread_out}.",
        f"{counted(free, 'variant')} marched nothing and have no place on the scale." if free else "",
    )
    return draw("saved", "Saved against the full model", caption, 3.2, partial(_draw_cost, seen, cost))


def _draw_cost(seen: View, cost: Array, drawing: Drawing) -> None:
    left, right = drawing.subplots(1, 2, width_ratios=(1.25, 1.0))
    values = of_variants(seen.results, COST)
    assert seen.x is not None
    if seen.y is None:
        marched = np.where(values > 0.0, values, np.nan)
        _line(left, seen, seen.along(seen.x), seen.plane(_over(seen, marched)))
        along_axis(left, seen)
        logarithmic(left.yaxis)
        left.set_ylabel(AGAINST)
    else:
        _draw_scaled(left, seen, values, AGAINST, "right")
        left.set(xlabel=seen.x.title, ylabel=seen.y.title)
    _draw_sorted(right, cost)


def _draw_sorted(axes: Axes, cost: Array) -> None:
    """All variants by their cost, beside that of the full model."""
    ordered, median = np.sort(cost), float(np.median(cost))
    share = 100.0 * (np.arange(cost.size) + 0.5) / cost.size
    axes.plot(share, np.where(ordered > 0.0, ordered, np.nan), color=BLUE, drawstyle="steps-mid")
    axes.axhline(1.0, color=INK, linewidth=0.9, linestyle=(0, (4, 2)), label="full model")
    axes.axhline(float(cost.mean()), color=VERMILION, linewidth=0.9, label="average")
    if median > 0.0:
        axes.plot(50.0, median, "o", color=VERMILION, markersize=4.5, label="median")
    logarithmic(axes.yaxis)
    axes.set(xlim=(0.0, 100.0), xlabel="variants, cheapest first (%)")
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, handlelength=1.5, columnspacing=1.2, borderpad=0.0
    )
