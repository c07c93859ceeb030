"""Solid models out of files as bodies whose frames move: beside their matrices, and what is conserved."""

from itertools import combinations, pairwise, product
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.io import mmwrite
from scipy.sparse import csc_array, kron, save_npz
from scipy.sparse import eye as unity
from scipy.sparse.linalg import spsolve

from engine.bodies.imported.body import motion_of_nodes
from engine.bodies.imported.kinds import Matrices
from engine.floating.model import build
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.bodies.frames import straight
from tests.bodies.models import Files
from tests.floating.scenes import history, largest_drift, steps

LENGTH, WIDTH, HEIGHT, CELLS = 4.0, 0.5, 0.4, 8
DENSITY, BAR = 700.0, 2e6  # kg/m3; E A of the bars, N
FREE = {"kind": "free", "rate": [0.3, -0.5, 0.4], "velocity": [0.1, 0.2, 0.3]}


def one_way(size: float, cells: int) -> np.ndarray:
    """Masses between the nodes of bars in a row."""
    found = np.zeros((cells + 1, cells + 1))
    for cell in range(cells):
        found[cell : cell + 2, cell : cell + 2] += size / cells / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    return found


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, np.ndarray, csc_array]:
    """A row of bricks, whose masses are those of trilinear shapes and whose stiffness is that of bars between all of
    their corners: a body's table, its nodes, and masses between these."""
    folder = tmp_path_factory.mktemp("block")
    grid = [np.linspace(0.0, LENGTH, CELLS + 1), np.array([0.0, WIDTH]), np.array([0.0, HEIGHT])]
    nodes = np.array(list(product(*grid)))
    masses = csc_array(DENSITY * kron(kron(one_way(LENGTH, CELLS), one_way(WIDTH, 1)), one_way(HEIGHT, 1)))
    stiffness = np.zeros((3 * len(nodes), 3 * len(nodes)))
    for one, other in combinations(range(len(nodes)), 2):
        gap = nodes[other] - nodes[one]
        if abs(gap[0]) < 1.01 * LENGTH / CELLS:
            ends = np.concatenate([3 * one + np.arange(3), 3 * other + np.arange(3)])
            row = np.concatenate([-gap, gap]) / np.linalg.norm(gap)
            stiffness[np.ix_(ends, ends)] += BAR / np.linalg.norm(gap) * np.outer(row, row)
    save_npz(folder / "mass.npz", kron(masses, unity(3)).tocsc())
    mmwrite(folder / "stiffness.mtx", csc_array(stiffness), symmetry="symmetric")
    lines = [f"{number},{x!r},{y!r},{z!r}" for number, (x, y, z) in enumerate(nodes.tolist(), start=1)]
    (folder / "nodes.csv").write_text("\n".join(["node,x,y,z", *lines]), encoding="utf-8")
    rows = [f"{number},{way}" for number in range(1, len(nodes) + 1) for way in "xyz"]
    (folder / "freedoms.csv").write_text("\n".join(["node,direction", *rows]), encoding="utf-8")
    names = {"stiffness": "stiffness.mtx", "mass": "mass.npz", "nodes": "nodes.csv", "freedoms": "freedoms.csv"}
    track = {"nodes": [int(n) + 1 for n in np.flatnonzero((nodes[:, 1] == 0.0) & (nodes[:, 2] == HEIGHT))]}
    table = {"kind": "matrices", **{key: str(folder / name) for key, name in names.items()}, "track": track}
    return table | {"modes": 12, "own_weight": True, "damping_ratio": 0.0}, nodes, masses


def scene(body: dict, joint: dict, **more: object) -> Study:
    frame = {"block": {"joints": [joint]}}
    return Study(kind="moving-frames", body={"block": body}, frame=frame, **({"gravity": 0.0} | more))


def test_integrals_are_those_of_the_matrices(block: tuple[dict, np.ndarray, csc_array]) -> None:
    """Of all products of 1, places and shapes."""
    table, nodes, masses = block
    study = scene(table, FREE)
    found = build(study).bodies["block"]
    assert isinstance(study.body["block"], Matrices)
    _, motion = motion_of_nodes(study.body["block"].model_copy(update={"rigid_body_modes": "drop"}))
    axes = np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])
    places, shapes = (nodes - [0, 0, HEIGHT]) @ axes.T, np.einsum("ab,pbn->pan", axes, motion)
    N = shapes.shape[2]

    def products(w: np.ndarray, c: np.ndarray, phi: np.ndarray) -> np.ndarray:
        fields = np.concatenate([np.ones((len(c), 1)), c, phi.reshape(len(c), 3 * N)], axis=1)
        return np.asarray(fields.T @ (w @ fields))

    wanted = products(masses.toarray(), places, shapes)
    own = products(np.diag(found.weights), found.places, found.shapes)
    assert own == pytest.approx(wanted, abs=1e-8 * np.abs(wanted).max())
    assert own[0, 0] == pytest.approx(DENSITY * LENGTH * WIDTH * HEIGHT)


