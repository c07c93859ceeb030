"""Which stations of a run are sampled: for a study's reduction, and for the histories that are kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from results_schema.arrays import Counts

if TYPE_CHECKING:
    from engine.model.timeline import Segment, Timeline, Window
    from engine.scene.settings import Every

CYCLE_STATIONS = 200  # of a kept history over the last cycle
WHOLE_STATIONS = 401  # of a kept history over a whole run
REST_STATIONS = 1201  # more over its rest, where it is told how far sensors swing on: 150 periods of some 8 each


def counts_shown(timeline: Timeline, window: Window, wanted: Literal["auto", "none", "all"] | Every) -> Counts:
    """Stations of the kept histories by their count, ascending and distinct.

    Over a cycle phase 0 is in and phase 1 is not; over a whole run both ends are.
    """
    first, last = timeline.window
    if wanted == "none":
        return np.zeros(0, dtype=np.int64)
    if not isinstance(wanted, str):
        return np.arange(first, last + 1, wanted.every)
    if wanted == "all":
        return np.arange(first, last + 1)
    if window == "last-cycle":
        steps = last - first
        return np.unique(first + np.rint(np.arange(CYCLE_STATIONS) * (steps / CYCLE_STATIONS)).astype(np.int64))
    return np.unique(np.rint(np.linspace(first, last, WHOLE_STATIONS)).astype(np.int64))


def counts_at_rest(timeline: Timeline, most: int = REST_STATIONS) -> Counts:
    """Stations by their count over the end of a run, from where all carriages rest; at most so many."""
    first, last = min(segment.first for segment in timeline.segments if segment.rests), timeline.window[1]
    return np.unique(np.rint(np.linspace(first, last, most)).astype(np.int64))


def counts_reduced(timeline: Timeline, stations: int) -> Counts:
    """Equidistant stations of the last cycle from its beginning to its end, at least ``stations`` besides the last
    where there are so many.

    Every 2^j-th step, so that out and back meet at equal places; times an odd number where that leaves too many.
    """
    first, last = timeline.window
    steps, stride = last - first, 1
    while steps % (4 * stride) == 0 and steps // (2 * stride) >= stations:
        stride *= 2
    if steps // stride >= 2 * stations:
        odd = np.arange(1, steps // (stride * stations) + 1, 2)
        stride *= int(odd[steps % (stride * odd) == 0].max())
    return np.arange(first, last + 1, stride)


def rows_sampled(segment: Segment, counts: Counts) -> Counts:
    """(stations,) the row of a history that each station of a segment fills, or -1."""
    found = np.full(segment.steps + 1, -1, dtype=np.int64)
    low, high = np.searchsorted(counts, [segment.first, segment.first + segment.steps + 1])
    found[counts[low:high] - segment.first] = np.arange(low, high)
    return found
