"""The choice of all variants of a scene. What one gets depends on its own numbers alone: rounded to a fixed lattice, so
that a million variants ask for a few thousand choices.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from engine.choice import Asked, Choice
from engine.lanes import LaneValues
from engine.model import SceneModel
from engine.options import CELL, Options

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

AT_ONCE = 4096  # variants that are looked at together


def choose(scene: SceneModel, values: LaneValues, asked: Asked) -> Choice:
    """The choice for some variants of a scene."""
    cells, inverse = _lattice(values)
    options = Options(scene, asked)
    with np.errstate(over="ignore", invalid="ignore"):  # infinitely slow variants
        parts = [options.choose(part) for part in _pieces(cells)]
    return Choice(*(np.concatenate(column) for column in zip(*parts, strict=True))).of(inverse)


class _Cells(LaneValues):
    """Numbers of variants on the lattice, swept or not: a variant is chosen for alike in any sweep."""

    def of(self, path: str) -> Array:
        """(V,) values at a dotted key."""
        return _rounded(super().of(path), path)


def _lattice(values: LaneValues) -> tuple[LaneValues, Counts]:
    """Variants with distinct numbers after rounding to a few per cent, and which of them every variant is."""
    code = np.zeros(values.size, dtype=np.int64)
    for path, column in values.columns.items():
        distinct, place = np.unique(_rounded(column, path), return_inverse=True)
        code = np.unique(code * distinct.size + place.reshape(-1), return_inverse=True)[1].reshape(-1)
    first, inverse = np.unique(code, return_index=True, return_inverse=True)[1:]
    return LaneValues(
        values.study, {path: column[first] for path, column in values.columns.items()}, first.size
    ), inverse


def _rounded(column: Array, path: str) -> Array:
    """A column on the lattice; tolerances and numbers of steps as they are."""
    if path.startswith("solver."):
        return column
    with np.errstate(divide="ignore"):
        cell = np.rint(np.log(np.abs(column)) / CELL)
    return np.asarray(np.where(column == 0.0, 0.0, np.sign(column) * np.exp(CELL * cell)))


def _pieces(values: LaneValues) -> Iterator[LaneValues]:
    """Variants a few at a time, their numbers on the lattice."""
    for first in range(0, values.size, AT_ONCE):
        part = slice(first, first + AT_ONCE)
        columns = {path: column[part] for path, column in values.columns.items()}
        yield _Cells(values.study, columns, min(AT_ONCE, values.size - first))
