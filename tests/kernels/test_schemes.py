"""What a scheme says of itself against its amplification matrix, and what is refused because of it."""

import math
from typing import Any

import numpy as np
import pytest

from engine.batch.plan import make_plan
from engine.kernels.schemes import SCHEMES, AlphaScheme, NewmarkScheme, Scheme, generalized_alpha, hht_alpha, is_damped
from engine.march.tables import SceneTables
from engine.methods.transition import spectral_radius, transitions
from engine.model.scene_model import build_model
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from results_schema.errors import BadInput
from tests.engine.build import beam, cruise, force, mass, study

X = np.array([1e-3, 0.1, 0.7, 1.5, 1.99])
FAST = (2.1, 2.45, 10.0, 1e3)  # beyond what a mode of its own mass may have by the scaled scheme
CONDITIONAL = ("linear-acceleration", "fox-goodwin", "central-difference")


def newmark_matrix(beta: float, gamma: float, x: float) -> Array:
    """(u, h u') of one step to the next: u" = -x^2 u at both ends put into Newmark's formulas."""
    new = np.array([[1.0 + beta * x**2, 0.0], [gamma * x**2, 1.0]])
    old = np.array([[1.0 - (0.5 - beta) * x**2, 1.0], [-(1.0 - gamma) * x**2, 1.0]])
    return np.asarray(np.linalg.solve(new, old))


def alpha_matrix(m: float, f: float, x: float) -> Array:
    """(u, h u', h^2 a) of one step to the next, as Chung and Hulbert (1993) write their scheme."""
    gamma, beta = 0.5 - m + f, 0.25 * (1.0 - m + f) ** 2
    new = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [(1.0 - f) * x**2, 0.0, 1.0 - m]])
    old = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma], [-f * x**2, 0.0, -m]])
    return np.asarray(np.linalg.solve(new, old))


def kernel_matrix(scheme: AlphaScheme, x: float) -> Array:
    """(u, h u', e) of one step to the next by the coefficients that the kernels take."""
    c = scheme.coefficients
    columns = []
    for u, v, e in np.eye(3):  # predictors and memory before the step; without a force the true acceleration is
        true = -(x**2) * u / (1.0 + c.beta * x**2)
        q, rate = u + c.beta * true, v + c.gamma * true
        v_next = rate + c.velocity_x * true + c.velocity_e * e
        u_next = q + rate + c.displacement_x * true + c.displacement_e * e
        columns.append([u_next, v_next, c.next_x * true + c.next_e * e])
    return np.array(columns).T


def radius(matrix: Array) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max())


@pytest.mark.parametrize("name", ["average-acceleration", *CONDITIONAL, "newmark"])
def test_phase_is_that_of_the_amplification_matrix(name: str) -> None:
    scheme = SCHEMES[name]({"beta": 0.3025, "gamma": 0.6})
    assert isinstance(scheme, NewmarkScheme)
    found = scheme.phase(X)
    wanted = [np.abs(np.angle(np.linalg.eigvals(newmark_matrix(scheme.beta, scheme.gamma, x)))).max() for x in X]
    np.testing.assert_allclose(found, wanted, rtol=1e-7, equal_nan=False)


def test_modes_that_take_mass_go_as_by_a_larger_beta() -> None:
    """The same eigenvalues, on the unit circle; and the angle that the scheme tells."""
    scheme = SCHEMES["scaled-fox-goodwin"]({})
    for x in (*X, *FAST):
        larger = newmark_matrix(1 / 12 + max(0.0, 1 / scheme.scaled_from**2 - 1 / x**2), 0.5, x)
        found = scheme.amplification(float(x))
        assert np.abs(np.poly(np.linalg.eigvals(found)) - np.poly(np.linalg.eigvals(larger))).max() < 1e-12
        assert abs(radius(found) - 1.0) < 1e-12
        angle = float(np.abs(np.angle(np.linalg.eigvals(found))).max())
        assert float(scheme.phase(np.array([x]))[0]) == pytest.approx(angle, rel=1e-7)


@pytest.mark.parametrize("x", [0.3, 1.9, 2.5, 40.0])
def test_modes_swing_about_a_load_that_grows_as_in_truth(x: float) -> None:
    """One mode of unit frequency, at rest, under a load t: by the first step of Newmark's formulas it swings about t by
    one, whatever its mass; without a velocity at the start by more."""
    scheme = SCHEMES["scaled-fox-goodwin"]({})
    assert isinstance(scheme, NewmarkScheme)
    mass, h, angle = max(1.0, (x / scheme.scaled_from) ** 2), x, float(scheme.phase(np.array([x]))[0])
    amplitudes = []
    for v in (float(scheme.velocity_at_kinks(np.array([x]))[0]) * h**2, 0.0):
        a = (h - h * v) / (mass + scheme.beta * h**2)
        amplitudes.append((h - h * v - scheme.beta * h**2 * a) / math.sin(angle))
    assert amplitudes[0] == pytest.approx(1.0, rel=1e-9) and amplitudes[1] > 1.005


