"""Matrices of a body that stands on springs of its own: what its nodes' coordinates and its weight tell."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_matrix, load_npz, save_npz

from engine.batch.plan import make_plan
from engine.batch.plausibility import remarks
from engine.bodies.build import build_body
from engine.bodies.imported.kinds import Matrices
from results_schema.errors import BadInput
from tests.bodies.frames import straight
from tests.bodies.models import Files, study

ALONG = (1, *range(3, 14), 2)  # nodes from one end to the other
ENDS, WITHIN, GROUND = (1, 2), (ALONG[3], ALONG[7]), 1e7  # nodes with springs, N/m in every direction
GRAVITY = 9.81


@pytest.fixture(scope="module")
def loose(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """A frame of 12 elements that nothing holds: its files have all rows."""
    return Files(tmp_path_factory.mktemp("loose"), straight({}, elements=12))


def rows_of(files: Files, *nodes: int) -> np.ndarray:
    return np.flatnonzero(np.isin(files.assembly.free // 6 + 1, nodes))


def on_springs(files: Files, *nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass, with springs to the ground at some nodes."""
    stiffness, mass = files.assembly.stiffness.toarray(), files.assembly.mass.toarray()
    held = rows_of(files, *nodes)
    stiffness[held, held] += GROUND
    return stiffness, mass


def written(folder: Path, **matrices: np.ndarray) -> dict[str, str]:
    for name, matrix in matrices.items():
        save_npz(folder / f"{name}.npz", csc_matrix(matrix))
    return {name: str(folder / f"{name}.npz") for name in matrices}


@pytest.mark.parametrize(("reverse", "doubted"), [(False, False), (True, True)])
def test_nodes_in_another_order_than_the_freedoms_are_doubted(
    loose: Files, tmp_path: Path, reverse: bool, doubted: bool
) -> None:
    """Nothing but the study's own supports had them looked at; springs at two nodes of 13 are none."""
    stiffness, mass = on_springs(loose, *ENDS)
    head, *lines = (loose.folder / "nodes.csv").read_text(encoding="utf-8").splitlines()
    places = [line.partition(",")[2] for line in lines]
    mixed = [f"{n},{place}" for n, place in enumerate(places[5:] + places[:5] if reverse else places, start=1)]
    (tmp_path / "nodes.csv").write_text("\n".join([head, *mixed]), encoding="utf-8")
    table = loose.table(nodes=str(tmp_path / "nodes.csv"), **written(tmp_path, stiffness=stiffness, mass=mass))
    said = [one for one in remarks(make_plan(study(table))) if one.startswith("bed: ")]
    assert bool(said) is doubted and all(
        "of its nodes resist rigid motions by their coordinates" in one for one in said
    )


def reduced(files: Files, folder: Path, *grounded: int) -> dict[str, Any]:
    """The table of a Craig-Bampton model: the track's nodes in every second place, six modes of all else."""
    stiffness, mass = on_springs(files, *grounded)
    kept = rows_of(files, *ALONG[::2])
    inner = np.setdiff1d(np.arange(len(stiffness)), kept)
    _, modes = eigh(stiffness[np.ix_(inner, inner)], mass[np.ix_(inner, inner)], subset_by_index=[0, 5])
    basis = np.zeros((len(stiffness), kept.size + 6))
    basis[kept, np.arange(kept.size)] = 1.0
    basis[inner, : kept.size] = -np.linalg.solve(stiffness[np.ix_(inner, inner)], stiffness[np.ix_(inner, kept)])
    basis[inner, kept.size :] = modes
    given = written(folder, **{name: basis.T @ own @ basis for name, own in (("stiffness", stiffness), ("mass", mass))})
    lines = (files.folder / "freedoms.csv").read_text(encoding="utf-8").splitlines()
    own = [lines[0], *(lines[row + 1] for row in kept), *(f"{n},modal" for n in range(100, 106))]
    (folder / "freedoms.csv").write_text("\n".join(own), encoding="utf-8")
    return files.table(freedoms=str(folder / "freedoms.csv"), own_weight=True, **given)


def sag(table: dict[str, Any]) -> float:
    """Of the middle under its own weight, m."""
    return GRAVITY * float(build_body(Matrices.model_validate(table)).own_weight_deflection(np.array([7.5]))[0])


def test_a_reduced_body_that_stands_on_springs_inside_has_no_weight(loose: Files, tmp_path: Path) -> None:
    """With its springs at kept nodes it sags as all of it does; else its sag was told as exact, and 1 % off."""
    stiffness, mass = on_springs(loose, *ENDS)
    whole = sag(loose.table(own_weight=True, **written(tmp_path, stiffness=stiffness, mass=mass)))
    assert sag(reduced(loose, tmp_path, *ENDS)) == pytest.approx(whole, rel=1e-8)
    make_plan(study(reduced(loose, tmp_path, *ENDS)))
    inside = reduced(loose, tmp_path, *WITHIN)
    with pytest.raises(BadInput, match=r"bed\.own_weight: by the rigid motions of its nodes its mass is .*on springs"):
        make_plan(study(inside))
    make_plan(study(inside | {"own_weight": False}))


def test_a_reduced_body_whose_nodes_move_in_other_directions_has_its_weight(loose: Files, tmp_path: Path) -> None:
    """Its mass along x and z differs, as not all of its nodes move along x: that says nothing of springs."""
    table = reduced(loose, tmp_path, *ENDS)
    free = sag(table)
    lines = Path(table["freedoms"]).read_text(encoding="utf-8").splitlines()
    kept = [n for n, line in enumerate(lines[1:]) if line != f"{ALONG[6]},x"]
    for name in ("stiffness", "mass"):
        save_npz(table[name], csc_matrix(load_npz(table[name]))[kept][:, kept])
    Path(table["freedoms"]).write_text("\n".join([lines[0], *(lines[n + 1] for n in kept)]), encoding="utf-8")
    make_plan(study(table))
    assert sag(table) == pytest.approx(free, rel=1e-3)
