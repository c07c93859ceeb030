"""Models of Nastran, read by pyyeti (extra `nastran`): matrices of OP4, OP2 and punched DMIG files, nodes and rows of
bulk data (also the `.asm` and `.pch` of an external superelement) or of an OP2 file.

Text is looked at card by card first, and handed on with its includes in their places.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from engine.bodies.files.cards import Card, cards_of, check_matrices, check_nodes, included, rows_of, scalars
from engine.bodies.files.model import Array, FileModel, checked, hashes_of, turned
from engine.bodies.files.optional_packages import extra, foreign
from engine.bodies.files.text import file_bytes, read_lines, read_paths, written
from results_schema.errors import BadInput
from results_schema.lazy_imports import sparse

Row = tuple[int, int]  # a node and a direction 1 to 6, or a scalar point and 0
PAIRS = (("kaa", "maa"), ("kxx", "mxx"), ("kaax", "maax"), ("kgg", "mgg"), ("k2gg", "m2gg"))


def read_nastran(files: Mapping[str, str], options: Mapping[str, Any]) -> FileModel:
    """A model from its files: matrices, nodes; options: stiffness and mass (names), superelement. Raises BadInput."""
    path, superelement = files["matrices"], int(options.get("superelement", 0))
    table = _Table(files["nodes"], superelement)
    suffix = Path(path).suffix.lower()
    if suffix in (".op4", ".op2"):
        both = suffix == ".op4" and Path(files["nodes"]).suffix.lower() == ".op2"
        found = _of_superelement(files, superelement) if both else _binary(path, suffix)
        rows, read = table.rows, [path]
        stiffness, mass = (sparse.csc_array(found[name]) for name in _names(found, options, path))
        recovery = _recovery(found, options, path)
    else:
        rows, read, (stiffness, mass) = _punched(path, options)
        recovery = _recovery({}, options, path)
    numbers = list(dict.fromkeys(node for node, direction in rows if direction))
    missing = next((node for node in numbers if node not in table.places), None)
    if missing is not None:
        raise BadInput(f"node {missing} of the matrices is missing", where=files["nodes"], expected="its GRID card")
    nodes = list(table.places)
    at = {node: place for place, node in enumerate(nodes)}
    model = FileModel(
        stiffness=stiffness,
        mass=mass,
        nodes=np.array(nodes, dtype=np.int64),
        places=np.array([table.places[node] for node in nodes]).reshape(-1, 3),
        owner=np.array([at[node] if direction else -1 for node, direction in rows], dtype=np.int64),
        direction=np.array([direction - 1 if direction else node for node, direction in rows], dtype=np.int64),
        held=np.zeros(len(rows), dtype=np.bool_),
        hashes=hashes_of(*read, *table.read),
        recovery=recovery,
    )
    turns = np.array([table.turns[node] for node in nodes]).reshape(-1, 3, 3)
    return checked(turned(checked(model, path), turns, path), path)


class _Table:
    """Nodes of a file: places (3,) and directions (3, 3) by number, and the rows of matrices that belong to it."""

    def __init__(self, path: str, superelement: int) -> None:
        self.places: dict[int, Array] = {}
        self.turns: dict[int, Array] = {}
        self.rows: list[Row] = []
        self.read = [path]
        if Path(path).suffix.lower() == ".op2":
            self._fill(_table_of_op2(path, superelement), path)
        else:
            self._of_text(path)

    def _of_text(self, path: str) -> None:
        lines = read_lines(path, included)
        cards = cards_of(lines)
        grids = check_nodes(cards)
        if not grids:
            raise BadInput("there is no node", where=path, expected="GRID cards")
        beside = Path(path).with_suffix(".pch")
        more: list[Card] = []
        self.read = read_paths(lines)
        if Path(path).suffix.lower() == ".asm" and beside.is_file():
            punched = read_lines(str(beside), included)
            more = cards_of(punched)
            self.read += read_paths(punched)
        wanted = rows_of(cards) or rows_of(more)
        nastran = extra("pyyeti.nastran", "nastran")
        with tempfile.TemporaryDirectory() as folder:
            flat = written(Path(folder) / "nodes.bdf", lines)
            self._fill(foreign(path, lambda: nastran.bulk2uset(flat)[0]), path)
        self.rows = wanted or self.rows + [(number, 0) for number in scalars(cards)]
        if set(self.places) != set(grids):
            raise BadInput("the nodes are not read as they stand in the file", where=path)

    def _fill(self, uset: Any, path: str) -> None:
        """From pyyeti's table of degrees of freedom."""
        n2p = extra("pyyeti.nastran.n2p", "nastran")
        index = [(int(node), int(direction)) for node, direction in uset.index]
        motion = foreign(path, lambda: n2p.rbgeom_uset(uset))
        values = np.asarray(uset[["x", "y", "z"]], dtype=np.float64)
        for row, (node, direction) in enumerate(index):
            if direction == 1:
                self.places[node] = values[row]
                self.turns[node] = motion[row : row + 3, :3]
        self.rows = list(dict.fromkeys(index))


