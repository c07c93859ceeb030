"""Bodies that ride on contacts: the engine against a dense twin, lanes, steps, histories, separation, limits."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import engine
import studies
from engine.batch.plan import make_plan
from engine.march.march import march
from engine.march.richardson import march_scheme
from engine.march.step_rules import contact_omega
from engine.model.distinct_models import base_scene
from engine.model.lane_table import padded
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from results_schema.errors import BadInput
from tests.engine.bodies_on_contacts import FLEXIBLE, FRAME, RIGID, SHOES, THREE, TWO, UNEVEN, riding
from tests.engine.bodies_on_contacts_dense import Twin, Where
from tests.engine.build import Table, beam, cruise, fixed, mass, oscillator, shuttle, study, swing, under


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


OTHER_MASSES = {"mass": [0.2, 0.5, 1.1], "inertia": [0.004, 0.03]}
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
    """Speed, gravity, damping and stiffness of a contact are lanes."""
    swept = {
        "speed": {"of": "carriage.car.motion.speed", "values": [0.3, 0.8]},
        "damping": {"of": "carriage.car.contacts.rear.damping", "values": [0.1, 0.6]},
        "stiffness": {"of": "carriage.car.contacts.front.stiffness", "values": [300.0, 900.0]},
    }
    case = riding(shuttle(0.3, 0.7, 0.8, 0.1, 1), sweep=swept)
    assert len(make_plan(case).groups) == 1
    found = engine.run(case).sel(speed=0.3, damping=0.6, stiffness=900.0)
    values = {"carriage.car.motion.speed": 0.3, "carriage.car.contacts.rear.damping": 0.6}
    alone = engine.run(case.without_sweep().with_values(values | {"carriage.car.contacts.front.stiffness": 900.0}))
    for name in ("rear_max", "tip_min", "place_max"):
        assert float(found[name]) == pytest.approx(float(alone[name]), rel=1e-12)


WAY = cruise(0.3, 0.6, 0.8)
JOINTS = {name: {"at": at, "stiffness": "rigid"} for name, at in (("rear", 0.05), ("front", 0.35))}
TROLLEY = {"on": "table", "kind": "mass", "mass": 0.2, "motion": cruise(0.02, 0.38, 0.4)}
CARRYING = {"car": {"on": "bed", "kind": "body", "body": "table", "contacts": TWO, "motion": WAY}, "trolley": TROLLEY}
MASSES: dict[str, Callable[[Table], Study]] = {
    "a table, standing still at first": lambda sweep: riding(
        shuttle(0.3, 0.7, 0.8, 0.1, 1), initial="equilibrium", sweep=sweep
    ),
    "uneven, over both ends": lambda sweep: riding(cruise(-0.4, 1.4, 0.8), table=UNEVEN, sweep=sweep),
    "on rigid contacts, on a bed that sags": lambda sweep: riding(
        shuttle(0.3, 0.7, 0.8, 0.3, 1), JOINTS, bed=beam(own_weight=True, modes=5), sweep=sweep
    ),
    "with a trolley on it": lambda sweep: riding(WAY, carriage=CARRYING, sweep=sweep),
}


@pytest.mark.parametrize("name", MASSES)
def test_rigid_bodies_of_other_masses_share_a_scene(name: str) -> None:
    """Heave and pitch keep their shapes: every lane has masses of its own, as each would have in a scene of its own."""
    swept = {key: {"of": f"body.table.{key}", "values": values} for key, values in OTHER_MASSES.items()}
    case = MASSES[name](swept)
    assert len(make_plan(case).grids) == 1
    found = engine.run(case)
    for place in np.ndindex(3, 2):
        own = {f"body.table.{key}": OTHER_MASSES[key][number] for key, number in zip(OTHER_MASSES, place, strict=True)}
        alone = engine.run(case.without_sweep().with_values(own))
        for result in ("tip_max", "tip_acceleration_min", "place_rms", "rear_max", "total_min", "place_static"):
            known = float(alone[result])
            assert float(found[result][place]) == pytest.approx(known, rel=1e-10), (result, place)


def test_rigid_bodies_on_one_rigid_contact_have_scenes_of_their_own() -> None:
    """How that sets them moving at time 0 is shared out by masses."""
    one = {"only": {"at": 0.2, "stiffness": "rigid"}}
    swept = {"mass": {"of": "body.table.mass", "values": OTHER_MASSES["mass"]}}
    assert len(make_plan(riding(shuttle(0.3, 0.7, 0.8, 0.1, 1), one, sweep=swept)).grids) == 3


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


# ---- where the answer is known: masses, sprung masses, forces, rigid joints, orders ----


def test_on_one_rigid_contact_it_is_a_rigid_mass() -> None:
    bed, way = beam(modes=6, own_weight=True), swing(0.4, 0.3, 0.9, 1)  # starts with a speed, on a slope
    plain: Table = {"steps": 900, "static_correction": False}  # which a mass feels, a rigid contact does not
    changes: Table = {"solver": plain, "sensor": {"place": fixed(0.61), "below": under("car")}}
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
    changes: Table = {
        "solver": {"steps": 20000, "static_correction": False, "tolerance": 0.5},
        "sensor": {"place": fixed(0.61)},
    }

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
        "solver": {"steps": 4000, "static_correction": False, "tolerance": 0.5},
        "sensor": sensors,
        "kind": "trajectory",
        "output": {"histories": "all"},
    }
    for motion in (shuttle(0.3, 0.7, 0.8, 0.1, 1), swing(0.4, 0.3, 0.9, 1)):
        found = studies.run(riding(motion, one, RIGID, beam(modes=4, own_weight=True, damping_ratio=0.02), **changes))
        gap = np.abs(found.own.values - found.below.values)
        assert gap.max() < 1e-4 * np.abs(found.below.values).max()


def test_what_turns_easily_stands_all_the_same() -> None:
    """Shares of the weight follow from places and springs alone, however small the inertia."""
    for inertia in (0.01, 1e-16):
        (car,) = base_scene(riding(cruise(0.3, 0.7, 0.8), table=UNEVEN | {"inertia": inertia})).carriages
        assert [load.share for load in car.loads] == pytest.approx([0.22 / 0.3, 0.08 / 0.3], rel=1e-9)


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


# ---- what is refused ----


def change(case: Study, path: str, value: Any) -> Study:
    return case.with_values({path: value})


WHOLE = riding(shuttle(0.3, 0.7, 0.8, 0.1, 2))


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("carriage.car.body", "bed", r"carriage\.car\.body: a body cannot ride on itself"),
        ("carriage.car.body", "tabel", r"carriage\.car\.body: no such body"),
        ("carriage.car.contacts.front.at", 0.5, r"contacts\.front\.at: a place off the track of the body that rides"),
        ("carriage.car.contacts.front.at", 0.1, r"carriage\.car\.contacts: this body would tip over"),
        ("carriage.car.contacts", {}, r"carriage\.car\.contacts"),
        ("carriage.car.contacts.rear", {"at": 0.35, "stiffness": 1.0}, r"this body would tip over"),
        ("carriage.car.contacts.front.stiffness", 0.0, r"contacts\.front\.stiffness"),
        ("carriage.car.contacts.front.stiffness", "stiff", r"contacts\.front\.stiffness"),
        ("carriage.car.contacts.front.stiffness", "rigid", r"a rigid contact has no damper"),
        ("carriage.car.contacts.front.point", "toe", r"exactly one place"),
        ("carriage.car.contacts.front", {"point": "toe", "offset": 0.1, "stiffness": 1.0}, r"no such point"),
        ("carriage.car.contacts.front", {"point": "toe", "stiffness": 1.0}, r"a point needs an offset"),
        ("carriage.car.motion.end", 0.9, r"contacts\.front: this contact leaves the body"),
        ("carriage.car.reference", 0.6, r"carriage\.car\.reference: a place off the track"),
        ("solver.fidelity", "mass", r"solver\.fidelity: .*has no meaning"),
        ("body.table.damping_ratio", 0.02, r"body\.table: a rigid body has no modes that bend"),
        ("body.table.modes", 3, r"body\.table: a rigid body has no modes that bend"),
        ("body.table.own_weight", True, r"nothing holds this body fully"),
        ("body.table", beam(length=0.4, modes=4), r"something holds this body"),
        ("body.table.centre", 0.41, r"body\.table\.centre"),
        ("sensor.rear.contact", "raer", r"sensor\.rear\.contact: no such contact"),
        ("sensor.rear.quantity", "displacement", r"sensor\.rear: only contact forces"),
        ("sensor.total.quantity", "velocity", r"has no sprung mass"),
    ],
)
def test_refused(path: str, value: Any, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        make_plan(change(WHOLE, path, value))


def test_rigid_contacts_meet_no_shocks() -> None:
    rigid = {name: {"at": contact["at"], "stiffness": "rigid"} for name, contact in TWO.items()}
    for motion in (cruise(-0.4, 1.4, 0.8), shuttle(0.3, 0.7, 0.8, 0.0, 1), cruise(0.3, 0.7, 0.8, after=1.0)):
        with pytest.raises(BadInput, match="a rigid contact would meet a shock"):
            make_plan(riding(motion, rigid))
    whole = swing(0.5, 0.2, 0.7, 2)  # sets off and stops at once, as a scene of its own begins and ends
    make_plan(riding(whole, rigid))
    car = {"on": "bed", "kind": "body", "body": "table", "contacts": rigid}
    push = {"on": "bed", "kind": "force", "force": 1.0, "motion": cruise(0.0, 1.0, 0.1)}
    late = {"motion": cruise(0.3, 0.7, 0.8), "delay": 0.1}  # it is not there before
    for cars in ({"car": car | {"motion": whole}, "push": push}, {"car": car | late}):
        with pytest.raises(BadInput, match="a rigid contact would meet a shock"):
            make_plan(study(beam(), cars, body={"bed": beam(), "table": RIGID}))


@pytest.mark.parametrize(
    ("bed", "places", "most"), [(5, np.linspace(0.05, 0.35, 8), 7), (5, [0.2, 0.2], 1), (1, [0.0, 0.1, 0.2, 0.4], 3)]
)
def test_rigid_contacts_that_the_modes_cannot_meet_are_refused(bed: int, places: Any, most: int) -> None:
    """A rigid body moves in two ways, and the bed in as many as it has modes."""
    rigid = {f"c{number}": {"at": float(at), "stiffness": "rigid"} for number, at in enumerate(places)}
    with pytest.raises(BadInput, match=rf"carriage\.car\.contacts: .*at most {most} of them rigid"):
        make_plan(riding(shuttle(0.3, 0.7, 0.8, 0.1, 1), rigid, bed=beam(modes=bed)))
