"""Texts of ANSYS and Nastran models: faults with file, line and card, includes that stay in the folder, and limits of
the process that reads."""

import os
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.bodies.files import ansys as import_ansys
from engine.bodies.files import cards as import_cards
from engine.bodies.files import optional_packages as import_extras
from engine.bodies.files import reader as import_files
from engine.bodies.files.model import FileModel, checked, turned
from engine.bodies.files.reader import Request, read_files
from engine.bodies.files.text import Line, lines_of, read_lines, real, whole
from results_schema.errors import BadInput
from tests.bodies.frames import PINNED, straight
from tests.bodies.models import BULK, CDB, Files


def lines(text: str) -> list[Line]:
    return lines_of("model.txt", text.encode())


def cdb(text: str) -> dict[int, Any]:
    return import_ansys.scan_nodes(lines(text))


def bulk(text: str) -> tuple[dict[int, Any], list[int], list[tuple[int, int]], set[str]]:
    cards = import_cards.cards_of(lines(text))
    nodes = import_cards.check_nodes(cards)
    return nodes, import_cards.scalars(cards), import_cards.rows_of(cards), import_cards.check_matrices(cards)


def test_nodes_of_a_cdb() -> None:
    found = cdb(CDB)
    assert list(found) == [1, 2, 5, 9]
    assert found[2] == (1.0, 0.25, 0.0, 0.0, 0.0, 0.0) and found[5][2] == 0.5


@pytest.mark.fault(6, 7)
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("1.0000000000000E+000", "           nan      ", ["line 6", "NBLOCK", "node 2", "not finite"]),
        ("1.0000000000000E+000", "1.0000000000000E+999", ["line 6", "node 2", "not finite"]),
        ("1.0000000000000E+000", "1.00000x0000000E+000", ["line 6", "node 2", "wanted here"]),
        ("        5        0", "        2        0", ["line 7", "node 2", "twice"]),
        ("        5        0", "       -5        0", ["line 7", "node's number"]),
        ("        9        0        0 3.0000000000000E+000\n", "", ["line 8", "missing", "4 nodes", "3"]),
        ("N,R5.3,LOC,       -1,\nFINISH\n", "", ["NBLOCK", "truncated"]),
        ("(3i9,6e21.13e3)\n", "", ["line 4", "format"]),
        ("NBLOCK,6,SOLID", "NBLOCK,x,SOLID", ["line 3", "NBLOCK,6,SOLID"]),
        ("NBLOCK,6,SOLID,        4,         4", "EBLOCK", ["no node"]),
    ],
)
def test_faults_of_a_cdb(old: str, new: str, words: list[str]) -> None:
    assert old in CDB
    with pytest.raises(BadInput) as caught:
        cdb(CDB.replace(old, new))
    assert all(word in str(caught.value) for word in ["model.txt", *words]), str(caught.value)


def test_cards() -> None:
    nodes, points, rows, matrices = bulk(BULK)
    assert list(nodes) == [1, 2, 3] and nodes[3].fields[2:5] == (
        "0.200000000E+01",
        "0.000000000E+00",
        "0.300000000E+01",
    )
    assert points == [1001, 1002, 1003] and matrices == {"kaax"}
    assert rows == [(1, d) for d in range(1, 7)] + [(2, 3), (3, 1), (3, 2), (3, 3), (1001, 0), (1002, 0), (1003, 0)]


