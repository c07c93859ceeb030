"""Figures of an asymmetry: the two ways on one axis, the lag with its theory, the odd and even parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

from results_schema.arrays import Array
from studies.findings import theory
from studies.findings.settled import odd_parts, settled, shown_sensors, thresholds
from studies.pictures.common import figures as look
from studies.pictures.common.figures import Figure, banded, colour_bar, draw, logarithmic, zero_line
from studies.pictures.common.sweep_view import (
    DAMPING,
    MASSES,
    SPEEDS,
    Curve,
    View,
    along_axis,
    draw_curves,
    draw_map,
    one_legend,
    view,
)
from studies.pictures.common.traces import odd_part, over_position, picked, there_and_back
from studies.results.findings_common import exceeds
from studies.results.formatting import listed, percent, quantity, scale_for
from studies.results.places import Index, extreme
from studies.results.results import Results

BANDS = (0.1, 0.3, 1.0, 3.0, 5.0, 10.0)  # percent
LAGS_SHOWN = 1.6
NARROW = 22  # letters of a line in a legend beside
VISIBLE = 0.03  # odd part that an eye sees in the response


def pictures(results: Results) -> list[Figure]:
    """All figures that the sweep and the kept histories allow."""
    sensors = shown_sensors(results)
    left_out = len(results.sensors) - len(sensors)
    more = f"{left_out} more sensors are in the archive." if left_out else ""
    telling = [sensor for sensor in sensors if _most_odd(results, sensor) > thresholds(results)[0]] or sensors[:1]
    alike = [sensor for sensor in sensors if sensor not in telling and np.isfinite(_most_odd(results, sensor))]
    found = [figure for sensor in telling for figure in _response(results, sensor)]
    if found and alike:
        found[-1] = replace(found[-1], caption=f"{found[-1].caption} {_told_alike(results, alike)}")
    top = extreme(_odd_where_settled(results, sensors[0]))
    seen = view(results, SPEEDS, (*DAMPING, *MASSES), top)
    if seen.x is not None:
        found += [
            make(seen, *_known(results, sensors, name, more)) for make, name in ((_lag, "lag"), (_parts, "odd_rms"))
        ]
        by_mass = view(results, SPEEDS, MASSES, top)
        if by_mass.y is not None and _has_map(by_mass, seen, sensors[0]):
            found.append(_map(by_mass, sensors[0]))
    return found


def _known(results: Results, sensors: list[str], name: str, more: str) -> tuple[list[str], str]:
    """The sensors that have a result anywhere, and in a sentence which have none; all of them where none has."""
    known = [sensor for sensor in sensors if np.isfinite(results.numbers(name, sensor)).any()]
    left = [sensor for sensor in sensors if sensor not in known]
    if not known or not left:
        return sensors, more
    return known, f"{more} Not known of {listed(left)}: at rest nothing changes there on the way.".strip()


def _odd_where_settled(results: Results, sensor: str) -> Array:
    """The odd part of a sensor, in the sweep's shape; NaN where a variant has not settled."""
    return np.asarray(odd_parts(results)[..., list(results.sensors).index(sensor)])


def _most_odd(results: Results, sensor: str) -> float:
    """The largest odd part of a sensor; NaN where it has none."""
    return float(np.fmax.reduce(_odd_where_settled(results, sensor).ravel(), initial=np.nan))


def _told_alike(results: Results, sensors: Sequence[str]) -> str:
    """Sensors whose two ways are one line to the eye, as a sentence."""
    each = [f"{sensor.replace('_', ' ')} by {percent(_most_odd(results, sensor))}" for sensor in sensors]
    return f"Not drawn, as their two ways would be one line: {listed(each)} of the static range at most."


def _has_map(by_mass: View, seen: View, sensor: str) -> bool:
    """Whether the odd part has a map: not where curves say already that the second axis changes nothing."""
    assert by_mass.y is not None
    least, odd = BANDS[0] / 100.0, by_mass.results.of_sensor("odd_rms", sensor)
    told = by_mass.y is seen.y and by_mass.most_along(by_mass.y, odd) <= least
    return not told and bool(np.nanmax(_odd(by_mass, sensor), initial=0.0) > least)


def _odd(seen: View, sensor: str) -> Array:
    """The odd part over the shown plane, of the static range; NaN where a variant has not settled."""
    values = _odd_where_settled(seen.results, sensor)
    return seen.plane(seen.results.dataset["status"].transpose(*seen.results.dims).copy(data=values))


def _response(results: Results, sensor: str) -> list[Figure]:
    odd = _odd_where_settled(results, sensor)
    ranked = picked(results, odd, results.size)
    if not ranked:
        return []
    largest = ranked[-1]
    modest = min(ranked, key=lambda index: abs(float(odd[index]) - VISIBLE))
    shown = list(dict.fromkeys([modest, largest]))
    which = (
        f"Of the kept histories, the one whose odd part is closest to {percent(VISIBLE)} of the static range (left) "
        "and the one with the largest of all variants (right)."
        if len(shown) == 2
        else ""
    )
    caption = (
        f"{which} Above: the last cycle over the position of the carriage; below: half the difference of forward and "
        "backward at equal position. Grey: the turns, which no index counts."
    ).strip()
    if results.hangs(sensor):
        caption += " Above, displacements point down, as the body hangs."
    title = (
        f"{results.noun(sensor).capitalize()} {results.place(sensor)}: the two ways differ by "
        f"{percent(float(odd[largest]))} of the static range"
    )
    return [draw(f"response-{sensor}", title, caption, 4.2, partial(_draw_response, results, sensor, shown))]


