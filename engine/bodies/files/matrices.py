"""Models as plain files: matrices as Matrix Market or NPZ, nodes and rows as CSV."""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np

from engine.bodies.files.model import DIRECTIONS, MAX_FREEDOMS, FileModel, checked, hashes_of
from engine.bodies.files.text import Line, file_bytes, lines_of, real, whole
from results_schema.errors import BadInput, shortened
from results_schema.lazy_imports import sparse

NUMPY = b"\x93NUMPY"  # how a .npy file begins
SPARSE = "%%MatrixMarket matrix ..., or a sparse matrix of scipy as .npz"
SAVED = "scipy.sparse.save_npz(path, scipy.sparse.csc_array(matrix))"
_SPARSE = ("csr", "csc", "coo")
_MODAL = ("0", "q", "modal")


def read_matrices(files: Mapping[str, str], options: Mapping[str, Any]) -> FileModel:
    """A model from its files: stiffness, mass, nodes, and freedoms and recovery if they are given. Raises BadInput."""
    stiffness, mass = (read_matrix(files[key], file_bytes(files[key])) for key in ("stiffness", "mass"))
    nodes, places = nodes_of(lines_of(files["nodes"], file_bytes(files["nodes"])))
    if "freedoms" in files:
        owner, direction = freedoms_of(lines_of(files["freedoms"], file_bytes(files["freedoms"])), nodes)
    else:
        owner, direction = freedoms_in_order(stiffness.shape[0], len(nodes), files["stiffness"])
    for key, matrix in (("stiffness", stiffness), ("mass", mass)):
        if matrix.shape != (len(owner), len(owner)):
            size = " x ".join(str(part) for part in matrix.shape)
            told = f" that {files['freedoms']} names" if "freedoms" in files else ""
            what = f"the {key} matrix does not fit the {len(owner)} degrees of freedom{told}"
            raise BadInput(what, where=files[key], expected=f"{len(owner)} x {len(owner)}", received=size)
    held = np.zeros(len(owner), dtype=np.bool_)
    recovery = read_matrix(files["recovery"], file_bytes(files["recovery"])) if "recovery" in files else None
    model = FileModel(stiffness, mass, nodes, places, owner, direction, held, hashes_of(*files.values()), recovery)
    return checked(model, files["stiffness"], files)


def read_matrix(path: str, raw: bytes) -> Any:
    """A sparse matrix from Matrix Market text or scipy's NPZ. Raises BadInput."""
    if raw.startswith(NUMPY):
        raise BadInput("this is an array of numpy", where=path, expected=SPARSE, remedy=SAVED)
    found = _from_npz(path, raw) if raw[:2] == b"PK" else from_market(lines_of(path, raw))
    if np.iscomplexobj(found):
        raise BadInput("a complex matrix", where=path, expected="real numbers")
    return found


def _from_npz(path: str, raw: bytes) -> Any:
    """Of scipy's `save_npz`; pickles are refused, indices checked."""
    try:
        with np.load(BytesIO(raw), allow_pickle=False) as found:
            if "format" not in found:
                what, received = "these are arrays of numpy", ", ".join(map(shortened, found))
                raise BadInput(what, where=path, expected=SPARSE, received=received, remedy=SAVED)
            form, shape = found["format"].item(), tuple(int(size) for size in found["shape"])
            form = form.decode("ascii") if isinstance(form, bytes) else str(form)
            if form not in _SPARSE or len(shape) != 2 or max(shape) > MAX_FREEDOMS:
                what, expected = "this matrix is not read", f"a csr, csc or coo matrix of at most {MAX_FREEDOMS} rows"
                raise BadInput(what, where=path, expected=expected, received=f"{form} {shape}", remedy=SAVED)
            data = found["data"]
            if data.dtype.kind not in "fiu" or data.ndim != 1:
                raise BadInput("not a matrix of real numbers", where=path, received=str(data.dtype))
            if form == "coo":
                return sparse.coo_array((data, (found["row"], found["col"])), shape=shape).tocsc()
            kind = sparse.csr_array if form == "csr" else sparse.csc_array
            matrix = kind((data, found["indices"], found["indptr"]), shape=shape)
            matrix.check_format(full_check=True)
            return matrix.tocsc()
    except (BadInput, MemoryError):
        raise
    except Exception as error:
        what, expected = "the matrix cannot be read", "a file of scipy.sparse.save_npz without pickles"
        raise BadInput(what, where=path, expected=expected, received=str(error)[:200]) from None


