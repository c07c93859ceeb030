"""Models of ANSYS: stiffness and mass of a `.full` file, nodes of a `.cdb` or `.rst` file.

The files are read by mapdl-archive and ansys-mapdl-reader (extra `ansys`). These forgive what is missing, doubled or
cut off in a `.cdb`, so that its lines are looked at here first.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from engine.bodies.files.ansys_results import recovery_along
from engine.bodies.files.model import Array, Counts, FileModel, checked, hashes_of, turned
from engine.bodies.files.optional_packages import extra, foreign
from engine.bodies.files.text import Line, file_bytes, read_lines, read_paths, real, whole, written
from engine.bodies.files.track import line_as_told
from results_schema.errors import BadInput
from results_schema.lazy_imports import sparse

_HEAD = re.compile(r"\s*NBLOCK\s*,\s*(\d+)\s*(?:,\s*(\w*)\s*(?:,\s*(\d*)\s*(?:,\s*(\d*)\s*)?)?)?$", re.IGNORECASE)
_FORMAT = re.compile(
    r"\s*\(\s*(\d{1,2})i(\d{1,3})\s*,\s*(\d{1,2})e(\d{1,3})\.(\d{1,3})(?:e\d)?\s*\)\s*$", re.IGNORECASE
)
_INPUT = re.compile(r"\s*/INP\w*\s*,(.*)$", re.IGNORECASE)
_FREEDOMS = 6


def read_ansys(files: Mapping[str, str], options: Mapping[str, Any]) -> FileModel:
    """A model from its files: full, nodes, and results if they are given, of which stress and strain are read in a
    ``component`` at the nodes of a ``track``, told as JSON. Raises BadInput."""
    numbers, places, turns, read = _nodes(files["nodes"])
    owner_number, direction, held, stiffness, mass = _matrices(files["full"])
    known = {int(number): place for place, number in enumerate(numbers)}
    missing = next((int(number) for number in owner_number if int(number) not in known), None)
    if missing is not None:
        what = f"node {missing} of {files['full']} is missing"
        raise BadInput(what, where=files["nodes"], expected="the nodes of the same model")
    if direction.size and direction.max() >= _FREEDOMS:
        what = "a degree of freedom other than displacements and rotations"
        raise BadInput(what, where=files["full"], received=f"number {int(direction.max())}")
    owner = np.array([known[int(number)] for number in owner_number], dtype=np.int64)
    results = [files["results"]] if "component" in options else []
    for path in results:
        file_bytes(path)
    hashes = hashes_of(files["full"], *read, *results)
    model = FileModel(stiffness, mass, numbers, places, owner, direction, held, hashes)
    model = checked(turned(model, turns, files["full"]), files["full"])
    for path in results:
        try:
            line = line_as_told(numbers, places, json.loads(str(options["track"])))
        except BadInput:
            break  # the study refuses its track itself, with its key
        model = replace(model, recovery=recovery_along(model, path, line, str(options["component"])))
    return model


def _nodes(path: str) -> tuple[Counts, Array, Array, list[str]]:
    """Numbers, coordinates and directions of all nodes, and the files that were read."""
    read = [path]
    if Path(path).suffix.lower() == ".rst":
        file_bytes(path)
        reader = extra("ansys.mapdl.reader", "ansys")
        mesh = foreign(path, lambda: reader.read_binary(path).mesh)
        numbers, places, angles = mesh.nnum, mesh.nodes, mesh.node_angles
    else:
        lines = read_lines(path, included)
        scanned, read = scan_nodes(lines), read_paths(lines)
        reader = extra("mapdl_archive", "ansys")
        with tempfile.TemporaryDirectory() as folder:
            flat = written(Path(folder) / "nodes.cdb", lines)
            mesh = foreign(path, lambda: reader.Archive(flat, parse_vtk=False, read_eblock=False))
        numbers, places, angles = mesh.nnum, mesh.nodes, mesh.node_angles
        if len(numbers) != len(scanned) or not np.array_equal(np.asarray(numbers), np.array(list(scanned))):
            what = "the nodes are not read as they stand in the file"
            raise BadInput(what, where=path, expected=f"{len(scanned)} nodes", received=f"{len(numbers)}")
    count = len(numbers)
    angles = np.zeros((count, 3)) if angles is None else np.asarray(angles, dtype=np.float64)[:, :3]
    return np.asarray(numbers, dtype=np.int64), np.asarray(places, dtype=np.float64)[:, :3], turns_of(angles), read


def turns_of(degrees: Array) -> Array:
    """(P, 3, 3) directions of nodes as rows, from the angles about z, then the new x, then the new y."""
    found = np.broadcast_to(np.eye(3), (len(degrees), 3, 3)).copy()
    for axis, angle in zip((2, 0, 1), np.radians(degrees).T, strict=True):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        turn = np.broadcast_to(np.eye(3), found.shape).copy()
        turn[:, one, one] = turn[:, other, other] = np.cos(angle)
        turn[:, one, other], turn[:, other, one] = np.sin(angle), -np.sin(angle)
        found = turn @ found
    return found


def _matrices(path: str) -> tuple[Counts, Counts, Any, Any, Any]:
    """Node and direction of every row, which are held, stiffness and mass, of a `.full` file."""
    file_bytes(path)
    reader = extra("ansys.mapdl.reader", "ansys")
    file = foreign(path, lambda: reader.read_binary(path))
    if not hasattr(file, "load_km"):
        raise BadInput("no .full file of ANSYS", where=path, received=type(file).__name__)
    rows, stiffness, mass = foreign(path, lambda: file.load_km(as_sparse=True, sort=True))
    if stiffness is None or mass is None:
        raise BadInput("stiffness or mass is missing", where=path, remedy="write the file in a modal analysis")
    const = {(int(node), int(way)) for node, way in np.asarray(file.const).reshape(-1, 2)}
    held = np.array([(int(node), int(way)) in const for node, way in rows], dtype=np.bool_)
    whole_matrices = [matrix + sparse.triu(matrix, 1).T for matrix in (stiffness, mass)]
    numbers, direction = np.asarray(rows, dtype=np.int64).T
    return numbers, direction, held, whole_matrices[0], whole_matrices[1]


def included(line: Line, after: Iterator[Line]) -> str | None:
    """The file that a line of ANSYS commands reads in; None for other lines."""
    match = _INPUT.match(line.text)
    if match is None:
        return None
    fields = [field.strip().strip("'") for field in match.group(1).split("!")[0].split(",")]
    name = fields[0] + (f".{fields[1]}" if len(fields) > 1 and fields[1] else "")
    folder = fields[2] if len(fields) > 2 and fields[2] else ""
    return f"{folder}/{name}" if folder else name


def scan_nodes(lines: list[Line]) -> dict[int, tuple[float, ...]]:
    """Coordinates by node of all NBLOCK cards. Raises BadInput with file, line and card."""
    found: dict[int, tuple[float, ...]] = {}
    rows = iter(lines)
    for line in rows:
        if re.match(r"\s*NBLOCK\b", line.text, re.IGNORECASE):
            _scan_block(line, rows, found)
    if not found:
        raise BadInput("there is no node", where=lines[0].path, expected="an NBLOCK card with nodes")
    return dict(sorted(found.items())) if list(found) != sorted(found) else found


def _scan_block(head: Line, rows: Iterator[Line], found: dict[int, tuple[float, ...]]) -> None:
    """One NBLOCK card with its lines, up to its -1."""
    card = "NBLOCK"
    match = _HEAD.match(head.text)
    if match is None or not 4 <= int(match.group(1)) <= 9:
        raise head.fault("the card cannot be read", card=card, expected="NBLOCK,6,SOLID", received=head.text)
    form = next(rows, head)
    layout = _FORMAT.match(form.text)
    if layout is None:
        raise form.fault("the format of the nodes is wanted here", card=card, expected="(3i9,6e21.13e3)")
    integers, width, reals, wide = (int(layout.group(part)) for part in (1, 2, 3, 4))
    if not (integers >= 1 and reals >= 3 and width and wide):
        raise form.fault("the format of the nodes cannot be right", card=card, received=form.text)
    wanted = int(match.group(4) or 0)
    count, line = 0, form
    for line in rows:
        if re.match(r"\s*(N\s*,|-1\b)", line.text, re.IGNORECASE):
            break
        if not line.text.strip():
            continue
        number = whole(line, line.text[:width], card=card)
        if number in found:
            raise line.fault(f"node {number} is defined twice", card=card)
        found[number] = _coordinates(line, integers * width, wide, number)
        count += 1
    else:
        raise line.fault("the file is truncated", card=card, expected="the end of the nodes, -1")
    if wanted and count != wanted:
        raise line.fault("nodes are missing", card=card, expected=f"{wanted} nodes", received=str(count))


def _coordinates(line: Line, start: int, wide: int, number: int) -> tuple[float, ...]:
    """x, y, z and angles of a node; what is left out is zero."""
    text = line.text[start:].rstrip()
    fields = [text[first : first + wide] for first in range(0, len(text), wide)]
    if len(fields) > 6:
        raise line.fault("the line does not fit", card="NBLOCK", expected="at most six numbers", received=text)
    noun = f"a coordinate of node {number}"
    values = [real(line, field, card="NBLOCK", noun=noun) for field in fields]
    return tuple(values + [0.0] * (6 - len(values)))
