"""Figures of bodies in moving frames: histories, where carriages slide, energies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure as Drawing

from studies.findings.amplification import largest, sizes
from studies.findings.beyond import limits_of, of_every_quantity, ranked
from studies.findings.effects import unchanged
from studies.pictures.common.figures import Figure, draw, legend_of_all, on_method, shades
from studies.pictures.common.sizes import sizes_of
from studies.pictures.common.sweep_view import view
from studies.pictures.trajectory import histories, ranging
from studies.results.formatting import ALIKE, quantity
from studies.results.places import Index, chosen
from studies.results.results import Results

MOST_ROWS, MOST_CURVES = 5, 4


def pictures(results: Results) -> list[Figure]:
    """Largest values over the sweep, sensors and carriages over time, the phase portrait of what slides (these first),
    the energy."""
    traced = results.traced()
    if not traced:
        return []
    shown, own = list(chosen(traced, MOST_CURVES)), [_own(results, traced)]
    rows, over_time = _rows(results), list[Figure]()
    caption = f"At {results.at(own[0])}; one of {len(traced)} kept histories." if len(traced) > 1 else ""
    if rows:
        name = next(iter(rows))
        over_time.append(histories(results, "histories", ranging(results, name, rows[name], own), caption, rows, own))
    sliding = [_portrait(results, name, shown) for name, c in results.study.carriage.items() if c.motion.slides]
    over_sweep = list(_over_sweep(results))
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
        top = largest(results, sizes(results, own[0]))
        assert top is not None
        seen = view(results, at=top)
        if seen.x is not None and not all(unchanged(results, sizes(results, name)) for name in own):
            limit = limits.limit(results.study.sensor[own[0]].quantity)
            yield sizes_of(seen, own, limit, top)


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
