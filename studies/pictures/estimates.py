"""Estimated errors: over the sweep beside the tolerance, and beside what the audit observed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from numpy.typing import NDArray

from studies.choices import ERROR, PARTS, is_marched, of_variants
from studies.figures import (
    BLUE,
    DISTINCT,
    GREEN,
    INK,
    MUTED,
    PURPLE,
    VERMILION,
    Figure,
    draw,
    legend_beside,
    logarithmic,
)
from studies.pictures.choice import MANY_POINTS, chosen_view
from studies.results import Axis, Results
from studies.views import View, along_axis
from studies.words import counted, listed, number

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COLOURS = {"error_steps": GREEN, "error_modes": PURPLE, "error_fidelity": VERMILION}
SMALL = 1e-4  # of the tolerance: what is smaller has no place of its own
ROOM = 1.8  # of a logarithmic axis beyond its data
MOST_RESULTS, MOST_TOLERANCES = 5, 3
DASHED = (0, (4, 2))


def pictures(results: Results) -> list[Figure]:
    """The estimates over the sweep; none where there are none, or there is no sweep."""
    if not is_marched(results) or not np.isfinite(of_variants(results, ERROR)).any():
        return []
    seen = chosen_view(results)
    if seen.x is None:
        return []
    caption = " ".join(text for text in _sentences(results, seen, seen.x) if text)
    return [draw("estimates", "Estimated errors over the sweep", caption, 2.9, partial(_draw_estimates, seen, seen.x))]


def _sentences(results: Results, seen: View, x: Axis) -> Iterator[str]:
    yield (
        "Estimated errors of what is read over time, over the largest static value of each sensor (velocity and "
        "acceleration: over its own largest value): the whole, and the parts of which it is the sum."
    )
    others = [axis.noun for axis in results.axes if len(axis.values) > 1 and axis is not x]
    if seen.is_sampled:
        yield "Each point is one variant, coloured by the largest of its parts."
    elif others:
        yield f"Each line is the largest over {listed(others)}."
    if any((of_variants(results, name) < _floor(_tolerance(results))).any() for name in (ERROR, *PARTS)):
        yield "What is zero, or less than a ten-thousandth of the tolerance, is not drawn."
    unknown = int((np.isnan(of_variants(results, ERROR)) & results.kept.values).sum())
    if unknown:
        yield f"Without an estimate: {counted(unknown, 'variant')} of {results.size:,}."


def _tolerance(results: Results) -> Array:
    """The tolerance asked of every variant, in the sweep's shape."""
    return results.everywhere(results.parameter("solver.tolerance"))


def _floor(tolerance: Array) -> float:
    return SMALL * float(tolerance.min())


def _draw_estimates(seen: View, x: Axis, drawing: Drawing) -> None:
    axes, results = drawing.subplots(), seen.results
    floor = _floor(_tolerance(results))
    if seen.is_sampled:
        _draw_points(axes, results, x, floor)
    else:
        order = np.argsort(x.values, kind="stable")
        for name, colour, words in _curves(results):
            largest = np.fmax.reduce(_rows(results, x, of_variants(results, name)), axis=1)[order]
            style: dict[str, Any] = {"linewidth": 1.8 if name == ERROR else 1.1, "markersize": 2.5}
            style |= {"color": colour, "label": words, "marker": "o" if order.size <= MANY_POINTS else ""}
            axes.plot(x.values[order], np.where(largest >= floor, largest, np.nan), **style)
    _draw_tolerance(axes, results, x)
    logarithmic(axes.yaxis)
    axes.set_ylabel("relative error")
    along_axis(axes, seen)
    legend_beside(axes)


def _curves(results: Results) -> list[tuple[str, str, str]]:
    """Name, colour and words of the whole and the parts that are known."""
    parts = [(name, COLOURS[name], f"part of the {words}") for name, words in PARTS.items()]
    found = [part for part in parts if np.isfinite(of_variants(results, part[0])).any()]
    return [(ERROR, INK, "estimated error"), *found]


def _rows(results: Results, x: Axis, values: Array) -> Array:
    """Numbers in the sweep's shape as (n, others) with one axis first."""
    return np.moveaxis(values, results.dims.index(x.dim), 0).reshape(len(x.values), -1)


def _draw_points(axes: Axes, results: Results, x: Axis, floor: float) -> None:
    """Variants of a sample, each in the colour of its largest part."""
    whole = _rows(results, x, of_variants(results, ERROR))
    along = np.broadcast_to(x.values[:, None], whole.shape)
    parts = np.stack([np.nan_to_num(_rows(results, x, of_variants(results, name)), nan=-1.0) for name in PARTS])
    largest = parts.argmax(axis=0)
    for place, (name, words) in enumerate(PARTS.items()):
        own = (largest == place) & (whole >= floor)
        if own.any():
            style: dict[str, Any] = {"color": COLOURS[name], "markersize": 3.0, "label": f"mostly of the {words}"}
            axes.plot(along[own], whole[own], "o", **style)


