"""What the ladder of models tells beforehand: closed forms, limits, bodies of all kinds, and marches of every model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.ladder import Rung, full_fidelity, ladder, model_errors
from engine.plan import make_plan
from engine.scene import Study
from results_schema.status import Fidelity
from tests.calibration.ladder import compared, sample
from tests.engine.build import Table, beam, cruise, fixed, force, mass, oscillator, shuttle, study, swing, under

Array = NDArray[np.float64]

STATIC, FORCE, BARE, MASS = (
    Fidelity.STATIC,
    Fidelity.FORCE,
    Fidelity.MASS_WITHOUT_CONVECTIVE,
    Fidelity.MASS,
)
MOTIONS: dict[str, Table] = {
    "cruise": cruise(0.0, 1.0, 1.0),
    "far cruise": cruise(-0.2, 1.3, 1.0),
    "backward": cruise(1.0, 0.0, 1.0),
    "free vibration": cruise(0.0, 1.0, 1.0, after=2.0),
    "sharp": shuttle(0.1, 0.9, 1.0, 0.0, 3),
    "smooth": shuttle(0.1, 0.9, 1.0, 0.2, 3),
    "sinusoidal": swing(0.5, 0.4, 1.0, 3),
    "waypoints": {"kind": "waypoints", "times": [0.0, 0.5, 1.0], "positions": [0.1, 0.8, 0.4]},
}


def told(given: Study) -> dict[Fidelity, Array]:
    """Estimated errors of all variants by model."""
    plan = make_plan(given)
    return model_errors(plan.base, plan.values(plan.buckets[0], np.arange(plan.size)))


def crossing(alpha: Array, mu: Array, zeta: float = 0.0, **solver: Any) -> Study:
    """A mass over a pinned beam: alpha = speed over pi, mu = mass over the beam's."""
    sweep = {
        "zip": True,
        "speed": {"of": "carriage.car.motion.speed", "values": (math.pi * alpha).tolist()},
        "mass": {"of": "carriage.car.mass", "values": mu.tolist()},
    }
    bed = beam(modes=12, damping_ratio=zeta)
    return study(bed, mass(1.0, cruise(0.0, 1.0, 1.0)), sweep=sweep, solver=solver)


@pytest.fixture(scope="module")
def grid() -> tuple[Array, Array]:
    alpha, mu = np.meshgrid(np.geomspace(0.005, 0.4, 12), np.geomspace(0.01, 0.5, 8))
    return alpha.ravel(), mu.ravel()


def test_a_pinned_beam_has_the_closed_forms(grid: tuple[Array, Array]) -> None:
    """Mechanics section 8, undamped: within a factor of three, and never much below."""
    alpha, mu = grid
    pressed = math.pi**2 * mu * alpha**2 / 3.0
    formulas = {
        STATIC: alpha / (1.0 - alpha) + pressed,
        FORCE: 2.0 * alpha * np.sin(np.minimum(math.pi / 2.0, math.pi * mu / (4.0 * alpha))) + pressed,
        BARE: alpha * (np.sqrt(1.0 + 2.0 * mu) - 1.0) + pressed,
    }
    found = told(crossing(alpha, mu))
    assert set(found) == set(formulas)
    for rung, formula in formulas.items():
        ratio = found[rung] / formula
        assert np.all((ratio > 0.95) & (ratio < 4.0)), rung
        assert 1.1 < np.median(ratio) < 2.5, rung


def test_statics_are_right_when_slow() -> None:
    alpha = np.array([1e-2, 1e-3, 1e-4, 1e-5])
    found = told(crossing(alpha, np.full(4, 0.3), 0.02))[STATIC]
    np.testing.assert_allclose(found[1:] / found[:-1], 0.1, rtol=0.1)
    assert found[-1] < 5e-5


def test_a_force_is_right_when_light() -> None:
    mu = np.array([1e-2, 1e-4, 1e-6, 1e-8])
    found = told(crossing(np.full(4, 0.2), mu, 0.02))
    for rung in (FORCE, BARE):
        np.testing.assert_allclose(found[rung][1:] / found[rung][:-1], 1e-2, rtol=0.1)
    assert found[STATIC].min() > 0.1, "speed, not mass, is what statics miss"


def test_damping_helps(grid: tuple[Array, Array]) -> None:
    alpha, mu = grid
    slow = alpha < 0.02
    free, damped = (told(crossing(alpha[slow], mu[slow], zeta)) for zeta in (0.0, 0.1))
    assert np.all(damped[FORCE] < 0.5 * free[FORCE])
    assert np.all(damped[BARE] < free[BARE])


