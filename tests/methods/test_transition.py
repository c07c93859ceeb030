"""Transition matrices of the kernels against the naive twin, which steps one state at a time."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from engine.march.tables import SceneTables
from engine.methods.comparison import runge_kutta, wilson_theta
from engine.methods.transition import (
    Frozen,
    FrozenCompared,
    held_transitions,
    spectral_radius,
    step_matrices,
    transitions,
)
from engine.model.scene_model import SceneModel, build_model
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from tests.engine import build
from tests.naive import motions
from tests.naive import newmark as naive
from tests.naive.scene import Phase, Scene, State, moving_mass, system
from tests.reference.closed_forms import PinnedBeam

SCHEMES: dict[str, dict[str, Any]] = {
    "average": {"scheme": "average-acceleration"},
    "fox-goodwin": {"scheme": "fox-goodwin"},
    "scaled": {"scheme": "scaled-fox-goodwin"},
    "damped": {"scheme": "newmark", "beta": 0.3025, "gamma": 0.6},
    "hht": {"scheme": "hht-alpha", "alpha": -0.2},
    "generalized": {"scheme": "generalized-alpha", "rho_inf": 0.4},
}
# as the literature gives them
WEIGHTS = {
    "average": naive.Newmark(),
    "fox-goodwin": naive.Newmark(1 / 12, 1 / 2),
    "scaled": naive.Newmark(1 / 12, 1 / 2, 2.0),
    "damped": naive.Newmark(0.3025, 0.6),
    "hht": naive.GeneralizedAlpha(0.0, 0.2),
    "generalized": naive.GeneralizedAlpha(-1 / 7, 2 / 7),
}
MODES = 3
OMEGA = (np.arange(1, MODES + 1) * np.pi) ** 2
BED = PinnedBeam(MODES)


def riding(mass: float, phases: tuple[Phase, ...], damping: float = 0.0) -> Scene:
    """A mass without weight on a pinned beam with L = E I = rho A = 1."""
    return Scene(BED.phi, BED.omega, np.full(MODES, damping), (moving_mass(mass, 0.0, phases),))


def held(speed: float = 0.0) -> tuple[Phase, ...]:
    """A place that is held, with the terms of a speed."""
    return (Phase(0.0, 1.0, lambda t: 0.37, lambda t: speed, lambda t: 0.0),)


def passage(twin: Scene, name: str, times: Array) -> Array:
    """(2N, 2N) what becomes of unit displacements, and of velocities omega."""
    states = [State(unit[:MODES], unit[MODES:] * OMEGA) for unit in np.eye(2 * MODES)]
    ends = [naive.march(twin, times, state, WEIGHTS[name]) for state in states]
    return np.array([np.concatenate([end.q[-1], end.v[-1] / OMEGA]) for end in ends]).T


def scene(name: str = "average", motion: dict[str, Any] | None = None, **bed: Any) -> tuple[Study, SceneModel]:
    study = build.study(
        build.beam(modes=MODES, **bed),
        build.mass(0.4, motion or build.cruise(0.0, 1.0, 1.0)),
        solver=SCHEMES[name] | {"static_correction": False},
    )
    return study, build_model(study, {}, {})


def close(found: Array, wanted: Array, to: float = 1e-9) -> bool:
    assert np.isfinite(found).all()
    return bool(np.abs(found - wanted).max() <= to * max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize("name", SCHEMES)
def test_passages_of_many_variants_equal_the_dense_twin(name: str) -> None:
    study, model = scene(name)
    mass, speed, damping = np.array([0.1, 0.8, 0.8]), np.array([0.5, 1.1, 1.1]), np.array([0.0, 0.0, 0.03])
    columns = {"carriage.car.mass": mass, "carriage.car.motion.speed": speed, "body.bed.damping_ratio": damping}
    found = transitions(SceneTables(model, 60, "whole"), VariantValues(study, columns, 3))
    assert found.shape == (3, 2 * MODES, 2 * MODES)
    for one, m, v, zeta in zip(found, mass, speed, damping, strict=True):
        twin = riding(m, motions.cruise(0.0, 1.0, v), zeta)
        assert close(one, passage(twin, name, np.linspace(0.0, 1.0 / v, 61)))


def test_one_period_of_a_shuttle_equals_the_dense_twin() -> None:
    frequency = 0.9
    study, model = scene("hht", build.swing(0.5, 0.4, frequency, 1))
    found = transitions(
        SceneTables(model, 80, "whole"), VariantValues(study, {"carriage.car.mass": np.array([0.6])}, 1)
    )
    twin = riding(0.6, motions.sinusoidal(0.5, 0.4, 2 * np.pi * frequency, 1))
    assert close(found[0], passage(twin, "hht", np.linspace(0.0, 1 / frequency, 81)))


@pytest.mark.parametrize("name", ["average", "scaled"])
def test_weights_and_gravity_do_not_enter(name: str) -> None:
    study, model = scene(name)
    heavy = build_model(other := study.with_values({"gravity": 1e6, "body.bed.own_weight": True}), {}, {})
    found = [
        transitions(SceneTables(m, 50, "whole"), VariantValues(s, {}, 1)) for s, m in ((study, model), (other, heavy))
    ]
    assert np.array_equal(found[0], found[1])


@pytest.mark.parametrize("advance", [0.0, 0.02])
@pytest.mark.parametrize("name", SCHEMES)
def test_steps_at_a_frozen_station_equal_the_dense_twin(name: str, advance: float) -> None:
    study, model = scene(name)
    mass, step = np.array([0.2, 1.5]), np.array([0.004, 0.011])
    values = VariantValues(study, {"carriage.car.mass": mass}, 2)
    frozen = Frozen(model, 0.37, advance)
    few, whole = held_transitions(frozen, values, step, 7), step_matrices(frozen, values, step)
    size = whole.shape[-1]
    assert size == (4 if "alpha" in SCHEMES[name]["scheme"] else 3) * MODES
    for n, (m, h) in enumerate(zip(mass, step, strict=True)):
        twin = riding(m, held(advance / h))
        assert close(few[n], passage(twin, name, h * np.arange(8)))
        # n steps of the whole state from settled accelerations are the n-th power of one
        settled = np.zeros((size, 2 * MODES))
        settled[:MODES, :MODES], settled[MODES : 2 * MODES, MODES:] = np.eye(MODES), np.diag(h * OMEGA)
        matrices = system(twin, 0.0, "right")
        forces = -np.hstack([matrices.stiffness, matrices.damping @ np.diag(OMEGA)])
        settled[2 * MODES : 3 * MODES] = h**2 * np.linalg.solve(matrices.mass, forces)
        powered = np.linalg.matrix_power(whole[n], 7) @ settled
        assert close(np.vstack([powered[:MODES], powered[MODES : 2 * MODES] / (h * OMEGA[:, None])]), few[n])


@pytest.mark.parametrize("advance", [0.0, 0.01])
def test_comparison_schemes_tend_to_the_same_exact_matrix(advance: float) -> None:
    """Small steps of any consistent scheme turn the frozen station's state by the matrix exponential."""
    study, model = scene()
    h = 1e-4
    m, c, k, _ = system(riding(0.4, held(advance / 20 / h)), 0.0, "right")
    upper = np.hstack([np.zeros((MODES, MODES)), np.diag(OMEGA)])
    lower = np.linalg.solve(m, np.hstack([-k, -c @ np.diag(OMEGA)])) / OMEGA[:, None]
    exact = expm(20 * h * np.vstack([upper, lower]))
    for scheme in (runge_kutta(), wilson_theta()):
        frozen = FrozenCompared(model, 0.37, advance / 20, scheme=scheme)
        found = held_transitions(frozen, VariantValues(study, {}, 1), np.array([h]), 20)
        assert close(found[0], exact, 1e-3), scheme.name


def test_a_march_that_overflows_has_an_infinite_radius() -> None:
    study, model = scene("fox-goodwin")
    values = VariantValues(study, {"carriage.car.motion.speed": np.array([0.001, 0.5])}, 2)
    found = spectral_radius(transitions(SceneTables(model, 400, "whole"), values))
    assert found[0] == np.inf and np.isfinite(found[1])
