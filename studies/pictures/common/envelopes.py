"""Figures of envelopes: the extremes along a body, of some variants and of all."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from studies.findings.beyond import limits_of
from studies.findings.envelopes import largest_along, nearest_to_limits, sizes_along
from studies.pictures.common.figures import (
    HAIR,
    INK,
    Figure,
    draw,
    legend_of_all,
    limit_far,
    limit_line,
    shades,
    telling_limits,
    zero_line,
)
from studies.pictures.common.sizes import FAR
from studies.results.findings_common import hanging
from studies.results.formatting import Scale, counted, quantity, scale_for
from studies.results.places import Index, spread
from studies.results.results import Results

MOST_ENVELOPES = 4
MOST_CURVES = 4


def pictures(results: Results) -> list[Figure]:
    """Envelopes, one below the other, those nearest to their limits first; none where the study has none, or no variant
    has values."""
    names = [name for name in nearest_to_limits(results) if np.isfinite(results.envelope(name, "max")).any()]
    if not names:
        return []
    shown = names[:MOST_ENVELOPES]
    height = 0.8 + 2.1 * len(shown)
    title = f"{largest_along(results, names[0])}{_against(results, names[0])}"
    title = f"{title[0].upper()}{title[1:]}"
    caption, fill = _caption(results, names, shown), partial(_draw, results, shown)
    return [telling_limits(draw("envelopes", title, caption, height, fill))]


def _limit(results: Results, name: str) -> float | None:
    return limits_of(results.study).limit(results.study.envelope[name].quantity)


def _against(results: Results, name: str) -> str:
    """Whether an envelope is beyond its limit, as the end of a title; "" without one."""
    if (limit := _limit(results, name)) is None:
        return ""
    beyond = bool((sizes_along(results, name)[results.with_values] > limit).any())
    return f", {'beyond' if beyond else 'within'} the limit of {quantity(limit, results.envelopes[name])}"


def _caption(results: Results, names: list[str], shown: list[str]) -> str:
    lines = "Largest and smallest value at every place, over the same instants as the extremes of sensors"
    held = results.with_values
    whose = " whose contact holds" if held.sum() < results.kept.values.sum() else ""
    band = f"; the grey band holds those of all {counted(int(held.sum()), 'variant')}{whose}" if held.sum() > 1 else ""
    down = [name for name in shown if results.hangs_along(name)]
    said = hanging(down, [name for name in shown if results.envelopes[name] == "m" and name not in down])
    hang = f" {said}" if said else ""
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
    size = np.where(results.with_values, sizes_along(results, name), np.nan).reshape(-1)
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
    _draw_limit(axes, results, name, scale, (float(bottom.min()), float(top.max())))
    axes.set_xlim(places[0], places[-1])
    if results.hangs_along(name):
        axes.invert_yaxis()
    words = f"{name}\n{results.study.envelope[name].quantity}".replace("_", " ")
    axes.set_ylabel(f"{words} ({scale.unit})" if scale.unit else words)


def _draw_limit(axes: Axes, results: Results, name: str, scale: Scale, ends: tuple[float, float]) -> None:
    """The limit of an envelope on the sides on which it comes near, or words on one that is far off."""
    if (limit := _limit(results, name)) is None:
        return
    said = f"limit {quantity(limit, results.envelopes[name])}"
    sides = [side for side, end in ((-limit, -ends[0]), (limit, ends[1])) if limit <= FAR * end]
    for side in sides:
        limit_line(axes, side * scale.factor, said if side == sides[-1] else "", "left")
    if not sides:
        limit_far(axes, f"{said}, beyond this panel")
