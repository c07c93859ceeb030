"""Modes of beams: frequencies, shapes, orthonormality, limits, and what a bad beam says."""

import itertools
import math

import numpy as np
import pytest

from engine.bodies.beam.modes import MOST_MODES, uniform_beam
from engine.bodies.modal.modal_body import Array, ModalBody
from results_schema.errors import BadInput
from tests.bodies.beams import uniform, unit
from tests.bodies.waves import Support, WaveBeam
from tests.reference.closed_forms import CLAMPED, FREE, PINNED, characteristic_values

MODES = 64
KINDS = {"pinned": PINNED, "clamped": CLAMPED, "free": FREE}
ALL_ENDS = [(left, right) for left in KINDS for right in KINDS]
SUPPORTS: dict[str, tuple[Support, ...]] = {
    "end springs": ((0.0, 50.0, 0.0), (1.0, 20.0, 3.0)),
    "soft": ((0.0, 1e-9, 0.0), (0.3, 2e-9, 0.0), (1.0, 3e-9, 1e-9)),
    "stiff": ((0.0, 1e12, 0.0), (0.37, 1e12, 1e12), (1.0, 1e12, 0.0)),
    "close together": ((0.3, 1e12, 0.0), (0.301, 1e12, 0.0)),
    "close, stiff and soft": ((0.3, 1e12, 0.0), (0.301, 1e-9, 0.0), (0.8, 100.0, 0.0)),
    "redundant, stiff and soft": ((0.0, 1e-9, 0.0), (0.3, 1e12, 0.0), (0.301, 1e12, 0.0), (0.8, 1e12, 0.0)),
    "one spring": ((0.4, 100.0, 0.0),),
    "rotary only": ((0.4, 0.0, 10.0), (0.7, 0.0, 1e-3)),
    "sleepers": tuple((float(x), 1e5, 0.0) for x in np.linspace(0.0, 1.0, 13)),
}


def on_ends(left: str, right: str, modes: int = MODES) -> ModalBody:
    return uniform_beam(unit(ends=(left, right)), modes)


def on_springs(supports: tuple[Support, ...], modes: int = MODES) -> ModalBody:
    return uniform_beam(unit(supports=supports), modes)


def gauss(places: list[float], pieces: int = 10) -> tuple[Array, Array]:
    """Points and weights on [0, 1], between the given places; exact enough for 64 modes squared."""
    points, weights = np.polynomial.legendre.leggauss(40)
    found: list[tuple[Array, Array]] = []
    inner = np.unique([0.0, 1.0, *places])
    for left, right in itertools.pairwise(inner):
        cuts = np.linspace(left, right, 1 + math.ceil((right - left) * pieces))
        for a, b in itertools.pairwise(cuts):
            found.append((a + (b - a) * (0.5 + 0.5 * points), 0.5 * (b - a) * weights))
    return np.concatenate([x for x, _ in found]), np.concatenate([w for _, w in found])


def energies(body: ModalBody, supports: tuple[Support, ...]) -> tuple[Array, Array]:
    """Modal mass and modal stiffness matrices by quadrature of the shapes."""
    x, weights = gauss([at for at, _, _ in supports])
    shape, curvature = body.shape(x), body.shape(x, 2)
    mass = (shape.T * weights) @ shape
    stiffness = (curvature.T * weights) @ curvature
    for at, k, k_r in supports:
        stiffness += k * body.shape([at]).T @ body.shape([at]) + k_r * body.shape([at], 1).T @ body.shape([at], 1)
    return mass, stiffness


@pytest.mark.parametrize("ends", ALL_ENDS, ids="-".join)
def test_frequencies_are_the_roots_of_the_characteristic_equation(ends: tuple[str, str]) -> None:
    body = on_ends(*ends)
    rigid = body.rigid_modes
    expected = characteristic_values(KINDS[ends[0]], KINDS[ends[1]], MODES - rigid)
    assert rigid == {"free": {"free": 2, "pinned": 1}, "pinned": {"free": 1}}.get(ends[0], {}).get(ends[1], 0)
    assert np.all(body.omega[:rigid] == 0.0)
    np.testing.assert_allclose(body.omega[rigid:], np.square(expected), rtol=1e-13)
    np.testing.assert_allclose(body.wave_number[rigid:], expected, rtol=1e-13)