@pytest.mark.fault(6, 7)
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("GRID,2,,1.0,0.0,.5", "GRID,1,,1.0,0.0,.5", ["line 7, GRID", "node 1", "twice", "line 6"]),
        ("GRID,2,,1.0,0.0,.5", "GRID,2,,nan,0.0,.5", ["line 7, GRID", "node 2", "not finite"]),
        ("GRID,2,,1.0,0.0,.5", "GRID,2,,1.0+400,0.0,.5", ["line 7, GRID", "node 2", "not finite"]),
        ("GRID,2,,1.0,0.0,.5", "GRID,2,,one,0.0,.5", ["line 7, GRID", "node 2", '"one"']),
        ("GRID,2,,1.0,0.0,.5", "GRID,-2,,1.0,0.0,.5", ["line 7, GRID", "node's number"]),
        ("GRID,2,,1.0,0.0,.5", "GRID,2,77,1.0,0.0,.5", ["line 7, GRID", "coordinate system 77"]),
        ("$ a superelement\nBEGIN BULK", "*       1.0", ["line 1", "after nothing"]),
        ("1001    THRU    1003", "1003    THRU    1001", ["SPOINT", "range"]),
        ("       3     123", "       2       3", ["EXTRN", "node 2", "twice"]),
        ("       3     123", "       3     127", ["EXTRN", "digits"]),
        ("1.500000000D+01", "            nan", ["DMIG", "node 1", "not finite"]),
        ("1.500000000D+01", "        garbage", ["DMIG", "node 1", "wanted here"]),
        ("DMIG    KAAX           0       6       2       0\n", "", ["DMIG", "kaax", "head"]),
        ("2       3       2.5+1", "2       8       2.5+1", ["DMIG", "direction"]),
    ],
)
def test_faults_of_bulk_data(old: str, new: str, words: list[str]) -> None:
    assert old in BULK
    with pytest.raises(BadInput) as caught:
        bulk(BULK.replace(old, new))
    assert all(word in str(caught.value) for word in ["model.txt", *words]), str(caught.value)


def test_numbers() -> None:
    line = Line("a", 1, "")
    words = {"1.5": 1.5, "-2.D+3": -2000.0, "1.5-3": 0.0015, ".5E2": 50.0, "+7": 7.0, "3.+2": 300.0, "1.0d0": 1.0}
    assert {word: real(line, word) for word in words} == words
    for word in ("", "nan", "-inf", "1_0", "0x1", "1e", "1e400", "--1", "1 2"):
        with pytest.raises(BadInput):
            real(line, word)
    for word in ("0", "-1", "1.0", "", "1" * 19, "²"):
        with pytest.raises(BadInput):
            whole(line, word)


INCLUDES = {
    "inside": ("INCLUDE 'more.bdf'\n", ""),
    "deeper": ("INCLUDE 'parts/more.bdf'\n", ""),
    "over lines": ("INCLUDE 'parts/\nmore.bdf'\n", ""),
    "absolute": ("INCLUDE '/etc/hostname'\n", "leaves the model's folder"),
    "home": ("INCLUDE '~/more.bdf'\n", "leaves the model's folder"),
    "symbol": ("INCLUDE 'HOME:more.bdf'\n", "leaves the model's folder"),
    "drive": ("INCLUDE 'C:\\more.bdf'\n", "leaves the model's folder"),
    "upwards": ("INCLUDE '../outside.bdf'\n", "leaves the model's folder"),
    "upwards inside": ("INCLUDE 'parts/../../outside.bdf'\n", "leaves the model's folder"),
    "backslash": ("INCLUDE '..\\outside.bdf'\n", "leaves the model's folder"),
    "symlink": ("INCLUDE 'link.bdf'\n", "leaves the model's folder"),
    "linked folder": ("INCLUDE 'way/outside.bdf'\n", "leaves the model's folder"),
    "itself": ("INCLUDE 'main.bdf'\n", "includes itself"),
    "in a circle": ("INCLUDE 'circle.bdf'\n", "includes itself"),
    "nowhere": ("INCLUDE 'none.bdf'\n", "no such file"),
    "nothing": ("INCLUDE ''\n", "leaves the model's folder"),
    "open quote": ("INCLUDE 'more.bdf\n", "truncated"),
}


@pytest.mark.fault(6, 8)
@pytest.mark.parametrize("name", list(INCLUDES))
def test_includes_of_nastran(tmp_path: Path, name: str) -> None:
    text, refused = INCLUDES[name]
    folder = tmp_path / "model"
    (folder / "parts").mkdir(parents=True)
    (tmp_path / "outside.bdf").write_text("GRID,9,,0.,0.,0.\n", encoding="utf-8")
    for path in ("more.bdf", "parts/more.bdf"):
        (folder / path).write_text("GRID,7,,0.,0.,0.\n", encoding="utf-8")
    (folder / "circle.bdf").write_text("INCLUDE 'main.bdf'\n", encoding="utf-8")
    os.symlink(tmp_path / "outside.bdf", folder / "link.bdf")
    os.symlink(tmp_path, folder / "way")
    main = folder / "main.bdf"
    main.write_text("GRID,1,,0.,0.,0.\n" + text + "GRID,2,,0.,0.,0.\n", encoding="utf-8")
    if not refused:
        nodes = import_cards.check_nodes(import_cards.cards_of(read_lines(str(main), import_cards.included)))
        assert list(nodes) == [1, 7, 2]
        return
    with pytest.raises(BadInput) as caught:
        read_lines(str(main), import_cards.included)
    assert refused in str(caught.value) and "line " in str(caught.value), str(caught.value)