def nodes_of(lines: list[Line]) -> tuple[Any, Any]:
    """Numbers (P,) and coordinates (P, 3) from lines `node, x, y, z`, with a heading or without. Raises BadInput."""
    numbers: dict[int, int] = {}
    places: list[tuple[float, float, float]] = []
    for line, fields in _rows(lines, ("node", "x", "y", "z")):
        number = whole(line, fields[0])
        if number in numbers:
            raise line.fault(f"node {number} is defined twice", expected=f"first in line {numbers[number]}")
        numbers[number] = line.number
        x, y, z = (real(line, field, noun=f"a coordinate of node {number}") for field in fields[1:])
        places.append((x, y, z))
    if not numbers:
        raise BadInput("there is no node", where=lines[0].path, expected="lines of node, x, y, z")
    return np.array(list(numbers), dtype=np.int64), np.array(places)


def freedoms_of(lines: list[Line], nodes: Any) -> tuple[Any, Any]:
    """Owner and direction (n,) of every row from lines `node, direction`. Raises BadInput.

    A direction is x, y, z, rx, ry, rz, or 1 to 6; `modal` makes the first number that of a modal coordinate.
    """
    known = {int(number): place for place, number in enumerate(nodes)}
    words = {word: index for index, word in enumerate(DIRECTIONS)} | {str(i + 1): i for i in range(6)}
    found: dict[tuple[int, int], int] = {}
    for line, fields in _rows(lines, ("node", "direction")):
        number, word = whole(line, fields[0]), fields[1].strip().lower()
        if word == "0" and number in known:
            expected = f"1 to 6, or modal where {number} is the number of a modal coordinate"
            raise line.fault("no such direction", expected=expected, received=fields[1])
        if word in _MODAL:
            row = (-1, number)
        elif word not in words:
            raise line.fault("no such direction", expected="x, y, z, rx, ry, rz or modal", received=fields[1])
        elif number not in known:
            raise line.fault(f"there is no node {number}", expected="a node of the file of nodes")
        else:
            row = (known[number], words[word])
        if row in found:
            raise line.fault("this degree of freedom stands here twice", expected=f"first in line {found[row]}")
        found[row] = line.number
    if not found:
        raise BadInput("there is no degree of freedom", where=lines[0].path, expected="lines of node, direction")
    owner, direction = np.array(list(found), dtype=np.int64).T
    return owner, direction


def freedoms_in_order(size: int, nodes: int, where: str) -> tuple[Any, Any]:
    """Owner and direction of every row: six or three per node, node by node in their order. Raises BadInput."""
    for each in (6, 3):
        if size == each * nodes:
            owner, direction = np.divmod(np.arange(size, dtype=np.int64), each)
            return owner, direction
    raise BadInput(
        "the matrix does not fit the nodes",
        where=where,
        expected=f"{6 * nodes} or {3 * nodes} rows for {nodes} nodes",
        received=f"{size} rows",
        remedy="name the rows in a file: freedoms = ...",
    )


def _rows(lines: list[Line], names: tuple[str, ...]) -> list[tuple[Line, list[str]]]:
    """Lines that hold something, split at commas or semicolons; a heading, comments after # left out. names: of the
    columns, which a heading may not have in another order."""
    found: list[tuple[Line, list[str]]] = []
    for line in lines:
        text = line.text.partition("#")[0].strip()
        fields = [field.strip().strip('"') for field in re.split("[,;]", text)]
        heading = not found and line.number <= 2 and not re.match(r"[+-]?\d", fields[0])
        if not text or (heading and re.match("[A-Za-z]", fields[0])):
            told = [field.lower() for field in fields]
            if any(word in names and names[place : place + 1] != (word,) for place, word in enumerate(told)):
                raise line.fault("columns in another order", expected=", ".join(names), received=text)
            continue
        if len(fields) != len(names):
            raise line.fault("the line does not fit", expected=f"{len(names)} fields", received=text)
        found.append((line, fields))
    return found


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
        what, expected = "no Matrix Market file", SPARSE
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
    if symmetric:
        beside = rows != columns
        values = np.concatenate([values, values[beside]])
        rows, columns = np.concatenate([rows, columns[beside]]), np.concatenate([columns, rows[beside]])
    return sparse.coo_array((values, (rows, columns)), shape=shape).tocsc()