@pytest.mark.parametrize("ends", ALL_ENDS, ids="-".join)
def test_sixty_four_modes_are_orthonormal(ends: tuple[str, str]) -> None:
    body = on_ends(*ends)
    mass, stiffness = energies(body, ())
    np.testing.assert_allclose(mass, np.eye(MODES), atol=2e-13)
    np.testing.assert_allclose(stiffness, np.diag(body.omega**2), atol=1e-12 * body.omega[-1] ** 2)


@pytest.mark.parametrize("name", SUPPORTS)
def test_modes_on_springs_keep_mass_and_stiffness_diagonal(name: str) -> None:
    body = on_springs(SUPPORTS[name])
    mass, stiffness = energies(body, SUPPORTS[name])
    np.testing.assert_allclose(mass, np.eye(MODES), atol=3e-13)
    np.testing.assert_allclose(np.diag(stiffness), body.omega**2, rtol=1e-11, atol=1e-25)
    np.testing.assert_allclose(stiffness, np.diag(body.omega**2), atol=1e-12 * body.omega[-1] ** 2)


@pytest.mark.parametrize("name", SUPPORTS)
def test_modes_on_springs_are_the_exact_waves(name: str) -> None:
    body, exact = on_springs(SUPPORTS[name]), WaveBeam(SUPPORTS[name])
    x = np.linspace(0.0, 1.0, 41)
    shapes = [body.shape(x, j) for j in range(4)]
    for mode in (0, 1, 2, 3, 4, 6, 11, 25, 40, 63):
        b = float(body.wave_number[mode])
        if b < 0.1:  # rigid motion, free or on soft springs (the waves lose their digits): tests below
            continue
        assert exact.sign(b * (1.0 - 3e-12)) * exact.sign(b * (1.0 + 3e-12)) == -1.0, (mode, b)
        wave = [exact.shape(b, x, j) for j in range(4)]
        scale = float(wave[0] @ shapes[0][:, mode]) / float(wave[0] @ wave[0])
        for j, limit in enumerate((2e-10, 2e-10, 2e-10, 5e-9)):  # the worst: stiff springs 0.001 apart
            found = shapes[j][:, mode] / b**j
            np.testing.assert_allclose(found, scale * wave[j], atol=limit, err_msg=f"mode {mode}, derivative {j}")


def test_a_stiff_spring_is_a_pin_and_a_soft_one_no_support() -> None:
    pinned = on_springs(((0.0, 1e12, 0.0), (1.0, 1e12, 0.0)), 12)
    np.testing.assert_allclose(pinned.omega, on_ends("pinned", "pinned", 12).omega, rtol=1e-7)
    clamped = on_springs(((0.0, 1e12, 1e12), (1.0, 1e12, 1e12)), 12)
    np.testing.assert_allclose(clamped.omega, on_ends("clamped", "clamped", 12).omega, rtol=1e-7)
    k = 1e-9
    free = on_springs(((0.0, k, 0.0), (1.0, k, 0.0)), 12)
    np.testing.assert_allclose(free.omega[:2], [math.sqrt(2.0 * k), math.sqrt(6.0 * k)], rtol=1e-9)
    np.testing.assert_allclose(free.omega[2:], on_ends("free", "free", 12).omega[2:], rtol=1e-9)


def test_rigid_body_modes_are_lines() -> None:
    s = np.linspace(0.0, 1.0, 101)
    body = on_ends("free", "free", 5)
    np.testing.assert_allclose(body.shape(s)[:, 0], 1.0, rtol=1e-14)
    np.testing.assert_allclose(body.shape(s)[:, 1], math.sqrt(3.0) * (1.0 - 2.0 * s), atol=1e-14)
    swing = on_springs(((0.4, 100.0, 0.0),), 3)
    np.testing.assert_allclose(swing.shape([0.4])[:, 0], 0.0, atol=1e-14)
    for one, rigid in (
        (body, 2),
        (swing, 1),
        (on_ends("pinned", "free", 3), 1),
        (on_springs(((0.4, 0.0, 1.0),), 3), 1),
    ):
        assert one.rigid_modes == rigid
        assert np.all(one.shape(s, 2)[:, :rigid] == 0.0)
        assert np.all(one.shape(s, 3)[:, :rigid] == 0.0)
    assert on_ends("free", "free", 1).omega.tolist() == [0.0]


