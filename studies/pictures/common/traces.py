"""Histories of selected variants, as several kinds of study draw them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from results_schema.arrays import Array
from studies.results.places import Index
from studies.results.results import Results


class Way(NamedTuple):
    """Values (T,) over the positions (T,) of the first carriage, in the order of time."""

    position: Array
    values: Array


def picked(results: Results, rank: Array | None, most: int) -> list[Index]:
    """At most `most` variants with a history: the one of largest rank (in the sweep's shape), before it others spread
    evenly below."""
    traced = results.traced()
    if rank is not None:
        traced = sorted((index for index in traced if np.isfinite(rank[index])), key=lambda index: float(rank[index]))
    if len(traced) <= most:
        return traced
    return [traced[round((i + 1) * (len(traced) - 1) / most)] for i in range(most)]


def over_way(results: Results, sensor: str, index: Index) -> Way:
    """The history of a sensor over the way of the first carriage, which goes on at the last speed when it has left."""
    trace = results.trace(sensor, index)
    position = results.trace(f"{results.carriage_name}_position", index).values
    on = np.flatnonzero(np.isfinite(position))
    if on.size > 1 and trace.elapsed is not None:
        first, last = on[-2], on[-1]
        speed = (position[last] - position[first]) / (trace.times[last] - trace.times[first])
        gone = np.isnan(position) & (np.arange(position.size) > last)
        position = np.where(gone, position[last] + speed * (trace.times - trace.times[last]), position)
    kept = np.isfinite(trace.values) & np.isfinite(position)
    return Way(position[kept], trace.values[kept])


def over_position(results: Results, sensor: str, index: Index) -> Way:
    """The history of a sensor over the first carriage's position, without what was not recorded."""
    values = results.trace(sensor, index).values
    position = results.trace(f"{results.carriage_name}_position", index).values
    kept = np.isfinite(values) & np.isfinite(position)
    return Way(position[kept], values[kept])


def there_and_back(way: Way) -> tuple[Way, Way]:
    """A cycle that begins at the start, as the way out and the way back, each from its first to its last place."""
    turn = int(np.argmax(np.abs(way.position - way.position[0])))
    out = Way(way.position[: turn + 1], way.values[: turn + 1])
    back = Way(np.append(way.position[turn:], way.position[0]), np.append(way.values[turn:], way.values[0]))
    return out, back


def odd_part(out: Way, back: Way) -> Way:
    """Half the difference of out and back at the places of the way out."""
    order = np.argsort(back.position)
    returned = np.interp(out.position, back.position[order], back.values[order])
    return Way(out.position, 0.5 * (out.values - returned))
