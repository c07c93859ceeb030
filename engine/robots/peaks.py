"""The largest values of what is known at steps, and what may be missed between these."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.kernels.robots.peaks import largest
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
    """The largest of values (T, ...) at equal steps of each stretch (T,), or of the stretches ``among`` them: that of a
    parabola through three of them, of which the middle one is the largest. What that adds is told as missed.

    >>> t = np.linspace(0.0, 3.0, 8)
    >>> found = peaks(np.sin(t), np.zeros(8, dtype=int))
    >>> round(float(np.sin(t).max()), 4), round(float(found.value), 4), round(float(found.missed), 4)
    (0.9897, 0.9996, 0.0099)
    """
    shape, own = values.shape[1:], np.ones(values.shape, dtype=np.bool_) if among is None else among
    value, missed = np.empty(shape), np.empty(shape)
    columns = [np.ascontiguousarray(each.reshape(len(stretch), -1)) for each in (values, own)]
    largest(*columns, stretch, value.reshape(-1), missed.reshape(-1))
    return Peaks(value, missed)
