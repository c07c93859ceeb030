"""A finite-element model out of files: matrices, nodes, and what every row of the matrices is."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from results_schema.errors import BadInput
from results_schema.lazy_imports import sparse

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
MAX_FREEDOMS = 200_000
ASYMMETRY = 1e-6  # of the largest entry: beyond it a matrix is refused
_MATRICES = ("stiffness", "mass")
_RECOVERY = "recovery"


@dataclass(frozen=True, eq=False)
class FileModel:
    """Stiffness and mass (n, n) sparse; nodes (P,): their numbers; places (P, 3); hashes: path and SHA-256 of every
    file that was read, included ones too; recovery (R, n): rows that give stresses, None where there are none.

    Of every row: owner (n,): place of its node in `nodes`, -1 for a modal or scalar coordinate; direction (n,): 0..5
    for x, y, z, rx, ry, rz, or the number of that coordinate; held (n,): the file holds it.
    """

    stiffness: Any
    mass: Any
    nodes: Counts
    places: Array
    owner: Counts
    direction: Counts
    held: NDArray[np.bool_]
    hashes: tuple[tuple[str, str], ...] = ()
    recovery: Any = None

    @property
    def digest(self) -> str:
        """SHA-256 of the contents of all files, one after another."""
        return hashlib.sha256(b"".join(bytes.fromhex(found) for _, found in self.hashes)).hexdigest()

    @property
    def size(self) -> int:
        """Rows of the matrices."""
        return len(self.owner)

    @property
    def numbered(self) -> str:
        """What a node's number may be, in words."""
        return f"one of {len(self.nodes)} nodes from {self.nodes.min()} to {self.nodes.max()}"

    def name(self, row: int) -> str:
        """A row in words: "node 12, rz"."""
        if self.owner[row] < 0:
            return f"coordinate {self.direction[row]}"
        return f"node {self.nodes[self.owner[row]]}, {DIRECTIONS[self.direction[row]]}"

    def rows_of(self, node: int) -> Counts:
        """(6,) rows of a node (its place in `nodes`) by direction, -1 where it has none."""
        found = np.full(6, -1, dtype=np.int64)
        rows = np.flatnonzero(self.owner == node)
        found[self.direction[rows]] = rows
        return found


def hashes_of(*paths: str) -> tuple[tuple[str, str], ...]:
    """Path and SHA-256 of every file."""
    return tuple((path, hashlib.sha256(Path(path).read_bytes()).hexdigest()) for path in paths)


def save_model(path: Path, model: FileModel) -> None:
    """Write a model as plain arrays."""
    arrays: dict[str, Any] = {}
    for name in (*_MATRICES, *([] if model.recovery is None else [_RECOVERY])):
        matrix = getattr(model, name).tocoo()
        arrays |= {f"{name}_row": matrix.row, f"{name}_column": matrix.col, f"{name}_value": matrix.data}
        arrays[f"{name}_shape"] = np.array(matrix.shape)
    rest = {key: getattr(model, key) for key in ("nodes", "places", "owner", "direction", "held")}
    np.savez(path, **arrays, **rest, hashes=np.array(model.hashes, dtype=np.str_).reshape(-1, 2))


def load_model(path: Path) -> FileModel:
    """Read what `save_model` wrote; pickles are refused."""
    with np.load(path, allow_pickle=False) as found:
        matrices = {
            name: sparse.coo_array(
                (found[f"{name}_value"], (found[f"{name}_row"], found[f"{name}_column"])),
                shape=tuple(found[f"{name}_shape"].tolist()),
            ).tocsc()
            for name in (*_MATRICES, _RECOVERY)
            if f"{name}_shape" in found
        }
        rest = {key: found[key] for key in ("nodes", "places", "owner", "direction", "held")}
        hashes = tuple((str(path), str(digest)) for path, digest in found["hashes"])
        return FileModel(**matrices, **rest, hashes=hashes)


def checked(model: FileModel, where: str, own: Mapping[str, str] = MappingProxyType({})) -> FileModel:
    """The model with exactly symmetric matrices; where: its file; own: files of single matrices by their names. Raises
    BadInput naming the node."""
    if not len(model.nodes):
        raise BadInput("there is no node", where=where)
    _check_nodes(model, where)
    _check_rows(model, where)
    matrices = {name: _checked_matrix(model, name, own.get(name, where)) for name in _MATRICES}
    return replace(model, **matrices, recovery=_checked_recovery(model, own.get(_RECOVERY, where)))


def _check_nodes(model: FileModel, where: str) -> None:
    numbers, counts = np.unique(model.nodes, return_counts=True)
    if counts.max() > 1:
        raise BadInput(f"node {numbers[counts.argmax()]} is defined twice", where=where)
    wrong = np.flatnonzero(~np.isfinite(model.places).all(axis=1))
    if len(wrong):
        place = ", ".join(f"{part:g}" for part in model.places[wrong[0]])
        what = f"node {model.nodes[wrong[0]]} has a coordinate that is not finite"
        raise BadInput(what, where=where, expected="finite numbers", received=place)


