"""Figures of a trajectory: histories over time."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from studies.findings.amplification import sizes
from studies.findings.beyond import AskedOfRest, of_every_quantity
from studies.pictures.common import residual
from studies.pictures.common.figures import MUTED, Figure, draw, legend_of_all, shades, widen
from studies.pictures.common.sweep_view import Curve, coincide
from studies.pictures.common.traces import coarse, picked
from studies.protocol.study import question_of
from studies.results.findings_common import told_hanging
from studies.results.formatting import ALIKE, quantity, scale_for
from studies.results.places import Index, chosen
from studies.results.results import Results

MOST_ROWS = 4
MOST_CURVES = 5
MOST_ALIKE = 3.0  # longest over shortest history that can share an axis of seconds


def pictures(results: Results) -> list[Figure]:
    """The sensors, then the carriages' own motion, over time, where histories were kept, then what rings on, where that
    is told."""
    rest = residual.pictures(results, question_of(results.study, AskedOfRest))
    return [*_over_time(results), *rest] if results.traced() else rest


def _over_time(results: Results) -> list[Figure]:
    sensors = of_every_quantity(results, MOST_ROWS)
    own = picked(results, sizes(results, sensors[0]), results.size)[-1:]
    shown = sorted({*own, *list(chosen(results.traced(), MOST_CURVES))[: MOST_CURVES - 1]})
    left_out = len(results.sensors) - len(sensors)
    more = f" {left_out} more sensors are in the archive." if left_out else ""
    many = f"{len(shown)} of {len(results.traced())} kept histories." if len(results.traced()) > len(shown) else ""
    units = {name: results.sensors[name] for name in sensors}
    hang = f" {said}" if (said := told_hanging(results, sensors)) else ""
    title = ranging(results, sensors[0], units[sensors[0]], shown)
    fine = coarse(results, results.trace(sensors[0], shown[0]).times)
    found = [histories(results, "sensors", title, f"{many}{more}{hang}{fine}", units, shown)]
    ways = _carriage_rows(results)
    if not ways:
        return found
    name = next(iter(ways))
    title = ranging(results, name, ways[name], shown)
    return [*found, histories(results, "carriages", title, many, ways, shown)]


def ranging(results: Results, name: str, unit: str, shown: list[Index]) -> str:
    """From where to where the histories of a result go, or where they stay."""
    values = np.concatenate([results.trace(name, index).values for index in shown])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    ends = [quantity(end, unit, beside=max(-low, high)) for end in (low, high)]
    noun = f"{results.noun(name)} {results.place(name)}" if name in results.sensors else name.replace("_", " ")
    stays = high - low <= ALIKE * max(abs(low), abs(high))
    return f"{noun[0].upper()}{noun[1:]} {f'stays at {ends[1]}' if stays else f'goes from {ends[0]} to {ends[1]}'}"


def _carriage_rows(results: Results) -> dict[str, str]:
    """Histories of the first carriage that are in the archive, with their units."""
    names = [f"{results.carriage_name}_{what}" for what in ("position", "speed", "acceleration_across")]
    return {name: str(results.dataset[name].attrs["units"]) for name in names if name in results.dataset}


def histories(
    results: Results, name: str, title: str, caption: str, units: dict[str, str], shown: list[Index]
) -> Figure:
    """One row for each of some results, with their units, over time."""
    height = 0.6 + 1.7 * len(units)
    return draw(name, title, caption.strip(), height, partial(_draw, results, units, shown))


def _draw(results: Results, units: dict[str, str], shown: list[Index], drawing: Drawing) -> None:
    rows = drawing.subplots(len(units), 1, squeeze=False, sharex=True)[:, 0]
    ends = [results.trace(next(iter(units)), index).end for index in shown]
    relative = max(ends) > MOST_ALIKE * min(ends)
    for axes, (name, unit) in zip(rows, units.items(), strict=True):
        traces = [results.trace(name, index) for index in shown]
        sizes = [float(np.abs(trace.values[np.isfinite(trace.values)]).max(initial=0.0)) for trace in traces]
        scale = scale_for(max(sizes), unit)
        if len(traces) > 1 and coincide([Curve("", trace.times, trace.values) for trace in traces]):
            axes.set_title("the same for all shown", loc="right", color=MUTED)
        for index, trace, colour in zip(shown, traces, shades(len(shown)), strict=True):
            times = trace.times / (trace.end if relative else 1.0)
            label = results.at(index).replace(", ", "\n")
            axes.plot(times, trace.values * scale.factor, color=colour, label=label, linewidth=1.3)
        widen(axes, [trace.values * scale.factor for trace in traces])
        words = name.replace("_", " ")
        if name not in results.sensors:
            axes.set_ylabel(f"{words}\n({scale.unit})" if scale.unit else words)
            continue
        axes.set_ylabel(results.label(name, scale.unit))
        axes.set_title(words)
        if results.hangs(name):
            axes.invert_yaxis()
    rows[-1].set_xlabel("time over the duration of the motion" if relative else "time (s)")
    drawing.align_ylabels()
    if len(shown) > 1:
        legend_of_all(drawing, rows[0])