def test_a_free_block_keeps_its_momentum(block: tuple[dict, np.ndarray, csc_array]) -> None:
    """In space, tumbling, with a carriage that slides on it: momentum, angular momentum and energy; order 2."""
    load = {"kind": "mass", "on": "block", "mass": 50.0, "motion": {"kind": "free", "start": 1.0, "speed": 0.3}}
    flying = scene(block[0], FREE, carriage={"load": load})
    drifts = [largest_drift(flying, count) for count in (2000, 4000)]
    assert drifts[0] < 1e-4
    assert np.log2(drifts[0] / drifts[1]) == pytest.approx(2.0, abs=0.3)


def test_what_a_recovery_matrix_tells_of_a_block(block: tuple[dict, np.ndarray, csc_array], tmp_path: Path) -> None:
    """Rises of the track from node to node, as rows of a matrix: those that sensors of its displacements see."""
    table, nodes, _ = block
    track = np.array(table["track"]["nodes"]) - 1
    gap = LENGTH / CELLS
    rows = np.zeros((CELLS + 1, nodes.size))
    for number, (one, other) in enumerate(pairwise(track)):
        rows[number, 3 * one + 2], rows[number, 3 * other + 2] = 1.0 / gap, -1.0 / gap  # z points up in the file
    rows[-1] = rows[-2]
    mmwrite(tmp_path / "recovery.mtx", csc_array(rows))
    told = {"recovery": str(tmp_path / "recovery.mtx"), "strain_rows": [[n + 1] for n in range(CELLS + 1)]}
    held = {"supports": {"1-4": "clamped"}}
    places = {"left": 3 * gap, "right": 4 * gap}
    sensor = {name: {"body": "block", "at": at} for name, at in places.items()}
    sensor["rise"] = {"body": "block", "at": 3 * gap, "quantity": "strain"}
    sensor["between"] = {"body": "block", "at": 3.5 * gap, "quantity": "strain"}
    sensor["next"] = {"body": "block", "at": 4 * gap, "quantity": "strain"}
    turn = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "spin-up", "rate": 1.0, "time": 0.5}}
    model, marched = steps(scene(table | told | held, turn, sensor=sensor, gravity=9.81), 0.5, 500, 50)
    left, right, rise, between, following = history(model, marched, "sensors", 0, 5).T
    assert np.abs(rise).max() > 1e-5
    assert rise == pytest.approx((right - left) / gap, abs=1e-12)
    assert between == pytest.approx(0.5 * (rise + following), abs=1e-12)
    with pytest.raises(BadInput, match=r"sensor\.rise\.quantity: .*strain is not available"):
        scene(table | held, turn, sensor=sensor)


def test_a_torque_at_the_end_of_a_block(block: tuple[dict, np.ndarray, csc_array]) -> None:
    """How far its end turns as long as the torque acts, by four modes with what they leave, beside its matrices; most
    of that is local, and 64 modes alone miss a quarter."""
    held = block[0] | {"supports": {"1-4": "clamped"}}
    joint = {"kind": "prismatic", "axis": [1, 0, 0], "motion": {"kind": "swing", "amplitude": 0.1, "frequency": 1.0}}
    torque = np.array([30.0, 20.0])
    twist = {"twist": {"on": "block", "torque": [0.0, *torque]}}

    def turned(modes: int, corrected: bool) -> np.ndarray:
        given = scene(held | {"modes": modes}, joint, load=twist, solver={"static_correction": corrected})
        body = build(given).bodies["block"]
        rows = body.fields(np.array([LENGTH]), (0,))[0, 0, 4:]
        return np.asarray(rows @ ((torque @ rows) / body.omega**2))

    body = scene(held, joint).body["block"]
    assert isinstance(body, Matrices)
    model, _ = motion_of_nodes(body)
    slopes = CubicSpline(np.linspace(0.0, LENGTH, CELLS + 1), np.eye(CELLS + 1))(LENGTH, 1)
    loads = np.zeros((len(block[1]), 3, 2))  # y and z of the floating frame are the file's, turned round
    loads[np.array(body.line.nodes), 2, 0], loads[np.array(body.line.nodes), 1, 1] = slopes, -slopes
    loads = loads.reshape(-1, 2)[model.free]
    wanted = loads.T @ spsolve(model.stiffness, loads @ torque)
    assert turned(4, True) == pytest.approx(wanted, rel=1e-9)
    assert np.abs(turned(64, False) / wanted - 1.0).max() > 0.25


def test_what_is_not_known_of_a_block_is_refused(block: tuple[dict, np.ndarray, csc_array], tmp_path: Path) -> None:
    table = block[0]
    load = {"kind": "mass", "on": "block", "mass": 5.0, "height": 0.3, "motion": {"kind": "free", "start": 1.0}}
    with pytest.raises(BadInput, match=r"carriage\.load: .*rotation about its track is not known"):
        build(scene(table, FREE, carriage={"load": load}))
    with pytest.raises(BadInput, match=r"body\.block\.supports: nothing holds this body"):
        build(scene(table, {"kind": "revolute", "axis": [0, 1, 0]}))
    beams = Files(tmp_path, straight({}, elements=4)).table(modes=8, own_weight=True)
    with pytest.raises(BadInput, match=r"body\.block\.kind: only solid models"):
        build(scene(beams, FREE))
