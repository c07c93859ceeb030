"""Figures of envelopes: the extremes along a body, of some variants and of all."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from studies.pictures.common.figures import HAIR, INK, Figure, draw, legend_of_all, shades, zero_line
from studies.results.findings_common import told_envelopes
from studies.results.formatting import counted, scale_for
from studies.results.places import Index, chosen, spread
from studies.results.results import Results

MOST_ENVELOPES = 4
MOST_CURVES = 4


def pictures(results: Results) -> list[Figure]:
    """All envelopes, one below the other; none where the study has none, or no variant has values."""
    names = [name for name in results.envelopes if np.isfinite(results.envelope(name, "max")).any()]
    if not names:
        return []
    shown = list(chosen(names, MOST_ENVELOPES))
    height = 0.8 + 2.1 * len(shown)
    title = told_envelopes(results)[list(results.envelopes).index(names[0])].partition(": ")[2].rstrip(".")
    title = f"{title[0].upper()}{title[1:]}"
    return [draw("envelopes", title, _caption(results, names, shown), height, partial(_draw, results, shown))]


def _caption(results: Results, names: list[str], shown: list[str]) -> str:
    lines = "Largest and smallest value at every place, over the same instants as the extremes of sensors"
    held = results.with_values
    whose = " whose contact holds" if held.sum() < results.kept.values.sum() else ""
    band = f"; the grey band holds those of all {counted(int(held.sum()), 'variant')}{whose}" if held.sum() > 1 else ""
    hang = " Displacements point down, as the body hangs." if "m" in map(results.envelopes.get, shown) else ""
    left_out = len(names) - len(shown)
    more = f" {counted(left_out, 'more envelope')} in the archive." if left_out else ""
    return f"{lines}{band}.{hang}{more}"


def _draw(results: Results, names: list[str], drawing: Drawing) -> None:
    rows = drawing.subplots(len(names), 1, squeeze=False)[:, 0]
    variants = _picked(results, names[0])
    for axes, name in zip(rows, names, strict=True):
        _draw_one(axes, results, name, variants)
        envelope = results.study.envelope[name]
        axes.set_xlabel(f"place along {envelope.body} (m)")
    drawing.align_ylabels()
    if len(variants) > 1:
        legend_of_all(drawing, rows[0])


def _picked(results: Results, name: str) -> list[Index]:
    """Variants spread evenly over the sizes of an envelope, the one with the largest value among them."""
    size = np.maximum(*(np.abs(results.envelope(name, end)).max(axis=-1) for end in ("max", "min")))
    size = np.where(results.with_values, size, np.nan).reshape(-1)
    order = np.argsort(size, kind="stable")[: int(np.isfinite(size).sum())]
    return [results.index_of(int(order[-1 - i])) for i in spread(len(order), MOST_CURVES)][::-1]


def _draw_one(axes: Axes, results: Results, name: str, variants: list[Index]) -> None:
    places = np.asarray(results.dataset[f"{name}_place"].values, dtype=np.float64)
    ends = [results.envelope(name, end) for end in ("max", "min")]
    known = [values[results.with_values] for values in ends]
    top, bottom = known[0].max(axis=0), known[1].min(axis=0)
    scale = scale_for(float(max(np.abs(top).max(), np.abs(bottom).max())), results.envelopes[name])
    if len(known[0]) > 1:
        axes.fill_between(places, bottom * scale.factor, top * scale.factor, color=HAIR, alpha=0.6, linewidth=0.0)
        for edge, label in ((top, f"all {len(known[0]):,} together"), (bottom, None)):
            axes.plot(places, edge * scale.factor, color=INK, linewidth=0.9, linestyle=(0, (4, 2)), label=label)
    for index, colour in zip(variants, shades(len(variants)), strict=True):
        for values, label in zip(ends, (results.at(index).replace(", ", "\n"), None), strict=True):
            axes.plot(places, values[index] * scale.factor, color=colour, label=label)
    zero_line(axes)
    axes.set_xlim(places[0], places[-1])
    if results.envelopes[name] == "m":
        axes.invert_yaxis()
    words = f"{name}\n{results.study.envelope[name].quantity}".replace("_", " ")
    axes.set_ylabel(f"{words} ({scale.unit})" if scale.unit else words)