def _check_rows(model: FileModel, where: str) -> None:
    if model.size > MAX_FREEDOMS:
        raise BadInput("the model is too large", where=where, expected=f"at most {MAX_FREEDOMS} degrees of freedom")
    order = np.lexsort((model.direction, model.owner))
    same = (np.diff(model.owner[order]) == 0) & (np.diff(model.direction[order]) == 0)
    if same.any():
        raise BadInput(f"{model.name(int(order[np.argmax(same)]))} has two rows", where=where, expected="each row once")


def _checked_matrix(model: FileModel, name: str, where: str) -> Any:
    matrix = sparse.csc_array(getattr(model, name))
    if matrix.shape != (model.size, model.size):
        size = " x ".join(str(part) for part in matrix.shape)
        what = f"the {name} matrix does not fit the degrees of freedom"
        raise BadInput(what, where=where, expected=f"{model.size} x {model.size}", received=size)
    if np.iscomplexobj(matrix.data):
        raise BadInput(f"the {name} matrix is complex", where=where, expected="real numbers")
    matrix = sparse.csc_array(matrix, dtype=np.float64)
    matrix.sum_duplicates()
    wrong = ~np.isfinite(matrix.data)
    if wrong.any():
        row = int(matrix.indices[np.argmax(wrong)])
        raise BadInput(f"the {name} of {model.name(row)} is not finite", where=where, expected="finite numbers")
    diagonal = matrix.diagonal()
    if diagonal.size and diagonal.min() < 0.0:
        row = int(diagonal.argmin())
        what = f"negative {name} of {model.name(row)}"
        raise BadInput(what, where=where, expected=">= 0", received=f"{diagonal[row]:g}")
    return _symmetric(model, matrix, name, where)


def _checked_recovery(model: FileModel, where: str) -> Any:
    if model.recovery is None:
        return None
    found = sparse.csc_array(model.recovery)
    if found.shape[1] != model.size:
        what, expected = "the recovery matrix does not fit the degrees of freedom", f"{model.size} columns"
        raise BadInput(what, where=where, expected=expected, received=f"{found.shape[1]} columns")
    if np.iscomplexobj(found.data) or not np.isfinite(found.data).all():
        raise BadInput("the recovery matrix has entries that are not finite real numbers", where=where)
    return sparse.csc_array(found, dtype=np.float64)


def _half(matrix: Any) -> str:
    """What completes a matrix of which one triangle alone is there; "" of others."""
    triangles = {"lower": sparse.tril(matrix, -1), "upper": sparse.triu(matrix, 1)}
    empty = [name for name, part in triangles.items() if not part.nnz]
    return f"the {empty[0]} triangle is empty: add the transpose, less the diagonal" if len(empty) == 1 else ""


def _symmetric(model: FileModel, matrix: Any, name: str, where: str) -> Any:
    """The mean of a matrix and its transpose; what has no diagonal has nothing beside it either."""
    gap = abs(matrix - matrix.T).tocoo()
    largest = float(abs(matrix).max()) if matrix.nnz else 0.0
    if largest == 0.0:
        raise BadInput(f"the {name} matrix is zero", where=where)
    if gap.nnz and gap.data.max() > ASYMMETRY * largest:
        worst = int(gap.data.argmax())
        pair = f"{model.name(int(gap.row[worst]))} and {model.name(int(gap.col[worst]))}"
        raise BadInput(
            f"the {name} matrix is not symmetric between {pair}",
            where=where,
            expected="a symmetric matrix, both triangles or a symmetric format",
            received=f"a difference of {gap.data[worst] / largest:.3g} of the largest entry",
            remedy=_half(matrix),
        )
    found = (0.5 * (matrix + matrix.T)).tocsc()
    lone = (found.diagonal() == 0.0) & (abs(found).sum(axis=0) > 0.0)
    if lone.any():
        row = int(np.argmax(lone))
        what = f"the {name} matrix is not positive: {model.name(row)} has entries but none on the diagonal"
        raise BadInput(what, where=where)
    return found


def turned(model: FileModel, turns: Array, where: str) -> FileModel:
    """The model in the directions of its coordinates.

    turns (P, 3, 3): directions of the rows of a node as rows. Raises BadInput where a turned node lacks some of its
    three displacements or rotations, or holds some of them only.
    """
    turn = sparse.eye_array(model.size, format="lil")
    for node in np.flatnonzero(np.abs(turns - np.eye(3)).max(axis=(1, 2)) > 1e-12):
        for rows in model.rows_of(int(node)).reshape(2, 3):
            if (rows < 0).all():
                continue
            if (rows < 0).any() or model.held[rows].any() != model.held[rows].all():
                what = f"node {model.nodes[node]} has directions of its own, and only some of them are free"
                raise BadInput(what, where=where, expected="all three, or nodes in global directions")
            turn[np.ix_(rows, rows)] = turns[node]
    turn = turn.tocsc()
    recovery = None if model.recovery is None else model.recovery @ turn
    matrices = {"stiffness": turn.T @ model.stiffness @ turn, "mass": turn.T @ model.mass @ turn}
    return replace(model, **matrices, recovery=recovery)