def _draw_response(results: Results, sensor: str, shown: list[Index], drawing: Drawing) -> None:
    grid = drawing.subplots(2, len(shown), squeeze=False, sharex="col", height_ratios=(3, 2))
    for column, index in enumerate(shown):
        _draw_ways(results, sensor, index, list(grid[:, column]))
        grid[0, column].set_title(results.at(index).replace(", ", "\n", 1) or " ")
    grid[0, 0].legend(loc="best")


def _draw_ways(results: Results, sensor: str, index: Index, axes: Sequence[Axes]) -> None:
    """The two ways above, the odd part below; displacements downwards, as the body hangs."""
    units = results.sensors[sensor]
    out, back = there_and_back(over_position(results, sensor, index))
    odd = odd_part(out, back)
    way = results.carriage_at(index).motion.legs
    assert way is not None
    scale = scale_for(float(np.abs(out.values).max()), units)
    small = scale_for(float(np.abs(odd.values).max()), units)
    axes[0].plot(out.position, out.values * scale.factor, color=look.BLUE, label="forward")
    axes[0].plot(
        back.position, back.values * scale.factor, color=look.VERMILION, linestyle=(0, (4, 1.5)), label="backward"
    )
    axes[1].plot(odd.position, odd.values * small.factor, color=look.INK, linewidth=1.2)
    zero_line(axes[1])
    depth = way.turn * (way.end - way.start)
    for ax in axes:
        for edge, inner in ((way.start, way.start + depth), (way.end, way.end - depth)):
            ax.axvspan(edge, inner, color=look.HAIR, alpha=0.45, linewidth=0.0, zorder=0.5)
        ax.set_xlim(min(way.start, way.end), max(way.start, way.end))
    if results.hangs(sensor):
        axes[0].invert_yaxis()
    axes[0].set_ylabel(results.label(sensor, scale.unit))
    axes[1].set_ylabel(f"odd part ({small.unit})" if small.unit else "odd part")
    axes[1].set_xlabel(f"position of {results.carriage_name} (m)")


def _lag(seen: View, sensors: list[str], more: str) -> Figure:
    results = seen.results
    cut = any(_lag_limit(seen, sensor) < _largest(_lags(seen, sensor)) for sensor in sensors)
    halves = any(theory.lag_factor(results, sensor) == 1 for sensor in sensors)
    half = ", half as much under the carriage, where the place of reading moves too" if halves else ""
    caption = seen.caption(
        "Lag of the response at equal position; negative: it trails.",
        f"Dashed: what damping alone gives at low speed{half}." if theory.lag_is_known(results) else "",
        f"Lags beyond {LAGS_SHOWN:g} times that are cut off: there vibration left over from the turns decides."
        if cut
        else "",
        more,
    )
    height = 0.6 + 2.3 * len(sensors)
    return draw("lag", _lag_title(results, sensors[0]), caption, height, partial(_draw_lag, seen, sensors))


def _lag_title(results: Results, sensor: str) -> str:
    """How far the response trails or runs ahead at most, whatever part of the sweep is drawn."""
    lags = results.numbers("lag", sensor)
    trails, ahead = -float(np.nanmin(lags, initial=0.0)), float(np.nanmax(lags, initial=0.0))
    parts = [
        f"{words} by up to {quantity(size, 'm')}"
        for words, size in (("trails", trails), ("runs ahead", ahead))
        if size > 0.0
    ]
    return f"The {results.noun(sensor)} {results.place(sensor)} {' or '.join(parts) or 'has no lag'}"


def _lags(seen: View, sensor: str) -> list[Curve]:
    return seen.curves(seen.results.of_sensor("lag", sensor))


def _largest(curves: list[Curve]) -> float:
    return max(float(np.abs(curve.y[np.isfinite(curve.y)]).max(initial=0.0)) for curve in curves)


def _lag_limit(seen: View, sensor: str) -> float:
    """Where the axis ends: all lags, but at most a few times the theory's, beside which a resonance is a spike."""
    expected = _largest(seen.curves(theory.lag(seen.results, sensor)))
    largest = _largest(_lags(seen, sensor))
    return min(largest, LAGS_SHOWN * expected) if expected else largest


