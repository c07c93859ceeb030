"""Errors told of every reported number: over all variants beside the tolerance, and beside what the audit observed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure as Drawing

from results_schema.arrays import Array, Mask
from results_schema.lazy_imports import xr
from studies.findings.numerics_used import is_marched, known
from studies.pictures.common import figures as look
from studies.pictures.common.figures import Figure, draw, legend_beside, logarithmic, on_method
from studies.results.axes import PACES, Axis
from studies.results.formatting import counted, number, percent
from studies.results.results import Results
from studies.runs.audit_findings import relative_errors

LEAST = 1e-6  # what is smaller stands there, at the end of the logarithmic axis
LEAST_POINTS = 2  # of a figure: a single number is a sentence
MOST_RESULTS = 18  # that are shown: first those that are nearest to their tolerances, then those without one


class Told(NamedTuple):
    """The errors told of a result: the smallest, the median and the largest, and in which part of the variants they are
    beyond its tolerance (NaN: it is held to none)."""

    name: str
    smallest: float
    median: float
    largest: float
    missed: float
    tolerance: float


def pictures(results: Results) -> list[Figure]:
    """The told errors by result; none where there are none, or there is no sweep."""
    if not is_marched(results.dataset) or "estimated_error" not in results.dataset or results.size < 2:
        return []
    kept, rows = results.kept.values, list[Told]()
    lacking = np.zeros(np.count_nonzero(kept), dtype=bool)
    asked = dict(zip(results.dataset["result"].values.tolist(), results.dataset["tolerance"].values, strict=True))
    for name, tolerance in asked.items():  # one after another: there may be very many variants
        error = results.estimated_error(name)[kept]
        lacking |= np.isnan(error)
        rows += _told(name, known(error), float(tolerance))
    if not rows:
        return []
    rows.sort(key=lambda row: (np.isnan(row.tolerance), -row.largest / np.nan_to_num(row.tolerance, nan=1.0)))
    shown = rows[:MOST_RESULTS]
    caption = (
        "Lines go from the smallest error of the variants to the largest, dots are their median. In grey: results that "
        f"are held to no tolerance. {len(shown)} of {counted(len(asked), 'result')}."
    )
    caption += f" Without an estimate of some: {counted(int(lacking.sum()), 'variant')}." if lacking.any() else ""
    return [
        on_method(draw("estimates", _title(rows[0]), caption, 0.8 + 0.21 * len(shown), partial(_draw_results, shown)))
    ]


def _told(name: str, error: Array, tolerance: float) -> Iterator[Told]:
    """Of known errors (n,) of a result; nothing where there are none."""
    if error.size:
        missed = float(np.count_nonzero(error > tolerance) / error.size)
        yield Told(name, float(error.min()), float(np.median(error)), float(error.max()), missed, tolerance)


def _title(nearest: Told) -> str:
    """How near its tolerance the nearest result comes."""
    if np.isnan(nearest.tolerance):
        return "No result is held to a tolerance"
    times, share = nearest.largest / nearest.tolerance, percent(nearest.missed)
    if nearest.largest <= nearest.tolerance:
        within = "All estimated errors that have a tolerance are within it"
        return f"{within}; {nearest.name} comes nearest, at {percent(times)}"
    return f"{nearest.name} may miss its tolerance in {share} of the variants, {number(times, 2)} times at most"


def _draw_results(rows: list[Told], drawing: Drawing) -> None:
    axes = drawing.subplots()
    for place, row in enumerate(rows):
        colour = look.MUTED if np.isnan(row.tolerance) else look.BLUE
        axes.plot(np.maximum([row.smallest, row.largest], LEAST), [place, place], color=colour, linewidth=2.0)
        axes.plot(max(row.median, LEAST), place, "o", color=colour)
        (mark,) = axes.plot(
            row.tolerance, place, "|", color=look.VERMILION, markersize=9.0, label="" if place else "tolerance"
        )
        mark.set_markeredgewidth(1.6)
    axes.set_yticks(range(len(rows)), [row.name for row in rows])
    axes.set(ylim=(len(rows) - 0.4, -0.6), xlabel="estimated error")
    axes.grid(False, axis="y")
    logarithmic(axes.xaxis)
    legend_beside(axes)


def compared(group: xr.Dataset | None) -> list[Figure]:
    """Told against observed errors of the audit; none without two numbers that have both."""
    if group is None:
        return []
    told, observed = (
        group[name].transpose("sample", "result").values for name in ("estimated_error", "observed_error")
    )
    both = np.isfinite(told) & np.isfinite(observed)
    if int(both.sum()) < 2:
        return []
    pairs = np.maximum(np.stack([told[both], observed[both]]), LEAST)
    times, variants = pairs[1] / pairs[0], counted(int(both.any(axis=1).sum()), "variant")
    beyond = int(np.count_nonzero(times > 1.0))
    further = f"{beyond:,} of {counted(times.size, 'audited number')} {'is' if beyond == 1 else 'are'} further off"
    none = f"All {times.size:,} audited numbers are no further off"
    title = f"{further if beyond else none} than estimated"
    caption = f"{variants}, a dot for every reported number; below the line its estimate was large enough."
    if times.max() > 1.0:
        worst = np.broadcast_to(group["result"].values, both.shape)[both][np.argmax(times)]
        caption += f" Worst above it: {worst}, {number(float(times.max()), 2)} times its estimate."
    caption += "" if both.all() else f" Not drawn: {counted(int((~both).sum()), 'number')} without one of both."
    held = np.broadcast_to(np.isfinite(group["tolerance"].values), both.shape)[both]
    fill = partial(_draw_compared, pairs, held, np.unique(known(group["tolerance"].values)))
    return [on_method(draw("estimated-observed", title, caption, 3.9, fill))]


def _draw_compared(pairs: Array, held: Mask, tolerances: Array, drawing: Drawing) -> None:
    axes = drawing.subplots()
    ends = pairs.min() / 1.8, max(pairs.max(), *tolerances, LEAST) * 1.8
    axes.plot(ends, ends, color=look.INK, linewidth=0.9, label="equal")
    for label, own, colour in (("held to a tolerance", held, look.BLUE), ("not held", ~held, look.MUTED)):
        if own.any():
            axes.plot(*pairs[:, own], "o", color=colour, markersize=3.0, label=label, rasterized=own.sum() > 500)
    for place, tolerance in enumerate(tolerances):
        axes.axhline(tolerance, color=look.VERMILION, linewidth=0.9, linestyle="--", label="" if place else "tolerance")
    for axis in (axes.xaxis, axes.yaxis):
        logarithmic(axis)
    axes.set(xlim=ends, ylim=ends, xlabel="estimated error", ylabel="observed error")
    axes.set_box_aspect(1.0)
    axes.set_anchor("W")
    legend_beside(axes)


def observed(results: Results, group: xr.Dataset | None) -> list[Figure]:
    """One figure of the observed errors along the sweep; none without an audit or a sweep, or where of fewer than two
    variants anything is held: sentences tell these."""
    axis = results.axis(*PACES) or next((axis for axis in results.axes if len(axis.values) > 1), None)
    if group is None or axis is None or np.isfinite(_worst(relative_errors(group))).sum() < LEAST_POINTS:
        return []
    worst = float(np.nanmax(relative_errors(group)))
    title = f"The audit found errors of at most {number(worst, 2)} times the tolerance"
    caption = (
        f"{counted(group.sizes['sample'], 'variant')} computed again with all terms, more modes and more steps, and "
        "one level beyond. Of every variant the largest error over its tolerance, among the results that have one."
    )
    return [on_method(draw("audit", title, caption, 3.0, partial(_draw_observed, group, axis)))]


def _draw_observed(group: xr.Dataset, axis: Axis, drawing: Drawing) -> None:
    axes = drawing.subplots()
    along = axis.factor * np.asarray(group[axis.name].values, dtype=np.float64)
    axes.axhline(1.0, color=look.MUTED, linewidth=1.0, label="tolerance")
    for name, mark, colour in (("observed", "o", look.BLUE), ("estimated", "x", look.VERMILION)):
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
