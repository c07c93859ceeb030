"""Which part of a sweep a figure shows: up to two axes of it, the others held, and the words that say so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.collections import PathCollection, QuadMesh

from results_schema.arrays import Array, Counts, Mask
from results_schema.lazy_imports import xr
from results_schema.status import Status
from studies.pictures.common import figures as look
from studies.pictures.common.figures import is_logarithmic, legend_beside, logarithmic, shades, widen
from studies.results.axes import DIRECTION, VARIANT, Axis
from studies.results.formatting import ALIKE, listed
from studies.results.places import Index, spread
from studies.results.results import Results, statuses

MOST_CURVES = 6
MOST_TICKS = 5  # of a scale above, whose numbers may be as long as 0.0225: seven of these overlapped
FEW = 4  # values of an axis: a curve through them shows nothing in between
DASHED = (0, (3, 2))
UNSEEN = 0.01  # of a plot's height: what lies closer is one line to the eye
VECTOR_CELLS = 4000  # larger maps are drawn as pictures inside the SVG
MOST_POINTS = 20_000  # of a sample that are drawn: more cover each other, and a million took four minutes
SPEEDS = (".motion.speed", ".motion.frequency")
MASSES = (".mass", ".force")
DAMPING = (".damping_ratio",)


class Curve(NamedTuple):
    """y (n,) over x (n,) for one value of the second axis. loose: where y is dashed, as it is known loosely."""

    label: str
    x: Array
    y: Array
    loose: Mask | None = None


@dataclass(frozen=True, eq=False)
class View:
    """A sweep seen along `x` and, for several curves or a map, `y`; every other dimension is held at an index.

    drawn: a place along `y` that is always among the curves.
    """

    results: Results
    x: Axis | None
    y: Axis | None
    held: dict[str, int]
    drawn: int | None = None

    @property
    def is_sampled(self) -> bool:
        """Whether the axes lie along the one dimension of a sampled or zipped sweep, so that there are points only."""
        return self.x is not None and self.x.dim == VARIANT

    @property
    def points(self) -> Counts:
        """Places (n,) along a sample that are drawn: evenly spread over its numbers where they are many."""
        assert self.x is not None
        return np.array(spread(len(self.x.values), MOST_POINTS), dtype=np.int64)

    @property
    def thinned(self) -> str:
        """How many points of a sample are drawn; "" where all are."""
        if not self.is_sampled or self.x is None or self.points.size == self.x.values.size:
            return ""
        return f"Drawn: {self.points.size:,} of {self.x.values.size:,} samples, evenly spread over their numbers."

    def cut(self, values: Any) -> xr.DataArray:
        """Values over (some of) the sweep with the held dimensions taken out."""
        array = xr.DataArray(values)
        return array.isel({dim: i for dim, i in self.held.items() if dim in array.dims})

    def plane(self, values: Any) -> Array:
        """The same as an array (x, y) of the shown dimensions, (x,) where they are one; axes ascend on a grid."""
        axes = {axis.dim: axis for axis in (self.x, self.y) if axis is not None}
        both = (self.cut(array) for array in (values, self.results.dataset["status"]))
        bare = (array.drop_vars(list(array.coords)) for array in both)  # coordinates would be copied
        full = xr.broadcast(*bare)[0].transpose(*axes)
        return np.asarray(full.isel({dim: _order(axis) for dim, axis in axes.items()}).values, dtype=np.float64)

    def most_along(self, axis: Axis, values: Any) -> float:
        """The largest difference that values have along one of the axes, all others held; of a sample, that of all."""
        grid, place = self.plane(values), 1 if axis is self.y and not self.is_sampled else 0
        return float(np.nan_to_num(np.fmax.reduce(grid, axis=place) - np.fmin.reduce(grid, axis=place)).max())

    def along(self, axis: Axis) -> Array:
        """The values (n,) of an axis in the order of `plane`, in the unit of its title."""
        return np.asarray(axis.shown[_order(axis)])

    def curves(self, values: Any) -> list[Curve]:
        """Values as curves over x, at most 6 of the second axis."""
        assert self.x is not None
        grid, way = self.plane(values), self.along(self.x)
        if grid.ndim == 1:
            return [Curve("", way, grid)]
        assert self.y is not None
        order = _order(self.y)
        places = spread(len(order), MOST_CURVES)
        if self.drawn is not None:
            wanted = int(np.flatnonzero(order == self.drawn)[0])
            places = places if wanted in places else sorted({*places, wanted} - {_nearest(places, wanted)})
        return [Curve(self.y.value(int(order[i])), way, grid[:, i]) for i in places]

    @property
    def words(self) -> str:
        """What is held where, "" if nothing is."""
        axes = [axis for axis in self.results.axes if len(axis.values) > 1]
        held = [self._held(axis) for axis in axes if axis.dim in self.held]
        others = [axis for axis in axes if axis.dim not in self.held and axis not in (self.x, self.y)]
        differ = "differ" if len(others) > 1 else "differs"
        varied = f"{listed([axis.name for axis in others])} {differ} from point to point." if others else ""
        return " ".join(text for text in (f"Held at {', '.join(held)}." if held else "", varied) if text)

    def _held(self, axis: Axis) -> str:
        """Where an axis is held, beside what the study file has for its number where that is something else."""
        place, own = self.held[axis.dim], self.results.written(axis)
        if own is None or np.isclose(own, axis.values[place], atol=0.0):
            return axis.at(place)
        return f"{axis.at(place)} (in the study file {axis.in_words(own)})"

    @property
    def missing(self) -> str:
        """How many of the shown variants have no values, and why; "" if all have."""
        status = self.cut(self.results.dataset["status"]).values.ravel()
        counts = {Status(int(v)): int(n) for v, n in zip(*np.unique(status, return_counts=True), strict=True)}
        lost = {value: count for value, count in counts.items() if not value.values_kept}
        return f"Of {status.size} variants shown: {statuses(lost)}." if lost else ""

    def caption(self, *sentences: str) -> str:
        """Sentences, then what is held, thinned and missing."""
        return " ".join(text for text in (*sentences, self.words, self.thinned, self.missing) if text)


def view(
    results: Results, x: Sequence[str] = SPEEDS, y: Sequence[str] = (*DAMPING, *MASSES), at: Index | None = None
) -> View:
    """A view along the first axis whose key ends like one of `x`, and one like `y`; else along what there is. A few
    values are curves, not points along a way, where another axis has more than twice as many.

    Axes that are not shown are held where a variant is, such as the one that the answer names, or in the middle of
    their values.
    """
    varied = [axis for axis in results.axes if len(axis.values) > 1]
    first = results.axis(*x) or (varied[0] if varied else None)
    if first is not None and first.values.size <= FEW and first.dim != VARIANT:
        longest = max(varied or [first], key=lambda axis: axis.values.size)
        first = longest if longest.values.size > 2 * first.values.size else first
    rest = [axis for axis in varied if axis is not first and first and (axis.dim == VARIANT) == (first.dim == VARIANT)]
    second = next((axis for ending in y for axis in rest if axis.sets(ending)), rest[0] if rest else None)
    shown = {axis.dim for axis in (first, second) if axis is not None}
    middle = tuple(size // 2 for size in results.shape)
    places = dict(zip(results.dims, middle if at is None else at, strict=True))
    held = {dim: place for dim, place in places.items() if dim not in shown}
    on_grid = second is not None and second.dim != VARIANT and at is not None
    return View(results, first, second, held, places[second.dim] if second is not None and on_grid else None)


def alone(seen: View) -> View:
    """The same view without its second axis, which is then held in the middle too."""
    if seen.y is None or seen.x is None or seen.y.dim == seen.x.dim:
        return View(seen.results, seen.x, None, seen.held)
    place = len(seen.y.values) // 2 if seen.drawn is None else seen.drawn
    return View(seen.results, seen.x, None, {**seen.held, seen.y.dim: place})


def _nearest(places: Sequence[int], wanted: int) -> int:
    """The place that is nearest to a wanted one, but never an end."""
    inner = places[1:-1] or [wanted]
    return min(inner, key=lambda place: abs(place - wanted))


def _order(axis: Axis) -> Any:
    """Places along an axis in ascending order; a sample stays as it is."""
    return slice(None) if axis.dim == VARIANT else np.argsort(axis.values, kind="stable")


def along_axis(axes: Axes, seen: View) -> None:
    """Label and scale of the horizontal axis."""
    assert seen.x is not None
    axes.set_xlabel(seen.x.title)
    _name_ways(axes.xaxis, seen.x)
    if is_logarithmic(seen.x.shown):
        logarithmic(axes.xaxis)


def _name_ways(drawn: XAxis | YAxis, axis: Axis) -> None:
    """Ticks of the way forward and backward in words."""
    if axis.sets(DIRECTION):
        drawn.set_ticks(axis.shown, labels=[axis.in_words(float(value)) for value in axis.values])


def draw_curves(axes: Axes, seen: View, curves: Sequence[Curve]) -> None:
    """Curves in ordered colours with a legend beside; points, coloured by the second axis, where it is sampled.

    Curves that no eye can tell apart are one, with a remark.
    """
    if seen.is_sampled:
        _draw_points(axes, seen, curves[0])
        return
    if seen.y is not None and coincide(curves):
        alike = "both alike" if seen.y.sets(DIRECTION) else f"{seen.y.span}, alike"
        curves = [curves[-1]._replace(label=alike)]
    for curve, colour in zip(curves, shades(len(curves)), strict=True):
        _draw_curve(axes, curve, colour)
    if seen.y is not None:
        legend_beside(axes, seen.y.noun)
    widen(axes, [curve.y for curve in curves])


def _draw_curve(axes: Axes, curve: Curve, colour: Any) -> None:
    """A curve, with marks where its points are few or stand between gaps; dashed from and to every point that is known
    loosely."""
    known = np.isfinite(curve.y)
    marker = "o" if known.sum() <= 12 else ""
    beside = np.pad(known, 1)
    alone = known & ~beside[:-2] & ~beside[2:]
    if alone.any() and not marker:
        axes.plot(curve.x[alone], curve.y[alone], "o", color=colour, markersize=4)
    loose = np.zeros(curve.y.shape, dtype=bool) if curve.loose is None else curve.loose
    axes.plot(curve.x, np.where(loose, np.nan, curve.y), color=colour, marker=marker, label=curve.label)
    if loose.any():
        axes.plot(curve.x, curve.y, color=colour, marker=marker, linestyle=DASHED, markerfacecolor="none")


def coincide(curves: Sequence[Curve]) -> bool:
    """Whether several curves lie on each other as far as an eye can tell."""
    x, y = np.array([curve.x for curve in curves]), np.array([curve.y for curve in curves])
    known = y[np.isfinite(y)]
    if len(curves) < 2 or not known.size or np.ptp(x, axis=0).any() or (np.isfinite(y) != np.isfinite(y[0])).any():
        return False
    height = max(float(np.ptp(known)), ALIKE * float(np.abs(known).max()))
    return bool(np.nan_to_num(np.ptp(y, axis=0)).max() <= UNSEEN * height)


def one_legend(rows: Sequence[Axes]) -> None:
    """Keep the first legend of axes below each other, whose colours mean the same; beside the uppermost."""
    legends = [legend for axes in rows if (legend := axes.get_legend()) is not None]
    for legend in legends[1:]:
        legend.remove()


def ratio_above(axes: Axes, seen: View, ratio: Any, title: str) -> None:
    """A second scale above the plot: a ratio, such as that to the critical speed, where it grows with what is swept."""
    assert seen.x is not None
    factor = per_shown(seen, seen.x, ratio)
    if factor is not None and axes.get_xscale() == "linear":
        there, back = partial(np.multiply, factor), partial(np.multiply, 1.0 / factor)
        above = axes.secondary_xaxis("top", functions=(there, back))
        above.set_xlabel(title)
        above.locator_params(axis="x", nbins=MOST_TICKS)


def per_shown(seen: View, axis: Axis | None, ratio: Any) -> float | None:
    """A ratio over the shown values of an axis, where it depends on them alone and in proportion."""
    if axis is None or ratio is None or seen.cut(ratio).dims != (axis.dim,) or axis.dim == VARIANT:
        return None
    factors = np.asarray(seen.cut(ratio).values, dtype=np.float64) / np.where(axis.shown, axis.shown, np.nan)
    known = factors[np.isfinite(factors)]
    return float(known[0]) if known.size and np.ptp(known) <= ALIKE * abs(known[0]) and known[0] > 0.0 else None


def _draw_points(axes: Axes, seen: View, curve: Curve) -> None:
    at, size = seen.points, 14.0 if len(curve.x) < 500 else 4.0
    style: dict[str, Any] = {"s": size, "linewidths": 0.0, "rasterized": at.size > VECTOR_CELLS}
    if seen.y is None:
        axes.scatter(curve.x[at], curve.y[at], color=look.BLUE, **style)
        return
    points = axes.scatter(curve.x[at], curve.y[at], c=seen.y.shown[at], cmap=look.SEQUENTIAL, **style)
    axes.figure.colorbar(points, ax=axes, label=seen.y.title, pad=0.02).outline.set_visible(False)


def draw_map(axes: Axes, seen: View, values: Any, **style: Any) -> Any:
    """Values over the plane of two axes as coloured cells, or as coloured points where the sweep is sampled."""
    assert seen.x is not None and seen.y is not None
    x, y = seen.along(seen.x), seen.along(seen.y)
    grid = seen.plane(values)
    axes.grid(visible=False)
    mesh: QuadMesh | PathCollection
    if seen.is_sampled:
        shown = seen.points[np.isfinite(grid[seen.points])]
        size, rasterized = 14.0 if shown.size <= VECTOR_CELLS else 4.0, shown.size > VECTOR_CELLS
        style |= {"s": size, "linewidths": 0.0, "rasterized": rasterized}
        mesh = axes.scatter(x[shown], y[shown], c=grid[shown], **style)
    else:
        rasterized = grid.size > VECTOR_CELLS
        edges = _edges(x), _edges(y)
        mesh = axes.pcolormesh(*edges, grid.T, shading="flat", rasterized=rasterized, edgecolors="face", **style)
        mesh.set_linewidth(0.7)  # covers the seams that browsers show between cells
    drawn = (axes.xaxis, seen.x, x, axes.set_xlim), (axes.yaxis, seen.y, y, axes.set_ylim)
    for axis, of, way, ends in drawn:
        _name_ways(axis, of)
        if np.nanmin(way) >= 0.0 > axis.get_view_interval()[0]:
            ends(0.0, None)  # the lowest cell reaches below its value
        if is_logarithmic(way):
            logarithmic(axis)
    axes.set(xlabel=seen.x.title, ylabel=seen.y.title)
    return mesh


def _edges(values: Array) -> Array:
    """Edges of cells around ascending or descending values: half-way between, by ratio where the axis is drawn so."""
    if values.size == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    spaced = np.log(values) if is_logarithmic(values) else values
    middle = 0.5 * (spaced[1:] + spaced[:-1])
    edges = np.concatenate([[1.5 * spaced[0] - 0.5 * spaced[1]], middle, [1.5 * spaced[-1] - 0.5 * spaced[-2]]])
    return np.exp(edges) if is_logarithmic(values) else edges
