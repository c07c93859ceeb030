"""What the audit observed, beside what was estimated and asked."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array
from studies.pictures.common.figures import BLUE, MUTED, VERMILION, Figure, draw, legend_beside, logarithmic, on_method
from studies.results.formatting import counted, number
from studies.results.results import PACES, Axis, Results
from studies.runs.audit import relative_errors

if TYPE_CHECKING:
    import xarray as xr

HEIGHT = 3.0
LEAST = 1e-6  # an observed error of nothing has no place on a logarithmic axis


def pictures(results: Results, group: xr.Dataset | None) -> list[Figure]:
    """One figure of the observed errors along the sweep; none without an audit or a sweep, or where nothing is held."""
    axis = results.axis(*PACES) or next((axis for axis in results.axes if len(axis.values) > 1), None)
    if group is None or axis is None or not np.isfinite(relative_errors(group)).any():
        return []
    worst = float(np.nanmax(relative_errors(group)))
    title = f"The audit found errors of at most {number(worst, 2)} times the tolerance"
    caption = (
        f"{counted(group.sizes['sample'], 'variant')} computed again with all terms, more modes and more steps, and "
        "one level beyond. Of every variant the largest error over its tolerance, among the results that have one."
    )
    return [on_method(draw("audit", title, caption, HEIGHT, partial(_draw, group, axis)))]


def _draw(group: xr.Dataset, axis: Axis, drawing: Drawing) -> None:
    axes = drawing.subplots()
    along = axis.factor * np.asarray(group[axis.name].values, dtype=np.float64)
    axes.axhline(1.0, color=MUTED, linewidth=1.0, label="tolerance")
    for name, mark, colour in (("observed", "o", BLUE), ("estimated", "x", VERMILION)):
        worst = _worst(relative_errors(group, f"{name}_error"))
        axes.plot(along, np.maximum(worst, LEAST), mark, color=colour, markersize=4.5, label=name)
    logarithmic(axes.yaxis)
    axes.set_xlabel(axis.title)
    axes.set_ylabel("error over tolerance")
    legend_beside(axes)


def _worst(errors: Array) -> Array:
    """(n,) the largest known of errors (n, R); NaN where none is."""
    found = np.max(np.nan_to_num(errors, nan=-np.inf), axis=1, initial=-np.inf)
    return np.where(np.isfinite(found), found, np.nan)
