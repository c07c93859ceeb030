"""A straight frame is a beam: against the engine's uniform beam and closed forms."""

from typing import Any

import numpy as np
import pytest

from engine.bodies.frame.assembly import assemble
from engine.bodies.frame.frame import Frame
from engine.bodies.frame.track import track_of
from engine.bodies.modal.flexibility import factorised
from engine.bodies.modal.modal_body import Array
from results_schema.errors import BadInput
from tests.bodies.frames import (
    AREA,
    CLAMPED_FREE,
    DENSITY,
    LENGTH,
    MODULUS,
    PINNED,
    SECOND_MOMENT,
    beam,
    body,
    straight,
    turned,
)

X, S = np.linspace(0.0, LENGTH, 37), np.linspace(0.0, LENGTH, 29)
PLANE = {"plane": "xz"}
ENDS: dict[tuple[str, str], dict[str, Any]] = {
    ("pinned", "pinned"): {"a": "pinned", "b": ["z"]},
    ("clamped", "free"): {"a": "clamped"},
    ("clamped", "pinned"): {"a": "clamped", "b": ["z"]},
    ("clamped", "clamped"): {"a": "clamped", "b": ["z", "ry"]},
}
SHEAR = MODULUS / 2.6


def worst(found: Array, expected: Array) -> float:
    """Largest difference over the largest expected value; NaN fails every comparison."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("ends", ENDS)
def test_influence_lines_are_those_of_the_beam(ends: tuple[str, str]) -> None:
    frame, exact = body(straight(ENDS[ends], elements=7, **PLANE)), beam(ends, 1)
    x, s = np.meshgrid(X, S, indexing="ij")
    for j in range(4):
        assert worst(frame.influence(X, S, j), exact.influence(X, S, j)) < 1e-9
        assert np.array_equal(frame.influence_at(x, s, j), frame.influence(X, S, j))
        assert worst(frame.own_weight_deflection(X, j), exact.own_weight_deflection(X, j)) < 1e-9


@pytest.mark.parametrize("ends", ENDS)
def test_modes_are_those_of_the_beam(ends: tuple[str, str]) -> None:
    table = straight(ENDS[ends], elements=80, modes=4, **PLANE)
    frame, exact = body(table), beam(ends, 4)
    np.testing.assert_allclose(frame.omega, exact.omega, rtol=1e-6)
    np.testing.assert_allclose(frame.wave_number, exact.wave_number, rtol=1e-6)
    np.testing.assert_allclose(frame.participation, exact.participation, atol=2e-5 * exact.participation.max())
    for j in range(4):
        assert worst(frame.shape(X, j), exact.shape(X, j)) < (4e-6, 4e-6, 1e-5, 1e-4)[j]
    assert frame.mass == pytest.approx(exact.mass, rel=1e-14)


def test_free_beam_has_inertia_relief() -> None:
    frame, exact = body(straight({}, elements=24, modes=6, **PLANE)), beam(("free", "free"), 5)
    assert frame.rigid_modes == 3
    assert (frame.omega[:3] == 0.0).all()
    np.testing.assert_allclose(frame.omega[3:], exact.omega[2:], rtol=5e-5)
    for j in range(3):
        assert worst(frame.influence(X, S, j), exact.influence(X, S, j)) < (5e-6, 5e-5, 5e-3)[j]
    with pytest.raises(BadInput, match="own weight"):
        frame.own_weight_deflection([1.0])


def test_influence_is_the_sum_over_all_modes() -> None:
    table = straight({}, elements=4, modes=64, track_offset=[0.0, 0.4, 0.0])
    frame = body(table)
    nodes = np.linspace(0.0, LENGTH, 5)
    rows = frame.shape(nodes)[:, frame.rigid_modes :]
    total = (rows / frame.omega[frame.rigid_modes :] ** 2) @ rows.T
    assert frame.rigid_modes == 6 and len(frame.omega) == 30
    assert worst(frame.influence(nodes, nodes), total) < 1e-9


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_section_forces_of_a_pinned_beam(theory: str) -> None:
    """M = (1 - s/L) x left of the load, V its slope; under own weight q x (L - x)/2."""
    frame = body(straight(PINNED, elements=5, member_theory=theory))
    x, s = (grid.reshape(-1) for grid in np.meshgrid(X, S, indexing="ij"))
    moment = np.where(x <= s, (1.0 - s / LENGTH) * x, s * (1.0 - x / LENGTH))
    shear = np.where((x < s) | ((x == LENGTH) & (s == LENGTH)), 1.0 - s / LENGTH, -s / LENGTH)
    assert frame.sections is not None
    assert worst(frame.sections.influence_at("bending_moment", x, s), moment) < 1e-9
    assert worst(frame.sections.influence_at("shear_force", x, s), shear) < 1e-9
    assert worst(frame.sections.influence_at("stress", x, s), moment * 0.1 / SECOND_MOMENT) < 1e-9
    assert worst(frame.sections.influence_at("strain", x, s), moment * 0.1 / SECOND_MOMENT / MODULUS) < 1e-9
    line = DENSITY * AREA
    assert worst(frame.sections.own_weight("bending_moment", X), line * X * (LENGTH - X) / 2.0) < 1e-9
    assert worst(frame.sections.own_weight("shear_force", X), line * (LENGTH / 2.0 - X)) < 1e-9
    with pytest.raises(BadInput, match="bending_moment"):
        frame.sections.rows("moment", [1.0])


def timoshenko(number: int, second_moment: float = SECOND_MOMENT, shear_area: float = 1e-4) -> float:
    """Lower root of the pinned Timoshenko beam's frequency equation (Huang 1961), rad/s."""
    k = number * np.pi / LENGTH
    stiff, soft = MODULUS * second_moment * k**2 + SHEAR * shear_area, SHEAR * shear_area * k
    mass, turn = DENSITY * AREA, DENSITY * second_moment
    roots = np.roots([mass * turn, -(mass * stiff + turn * soft * k), stiff * soft * k - soft**2])
    return float(np.sqrt(roots.min()))


