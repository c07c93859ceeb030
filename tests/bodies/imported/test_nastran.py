"""Craig-Bampton models that come with pyyeti: their published frequencies and masses, and DMIG cards of our own."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.linalg import eigh

from engine.bodies.build import build_body
from engine.bodies.imported.kinds import Nastran
from engine.bodies.modal.modal_body import ModalBody
from tests.bodies.frames import CLAMPED_FREE, body, straight
from tests.bodies.models import Files, optional, write_cards

pytestmark = pytest.mark.extras
pyyeti = optional("pyyeti")

MODELS = Path(pyyeti.__file__).parent / "tests"
# outboard_cbcheck.out: free-free modes 7 to 18 of the truss, Hz; mass; x of its centre from node 3 (at x = 600)
PUBLISHED = (
    1.757662, 1.792869, 3.649292, 4.149376, 7.025406, 7.254279, 11.070483, 11.752514, 14.226996, 15.414285, 25.286983,
    25.655202,
)  # fmt: skip
MASS, CENTRE = 1.5904, 600.0 - 415.360203


def modal(matrices: Path, nodes: Path, track: list[int], **more: Any) -> ModalBody:
    table = {"kind": "nastran", "matrices": str(matrices), "nodes": str(nodes), "track": {"nodes": track}}
    return build_body(Nastran.model_validate(table | more))


def test_the_truss() -> None:
    folder = MODELS / "cla_test_data"
    found = modal(folder / "outboard.op4", folder / "outboard.asm", [3, 11], modes=18)
    assert found.rigid_modes == 6
    assert np.abs(found.omega[6:] / (2.0 * np.pi) / np.array(PUBLISHED) - 1.0).max() < 5e-7
    assert found.mass == pytest.approx(MASS, abs=5e-5)
    said = dict(found.checks)
    assert said["centre of mass"].startswith(f"({CENTRE:.5g}, 150, 150) m")  # node 11 stands in directions of its own
    assert said["nodes, degrees of freedom"] == "4, 46 free of 46, 22 of them modal coordinates"
    assert float(said["rigid motions by the coordinates"].split()[0]) < 1e-9
    assert found.participation @ found.participation == pytest.approx(found.mass, rel=1e-6)


def test_the_truss_held_at_its_interface() -> None:
    """With its boundary held but for z of node 11; second source: rows and columns taken from the file."""
    folder = MODELS / "cla_test_data"
    supports = {"3,19,27": "clamped", "11": ["x", "y", "rx", "ry", "rz"]}
    found = modal(folder / "outboard.op4", folder / "outboard.asm", [3, 11], supports=supports)
    op4 = optional("pyyeti.nastran.op4")
    whole = op4.read(str(folder / "outboard.op4"))
    kept = [7, *range(24, 46)]  # z of node 11, whose own directions are y, z, x of the coordinates
    stiffness, mass = (whole[name][np.ix_(kept, kept)] for name in ("kxx", "mxx"))
    exact = np.sqrt(eigh(stiffness, mass, eigvals_only=True))[: len(found.omega)]
    assert np.abs(found.omega / exact - 1.0).max() < 1e-7


def test_a_model_with_part_of_its_boundary() -> None:
    folder = MODELS / "nas2cam_extseout"
    found = modal(folder / "reduced_bset_notall6.op4", folder / "reduced_bset_notall6.asm", [411, 373])
    assert found.rigid_modes == 6
    assert found.omega[6] / (2.0 * np.pi) == pytest.approx(11.30, abs=0.005)


def test_a_track_needs_degrees_of_freedom() -> None:
    folder = MODELS / "nas2cam_extseout"  # of node 475 the boundary has y alone
    with pytest.raises(ValidationError, match="node 475 of the track does not move along z"):
        modal(folder / "reduced_bset_notall6.op4", folder / "reduced_bset_notall6.asm", [441, 475])


def test_a_superelement_of_op2_and_op4() -> None:
    folder = MODELS / "nas2cam_extseout"
    found = modal(folder / "nas2cam.op4", folder / "nas2cam.op2", [3, 11], superelement=101, modes=18)
    assert np.abs(found.omega[6:] / (2.0 * np.pi) / np.array(PUBLISHED) - 1.0).max() < 5e-7


@pytest.fixture(scope="module")
def punched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Files]:
    """A frame of ours as DMIG cards and GRID cards."""
    files = Files(tmp_path_factory.mktemp("punched"), straight(CLAMPED_FREE, elements=6))
    write_cards(files)
    return files.folder, files


def test_punched_matrices(punched: tuple[Path, Files]) -> None:
    folder, files = punched
    order = (np.argsort(files.assembly.mesh.points[:, 0]) + 1).tolist()
    found = modal(folder / "matrices.pch", folder / "nodes.bdf", order, modes=6)
    wanted = body(straight(CLAMPED_FREE, elements=6, modes=6))
    assert np.abs(found.omega / wanted.omega - 1.0).max() < 1e-6
    nodes = np.linspace(0.0, wanted.length, 7)
    exact = wanted.influence(nodes, nodes)
    assert np.abs(found.influence(nodes, nodes) - exact).max() < 1e-6 * exact.max()


def test_the_content_follows_included_files(punched: tuple[Path, Files]) -> None:
    folder, _ = punched
    table = {"kind": "nastran", "matrices": str(folder / "matrices.pch"), "nodes": str(folder / "nodes.bdf")}
    before = Nastran.model_validate(table | {"track": {"nodes": [1, 2]}, "length_unit": 1.0}).content
    with (folder / "grids.bdf").open("a", encoding="utf-8") as file:
        file.write("$ another revision\n")
    assert Nastran.model_validate(table | {"track": {"nodes": [1, 2]}}).content != before


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"stiffness": "KBB"}, ["stiffness", "kaax, maax", "kbb"]),
        ({"track": {"nodes": [1, 12]}}, ["track", "12"]),
    ],
)
def test_refusals(punched: tuple[Path, Files], keys: dict[str, Any], words: list[str]) -> None:
    folder, _ = punched
    table = {"kind": "nastran", "matrices": str(folder / "matrices.pch"), "nodes": str(folder / "nodes.bdf")}
    with pytest.raises(ValidationError) as caught:
        Nastran.model_validate(table | {"track": {"nodes": [1, 2]}} | keys)
    found = str(caught.value.errors()[0])
    assert all(word in found for word in words), found


@pytest.mark.fault(6)
@pytest.mark.usefixtures("own_process")
def test_damaged_binary_matrices(tmp_path: Path) -> None:
    path, nodes = tmp_path / "cut.op4", str(MODELS / "cla_test_data" / "outboard.asm")
    whole = (MODELS / "cla_test_data" / "outboard.op4").read_bytes()
    path.write_bytes(whole[: len(whole) // 3])
    with pytest.raises(ValidationError) as caught:
        Nastran.model_validate({"kind": "nastran", "matrices": str(path), "nodes": nodes, "track": {"nodes": [3, 11]}})
    assert str(path) in str(caught.value.errors()[0])
