"""Where the finished parts of a run are kept: beside its archive, or in memory."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from typing import IO, Protocol

import numpy as np

from results_schema.store.rows import RowsOnDisk
from results_schema.store.tables import Table


class Store(Protocol):
    """Where finished parts are kept: `results_schema.store.parts.PartStore`, or memory."""

    def write(self, name: str, part: Mapping[str, Table]) -> object:
        """Keep one part."""

    def finished(self) -> dict[str, np.ndarray]:
        """The variants of every part by name, none in a piece."""

    def read(self, name: str) -> Mapping[str, Table]:
        """One part."""

    def scratch(self) -> IO[bytes]:
        """A file without a name, gone when it is closed, for what is too large for memory."""

    def rows(self, variants: int, size: int) -> RowsOnDisk | None:
        """Where to put the results of so many variants, of at most so many bytes; None: in memory."""


class Memory:
    """Parts of a run that writes no archive."""

    def __init__(self) -> None:
        self._parts: dict[str, Mapping[str, Table]] = {}

    def write(self, name: str, part: Mapping[str, Table]) -> None:
        """Keep one part."""
        self._parts[name] = part

    def finished(self) -> dict[str, np.ndarray]:
        """Which parts there are."""
        return dict.fromkeys(self._parts, np.empty(0, np.int64))

    def read(self, name: str) -> Mapping[str, Table]:
        """One part, which is handed over."""
        return self._parts.pop(name)

    def scratch(self) -> IO[bytes]:
        """A file without a name."""
        return tempfile.TemporaryFile()

    def rows(self, variants: int, size: int) -> RowsOnDisk | None:
        """In memory, where its dataset is to be."""
        return None
