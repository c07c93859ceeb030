"""Arrays of numbers that stay on the disk until they are asked for, so that datasets may be larger than memory.

xarray carries them as it carries those of files that it opens itself: to select or to rename reads nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing

RECENT_BYTES = 2**28  # of arrays that were read last and are likely to be asked for again

Read = Callable[[int, int], np.ndarray]


class OnDisk(BackendArray):
    """Numbers (n, ...) that `read` gives from one of the n rows to before another."""

    def __init__(self, shape: tuple[int, ...], dtype: np.dtype[Any], read: Read) -> None:
        self.shape, self.dtype = shape, dtype
        self._read = read

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._part)

    def _part(self, key: tuple[int | slice, ...]) -> np.ndarray:
        """The numbers at some rows (a slice, or one) and further places."""
        if 2 * self.size * self.dtype.itemsize <= RECENT_BYTES:
            return np.asarray(_RECENT.whole(self)[key])
        if not isinstance(key[0], slice):
            return np.asarray(self._read(key[0], key[0] + 1)[(0, *key[1:])])
        first, end, step = key[0].indices(self.shape[0])
        return np.asarray(self._read(first, max(first, end))[(slice(None, None, step), *key[1:])])

    def whole(self) -> np.ndarray:
        """All of it, not to be changed."""
        found = self._read(0, self.shape[0])
        found.flags.writeable = False
        return found


class _Recent:
    """What was read last."""

    def __init__(self) -> None:
        self._read: list[tuple[OnDisk, np.ndarray]] = []  # the last one last

    def whole(self, array: OnDisk) -> np.ndarray:
        """An array as a whole, from memory where it is there."""
        held = [pair for pair in self._read if pair[0] is not array]
        found = next((own for one, own in self._read if one is array), None)
        # What is let go comes first: both together would be too much.
        while held and sum(own.nbytes for _, own in held) + array.size * array.dtype.itemsize > RECENT_BYTES:
            held.pop(0)
        self._read = held
        whole = array.whole() if found is None else found
        self._read = [*held, (array, whole)]
        return whole


_RECENT = _Recent()


def on_disk(shape: tuple[int, ...], dtype: np.dtype[Any], read: Read) -> indexing.LazilyIndexedArray:
    """The same for a dataset, which reads what it is asked for and keeps nothing.

    >>> import xarray as xr
    >>> numbers = np.arange(6.0).reshape(3, 2)
    >>> array = xr.DataArray(on_disk((3, 2), numbers.dtype, lambda first, end: numbers[first:end]), dims=("x", "y"))
    >>> array.isel(x=1).values.tolist(), float(array.sum())
    ([2.0, 3.0], 15.0)
    """
    return indexing.LazilyIndexedArray(OnDisk(shape, dtype, read))