def _table_of_op2(path: str, superelement: int) -> Any:
    file_bytes(path)
    op2 = extra("pyyeti.nastran.op2", "nastran")
    tables = foreign(path, lambda: op2.OP2(path).rdn2cop2()["uset"])
    if superelement not in tables:
        expected = f"superelement = one of {', '.join(str(number) for number in tables)}"
        raise BadInput("no such superelement", where=path, expected=expected, received=str(superelement))
    return tables[superelement]


def _binary(path: str, suffix: str) -> dict[str, Any]:
    """All matrices of an OP4 or OP2 file by their names."""
    file_bytes(path)
    if suffix == ".op4":
        op4 = extra("pyyeti.nastran.op4", "nastran")
        found = foreign(path, lambda: op4.read(path, sparse=True))
    else:
        op2 = extra("pyyeti.nastran.op2", "nastran")
        found = foreign(path, lambda: op2.OP2(path).rdop2mats())
    return {str(name).lower(): matrix for name, matrix in found.items()}


def _of_superelement(files: Mapping[str, str], number: int) -> dict[str, Any]:
    """Matrices of a superelement from the OP4 file that belongs to an OP2 file."""
    file_bytes(files["matrices"])
    op2 = extra("pyyeti.nastran.op2", "nastran")
    tables = foreign(files["matrices"], lambda: op2.rdnas2cam(files["nodes"], files["matrices"]))
    sets = [(name, tables[name]) for name in ("kaa", "maa") if isinstance(tables.get(name), dict)]
    return {name: matrices[number] for name, matrices in sets if number in matrices}


def _names(found: Any, options: Mapping[str, Any], path: str) -> tuple[str, str]:
    """Names of stiffness and mass: as they are asked for, else a usual pair. Raises BadInput."""
    usual = next(((k, m) for k, m in PAIRS if k in found and m in found), ("", ""))
    names = []
    for key, name in zip(("stiffness", "mass"), usual, strict=True):
        name = str(options.get(key) or name).lower()
        if name not in found:
            known = ", ".join(sorted(found)[:20]) or "no matrix at all"
            what = f"no such matrix for the {key}"
            raise BadInput(what, where=path, expected=f"{key} = one of {known}", received=name)
        names.append(name)
    return names[0], names[1]


def _recovery(found: dict[str, Any], options: Mapping[str, Any], path: str) -> Any:
    """The matrix with rows that give stresses, if one is asked for. Raises BadInput."""
    name = str(options.get("recovery") or "").lower()
    if not name:
        return None
    if name not in found:
        known = ", ".join(sorted(found)[:30]) or "no other matrix"
        raise BadInput("no such recovery matrix", where=path, expected=f"recovery = one of {known}", received=name)
    return sparse.csc_array(found[name])


def _punched(path: str, options: Mapping[str, Any]) -> tuple[list[Row], list[str], tuple[Any, Any]]:
    """Rows, files, and stiffness and mass of DMIG cards; rows that one matrix lacks are zero there."""
    lines = read_lines(path, included)
    known = check_matrices(cards_of(lines))
    names = _names(known, options, path)
    nastran = extra("pyyeti.nastran", "nastran")
    with tempfile.TemporaryDirectory() as folder:
        flat = written(Path(folder) / "matrices.pch", lines)
        found = foreign(path, lambda: nastran.rddmig(flat, list(names), square=True))
        tables = [found[name] for name in names]
        rows = sorted({(int(node), int(way)) for table in tables for node, way in table.index})
        if any(table.shape[0] != table.shape[1] for table in tables):
            raise BadInput("a matrix that is not square", where=path)
        matrices = [
            sparse.csc_array(np.asarray(table.reindex(index=rows, columns=rows).fillna(0.0))) for table in tables
        ]
    return rows, read_paths(lines), (matrices[0], matrices[1])
