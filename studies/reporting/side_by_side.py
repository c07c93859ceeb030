"""What is looked for of every result, side by side for the few values of a swept number, as forward and backward."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from studies.findings.numerics_used import is_marched
from studies.protocol.parts import TextTable
from studies.reporting.summary import MOST_TIED, MOVE_AND_SETTLE, Extreme, Range, in_tables, speaking
from studies.results.axes import DIRECTION, VARIANT, Axis
from studies.results.cells import single_numbers
from studies.results.formatting import listed
from studies.results.results import Results

MOST_COLUMNS = 4  # values of a swept number, more of which are no few


def side_by_side(results: Results, found: Sequence[Range]) -> TextTable | None:
    """Those of some ranges that change, for each value of the number with few that changes results most, with where in
    the rest of the sweep they are; None where no number has few values beside one with more, or a direction."""
    results = speaking(results)
    axis = _few(results)
    wanted = [(one.name, one.sensor) for one in found if not one.is_constant]
    if axis is None or not wanted:
        return None
    order = np.argsort(-axis.values if axis.sets(DIRECTION) else axis.values)
    columns = [{(one.name, one.sensor): one for one in in_tables(_part(results, axis, n))} for n in order]
    headings = ("result", *(axis.value(n) if axis.sets(DIRECTION) else axis.at(n) for n in order))
    rows = [(" ".join(own).strip(), *(_cell(column.get(own), axis) for column in columns)) for own in wanted]
    return TextTable(_title(results, axis, [name for name, _ in wanted]), headings, rows)


def _few(results: Results) -> Axis | None:
    """The swept number whose few values stand side by side; None where there is none."""
    axes = [axis for axis in results.axes if axis.values.size > 1]
    if not (axes and results.study.output.keeps_variants and is_marched(results.dataset)) or VARIANT in results.dims:
        return None
    most = max(axis.values.size for axis in axes)
    few = [axis for axis in axes if axis.values.size <= MOST_COLUMNS and axis.values.size < most]
    ways = [axis for axis in axes if axis.sets(DIRECTION)]
    return max(ways or few, key=lambda axis: np.mean(list(_changes(results, axis))), default=None)


def _changes(results: Results, axis: Axis) -> Iterator[float]:
    """By how much every result changes along a swept number in the mean, over its largest size."""
    for _, _, array in single_numbers(results.dataset):
        known = array.where(results.kept)
        size = float(np.abs(known).max())
        if size > 0.0:
            yield float((known.max(axis.dim) - known.min(axis.dim)).mean()) / size


def _part(results: Results, axis: Axis, entry: int) -> Results:
    """The results at one value of a swept number."""
    return Results(results.dataset.isel({axis.dim: slice(entry, entry + 1)}), results.study, results.models)


def _cell(found: Range | None, axis: Axis) -> str:
    """The end that is looked for, and where it is; "" where no variant has one."""
    if found is None:
        return ""
    low, high, telling = map(found.value, (found.smallest.value, found.largest.value, found.telling.value))
    return telling if low == high else f"{telling}{_elsewhere(found.telling, axis)}"


def _elsewhere(end: Extreme, axis: Axis) -> str:
    """Where in the rest of the sweep an end is, by the numbers alone; "" where there is no rest."""
    words = [words for name, words in end.words.items() if name != axis.name]
    if not words or end.alike[0] > MOST_TIED:
        return f" {end.where}" * bool(words)
    return f" at {', '.join(words)}{f' and {end.alike[0] - 1} more' * (end.alike[0] > 1)}"


def _title(results: Results, axis: Axis, names: Sequence[str]) -> str:
    """Which end of a result is looked for, and which numbers tell where it is."""
    smallest = ["of what ends in _min the smallest"] * any(name.endswith("_min") for name in names)
    shortest = ["of move and settling the shortest"] * any(name.endswith(MOVE_AND_SETTLE) for name in names)
    beside = f" ({', '.join([*smallest, *shortest])})" if smallest or shortest else ""
    rest = [other.noun for other in results.axes if other is not axis and other.values.size > 1]
    return f"Largest for each {axis.noun}{beside}{f', and at which {listed(rest)}' if rest else ''}"
