"""What the ladder of models tells of sensors: closed forms of a beam, statics of other bodies, what it cannot tell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.ladder import errors_along, model_errors
from engine.moving_load import Load, noticed
from engine.plan import Plan, make_plan
from engine.quasistatic import rest
from engine.route import routes
from engine.scene import Study
from engine.tables import SceneTables
from results_schema.status import Fidelity
from tests.bodies.frames import LENGTH, PINNED, straight
from tests.calibration.ladder import LANES, Scene, measure
from tests.engine.build import Table, aboard, beam, cruise, fixed, force, mass, oscillator, shuttle, study, swing, under

Array = NDArray[np.float64]

STATIC, FORCE = Fidelity.STATIC, Fidelity.FORCE
CROSSING = cruise(0.0, 1.0, 0.3)
QUANTITIES = ("displacement", "bending_moment", "shear_force", "stress", "strain")
SECTION = {"second_moment": 2.0, "youngs_modulus": 3.0, "fibre_distance": 0.1}


def planned(sensor: dict[str, Table], carriage: Table | None = None, **changes: Any) -> Plan:
    """A pinned beam with many modes, sensors and a mass of weight 1 N that crosses it."""
    bed = changes.pop("bed", beam(modes=20))
    return make_plan(study(bed, carriage or mass(1.0 / 9.81, CROSSING), sensor=sensor, **changes))


def values_of(plan: Plan) -> Any:
    return plan.values(plan.buckets[0], np.arange(plan.size))


def told(plan: Plan, **more: Any) -> dict[Fidelity, Array]:
    return model_errors(plan.base, values_of(plan), **more)


def load_of(plan: Plan, most: int = 12) -> Load:
    """The only load of a scene."""
    found = routes(plan.base, most)
    assert found is not None and len(found) == 1
    return Load(found[0], values_of(plan))


def test_rows_and_scales_of_a_pinned_beam() -> None:
    """phi_k = sqrt 2 sin(k pi x), omega_k = (k pi)^2 with L = E I = rho A = 1; the largest moment of P is P L/4, the
    largest deflection P L^3/(48 E I), the largest shear at midspan P/2."""
    sensors = {
        "w": fixed(0.5),
        "m": fixed(0.5, "bending_moment"),
        "v": fixed(0.5, "shear_force"),
        "m_under": under("car", "bending_moment"),
    }
    load = load_of(planned(sensors))
    k = np.arange(1, 13)
    np.testing.assert_array_equal(load.modes, k - 1)
    sine, cosine = np.abs(np.sin(0.5 * k * math.pi)), np.abs(np.cos(0.5 * k * math.pi))
    slope = k * math.pi
    expected = math.sqrt(2.0) * np.array([sine / slope**4, sine / slope**2, cosine / slope, 1.0 / slope**2])
    found = np.hstack([load.at_places(row[:, None]) for row in np.eye(12)])
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-12)
    np.testing.assert_allclose(load.scale[:, 0], [1.0 / 48.0, 0.25, 0.5, 0.25], rtol=5e-3)


def test_more_modes_are_looked_at_where_they_matter() -> None:
    deflection, moment = ({"read": under("car", quantity)} for quantity in ("displacement", "bending_moment"))
    assert load_of(planned(moment, bed=beam(modes=40)), 40).modes.size == 40
    assert load_of(planned(moment, bed=beam(modes=40))).modes.size == 12
    assert 5 < load_of(planned(deflection, bed=beam(modes=40)), 40).modes.size < 20


def scaled(bed: Table, sensors: dict[str, Table], carriage: Table) -> tuple[Array, Array]:
    """Largest static values as the load tells them, and as the statics of the whole scene do."""
    plan = make_plan(study({"length": 1.0}, carriage, body={"bed": bed}, sensor=sensors))
    tables = SceneTables(plan.base, 2000, "whole")
    counts = np.arange(tables.timeline.steps + 1)
    history = rest(tables, values_of(plan), counts, 1).history
    return load_of(plan).scale[:, 0], np.nanmax(np.abs(history[:, :, 0]), axis=0)


@pytest.mark.parametrize(
    "supports", ["pinned-pinned", "clamped-pinned", [{"at": 0.2, "stiffness": 90.0}, {"at": 0.8, "stiffness": 70.0}]]
)
@pytest.mark.parametrize("motion", [CROSSING, shuttle(0.3, 0.9, 1.0, 0.2, 1)], ids=["cruise", "shuttle"])
def test_scales_are_the_largest_static_values(supports: Any, motion: Table) -> None:
    sensors = {quantity: fixed(0.35, quantity) for quantity in QUANTITIES}
    sensors |= {f"{quantity}_under": under("car", quantity) for quantity in QUANTITIES}
    found, expected = scaled(beam(supports=supports, **SECTION), sensors, mass(0.2, motion))
    np.testing.assert_allclose(found, expected, rtol=1e-2)


def test_scales_of_frames() -> None:
    bed = straight(PINNED)
    sensors = {q: fixed(0.4 * LENGTH, q) for q in (*QUANTITIES, "axial_force")} | {"under": under("car", "stress")}
    ride = mass(20.0, cruise(0.0, LENGTH, 5.0))
    found, expected = scaled(bed, sensors, ride)
    np.testing.assert_allclose(found, expected, rtol=1e-2, atol=1e-9 * expected.max())
    sensors.pop("axial_force")
    errors = told(make_plan(study({"length": 1.0}, ride, body={"bed": bed}, sensor=sensors)))
    assert all(np.isfinite(error).all() and (error > 0.0).all() for error in errors.values())


def test_the_worst_of_all_sensors_counts() -> None:
    sensors = {"w": fixed(0.4), "m": fixed(0.5, "bending_moment"), "v": fixed(0.3, "shear_force")}
    together = told(planned(sensors))
    alone = [told(planned({name: sensor})) for name, sensor in sensors.items()]
    for rung, error in together.items():
        worst = np.max([one[rung] for one in alone], axis=0)
        np.testing.assert_allclose(error, worst, rtol=1e-3)
        assert error[0] > alone[0][rung][0]


def test_stress_and_strain_are_parts_of_the_moment() -> None:
    sensors = [{"read": fixed(0.5, quantity)} for quantity in ("bending_moment", "stress", "strain")]
    moment, *others = (told(planned(sensor, bed=beam(**SECTION))) for sensor in sensors)
    for other in others:
        for rung, error in other.items():
            np.testing.assert_allclose(error, moment[rung], rtol=1e-9)


def test_shear_rings_in_high_modes() -> None:
    deflection, shear = (planned({"read": fixed(0.3, quantity)}) for quantity in ("displacement", "shear_force"))
    few, many = ([told(plan, most=most)[STATIC][0] for plan in (deflection, shear)] for most in (5, 20))
    assert many[0] < 1.01 * few[0]
    assert many[1] > 1.05 * few[1]


UNTOLD = {
    "velocity": fixed(0.5, "velocity"),
    "acceleration": under("car", "acceleration"),
    "contact force": aboard("car", "contact_force"),
}


@pytest.mark.parametrize("sensor", UNTOLD.values(), ids=list(UNTOLD))
def test_of_rates_and_contact_forces_nobody_can_tell(sensor: Table) -> None:
    plan = planned({"middle": fixed(0.5), "read": sensor})
    assert all(np.isnan(error).all() for error in told(plan).values())
    assert routes(plan.base) is None


def test_of_a_sprung_mass_nobody_can_tell() -> None:
    plan = planned({"read": aboard("car")}, oscillator(0.1, 30.0, CROSSING))
    assert all(np.isnan(error).all() for error in told(plan).values())


def test_a_moment_at_a_pinned_end_says_nothing() -> None:
    middle = {"middle": fixed(0.5, "bending_moment")}
    alone, both = told(planned(middle)), told(planned(middle | {"end": fixed(0.0, "bending_moment")}))
    for rung, error in alone.items():
        np.testing.assert_allclose(both[rung], error, rtol=1e-3)


def test_a_mass_hands_ringing_to_modes_that_nothing_else_shakes() -> None:
    """A mass that sets off from the middle of a clamped beam shakes the second mode alone, which a sensor there cannot
    see; by its inertia the first one rings too, more than by anything else."""
    motion = swing(0.5, 0.33, 1.0, 1)
    sweep = {
        "zip": True,
        "mass": {"of": "carriage.car.mass", "values": np.geomspace(0.01, 0.1, LANES).tolist()},
        "pace": {"of": "carriage.car.motion.frequency", "values": [0.02] * LANES},
    }
    scene = Scene(beam(modes=8, supports="clamped-clamped"), mass(1.0, motion), sweep, {"w": fixed(0.5)})
    told_errors, true = measure(scene)["w"]
    for rung in (STATIC, FORCE):
        ratio = told_errors[rung] / true[rung]
        assert np.all((ratio > 1.0) & (ratio < 8.0)), rung


def test_what_is_zero_at_rest_alone_is_in_the_way_of_every_simpler_model() -> None:
    """Under a load at the end of what it passed of a cantilever there is no moment, unless that end swings."""
    plan = planned({"read": under("car", "bending_moment")}, bed=beam(supports="clamped-free"))
    assert all(np.all(error > 1.0) for error in told(plan).values())


def test_two_loads_are_parts_of_the_larger_one() -> None:
    light, heavy = mass(0.1, CROSSING), mass(0.2, CROSSING, headway=0.3)
    plan = make_plan(study(beam(), {"car": light, "next": heavy}, sensor={"read": fixed(0.5, "bending_moment")}))
    found = routes(plan.base)
    assert found is not None
    loads = [Load(route, values_of(plan)) for route in found]
    np.testing.assert_array_equal(noticed(loads), loads[1].scale)


def test_parts_of_the_variants_share_their_routes() -> None:
    sweep = {"speed": {"of": "carriage.car.motion.speed", "from": 0.01, "to": 1.0, "count": 20}}
    plan = planned({"read": fixed(0.5, "bending_moment")}, sweep=sweep)
    along, whole = routes(plan.base), told(plan)
    part = plan.values(plan.buckets[0], np.arange(5, 12))
    for rung, error in errors_along(plan.base, along, part).items():
        np.testing.assert_allclose(error, whole[rung][5:12], rtol=1e-12)


def test_forces_tell_statics_alone() -> None:
    given: Study = study(beam(), force(3.0, CROSSING), sensor={"read": fixed(0.5, "bending_moment")})
    assert list(told(make_plan(given))) == [STATIC]
