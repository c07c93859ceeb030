"""Root mean squares: time averages, whatever the steps, against closed forms and statics."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import engine
from engine.batch.plan import make_plan
from engine.kernels.layout import LANES, SECONDS, SQUARES
from engine.march.march import march
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from tests.engine.build import Table, beam, cruise, fixed, force, mass, shuttle, study, under
from tests.reference import closed_forms

SPEED, AFTER = 1.3, 1.7


def crossing(**changes: Any) -> Study:
    """A force crosses a pinned beam of three undamped modes, which then vibrates freely."""
    solver = {"static_correction": False} | changes.pop("solver", {})
    return study(beam(modes=3), force(48.0, cruise(0.0, 1.0, SPEED, after=AFTER)), solver=solver, **changes)


@cache
def exact() -> float:
    """Its root mean square at midspan by the closed form; free vibration goes on with its last state."""
    body, end = closed_forms.PinnedBeam(3, 1.0, 1.0, 1.0), 1.0 / SPEED
    free = AFTER * 2.0 * math.pi / body.omega[0]
    apart = 1e-6
    odd = [closed_forms.PinnedBeam(n, 1.0, 1.0, 1.0) for n in (1, 2, 3)]
    parts = [lambda t, b=b: float(closed_forms.moving_force(b, 48.0, SPEED, 0.5, np.array([t]))[0]) for b in odd]

    def mode(k: int, t: float) -> float:
        return parts[k](t) - (parts[k - 1](t) if k else 0.0)

    last = [(mode(k, end), (mode(k, end + apart) - mode(k, end - apart)) / (2.0 * apart)) for k in range(3)]

    def freely(t: float) -> float:
        pairs = zip(last, body.omega, strict=True)
        return float(sum(q * math.cos(w * t) + v / w * math.sin(w * t) for (q, v), w in pairs))

    driven = quad(lambda t: parts[2](t) ** 2, 0.0, end, epsrel=1e-11, limit=200)[0]
    return math.sqrt((driven + quad(lambda t: freely(t) ** 2, 0.0, free, epsrel=1e-11, limit=200)[0]) / (end + free))


@pytest.mark.parametrize("scheme", ["average-acceleration", "linear-acceleration", "fox-goodwin"])
def test_it_converges_with_the_steps(scheme: str) -> None:
    """Of second order, as the trapezoidal rule is; steps of the passage and of the free vibration are cut alike."""
    given, errors = crossing(solver={"scheme": scheme, "steps": 40}), []
    (grid,) = make_plan(given).grids
    for by in (2, 4, 8):
        marked = march(
            grid.tables(grid.scene, by), VariantValues(given, {}, LANES), np.zeros(0, np.int64), 1
        ).statistics
        errors.append(math.sqrt(marked[0, SQUARES, 0] / marked[0, SECONDS, 0]) - exact())
    assert -np.polyfit(np.log([2, 4, 8]), np.log(np.abs(errors)), 1)[0] == pytest.approx(2.0, abs=0.1)
    assert abs(errors[-1]) < 2e-4 * exact()


def test_a_pair_takes_simpsons_rule() -> None:
    pair = engine.run(crossing(solver={"scheme": "richardson", "steps": 1600}))
    assert float(pair.midspan_rms) == pytest.approx(exact(), rel=1e-7)


def test_free_vibration_has_steps_of_its_own() -> None:
    """Its 340 steps against 200, 400 and 3000 of the passage, at three paces: each is a time average."""
    for steps in (200, 400, 3000):
        assert float(engine.run(crossing(solver={"steps": steps})).midspan_rms) == pytest.approx(exact(), rel=3e-4)
    paces = {"speed": {"of": "carriage.car.motion.speed", "values": [0.5 * SPEED, SPEED, 2.0 * SPEED]}}
    assert float(engine.run(crossing(sweep=paces, solver={"steps": 800})).midspan_rms[1]) == pytest.approx(
        exact(), rel=3e-4
    )


def test_under_a_carriage_only_its_own_time_counts() -> None:
    """Slowly over a beam on which it is for two thirds of the time, and never from outside."""
    slow = 1e-3
    sensors = {"below": under("car"), "midspan": fixed(0.5)}
    for solver in ({"fidelity": "static"}, {"steps": 6000}):
        found = engine.run(study(beam(), force(48.0, cruise(-0.2, 1.3, slow)), sensor=sensors, solver=solver))
        below = quad(lambda s: (16.0 * (s * (1.0 - s)) ** 2) ** 2, 0.0, 1.0)[0]
        midspan = 2.0 * quad(lambda s: (s * (3.0 - 4.0 * s**2)) ** 2, 0.0, 0.5)[0] / 1.5
        assert float(found.below_rms) == pytest.approx(math.sqrt(below), rel=2e-4)
        assert float(found.midspan_rms) == pytest.approx(math.sqrt(midspan), rel=2e-4)


@pytest.mark.parametrize("fidelity", ["static", "full"])
def test_at_rest_it_is_a_time_average_too(fidelity: str) -> None:
    """A slow mass and a beam that then stands still for half of the time, or bends under a parked mass and itself."""
    period = 2.0 * math.pi / math.pi**2
    slow = 0.02
    there = cruise(0.0, 1.0, slow, after=1.0 / slow / period)
    solver: Table = {"fidelity": fidelity, "tolerance": 0.1} | ({} if fidelity == "static" else {"steps": 4000})
    found = engine.run(study(beam(modes=2, damping_ratio=0.05), mass(0.1, there), solver=solver))
    weight = 0.1 * 9.81 / 48.0
    square = 2.0 * quad(lambda s: (s * (3.0 - 4.0 * s**2)) ** 2, 0.0, 0.5)[0] / 2.0
    assert float(found.midspan_rms) == pytest.approx(weight * math.sqrt(square), rel=2e-3)
    parked = {"car": mass(0.1, there), "still": mass(0.2, shuttle(0.5, 0.7, 10.0, 0.4, 1))}
    both = engine.run(study(beam(modes=2, damping_ratio=0.05, own_weight=True), parked, solver=solver))
    own = 0.2 * 9.81 / 48.0 + 9.81 * closed_forms.own_weight_pinned(0.5)
    passing = [weight * s * (3.0 - 4.0 * s**2) + own for s in np.linspace(0.0, 0.5, 2001)]
    expected = math.sqrt(0.5 * float(np.mean(np.square(passing))) + 0.5 * own**2)
    assert float(both.midspan_rms) == pytest.approx(expected, rel=2e-3)
