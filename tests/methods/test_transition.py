"""Transition matrices of the kernels against a twin that assembles dense matrices and steps one state at a time."""

from collections.abc import Callable
from dataclasses import dataclass
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

Place = tuple[float, float, float]  # s and its first two derivatives by time

SCHEMES: dict[str, dict[str, Any]] = {
    "average": {"scheme": "average-acceleration"},
    "fox-goodwin": {"scheme": "fox-goodwin"},
    "damped": {"scheme": "newmark", "beta": 0.3025, "gamma": 0.6},
    "hht": {"scheme": "hht-alpha", "alpha": -0.2},
    "generalized": {"scheme": "generalized-alpha", "rho_inf": 0.4},
}
# beta, gamma, alpha_m, alpha_f as the literature gives them
WEIGHTS = {
    "average": (0.25, 0.5, 0.0, 0.0),
    "fox-goodwin": (1 / 12, 0.5, 0.0, 0.0),
    "damped": (0.3025, 0.6, 0.0, 0.0),
    "hht": (0.36, 0.7, 0.0, 0.2),
    "generalized": (0.25 * (1 + 1 / 7 + 2 / 7) ** 2, 0.5 + 1 / 7 + 2 / 7, -1 / 7, 2 / 7),
}
MODES = 3
OMEGA = (np.arange(1, MODES + 1) * np.pi) ** 2


@dataclass(frozen=True)
class Twin:
    """A mass on a pinned beam with L = E I = rho A = 1, matrices of full size."""

    mass: float
    damping: float
    place: Callable[[float], Place]

    def matrices(self, t: float) -> tuple[Array, Array, Array]:
        """Mass, damping and stiffness matrices with the mass where it is at time t."""
        s, v, a = self.place(t)
        k = np.arange(1, MODES + 1) * np.pi
        phi, slope, bend = (np.sqrt(2) * f for f in (np.sin(k * s), k * np.cos(k * s), -(k**2) * np.sin(k * s)))
        return (
            np.eye(MODES) + self.mass * np.outer(phi, phi),
            np.diag(2 * self.damping * OMEGA) + self.mass * np.outer(phi, 2 * v * slope),
            np.diag(OMEGA**2) + self.mass * np.outer(phi, v**2 * bend + a * slope),
        )

    def passage(self, weights: tuple[float, ...], h: float, steps: int) -> Array:
        """(2N, 2N) what becomes of unit displacements, and of velocities omega."""
        columns = [self._march(weights, h, steps, unit[:MODES], unit[MODES:] * OMEGA) for unit in np.eye(2 * MODES)]
        return np.array(columns).T

    def _march(self, weights: tuple[float, ...], h: float, steps: int, q: Array, v: Array) -> Array:
        beta, gamma, alpha_m, alpha_f = weights
        m, c, k = self.matrices(0.0)
        true = np.linalg.solve(m, -c @ v - k @ q)
        helper = true
        for n in range(1, steps + 1):
            m, c, k = self.matrices(n * h)
            # helper_new = (known + (1 - alpha_f) true_new)/(1 - alpha_m), all put into M true + C v + K q = 0
            known = (alpha_f * true - alpha_m * helper) / (1 - alpha_m)
            part = (1 - alpha_f) / (1 - alpha_m)
            q_known = q + h * v + h**2 * ((0.5 - beta) * helper + beta * known)
            v_known = v + h * ((1 - gamma) * helper + gamma * known)
            true = np.linalg.solve(m + part * h * (gamma * c + beta * h * k), -c @ v_known - k @ q_known)
            helper = known + part * true
            q, v = q_known + beta * h**2 * part * true, v_known + gamma * h * part * true
        return np.concatenate([q, v / OMEGA])


def scene(name: str = "average", motion: dict[str, Any] | None = None, **bed: Any) -> tuple[Study, SceneModel]:
    study = build.study(
        build.beam(modes=MODES, **bed), build.mass(0.4, motion or build.cruise(0.0, 1.0, 1.0)), solver=SCHEMES[name]
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
        twin = Twin(m, zeta, lambda t, v=v: (v * t, v, 0.0))
        assert close(one, twin.passage(WEIGHTS[name], 1.0 / v / 60, 60))


def test_one_period_of_a_shuttle_equals_the_dense_twin() -> None:
    frequency = 0.9
    study, model = scene("hht", build.swing(0.5, 0.4, frequency, 1))
    found = transitions(
        SceneTables(model, 80, "whole"), VariantValues(study, {"carriage.car.mass": np.array([0.6])}, 1)
    )
    om = 2 * np.pi * frequency

    def place(t: float) -> Place:
        return 0.5 + 0.4 * np.sin(om * t), 0.4 * om * np.cos(om * t), -0.4 * om**2 * np.sin(om * t)

    assert close(found[0], Twin(0.6, 0.0, place).passage(WEIGHTS["hht"], 1 / frequency / 80, 80))


def test_weights_and_gravity_do_not_enter() -> None:
    study, model = scene()
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
        twin = Twin(m, 0.0, lambda t, v=advance / h: (0.37, v, 0.0))
        assert close(few[n], twin.passage(WEIGHTS[name], h, 7))
        # n steps of the whole state from settled accelerations are the n-th power of one
        settled = np.zeros((size, 2 * MODES))
        settled[:MODES, :MODES], settled[MODES : 2 * MODES, MODES:] = np.eye(MODES), np.diag(h * OMEGA)
        matrices = twin.matrices(0.0)
        forces = -np.hstack([matrices[2], matrices[1] @ np.diag(OMEGA)])
        settled[2 * MODES : 3 * MODES] = h**2 * np.linalg.solve(matrices[0], forces)
        powered = np.linalg.matrix_power(whole[n], 7) @ settled
        assert close(np.vstack([powered[:MODES], powered[MODES : 2 * MODES] / (h * OMEGA[:, None])]), few[n])


@pytest.mark.parametrize("advance", [0.0, 0.01])
def test_comparison_schemes_tend_to_the_same_exact_matrix(advance: float) -> None:
    """Small steps of any consistent scheme turn the frozen station's state by the matrix exponential."""
    study, model = scene()
    h = 1e-4
    twin = Twin(0.4, 0.0, lambda t: (0.37, advance / 20 / h, 0.0))
    m, c, k = twin.matrices(0.0)
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