@pytest.mark.parametrize(("suffix", "direction"), [("", [0.0, 0.0, -1.0]), ("_lateral", [0.0, -1.0, 0.0])])
def test_rotary_inertia_of_timoshenko_members(suffix: str, direction: list[float]) -> None:
    """A deep web, upright or lying: frequencies, wave numbers, and moments M sin(k x) of its modes on a coarse mesh."""
    deep = {f"second_moment{suffix}": 2e-3, f"shear_area{suffix}": 1e-3}
    held = {"a": ["x", "y", "z", "rx"], "b": ["x", "y", "z"]}
    more: dict[str, Any] = {"member_theory": "timoshenko", "section": deep, "track_direction": direction, "modes": 24}
    frame = body(straight(held, elements=12, **more))
    felt = np.flatnonzero(np.abs(frame.shape(X)).max(axis=0) > 1e-6)[:2]
    np.testing.assert_allclose(frame.omega[felt], [timoshenko(n, 2e-3, 1e-3) for n in (1, 2)], rtol=1e-2)
    k = np.array([1.0, 2.0]) * np.pi / LENGTH
    np.testing.assert_allclose(frame.wave_number[felt], k, rtol=1e-2)
    assert frame.sections is not None
    moments = frame.sections.rows("bending_moment", X)[:, felt]
    for mode in range(2):
        wave = np.sin(k[mode] * X)
        size = (moments[:, mode] @ wave) / (wave @ wave)
        assert worst(moments[:, mode], size * wave) < (5e-5, 3e-4)[mode]
    fine = body(straight(held, elements=96, **more | {"modes": 30}))
    felt = np.flatnonzero(np.abs(fine.shape(X)).max(axis=0) > 1e-6)[:2]
    expected = [timoshenko(n, 2e-3, 1e-3) for n in (1, 2)]
    np.testing.assert_allclose(fine.omega[felt], expected, rtol=2e-4)
    bare = np.sqrt(np.sqrt(np.square(expected) * DENSITY * AREA / (MODULUS * 2e-3)))
    np.testing.assert_allclose(fine.wave_number[felt], k, rtol=5e-4)
    assert (fine.wave_number[felt] > 1.02 * bare).all()  # waves of a deep beam are shorter than Euler-Bernoulli's


def test_timoshenko_statics() -> None:
    """Cantilever under a force: P x/(G A_s) more up to the load; own weight q (L x - x^2/2)/(G A_s) more."""
    frame = body(straight(CLAMPED_FREE, elements=3, member_theory="timoshenko", section={"shear_area": 1e-4}))
    slender = beam(("clamped", "free"), 1)
    extra = np.minimum(X[:, None], S[None, :]) / (SHEAR * 1e-4)
    assert worst(frame.influence(X, S), slender.influence(X, S) + extra) < 1e-9
    more = DENSITY * AREA * (LENGTH * X - X**2 / 2.0) / (SHEAR * 1e-4)
    assert worst(frame.own_weight_deflection(X), slender.own_weight_deflection(X) + more) < 1e-9


