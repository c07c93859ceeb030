"""Arrays of numbers that stay on the disk until they are asked for, so that datasets may be larger than memory.

xarray carries them as it carries those of files that it opens itself: to select or to rename reads nothing.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing

from results_schema.blocks import APART

RECENT_BYTES = 2**27  # of the array that was read last, which is likely to be asked for again

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
        whole = (first, end) == (0, self.shape[0]) and not self._is_column(key) and self.nbytes <= RECENT_BYTES
        if _RECENT.array is self or whole:
            return np.asarray(_RECENT.whole(self)[key])
        found = self.read(slice(first, max(first, end)), key[1:])
        return np.asarray(found[::step] if isinstance(key[0], slice) else found[0])

    def _is_column(self, key: tuple[int | slice, ...]) -> bool:
        """Whether one of a few numbers of each variant is asked for: they lie apart."""
        return len(self.shape) > 1 and self.shape[-1] <= APART and not isinstance(key[-1], slice)

    @property
    def nbytes(self) -> int:
        """Bytes of all of it."""
        return math.prod(self.shape) * self.dtype.itemsize


class _Recent:
    """The array that was read last as a whole."""

    def __init__(self) -> None:
        self.array: OnDisk | None = None
        self._numbers = np.empty(0)

    def whole(self, array: OnDisk) -> np.ndarray:
        """An array, not to be changed, from memory where it is there."""
        if self.array is not array:
            self.array, self._numbers = None, np.empty(0)  # first: both together would be too much
            self._numbers = array.read(slice(0, array.shape[0]), ())
            self._numbers.flags.writeable = False
            self.array = array
        return self._numbers


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
