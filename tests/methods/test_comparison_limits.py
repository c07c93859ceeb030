"""Where the comparison schemes turn unstable: bisection on what their kernels make of unit states at a held place."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from engine.kernels.layout import Newmark, State
from engine.methods.comparison import (
    COMPARISON,
    ComparisonScheme,
    coupled,
    frozen_track,
    propagate_comparison,
)
from engine.model.lane_table import from_blocks, lane_table, padded, to_blocks
from engine.model.scene_model import SceneModel, build_model
from engine.scene.variants import VariantValues
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


def test_lagged_convective_stays_stable_where_lagged_inertia_fails() -> None:
    assert not grows(COMPARISON["lagged-convective"], held(10, 0.5, 0.01), 3e-3, advance=1e-4)
    assert grows(COMPARISON["lagged-inertia"], held(10, 0.5, 0.01), 3e-3, advance=1e-4)


def test_limits_are_those_of_the_scheme_of_the_modes() -> None:
    linear = Newmark(1 / 6, 1 / 2)
    model = held(2, 0.0)
    for scheme in (coupled("lagged-inertia", linear), coupled("picard-relaxed", linear)):
        limit = bisected(lambda x, one=scheme: grows(one, model, x / float(model.omega.max())), 2.0, 5.0)
        assert limit == pytest.approx(math.sqrt(12.0), rel=1e-3)
        assert scheme.stability_limit == pytest.approx(limit, rel=1e-3)