@pytest.mark.parametrize(
    ("still", "speed"),
    [
        ("x", np.sqrt(MODULUS / DENSITY)),
        ("rx", np.sqrt(SHEAR * 5.0e-6 / (DENSITY * (SECOND_MOMENT + 3.0e-6)))),
    ],
)
def test_bars(still: str, speed: float) -> None:
    """Clamped-free bars in extension and torsion: (2 n - 1) pi c/(2 L)."""
    others = [word for word in ("x", "y", "z", "rx", "ry", "rz") if word != still]
    held = straight({"a": "clamped", "b": others}, elements=80)
    model = assemble(Frame.model_validate(held))
    alone = np.flatnonzero(model.free % 6 == ("x", "y", "z", "rx").index(still))
    pair = (matrix[alone][:, alone].tocsc() for matrix in (model.stiffness, model.mass))
    omega, _ = factorised(*pair, np.zeros((len(alone), 0))).modes(3)
    expected = (2.0 * np.arange(1, 4) - 1.0) * np.pi * speed / (2.0 * LENGTH)
    np.testing.assert_allclose(omega, expected, rtol=1e-3)


def test_load_beside_the_axis_twists() -> None:
    """Cantilever, load at s beside the axis: e^2 min(x, s)/(G J) more than bending."""
    offset = 0.3
    frame = body(straight(CLAMPED_FREE, elements=4, track_offset=[0.0, offset, 0.0]))
    twist = offset**2 * np.minimum(X[:, None], S[None, :]) / (SHEAR * 5.0e-6)
    expected = beam(("clamped", "free"), 1).influence(X, S) + twist
    assert worst(frame.influence(X, S), expected) < 1e-9
    assert frame.sections is not None
    torque = frame.sections.influence_at("torque", [1.0, 6.0], 5.0)
    np.testing.assert_allclose(np.abs(torque), [offset, 0.0], atol=1e-9)
    assert worst(frame.own_weight_deflection(X), beam(("clamped", "free"), 1).own_weight_deflection(X)) < 1e-9


def test_lateral_loads_bend_the_other_way() -> None:
    frame = body(straight(CLAMPED_FREE, elements=3, track_direction=[0.0, 1.0, 0.0]))
    assert frame.influence_at([LENGTH], [LENGTH])[0] == pytest.approx(LENGTH**3 / (3.0 * MODULUS * 3.0e-6), rel=1e-9)
    oblique = body(straight(CLAMPED_FREE, elements=3, track_direction=[0.0, 3.0, 4.0]))
    soft = 0.36 / 3.0e-6 + 0.64 / SECOND_MOMENT
    assert oblique.influence_at([LENGTH], [LENGTH])[0] == pytest.approx(LENGTH**3 / (3.0 * MODULUS) * soft, rel=1e-9)
    assert oblique.sections is not None
    moment = oblique.sections.influence_at("bending_moment", [0.0], [LENGTH])[0]
    assert moment == pytest.approx(-LENGTH, rel=1e-9)
    stress = oblique.sections.influence_at("stress", [0.0], [LENGTH])[0]
    edges = 0.64 * 0.1 / SECOND_MOMENT + 0.36 * 0.05 / 3.0e-6
    assert stress == pytest.approx(-LENGTH * edges, rel=1e-9)


