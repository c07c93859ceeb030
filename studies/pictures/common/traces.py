"""Histories of selected variants, as several kinds of study draw them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from results_schema.arrays import Array
from studies.findings.theory import first_omega
from studies.results.formatting import number, quantity
from studies.results.places import Index
from studies.results.results import Results

PER_PERIOD = 6  # instants: fewer draw another vibration than there is
LARGE = 0.1  # of the whole range of a reading: swings below say nothing of how fast it swings
STILL = 1e-9  # of its place: what a carriage at rest is off by rounding


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


def since_rest(results: Results, sensor: str, index: Index) -> tuple[Array, Array]:
    """Seconds (T,) since the last carriage has come to rest or left, and the readings (T,) of a sensor then."""
    trace = results.trace(sensor, index)
    recorded = np.isfinite(trace.times)
    ways = [results.trace(f"{name}_position", index).values[recorded] for name in results.study.carriage]
    moving = [~np.isclose(way, way[-1], rtol=STILL, atol=STILL, equal_nan=True) for way in ways]
    first = int(np.flatnonzero(np.any(moving, axis=0)).max(initial=-1)) + 1
    times, values = trace.times[recorded][first:], trace.values[recorded][first:]
    return times - times[0], values


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


def per_period(values: Array) -> float:
    """How many instants a period of a reading (T,) has, in the mean of its large swings; infinite without two of them.

    >>> round(per_period(np.cos(2.0 * np.pi * np.arange(60) / 3.5)), 1), per_period(np.arange(9.0))
    (3.5, inf)
    """
    steps = np.diff(values)
    ends = 1 + np.flatnonzero(steps[1:] * steps[:-1] < 0.0)
    large = np.abs(np.diff(values[ends])) > LARGE * np.ptp(values)
    if np.count_nonzero(large) < 2:
        return np.inf
    return 2.0 * float(np.diff(ends)[large].mean())


def coarse(results: Results, times: Array) -> str:
    """That instants (T,) are too few to draw the first vibration of the body by; "" where they are enough."""
    each = (times.size - 1) / float(times[-1] - times[0])
    first = float(np.max(first_omega(results))) / (2.0 * np.pi)
    if each >= PER_PERIOD * first:
        return ""
    return (
        f" {number(each)} instants a second are kept: vibration above {quantity(each / PER_PERIOD, 'Hz')} is not drawn "
        f"as it is, and the first frequency of the body is {quantity(first, 'Hz')}; [output] histories = "
        '"all" keeps every step.'
    )
