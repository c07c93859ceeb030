"""Chunks that finish shortly after each other share a part on the disk: a part costs as much time as a small chunk."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

from results_schema.errors import OutputFailed
from results_schema.store.parts import Rows

SECONDS_PER_PART = 0.5
BYTES_PER_PART = 32 * 2**20

Write = Callable[[np.ndarray, Mapping[str, np.ndarray], Rows | None], object]


class Gatherer:
    """Takes finished chunks and writes them, joined, about twice a second; the last ones when the block ends.

    A process that is killed loses no more than the chunks of the last half second.
    """

    def __init__(self, write: Write) -> None:
        self._write = write
        self._chunks: list[tuple[Rows, Rows | None]] = []
        self._bytes = 0
        self._started = time.monotonic()

    def __enter__(self) -> Gatherer:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # Work that is finished is kept, whatever stopped the rest; a failed write would only fail again.
        if kind is None or not issubclass(kind, OutputFailed | MemoryError):
            self.flush()

    def add(self, variants: np.ndarray, arrays: Mapping[str, np.ndarray], selected: Rows | None) -> None:
        """Take one chunk; as the sink of `engine.batch.execution.execute`."""
        self._chunks.append((Rows(variants, arrays), selected))
        self._bytes += sum(array.nbytes for array in arrays.values())
        if time.monotonic() - self._started >= SECONDS_PER_PART or self._bytes >= BYTES_PER_PART:
            self.flush()

    def flush(self) -> None:
        """Write what has gathered."""
        chunks, self._chunks, self._bytes = self._chunks, [], 0
        if chunks:
            rows = _joined([rows for rows, _ in chunks])
            kept = [selected for _, selected in chunks if selected is not None and len(selected.variants)]
            self._write(rows.variants, rows.arrays, _joined(kept) if kept else None)
        self._started = time.monotonic()


def _joined(parts: list[Rows]) -> Rows:
    variants = np.concatenate([rows.variants for rows in parts])
    return Rows(variants, {name: np.concatenate([rows.arrays[name] for rows in parts]) for name in parts[0].arrays})