@pytest.mark.parametrize("ends", ALL_ENDS, ids="-".join)
def test_sign_the_first_place_at_half_of_the_largest_value_is_positive(ends: tuple[str, str]) -> None:
    values = on_ends(*ends, modes=20).shape(np.linspace(0.0, 1.0, 999))
    for shape in values.T:
        assert shape[np.argmax(np.abs(shape) >= 0.5 * np.abs(shape).max())] > 0.0


def test_units_follow_length_mass_and_stiffness() -> None:
    length, area, inertia, modulus, density = 15.0, 0.01, 8.33e-6, 210e9, 7850.0
    body = uniform_beam(uniform(length, area, inertia, modulus, density), 6)
    k = np.arange(1, 7) * np.pi / length
    mass = density * area * length
    s = np.linspace(0.0, length, 40)
    assert (body.length, body.bending_stiffness) == (length, modulus * inertia)
    assert body.mass == pytest.approx(mass, rel=1e-14)
    np.testing.assert_allclose(body.wave_number, k, rtol=1e-13)
    np.testing.assert_allclose(body.omega, k**2 * math.sqrt(modulus * inertia / (density * area)), rtol=1e-13)
    for j in range(4):
        expected = math.sqrt(2.0 / mass) * np.sin(np.outer(s, k) + 0.5 * np.pi * j)
        np.testing.assert_allclose(body.shape(s, j) / k**j, expected, atol=1e-13 * math.sqrt(2.0 / mass))
    odd = np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0])
    np.testing.assert_allclose(body.participation, odd * 2.0 * math.sqrt(2.0 * mass) / (k * length), atol=1e-12)


def test_springs_keep_their_units_and_dampers_are_listed() -> None:
    springs = ((0.5, 3e6, 2e5, 40.0), (4.0, 1e6), (4.0, 1e6, 0.0, 7.0))
    body = uniform_beam(uniform(4.0, 0.02, 1e-5, 2e11, 7800.0, supports=springs), 4)
    stiffness, line_mass = 2e6, 156.0
    unit = on_springs(((0.125, 3e6 * 64 / stiffness, 2e5 * 4 / stiffness), (1.0, 2e6 * 64 / stiffness, 0.0)), 4)
    np.testing.assert_allclose(body.omega, unit.omega * math.sqrt(stiffness / line_mass) / 16.0, rtol=1e-12)
    assert body.dampers == ((0.5, 40.0), (4.0, 7.0))


def test_jumps_are_taken_from_the_right_and_at_the_end_from_the_left() -> None:
    body = on_springs(((0.4, 80.0, 5.0), (1.0, 60.0, 0.0)), 5)
    before, at, after = (body.shape([0.4 + step], 2)[0] for step in (-1e-9, 0.0, 1e-9))
    np.testing.assert_allclose(at, after, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(at - before, 5.0 * body.shape([0.4], 1)[0], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(body.shape([1.0], 3)[0], 60.0 * body.shape([1.0])[0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("modes", [0, -1, MOST_MODES + 1, 2.5])
def test_a_bad_number_of_modes_is_refused(modes: int) -> None:
    with pytest.raises(BadInput, match="modes"):
        uniform_beam(unit(), modes)


@pytest.mark.parametrize(("s", "derivative"), [(-0.01, 0), (1.01, 0), (math.nan, 0), (0.5, 4), (0.5, -1)])
def test_places_off_the_beam_and_unknown_derivatives_are_refused(s: float, derivative: int) -> None:
    with pytest.raises(BadInput):
        on_ends("pinned", "pinned", 2).shape([s], derivative)
