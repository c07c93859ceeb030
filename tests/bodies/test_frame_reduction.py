"""Craig-Bampton reductions of frames, rigid-body modes, groups of equal frequencies."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh

import studies
from engine.bodies.frame.assembly import Assembly, assemble, rigid_motions
from engine.bodies.frame.body import interface_freedoms
from engine.bodies.frame.frame import Frame
from engine.bodies.modal.craig_bampton import reduce_model
from engine.bodies.modal.flexibility import factorised
from engine.bodies.modal.modal_body import gauge_at
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.bodies.frames import CLAMPED_FREE, LENGTH, RAIL, beam, body, straight

TUBE = {"second_moment_lateral": RAIL["second_moment"]}


def portal(elements: int = 6, **more: Any) -> dict[str, Any]:
    """Two clamped columns, a beam of three members on them (the track), and a strut across."""
    node = {"a": [0, 0, 0], "b": [6, 0, 0], "c": [0, 0, 4], "d": [2, 0, 4], "e": [4, 0, 4], "f": [6, 0, 4]}
    pairs = {"left": "ac", "right": "bf", "one": "cd", "two": "de", "three": "ef"}
    return {
        "kind": "frame",
        "node": {name: [float(part) for part in place] for name, place in node.items()},
        "section": {"rail": RAIL},
        "member": {
            name: {"nodes": list(pair), "section": "rail", "elements": elements, "up": [0.0, 1.0, 0.0]}
            for name, pair in pairs.items()
        },
        "supports": {"a": "clamped", "b": "clamped"},
        "track": {"members": ["one", "two", "three"]},
        "modes": 10,
    } | more


def parts(table: dict[str, Any]) -> tuple[Frame, Assembly]:
    frame = Frame.model_validate(table)
    return frame, assemble(frame)


def test_frequencies_of_a_portal_are_those_of_a_dense_model() -> None:
    _, model = parts(portal())
    values = eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True)
    np.testing.assert_allclose(body(portal()).omega, np.sqrt(values[:10]), rtol=1e-8)
    fine = portal(elements=30)  # 906 degrees of freedom: the sparse solver
    _, model = parts(fine)
    values = eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True, subset_by_index=[0, 9])
    np.testing.assert_allclose(body(fine).omega, np.sqrt(values), rtol=2e-6)


def test_sway_of_a_clamped_portal() -> None:
    """Stiffness 24 E I/h^3 (1 + 6 k)/(4 + 6 k), k = I_beam h/(I_column l), for members that do not stretch."""
    stiff = RAIL | {"area": 1e3}
    table = portal(
        elements=1, plane="xz", section={"rail": stiff}, track={"members": ["left"], "direction": [1.0, 0, 0]}
    )
    for member in table["member"].values():
        del member["up"]
    k = 4.0 / 6.0
    expected = 4.0**3 / (24.0 * 2.1e11 * RAIL["second_moment"]) * (4.0 + 6.0 * k) / (1.0 + 6.0 * k)
    assert body(table).influence_at([4.0], [4.0])[0] == pytest.approx(expected, rel=1e-6)


def test_point_mass_and_spring() -> None:
    """A nearly massless cantilever with a heavy mass and a spring at its tip: omega^2 = (k + 3 E I/L^3)/m."""
    light = {"density": 1e-3}
    weight, spring = 500.0, 2e4
    table = straight(CLAMPED_FREE, elements=2, section=light, plane="xz", modes=1)
    table["point_mass"] = {"tip": {"node": "b", "mass": weight}}
    table["spring"] = {"prop": {"node": "b", "stiffness": [0.0, 0.0, spring]}}
    held = body(table)
    stiffness = spring + 3.0 * 2.1e11 * RAIL["second_moment"] / LENGTH**3
    assert held.omega[0] == pytest.approx(np.sqrt(stiffness / weight), rel=1e-6)
    assert held.influence_at([LENGTH], [LENGTH])[0] == pytest.approx(1.0 / stiffness, rel=1e-9)
    assert held.own_weight_deflection([LENGTH])[0] == pytest.approx(weight / stiffness, rel=1e-5)
    assert held.participation[0] == pytest.approx(np.sqrt(weight), rel=1e-5)
    table["point_mass"]["tip"] |= {"offset": [1.0, 0.0, 0.0]}
    rod = 2.1e11 * RAIL["second_moment"]
    free = table | {"spring": {}}
    drop = weight * (LENGTH**3 / (3.0 * rod) + LENGTH**2 / (2.0 * rod))
    assert body(free).own_weight_deflection([LENGTH])[0] == pytest.approx(drop, rel=1e-5)
    light_mass = table["point_mass"]["tip"] | {"offset": [0.0, 0.0, 0.0], "inertia": [0.0, 40.0, 0.0]}
    two = body(free | {"point_mass": {"tip": light_mass}, "modes": 2})
    matrix = rod / LENGTH**3 * np.array([[12.0, -6.0 * LENGTH], [-6.0 * LENGTH, 4.0 * LENGTH**2]])
    squares = np.linalg.eigvals(np.diag([1.0 / weight, 1.0 / 40.0]) @ matrix)
    np.testing.assert_allclose(two.omega, np.sort(np.sqrt(squares)), rtol=1e-5)


def test_spring_between_nodes_never_holds_the_frame() -> None:
    table = portal(supports={})
    assert body(table).rigid_modes == 6
    table["spring"] = {"tie": {"node": "c", "to": "f", "stiffness": [1e6, 1e6, 1e6], "rotational": [1e5, 1e5, 1e5]}}
    assert body(table).rigid_modes == 6
    assert body(portal(supports={}, plane="xz", member=_without_up(table))).rigid_modes == 3
    table["spring"]["tie"]["to"] = None
    assert body(table).rigid_modes == 0


def _without_up(table: dict[str, Any]) -> dict[str, Any]:
    return {name: {k: v for k, v in member.items() if k != "up"} for name, member in table["member"].items()}


def test_points_at_the_track_are_places_of_it() -> None:
    """A point where a node of the track is, in the load's direction: rows, influence and own weight are the track's."""
    table = straight({"a": "clamped"}, elements=4, track_offset=[0.0, 0.3, 0.0], modes=6)
    table["point"] = {"tip": {"node": "b", "offset": [0.0, 0.3, 0.0]}, "side": {"node": "b", "direction": [0, 2.0, 0]}}
    table["spring"] = {"prop": {"node": "b", "stiffness": [0.0, 0.0, 1e4]}}
    frame = body(table)
    x = np.linspace(0.0, LENGTH, 9)
    assert frame.points is not None and frame.sections is not None
    np.testing.assert_allclose(frame.points.row("point.tip"), frame.shape([LENGTH])[0], atol=1e-12)
    for j in range(3):
        along = frame.influence(x, [LENGTH], j)[:, 0]
        found = frame.points.influence("point.tip", x, j)
        np.testing.assert_allclose(found[:-1], along[:-1], atol=1e-9 * np.abs(along).max())
    moment = frame.sections.influence_at("bending_moment", x[:-1], LENGTH)
    np.testing.assert_allclose(frame.points.section_influence("bending_moment", "point.tip", x[:-1]), moment, atol=1e-9)
    assert frame.points.between("point.tip", "point.tip") == pytest.approx(frame.influence_at([LENGTH], [LENGTH])[0])
    assert gauge_at(frame, "point.tip").own_weight() == pytest.approx(frame.own_weight_deflection([LENGTH])[0])
    assert frame.points.between("point.side", "point.side") == pytest.approx(LENGTH**3 / (3.0 * 2.1e11 * 3e-6))
    # The spring's upward elongation is the axis's deflection, downwards and without twist.
    assert frame.points.between("spring.prop.z", "point.tip") == pytest.approx(
        frame.points.between("point.tip", "spring.prop.z")
    )
    assert frame.points.between("spring.prop.z", "spring.prop.z") == pytest.approx(
        1.0 / (1e4 + 3.0 * 2.1e11 * RAIL["second_moment"] / LENGTH**3), rel=1e-9
    )


def test_groups_of_equal_frequencies_are_whole() -> None:
    """A square tube: every bending mode comes twice, the one that moves the track first."""
    tube = straight(CLAMPED_FREE, elements=6, modes=3, section=TUBE)
    frame = body(tube)
    assert len(frame.omega) == 4
    np.testing.assert_allclose(frame.omega[::2], frame.omega[1::2], rtol=1e-8)
    tip = np.abs(frame.shape([LENGTH])[0])
    assert tip[1] < 1e-8 * tip[0] and tip[3] < 1e-8 * tip[2]
    assert np.array_equal(body(tube | {"leave_out": [2]}).omega, frame.omega[2:])
    with pytest.raises(BadInput, match="no mode is left"):
        body(tube | {"leave_out": [1, 3]})


@pytest.mark.parametrize("matrix", ["consistent", "lumped"])
def test_sparse_solver_finds_every_mode_of_equal_frequency(matrix: str) -> None:
    """A free square tube, 486 degrees of freedom: six rigid modes, then pairs; the lumped mass matrix is singular."""
    tube = straight({}, elements=80, modes=14, section=TUBE, mass_matrix=matrix)
    omega = body(tube).omega
    assert (omega[:6] == 0.0).all() and len(omega) == 14
    # A group that is cut is kept whole.
    np.testing.assert_allclose(body(tube | {"modes": 13}).omega, omega, rtol=1e-8)
    expected = beam(("free", "free"), 6).omega[2:]
    np.testing.assert_allclose(omega[6::2], expected, rtol=2e-5 if matrix == "consistent" else 2e-3)
    np.testing.assert_allclose(omega[7::2], expected, rtol=2e-5 if matrix == "consistent" else 2e-3)


def test_craig_bampton_frequencies_against_the_full_model() -> None:
    """The reduced pair bounds the full model from above; 12 fixed-interface modes hold ten modes to 1e-3."""
    full = body(portal()).omega
    worst = []
    for count in (0, 4, 8, 12):
        omega = body(portal(interface=["d", "e"], fixed_interface_modes=count)).omega[:10]
        assert (omega > full * (1.0 - 1e-9)).all()
        worst.append(float((omega / full - 1.0).max()))
    assert worst[0] > worst[1] > worst[2] > worst[3]
    assert worst[3] < 5e-3 and worst[0] > 0.05


@pytest.mark.parametrize("count", [0, 4])
def test_craig_bampton_statics_of_interface_loads_are_exact(count: int) -> None:
    frame, model = parts(portal(interface=["d", "e"]))
    interface = interface_freedoms(frame, model)
    held = np.ones(6 * len(model.mesh.points), dtype=np.bool_)
    held[np.delete(model.free, interface)] = False
    none = rigid_motions(model.mesh, held, model.springs)[~held]
    reduction = reduce_model(model.stiffness, model.mass, interface, none, count)
    loads = np.eye(len(model.free))[:, interface]
    exact = np.linalg.solve(model.stiffness.toarray(), loads)
    found = reduction.basis @ np.linalg.solve(reduction.stiffness, reduction.basis.T @ loads)
    np.testing.assert_allclose(found, exact, atol=1e-10 * np.abs(exact).max())


def test_free_body_keeps_its_rigid_modes() -> None:
    free = portal(supports={}, modes=12)
    reduced = body(free | {"interface": ["a", "b", "d"]})
    assert reduced.rigid_modes == 6 and (reduced.omega[:6] == 0.0).all()
    np.testing.assert_allclose(reduced.omega[6:], body(free).omega[6:], rtol=2e-2)


def test_reduced_statics_need_the_residual_between_interface_nodes() -> None:
    """Moment under a load between interface nodes: the kept modes miss it by 15 % and more, whatever their number."""
    x = 2.9
    for count in (0, 4, 12):
        table = portal(interface=["d", "e"], fixed_interface_modes=count, modes="auto")
        reduced, full = body(table), body(portal(modes=64))
        assert reduced.sections is not None and full.sections is not None
        exact = full.sections.influence_at("bending_moment", x, x)[0]
        rows = reduced.sections.rows("bending_moment", [x])[0]
        alone = float(np.sum(rows * reduced.shape([x])[0] / reduced.omega**2))
        assert abs(alone / exact - 1.0) > 0.15
        residual = reduced.sections.influence_at("bending_moment", x, x)[0] - alone
        assert abs((alone + residual) / exact - 1.0) < 1e-9


def test_interface_that_leaves_parts_loose_is_refused() -> None:
    table = straight({}, elements=3)
    table["node"] |= {"c": [0.0, 1.0, 0.0], "d": [5.0, 1.0, 0.0]}
    table["member"]["other"] = table["member"]["span"] | {"nodes": ["c", "d"]}
    table["spring"] = {"link": {"node": "a", "to": "c", "stiffness": [0.0, 0.0, 1e5]}}
    with pytest.raises(BadInput, match="interface"):
        body(table | {"interface": ["a"]})


def test_missing_modes_are_noticed() -> None:
    model = assemble(Frame.model_validate(straight({"a": "clamped"}, elements=80)))
    flexibility = factorised(model.stiffness, model.mass, model.rigid)
    omega, _ = flexibility.modes(9)
    assert flexibility._is_complete(omega**2)
    assert not flexibility._is_complete(np.delete(omega, 4) ** 2)


def with_a_mass(kind: str, **more: Any) -> Study:
    """On the portal."""
    car = {
        "on": "bed",
        "kind": "mass",
        "mass": 500.0,
        "motion": {"kind": "cruise", "start": 0.0, "end": 6.0, "speed": 20.0},
    }
    asked = {"eigenfrequencies": {"question": {"positions": 7, "modes": 4}}, "passage": {"solver": {"audit": 0}}}
    bed = portal() | {"damping_ratio": 0.02} | more
    read = {"sensor": {"middle": {"body": "bed", "at": 2.5}}} if kind == "passage" else {}
    return Study(kind=kind, body={"bed": bed}, carriage={"car": car}, **asked[kind], **read)


@pytest.mark.parametrize(("interface", "count"), [("d", 0), ("d", 4), ("cdef", 2), ("de", 4), ("cf", 2), ("cf", 8)])
def test_what_a_reduction_leaves_out_is_in_the_estimated_errors(interface: str, count: int) -> None:
    """Of twice the modes within the interface they were told: 0 of none, and down to a hundredth of the true ones."""
    reduced = {"interface": list(interface), "fixed_interface_modes": count, "modes": "auto"}
    own, whole = (studies.run(with_a_mass("eigenfrequencies", **more)) for more in (reduced, {"modes": 64}))
    off = np.abs(own.frequency / whole.frequency - 1.0).max("position").values.reshape(-1)
    told = own.estimated_error.values.reshape(-1)[: off.size]
    assert off.max() > 5e-4 and np.all((told >= off) & (told <= 1.5 * off + 1e-5))


def test_where_no_number_of_modes_is_enough_the_reduction_is_named() -> None:
    reduced = {"interface": ["d"], "fixed_interface_modes": 2, "modes": "auto"}
    asked = {"question.unreduced": 3, "question.mode_counts": [4, 8]}
    given = with_a_mass("eigenfrequencies", **reduced).with_values(asked)
    named = "All of them lie within body.bed.fixed_interface_modes: more of these help."
    assert sum(named in said for said in studies.answer(studies.run(given))) == 1
    enough = given.with_values({"body.bed.interface": [], "question.mode_counts": [8, 40]})
    assert not any("lie within" in said for said in studies.answer(studies.run(enough)))


@pytest.mark.parametrize(("interface", "count"), [("d", 0), ("cf", 2)])
def test_of_marches_too(interface: str, count: int) -> None:
    reduced = {"interface": list(interface), "fixed_interface_modes": count, "modes": "auto"}
    own, whole = (studies.run(with_a_mass("passage", **more)) for more in (reduced, {"modes": 64}))
    off = abs(float(own.middle_max / whole.middle_max) - 1.0)
    told = float(studies.errors(own).middle_max / own.middle_max)
    assert 1e-2 < off <= told <= 5.0 * off
