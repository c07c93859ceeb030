"""Bodies of plain files against the frames that they were written from, and every refusal with its place."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.io import mmwrite
from scipy.sparse import block_diag, csc_array, csc_matrix, csr_array, load_npz, save_npz
from scipy.sparse.linalg import spsolve

import engine
from engine.batch.plan import make_plan
from engine.batch.plausibility import remarks
from engine.bodies.build import build_body
from engine.bodies.imported.kinds import Matrices
from engine.bodies.modal.modal_body import ModalBody, gauge_at
from engine.scene.study import Study, load
from engine.study_file.document import write_document
from results_schema.errors import BadInput
from studies.commands.preview import preview
from studies.protocol.parts import Variants
from studies.protocol.study import kind_of
from studies.runs.identity import run_key
from tests.bodies.frames import CLAMPED_FREE, LENGTH, PINNED, body, straight
from tests.bodies.models import Files, refusal, study

X = np.linspace(0.0, LENGTH, 31)


@pytest.fixture(scope="module")
def loose(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """A frame that nothing holds: its files have all rows."""
    return Files(tmp_path_factory.mktemp("loose"), straight({}, elements=12))


def modal(table: Any) -> ModalBody:
    return build_body(Matrices.model_validate(table))


def test_the_frames_own_modes_and_influence_lines(files: Files) -> None:
    found, frame = modal(files.table(modes=10)), body(straight(PINNED, elements=16, modes=10))
    assert np.abs(found.omega / frame.omega - 1.0).max() < 1e-10
    assert found.length == LENGTH and found.rigid_modes == 0
    nodes = np.linspace(0.0, LENGTH, 17)  # where the frame's statics are the model's
    exact = frame.influence(nodes, nodes)
    assert np.abs(found.influence(nodes, nodes) - exact).max() < 1e-10 * exact.max()
    slopes = frame.influence(nodes, nodes, 1)
    assert np.abs(found.influence(nodes, nodes, 1) - slopes).max() < 1e-10 * np.abs(slopes).max()
    assert np.abs(found.influence(X, X) - frame.influence(X, X)).max() < 1e-4 * exact.max()
    shapes = frame.shape(nodes)[:, :4]
    assert np.abs(found.shape(nodes)[:, :4] - shapes).max() < 1e-8 * np.abs(shapes).max()
    curvature = frame.shape(nodes[1:-1], 2)[:, 1]
    assert np.abs(found.shape(nodes[1:-1] + 1e-9, 2)[:, 1] - curvature).max() < 0.01 * np.abs(curvature).max()


@pytest.mark.parametrize("interpolation", ["rotations", "spline"])
def test_statics_are_a_direct_solve_with_the_same_interpolation(files: Files, interpolation: str) -> None:
    """Second source: scipy's splines of unit vectors, and its direct solver, on the frame's assembled matrix."""
    assembly = files.assembly
    order = np.argsort(assembly.mesh.points[:, 0])
    places, total = assembly.mesh.points[order, 0], 6 * len(order)

    def weights(s: float, derivative: int = 0) -> np.ndarray:
        found = np.zeros((len(order), 6))
        unit = np.eye(len(order))
        if interpolation == "spline":
            found[order, 2] = -CubicSpline(places, unit)(s, derivative)
        else:  # down is -z; a positive rotation about y tilts a line along x down
            none = np.zeros_like(unit)
            found[order, 2] = -CubicHermiteSpline(places, unit, none)(s, derivative)
            found[order, 4] = CubicHermiteSpline(places, none, unit)(s, derivative)
        return found.reshape(total)[assembly.free]

    track = files.table()["track"] | {"interpolation": interpolation}
    found, x = modal(files.table(track=track)), np.array([0.3, 4.0, 7.7, 11.9])
    for s in (0.2, 6.1, 9.99, 14.8):
        moved = spsolve(csc_array(assembly.stiffness), weights(s))
        for derivative in range(4):
            wanted = np.array([weights(float(place), derivative) @ moved for place in x])
            line = found.influence(x, [s], derivative)[:, 0]
            assert np.abs(line - wanted).max() < 1e-10 * np.abs(wanted).max()
            assert np.array_equal(found.influence_at(x, [s] * 4, derivative), line)


def test_supports_of_the_study_hold_what_the_files_leave_free(loose: Files) -> None:
    exact = body(straight(PINNED, elements=12))
    supports = {"1": ["x", "y", "z", "rx"], "2": ["y", "z"]}
    found = modal(loose.table(supports=supports, track={"nodes": [1, *range(3, 14), 2]}))
    assert np.abs(found.omega / exact.omega - 1.0).max() < 1e-9
    assert found.mass == pytest.approx(exact.mass, rel=1e-12)
    assert np.abs(found.participation - exact.participation).max() < 1e-8 * np.abs(exact.participation).max()
    nodes = np.linspace(0.0, LENGTH, 13)
    sag = exact.own_weight_deflection(nodes)
    assert np.abs(found.own_weight_deflection(nodes) - sag).max() < 1e-9 * sag.max()
    other = modal(loose.table(supports={"1-2": ["y", "z"], "1": ["x", "rx"]}))
    assert np.abs(other.omega / exact.omega - 1.0).max() < 1e-9
    clamped = modal(loose.table(supports={"1": "clamped"}))
    assert np.abs(clamped.omega / body(straight(CLAMPED_FREE, elements=12)).omega - 1.0).max() < 1e-9


def test_a_body_that_nothing_holds(loose: Files) -> None:
    found, frame = modal(loose.table(modes=12)), body(straight({}, elements=12, modes=12))
    assert found.rigid_modes == frame.rigid_modes == 6
    assert np.abs(found.omega[6:] / frame.omega[6:] - 1.0).max() < 1e-8
    nodes = np.linspace(0.0, LENGTH, 13)
    exact = frame.influence(nodes, nodes)
    assert np.abs(found.influence(nodes, nodes) - exact).max() < 1e-8 * np.abs(exact).max()
    with pytest.raises(BadInput, match="own weight"):
        found.own_weight_deflection(nodes)
    dropped = modal(loose.table(modes=12, rigid_body_modes="drop"))
    assert dropped.rigid_modes == 0 and np.array_equal(dropped.omega, found.omega[6:])
    said = dict(found.checks)
    assert said["rigid-body modes"] == "6"
    assert said["mass by rigid motions"].startswith(f"{frame.mass:.6g} kg in all")
    assert said["centre of mass"] == "(7.5, 0, 0) m, among the nodes"
    assert float(said["rigid motions by the coordinates"].split()[0]) < 1e-10


@pytest.mark.parametrize("exchanged", [False, True])
def test_a_stiffness_that_moves_otherwise_than_its_nodes_is_doubted(
    loose: Files, tmp_path: Path, exchanged: bool
) -> None:
    """Rotations about two axes exchanged, or nodes in mm: one number among others was all that told of it."""
    held, name = {"1": "clamped"}, "freedoms.csv" if exchanged else "nodes.csv"
    lines = (loose.folder / name).read_text(encoding="utf-8").splitlines()
    other = {"rx": "ry", "ry": "rx"}
    for n, line in enumerate(lines[1:], start=1):
        node, *rest = line.split(",")
        told = [other.get(way, way) for way in rest] if exchanged else [repr(1e3 * float(x)) for x in rest]
        lines[n] = ",".join([node, *told])
    (tmp_path / name).write_text("\n".join(lines), encoding="utf-8")
    changes: dict[str, Any] = {name.partition(".")[0]: str(tmp_path / name)}
    if not exchanged:
        changes["track"] = {"from": [0.0, 0.0, 0.0], "to": [1e3 * LENGTH, 0.0, 0.0]}
    (said,) = modal(loose.table(supports=held, **changes)).doubts
    assert "length_unit" in said and "exchanged" in said and float(said.split()[0]) > 0.01
    assert not modal(loose.table(supports=held)).doubts
    assert "length_unit" in str(refusal(loose.table(**changes)))  # where nothing holds it
    plan = make_plan(study(loose.table(supports=held, **changes), initial="rest"))
    assert [f"bed: {said}"] == [text for text in remarks(plan) if text.startswith("bed: ")]


@pytest.mark.parametrize(("per_metre", "words"), [(1e-5, "kg on 15 m of track"), (1.0, ""), (1e5, "in other units")])
def test_a_mass_that_no_structure_of_its_length_has_is_doubted(
    loose: Files, tmp_path: Path, per_metre: float, words: str
) -> None:
    scaled = per_metre * load_npz(loose.folder / "mass.npz")
    save_npz(tmp_path / "mass.npz", scaled)
    said = modal(loose.table(mass=str(tmp_path / "mass.npz"), supports={"1": "clamped"})).doubts
    assert len(said) == bool(words) and all(words in one for one in said)


def test_rows_in_another_order_than_the_freedoms_are_doubted(loose: Files, tmp_path: Path) -> None:
    """Of a bed whose displacements came first the mass was 477, 1273 and 487 kg along x, y and z, told in one row among
    others; of a beam, whose masses are then the same, it is where they stand from the last to the first."""
    size = load_npz(loose.folder / "mass.npz").shape[0]
    order = np.arange(size)[::-1]
    on_springs = loose.assembly.stiffness + 1e6 * csc_array(np.eye(size))
    given = {"mass": loose.assembly.mass, "stiffness": on_springs}
    for name, matrix in given.items():
        save_npz(tmp_path / f"{name}.npz", csc_matrix(csr_array(matrix)[order][:, order]))
    told = modal(loose.table(**{name: str(tmp_path / f"{name}.npz") for name in given}))
    assert any("kg along x, y, z: are rows of its matrices in another order" in one for one in told.doubts)


@pytest.mark.parametrize(("kept", "ways", "centre"), [((0, 2, 4), "x, z", "0.4"), ((2, 4), "z", "unknown")])
def test_the_mass_of_a_plane_model(loose: Files, tmp_path: Path, kept: tuple[int, ...], ways: str, centre: str) -> None:
    """Nodes that move in some directions only, beside the origin: mass and centre are told of these."""
    rows = np.flatnonzero(np.isin(loose.assembly.free % 6, kept))
    places = {name: str(tmp_path / name) for name in ("nodes.csv", "freedoms.csv", "mass.npz", "stiffness.npz")}
    points = [f"{number},{x!r},-0.2,0.4" for number, x in enumerate(loose.assembly.mesh.points[:, 0].tolist(), start=1)]
    lines = (loose.folder / "freedoms.csv").read_text(encoding="utf-8").splitlines()
    for name, text in (
        ("nodes.csv", ["node,x,y,z", *points]),
        ("freedoms.csv", [lines[0], *(lines[r + 1] for r in rows)]),
    ):
        Path(places[name]).write_text("\n".join(text), encoding="utf-8")
    for name, matrix in (("mass.npz", loose.assembly.mass), ("stiffness.npz", loose.assembly.stiffness)):
        save_npz(places[name], csc_matrix(matrix)[rows][:, rows])
    track = {"from": [0, -0.2, 0.4], "to": [LENGTH, -0.2, 0.4]}
    supports = {"1": [("x", "y", "z", "rx", "ry", "rz")[way] for way in kept]}
    files = {name.partition(".")[0]: place for name, place in places.items()}
    said = dict(modal(loose.table(**files, track=track, supports=supports)).checks)
    assert said["mass by rigid motions"] == f"{body(straight({}, elements=12)).mass:.6g} kg along {ways}"
    assert said["centre of mass"] == f"(7.5, -0.2, {centre}) m, among the nodes"


def test_massless_degrees_of_freedom(tmp_path: Path) -> None:
    table = straight(PINNED, elements=8, mass_matrix="lumped")
    files = Files(tmp_path, table)
    mass = files.assembly.mass.tolil()
    turning = np.flatnonzero(files.assembly.free % 6 >= 3)
    mass[turning, turning] = 0.0
    save_npz(tmp_path / "mass.npz", csc_matrix(mass))
    found = modal(files.table(modes=5))
    stiffness = files.assembly.stiffness.toarray()
    moving = np.setdiff1d(np.arange(len(stiffness)), turning)
    inner = stiffness[np.ix_(turning, turning)]
    condensed = stiffness[np.ix_(moving, moving)] - stiffness[np.ix_(moving, turning)] @ np.linalg.solve(
        inner, stiffness[np.ix_(turning, moving)]
    )
    scale = 1.0 / np.sqrt(mass.toarray()[moving, moving])
    exact = np.sqrt(np.linalg.eigvalsh(condensed * np.outer(scale, scale)))[:5]
    assert np.abs(found.omega[:5] / exact - 1.0).max() < 1e-8
    assert dict(found.checks)["massless degrees of freedom"].startswith(f"{len(turning)} of")
    free = Files(tmp_path, straight({}, elements=8))
    mass = free.assembly.mass.tolil()
    turning = np.flatnonzero(free.assembly.free % 6 >= 3)
    mass[turning, :] = 0.0
    mass[:, turning] = 0.0
    save_npz(tmp_path / "mass.npz", csc_matrix(mass))
    assert "moves no mass" in str(refusal(free.table()))  # it spins about its own line


def test_units_of_the_files(loose: Files, tmp_path: Path) -> None:
    """The same frame in millimetres and kilonewtons."""
    files = Files(tmp_path, straight({}, elements=12))
    moves = files.assembly.free % 6 < 3
    scale = np.where(moves, 1e-3, 1.0) / np.sqrt(1e-3 * 1e3)
    for name, matrix in (("stiffness", files.assembly.stiffness), ("mass", files.assembly.mass)):
        turned = csc_matrix(matrix.multiply(np.outer(scale, scale)))
        mmwrite(tmp_path / f"{name}.mtx", turned)
    rows = [
        f"{n + 1},{1e3 * x!r},{1e3 * y!r},{1e3 * z!r}"
        for n, (x, y, z) in enumerate(files.assembly.mesh.points.tolist())
    ]
    (tmp_path / "nodes.csv").write_text("\n".join(rows), encoding="utf-8")
    units = {"length_unit": "1 mm", "force_unit": "1 kN", "supports": {"1": "clamped"}}
    found = modal(
        Study(kind="passage", body={"bed": files.table(mass=str(tmp_path / "mass.mtx"), **units)}).body["bed"]
    )
    wanted = modal(loose.table(supports={"1": "clamped"}))
    assert not found.doubts and float(dict(found.checks)["rigid motions by the coordinates"].split()[0]) < 1e-10
    assert np.abs(found.omega / wanted.omega - 1.0).max() < 1e-9
    assert found.mass == pytest.approx(wanted.mass, rel=1e-9)
    assert (
        np.abs(
            found.influence(X, X) / np.abs(wanted.influence(X, X)).max()
            - wanted.influence(X, X) / np.abs(wanted.influence(X, X)).max()
        ).max()
        < 1e-9
    )


def test_stiffness_and_mass_in_each_others_place_are_doubted(loose: Files) -> None:
    other = {"stiffness": str(loose.folder / "mass.npz"), "mass": str(loose.folder / "stiffness.mtx")}
    (said,) = modal(loose.table(supports={"1": "clamped"}, **other)).doubts
    assert "are stiffness and mass exchanged" in said


def test_an_inclined_track_stretches(tmp_path: Path) -> None:
    """Under a vertical load an inclined, axially soft beam gives way along itself too: slopes have both parts."""
    table = straight(CLAMPED_FREE, elements=16, section={"area": 1e-6}) | {
        "node": {"a": [0.0, 0.0, 0.0], "b": [10.0, 0.0, 10.0]}
    }
    found, frame = modal(Files(tmp_path, table).table()), body(table)
    places = np.linspace(0.0, found.length, 33)[1:-1]
    exact = frame.influence(places, [found.length])
    assert np.abs(found.influence(places, [found.length]) - exact).max() < 1e-4 * exact.max()
    nodes = np.linspace(0.0, found.length, 17)[1:-1]
    slopes = frame.influence(nodes, [found.length], 1)
    assert np.abs(found.influence(nodes, [found.length], 1) - slopes).max() < 1e-3 * np.abs(slopes).max()
    level = straight(CLAMPED_FREE, elements=16) | {"node": table["node"]}
    assert exact.max() > 1.05 * body(level).influence(places, [found.length]).max()


def test_wave_numbers(files: Files) -> None:
    found = modal(files.table(modes=10))
    sagging = [mode for mode in range(10) if found.wave_number[mode] > 0.0]
    waves = np.arange(1, len(sagging) + 1) * np.pi / LENGTH
    assert len(sagging) >= 4 and np.abs(found.wave_number[sagging] / waves - 1.0).max() < 0.01


def test_points_and_other_directions(loose: Files) -> None:
    supports = {"1": "clamped"}
    table = loose.table(supports=supports, point={"tip": {"node": 2}, "side": {"node": 2, "direction": [0, 1, 0]}})
    found = modal(table)
    assert found.points is not None
    assert np.abs(found.points.row("point.tip") - found.shape([LENGTH])[0]).max() < 1e-12
    assert found.points.between("point.tip", "point.tip") == pytest.approx(found.influence([LENGTH], [LENGTH])[0, 0])
    assert np.abs(found.points.influence("point.tip", X) - found.influence(X, [LENGTH])[:, 0]).max() < 1e-15
    assert abs(found.points.between("point.tip", "point.side")) < 1e-15
    assert gauge_at(found, "point.tip").own_weight() == pytest.approx(found.own_weight_deflection([LENGTH])[0])
    lateral = loose.table(supports=supports)
    lateral["track"] |= {"direction": [0.0, 1.0, 0.0]}
    sideways, frame = modal(lateral), body(straight(CLAMPED_FREE, elements=12, track_direction=[0.0, 1.0, 0.0]))
    nodes = np.linspace(0.0, LENGTH, 13)
    exact = frame.influence(nodes, nodes)
    assert np.abs(sideways.influence(nodes, nodes) - exact).max() < 1e-9 * exact.max()
    assert sideways.gravity_share == 0.0


@pytest.mark.usefixtures("own_process")
def test_a_passage_is_the_frames(files: Files) -> None:
    given = engine.run(study(files.table(modes=8, damping_ratio=0.01), output={"histories": "all"}))
    frame = engine.run(study(straight(PINNED, elements=16, modes=8, damping_ratio=0.01), output={"histories": "all"}))
    scale = float(np.abs(frame["middle"]).max())
    assert given["middle"].shape == frame["middle"].shape and int(given["status"]) == 0
    assert float(np.abs(given["middle"].values - frame["middle"].values).max()) < 2e-4 * scale


@pytest.mark.usefixtures("own_process")
def test_modes_that_are_left_open_hold_the_tolerance(files: Files) -> None:
    """Against all that a study may ask for: what is told is no less than the difference."""
    found, most = (
        engine.run(study(files.table(damping_ratio=0.01) | more, solver={"tolerance": tolerance}))
        for more, tolerance in (({}, 1e-4), ({"modes": 64}, 1e-6))
    )
    off = abs(float(found["middle_max"] / most["middle_max"]) - 1.0)
    assert int(found["status"]) == 0 and 12 < int(found["modes_used"]) <= 64
    assert 0.0 < off <= float(found["estimated_error"].sel(result="middle_max")) < 1e-4


def test_modes_of_bodies_that_drop_rigid_ones_are_not_left_open(loose: Files) -> None:
    """Few of them would all be rigid."""
    kept, dropped = (Matrices.model_validate(loose.table(rigid_body_modes=word)) for word in ("keep", "drop"))
    assert kept.modes_are_open and not dropped.modes_are_open


@pytest.mark.usefixtures("own_process")
def test_checks_are_printed_and_the_key_follows_the_files(files: Files, tmp_path: Path) -> None:
    copy = Files(tmp_path, straight(PINNED, elements=16))
    given = study(copy.table())
    plan, parts = make_plan(given), Variants(kind_of(given), given)
    shown = next(table for table in preview(parts, 1).tables if table.title == "Import of bed")
    assert ("rigid-body modes", "none: the supports hold the body") in shown.rows
    save_npz(tmp_path / "mass.npz", csc_matrix(2.0 * copy.assembly.mass))
    again = make_plan(study(copy.table()))
    assert run_key(again.study) != run_key(given)
    assert np.abs(again.base.bodies[0].modal.omega / plan.base.bodies[0].modal.omega - 0.5**0.5).max() < 1e-9
    assert load(write_document({"schema_version": 1} | study(copy.table()).data)).body["bed"].length == LENGTH


def test_matrix_formats(files: Files, tmp_path: Path) -> None:
    wanted = modal(files.table()).omega
    dense = tmp_path / "dense.mtx"
    mmwrite(dense, files.assembly.mass.toarray(), symmetry="symmetric")
    general = tmp_path / "general.mtx"
    mmwrite(general, files.assembly.stiffness, symmetry="general")
    found = modal(files.table(mass=str(dense), stiffness=str(general))).omega
    assert np.abs(found / wanted - 1.0).max() < 1e-9
    for form in ("coo", "csr"):
        save_npz(tmp_path / "form.npz", files.assembly.mass.asformat(form))
        assert np.array_equal(modal(files.table(mass=str(tmp_path / "form.npz"))).omega, wanted)


@pytest.mark.parametrize("end", [(LENGTH, 0.0, 0.0), (11.0, 7.0, 6.0)])
def test_a_loose_part_beside_the_body(tmp_path: Path, end: tuple[float, float, float]) -> None:
    """A second piece that nothing holds is no rigid-body mode of the whole; with exact zeros or almost."""
    frame = {"node": {"a": [0.0, 0.0, 0.0], "b": list(end)}}
    files = Files(tmp_path, straight({}, elements=4) | frame)
    twice = {name: block_diag([getattr(files.assembly, name)] * 2) for name in ("stiffness", "mass")}
    for name, matrix in twice.items():
        save_npz(tmp_path / f"{name}.npz", csc_matrix(matrix))
    points = files.assembly.mesh.points
    places = np.concatenate([points, points + np.array([0.0, 5.0, 0.0])]).tolist()
    lines = [f"{number},{x},{y},{z}" for number, (x, y, z) in enumerate(places, start=1)]
    (tmp_path / "nodes.csv").write_text("\n".join(lines), encoding="utf-8")
    table = files.table(stiffness=str(tmp_path / "stiffness.npz"), supports={"1": "clamped"})
    del table["freedoms"]
    found = str(refusal(table))
    assert "bed.supports" in found and "without strain" in found
    both = modal(table | {"supports": {"1": "clamped", "6": "clamped"}, "modes": 8})
    single = body(straight(CLAMPED_FREE, elements=4, modes=4) | frame)
    assert np.abs(both.omega[::2] / single.omega - 1.0).max() < 1e-8