@pytest.mark.parametrize("modes", [5, 12])
@pytest.mark.parametrize("speed", [0.1, 0.6])
def test_a_moving_mass_does_not_resonate_with_modes_that_take_mass(modes: int, speed: float) -> None:
    """Growth by a passage from the rule's steps on; Fox-Goodwin alone, with so few, blows up in the slower one."""
    worst = {}
    for name in ("scaled-fox-goodwin", "fox-goodwin"):
        solver = {"scheme": name}
        given = study(beam(modes=modes), mass(1.0, cruise(0.0, 1.0, speed * math.pi)), solver=solver)
        scene = build_model(given, {}, {})
        values = VariantValues(scene.study, {"carriage.car.mass": np.repeat([0.25, 0.5, 1.0, 2.0], 2)}, 8)
        rule = least_steps(SCHEMES["scaled-fox-goodwin"]({}), modes, speed * math.pi)
        growth = [
            spectral_radius(transitions(SceneTables(scene, math.ceil(rule * part), "whole"), values))
            for part in (1.1, 1.3, 1.5, 2.0, 3.0)
        ]
        worst[name] = float(np.max(growth))
    assert worst["scaled-fox-goodwin"] < 1.25
    assert worst["fox-goodwin"] > 1e10 or speed > 0.1


@pytest.mark.parametrize("name", CONDITIONAL)
def test_phase_is_half_a_turn_at_the_limit(name: str) -> None:
    scheme = SCHEMES[name]({})
    assert float(scheme.phase(np.array([scheme.stability_limit * (1.0 - 1e-9)]))[0]) == pytest.approx(math.pi, abs=1e-3)
    assert isinstance(scheme, NewmarkScheme)
    assert radius(newmark_matrix(scheme.beta, scheme.gamma, 0.999 * scheme.stability_limit)) < 1.0 + 1e-12
    assert radius(newmark_matrix(scheme.beta, scheme.gamma, 1.001 * scheme.stability_limit)) > 1.01


ALPHA = [hht_alpha(0.0), hht_alpha(-0.05), hht_alpha(-1 / 3), *map(generalized_alpha, (0.0, 0.3, 0.8, 1.0))]


@pytest.mark.parametrize("scheme", ALPHA, ids=repr)
def test_alpha_schemes_are_chung_and_hulberts(scheme: AlphaScheme) -> None:
    """Equal eigenvalues: for one oscillator the form with true accelerations is the same scheme."""
    for x in (0.01, 0.3, 2.0, 50.0):
        found = np.sort_complex(np.linalg.eigvals(kernel_matrix(scheme, x)))
        wanted = np.sort_complex(np.linalg.eigvals(alpha_matrix(scheme.m, scheme.f, x)))
        assert np.abs(np.poly(found) - np.poly(wanted)).max() < 1e-12


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.8, 1.0])
def test_rho_inf_is_the_radius_at_high_frequency(rho: float) -> None:
    assert radius(kernel_matrix(generalized_alpha(rho), 1e6)) == pytest.approx(rho, abs=2e-3)


@pytest.mark.parametrize("scheme", ALPHA, ids=repr)
def test_alpha_schemes_have_no_limit(scheme: AlphaScheme) -> None:
    largest = max(radius(kernel_matrix(scheme, x)) for x in np.geomspace(1e-3, 1e6, 60))
    assert largest < 1.0 + 1e-7
    assert scheme.stability_limit == math.inf


DAMPED = [({"alpha": -0.05}, True), ({"alpha": -0.03}, True), ({"alpha": -0.02}, False), ({"alpha": -1e-6}, False)]
DAMPED += [({"rho_inf": 0.0}, True), ({"rho_inf": 0.7}, True), ({"rho_inf": 0.85}, False), ({"rho_inf": 1.0}, False)]
DAMPED += [
    ({"beta": 0.265, "gamma": 0.53}, True),
    ({"beta": 0.2601, "gamma": 0.52}, False),
    ({"beta": 0.25001, "gamma": 0.50001}, False),
]


@pytest.mark.parametrize(("given", "damped"), DAMPED, ids=repr)
def test_only_schemes_that_damp_enough_do_without_the_alias_rule(given: dict[str, float], damped: bool) -> None:
    """Growth per passage with too few steps, by the march itself, on scenes where the others resonate."""
    name = "hht-alpha" if "alpha" in given else "generalized-alpha" if "rho_inf" in given else "newmark"
    assert is_damped(SCHEMES[name](given)) == damped
    worst = 0.0
    for modes, speed in ((5, 0.3), (12, 0.3)):
        solver = {"scheme": name, **given}
        scene = build_model(
            study(beam(modes=modes), mass(1.0, cruise(0.0, 1.0, speed * math.pi)), solver=solver), {}, {}
        )
        rule = least_steps(SCHEMES["average-acceleration"]({}), modes, speed * math.pi)
        values = VariantValues(scene.study, {"carriage.car.mass": np.repeat([0.25, 0.5, 0.75, 1.0], 4)}, 16)
        for steps in {round(rule * part) for part in np.linspace(0.3, 1.0, 50)}:
            growth = spectral_radius(transitions(SceneTables(scene, steps, "whole"), values))
            worst = max(worst, float(growth.max()))
    assert (worst < 1.05) == damped