def test_inclined_track_is_compressed() -> None:
    """A strut at 45 degrees, clamped below: the vertical load bends it by half and compresses it by half."""
    table = straight(CLAMPED_FREE, elements=4)
    table["node"] = {"a": [0.0, 0.0, 0.0], "b": [LENGTH / np.sqrt(2.0), 0.0, LENGTH / np.sqrt(2.0)]}
    frame, bent = body(table), beam(("clamped", "free"), 1)
    pressed = np.minimum(X[:, None], S[None, :]) / (MODULUS * AREA)
    assert worst(frame.influence(X, S), 0.5 * bent.influence(X, S) + 0.5 * pressed) < 1e-9
    assert frame.sections is not None
    half = np.sqrt(0.5)
    assert frame.sections.influence_at("axial_force", [3.0], [9.0])[0] == pytest.approx(-half, rel=1e-9)
    stress = -half / AREA - half * 6.0 * 0.1 / SECOND_MOMENT
    assert frame.sections.influence_at("stress", [3.0], [9.0])[0] == pytest.approx(stress, rel=1e-9)
    line = DENSITY * AREA
    shortened = line * (LENGTH * X - X**2 / 2.0) / (MODULUS * AREA)
    assert worst(frame.own_weight_deflection(X), 0.5 * bent.own_weight_deflection(X) + 0.5 * shortened) < 1e-9
    model = Frame.model_validate(table)
    track, _ = track_of(model, assemble(model).mesh)
    fast = np.array([1e7])  # where extension has the shorter waves
    np.testing.assert_allclose(track.wave_number(fast), fast * np.sqrt(DENSITY / MODULUS), rtol=1e-12)


def test_turning_the_frame_in_space_changes_nothing() -> None:
    upright = {"member_up": [0.0, 0.0, 1.0], "track_offset": [0.0, 0.3, 0.0], "modes": 8}
    table = straight({"a": "clamped", "b": "pinned"}, elements=6, **upright)
    axis, angle = np.array([1.0, 2.0, -2.0]) / 3.0, 1.1
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    matrix = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    one, other = body(table), body(turned(table, matrix))
    np.testing.assert_allclose(other.omega, one.omega, rtol=1e-9)
    np.testing.assert_allclose(other.participation, one.participation, atol=1e-7 * np.abs(one.participation).max())
    for j in range(3):
        assert worst(other.influence(X, S, j), one.influence(X, S, j)) < 1e-8
        assert worst(other.shape(X, j), one.shape(X, j)) < 1e-6
    assert one.sections is not None and other.sections is not None
    for quantity in ("bending_moment", "shear_force", "stress"):
        assert worst(other.sections.rows(quantity, X), one.sections.rows(quantity, X)) < 1e-6


@pytest.mark.parametrize(("matrix", "order"), [("consistent", 4.0), ("lumped", 4.0)])
def test_order_of_convergence(matrix: str, order: float) -> None:
    exact = beam(("pinned", "pinned"), 2).omega[1]
    errors = []
    for elements in (8, 16):
        frame = body(straight(ENDS["pinned", "pinned"], elements=elements, modes=3, mass_matrix=matrix, **PLANE))
        errors.append(abs(frame.omega[1] / exact - 1.0))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


def test_members_end_to_end_and_backwards_are_one_track() -> None:
    table = straight(PINNED)
    table["node"]["m"] = [6.0, 0.0, 0.0]
    table["member"] = {
        "first": {"nodes": ["m", "a"], "section": "rail", "elements": 3},
        "second": {"nodes": ["m", "b"], "section": "rail", "elements": 4},
    }
    table["track"] = {"members": ["first", "second"]}
    assert worst(body(table).influence(X, S), beam(("pinned", "pinned"), 1).influence(X, S)) < 1e-9
    table["track"] = {"members": ["second", "first"]}
    assert worst(body(table).influence(X, S), beam(("pinned", "pinned"), 1).influence(X, S)[::-1, ::-1]) < 1e-9


def test_an_arm_lengthens_the_lever() -> None:
    """A clamped column carries a cantilever that starts 0.5 m beside its head: its head turns and sinks by the load."""
    height, arm = 3.0, 0.5
    table = straight({"foot": "clamped"}, elements=4, member_offsets=[[arm, 0.0, 0.0], [0.0, 0.0, 0.0]])
    table["node"] |= {"foot": [0.0, 0.0, -height], "b": [LENGTH + arm, 0.0, 0.0]}
    table["member"]["column"] = {"nodes": ["foot", "a"], "section": "rail", "elements": 2, "up": [-1.0, 0.0, 0.0]}
    turned_by = height / (MODULUS * SECOND_MOMENT) * np.outer(X + arm, S + arm)
    expected = beam(("clamped", "free"), 1).influence(X, S) + turned_by + height / (MODULUS * AREA)
    frame = body(table)
    assert frame.length == pytest.approx(LENGTH)
    assert worst(frame.influence(X, S), expected) < 1e-9
    rows = frame.shape([0.0], 1)[0] * arm  # at the arm's end the track moves by the head's turn times the arm
    assert np.abs(frame.shape([0.0])[0] - rows).max() < 1e-2 * np.abs(rows).max()
