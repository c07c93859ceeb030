"""Results of some variants, as chunks of a march give them: as a part of a run, and put together again."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from results_schema.blocks import APART, BLOCK_BYTES, slices
from results_schema.errors import OutputFailed
from results_schema.store import files
from results_schema.store.tables import Table, from_arrays

Arrays = dict[str, np.ndarray]

VARIANTS = "variants"
_SELECTED = "/selected"
_NAMES, _PLACES, _COLUMN = "names", "places", "column"  # of arrays: the number of their column, and which of it
SECONDS_PER_PART, BYTES_PER_PART = 0.5, 32 * 2**20  # of chunks that share one


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
    parts = sorted(parts, key=lambda part: part.variants[:1].tolist())
    variants, names = np.concatenate([part.variants for part in parts]), parts[0].arrays
    arrays = {name: _stacked([part.arrays[name] for part in parts]) for name in names}
    if np.all(np.diff(variants) > 0):
        return Rows(variants, arrays)
    variants, order = np.unique(variants, return_index=True)
    return Rows(variants, {name: array[order] for name, array in arrays.items()})


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


class Gatherer:
    """Takes finished chunks and writes them, joined, about twice a second (a part costs as much time as a small chunk);
    the last ones when the block ends. A process that is killed loses no more than the chunks of the last half second.
    """

    def __init__(self, write: Callable[[Chunk], object]) -> None:
        self._write = write
        self._chunks: list[Chunk] = []
        self._bytes, self._started = 0, time.monotonic()

    def __enter__(self) -> Gatherer:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # Work that is finished is kept, whatever stopped the rest; a failed write would only fail again.
        if kind is None or not issubclass(kind, OutputFailed | MemoryError):
            self.flush()

    def add(self, chunk: Chunk) -> None:
        """Take one chunk; as the sink of `engine.batch.execution.execute`."""
        self._chunks.append(chunk)
        self._bytes += sum(array.nbytes for array in chunk.rows.arrays.values())
        if time.monotonic() - self._started >= SECONDS_PER_PART or self._bytes >= BYTES_PER_PART:
            self.flush()

    def flush(self) -> None:
        """Write what has gathered."""
        chunks, self._chunks, self._bytes = self._chunks, [], 0
        rows = joined([chunk.rows for chunk in chunks])
        if rows is not None:
            self._write(Chunk(rows, joined([chunk.selected for chunk in chunks if chunk.selected is not None])))
        self._started = time.monotonic()


class RowsOnDisk:
    """Rows of all variants, taken as they come and read again by name in the order of the variants.

    The file, without a name in a folder, holds blocks of neighbouring variants; in each, one array after another with
    the rows as they came; a few numbers of each variant lie apart, as they are asked for.
    """

    def __init__(self, file: IO[bytes], folder: Path, size: int) -> None:
        self.finished = np.zeros(size, bool)
        self._file, self._folder, self._size = file, folder, size
        self._kinds: dict[str, tuple[np.dtype[Any], tuple[int, ...]]] = {}
        self._starts: dict[str, int] = {}  # bytes of a variant before those of an array
        self._bytes, self._block = 0, 0  # of a variant; variants of a block
        self._came: list[list[np.ndarray]] = []

    def add(self, rows: Rows) -> None:
        """Take the rows of variants that have not come yet, always with the same arrays. Raises OutputFailed."""
        if not self._kinds:
            self._lay_out(rows)
        assert not self.finished[rows.variants].any(), "a variant comes twice"
        self.finished[rows.variants] = True
        try:
            files.FAULTS.before("write", self._folder)
            self._write(rows)
        except OSError as error:
            raise files.output_failed(self._folder, error) from error

    def _write(self, rows: Rows) -> None:
        blocks = rows.variants // self._block
        for block in np.unique(blocks):
            own = np.flatnonzero(blocks == block)
            held = sum(came.size for came in self._came[block])
            for name in self._kinds:
                for number, column in enumerate(self._columns(name, rows.arrays[name][own])):
                    self._file.seek(self._place(name, block, number, held))
                    self._file.write(np.ascontiguousarray(column).data)
            self._came[block].append((rows.variants[own] - block * self._block).astype(np.int32))
        self._file.flush()

    def _lay_out(self, rows: Rows) -> None:
        for name, array in rows.arrays.items():
            self._kinds[name], self._starts[name] = (array.dtype, array.shape[1:]), self._bytes
            self._bytes += self._bytes_of(name)
        self._block = max(1, 2 * BLOCK_BYTES // self._bytes)
        self._came = [[] for _ in range(0, self._size, self._block)]

    def _columns(self, name: str, array: np.ndarray) -> Sequence[np.ndarray]:
        """An array of rows as it lies in a block."""
        return list(array.T) if self._lies_apart(name) else [array]

    def _lies_apart(self, name: str) -> bool:
        _, shape = self._kinds[name]
        return len(shape) == 1 and shape[0] <= APART

    def _bytes_of(self, name: str) -> int:
        """Bytes of a variant in an array."""
        dtype, shape = self._kinds[name]
        return dtype.itemsize * math.prod(shape)

    def _place(self, name: str, block: int, column: int, row: int) -> int:
        """Where in the file a row of a block is, of one column where these lie apart."""
        variants = min(self._block, self._size - block * self._block)
        start = block * self._block * self._bytes + variants * self._starts[name]
        if not self._lies_apart(name):
            return start + row * self._bytes_of(name)
        return start + (column * variants + row) * self._kinds[name][0].itemsize

    def read(self, name: str, first: int, end: int, columns: Sequence[int] | None = None) -> np.ndarray:
        """(end - first, ...) an array from one variant to before another; of a few numbers of each those at `columns`
        alone."""
        dtype, shape = self._kinds[name]
        if self._lies_apart(name):
            chosen = range(*shape) if columns is None else columns
            found = np.empty((len(chosen), end - first), dtype)
            for row, column in zip(found, chosen, strict=True):
                self._fill(row, name, first, column)
            return found.T
        found = np.empty((end - first, *shape), dtype)
        self._fill(found, name, first, 0)
        return found

    def _fill(self, found: np.ndarray, name: str, first: int, column: int) -> None:
        """Read what lies together into an array of rows from one variant on."""
        end = first + len(found)
        for block in range(first // self._block, -(-end // self._block)):
            places = np.concatenate(self._came[block]) + (block * self._block - first)
            self._file.seek(self._place(name, block, column, 0))
            size = places.size * found[:1].nbytes
            rows = np.frombuffer(self._file.read(size), found.dtype).reshape(-1, *found.shape[1:])
            if places.min() < 0 or places.max() >= len(found):
                inside = (places >= 0) & (places < len(found))
                places, rows = places[inside], rows[inside]
            found[places] = rows

    def array(self, name: str, shape: tuple[int, ...]) -> Any:
        """An array of a dataset over the grid of all variants, `shape`, that is read when it is asked for."""
        from results_schema.store.arrays_on_disk import on_disk

        dtype, rest = self._kinds[name]
        return on_disk((*shape, *rest), dtype, partial(self._over_grid, name, shape))

    def _over_grid(self, name: str, shape: tuple[int, ...], rows: slice, at: tuple[int | slice, ...]) -> np.ndarray:
        dtype, rest = self._kinds[name]
        columns: Sequence[int] | None = None
        if self._lies_apart(name) and len(at) == len(shape):  # what is wanted of the last axis
            columns = np.atleast_1d(np.arange(*rest)[at[-1]]).tolist()
            at = (*at[:-1], slice(None) if isinstance(at[-1], slice) else 0)
            rest = (len(columns),)
        inner, each = (*shape[1:], *rest), math.prod(shape[1:])
        found = np.empty((rows.stop - rows.start, *np.empty(inner, np.int8)[at].shape), dtype)
        for block in slices((len(found), *inner), dtype.itemsize):
            part = self.read(name, (rows.start + block.start) * each, (rows.start + block.stop) * each, columns)
            found[block] = part.reshape(-1, *inner)[(slice(None), *at)]
        return found


def _stacked(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays (n, ...) one after another, those with shorter rows filled up with NaN."""
    longest = max((array.shape[1] for array in arrays if array.ndim > 1), default=0)
    if all(array.ndim < 2 or array.shape[1] == longest for array in arrays):
        return np.concatenate(arrays)
    return np.concatenate([np.pad(a, ((0, 0), (0, longest - a.shape[1])), constant_values=np.nan) for a in arrays])


