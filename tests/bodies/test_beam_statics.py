"""Influence lines: closed forms, reciprocity, equilibrium, inertia relief and the modal sums they complete."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.bodies.beam.modes import uniform_beam
from engine.bodies.modal.modal_body import Array, ModalBody
from results_schema.errors import BadInput
from tests.bodies.beams import uniform, unit
from tests.bodies.waves import Support, hermite_model
from tests.reference import closed_forms

X = np.linspace(0.0, 1.0, 41)
FREE_BODIES: dict[str, dict[str, Any]] = {
    "free-free": {"ends": ("free", "free")},
    "pinned-free": {"ends": ("pinned", "free")},
    "free-pinned": {"ends": ("free", "pinned")},
    "one spring": {"supports": ((0.3, 40.0),)},
    "rotary springs": {"supports": ((0.3, 0.0, 5.0), (0.8, 0.0, 2.0))},
}


def unit_beam(modes: int = 1, **how: Any) -> ModalBody:
    return uniform_beam(unit(**how), modes)


def on_springs(*supports: Support) -> ModalBody:
    return unit_beam(supports=supports)


def modal_sum(body: ModalBody, x: Array, s: Array, derivative: int = 0) -> Array:
    """Flexibility of the kept elastic modes."""
    elastic = slice(body.rigid_modes, None)
    rows = body.shape(x, derivative)[:, elastic] / body.omega[elastic] ** 2
    total: Array = rows @ body.shape(s)[:, elastic].T
    return total


@pytest.mark.parametrize(
    ("ends", "formula"),
    [
        (("pinned", "pinned"), closed_forms.influence_pinned),
        (("clamped", "free"), closed_forms.influence_cantilever),
        (("clamped", "clamped"), closed_forms.influence_clamped),
    ],
)
def test_influence_on_rigid_ends_is_the_closed_form(ends: tuple[str, str], formula: object) -> None:
    expected = np.array([[formula(x, s) for s in X] for x in X])  # type: ignore[operator]
    np.testing.assert_allclose(unit_beam(ends=ends).influence(X, X), expected, atol=1e-12 * expected.max())


@pytest.mark.parametrize("springs", [(100.0, 20.0), (1e12, 1e-9), (1e-9, 1e-9), (1e12, 1e12)])
def test_influence_on_end_springs_is_the_closed_form(springs: tuple[float, float]) -> None:
    body = on_springs((0.0, springs[0], 0.0), (1.0, springs[1], 0.0))
    expected = np.array([[closed_forms.influence_end_springs(x, s, springs) for s in X] for x in X])
    np.testing.assert_allclose(body.influence(X, X), expected, atol=1e-12 * expected.max())


def test_bending_moment_and_shear_of_a_pinned_beam() -> None:
    """M = (1 - s) x left of the force and s (1 - x) right of it; at the force the shear is taken from the right."""
    body = unit_beam()
    x, s = np.meshgrid(X, X[1:-1], indexing="ij")
    moment, shear = -body.influence(X, X[1:-1], 2), -body.influence(X, X[1:-1], 3)
    np.testing.assert_allclose(moment, np.where(x <= s, (1.0 - s) * x, s * (1.0 - x)), atol=1e-14)
    np.testing.assert_allclose(shear, np.where(x < s, 1.0 - s, -s), atol=1e-14)
    cantilever = unit_beam(ends=("clamped", "free"))
    np.testing.assert_allclose(-cantilever.influence([0.0, 0.5, 1.0], [1.0], 3), 1.0, atol=1e-14)


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_derivatives_belong_together(derivative: int) -> None:
    body = on_springs((0.1, 30.0, 2.0), (0.6, 1e3, 0.0), (1.0, 4.0, 0.0))
    x, s, h = np.array([0.05, 0.3, 0.45, 0.77]), np.array([0.2, 0.5]), 1e-5
    slope = (body.influence(x + h, s, derivative) - body.influence(x - h, s, derivative)) / (2.0 * h)
    np.testing.assert_allclose(slope, body.influence(x, s, derivative + 1), rtol=1e-7, atol=1e-8)


def test_influence_agrees_with_a_finite_element_model() -> None:
    """Cubic elements are exact at their nodes under nodal forces."""
    supports = ((0.1, 300.0, 2.0), (0.5, 5e4, 0.0), (0.55, 10.0, 40.0), (1.0, 1e3, 0.0))
    stiffness, _ = hermite_model(supports, 20)
    expected = np.linalg.inv(stiffness)
    nodes = np.linspace(0.0, 1.0, 21)
    body = on_springs(*supports)
    np.testing.assert_allclose(body.influence(nodes, nodes), expected[::2, ::2], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(body.influence(nodes, nodes, 1), expected[1::2, ::2], rtol=1e-9, atol=1e-11)


def test_pairs_are_the_entries_of_the_table_bit_for_bit() -> None:
    body = on_springs((0.1, 30.0, 2.0), (0.6, 1e3, 0.0))
    s = np.random.default_rng(5).random(60)
    for j in range(4):
        table = body.influence(s, s, j)
        assert np.array_equal(body.influence_at(s, s, j), np.diag(table))
        assert np.array_equal(body.influence(s[7:9], s[3:4], j), table[7:9, 3:4])


@pytest.mark.parametrize("name", FREE_BODIES)
def test_inertia_relief_is_the_sum_over_the_elastic_modes(name: str) -> None:
    body = unit_beam(64, **FREE_BODIES[name])
    rigid = body.rigid_modes
    assert rigid > 0
    exact = body.influence(X, X)
    np.testing.assert_allclose(exact, modal_sum(body, X, X), atol=4e-7)
    np.testing.assert_allclose(body.influence(X, X, 1), modal_sum(body, X, X, 1), atol=1e-4)
    points, weights = np.polynomial.legendre.leggauss(60)
    for s in (0.0, 0.3, 0.8, 1.0):  # orthogonal to rigid motion, by quadrature on both sides of jumps
        cuts = np.unique([0.0, 0.3, 0.8, 1.0])
        total = np.zeros(rigid)
        for a, b in itertools.pairwise(cuts):
            place = a + (b - a) * (0.5 + 0.5 * points)
            total += (0.5 * (b - a) * weights * body.influence(place, [s])[:, 0]) @ body.shape(place)[:, :rigid]
        np.testing.assert_allclose(total, 0.0, atol=1e-15)
    ends = body.influence([0.0, 1.0], [0.37], 2)
    np.testing.assert_allclose(ends, 0.0, atol=1e-14)


def test_what_the_modes_leave_out_falls_like_the_third_power_of_their_number() -> None:
    """Midspan of a pinned beam: 16/(pi^4 (N+1)^3) of the static deflection, moment 4/(pi^2 (N+1)), N odd."""
    for modes in (7, 15, 31, 63):
        body = unit_beam(modes)
        left = 48.0 * (body.influence([0.5], [0.5]) - modal_sum(body, np.array([0.5]), np.array([0.5])))
        assert left.item() == pytest.approx(16.0 / (math.pi**4 * (modes + 1) ** 3), rel=2.5 / (modes + 1) ** 2)
        bend = body.influence([0.5], [0.5], 2) - modal_sum(body, np.array([0.5]), np.array([0.5]), 2)
        assert -4.0 * bend.item() == pytest.approx(4.0 / (math.pi**2 * (modes + 1)), rel=2.5 / (modes + 1) ** 2)


@pytest.mark.parametrize("how", [{}, {"ends": ("clamped", "free")}, {"supports": ((0.2, 50.0), (0.9, 8.0, 3.0))}])
def test_own_weight_is_the_integral_of_the_influence_and_the_modal_sum(how: dict[str, Any]) -> None:
    body = unit_beam(64, **how)
    points, weights = np.polynomial.legendre.leggauss(4)
    for x in (0.0, 0.37, 0.8, 1.0):
        total = 0.0
        cuts = np.unique([0.0, 0.2, x, 0.9, 1.0])
        for a, b in itertools.pairwise(cuts):
            s = a + (b - a) * (0.5 + 0.5 * points)
            total += 0.5 * (b - a) * float(body.influence([x], s)[0] @ weights)
        assert body.own_weight_deflection([x]).item() == pytest.approx(total, rel=1e-12, abs=1e-16)
    modal = body.shape(X) @ (body.participation / body.omega**2)
    np.testing.assert_allclose(body.own_weight_deflection(X), modal, rtol=1e-7, atol=1e-9)


def test_own_weight_of_a_pinned_beam_in_units() -> None:
    body = uniform_beam(uniform(15.0, 0.01, 8.33e-6, 210e9, 7850.0), 1)
    x = np.linspace(0.0, 15.0, 31)
    stiffness, weight = 210e9 * 8.33e-6, 78.5
    expected = [closed_forms.own_weight_pinned(place / 15.0) * weight * 15.0**4 / stiffness for place in x]
    np.testing.assert_allclose(body.own_weight_deflection(x), expected, atol=1e-13 * max(expected))
    np.testing.assert_allclose(-stiffness * body.own_weight_deflection(x, 2), weight * x * (15.0 - x) / 2.0, atol=1e-9)
    np.testing.assert_allclose(-stiffness * body.own_weight_deflection(x, 3), weight * (7.5 - x), atol=1e-9)
    force = body.influence([4.0], [9.0]).item()
    assert force == pytest.approx(closed_forms.influence_pinned(4.0, 9.0, 15.0, stiffness), rel=1e-13)


def test_own_weight_of_a_body_that_nothing_holds_is_refused() -> None:
    with pytest.raises(BadInput, match="own weight"):
        unit_beam(ends=("free", "pinned")).own_weight_deflection(X)


springs = st.lists(
    st.tuples(st.integers(0, 200), st.floats(-9.0, 12.0), st.floats(-9.0, 12.0)),
    min_size=2,
    max_size=5,
    unique_by=lambda one: one[0],
)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(springs)
def test_any_springs_reciprocity_equilibrium_and_positive_energy(drawn: list[tuple[int, float, float]]) -> None:
    supports = tuple((at / 200.0, 10.0**k, 10.0**k_r) for at, k, k_r in drawn)
    body = on_springs(*supports)
    table = body.influence(X, X)
    scale = np.abs(table).max()
    np.testing.assert_allclose(table, table.T, atol=1e-10 * scale)
    assert np.linalg.eigvalsh(0.5 * (table + table.T)).min() > -1e-10 * scale


@settings(max_examples=40, deadline=None, derandomize=True)
@given(springs)
def test_any_springs_their_forces_add_up_to_the_unit_force(drawn: list[tuple[int, float, float]]) -> None:
    """Sum of k w(x_j); k at most 1e6, beyond that it only multiplies the rounding of w."""
    supports = tuple((at / 200.0, 10.0 ** min(k, 6.0), 10.0**k_r) for at, k, k_r in drawn)
    at, k, _ = np.array(supports).T
    deflection = on_springs(*supports).influence(at, X)
    lost = 1e-10 * float(k @ np.abs(deflection).max(axis=1))
    np.testing.assert_allclose(k @ deflection, 1.0, atol=2e-6 + lost)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(springs, st.floats(0.02, 0.98))
def test_any_springs_free_ends_carry_no_moment_and_the_force_is_the_jump_of_the_shear(
    drawn: list[tuple[int, float, float]], s: float
) -> None:
    supports = tuple((0.05 + 0.9 * at / 200.0, 10.0**k, 10.0**k_r) for at, k, k_r in drawn)
    body = on_springs(*supports)
    most = 1.0 + np.abs(body.influence(X, [s], 2)).max() + np.abs(body.influence(X, [s], 3)).max()
    np.testing.assert_allclose(body.influence([0.0, 1.0], [s], 2), 0.0, atol=1e-8 * most)
    np.testing.assert_allclose(body.influence([0.0], [s], 3), 0.0, atol=1e-8 * most)
    if min(abs(s - at) for at, _, _ in supports) > 1e-6:
        jump = body.influence([s], [s], 3) - body.influence([s - 1e-9], [s], 3)
        np.testing.assert_allclose(jump, 1.0, atol=1e-8 * most)


@pytest.mark.parametrize(("x", "s", "derivative"), [(-0.1, 0.5, 0), (0.5, 1.1, 0), (math.nan, 0.5, 0), (0.5, 0.5, 4)])
def test_places_off_the_beam_and_unknown_derivatives_are_refused(x: float, s: float, derivative: int) -> None:
    body = unit_beam()
    for bad in (body.influence, body.influence_at):
        with pytest.raises(BadInput):
            bad([x], [s], derivative)
