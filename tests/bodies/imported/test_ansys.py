"""The solid beam that comes with ansys-mapdl-reader: its frequencies, and statics along its top edge."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.interpolate import CubicSpline
from scipy.sparse import csc_array, triu
from scipy.sparse.linalg import spsolve

import engine
from engine.bodies.build import build_body
from engine.bodies.files.ansys_results import recovery_along
from engine.bodies.files.model import FileModel
from engine.bodies.files.track import line_between
from engine.bodies.imported.kinds import Ansys
from engine.bodies.modal.modal_body import ModalBody
from results_schema.errors import BadInput
from tests.bodies.models import optional

pytestmark = pytest.mark.extras
full = optional("ansys.mapdl.reader.full")
archive = optional("mapdl_archive")

EXAMPLES = Path(full.__file__).parent / "examples"
TABLE: dict[str, Any] = {
    "kind": "ansys",
    "full": str(EXAMPLES / "file.full"),
    "nodes": str(EXAMPLES / "HexBeam.cdb"),
    "gravity_direction": [0.0, -1.0, 0.0],
    "track": {"from": [0.0, 1.0, 0.0], "to": [0.0, 1.0, 5.0]},
    "modes": 6,
}
PUBLISHED = (1283.200, 1283.200, 5781.975, 6919.399)  # Hz


@pytest.fixture(scope="module")
def beam() -> ModalBody:
    return build_body(Ansys.model_validate(TABLE))


def test_frequencies(beam: ModalBody) -> None:
    frequencies = beam.omega[:4] / (2.0 * np.pi)
    assert np.abs(frequencies / np.array(PUBLISHED) - 1.0).max() < 1e-5 / 13  # as printed: 5e-7
    assert beam.rigid_modes == 0 and beam.length == 5.0
    said = dict(beam.checks)
    assert said["nodes, degrees of freedom"] == "321, 900 free of 963"
    assert said["track"] == "21 nodes from 10 to 31, 1 of them held along the load"
    assert said["centre of mass"].endswith("among the nodes")


def direct(places: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """(X, S) deflection at places per unit load, down being -y: file and spline read here, solved by scipy."""
    rows, stiffness, _ = full.FullFile(str(EXAMPLES / "file.full")).load_km(as_sparse=True, sort=True)
    mesh = archive.Archive(str(EXAMPLES / "HexBeam.cdb"), parse_vtk=False)
    edge = np.flatnonzero((np.abs(mesh.nodes[:, 0]) < 1e-9) & (np.abs(mesh.nodes[:, 1] - 1.0) < 1e-9))
    edge = edge[np.argsort(mesh.nodes[edge, 2])]
    free = np.flatnonzero(stiffness.diagonal() != 0.0)
    inner = (stiffness + triu(stiffness, 1).T).tocsc()[free][:, free]
    at = {(int(node), int(way)): row for row, (node, way) in enumerate(rows[free])}
    spline = CubicSpline(mesh.nodes[edge, 2], np.eye(len(edge)))
    found = np.zeros((len(free), len(edge)))
    for column, node in enumerate(mesh.nnum[edge]):
        if (int(node), 1) in at:
            found[at[int(node), 1], column] = -1.0
    moved = np.array([spsolve(inner, found @ spline(float(s))) for s in loads]).T
    return np.asarray(spline(places) @ found.T @ moved)


def test_a_load_along_the_top_edge(beam: ModalBody) -> None:
    places, loads = np.linspace(0.0, 5.0, 23), np.array([0.4, 1.3, 2.5, 3.77, 5.0])
    wanted = direct(places, loads)
    assert np.abs(beam.influence(places, loads) - wanted).max() < 1e-10 * wanted.max()


def passage(speed: float, steps: int) -> Any:
    motion = {"kind": "cruise", "start": 0.0, "end": 5.0, "speed": speed}
    study = engine.Study(
        kind="passage",
        body={"beam": TABLE | {"damping_ratio": 0.5}},
        carriage={"load": {"on": "beam", "kind": "force", "force": 1000.0, "motion": motion}},
        sensor={"tip": {"body": "beam", "at": 4.9}, "under": {"under": "load"}},
        solver={"steps": steps},
        output={"histories": "all"},
    )
    return engine.run(study)


def test_the_slow_limit_of_the_march_is_the_direct_solve() -> None:
    """With static correction six modes give the whole deflection, the local dent under the load included.

    Damping lags behind in proportion to the speed, so that twice the slower run minus the faster one is the limit.
    """
    steps = 32_000
    slow, fast = passage(20.0, steps), passage(40.0, steps // 2)
    some, other = slice(steps // 20, steps, steps // 20), slice(steps // 40, steps // 2, steps // 40)
    places = slow["load_position"].values[some]
    assert np.abs(places - fast["load_position"].values[other]).max() < 1e-9
    tip = 1000.0 * direct(np.array([4.9]), places)[0]
    under = 1000.0 * np.diag(direct(places, places))
    for name, wanted in (("tip", tip), ("under", under)):
        limit = 2.0 * slow[name].values[some] - fast[name].values[other]
        assert np.abs(limit - wanted).max() < 1e-7 * tip.max()


def test_nodes_of_a_result_file(beam: ModalBody) -> None:
    other = build_body(Ansys.model_validate(TABLE | {"nodes": str(EXAMPLES / "file.rst")}))
    assert np.array_equal(other.omega, beam.omega)


def test_solid_elements_have_no_rotations() -> None:
    table = TABLE | {"track": TABLE["track"] | {"interpolation": "rotations"}}
    with pytest.raises(BadInput, match=r"track\.interpolation.*no rotations"):
        build_body(Ansys.model_validate(table))


def words_of(table: dict[str, Any]) -> str:
    with pytest.raises(ValidationError) as caught:
        Ansys.model_validate(table)
    detail = caught.value.errors()[0]
    assert detail["type"] == "wanderlast"
    return f"{detail['loc']} {detail['ctx']}"


@pytest.mark.fault(6)
@pytest.mark.usefixtures("own_process")
def test_damaged_matrices(tmp_path: Path) -> None:
    whole = (EXAMPLES / "file.full").read_bytes()
    path = tmp_path / "cut.full"
    path.write_bytes(whole[: len(whole) // 2])
    found = words_of(TABLE | {"full": str(path)})
    assert "full" in found and str(path) in found, found


def test_damaged_nodes(tmp_path: Path) -> None:
    text = (EXAMPLES / "HexBeam.cdb").read_text(encoding="utf-8").splitlines(keepends=True)
    path = tmp_path / "nodes.cdb"
    path.write_text("".join([*text[:100], *text[101:]]), encoding="utf-8")
    assert "nodes are missing" in words_of(TABLE | {"nodes": str(path)})
    head = [line.replace("321,       321", "320,       320") for line in text]
    path.write_text("".join([*head[:100], *head[101:]]), encoding="utf-8")
    assert "node 65 of" in words_of(TABLE | {"nodes": str(path)})


RESULTS = {"results": str(EXAMPLES / "file.rst"), "component": "z"}


@pytest.fixture(scope="module")
def results() -> Any:
    """Six modes of the same beam, free of supports, with their element results."""
    return optional("ansys.mapdl.reader").read_binary(RESULTS["results"])


@pytest.fixture(scope="module")
def model(results: Any) -> FileModel:
    """Matrices whose modes are those of the results, all other motions faster: M = P^T P + I - F P and
    K = M F diag(omega^2) F^T M + c (I - F P), F the shapes and P their pseudoinverse, made symmetric."""
    shapes = np.array([results.nodal_solution(k)[1].reshape(-1) for k in range(6)]).T
    inverse, count = np.linalg.pinv(shapes), len(shapes)
    others, squares = np.eye(count) - shapes @ inverse, (2.0 * np.pi * np.asarray(results.time_values)) ** 2
    mass = inverse.T @ inverse + others
    stiffness = mass @ shapes * squares @ shapes.T @ mass + 1e3 * squares.max() * others
    owner, direction = np.divmod(np.arange(count), 3)
    matrices = (csc_array(0.5 * (one + one.T)) for one in (stiffness, mass))
    nodes, places = np.array(results.mesh.nnum, dtype=np.int64), np.array(results.mesh.nodes)
    return FileModel(*matrices, nodes, places, owner, direction, np.zeros(count, dtype=bool))


def test_stress_of_the_modes_is_that_of_the_elements(
    results: Any, model: FileModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the file has them at the corners of elements, midway between two corners their mean. Twin modes may turn."""
    line = line_between(model.nodes, model.places, (np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0, 5.0])), None)
    recovery = recovery_along(model, RESULTS["results"], line, "z")
    monkeypatch.setattr("engine.bodies.imported.imported.read_files", lambda _: replace(model, recovery=recovery))
    found = build_body(Ansys.model_validate(TABLE | RESULTS))
    assert found.sections is not None
    numbers = model.nodes[line.nodes]
    for quantity, read in (("stress", results.nodal_stress), ("strain", results.nodal_elastic_strain)):
        wanted = np.array([read(k)[1][np.searchsorted(read(k)[0], numbers), 2] for k in range(6)]).T
        known, rows = np.isfinite(wanted).all(axis=1), found.sections.rows(quantity, line.places)
        assert known.sum() == 11 and (~known).sum() == 10
        given, told = (np.stack([np.hypot(part[:, 0], part[:, 1]), np.abs(part[:, 2])]) for part in (rows, wanted))
        assert np.abs(given[:, known] - told[:, known]).max() < 1e-6 * told[:, known].max()
        middle = 0.5 * (rows[0:-1:2] + rows[2::2])
        assert np.abs(rows[1::2] - middle).max() < 1e-9 * np.abs(rows).max()


