"""Places in a sweep: that of an extreme, and some that are evenly spread."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr

Index = tuple[int, ...]


def extreme(values: xr.DataArray | Array, by: Any = np.nanargmax) -> Index | None:
    """Place of the largest value (or of that which `by` picks); None where there are only NaN.

    >>> extreme(np.array([[1.0, np.nan], [3.0, 2.0]]))
    (1, 0)
    """
    array = np.asarray(values, dtype=np.float64)
    if np.isnan(array).all():
        return None
    return tuple(int(i) for i in np.unravel_index(int(by(array)), array.shape)) if array.ndim else ()


def both_ends(values: xr.DataArray | Array) -> tuple[Index, Index] | None:
    """Places of the smallest and of the largest value; None where there are only NaN."""
    low, high = extreme(values, np.nanargmin), extreme(values)
    return None if low is None or high is None else (low, high)


def spread(count: int, most: int) -> list[int]:
    """At most `most` of `count` places, evenly spread, with both ends.

    >>> spread(10, 4), spread(2, 4)
    ([0, 3, 6, 9], [0, 1])
    """
    if count <= most:
        return list(range(count))
    return sorted({math.floor(0.5 + i * (count - 1) / (most - 1)) for i in range(most)}) if most > 1 else [count // 2]


def chosen(items: Sequence[Any], most: int) -> Iterator[Any]:
    """At most `most` of the items, evenly spread."""
    return (items[i] for i in spread(len(items), most))
