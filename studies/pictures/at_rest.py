"""What figures of studies at rest share: where bodies lie along the way, shapes over each other, errors over modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import FixedLocator

from results_schema.arrays import Array
from studies.pictures.common.figures import BLUE, INK, MUTED, VERMILION, Figure, draw, logarithmic, on_method, printed
from studies.pictures.common.sweep_view import MASSES, SPEEDS, Curve, View, view
from studies.results.formatting import percent, quantity
from studies.results.places import spread
from studies.results.results import Results

MOST_CURVES = 6
FLOOR = 1e-9  # below it an error is drawn at the floor: what is left there is rounding


@dataclass(frozen=True)
class Places:
    """Where the points of a body lie along the way, m: ``first + along`` (X,), with the first carriage's place besides
    where ``rides``."""

    name: str
    along: Array
    rides: bool

    def at(self, position: float) -> Array:
        """(X,) with the first carriage at a position."""
        return self.along + position if self.rides else self.along


def places(results: Results) -> list[Places]:
    """The bodies in the dataset's order; one that rides lies on its carriage's reference."""
    part, found = results.dataset["body_place"].values, []
    for name in map(str, results.dataset["on_body"].values):
        along = part * float(results.study.value(f"body.{name}.length"))
        rider = next((c for c in results.study.carriage.values() if c.riding_body == name), None)
        if rider is not None and not rider.lies_across:
            along = along - rider.reference_on(along[-1])
            first = rider is results.carriage
            found.append(Places(name, along if first else along + float(rider.motion.path(0.0).S), first))
        else:
            found.append(Places(name, along, False))
    return found


def swept(results: Results) -> View | None:
    """The sweep along one axis, the others held; None without a sweep."""
    seen = view(results, (*MASSES, *SPEEDS))
    return None if seen.x is None else seen


def sweep_curves(seen: View, values: Any) -> list[Curve]:
    """Values over (grid, position) as curves over the position, at most 6 along the sweep's axis."""
    assert seen.x is not None
    held = {dim: size // 2 for dim, size in zip(seen.results.dims, seen.results.shape, strict=True)}
    held.pop(seen.x.dim)
    cut = values.isel(held)
    order = np.argsort(seen.x.values, kind="stable")
    return [
        Curve(seen.x.value(int(order[i])), cut["position"].values, np.asarray(cut.isel({seen.x.dim: order[i]}).values))
        for i in spread(order.size, MOST_CURVES)
    ]


def held_words(seen: View) -> str:
    """What the other axes are held at, as a sentence; "" if there are none."""
    assert seen.x is not None
    axes = [axis for axis in seen.results.axes if axis.dim != seen.x.dim and len(axis.values) > 1]
    return f"Held at {', '.join(axis.at(len(axis.values) // 2) for axis in axes)}." if axes else ""


def way_title(results: Results) -> str:
    """The horizontal axis of what stands over the places of bodies."""
    across = any(carriage.lies_across for carriage in results.study.carriage.values())
    return "along the way, and across it (m)" if across else "along the way (m)"


def position_title(results: Results) -> str:
    """The horizontal axis of what stands over the first carriage's place."""
    return f"position of {results.carriage_name} (m)"


def carriage_marks(axes: Axes, results: Results, position: float, level: float) -> None:
    """The first carriage as a mark where it stands, unless it is a body with a line of its own."""
    if results.carriage.riding_body is None:
        axes.plot([position], [level], marker="s", markersize=4.0, color=INK, linestyle="none")


@dataclass(frozen=True, eq=False)
class Errors:
    """Relative errors (correction, mode_count, position) of one panel, whose title is given."""

    title: str
    counts: Sequence[int]
    errors: Array


def error_figure(results: Results, panels: Sequence[Errors], wanted: float, words: str) -> Figure:
    """Errors over the number of modes, with and without static correction; one panel each."""
    caption = f"{words} The dashed line is {printed(100.0 * wanted)} %." + (
        f" Errors below {printed(FLOOR)}, where rounding begins, are drawn there."
        if any((panel.errors < FLOOR).any() for panel in panels)
        else ""
    )
    title = _enough_title(panels, wanted)
    height = 0.5 + 2.3 * -(-len(panels) // 2)
    where = [quantity(float(place), "m") for place in results.dataset["checked_position"].values]
    return on_method(draw("modes", title, caption, height, partial(_draw_errors, panels, wanted, where)))


def _enough_title(panels: Sequence[Errors], wanted: float) -> str:
    """From how many modes on all errors with static correction stay within what is wanted."""
    worst = np.max([np.nan_to_num(panel.errors[0], nan=np.inf).max(axis=-1) for panel in panels], axis=0)
    beyond = np.flatnonzero(worst > wanted)
    first = beyond[-1] + 1 if beyond.size else 0
    if first == worst.size:
        return f"{panels[0].counts[-1]} modes of every body leave more than {percent(wanted)}"
    return f"{panels[0].counts[first]} modes of every body are enough for {percent(wanted)}"


def _draw_errors(panels: Sequence[Errors], wanted: float, where: Sequence[str], drawing: Drawing) -> None:
    grid = drawing.subplots(-(-len(panels) // 2), min(2, len(panels)), squeeze=False, sharey=True).ravel()
    styles: Mapping[int, Any] = {0: {"color": BLUE}, 1: {"color": VERMILION}}
    lines = ("-", (0, (1.5, 1.5)))
    for axes, panel in zip(grid, panels, strict=False):
        for correction, words in enumerate(("static correction", "without")):
            for place, at in enumerate(where):
                axes.plot(
                    panel.counts,
                    np.maximum(panel.errors[correction, :, place], FLOOR),
                    marker="o",
                    markersize=3.0,
                    linestyle=lines[place % 2],
                    label=f"{words}, {at}",
                    **styles[correction],
                )
        axes.axhline(wanted, color=MUTED, linewidth=0.8, linestyle="--")
        axes.set_title(panel.title)
        logarithmic(axes.xaxis)
        axes.xaxis.set_major_locator(FixedLocator(_apart(panel.counts)))
        logarithmic(axes.yaxis)
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    for axes in grid[: len(panels)][-2:]:
        axes.set_xlabel("modes of every body")
    for axes in grid[::2]:
        axes.set_ylabel("relative error")
    handles, labels = grid[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside upper center", ncols=2, alignment="left")


def _apart(counts: Sequence[int]) -> list[int]:
    """Numbers of modes whose ticks do not run into each other on a logarithmic axis."""
    kept = [counts[0]]
    for count in counts[1:]:
        if count >= 1.24 * kept[-1]:
            kept.append(count)
    return kept
