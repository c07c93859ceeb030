"""Names of what a drawing of a scene shows, in rows above and below it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from results_schema.arrays import Array

PLOT, ROW, LETTER = 7.3, 0.17, 0.064  # inches: width of the plot, height of a row of names, width of a letter


class Label(NamedTuple):
    """A name with the place (2,) that it belongs to on the sheet; above: of those that always stand above."""

    place: Array
    text: str
    colour: str
    above: bool = False


class Named(NamedTuple):
    """A name in the rows above or below a drawing: its middle, half of its width, and the number of its row."""

    label: Label
    x: float
    half: float
    row: int


def in_rows(names: Sequence[Label], ends: tuple[float, float]) -> list[Named]:
    """Names in rows, from left to right, so that none covers another."""
    found, taken, letter = list[Named](), list[float](), LETTER * (ends[1] - ends[0]) / PLOT
    for label in sorted(names, key=lambda one: float(one.place[0])):
        half = 0.5 * letter * (len(label.text) + 2)
        x = min(max(float(label.place[0]), ends[0] + half), ends[1] - half)
        row = next((place for place, end in enumerate(taken) if end <= x - half), len(taken))
        taken[row : row + 1] = [x + half]
        found.append(Named(label, x, half, row))
    return found


def write(names: Sequence[Named], axes: Any, edge: float, step: float) -> None:
    """Names in their rows beyond an edge, each with a line to its place: upright where that lies beside the name, so
    that lines do not cross."""
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
    for (place, text, colour, _), x, half, row in names:
        height, foot = edge + (row + 0.6) * step, min(max(float(place[0]), x - half), x + half)
        axes.plot([place[0], foot], [place[1], height], color=colour, linewidth=0.5, alpha=0.6, zorder=1.0)
        axes.text(x, height, text, color=colour, ha="center", va="center", fontsize=8.0, bbox=box, zorder=6.0)