def _draw_lag(seen: View, sensors: list[str], drawing: Drawing) -> None:
    rows = drawing.subplots(len(sensors), 1, squeeze=False, sharex=True)[:, 0]
    for axes, sensor in zip(rows, sensors, strict=True):
        limit = _lag_limit(seen, sensor)
        scale = scale_for(limit, "m")
        draw_curves(axes, seen, [curve._replace(y=curve.y * scale.factor) for curve in _lags(seen, sensor)])
        colours = [line.get_color() for line in axes.get_lines()]
        for curve, colour in zip(seen.curves(theory.lag(seen.results, sensor)), colours, strict=False):
            axes.plot(curve.x, curve.y * scale.factor, color=colour, linestyle=(0, (4, 2)), linewidth=0.9)
        zero_line(axes)
        if limit > 0.0:
            axes.set_ylim(-1.08 * limit * scale.factor, 1.08 * limit * scale.factor)
        axes.set_ylabel(seen.results.label(sensor, scale.unit, "lag of"))
        if axes is not rows[0] and axes.get_legend() is not None:
            axes.get_legend().remove()
        if colours and axes is rows[0] and theory.lag_is_known(seen.results):
            _name_theory(axes, theory.lag_formula(seen.results, sensor), seen)
    assert seen.x is not None
    rows[-1].set_xlabel(seen.x.title)


def _name_theory(axes: Axes, formula: str, seen: View) -> None:
    """The dashed lines in the legend too."""
    handles, labels = axes.get_legend_handles_labels()
    dashes = Line2D([], [], color=look.MUTED, linestyle=(0, (4, 2)), linewidth=0.9)
    place = {**look.BESIDE, "title": seen.y.noun} if labels and seen.y is not None else {"loc": "best"}
    axes.legend([*handles, dashes], [*labels, fill(formula, NARROW)], **place)


def _late(seen: View) -> Any:
    """1 where a variant has not settled, though others have, and 0 elsewhere, over the sweep."""
    fine, status = settled(seen.results), seen.results.dataset["status"].transpose(*seen.results.dims)
    return status.copy(data=(~fine if fine.any() else np.zeros_like(fine)).astype(np.float64))


def _parts(seen: View, sensors: list[str], more: str) -> Figure:
    limits, late = [percent(part) for part in thresholds(seen.results)], seen.plane(_late(seen)).any()
    caption = seen.caption(
        "Left: rms of half the difference of forward and backward; right: rms of their mean minus the static "
        f"response; both over the static range on the cruise part. Dotted: {listed(limits)}.",
        "Dashed: variants that have not settled, which the title leaves out." if late else "",
        more,
    )
    height = 0.6 + 2.3 * len(sensors)
    results, first = seen.results, sensors[0]
    odd = _odd_where_settled(results, first)
    even = np.where(np.isfinite(odd), np.abs(results.numbers("even_excess", first)), np.nan)
    most = [percent(float(np.nanmax(part, initial=0.0))) for part in (odd, even)]
    title = (
        f"{first.replace('_', ' ')}: the ways differ by up to {most[0]} of the static range, their mean from statics "
        f"by up to {most[1]}"
    )
    return draw("odd-and-even", title, caption, height, partial(_draw_parts, seen, sensors))


def _draw_parts(seen: View, sensors: list[str], drawing: Drawing) -> None:
    grid = drawing.subplots(len(sensors), 2, squeeze=False, sharex=True, sharey="row")
    late = [curve.y > 0.0 for curve in seen.curves(_late(seen))]
    for row, sensor in zip(grid, sensors, strict=True):
        for axes, name, title in zip(row, ("odd_rms", "even_excess"), ("odd part", "even excess"), strict=True):
            curves = seen.curves(seen.results.of_sensor(name, sensor))
            marked = zip(curves, late, strict=True)
            draw_curves(axes, seen, [curve._replace(y=100.0 * curve.y, loose=loose) for curve, loose in marked])
            if any((curve.y > 0.0).any() for curve in curves):
                logarithmic(axes.yaxis)
            for threshold in thresholds(seen.results):
                axes.axhline(100.0 * threshold, color=look.MUTED, linestyle=":", linewidth=0.9)
            axes.set_title(f"{title}, {sensor.replace('_', ' ')}")
        row[0].set_ylabel(f"part of {seen.results.noun(sensor)}\n{seen.results.place(sensor)}\n(% of the static range)")
    one_legend([axes for row in grid for axes in row[::-1]])
    for axes in grid[-1]:
        along_axis(axes, seen)


def _map(seen: View, sensor: str) -> Figure:
    odd = _odd_where_settled(seen.results, sensor)
    late = "White: variants that have not settled." if seen.plane(_late(seen)).any() else ""
    caption = seen.caption("Rms of half the difference of forward and backward.", late)
    told = exceeds(seen.results, odd, thresholds(seen.results)[0])
    title = f"{sensor.replace('_', ' ')}: the difference of the ways {told}"
    return draw("odd-map", title, caption, 3.0, partial(_draw_map, seen, sensor))


def _draw_map(seen: View, sensor: str, drawing: Drawing) -> None:
    axes = drawing.subplots()
    odd = seen.results.of_sensor("odd_rms", sensor).where(_late(seen) == 0.0)
    mesh = draw_map(axes, seen, 100.0 * odd, **banded(BANDS))
    colour_bar(axes, mesh, "odd part (% of the static range)", spacing="uniform")
