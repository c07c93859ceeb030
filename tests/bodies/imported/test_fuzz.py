"""Mutation fuzz of 1,000 files (faults 6-8): each is refused as bad input, or it is a body of finite numbers."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.io import mmwrite

from engine.bodies.files.ansys import scan_nodes
from engine.bodies.files.cards import cards_of, check_matrices, check_nodes, rows_of, scalars
from engine.bodies.files.reader import Request, read_files
from engine.bodies.files.text import lines_of
from engine.bodies.imported.body import imported_body
from engine.bodies.imported.kinds import Matrices
from results_schema.errors import BadInput
from tests.bodies.frames import PINNED, straight
from tests.bodies.models import BULK, CDB, Files, damaged

EACH = {"stiffness.mtx": 200, "mass.npz": 100, "nodes.csv": 150, "freedoms.csv": 150}


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Files:
    found = Files(tmp_path_factory.mktemp("model"), straight(PINNED, elements=4))
    mmwrite(found.folder / "mass.mtx", found.assembly.mass, symmetry="symmetric")
    return found


@pytest.mark.fault(6, 7)
@pytest.mark.parametrize("name", list(EACH))
def test_damaged_matrices(model: Files, name: str) -> None:
    path = model.folder / name
    whole = path.read_bytes()
    outcomes = [0, 0]
    try:
        for text in damaged(whole, EACH[name], seed=len(whole)):
            path.write_bytes(text)
            try:
                body = imported_body(Matrices.model_validate(model.table(modes=4)))
            except (BadInput, ValidationError) as error:
                outcomes[0] += 1
                if isinstance(error, ValidationError):
                    assert error.errors()[0]["type"] == "wanderlast", error
                continue
            outcomes[1] += 1
            assert all(np.isfinite(part).all() for part in (body.omega, body.shape([0.0, 7.0], 3), body.mass))
    finally:
        path.write_bytes(whole)
    assert sum(outcomes) == EACH[name] and outcomes[0] > EACH[name] / 4


def parsed(text: str, reads: tuple[Callable[[list[Any]], Any], ...], raw: bytes) -> bool:
    try:
        lines = lines_of("model", raw)
        for read in reads:
            read(lines)
    except BadInput as error:
        assert "model" in str(error)
        return False
    return True


@pytest.mark.fault(6)
@pytest.mark.parametrize(
    ("text", "reads"),
    [
        (CDB, (scan_nodes,)),
        (
            BULK,
            tuple(
                lambda lines, read=read: read(cards_of(lines))
                for read in (check_nodes, check_matrices, rows_of, scalars)
            ),
        ),
    ],
    ids=["cdb", "bulk"],
)
def test_damaged_texts(text: str, reads: tuple[Callable[[list[Any]], Any], ...]) -> None:
    assert parsed(text, reads, text.encode())
    outcomes = [parsed(text, reads, raw) for raw in damaged(text.encode(), 200, seed=len(text))]
    assert len(outcomes) == 200 and 20 < sum(outcomes) < 180


def test_a_handful_in_the_process_of_its_own(model: Files, tmp_path: Path) -> None:
    whole = (model.folder / "stiffness.mtx").read_bytes()
    for number, text in enumerate(damaged(whole, 3, seed=3)):
        path = tmp_path / f"stiffness{number}.mtx"
        path.write_bytes(text)
        table = model.table(stiffness=str(path), mass=str(model.folder / "mass.mtx"))
        request = Request("matrices", tuple((key, table[key]) for key in ("stiffness", "mass", "nodes", "freedoms")))
        try:
            assert read_files(request).size == len(model.assembly.free)
        except BadInput as error:
            assert error.where or error.what
