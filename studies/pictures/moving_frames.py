"""Figures of bodies in moving frames: histories, where carriages slide, energies."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from results_schema.quantities import AFTER_STOP
from studies.findings.amplification import largest, sizes
from studies.findings.beyond import limits_of, of_every_quantity, ranked
from studies.findings.effects import unchanged
from studies.findings.residual import banded
from studies.moving.findings import along_way
from studies.moving.question import Question
from studies.pictures.common.figures import Figure, draw, legend_of_all, limit_line, on_method, shades, telling_limits
from studies.pictures.common.residual import settling
from studies.pictures.common.sizes import sizes_of
from studies.pictures.common.sweep_view import View, along_axis, draw_curves, one_legend, view
from studies.pictures.trajectory import histories, ranging
from studies.protocol.study import question_of
from studies.results.findings_common import in_words
from studies.results.formatting import ALIKE, counted, quantity, scale_for
from studies.results.places import Index, chosen
from studies.results.results import Results

Limited = tuple[float | None, float | None]  # in the whole time, and after the stop
MOST_ROWS, MOST_CURVES, MOST_TIPS = 5, 4, 3
SMALL = (
    0.02  # of the largest value: a limit below stands on an axis of powers of ten, or it would lie on the axis itself
)


def pictures(results: Results) -> list[Figure]:
    """Largest values over the sweep, sensors and carriages over time, the phase portrait of what slides (these first),
    the energy."""
    traced = results.traced()
    if not traced:
        return []
    shown, own = list(chosen(traced, MOST_CURVES)), [_of_answer(results, traced)]
    rows, over_time = _rows(results), list[Figure]()
    caption = f"At {results.at(own[0])}; one of {len(traced)} kept histories." if len(traced) > 1 else ""
    if rows:
        name = next(iter(rows))
        over_time.append(histories(results, "histories", ranging(results, name, rows[name], own), caption, rows, own))
    sliding = [_portrait(results, name, shown) for name, c in results.study.carriage.items() if c.motion.slides]
    over_sweep = [*_over_sweep(results), *_settling(results)]
    found = [*over_time, *sliding, *over_sweep] if sliding else [*over_sweep, *over_time]
    energies = {"kinetic_energy": "J", "potential_energy": "J"}
    change = float(np.nanmax(results.dataset["energy_change"].values))
    whole = max(float(np.abs(results.trace(name, index).values).max()) for name in energies for index in traced)
    title = f"The energy of everything changes by at most {quantity(change, 'J')}"
    if change <= ALIKE * whole:
        title = "The energy of everything does not change"
    return [*found, on_method(histories(results, "energy", title, caption, energies, own))]


def _over_sweep(results: Results) -> Iterator[Figure]:
    """The largest values of sensors over the sweep, one figure for each quantity that changes."""
    limits = limits_of(results.study)
    ordered = ranked(results, limits)
    sensors = [name for name in ordered if np.isfinite(sizes(results, name)).any()]
    for noun in dict.fromkeys(map(results.noun, sensors)):
        own = [name for name in sensors if results.noun(name) == noun]
        tips = [name for name in own if results.study.sensor[name].reads.of_arm]
        top = largest(results, sizes(results, own[0]))
        assert top is not None
        seen = view(results, at=top)
        if seen.x is not None and not all(unchanged(results, sizes(results, name)) for name in own):
            limit = limits.of(results.study.sensor[own[0]])
            limits_of_tips = limit, question_of(results.study, Question).residual.position_error
            yield telling_limits(_of_tips(seen, tips, limits_of_tips, top)) if tips else sizes_of(seen, own, limit, top)


def _settling(results: Results) -> list[Figure]:
    """How long position errors take to settle."""
    sensors = [name for name in ranked(results, limits_of(results.study)) if name in banded(results)]
    return settling(results, sensors[:MOST_TIPS], question_of(results.study, Question).settling_time)


def _of_tips(seen: View, tips: list[str], limits: Limited, top: Index) -> Figure:
    """How far tips are from where the rigid arm would have them, at all and after the stop; top: where most."""
    results = seen.results
    most = f"{quantity(float(sizes(results, tips[0])[top]), 'm')},{in_words(results, top)}"
    title = f"The largest position error {results.place(tips[0])} is {most}"
    caption = seen.caption(
        "Largest distances from where the rigid arm would have them, in the whole time and from where its joints stop.",
        f"{counted(len(tips) - MOST_TIPS, 'more sensor')} in the archive." if len(tips) > MOST_TIPS else "",
    )
    shown = tips[:MOST_TIPS]
    return draw("position-errors", title, caption, 0.9 + 2.1 * len(shown), partial(_draw_tips, seen, shown, limits))


def _draw_tips(seen: View, tips: list[str], limits: Limited, drawing: Drawing) -> None:
    stops = any(np.isfinite(sizes(seen.results, f"{tip}{AFTER_STOP}")).any() for tip in tips)
    columns = [("", "in the whole time"), (AFTER_STOP, "after the stop")][: 1 + stops]
    grid = drawing.subplots(len(tips), len(columns), squeeze=False, sharex=True, sharey="row")
    for row, tip in zip(grid, tips, strict=True):
        largest = float(np.nanmax(sizes(seen.results, tip)))
        scale, known = scale_for(largest, "m"), [limit for limit in limits[: len(columns)] if limit is not None]
        by_tens = any(limit < SMALL * largest for limit in known)
        for axes, (end, when), limit in zip(row, columns, limits[: len(columns)], strict=True):
            values = seen.results.dataset["status"].copy(data=sizes(seen.results, f"{tip}{end}") * scale.factor)
            draw_curves(axes, seen, seen.curves(values))
            axes.set_title(f"{tip.replace('_', ' ')}{along_way(seen.results, tip)} {when}")
            if by_tens:
                axes.set_yscale("log")
            else:
                axes.set_ylim(0.0, None)
            if limit is not None and limit * scale.factor <= axes.get_ylim()[1]:
                limit_line(axes, limit * scale.factor, f"limit {quantity(limit, 'm')}", "left")
        row[0].set_ylabel(seen.results.label(tip, scale.unit, "largest"))
    one_legend([axes for row in grid for axes in row[::-1]])
    for axes in grid[-1]:
        along_axis(axes, seen)
    drawing.align_ylabels()


def _of_answer(results: Results, traced: list[Index]) -> Index:
    """The variant that the answer begins with, if its history is kept, else `_own`."""
    told = ranked(results, limits_of(results.study))[:1]
    top = largest(results, sizes(results, told[0])) if told else None
    return top if top in traced else _own(results, traced)


def _own(results: Results, traced: list[Index]) -> Index:
    """The kept variant that is nearest to the numbers of the study itself."""
    spans = {
        path: factor * float(np.ptp(axis.values)) for axis in results.axes for path, factor in axis.targets.items()
    }

    def distance(index: Index) -> float:
        values = results.values_at(index)
        return float(sum(abs(values[path] - results.study.value(path)) / (span or 1.0) for path, span in spans.items()))

    return min(traced, key=distance)


def _rows(results: Results) -> dict[str, str]:
    """Histories that are drawn, with their units."""
    rows = {name: results.sensors[name] for name in of_every_quantity(results, MOST_ROWS)}
    for name, carriage in results.study.carriage.items():
        ends = ("position", "acceleration_x", "acceleration_z") if carriage.motion.slides else ("acceleration_z",)
        rows |= {f"{name}_{end}": str(results.dataset[f"{name}_{end}"].attrs["units"]) for end in ends}
    return dict(list(rows.items())[:MOST_ROWS])


def _portrait(results: Results, name: str, shown: list[Index]) -> Figure:
    """Speed over place of a carriage that slides."""

    def fill(drawing: Drawing) -> None:
        axes = drawing.subplots()
        for index, colour in zip(shown, shades(len(shown)), strict=True):
            place, speed = (results.trace(f"{name}_{end}", index).values for end in ("position", "speed"))
            axes.plot(place, speed, color=colour, linewidth=1.0, label=results.at(index).replace(", ", "\n"))
        axes.set_xlabel(f"place of {name} on its track (m)")
        axes.set_ylabel("speed (m/s)")
        if len(shown) > 1:
            legend_of_all(drawing, axes)

    return draw(f"{name} portrait", f"How {name} slides: its speed over its place", "", 3.2, fill)
