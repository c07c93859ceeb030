"""Where the comparison schemes turn unstable: bisection on what their kernels make of unit states at a held place."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from engine.kernels.layout import Newmark, State
from engine.methods.comparison import (
    COMPARISON,
    ComparisonScheme,
    frozen_track,
    lagged_inertia,
    picard_relaxed,
    propagate_comparison,
)
from engine.model.scene_model import SceneModel, build_model
from engine.model.variant_values import VariantValues, from_blocks, lane_table, padded, to_blocks
from tests.engine.build import beam, cruise, force, mass, study
from tests.naive.scene import Array


def held(modes: int, kilograms: float, damping: float = 0.0) -> SceneModel:
    """A beam with a mass to be held; a mass of 0 is a force."""
    way = cruise(0.0, 1.0, 1.0)
    car = mass(kilograms, way) if kilograms > 0.0 else force(1.0, way)
    return build_model(study(beam(modes=modes, damping_ratio=damping), car), {}, {})


def one_step(scheme: ComparisonScheme, model: SceneModel, step: float, advance: float = 0.0) -> Array:
    """(3N, 3N) what one step in s at a held midspan makes of (q, h q', h^2 q'')."""
    modes = model.omega.size
    units = 3 * modes
    size = padded(np.arange(units)).size
    lanes = lane_table(model, VariantValues(model.study, {}, size)).steps_of(to_blocks(np.full(size, step)))
    unit = np.eye(units, size).reshape(3, modes, size)
    state = State(*(to_blocks(part / step**power) for power, part in enumerate(unit)), np.zeros_like(lanes.stiffness))
    moved = propagate_comparison(scheme, frozen_track(scheme, model, 0.5, 1, advance), lanes, state).state
    return np.concatenate([from_blocks(part, units) * step**power for power, part in enumerate(moved[:3])])


def grows(scheme: ComparisonScheme, model: SceneModel, step: float, advance: float = 0.0) -> bool:
    """Whether a step at the held midspan makes something larger."""
    return bool(np.abs(np.linalg.eigvals(one_step(scheme, model, step, advance))).max() > 1.0 + 1e-7)


def bisected(unstable: Callable[[float], bool], low: float, high: float) -> float:
    """Where a scheme turns unstable, to 1e-4 of itself."""
    assert not unstable(low)
    assert unstable(high)
    while high - low > 1e-4 * low:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return 0.5 * (low + high)


@pytest.mark.parametrize("modes", [1, 4])
def test_limit_of_runge_kutta(modes: int) -> None:
    model = held(modes, 0.0)
    rk4 = COMPARISON["rk4"]
    limit = bisected(lambda x: grows(rk4, model, x / float(model.omega.max())), 2.0, 4.0)
    assert limit == pytest.approx(2.0 * math.sqrt(2.0), rel=1e-3)
    assert rk4.stability_limit == pytest.approx(limit, rel=1e-3)


@pytest.mark.parametrize("name", ["wilson-theta", "lagged-inertia", "lagged-convective", "picard-relaxed"])
def test_no_limit(name: str) -> None:
    model = held(3, 0.0)
    assert not any(grows(COMPARISON[name], model, x / float(model.omega.max())) for x in (0.3, 3.0, 30.0, 300.0))
    assert COMPARISON[name].stability_limit == math.inf


def test_wilson_overshoots_57_times() -> None:
    """Section 7.7: displaced by 1 and let go at omega h = 20, it is at -57.2 after one step."""
    model = held(1, 0.0)
    omega = float(model.omega[0])
    lanes = lane_table(model, VariantValues(model.study, {}, 16)).steps_of(np.full((1, 16), 20.0 / omega))
    one = np.ones((1, 1, 16))
    state = State(one, 0.0 * one, -(omega**2) * one, 0.0 * one)
    wilson = COMPARISON["wilson-theta"]
    moved = propagate_comparison(wilson, frozen_track(wilson, model, 0.5, 1), lanes, state).state
    assert moved.q == pytest.approx(-57.228, abs=1e-3)
    assert (state.q == 1.0).all()


@pytest.mark.parametrize(("modes", "critical"), [(1, 0.5), (3, 0.25), (5, 1 / 6), (10, 0.1), (20, 0.05)])
@pytest.mark.parametrize("step", [1e-4, 3e-3, 0.1])
def test_lagged_inertia_fails_at_m_phi_phi_1_whatever_the_step(modes: int, critical: float, step: float) -> None:
    """Section 7.1; the step is in s, omega_1 being pi^2. Damping does not help."""
    for damping in (0.0, 0.05):
        limit = bisected(
            lambda mu, zeta=damping: grows(COMPARISON["lagged-inertia"], held(modes, mu, zeta), step),
            0.5 * critical,
            2.0 * critical,
        )
        assert limit == pytest.approx(critical, rel=0.01)


def test_lagged_convective_stays_stable_where_lagged_inertia_fails() -> None:
    assert not grows(COMPARISON["lagged-convective"], held(10, 0.5, 0.01), 3e-3, advance=1e-4)
    assert grows(COMPARISON["lagged-inertia"], held(10, 0.5, 0.01), 3e-3, advance=1e-4)


def test_terms_of_the_speed_at_a_held_place() -> None:
    """One mode diverges from alpha = 0.7071/sqrt(mu) on (section 7.4); alpha = v/pi here."""
    mu, step = 0.25, 1e-3
    model = held(1, mu)
    found = bisected(lambda alpha: grows(COMPARISON["rk4"], model, step, alpha * math.pi * step), 1.0, 2.0)
    assert found * math.sqrt(mu) == pytest.approx(math.sqrt(0.5), rel=1e-3)


def test_limits_are_those_of_the_scheme_of_the_modes() -> None:
    linear = Newmark(1 / 6, 1 / 2)
    model = held(2, 0.0)
    for scheme in (lagged_inertia(linear), picard_relaxed(linear)):
        limit = bisected(lambda x, one=scheme: grows(one, model, x / float(model.omega.max())), 2.0, 5.0)
        assert limit == pytest.approx(math.sqrt(12.0), rel=1e-3)
        assert scheme.stability_limit == pytest.approx(limit, rel=1e-3)
