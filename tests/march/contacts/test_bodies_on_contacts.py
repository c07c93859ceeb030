"""Bodies that ride on contacts: the engine against a dense twin, lanes, steps, histories and separation."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import engine
import studies
from engine.batch.plan import make_plan
from engine.march.march import march
from engine.march.step_rules import contact_omega
from engine.model.lane_table import padded
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from tests.engine.bodies_on_contacts import FLEXIBLE, FRAME, SHOES, THREE, TWO, UNEVEN, riding
from tests.engine.bodies_on_contacts_dense import Twin, Where
from tests.engine.build import Table, beam, cruise, fixed, shuttle, swing


def histories(case: Study) -> tuple[dict[str, Array], Twin, tuple[Array, Array, list[Where]], NDArray[np.bool_]]:
    """The engine's sensors by name at all stations, the twin and its march, and which stations lie within segments."""
    plan = make_plan(case)
    (group,) = plan.groups
    tables, values = group.tables, plan.values(group, padded(group.variants))
    segments = [segment for segment in tables.timeline.segments if not segment.free]
    counts = np.arange(segments[-1].first + segments[-1].steps + 1)
    found = march(tables, values, counts, 1).history[:, :, 0]
    twin = Twin(case)
    x, force, where = twin.march(segments, float(values.scene_time_scale[0]))
    kept, inner, first = [], [], 0
    for number, segment in enumerate(segments):
        stations = list(range(first, first + segment.steps + 1))[0 if number == 0 else 1 :]
        kept += stations
        inner += [True] * (len(stations) - 1) + [number + 1 == len(segments)]
        first += segment.steps + 1
    names = [sensor.name for sensor in tables.sensors]
    marched = x[kept], force[kept], [where[station] for station in kept]
    return {n: found[:, names.index(n)] for n in names}, twin, marched, np.array(inner)


PLAIN: Table = {"steps": 200, "static_correction": False}
SCENES: dict[str, Callable[[], Study]] = {
    "rigid, passing": lambda: riding(cruise(0.3, 0.7, 0.8)),
    "reference on, contacts off": lambda: riding(cruise(0.05, 0.95, 0.8)),
    "rigid, uneven, over both ends": lambda: riding(cruise(-0.4, 1.4, 0.8), table=UNEVEN),
    "backward, over both ends": lambda: riding(cruise(1.4, -0.4, 0.8), table=UNEVEN),
    "without static correction": lambda: riding(shuttle(0.3, 0.7, 0.8, 0.1, 2), THREE, FLEXIBLE, solver=PLAIN),
    "flexible on three": lambda: riding(shuttle(0.3, 0.7, 0.8, 0.1, 2), THREE, FLEXIBLE),
    "own weight of the bed": lambda: riding(swing(0.5, 0.2, 0.7, 2), THREE, FLEXIBLE, beam(own_weight=True, modes=4)),
    "own weight, entering": lambda: riding(cruise(-0.4, 0.7, 0.8), bed=beam(own_weight=True), initial="equilibrium"),
    "reference at the rear": lambda: _moved(riding(cruise(0.1, 0.5, 0.8), THREE, FLEXIBLE)),
    "frame on points": lambda: riding(shuttle(0.3, 0.7, 0.8, 0.1, 2), SHOES, FRAME),
}


def _moved(case: Study) -> Study:
    return case.with_values({"carriage.car.reference": 0.05})


@pytest.mark.parametrize("name", SCENES)
def test_the_engine_agrees_with_the_dense_twin(name: str) -> None:
    found, twin, (x, force, where), inner = histories(SCENES[name]())
    assert inner.sum() >= 190
    contacts = list(twin.study.carriage["car"].riding_contacts)
    for contact, pressed in zip([*contacts, "total"], [*force.T, force.sum(axis=1)], strict=True):
        seen = inner & np.isfinite(found[contact])
        assert seen.sum() > 30
        assert np.abs(found[contact] - pressed)[seen].max() <= 1e-9 * np.abs(force).max()
    for sensor in ("tip", "place"):
        spec = twin.study.sensor[sensor]
        seen = np.flatnonzero(inner)[::10]
        read = [twin.displacement(str(spec.body), float(spec.at or 0.0), x[h], force[h], where[h]) for h in seen]
        assert np.abs(found[sensor][seen] - read).max() <= 1e-9 * np.abs(found[sensor]).max()


