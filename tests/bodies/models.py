"""Finite-element files for tests: a frame of ours as matrices, small texts of ANSYS and Nastran, and damage to them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import mmwrite
from scipy.sparse import csc_matrix, save_npz

from engine.batch.plan import make_plan
from engine.bodies.files.child_process import READERS
from engine.bodies.files.model import FileModel
from engine.bodies.files.reader import Request
from engine.bodies.frame.assembly import Assembly, assemble
from engine.bodies.frame.frame import Frame
from engine.bodies.frame.geometry import DIRECTIONS
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.bodies.frames import LENGTH

CDB = """/COM,a small model
/PREP7
NBLOCK,6,SOLID,        4,         4
(3i9,6e21.13e3)
        1        0        0 0.0000000000000E+000
        2        0        0 1.0000000000000E+000 2.5000000000000E-001
        5        0        0 2.0000000000000E+000 0.0000000000000E+000 5.0000000000000E-001
        9        0        0 3.0000000000000E+000
N,R5.3,LOC,       -1,
FINISH
"""
BULK = """$ a superelement
BEGIN BULK
CORD2R*               10               0 0.000000000E+00 0.000000000E+00
*        0.000000000E+00 0.100000000E+01 0.000000000E+00 0.000000000E+00
*        0.000000000E+00 0.100000000E+01 0.000000000E+00
GRID           1             0.0     0.0     0.0
GRID,2,,1.0,0.0,.5
GRID*                  3               0 0.200000000E+01 0.000000000E+00
*        0.300000000E+01              10               0               0
SPOINT      1001    THRU    1003
EXTRN          1  123456       2       3       3     123    1001       0
            1002       0    1003       0
DMIG    KAAX           0       6       2       0
DMIG*   KAAX                           1               3
*                      1               3 1.500000000D+01
*                      2               3-1.500000000D+00
DMIG    KAAX    2       3               2       3       2.5+1
ENDDATA
"""

CRUISE = {"kind": "cruise", "start": 0.0, "end": LENGTH, "speed": 20.0}


class Files:
    """A frame's own matrices in a folder, as `kind = "matrices"` reads them."""

    def __init__(self, folder: Path, table: dict[str, Any]) -> None:
        self.folder = folder
        self.frame = Frame.model_validate(table)
        self.assembly: Assembly = assemble(self.frame)
        save_npz(folder / "mass.npz", csc_matrix(self.assembly.mass))
        mmwrite(folder / "stiffness.mtx", self.assembly.stiffness, symmetry="symmetric")
        points, free = self.assembly.mesh.points.tolist(), self.assembly.free
        nodes = [f"{number},{x!r},{y!r},{z!r}" for number, (x, y, z) in enumerate(points, start=1)]
        rows = [f"{row // 6 + 1},{DIRECTIONS[row % 6]}" for row in free]
        (folder / "nodes.csv").write_text("\n".join(["node,x,y,z", *nodes]), encoding="utf-8")
        (folder / "freedoms.csv").write_text("\n".join(["node,direction", *rows]), encoding="utf-8")

    def table(self, **more: Any) -> dict[str, Any]:
        """The body's table; its track is the frame's first member in whole."""
        first, last = (list(self.frame.place(node)) for node in self.frame.member["span"].nodes)
        names = {"stiffness": "stiffness.mtx", "mass": "mass.npz", "nodes": "nodes.csv", "freedoms": "freedoms.csv"}
        files = {key: str(self.folder / name) for key, name in names.items()}
        return {"kind": "matrices", **files, "track": {"from": first, "to": last}, **more}


def write_cards(files: Files) -> None:
    """The same model as DMIG cards (matrices.pch) and GRID cards (nodes.bdf, which includes grids.bdf)."""
    lines = []
    rows = [(row // 6 + 1, row % 6 + 1) for row in files.assembly.free.tolist()]
    for name, matrix in (("KAAX", files.assembly.stiffness), ("MAAX", files.assembly.mass)):
        lines.append(f"{'DMIG':8}{name:8}{0:8d}{6:8d}{2:8d}{0:8d}")
        dense = matrix.toarray()
        for column, (node, way) in enumerate(rows):
            lines.append(f"{'DMIG*':8}{name:16}{node:16d}{way:16d}")
            for row in range(column, len(rows)):
                if dense[row, column]:
                    value = f"{dense[row, column]:.9E}".replace("E", "D")
                    lines.append(f"{'*':8}{rows[row][0]:16d}{rows[row][1]:16d}{value:>16}")
    (files.folder / "matrices.pch").write_text("\n".join(lines) + "\n", encoding="utf-8")
    points = files.assembly.mesh.points.tolist()
    grids = "".join(f"GRID,{number},,{x!r},{y!r},{z!r}\n" for number, (x, y, z) in enumerate(points, start=1))
    (files.folder / "grids.bdf").write_text(grids, encoding="utf-8")
    (files.folder / "nodes.bdf").write_text("BEGIN BULK\nINCLUDE 'grids.bdf'\nENDDATA\n", encoding="utf-8")


def study(table: dict[str, Any], **more: Any) -> Study:
    carriage = {"on": "bed", "kind": "mass", "mass": 100.0, "motion": CRUISE}
    sensor = {"middle": {"body": "bed", "at": 7.5}}
    return Study(kind="passage", **({"body": {"bed": table}, "carriage": {"table": carriage}, "sensor": sensor} | more))


def refusal(table: dict[str, Any]) -> BadInput:
    with pytest.raises(BadInput) as caught:
        make_plan(study(table))
    return caught.value


def in_process(request: Request) -> FileModel:
    """What reading in a process of its own would give, here."""
    return READERS[request.kind](dict(request.files), dict(request.options))


def optional(module: str) -> Any:
    """A module of an extra, or the tests that need it are skipped; what it sets in numpy is set back."""
    with np.printoptions(), np.errstate():
        return pytest.importorskip(module)


def damaged(text: bytes, count: int, seed: int) -> Iterator[bytes]:
    """Texts with damage: bytes changed, cut off, lines doubled, dropped, swapped, numbers replaced by bad ones."""
    random = np.random.default_rng(seed)
    words = [b"nan", b"inf", b"-1", b"0", b"1e400", b"99999999999999999999", b"x", b"", b"1.0+400", b"\xff", b"2"]
    for number in range(count):
        lines = text.splitlines(keepends=True)
        at = int(random.integers(len(lines)))
        way = number % 8
        if way == 0:
            yield text[: int(random.integers(len(text)))]
        elif way == 1:
            place = int(random.integers(len(text)))
            yield text[:place] + bytes([int(random.integers(256))]) + text[place + 1 :]
        elif way == 2:
            yield b"".join([*lines[: at + 1], *lines[at:]])
        elif way == 3:
            yield b"".join([*lines[:at], *lines[at + 1 :]])
        elif way == 4:
            other = int(random.integers(len(lines)))
            lines[at], lines[other] = lines[other], lines[at]
            yield b"".join(lines)
        elif way == 5:
            place, size = int(random.integers(len(text))), int(random.integers(1, 40))
            yield text[:place] + text[place + size :]
        elif way == 6:
            parts = lines[at].replace(b",", b" , ").split(b" ")
            parts[int(random.integers(len(parts)))] = words[int(random.integers(len(words)))]
            lines[at] = b" ".join(parts)
            yield b"".join(lines)
        else:
            place = int(random.integers(len(text)))
            yield text[:place] + random.bytes(int(random.integers(1, 30))) + text[place:]