def test_results_of_another_analysis_are_refused(model: FileModel) -> None:
    """The matrices of the beam that is held at one end, and modes that are not orthogonal."""
    assert "mode 1 of the results is none of these matrices" in words_of(TABLE | RESULTS)
    assert "expected" in words_of(TABLE | RESULTS) and "38228.8 Hz by its shape" in words_of(TABLE | RESULTS)
    line = line_between(model.nodes, model.places, (np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0, 5.0])), None)
    with pytest.raises(BadInput, match="none of these matrices"):
        recovery_along(replace(model, stiffness=1.01 * model.stiffness), RESULTS["results"], line, "z")
    short = replace(line, nodes=line.nodes[:-1], places=line.places[:-1])
    with pytest.raises(BadInput, match="where the track ends"):
        recovery_along(model, RESULTS["results"], short, "z")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"results": RESULTS["results"]}, "component"),
        ({"component": "z"}, "results"),
        (RESULTS | {"component": "r"}, "component"),
        (RESULTS | {"results": TABLE["full"]}, "no .rst file"),
        (RESULTS | {"results": "none.rst"}, "no such file"),
        (RESULTS | {"track": {"nodes": [1, 5000]}}, "track"),
    ],
)
def test_results_that_do_not_fit(more: dict[str, Any], words: str) -> None:
    assert words in words_of(TABLE | more)