def _draw_tolerance(axes: Axes, results: Results, x: Axis) -> None:
    """The tolerance along an axis; its smallest and largest where it depends on others too."""
    rows = _rows(results, x, _tolerance(results))
    order = np.argsort(x.values, kind="stable")
    ends = [rows.min(axis=1)[order], rows.max(axis=1)[order]]
    for line in ends[: 1 if np.array_equal(*ends) else 2]:
        label = "tolerance" if line is ends[0] else None
        axes.plot(x.values[order], line, color=MUTED, linewidth=1.0, linestyle=DASHED, label=label)


@dataclass(frozen=True, eq=False)
class Pairs:
    """Estimated and observed errors (n,) of audited variants, NaN where unknown, and the result that was worst."""

    estimated: Array
    observed: Array
    tolerance: Array
    worst: NDArray[np.str_]

    @classmethod
    def of(cls, group: xr.Dataset) -> Pairs:
        """Those of the archive's group that have an observed error."""
        own = np.isfinite(group["observed_error"].values)
        worst = np.asarray(group["worst_result"].values)[own].astype(np.str_)
        names = ("estimated_error", "observed_error", "tolerance_asked")
        estimated, observed, tolerance = (np.asarray(group[name].values, dtype=np.float64)[own] for name in names)
        return cls(estimated, observed, tolerance, worst)

    @property
    def known(self) -> Mask:
        """(n,) which have an estimate."""
        return np.isfinite(self.estimated)

    @property
    def limits(self) -> tuple[float, float]:
        """The ends of both axes."""
        sizes = np.concatenate([self.estimated[self.known], self.observed, self.tolerance])
        low = max(float(sizes[sizes > 0.0].min()), _floor(self.tolerance))
        return low / ROOM, float(sizes.max()) * ROOM


def compared(group: xr.Dataset | None) -> list[Figure]:
    """Estimated against observed errors of the audit; none without two variants that have both."""
    pairs = None if group is None else Pairs.of(group)
    if pairs is None or group is None or int(pairs.known.sum()) < 2:
        return []
    caption = " ".join(text for text in _compared_sentences(pairs, int(group.sizes["sample"])) if text)
    title = "Estimated against observed errors"
    return [draw("estimated-observed", title, caption, 3.9, partial(_draw_compared, pairs))]


def _compared_sentences(pairs: Pairs, audited: int) -> Iterator[str]:
    estimated, observed = pairs.estimated[pairs.known], pairs.observed[pairs.known]
    low = observed > estimated
    yield f"{counted(estimated.size, 'audited variant')}, coloured by the result that differed most."
    if low.any():
        factors = observed[low] / np.where(estimated[low] > 0.0, estimated[low], np.nan)
        worst = f", at most {number(float(np.nanmax(factors)), 2)} times" if np.isfinite(factors).any() else ""
        yield f"Above the diagonal the estimate was too small: {int(low.sum()):,} of them{worst}."
    else:
        yield "No estimate was smaller than what was observed."
    floor = pairs.limits[0]
    small = int(((estimated < floor) | (observed < floor)).sum())
    if small:
        yield f"Drawn at the edge because zero or too small for the scale: {small:,}."
    if not pairs.known.all():
        yield f"Triangles at the right edge: {int((~pairs.known).sum()):,} without an estimate."
    if audited > pairs.observed.size:
        yield f"Not drawn: {audited - pairs.observed.size:,} that could not be compared."


def _draw_compared(pairs: Pairs, drawing: Drawing) -> None:
    axes = drawing.subplots()
    low, high = pairs.limits
    axes.plot([low, high], [low, high], color=INK, linewidth=0.9, label="as estimated")
    line: dict[str, Any] = {"color": MUTED, "linewidth": 0.9, "linestyle": DASHED}
    for place, tolerance in enumerate(_tolerances(pairs.tolerance)):
        axes.axhline(tolerance, label="" if place else "tolerance", **line)
        axes.axvline(tolerance, **line)
    estimated, observed = (np.clip(values, low, high) for values in (pairs.estimated, pairs.observed))
    for name, colour, own in _by_result(pairs.worst):
        there, unknown = own & pairs.known, own & ~pairs.known
        style: dict[str, Any] = {"color": colour, "linestyle": "", "clip_on": False, "zorder": 3}
        axes.plot(estimated[there], observed[there], marker="o", markersize=3.6, label=name, **style)
        axes.plot(np.full(unknown.sum(), high), observed[unknown], marker=">", markerfacecolor="none", **style)
    for axis in (axes.xaxis, axes.yaxis):
        logarithmic(axis)
    axes.set(xlim=(low, high), ylim=(low, high), xlabel="estimated error", ylabel="observed error")
    axes.set_box_aspect(1.0)
    axes.set_anchor("W")
    legend_beside(axes)


def _tolerances(asked: Array) -> list[float]:
    """Few different tolerances, or the smallest and the largest of many."""
    different = np.unique(asked)
    return [float(value) for value in (different if different.size <= MOST_TOLERANCES else different[[0, -1]])]


def _by_result(worst: NDArray[np.str_]) -> Iterator[tuple[str, str, Mask]]:
    """Name, colour and variants of the results that were worst most often, then of all others."""
    often = [name for name, _ in Counter(worst.tolist()).most_common()]
    for name, colour in zip(often[:MOST_RESULTS], (BLUE, *DISTINCT[1:]), strict=False):
        yield name, colour, worst == name
    if len(often) > MOST_RESULTS:
        yield "others", MUTED, ~np.isin(worst, often[:MOST_RESULTS])
