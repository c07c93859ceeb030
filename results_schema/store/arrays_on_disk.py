"""Arrays of numbers that stay on the disk until they are asked for, so that datasets may be larger than memory.

xarray carries them as it carries those of files that it opens itself: to select or to rename reads nothing.
"""

import math
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing

from results_schema.blocks import APART

RECENT_BYTES = 2**28  # of what was read last, which is likely to be asked for again

Read = Callable[[slice, tuple[int | slice, ...]], np.ndarray]


class OnDisk(BackendArray):
    """Numbers (n, ...) that `read` gives: some of the n rows, at further places of the other axes."""

    def __init__(self, shape: tuple[int, ...], dtype: np.dtype[Any], read: Read) -> None:
        self.shape, self.dtype = shape, dtype
        self.read = read

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._part)

    def _part(self, key: tuple[int | slice, ...]) -> np.ndarray:
        """The numbers at some rows (a slice, or one) and further places."""
        rows = key[0] if isinstance(key[0], slice) else slice(key[0], key[0] + 1)
        first, end, step = rows.indices(self.shape[0])
        column = self._column(key)
        known = _RECENT.numbers(self, column, (first, end) == (0, self.shape[0]))
        if known is not None:
            return np.asarray(known[key if column is None else key[:-1]])
        found = self.read(slice(first, max(first, end)), key[1:])
        return np.asarray(found[::step] if isinstance(key[0], slice) else found[0])

    def _column(self, key: tuple[int | slice, ...]) -> int | None:
        """Which one of a few numbers of each variant is asked for, as they lie apart; None of all."""
        one = key[-1]
        return one if len(self.shape) > 1 and self.shape[-1] <= APART and not isinstance(one, slice) else None


class _Recent:
    """The arrays, and columns of a few numbers of each variant, that were read last as wholes."""

    def __init__(self) -> None:
        self._numbers: OrderedDict[tuple[OnDisk, int | None], np.ndarray] = OrderedDict()
        self._lock = threading.RLock()  # dask reads on several threads

    def numbers(self, array: OnDisk, column: int | None, is_asked_for: bool) -> np.ndarray | None:
        """An array or column, not to be changed, from memory; read where all of it is asked for and there would be
        room, else None."""
        key = array, column
        with self._lock:
            if key not in self._numbers:
                if not is_asked_for or _bytes(array, column) > RECENT_BYTES:
                    return None
                self._make_room(_bytes(array, column))
                rest: tuple[int | slice, ...] = (
                    () if column is None else (*[slice(None)] * (len(array.shape) - 2), column)
                )
                self._numbers[key] = numbers = array.read(slice(0, array.shape[0]), rest)
                numbers.flags.writeable = False
            self._numbers.move_to_end(key)
            return self._numbers[key]

    def _make_room(self, size: int) -> None:
        """Forget what was asked for longest ago, before more is read."""
        held = sum(numbers.nbytes for numbers in self._numbers.values())
        while self._numbers and held + size > RECENT_BYTES:
            held -= self._numbers.popitem(last=False)[1].nbytes


def _bytes(array: OnDisk, column: int | None) -> int:
    return math.prod(array.shape if column is None else array.shape[:-1]) * array.dtype.itemsize


_RECENT = _Recent()


def on_disk(shape: tuple[int, ...], dtype: np.dtype[Any], read: Read) -> indexing.LazilyIndexedArray:
    """The same for a dataset, which reads what it is asked for and keeps nothing.

    >>> import xarray as xr
    >>> numbers = np.arange(6.0).reshape(3, 2)
    >>> array = xr.DataArray(on_disk((3, 2), numbers.dtype, lambda rows, at: numbers[rows, *at]), dims=("x", "y"))
    >>> array.isel(x=1).values.tolist(), float(array.sum())
    ([2.0, 3.0], 15.0)
    """
    return indexing.LazilyIndexedArray(OnDisk(shape, dtype, read))
