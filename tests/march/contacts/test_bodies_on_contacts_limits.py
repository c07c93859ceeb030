"""Bodies that ride on contacts where the answer is known: masses, sprung masses, forces, rigid joints, orders."""

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from engine.march.richardson import march_scheme
from engine.model.lane_table import padded
from results_schema.arrays import Array
from tests.engine.bodies_on_contacts import FLEXIBLE, RIGID, THREE, TWO, UNEVEN, riding
from tests.engine.build import Table, beam, cruise, fixed, mass, oscillator, shuttle, study, swing, under


def test_on_one_rigid_contact_it_is_a_rigid_mass() -> None:
    bed, way = beam(modes=6, own_weight=True), swing(0.4, 0.3, 0.9, 1)  # starts with a speed, on a slope
    changes: Table = {"solver": {"steps": 900}, "sensor": {"place": fixed(0.61), "below": under("car")}}
    one = {"only": {"at": 0.2, "stiffness": "rigid"}}
    joined = engine.run(riding(way, one, RIGID, bed, **changes))
    single = engine.run(study(bed, mass(0.5, way), **changes))
    for name in ("place_max", "place_min", "below_max", "car_contact_force_max", "car_contact_force_min"):
        assert float(joined[name]) == pytest.approx(float(single[name]), rel=1e-9), name


def test_on_one_spring_it_is_a_sprung_mass() -> None:
    way, bed = cruise(0.0, 1.0, 0.8), beam(modes=6)
    plain: Table = {"solver": {"steps": 900, "static_correction": False}, "sensor": {"place": fixed(0.61)}}
    one = {"only": {"at": 0.2, "stiffness": 40.0, "damping": 1.5}}
    joined = engine.run(riding(way, one, RIGID, bed, **plain))
    single = engine.run(study(bed, oscillator(0.5, 40.0, way, damping=1.5), **plain))
    for name in ("place_max", "place_min", "car_contact_force_max", "car_contact_force_min"):
        assert float(joined[name]) == pytest.approx(float(single[name]), rel=1e-9), name


def test_rigid_joints_are_the_limit_of_stiff_springs() -> None:
    """Two joints hold heave and pitch; stiffer and stiffer springs tend to them, as 1/k."""
    bed, way = beam(modes=3, damping_ratio=0.05), shuttle(0.3, 0.7, 0.8, 0.5, 1)
    changes: Table = {"solver": {"steps": 20000, "static_correction": False}, "sensor": {"place": fixed(0.61)}}

    def largest(stiffness: float | str) -> float:
        contacts = {name: {"at": at, "stiffness": stiffness} for name, at in (("rear", 0.05), ("front", 0.35))}
        return float(engine.run(riding(way, contacts, RIGID, bed, **changes)).place_max)

    joint = largest("rigid")
    gaps = [abs(largest(stiffness) - joint) / joint for stiffness in (2e3, 2e4, 2e5)]
    assert gaps[1] < 0.15 * gaps[0] < 0.15 * 0.02 and gaps[2] < 0.15 * gaps[1]


def test_a_rigid_contact_stays_on_the_track() -> None:
    """From the first instant on, with the speed that a slope gives it, on a bed that sags by itself too."""
    one = {"only": {"at": 0.2, "stiffness": "rigid"}}
    sensors = {"below": under("car"), "own": fixed(0.2, body="table")}
    changes: Table = {
        "solver": {"steps": 4000, "static_correction": False},
        "sensor": sensors,
        "kind": "trajectory",
        "output": {"histories": "all"},
    }
    for motion in (shuttle(0.3, 0.7, 0.8, 0.1, 1), swing(0.4, 0.3, 0.9, 1)):
        found = studies.run(riding(motion, one, RIGID, beam(modes=4, own_weight=True, damping_ratio=0.02), **changes))
        gap = np.abs(found.own.values - found.below.values)
        assert gap.max() < 1e-4 * np.abs(found.below.values).max()


def test_its_weight_alone() -> None:
    """fidelity = "force": the shares of level ground as moving forces."""
    changes: Table = {"sensor": {"place": fixed(0.61)}, "solver": {"steps": 300, "fidelity": "force"}}
    found = engine.run(riding(cruise(0.3, 0.7, 0.8), table=UNEVEN, **changes))
    forces = {
        name: {"on": "bed", "kind": "force", "force": 0.5 * 9.81 * share, "motion": cruise(a, a + 0.4, 0.8)}
        for name, share, a in (("rear", 0.22 / 0.3, 0.15), ("front", 0.08 / 0.3, 0.45))
    }
    base = beam(damping_ratio=0.02, modes=5)
    single = engine.run(study(base, forces, **(changes | {"solver": {"steps": 300}})))
    assert float(found.place_max) == pytest.approx(float(single.place_max), rel=1e-9)
    assert float(found.car_contact_force_max) == pytest.approx(0.5 * 9.81 * 0.22 / 0.3)
    assert float(found.car_contact_force_min) == pytest.approx(0.5 * 9.81 * 0.08 / 0.3)
    sensors = {name: {"carriage": "car", "contact": name, "quantity": "contact_force"} for name in TWO}
    read = engine.run(riding(cruise(0.3, 0.7, 0.8), table=UNEVEN, **(changes | {"sensor": sensors})))
    assert float(read.rear_max) == pytest.approx(0.5 * 9.81 * 0.22 / 0.3) == float(read.rear_static)
    assert float(read.front_min) == pytest.approx(0.5 * 9.81 * 0.08 / 0.3)


@pytest.mark.parametrize(
    ("scheme", "order"),
    [
        ({}, 2.0),
        ({"scheme": "hht-alpha", "alpha": -0.1}, 2.0),
        ({"scheme": "generalized-alpha", "rho_inf": 0.8}, 2.0),
        ({"scheme": "richardson"}, 4.0),
    ],
)
def test_orders(scheme: Table, order: float) -> None:
    def largest(steps: int, solver: Table) -> Array:
        case = riding(shuttle(0.3, 0.7, 0.8, 0.3, 1), THREE, FLEXIBLE, solver={"steps": steps} | solver)
        plan = make_plan(case)
        (group,) = plan.groups
        counts = np.linspace(0, group.tables.timeline.steps, 41).astype(np.int64)
        marched = march_scheme(group.tables, plan.values(group, padded(group.variants)), counts, 1)
        return marched.history[:, :, 0]

    exact = largest(25600, {"scheme": "richardson"})
    errors = [np.nanmax(np.abs(largest(steps, scheme) - exact), axis=0) for steps in (1600, 3200)]
    fitted = np.log2(errors[0] / errors[1])[[0, 1, 2, 4, 7]]
    assert np.all(np.abs(fitted - order) < 0.06 * order)
