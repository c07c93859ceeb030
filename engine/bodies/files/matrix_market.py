"""Matrix Market text: real matrices in coordinate or array format, whole or one triangle of a symmetric one.

Read here and not by scipy, whose reader takes the whole program down on some damaged files.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from engine.bodies.files.model import MAX_FREEDOMS
from engine.bodies.files.text import Line, real, whole
from results_schema.errors import BadInput

_FORMS = {"coordinate": 3, "array": 1}


def from_market(lines: list[Line]) -> Any:
    """The sparse matrix of a file. Raises BadInput with its line."""
    form, symmetric = _head(lines[0])
    rest = [line for line in lines[1:] if line.text.strip() and not line.text.lstrip().startswith("%")]
    if not rest:
        raise lines[-1].fault("the file is truncated", expected="the sizes of the matrix")
    shape, count = _sizes(rest[0], form, symmetric)
    if len(rest) - 1 != count:
        what = "the file is truncated" if len(rest) - 1 < count else "more entries than the file announces"
        raise rest[-1].fault(what, expected=f"{count} entries", received=str(len(rest) - 1))
    values = _numbers(rest[1:], _FORMS[form])
    if form == "array":
        rows, columns = _array_places(shape, symmetric)
        return _assembled(rows, columns, values[:, 0], shape, symmetric)
    rows, columns = _places(rest[1:], values, shape, symmetric)
    return _assembled(rows, columns, values[:, 2], shape, symmetric)


def _head(line: Line) -> tuple[str, bool]:
    words = line.text.lower().split()
    if words[:2] != ["%%matrixmarket", "matrix"]:
        what, expected = "no Matrix Market file", "%%MatrixMarket matrix ..., or a sparse matrix of scipy as .npz"
        raise line.fault(what, expected=expected, received=line.text)
    if len(words) != 5 or words[2] not in _FORMS or words[3] not in ("real", "double", "integer"):
        raise line.fault("not a matrix of real numbers", expected="coordinate or array, real or integer")
    if words[4] not in ("general", "symmetric"):
        raise line.fault("not a matrix of a model", expected="general or symmetric", received=words[4])
    return words[2], words[4] == "symmetric"


def _sizes(line: Line, form: str, symmetric: bool) -> tuple[tuple[int, int], int]:
    """Rows and columns, and entries in the file."""
    words = line.text.split()
    if len(words) != (3 if form == "coordinate" else 2) or not all(re.fullmatch(r"\d{1,12}", w, re.A) for w in words):
        raise line.fault("the sizes of the matrix are wanted here", received=line.text)
    shape = int(words[0]), int(words[1])
    if not 1 <= min(shape) <= max(shape) <= MAX_FREEDOMS or (symmetric and shape[0] != shape[1]):
        expected = f"at most {MAX_FREEDOMS} rows and columns, as many of both if it is symmetric"
        raise line.fault("not a matrix of a model", expected=expected, received=line.text)
    if form == "coordinate":
        return shape, int(words[2])
    return shape, shape[0] * (shape[0] + 1) // 2 if symmetric else shape[0] * shape[1]


def _numbers(lines: list[Line], width: int) -> Any:
    """(entries, width) numbers, all finite."""
    if not lines:
        return np.zeros((0, width))
    try:
        found = np.loadtxt([line.text for line in lines], dtype=np.float64, ndmin=2, comments=None)
    except ValueError:
        found = None
    if found is not None and found.shape == (len(lines), width) and np.isfinite(found).all():
        return found
    for line in lines:
        words = line.text.split()
        if len(words) != width:
            raise line.fault("the line does not fit", expected=f"{width} number(s)", received=line.text)
        for word in words[:-1]:
            whole(line, word, noun="a row and a column")
        real(line, words[-1], noun="an entry")
    raise BadInput("the matrix cannot be read", where=lines[0].path)


def _places(lines: list[Line], values: Any, shape: tuple[int, int], symmetric: bool) -> tuple[Any, Any]:
    """Rows and columns from 0; each entry stands once, of a symmetric matrix on one side of the diagonal."""
    places = values[:, :2]
    wrong = ((places < 1) | (places > np.array(shape)) | (places != np.floor(places))).any(axis=1)
    if wrong.any():
        line = lines[int(np.argmax(wrong))]
        what = "an entry outside the matrix"
        raise line.fault(what, expected=f"rows 1 to {shape[0]}, columns 1 to {shape[1]}", received=line.text)
    rows, columns = places.astype(np.int64).T - 1
    low, high = (np.minimum(rows, columns), np.maximum(rows, columns)) if symmetric else (rows, columns)
    number = high * max(shape) + low
    order = np.argsort(number, kind="stable")
    same = np.flatnonzero(np.diff(number[order]) == 0)
    if len(same):
        line, first = lines[int(order[same[0] + 1])], lines[int(order[same[0]])]
        raise line.fault("this entry stands here twice", expected=f"first in line {first.number}", received=line.text)
    return rows, columns


def _array_places(shape: tuple[int, int], symmetric: bool) -> tuple[Any, Any]:
    """Rows and columns of an array, column by column; the lower triangle of a symmetric one."""
    columns, rows = np.indices(shape[::-1]).reshape(2, -1)
    kept = rows >= columns if symmetric else np.ones(len(rows), dtype=np.bool_)
    return rows[kept], columns[kept]


def _assembled(rows: Any, columns: Any, values: Any, shape: tuple[int, int], symmetric: bool) -> Any:
    from scipy.sparse import coo_array

    if symmetric:
        beside = rows != columns
        values = np.concatenate([values, values[beside]])
        rows, columns = np.concatenate([rows, columns[beside]]), np.concatenate([columns, rows[beside]])
    return coo_array((values, (rows, columns)), shape=shape).tocsc()
