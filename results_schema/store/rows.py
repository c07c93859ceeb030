"""Results of some variants, as chunks of a march give them: as a part of a run, and put together again."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from results_schema.store.tables import Table, from_arrays

Arrays = dict[str, np.ndarray]

VARIANTS = "variants"
_SELECTED = "/selected"


class Rows(NamedTuple):
    """Results of some variants: `variants` (n,) int64, and arrays (n, ...) by name."""

    variants: np.ndarray
    arrays: Mapping[str, np.ndarray]


class Chunk(NamedTuple):
    """Finished variants, and of a few of them more (histories)."""

    rows: Rows
    selected: Rows | None = None

    @property
    def name(self) -> str:
        """The name of the chunk as a part of a run: one of its own for these variants in this order."""
        return hashlib.sha1(self.rows.variants.tobytes()).hexdigest()

    @property
    def tables(self) -> dict[str, Table]:
        """The chunk as a part of a run. Raises ValueError when arrays do not fit the variants."""
        kept = self.selected is not None and len(self.selected.variants) > 0
        return {"/": _table(self.rows)} | ({_SELECTED: _table(self.selected)} if self.selected and kept else {})

    @classmethod
    def of(cls, tables: Mapping[str, Table]) -> Chunk:
        """The chunk that a part of a run is."""
        return cls(_rows(tables["/"]), _rows(tables[_SELECTED]) if _SELECTED in tables else None)


def joined(parts: Sequence[Rows]) -> Rows | None:
    """Rows of different variants as one, ascending; None of none. All must have the same arrays; shorter histories are
    filled up with NaN."""
    if not parts:
        return None
    variants, order = np.unique(np.concatenate([part.variants for part in parts]), return_index=True)
    names = parts[0].arrays
    return Rows(variants, {name: _stacked([part.arrays[name] for part in parts])[order] for name in names})


class Collector:
    """Chunks put together: `arrays` (V, ...) by name, and the rows of a few variants.

    size: V. finished: (V,) which variants have come.
    """

    def __init__(self, size: int) -> None:
        self.arrays: Arrays = {}
        self.finished = np.zeros(size, bool)
        self._selected: list[Rows] = []

    def add(self, chunk: Chunk) -> None:
        """Take one chunk."""
        rows, selected = chunk
        for name, array in rows.arrays.items():
            if name not in self.arrays:
                self.arrays[name] = np.zeros((self.finished.size, *array.shape[1:]), array.dtype)
            self.arrays[name][rows.variants] = array
        self.finished[rows.variants] = True
        self.select(selected)

    def select(self, rows: Rows | None) -> None:
        """Take rows of a few variants more."""
        self._selected += [] if rows is None else [rows]

    @property
    def selected(self) -> Rows | None:
        """The rows of a few, ascending by variant."""
        return joined(self._selected)


def _stacked(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays (n, ...) one after another, those with shorter rows filled up with NaN."""
    longest = max((array.shape[1] for array in arrays if array.ndim > 1), default=0)
    if all(array.ndim < 2 or array.shape[1] == longest for array in arrays):
        return np.concatenate(arrays)
    return np.concatenate([np.pad(a, ((0, 0), (0, longest - a.shape[1])), constant_values=np.nan) for a in arrays])


def _table(rows: Rows) -> Table:
    variants = np.ascontiguousarray(rows.variants, np.int64)
    if variants.ndim != 1 or variants.size == 0 or variants.min() < 0:
        raise ValueError(f"variants: expected (n > 0,) numbers >= 0, received shape {variants.shape}")
    if VARIANTS in rows.arrays:
        raise ValueError(f"an array is called {VARIANTS!r}, the name of the numbers of the variants")
    arrays = {VARIANTS: variants, **rows.arrays}
    for name, array in arrays.items():
        if array.shape[:1] != variants.shape or array.size == 0 or array.dtype.kind not in "iuf":
            raise ValueError(f"{name}: expected numbers ({variants.size}, ...), received {array.dtype} {array.shape}")
    return from_arrays(arrays)


def _rows(table: Table) -> Rows:
    arrays = {name: column.data for name, column in table.columns.items()}
    return Rows(arrays.pop(VARIANTS), arrays)
