"""Figures of cells of variants: what every result ranges over along a swept number, with its percentiles."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array
from studies.pictures.common import figures as look
from studies.pictures.common.figures import Figure, draw, legend_beside, shades
from studies.results.axes import PACES, Axis
from studies.results.cells import CellRange, cell_ranges
from studies.results.formatting import counted, listed, number, scale_for
from studies.results.results import Results

MOST = 6  # results that are drawn


def pictures(results: Results) -> list[Figure]:
    """One figure of the ranges along a number that cells differ by; none where there is one cell."""
    axis = results.axis(*PACES) or next((axis for axis in results.axes if len(axis.values) > 1), None)
    shown = [one for one in cell_ranges(results) if one.name not in ("work", "error_estimate")][:MOST]
    if axis is None or not shown:
        return []
    others = [dim for dim in results.dims if dim != axis.dim]
    over = f" and of all values of {listed(others)}" if others else ""
    caption = (
        f"Bands from the smallest to the largest value of the variants of each value of {axis.noun}{over}, of "
        f"{counted(results.variants, 'variant')}. {len(shown)} of {counted(results.dataset.sizes['result'], 'result')}."
    )
    title = f"What {counted(results.variants, 'variant')} range over, along {axis.noun}"
    return [draw("ranges", title, caption, 0.8 + 1.7 * len(shown), partial(_draw, results, axis, shown))]


def _draw(results: Results, axis: Axis, shown: list[CellRange], drawing: Drawing) -> None:
    order = np.argsort(axis.values, kind="stable")
    rows = drawing.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0]
    for axes, one in zip(rows, shown, strict=True):
        scale = scale_for(max(abs(one.smallest.value), abs(one.largest.value)), one.units)
        low, high = (_along(results, side, one, axis)[order] * scale.factor for side in ("smallest", "largest"))
        axes.fill_between(axis.shown[order], low, high, color=look.SKY, alpha=0.4, linewidth=0.0)
        axes.plot(axis.shown[order], low, color=look.BLUE, linewidth=0.9)
        axes.plot(axis.shown[order], high, color=look.BLUE, linewidth=0.9)
        if len(results.dims) == 1 and "percentile" in results.dataset:
            _draw_percentiles(axes, results, one, axis, scale.factor)
        axes.set_ylabel(f"{one.name}\n{one.sensor}{f' ({scale.unit})' if scale.unit else ''}")
    rows[-1].set_xlabel(axis.title)


def _draw_percentiles(axes: Axes, results: Results, one: CellRange, axis: Axis, factor: float) -> None:
    """A line for each percentile."""
    order = np.argsort(axis.values, kind="stable")
    values = results.dataset["percentile"].sel(result=f"{one.name} {one.sensor}".strip()).transpose(axis.dim, "percent")
    parts = results.dataset["percent"].values
    for part, row, colour in zip(parts, values.values.T, shades(len(parts)), strict=True):
        axes.plot(axis.shown[order], row[order] * factor, color=colour, label=f"{number(float(part))} %")
    legend_beside(axes)


def _along(results: Results, side: str, one: CellRange, axis: Axis) -> Array:
    """An extreme along an axis, over all others."""
    values = results.dataset[side].sel(result=f"{one.name} {one.sensor}".strip())
    others = [dim for dim in values.dims if dim != axis.dim]
    found = values.min(others) if side == "smallest" else values.max(others)
    return np.asarray(found.values, dtype=np.float64)