def test_nothing_is_left_out_by_the_full_model(grid: tuple[Array, Array]) -> None:
    plan = make_plan(crossing(*grid))
    rungs = ladder(plan.base, plan.values(plan.buckets[0], np.arange(plan.size)))
    assert [rung.fidelity for rung in rungs] == [STATIC, FORCE, BARE, MASS]
    assert np.all(rungs[-1].error == 0.0)
    assert np.all(rungs[0].cost == 0.0) and np.all(rungs[1].cost <= rungs[-1].cost)


def test_costs_are_modes_times_steps(grid: tuple[Array, Array]) -> None:
    """At least 200 steps per first period, and per passage; rounded up by less than a quarter, but for the high modes
    under a mass."""
    full = costs(make_plan(crossing(*grid)))[-1]
    least = 12.0 * 200.0 * np.maximum(1.0 / (2.0 * grid[0]), 1.0)
    assert np.all(full.cost >= least)
    slow = grid[0] < 0.02
    assert np.all(full.cost[slow] < 1.5 * least[slow])
    fixed_steps = make_plan(crossing(*grid, steps=3000))
    assert all(np.all(rung.cost == 36000.0) for rung in costs(fixed_steps)[1:])


def test_springs_cost_steps_that_only_the_tied_carriage_needs() -> None:
    moving = oscillator(1.0, 3e5, cruise(0.0, 1.0, 1.0))
    plan = make_plan(study(beam(), moving, solver={"scheme": "average-acceleration"}))
    rungs = costs(plan)
    assert [rung.fidelity for rung in rungs] == [*(STATIC, FORCE, BARE, MASS), Fidelity.TIED]
    assert rungs[-1].cost[0] == 4.0 * plan.buckets[0].steps > 2.0 * rungs[-2].cost[0]


def costs(plan: Any) -> tuple[Rung, ...]:
    """The ladder of all variants of a scene."""
    return ladder(plan.base, plan.values(plan.buckets[0], np.arange(plan.size)))


def test_stiff_springs_are_rigid_and_soft_ones_carry_a_force() -> None:
    stiffness = [1e-4, 1e8]
    sweep = {"k": {"of": "carriage.car.stiffness", "values": stiffness}}
    found = told(study(beam(), oscillator(0.3, 1.0, cruise(0.0, 1.0, 0.3)), sweep=sweep, solver={"steps": 10**7}))
    rigid = told(study(beam(), mass(0.3, cruise(0.0, 1.0, 0.3))))
    assert found[MASS][1] < 1e-4 < 1e-2 < found[MASS][0]
    np.testing.assert_allclose(found[FORCE][1], rigid[FORCE][0], rtol=1e-2)
    assert found[FORCE][0] < 0.1 * rigid[FORCE][0]


def test_a_force_needs_no_more() -> None:
    given = study(beam(), force(3.0, cruise(0.0, 1.0, 1.0)))
    assert full_fidelity(make_plan(given).base) is FORCE
    assert list(told(given)) == [STATIC]


def test_turns_at_an_instant_are_worse_than_smooth_ones() -> None:
    sharp, smooth, smoother = (
        told(study(beam(), mass(0.1, shuttle(0.1, 0.9, 0.05, turn, 1)))) for turn in (0.0, 0.1, 0.4)
    )
    assert sharp[STATIC][0] > 3.0 * smooth[STATIC][0] > 3.0 * smoother[STATIC][0]


def test_a_sinusoidal_load_has_its_closed_form() -> None:
    """Mechanics section 9, undamped: (Om/omega_1)^2 (2.5 + 8.1 mu) for the largest value; the start rings beside."""
    ratio, mu = np.array([0.005, 0.01, 0.02, 0.005, 0.01, 0.02]), np.repeat([0.01, 0.5], 3)
    sweep = {
        "zip": True,
        "pace": {"of": "carriage.car.motion.frequency", "values": (0.5 * math.pi * ratio).tolist()},
        "mass": {"of": "carriage.car.mass", "values": mu.tolist()},
    }
    found = told(study(beam(), mass(1.0, swing(0.5, 0.49, 1.0, 3)), sweep=sweep))[STATIC]
    over = found / (ratio**2 * (2.5 + 8.1 * mu))
    assert np.all((over > 1.0) & (over < 6.0))


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=list(MOTIONS))
@pytest.mark.parametrize(
    "supports", ["pinned-pinned", "clamped-free", [{"at": 0.2, "stiffness": 50.0}, {"at": 0.8, "stiffness": 70.0}]]
)
def test_every_way_has_an_estimate(motion: Table, supports: Any) -> None:
    for start in ("rest", "equilibrium"):
        bed = beam(supports=supports, own_weight=True, damping_ratio=0.01)
        found = told(study(bed, mass(0.2, motion), initial=start, sensor={"below": under("car")}))
        assert set(found) == {STATIC, FORCE, BARE}
        assert all(np.all(np.isfinite(error)) and np.all(error > 0.0) for error in found.values())


