"""Static deflections under what hangs on beams, as shapes beside their modes."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

import studies
from engine.bodies.beam.beam import Beam
from engine.floating.bodies.build import elastic_body
from engine.floating.bodies.fields import ABOUT_Y, Z
from engine.floating.bodies.static_shapes import BENDING, FORCE, MOMENT, deflections
from engine.scene.frames import Frame
from engine.scene.study import load
from studies.commands.catalogue import built_in

X = np.linspace(0.0, 1.0, 11)
ENDS = [
    "clamped-free",
    "free-clamped",
    "pinned-pinned",
    "clamped-pinned",
    "clamped-clamped",
    "pinned-free",
    "free-free",
]
PARTS = (0.0, 0.3), (0.3, 0.8), (0.8, 1.0)


def under(ends: str, place: float, kind: int) -> np.ndarray:
    near, far = ends.split("-")
    found = deflections(BENDING, (near, far), [place])
    return found.derivatives(X, 0)[:, list(found.kinds).index(kind)]


def test_closed_forms() -> None:
    np.testing.assert_allclose(under("clamped-free", 1.0, FORCE), X**2 * (3.0 - X) / 6.0, atol=1e-14)
    np.testing.assert_allclose(np.abs(under("clamped-free", 1.0, MOMENT)), X**2 / 2.0, atol=1e-14)
    half = X[X <= 0.5]
    middle = half * (3.0 - 4.0 * half**2) / 48.0
    np.testing.assert_allclose(under("pinned-pinned", 0.5, FORCE)[: half.size], middle, atol=1e-14)
    np.testing.assert_allclose(np.abs(under("pinned-pinned", 1.0, MOMENT)), X * (1.0 - X**2) / 6.0, atol=1e-14)


@pytest.mark.parametrize("ends", ENDS)
def test_shapes_are_coupled_by_neither_mass_nor_stiffness(ends: str) -> None:
    """Their frequencies are those of the energy of bending; also where inertia carries the loads."""
    numbers = {"length": 2.0, "area": 3.0, "second_moment": 0.5, "youngs_modulus": 7.0, "density": 1.5, "modes": 3}
    beam = Beam(kind="beam", supports=ends, **numbers)
    body = elastic_body(beam, Frame(), None, "body.b", [0.6, 1.6, 2.0])
    nodes, weights = np.polynomial.legendre.leggauss(40)
    s = np.concatenate([2.0 * low + (high - low) * (nodes + 1.0) for low, high in PARTS])
    ds = np.concatenate([(high - low) * weights for low, high in PARTS])
    shapes, bent = body.fields(s, (0, 2))[:, :, Z]
    one = np.eye(body.omega.size)
    assert body.omega.size > 5 + (ends != "clamped-clamped")
    np.testing.assert_allclose(4.5 * shapes.T @ (ds[:, None] * shapes), one, atol=1e-9)
    stiffness = 3.5 * bent.T @ (ds[:, None] * bent)
    np.testing.assert_allclose(stiffness / np.multiply.outer(body.omega, body.omega), one, atol=1e-9)


@pytest.mark.parametrize("modes", [10, 16, 24, 40, 64])
@pytest.mark.parametrize("hung", [[2.0], [1.0, 2.0], [0.002, 2.0]])
@pytest.mark.parametrize("ends", ["clamped-free", "clamped-pinned", "pinned-pinned"])
def test_shapes_vanish_where_the_beam_is_held_however_many_modes_there_are(
    ends: str, hung: list[float], modes: int
) -> None:
    """Many modes leave little more than rounding of static deflections: of unit mass it is 1e-7 of a shape."""
    numbers = {"length": 2.0, "area": 3.0, "second_moment": 0.5, "youngs_modulus": 7.0, "density": 1.5}
    frame = Frame(lateral_second_moment=0.2, lateral_modes=min(modes, 32), axial_modes=min(modes, 32))
    body = elastic_body(Beam(kind="beam", supports=ends, modes=modes, **numbers), frame, None, "body.b", hung)
    start, far = (body.fields(np.array(places), (0,))[0] for places in ([0.0], [0.4, 0.9, 1.3, 1.7]))
    assert np.abs(start[0, : Z + 1]).max() < 1e-13 * np.abs(far[:, : Z + 1]).max()
    if ends.startswith("clamped"):
        assert np.abs(start[0, Z + 1 :]).max() < 1e-13 * np.abs(far[:, Z + 1 :]).max()


def tip_frequencies(mass: float, inertia: float, out: float, count: int) -> list[float]:
    """Of a cantilever with E I = rho A = L = 1 and a rigid body at its end, whose centre lies further out."""

    def determinant(k: float) -> float:
        c, s, ch, sh = np.cos(k), np.sin(k), np.cosh(k), np.sinh(k)
        rows = []
        for w, w1, w2, w3 in ((ch - c, sh + s, ch + c, sh - s), (sh - s, ch - c, sh + s, ch + c)):
            w1, w2, w3 = k * w1, k**2 * w2, k**3 * w3
            moved = w + out * w1
            shear, moment = w3 + mass * k**4 * moved, w2 - k**4 * (inertia * w1 + mass * out * moved)
            rows.append((shear, moment))
        return float(np.linalg.det(np.array(rows))) / np.cosh(k) ** 2

    grid = np.linspace(0.05, 30.0, 20_000)
    values = np.array([determinant(k) for k in grid])
    at = np.flatnonzero(values[:-1] * values[1:] < 0.0)[:count]
    return [brentq(determinant, grid[i], grid[i + 1], xtol=1e-13) ** 2 for i in at]


@pytest.mark.parametrize("modes", [1, 2, 4])
def test_frequencies_of_a_cantilever_with_a_rigid_body_at_its_end(modes: int) -> None:
    """By the closed form; of the modes alone 32 are off by more than 1e-3."""
    mass, inertia, out = 0.8, 0.3, 0.4
    numbers = dict.fromkeys(("length", "area", "second_moment", "youngs_modulus", "density"), 1.0)
    wanted = np.array(tip_frequencies(mass, inertia, out, 2))

    def found(count: int, hung: list[float]) -> np.ndarray:
        beam = Beam(kind="beam", supports="clamped-free", modes=count, **numbers)
        body = elastic_body(beam, Frame(), None, "body.arm", hung)
        end = body.fields(np.ones(1), (0,))[0, 0]
        moved, turned = end[Z] - out * end[ABOUT_Y], end[ABOUT_Y]
        M = np.eye(body.omega.size) + mass * np.outer(moved, moved) + inertia * np.outer(turned, turned)
        return np.sqrt(eigh(np.diag(body.omega**2), M, eigvals_only=True))[:2]

    first = {1: 1e-6, 2: 1e-8, 4: 1e-9}[modes]
    assert found(modes, [1.0])[0] == pytest.approx(wanted[0], rel=first)
    assert found(modes, [1.0])[1] == pytest.approx(wanted[1], rel=2000.0 * first)
    assert abs(found(32, [])[0] / wanted[0] - 1.0) > 1e-3


def test_the_arm_of_the_library_needs_no_more_than_its_two_modes() -> None:
    """Beside six modes of each link; without the static deflections it bends otherwise by a tenth. Until it swings on:
    it bends most before that."""
    short = {"sweep": {}, "solver.tolerance": 5e-3, "question.duration": 1.5}
    arm = load(built_in()["flexible-arm"]).with_values(short)
    six = {"body.upper.modes": 6, "body.lower.modes": 6, "solver.tolerance": 1e-3}
    two, finer, alone = (studies.run(arm.with_values(more)) for more in ({}, six, {"solver.static_correction": False}))
    largest = float(abs(finer["bend_min"]))
    assert abs(two["bend_min"] - finer["bend_min"]) < 5e-3 * largest
    assert abs(alone["bend_min"] - finer["bend_min"]) > 2e-2 * largest
