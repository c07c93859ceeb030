"""Where a load passes a sensor of moments its influence line has a kink, which no step may jump over."""

from __future__ import annotations

import numpy as np
import pytest

from engine.execution import run
from engine.plan import make_plan
from engine.tables import SceneTables
from engine.timeline import Rider
from tests.engine.build import beam, cruise, fixed, force, shuttle, study

AT = 0.3137
MOMENT = {"moment": fixed(AT, "bending_moment")}
SLOW = force(1.0, cruise(0.0, 1.0, 0.02))


def test_the_times_at_which_a_way_passes_a_place() -> None:
    car = make_plan(study(beam(), force(1.0, shuttle(0.2, 0.8, 1.0, 0.0, 2)))).base.carriages[0]
    found = list(car.rider.passes(0.5))
    places = [float(car.rider.path(np.array([tau]), np.floor(tau), np.floor(tau) + 0.5).S[0]) for tau in found[::2]]
    assert len(found) == 4
    np.testing.assert_allclose(places, 0.5, atol=1e-9)
    assert list(Rider(car.rider.motion, 1.0).passes(0.9)) == []


def test_chosen_steps_do_not_jump_over_a_kink() -> None:
    """A slow force: the largest moment is P a b/L within what vibration adds, with 200 steps or so."""
    plan = make_plan(study(beam(modes=4, damping_ratio=0.1), SLOW, sensor=MOMENT, solver={"fidelity": "full"}))
    tables = plan.groups[0].tables
    places = tables.timeline.positions(0, np.arange(tables.timeline.steps + 1.0))
    assert np.abs(places - AT).min() < 1e-9
    jumped = SceneTables(plan.base, tables.steps, "whole", refinement=2)
    others = jumped.timeline.positions(0, np.arange(jumped.timeline.steps + 1.0))
    assert np.abs(others - AT).min() > 1e-5


def test_static_readings_know_the_kink() -> None:
    found = run(study(beam(modes=4), SLOW, sensor=MOMENT, solver={"fidelity": "static"}))
    assert float(found.moment_max) == pytest.approx(AT * (1.0 - AT), rel=1e-12)
