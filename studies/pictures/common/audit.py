"""What the audit observed, beside what was estimated and asked."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure as Drawing

from studies.pictures.common.figures import BLUE, MUTED, VERMILION, Figure, draw, legend_beside, logarithmic
from studies.results.formatting import axis_title, counted
from studies.results.results import PACES, Axis, Results

if TYPE_CHECKING:
    import xarray as xr

HEIGHT = 3.0
LEAST = 1e-12  # an observed error of nothing has no place on a logarithmic axis


def pictures(results: Results, group: xr.Dataset | None) -> list[Figure]:
    """One figure of the observed errors along the sweep; none without an audit of two variants or a sweep."""
    axis = results.axis(*PACES) or next((axis for axis in results.axes if len(axis.values) > 1), None)
    if group is None or axis is None or not np.isfinite(group["observed_error"].values).any():
        return []
    caption = (
        f"{counted(group.sizes['sample'], 'variant')} computed again with all terms, twice the modes and at least four "
        "times the steps. The largest difference of what they report, of extremes over the largest static value."
    )
    return [draw("audit", "Errors that the audit observed", caption, HEIGHT, partial(_draw, group, axis))]


def _draw(group: xr.Dataset, axis: Axis, drawing: Drawing) -> None:
    axes = drawing.subplots()
    along = np.asarray(group[axis.name].values, dtype=np.float64)
    observed, estimated, asked = (
        np.asarray(group[name].values) for name in ("observed_error", "estimated_error", "tolerance_asked")
    )
    order = np.argsort(along)
    axes.plot(along[order], asked[order], color=MUTED, linewidth=1.0, label="tolerance")
    axes.plot(along, np.maximum(observed, LEAST), "o", color=BLUE, markersize=4.5, label="observed")
    if np.isfinite(estimated).any():
        axes.plot(along, np.maximum(estimated, LEAST), "x", color=VERMILION, markersize=5.0, label="estimated")
    logarithmic(axes.yaxis)
    axes.set_xlabel(axis_title(axis.noun, axis.units))
    axes.set_ylabel("relative error")
    legend_beside(axes)
