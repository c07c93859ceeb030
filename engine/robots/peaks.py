"""The largest values of what is known at steps, and what may be missed between these."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from results_schema.arrays import Array, Counts, Mask

if TYPE_CHECKING:
    from engine.kernels.robots.layout import Stretch


class Steps(NamedTuple):
    """All T steps of a march: times (T,), s; stretch (T,) that each belongs to; station (T,) up to which it has come,
    with its part of the way to the next one."""

    times: Array
    stretch: Counts
    station: Array

    @classmethod
    def of(cls, cut: Stretch) -> Steps:
        """Those of stretches of time, with the first and the last of each."""
        count, stations = cut.steps + 1, cut.steps // cut.every + 1
        stretch = np.repeat(np.arange(count.size), count)
        number = np.arange(stretch.size) - np.repeat(np.cumsum(count) - count, count)
        first = np.cumsum(stations) - stations
        return cls(cut.start[stretch] + number * cut.step[stretch], stretch, first[stretch] + number / cut.every)

    def between_stations(self, values: Array) -> Array:
        """(T, ...) of values at stations (S, ...), straight from one to the next."""
        before = self.station.astype(np.int64)
        part = (self.station - before).reshape(-1, *[1] * (values.ndim - 1))
        return values[before] * (1.0 - part) + values[np.minimum(before + 1, len(values) - 1)] * part


class Peaks(NamedTuple):
    """Largest values (...), NaN where there are none, and by how much the true ones may be larger."""

    value: Array
    missed: Array


def peaks(values: Array, stretch: Counts, among: Mask | None = None) -> Peaks:
    """The largest of values (T, ...) at equal steps of each stretch (T,), or of those ``among`` them: that of a
    parabola through three of them, of which the middle one is the largest.

    What that adds to the largest step is told as missed; where others than these begin or end within a stretch, what
    the value beyond is larger, since the change is somewhere between.

    >>> t = np.linspace(0.0, 3.0, 8)
    >>> found = peaks(np.sin(t), np.zeros(8, dtype=int))
    >>> round(float(np.sin(t).max()), 4), round(float(found.value), 4), round(float(found.missed), 4)
    (0.9897, 0.9996, 0.0099)
    """
    own = np.ones(values.shape, dtype=np.bool_) if among is None else among
    most = np.max(np.where(own, values, -np.inf), axis=0)
    low, top, high = values[:-2], values[1:-1], values[2:]
    inside = own[:-2] & own[1:-1] & own[2:] & _along(stretch[2:] == stretch[:-2], values)
    bent = 2.0 * top - low - high
    at_top = inside & (top >= low) & (top >= high) & (bent > 0.0)
    beside = np.divide((low - high) ** 2, 8.0 * bent, out=np.zeros(top.shape), where=at_top)
    value = np.maximum(most, np.max(np.where(at_top, top + beside, -np.inf), axis=0, initial=-np.inf))
    edges = (own[1:] != own[:-1]) & _along(stretch[1:] == stretch[:-1], values)
    beyond = np.max(np.where(edges, np.maximum(values[1:], values[:-1]), -np.inf), axis=0, initial=-np.inf)
    known = own.any(axis=0)
    missed = np.subtract(np.maximum(value, beyond), most, out=np.zeros(most.shape), where=known)
    return Peaks(np.where(known, value, np.nan), missed)


def _along(which: Mask, values: Array) -> Mask:
    """(T,) as wide as values."""
    return which.reshape(-1, *[1] * (values.ndim - 1))