def passing(steps: int, scheme: str, car: Any = None, **parameters: float) -> Study:
    solver = {"steps": steps, "scheme": scheme, **parameters}
    return study(beam(modes=12), car or mass(0.5, cruise(0.0, 1.0, 0.3)), solver=solver)


def least_steps(scheme: Scheme, modes: int = 12, speed: float = 0.3) -> float:
    """The alias rule of the highest mode, k v h + phase = pi, by scanning."""
    steps = np.geomspace(3.0, 1e5, 400_001)
    h = 1.0 / (speed * steps)
    turned = modes * math.pi * speed * h + scheme.phase((modes * math.pi) ** 2 * h)
    return float(steps[np.argmax(turned < math.pi)])


@pytest.mark.parametrize("name", ["average-acceleration", "richardson", "scaled-fox-goodwin", *CONDITIONAL])
def test_too_few_steps_for_the_alias_rule_are_refused(name: str) -> None:
    stride = SCHEMES[name]({}).stride
    least = least_steps(SCHEMES[name]({})) * 1.1  # of the pair's coarser march
    assert make_plan(passing(stride * math.ceil(1.002 * least), name)).groups
    with pytest.raises(BadInput) as caught:
        make_plan(passing(stride * math.floor(0.998 * least), name))
    assert "solver.steps" in str(caught.value) and "steps = " in caught.value.remedy
    suggested = int(caught.value.remedy.split()[2])
    assert make_plan(passing(suggested, name)).groups
    assert suggested < 1.2 * stride * least


def test_the_alias_rule_is_for_masses_and_schemes_without_damping() -> None:
    with pytest.raises(BadInput, match="alias rule"):
        make_plan(passing(math.floor(least_steps(SCHEMES["average-acceleration"]({}))), "hht-alpha", alpha=-0.001))
    few = math.floor(0.5 * least_steps(SCHEMES["average-acceleration"]({})))
    assert make_plan(passing(few, "hht-alpha", alpha=-0.05)).groups
    assert make_plan(passing(few, "generalized-alpha", rho_inf=0.7)).groups
    assert make_plan(passing(few, "average-acceleration", force(1.0, cruise(0.0, 1.0, 0.3)))).groups


def test_a_pair_wants_an_even_number_of_steps() -> None:
    with pytest.raises(BadInput) as caught:
        make_plan(passing(8001, "richardson"))
    assert (caught.value.where, caught.value.received, caught.value.remedy) == ("solver.steps", "8001", "steps = 8002")


def test_the_alias_rule_is_for_masses_without_convective_terms_too() -> None:
    solver = {"steps": 30, "fidelity": "mass-without-convective"}
    with pytest.raises(BadInput, match="alias rule"):
        make_plan(study(beam(modes=12), mass(0.5, cruise(0.0, 1.0, 0.3)), solver=solver))


@pytest.mark.parametrize(("scheme", "wanted"), [("hht-alpha", "alpha"), ("generalized-alpha", "rho_inf")])
def test_a_scheme_says_which_parameter_it_needs(scheme: str, wanted: str) -> None:
    with pytest.raises(BadInput) as caught:
        passing(400, scheme)
    assert f"needs {wanted}" in caught.value.what
    assert caught.value.expected.startswith(f"{wanted} = ") and "say, from" in caught.value.expected
    other = {"hht-alpha": {"rho_inf": 0.5}, "generalized-alpha": {"alpha": -0.1}}[scheme]
    with pytest.raises(BadInput, match="not for this scheme"):
        passing(400, scheme, **other)


@pytest.mark.parametrize(
    ("name", "square", "fourth"),
    [
        ("average-acceleration", 1 / 12, 0.0),
        ("linear-acceleration", 1 / 24, 0.0),
        ("fox-goodwin", 0.0, 1 / 480),
        ("central-difference", 1 / 24, 0.0),
    ],
)
def test_period_errors_are_those_of_the_literature(name: str, square: float, fourth: float) -> None:
    """|beta/2 - 1/24| of the period per (omega h)^2, from the angle that the amplification matrix turns by."""
    scheme = SCHEMES[name]({})
    for x in (0.05, 0.1, 0.2):
        turned = np.abs(np.angle(np.linalg.eigvals(scheme.amplification(x)))).max()
        expected = square * x**2 + fourth * x**4
        assert abs(abs(turned / x - 1.0) - expected) < 0.1 * expected
