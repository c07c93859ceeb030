"""Stress and strain of a model of ANSYS along its track, from the element results of its modes.

phi_i being the modes of a `.rst` file, m_i their modal masses and sigma_i a stress at a node, averaged over the
elements that share it, a displacement u has the stress sum over i of sigma_i phi_i^T M u/m_i: what the file's modes
hold of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from engine.bodies.files.model import Array, FileModel
from engine.bodies.files.optional_packages import extra, foreign
from engine.bodies.files.track import NodeLine
from results_schema.arrays import Mask
from results_schema.errors import BadInput
from results_schema.lazy_imports import sparse

COMPONENTS = ("x", "y", "z", "xy", "yz", "xz")
DOFS = {"UX": 0, "UY": 1, "UZ": 2, "ROTX": 3, "ROTY": 4, "ROTZ": 5}
#: By which squares of frequencies, and products of modes that are to be orthogonal, may differ from the matrices'.
#: Files hold numbers of single precision (1e-7); those of the same beam held otherwise were off by a factor of 27.
SAME = 1e-3


@dataclass(frozen=True, eq=False)
class Modes:
    """Shapes (n, k) over the rows of the matrices, and of every node of a track stress and strain (2, T, k); NaN where
    the file has none, as at nodes in the middle of an edge."""

    shapes: Array
    told: Array


def recovery_along(model: FileModel, path: str, line: NodeLine, component: str) -> Any:
    """(2 T, n) sparse: rows that give the stress at each of the T nodes of a track, then those of the strain. Raises
    BadInput."""
    modes = _modes(model, path, line, COMPONENTS.index(component))
    masses = _masses(model, modes.shapes, path)
    told = np.array([_between(part, line, model, path) for part in modes.told]) / masses
    return sparse.csc_array(told.reshape(-1, masses.size) @ (model.mass @ modes.shapes).T)


def _modes(model: FileModel, path: str, line: NodeLine, component: int) -> Modes:
    reader = extra("ansys.mapdl.reader", "ansys")
    file = foreign(path, lambda: reader.read_binary(path))
    if not hasattr(file, "nodal_stress"):
        raise BadInput("no .rst file of ANSYS", where=path, received=type(file).__name__)
    shapes, told = np.zeros((model.size, file.nsets)), np.full((2, line.nodes.size, file.nsets), np.nan)
    rows = np.full((len(model.nodes), len(DOFS)), -1)
    rows[model.owner, model.direction] = np.arange(model.size)
    for k in range(file.nsets):
        moved = _of_nodes(model, path, partial(file.nodal_solution, k))
        ways = foreign(path, partial(file.result_dof, k))
        for name, values in zip(ways, moved.T, strict=False):
            own = rows[:, DOFS[name]] if name in DOFS else np.full(len(rows), -1)
            shapes[own[own >= 0], k] = values[own >= 0]
        for q, read in enumerate((file.nodal_stress, file.nodal_elastic_strain)):
            told[q, :, k] = _of_nodes(model, path, partial(read, k))[line.nodes, component]
    rate = (2.0 * np.pi * np.asarray(file.time_values, dtype=np.float64)) ** 2
    _check(model, np.nan_to_num(shapes), rate, path)
    return Modes(np.nan_to_num(shapes), told)


def _of_nodes(model: FileModel, path: str, read: Callable[[], Any]) -> Array:
    """(P, values) of all nodes of the model, NaN where the file tells nothing."""
    numbers, values = foreign(path, read)
    order = np.argsort(numbers, kind="stable")
    at = np.clip(np.searchsorted(numbers, model.nodes, sorter=order), 0, len(numbers) - 1)
    known = np.asarray(numbers)[order[at]] == model.nodes
    return np.where(known[:, None], np.asarray(values, dtype=np.float64)[order[at]], np.nan)


def _masses(model: FileModel, shapes: Array, path: str) -> Array:
    """(k,) modal masses. Raises BadInput where the shapes are no modes of the matrices."""
    masses = np.sum(shapes * (model.mass @ shapes), axis=0)
    if not masses.size or not masses.min() > 0.0:
        raise BadInput(
            "a result without a mode of this model", where=path, expected="a modal analysis of the same model"
        )
    return np.asarray(masses)


def _check(model: FileModel, shapes: Array, squares: Array, path: str) -> None:
    """Squares of frequencies (k,) are those of the matrices, and modes orthogonal."""
    masses = _masses(model, shapes, path)
    own = np.sum(shapes * (model.stiffness @ shapes), axis=0) / masses
    off = ~(np.abs(own - squares) <= SAME * np.maximum(squares, SAME * squares.max()))
    if off.any():
        k = int(np.argmax(off))
        what = f"mode {k + 1} of the results is none of these matrices"
        expected = f"{np.sqrt(squares[k]) / (2.0 * np.pi):.6g} Hz, as the file says"
        received = f"{np.sqrt(max(own[k], 0.0)) / (2.0 * np.pi):.6g} Hz by its shape"
        raise BadInput(what, where=path, expected=expected, received=received, remedy="files of the same analysis")
    scaled = shapes / np.sqrt(masses)
    if not np.abs(scaled.T @ (model.mass @ scaled) - np.eye(masses.size)).max() <= SAME:
        raise BadInput("results that are no modes of these matrices", where=path, expected="orthogonal mode shapes")


def _between(told: Array, line: NodeLine, model: FileModel, path: str) -> Array:
    """(T, k) without gaps: in the middle of an edge linear between the next nodes that the file tells of."""
    known: Mask = np.asarray(np.isfinite(told).all(axis=1))
    if not (known[0] and known[-1]):
        number = model.nodes[line.nodes[0 if not known[0] else -1]]
        what = f"no stress or strain is told at node {number}, where the track ends"
        raise BadInput(what, where=path, expected="element results of the elements there (OUTRES)")
    return np.array([np.interp(line.places, line.places[known], column[known]) for column in told.T]).T
