"""Bad files and keys of imported bodies (faults 6 and 7): each refused with its place, before anything is computed."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import mmwrite
from scipy.sparse import csc_matrix, dia_array, save_npz, tril

from engine.batch.plan import make_plan
from engine.bodies.imported.kinds import Matrices
from engine.scene.study import load
from engine.study_file.document import write_document
from results_schema.errors import BadInput
from tests.bodies.frames import LENGTH, PINNED, straight
from tests.bodies.models import CRUISE, Files, refusal, study
from tests.scene.mutations import HOW, How, accepted, distinct


def faults(folder: Path, files: Files) -> dict[str, tuple[dict[str, Any], list[str]]]:
    """Names of faults: what replaces keys of the body, and words that the refusal has."""
    lines = {
        name: (files.folder / name).read_text().splitlines() for name in ("nodes.csv", "freedoms.csv", "stiffness.mtx")
    }
    count = 0

    def written(name: str, *texts: str | bytes) -> str:
        nonlocal count
        count += 1
        path = folder / f"{count}_{name}"
        path.write_bytes(b"\n".join(text if isinstance(text, bytes) else text.encode() for text in texts))
        return str(path)

    def matrix(change: Callable[[Any], None]) -> str:
        wrong = files.assembly.stiffness.tolil()
        change(wrong)
        path = folder / f"wrong{len(list(folder.iterdir()))}.npz"
        save_npz(path, csc_matrix(wrong))
        return str(path)

    def heavy() -> str:
        wrong = files.assembly.mass.tolil()
        wrong[3, 9] = wrong[9, 3] = 2.0 * max(wrong[3, 3], wrong[9, 9])
        save_npz(folder / "heavy.npz", csc_matrix(wrong))
        return str(folder / "heavy.npz")

    def negative() -> str:
        wrong = files.assembly.mass.tolil()
        wrong[at, at] = -1.0
        save_npz(folder / "negative.npz", csc_matrix(wrong))
        return str(folder / "negative.npz")

    def turning() -> str:
        save_npz(folder / "complex.npz", csc_matrix(files.assembly.mass * 1j))
        return str(folder / "complex.npz")

    def stored(name: str, form: Any) -> str:
        save_npz(folder / name, form)
        return str(folder / name)

    def arrays() -> str:
        np.savez(folder / "arrays.npz", K=np.eye(96))
        return str(folder / "arrays.npz")

    nodes, rows, market = lines["nodes.csv"], lines["freedoms.csv"], lines["stiffness.mtx"]
    at = int(np.flatnonzero(files.assembly.free == 6 * 4 + 2)[0])  # node 5, z
    return {
        "missing": ({"mass": str(folder / "none.mtx")}, ["body.bed.mass", "no such file"]),
        "empty": ({"nodes": written("n.csv", "")}, ["body.bed.nodes", "empty"]),
        "blank": ({"nodes": written("n.csv", "", "  ")}, ["body.bed.nodes", "empty"]),
        "binary": ({"nodes": written("n.csv", b"\0\1\2")}, ["body.bed.nodes", "binary"]),
        "latin": ({"nodes": written("n.csv", *nodes, b"# caf\xe9")}, ["encoding", f"line {len(nodes) + 1}"]),
        "utf-16": ({"nodes": written("n.csv", "\n".join(nodes).encode("utf-16"))}, ["body.bed.nodes", "binary"]),
        "truncated": ({"stiffness": written("k.mtx", *market[:-5])}, ["body.bed.stiffness", "truncated"]),
        "no header": ({"stiffness": written("k.mtx", *market[1:])}, ["line 1", "Matrix Market"]),
        "huge": ({"stiffness": written("k.mtx", market[0], "900000000 900000000 1", "1 1 1.0")}, ["line 2", "at most"]),
        "entry": ({"stiffness": written("k.mtx", *market[:-1], "1 x 1.0")}, [f"line {len(market)}", '"x"']),
        "nan entry": ({"stiffness": written("k.mtx", *market[:-1], "1 1 nan")}, [f"line {len(market)}", "not finite"]),
        "twice": ({"stiffness": written("k.mtx", *market[:-1], market[-2])}, ["twice", f"line {len(market)}"]),
        "damaged npz": ({"mass": written("m.npz", (files.folder / "mass.npz").read_bytes()[:300])}, ["bed.mass"]),
        "node twice": ({"nodes": written("n.csv", *nodes, nodes[3])}, ["node 3", "twice", f"line {len(nodes) + 1}"]),
        "node missing": ({"nodes": written("n.csv", *nodes[:4], *nodes[5:])}, ["bed.freedoms", "no node 4", "line"]),
        "coordinate": ({"nodes": written("n.csv", *nodes[:2], "2,nan,0,0")}, ["line 3", "node 2", "not finite"]),
        "infinite": ({"nodes": written("n.csv", *nodes[:2], "2,1e999,0,0")}, ["line 3", "node 2", "not finite"]),
        "fields": ({"nodes": written("n.csv", *nodes[:2], "2,0,0")}, ["line 3", "4 fields"]),
        "direction": ({"freedoms": written("d.csv", *rows[:-1], "1,q1")}, [f"line {len(rows)}", "direction"]),
        "row twice": ({"freedoms": written("d.csv", *rows[:-1], rows[-2])}, [f"line {len(rows)}", "twice"]),
        "rows": ({"freedoms": written("d.csv", *rows[:-1])}, ["bed.stiffness", "does not fit"]),
        "no rows": ({"freedoms": None}, ["bed.stiffness", "does not fit the nodes", "102 or 51 rows"]),
        "negative": (
            {"stiffness": matrix(lambda k: k.__setitem__((at, at), -1.0))},
            ["negative stiffness", "node 5, z"],
        ),
        "infinite entry": (
            {"stiffness": matrix(lambda k: k.__setitem__((at, at), np.inf))},
            ["not finite", "node 5, z"],
        ),
        "lopsided": ({"stiffness": matrix(lambda k: k.__setitem__((at, at - 2), 1e9))}, ["not symmetric", "node 5, z"]),
        "indefinite": ({"stiffness": matrix(lambda k: k.__setitem__((at, at), 1.0))}, ["not positive"]),
        "indefinite mass": ({"mass": heavy()}, ["bed.mass", "mass matrix is not positive"]),
        "negative mass": ({"mass": negative()}, ["bed.mass", "negative.npz", "negative mass", "node 5, z"]),
        "complex": ({"mass": turning()}, ["bed.mass", "real numbers"]),
        "slack": ({"stiffness": matrix(lambda k: slack(k, at))}, ["node 5, z", "no stiffness", "bed.supports"]),
        "track node": ({"track": {"nodes": [1, 99]}}, ["bed.track.nodes.1", "99"]),
        "track order": ({"track": {"nodes": [1, 9, 4, 2]}}, ["bed.track", "9 and 4"]),
        "track beside": ({"track": {"from": [0, 1, 0], "to": [15, 1, 0]}}, ["bed.track", "too few", "1 m beside it"]),
        "along": ({"gravity_direction": [1.0, 0.0, 0.0]}, ["bed.track.direction", "along the track"]),
        "support": (
            {"supports": {"77": "clamped"}},
            ["bed.supports.77", "no such node", "17 nodes from 1 to 17"],
        ),
        "numpy": ({"mass": written("m.npy", b"\x93NUMPY\x01\0v\0")}, ["array of numpy", "scipy.sparse.save_npz(path"]),
        "a triangle": (
            {"stiffness": matrix(lambda k: k.__setitem__(slice(None), tril(k).tolil()))},
            ["not symmetric", "the upper triangle is empty: add the transpose, less the diagonal"],
        ),
        "support words": ({"supports": {"left": "clamped"}}, ["bed.supports.left", "1-21"]),
        "point": ({"point": {"p": {"node": 77}}}, ["bed.point.p.node", "77"]),
        "two ways": ({"track": {"nodes": [1, 2], "from": [0, 0, 0]}}, ["bed.track", "one way"]),
        "recovery alone": ({"recovery": str(files.folder / "mass.npz")}, ["bed.stress_rows", "missing"]),
        "few rows": (
            {"recovery": str(files.folder / "mass.npz"), "stress_rows": [[1], [2]]},
            ["stress_rows", "17 lists"],
        ),
        "no such row": (
            {"recovery": str(files.folder / "mass.npz"), "stress_rows": [[1]] * 16 + [[97]]},
            ["stress_rows.16", "1 to 96", "97"],
        ),
        "other form": ({"mass": stored("dia.npz", dia_array(np.eye(96)))}, ["dia (96, 96)", "save_npz(path"]),
        "arrays": ({"mass": arrays()}, ["arrays of numpy", '"K"', "save_npz(path"]),
        "columns": ({"nodes": written("n.csv", "node,y,x,z", *nodes)}, ["line 1", "another order", "node, x, y, z"]),
        "other words": ({"nodes": written("n.csv", "id,y,x,z", *nodes)}, ["line 1", "another order"]),
        "from 0": ({"freedoms": written("f.csv", "1,0", "1,1")}, ["line 1", "no such direction", "1 to 6"]),
        "a row short": ({"freedoms": written("f.csv", *rows[:-1])}, ["the 95 degrees", "f.csv", "95 x 95", "96 x 96"]),
        "narrow": ({"recovery": written("r.mtx", *NARROW), "stress_rows": [[1]] * 17}, ["recovery", "96 columns", "2"]),
        "few": ({"track": {"nodes": [1, 7, 2], "interpolation": "spline"}}, ["bed.track", "at least 4"]),
        "zero byte": ({"mass": "a\0b"}, ["bed.mass", "path"]),
        "folder": ({"mass": str(folder)}, ["bed.mass", "no such file"]),
        "elsewhere": (
            {"mass": "none.mtx"},
            ["bed.mass: none.mtx: no such file", f"working folder, which is {Path.cwd()}"],
        ),
    }


def slack(matrix: Any, at: int) -> None:
    matrix[at, :] = 0.0
    matrix[:, at] = 0.0


@pytest.mark.fault(6, 7)
def test_faults(files: Files, tmp_path: Path) -> None:
    for name, (keys, words) in faults(tmp_path, files).items():
        table = {key: value for key, value in (files.table() | keys).items() if value is not None}
        found = str(refusal(table))
        assert all(word in found for word in words), (name, found)


@pytest.mark.parametrize("quantity", ["stress", "bending_moment", "shear_force"])
def test_no_section_forces(files: Files, quantity: str) -> None:
    sensor = {"middle": {"body": "bed", "at": 7.5, "quantity": quantity}}
    with pytest.raises(BadInput, match=f"sensor.middle.quantity.*{quantity} is not available") as refused:
        study(files.table(), sensor=sensor)
    assert "support" not in str(refused.value)  # which it refuses, too


NARROW = ("%%MatrixMarket matrix array real general", "3 2", *["1.0"] * 6)
EVERY_KEY = write_document(
    {
        "schema_version": 1,
        "kind": "passage",
        "body": {
            "bed": {
                "kind": "matrices",
                **{key: f"FOLDER/{key}.mtx" for key in ("stiffness", "mass")},
                **{key: f"FOLDER/{key}.csv" for key in ("nodes", "freedoms")},
                "track": {
                    "from": [0.0, 0.0, 0.0],
                    "to": [LENGTH, 0.0, 0.0],
                    "tolerance": 0.01,
                    "direction": [0.0, 0.0, -1.0],
                    "interpolation": "auto",
                },
                "recovery": "FOLDER/recovery.mtx",
                "stress_rows": [[1], [2, 3], [4], [5]],
                "strain_rows": [[5], [1, 2], [4], [3]],
                "supports": {"1": ["x", "y"], "3-4": ["rx"]},
                "point": {"tip": {"node": 3, "direction": [0.0, 0.0, 1.0]}},
                "gravity_direction": [0.0, 0.0, -1.0],
                "length_unit": 1.0,
                "force_unit": 1.0,
                "rigid_body_modes": "keep",
                "damping_ratio": 0.01,
                "modes": 6,
                "own_weight": False,
            }
        },
        "carriage": {"table": {"on": "bed", "kind": "mass", "mass": 100.0, "motion": CRUISE}},
    }
)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Files:
    found = Files(tmp_path_factory.mktemp("small"), straight(PINNED, elements=3))
    mmwrite(found.folder / "mass.mtx", found.assembly.mass)
    mmwrite(found.folder / "recovery.mtx", np.ones((5, len(found.assembly.free))))
    return found


@pytest.mark.fault(2, 3, 4)
@pytest.mark.parametrize("how", HOW)
def test_every_key(small: Files, how: How) -> None:
    accepted(how, distinct(EVERY_KEY), lambda text: load(text.replace("FOLDER", str(small.folder))))


def test_every_key_is_there(small: Files) -> None:
    assert make_plan(load(EVERY_KEY.replace("FOLDER", str(small.folder)))).size == 1
    given = set(tomllib.loads(EVERY_KEY)["body"]["bed"])
    assert given == set(Matrices.model_fields)