def _table(rows: Rows) -> Table:
    """Rows as a table: arrays of a type and shape in one column. One more column takes as long as some thirty thousand
    numbers, and a train of 24 axles has 200 results."""
    variants = np.ascontiguousarray(rows.variants, np.int64)
    if variants.ndim != 1 or variants.size == 0 or variants.min() < 0:
        raise ValueError(f"variants: expected (n > 0,) numbers >= 0, received shape {variants.shape}")
    alike: dict[tuple[np.dtype[Any], tuple[int, ...]], list[str]] = {}
    for name, array in rows.arrays.items():
        if array.shape[:1] != variants.shape or array.size == 0 or array.dtype.kind not in "iuf":
            raise ValueError(f"{name}: expected numbers ({variants.size}, ...), received {array.dtype} {array.shape}")
        alike.setdefault((array.dtype, array.shape), []).append(name)
    columns = {f"{_COLUMN}{n}": np.stack([rows.arrays[one] for one in names]) for n, names in enumerate(alike.values())}
    places = {one: (n, k) for n, names in enumerate(alike.values()) for k, one in enumerate(names)}
    named = {_NAMES: np.array(list(rows.arrays), dtype=object), _PLACES: np.array([places[one] for one in rows.arrays])}
    return from_arrays({VARIANTS: variants, **(named if columns else {}), **columns})


def _rows(table: Table) -> Rows:
    columns = {name: column.data for name, column in table.columns.items()}
    found = zip(columns.get(_NAMES, ()), columns.get(_PLACES, ()), strict=True)
    return Rows(columns[VARIANTS], {name: columns[f"{_COLUMN}{n}"][k] for name, (n, k) in found})
