"""What a spring and a damper under a sprung mass press with: by what it accelerates, and what it presses on."""

from typing import Any

import numpy as np
import pytest

import engine
import studies
from results_schema.errors import BadInput
from tests.engine.build import aboard, beam, cruise, fixed, mass, oscillator, study, under
from tests.unreduced.test_unreduced import apart

WHEEL, MASSES, GRAVITY = 0.2, [0.3, 0.6], 9.81
READ: dict[str, Any] = {
    "spring": aboard("car", "suspension_force"),
    "body": aboard("car", "acceleration"),
    "wheel": under("car", "acceleration"),
    "contact": aboard("car", "contact_force"),
}


def crossing(sensors: dict[str, Any], **changes: Any) -> Any:
    motion = cruise(0.0, 1.0, 0.5)
    car = oscillator(MASSES[0], 40.0, motion, wheel_mass=WHEEL, damping=1.5)
    more = {"sensor": sensors, "solver": {"steps": 2000}, "output": {"histories": "all"}}
    return study(beam(modes=12), {"car": car, "cart": mass(0.1, motion)}, **(more | changes))


def test_it_accelerates_the_sprung_mass_and_presses_on_the_wheel() -> None:
    plain = {"steps": 2000, "static_correction": False}  # accelerations are read of the kept modes alone
    found = engine.run(crossing(READ, solver=plain, sweep={"mass": {"of": "carriage.car.mass", "values": MASSES}}))
    sprung = found.mass.values[:, None]
    spring, body, wheel, contact = (found[name].values for name in READ)
    assert np.abs(spring).max() > 0.05 * GRAVITY * MASSES[0]
    np.testing.assert_allclose(spring, -sprung * body, rtol=0.0, atol=1e-9 * np.abs(spring).max())
    pressing = sprung * GRAVITY + spring + WHEEL * (GRAVITY - wheel)
    np.testing.assert_allclose(contact, pressing, rtol=0.0, atol=1e-9 * np.abs(contact).max())


def test_the_unreduced_model_reads_the_same() -> None:
    given = crossing({"spring": READ["spring"], "middle": fixed(0.5)})
    assert max(apart(given.with_values({"body.bed.modes": 30})).values()) < 3e-4


def test_a_coach_on_its_wheels_is_as_many_sprung_masses() -> None:
    """A rigid body with half of its mass over each of two suspensions, whose wheels are carriages of their own."""
    base, spring = 0.2, {"stiffness": 40.0, "damping": 1.5}
    ways = {"front": cruise(0.0, 1.2, 0.5), "rear": cruise(-base, 1.0, 0.5)}
    table = {"kind": "rigid", "length": 0.3, "mass": 2.0 * MASSES[0], "inertia": 2.0 * MASSES[0] * (0.5 * base) ** 2}
    contacts = {"front": spring | {"at": 0.15 + 0.5 * base}, "rear": spring | {"at": 0.15 - 0.5 * base}}
    coach = {"on": "bed", "kind": "body", "body": "table", "contacts": contacts, "motion": cruise(-0.1, 1.1, 0.5)}
    plain = {"steps": 2000, "tolerance": 0.5, "static_correction": False}  # which wheels of both kinds feel otherwise
    bed, more = beam(modes=12), {"solver": plain, "output": {"histories": "all"}}
    sensors = {name: {"carriage": "coach", "contact": name, "quantity": "contact_force"} for name in ways}
    wheels = {f"{name}_wheels": mass(WHEEL, way) for name, way in ways.items()}
    sensors |= {"middle": fixed(0.5)}
    whole = study(bed, {"coach": coach} | wheels, body={"bed": bed, "table": table}, sensor=sensors, **more)
    axles = {name: oscillator(MASSES[0], motion=way, wheel_mass=WHEEL, **spring) for name, way in ways.items()}
    read = {name: aboard(name, "suspension_force") for name in ways} | {"middle": fixed(0.5)}
    found, single = (engine.run(given) for given in (whole, study(bed, axles, sensor=read, **more)))
    np.testing.assert_allclose(found.middle, single.middle, rtol=0.0, atol=1e-12)
    for name in ways:
        beyond = found[name].values - GRAVITY * MASSES[0]
        np.testing.assert_allclose(beyond, single[name].values, rtol=0.0, atol=1e-9 * np.nanmax(np.abs(beyond)))
        assert np.nanmax(np.abs(beyond)) > 0.05 * GRAVITY * MASSES[0]


def test_an_answer_names_it_and_it_has_no_static_value() -> None:
    found = studies.run(crossing({"spring": READ["spring"]}))
    assert "the largest suspension force of car is" in " ".join(studies.answer(found))
    assert np.isnan(found.dynamic_amplification.values).all()


@pytest.mark.parametrize(
    ("sensor", "told"),
    [
        (aboard("cart", "suspension_force"), 'no sprung mass; expected an oscillator.*"contact_force"'),
        (under("car", "suspension_force"), "a suspension_force is that of a carriage; expected carriage"),
        (aboard("car", "suspension_force") | {"contact": "front"}, "only contact forces are read at a contact"),
        (aboard("car", "spring-force"), "suspension_force"),
    ],
    ids=str,
)
def test_refusals(sensor: dict[str, Any], told: str) -> None:
    with pytest.raises(BadInput, match=told):
        studies.run(crossing({"spring": sensor}))