def test_loads_add_up() -> None:
    one = mass(0.1, cruise(0.0, 1.0, 0.5))
    alone, both = (
        told(study(beam(), carriages)) for carriages in ({"car": one}, {"car": one, "next": one | {"headway": 0.2}})
    )
    assert np.all(both[FORCE] > 1.9 * alone[FORCE])


def test_a_body_that_nothing_holds_has_no_statics() -> None:
    found = told(study(beam(supports="free-free"), mass(0.1, cruise(0.1, 0.9, 0.5)), initial="rest"))
    assert np.isinf(found[STATIC]).all()
    assert np.all(found[FORCE] > 0.1), "the mass takes part in the rigid motion"


def on_table(**contacts: Table) -> Study:
    """A rigid table on contacts that crosses a beam, from beside it to beside it."""
    table = {"kind": "rigid", "length": 0.4, "mass": 0.3, "inertia": 0.004}
    motion = cruise(-0.3, 1.3, 0.2)
    riding = {"on": "bed", "kind": "body", "body": "table", "motion": motion, "contacts": contacts}
    return study(beam(), riding, body={"bed": beam(), "table": table})


def test_a_stiff_table_is_nearly_a_rigid_mass() -> None:
    stiff, soft = (
        told(on_table(front={"at": 0.4, "stiffness": k}, rear={"at": 0.0, "stiffness": k})) for k in (1e7, 1.0)
    )
    assert 0.0 < stiff[MASS][0] < 1e-2 < soft[MASS][0]
    assert soft[FORCE][0] < stiff[FORCE][0]


def test_contacts_that_carry_or_meet_nothing_do_no_harm() -> None:
    contacts = {"front": {"at": 0.3, "stiffness": 1e5}, "middle": {"at": 0.2, "stiffness": 1e5}}
    found = told(on_table(**contacts, rear={"at": 0.1, "stiffness": 1e5}))
    assert all(np.all(np.isfinite(error)) and np.all(error > 0.0) for error in found.values())


def test_of_what_rides_on_a_table_nobody_can_tell() -> None:
    spring = {"stiffness": 1e5}
    given = on_table(front={"at": 0.4} | spring, rear={"at": 0.0} | spring)
    trolley = mass(0.1, shuttle(0.1, 0.3, 0.1, 0.2, 1), on="table")
    both = study(beam(), dict(given.data["carriage"]) | {"trolley": trolley}, body=given.data["body"])
    assert all(np.isnan(error).all() for error in told(both).values())


def test_a_sensor_on_a_support_says_nothing() -> None:
    load = mass(0.1, cruise(0.0, 1.0, 0.5))
    more = {"middle": fixed(0.5), "support": fixed(1.0)}
    alone, both = told(study(beam(), load)), told(study(beam(), load, sensor=more))
    for rung, error in alone.items():
        np.testing.assert_array_equal(both[rung], error)


def test_dampers_count() -> None:
    load, ends = mass(0.1, cruise(0.0, 1.0, 0.05)), [{"at": 0.0, "stiffness": 90.0}, {"at": 1.0, "stiffness": 90.0}]
    held = {"at": 1.0, "stiffness": 90.0, "damping": 1.0}
    free, damped = (told(study(beam(supports=s), load)) for s in (ends, [ends[0], held]))
    assert damped[FORCE][0] < 0.9 * free[FORCE][0]


def test_without_weight_nobody_can_tell() -> None:
    assert np.isnan(told(study(beam(), mass(0.1, cruise(0.0, 1.0, 0.5)), gravity=0.0))[FORCE]).all()


def test_variants_do_not_know_their_neighbours(grid: tuple[Array, Array]) -> None:
    alpha, mu = grid
    together = told(crossing(alpha, mu))
    alone = told(crossing(alpha[17:18], mu[17:18]))
    for rung, error in together.items():
        np.testing.assert_array_equal(error[17], alone[rung][0])


def test_marches_agree() -> None:
    """A small fixed sample of the calibration: every model marched, over the full one."""
    found = sample(10, 5, slowest=0.01)
    for rung, most in ((STATIC, 3.0), (FORCE, 4.0), (BARE, 5.0)):
        for sensor in ("displacement", "moment"):
            parts = [m for m in found if rung in m.told and m.sensor == sensor]
            ratio = compared(*(np.concatenate([getattr(m, side)[rung] for m in parts]) for side in ("told", "true")))
            assert ratio.size > 80
            assert np.mean(ratio >= 1.0) >= 0.93, (rung, sensor)
            assert np.median(ratio) < most, (rung, sensor)


def test_the_place_that_is_read_counts() -> None:
    quarter, middle = (
        told(study(beam(modes=12), mass(0.2, cruise(0.0, 1.0, 0.3)), sensor={"read": fixed(at)})) for at in (0.25, 0.5)
    )
    assert quarter[STATIC][0] != middle[STATIC][0]
    np.testing.assert_allclose(quarter[STATIC], middle[STATIC], rtol=0.5)