def test_lanes_agree_with_single_variants() -> None:
    """Speed, gravity and damping of a contact are lanes; stiffness makes scenes of their own."""
    swept = {
        "speed": {"of": "carriage.car.motion.speed", "values": [0.3, 0.8]},
        "damping": {"of": "carriage.car.contacts.rear.damping", "values": [0.1, 0.6]},
        "stiffness": {"of": "carriage.car.contacts.front.stiffness", "values": [300.0, 900.0]},
    }
    case = riding(shuttle(0.3, 0.7, 0.8, 0.1, 1), sweep=swept)
    assert len(make_plan(case).groups) == 2
    found = engine.run(case).sel(speed=0.3, damping=0.6, stiffness=900.0)
    values = {"carriage.car.motion.speed": 0.3, "carriage.car.contacts.rear.damping": 0.6}
    alone = engine.run(case.without_sweep().with_values(values | {"carriage.car.contacts.front.stiffness": 900.0}))
    for name in ("rear_max", "tip_min", "place_max"):
        assert float(found[name]) == pytest.approx(float(alone[name]), rel=1e-12)


def test_frequencies_of_contacts_on_their_springs() -> None:
    """k (v.v + largest phi.phi), summed over the contacts: of a rigid body v.v = 1/m + arm^2/J."""
    (group,) = make_plan(riding(cruise(0.3, 0.7, 0.8))).groups
    places = np.linspace(0.0, 1.0, 257)
    mobility = np.max(sum(2.0 * np.sin(n * np.pi * places) ** 2 for n in range(1, 6)))
    own = 1.0 / 0.5 + 0.15**2 / 0.01
    square = (400.0 + 500.0) * (own + mobility)
    found = contact_omega(group.scene, VariantValues(group.scene.study, {}, 1))
    assert float(found[0]) == pytest.approx(np.sqrt(square), rel=1e-9)
    rigid = {"rear": {"at": 0.05, "stiffness": "rigid"}, "front": TWO["front"]}
    model = make_plan(riding(shuttle(0.3, 0.7, 0.8, 0.1, 1), rigid)).base
    assert float(contact_omega(model, VariantValues(model.study, {}, 1))[0] ** 2) == pytest.approx(
        500.0 * square / 900.0
    )


def test_a_damper_that_only_a_sweep_has() -> None:
    contact = "carriage.car.contacts.b.damping"
    case = riding(shuttle(0.3, 0.7, 0.8, 0.1, 1), THREE, sweep={"damping": {"of": contact, "values": [0.0, 0.6]}})
    found = engine.run(case)
    for damping in (0.0, 0.6):
        alone = engine.run(case.without_sweep().with_values({contact: damping}))
        assert float(found.b_max.sel(damping=damping)) == pytest.approx(float(alone.b_max), rel=1e-12)
    assert abs(float(found.b_max[0]) - float(found.b_max[1])) > 1e-3


def test_a_trajectory_has_the_acceleration_of_what_rides() -> None:
    sensor = {"centre": fixed(0.2, "acceleration", body="table")}
    case = riding(cruise(0.3, 0.7, 0.8), sensor=sensor, kind="trajectory", output={"histories": "all"})
    found = studies.run(case)
    assert np.ptp(found.centre.values) > 0.1
    assert np.array_equal(found.car_acceleration_across.values, found.centre.values)


def test_separation_is_judged_at_every_contact() -> None:
    """A contact behind the centre of mass of a braking load lifts long before the whole does."""
    found = engine.run(riding(shuttle(0.3, 0.7, 2.2, 0.05, 1)))
    assert int(found.status) == 1
    assert float(found.car_contact_force_min) == pytest.approx(min(float(found.rear_min), float(found.front_min)))
    assert np.isfinite(float(found.car_separation_position))