@pytest.mark.fault(6, 8)
@pytest.mark.parametrize(
    ("command", "refused"),
    [
        ("/INPUT,more,cdb", ""),
        ("/inp,'more','cdb'  ! a comment", ""),
        ("/INPUT,more,cdb,/tmp", "leaves the model's folder"),
        ("/INPUT,../outside,cdb", "leaves the model's folder"),
        ("/INPUT,main,cdb", "includes itself"),
    ],
)
def test_includes_of_ansys(tmp_path: Path, command: str, refused: str) -> None:
    main = tmp_path / "main.cdb"
    main.write_text(f"/PREP7\n{command}\nFINISH\n", encoding="utf-8")
    (tmp_path / "more.cdb").write_text(CDB, encoding="utf-8")
    if not refused:
        assert len(import_ansys.scan_nodes(read_lines(str(main), import_ansys.included))) == 4
        return
    with pytest.raises(BadInput, match=refused):
        read_lines(str(main), import_ansys.included)


def test_nodes_with_directions_of_their_own() -> None:
    """Springs of 1, 2, 3 N/m along the node's own x, y, z, which is turned by 90 degrees about z."""
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    model = FileModel(
        stiffness=np.diag([1.0, 2.0, 3.0]),
        mass=np.eye(3),
        nodes=np.array([4]),
        places=np.zeros((1, 3)),
        owner=np.zeros(3, dtype=np.int64),
        direction=np.arange(3),
        held=np.zeros(3, dtype=np.bool_),
    )
    found = checked(turned(checked(model, "f"), turn[None], "f"), "f")
    assert np.allclose(found.stiffness.toarray(), np.diag([2.0, 1.0, 3.0]), atol=1e-15)
    angles = import_ansys.turns_of(np.array([[90.0, 0.0, 0.0], [0.0, 90.0, 0.0], [0.0, 0.0, 90.0], [0.0, 0.0, 0.0]]))
    assert np.allclose(angles[0], turn, atol=1e-15)
    assert np.allclose(angles[1], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-15)
    assert np.allclose(angles[2], [[0, 0, -1], [0, 1, 0], [1, 0, 0]], atol=1e-15)
    assert np.allclose(angles[3], np.eye(3))


@pytest.mark.fault(6)
def test_limits_of_the_reader(tmp_path: Path) -> None:
    files = Files(tmp_path, straight(PINNED, elements=2))
    named = tuple((key, str(value)) for key, value in files.table().items() if key not in ("kind", "track"))
    assert read_files(Request("matrices", named)).size == len(files.assembly.free)
    with pytest.raises(BadInput, match="takes too long"):
        read_files(Request("matrices", named, seconds=0))
    bomb = tmp_path / "bomb.npz"
    with zipfile.ZipFile(bomb, "w") as archive, archive.open("data.npy", "w") as data:
        header = {"shape": (500_000_000,), "fortran_order": False, "descr": "<f8"}
        np.lib.format.write_array_header_1_0(data, header)
    with zipfile.ZipFile(bomb, "a") as archive:
        for name, array in (("format", np.array(b"coo")), ("shape", np.array([12, 12]))):
            with archive.open(f"{name}.npy", "w") as data:
                np.lib.format.write_array(data, array)
    with pytest.raises(BadInput, match="too much memory"):
        read_files(Request("matrices", (("stiffness", str(bomb)), *named[1:]), memory=2 * 2**30))
    with pytest.raises(RuntimeError, match="KeyError"):
        read_files(Request("something else", named))


def test_a_missing_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyyeti.nastran", None)
    with pytest.raises(BadInput) as caught:
        import_extras.extra("pyyeti.nastran", "nastran")
    assert caught.value.remedy == "pip install 'wanderlast[nastran]'" and "pyyeti" in caught.value.what
    assert (
        import_files.role_of(BadInput("", where="b/k.op4, line 3"), {"nodes": "b", "matrices": "b/k.op4"}) == "matrices"
    )
