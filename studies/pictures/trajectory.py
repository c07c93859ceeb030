"""Figures of a trajectory: histories over time."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from studies.pictures.common.figures import Figure, draw, legend_of_all, shades
from studies.results.formatting import scale_for
from studies.results.results import Index, Results, chosen

MOST_ROWS = 4
MOST_CURVES = 5
MOST_ALIKE = 3.0  # longest over shortest history that can share an axis of seconds


def pictures(results: Results) -> list[Figure]:
    """The sensors, then the carriages' own motion, over time; none where no history was kept."""
    shown = list(chosen(results.traced(), MOST_CURVES))
    if not shown:
        return []
    sensors = list(chosen(list(results.sensors), MOST_ROWS))
    left_out = len(results.sensors) - len(sensors)
    more = f" {left_out} more sensors are in the archive." if left_out else ""
    many = f"{len(shown)} of {len(results.traced())} kept histories." if len(results.traced()) > len(shown) else ""
    units = {name: results.sensors[name] for name in sensors}
    found = [_histories(results, "sensors", "Sensors over time", f"{many}{more}", units, shown)]
    ways = _carriage_rows(results)
    return [*found, *([_histories(results, "carriages", "Carriages over time", many, ways, shown)] if ways else [])]


def _carriage_rows(results: Results) -> dict[str, str]:
    """Histories of the first carriage that are in the archive, with their units."""
    names = [f"{results.carriage_name}_{what}" for what in ("position", "speed", "acceleration_across")]
    return {name: str(results.dataset[name].attrs["units"]) for name in names if name in results.dataset}


def _histories(
    results: Results, name: str, title: str, caption: str, units: dict[str, str], shown: list[Index]
) -> Figure:
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
        for index, trace, colour in zip(shown, traces, shades(len(shown)), strict=True):
            times = trace.times / (trace.end if relative else 1.0)
            label = results.at(index).replace(", ", "\n")
            axes.plot(times, trace.values * scale.factor, color=colour, label=label, linewidth=1.3)
        words = name.replace("_", " ")
        axes.set_ylabel(f"{words}\n({scale.unit})" if scale.unit else words)
    rows[-1].set_xlabel("time over the duration of the motion" if relative else "time (s)")
    drawing.align_ylabels()
    if len(shown) > 1:
        legend_of_all(drawing, rows[0])
