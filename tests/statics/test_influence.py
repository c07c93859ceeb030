"""Static readings over the position against closed forms, lever rules and slow marches."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.batch.plan import make_plan
from engine.march.march import march
from engine.march.step_rules import allow_any_steps
from engine.model.distinct_models import base_scene
from engine.model.lane_table import padded
from engine.model.station_path import frozen
from engine.observation.signals import build_sensors
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.statics.static_response import StaticReadings, contact_names, static_values
from results_schema.arrays import Array
from tests.engine.bodies_on_contacts import FLEXIBLE, FRAME, SHOES, THREE, TWO, UNEVEN, quiet, riding
from tests.engine.bodies_on_contacts_dense import Twin
from tests.engine.build import Table, beam, cruise, fixed, force, mass, oscillator, shuttle, study, swing, under

WAY = cruise(0.0, 1.0, 1.0)
PLACES = np.linspace(0.0, 1.0, 9)
G = 9.81


def readings(case: Study, places: Any = PLACES, **columns: Any) -> StaticReadings:
    model = base_scene(case)
    swept = {path.replace("__", "."): np.asarray(column, dtype=float) for path, column in columns.items()}
    size = max((len(column) for column in swept.values()), default=1)
    return static_values(
        model,
        build_sensors(model),
        VariantValues(model.study, swept, size),
        frozen(model, np.asarray(places, dtype=float)),
    )


def line(x: float, s: Array) -> Array:
    """Deflection of a pinned beam, L = E I = 1, at x per unit force at s."""
    low, high = np.minimum(x, s), np.maximum(x, s)
    return np.asarray(low * (1.0 - high) * (1.0 - low**2 - (1.0 - high) ** 2) / 6.0)


SENSORS = {"place": fixed(0.3), "moment": fixed(0.3, "bending_moment"), "below": under("car")}


def test_readings_are_influence_lines() -> None:
    found = readings(study(beam(modes=3), mass(0.5, WAY), sensor=SENSORS))
    weight = 0.5 * G
    expected = np.stack([line(0.3, PLACES), np.minimum(0.3 * (1 - PLACES), PLACES * 0.7), line_at_itself()], axis=1)
    assert found.influence[0] == pytest.approx(expected, rel=1e-9, abs=1e-15)
    assert found.sensors[0] == pytest.approx(weight * expected, rel=1e-9, abs=1e-15)
    assert found.contacts[0] == pytest.approx(np.full((9, 1), weight))


def line_at_itself() -> Array:
    return np.asarray(PLACES**2 * (1.0 - PLACES) ** 2 / 3.0)


def test_own_weight_and_other_carriages_are_added() -> None:
    whole = study(
        beam(modes=3, own_weight=True),
        {"car": mass(0.5, WAY), "other": force(2.0, swing(0.7, 0.1, 1.0, 1))},
        sensor={"middle": fixed(0.5), "moment": fixed(0.5, "bending_moment")},
    )
    found = readings(whole)
    own = 5.0 * G / 384.0, G / 8.0
    other = 2.0 * float(line(0.5, np.array([0.7]))[0]), 2.0 * 0.5 * 0.3
    for j, unit in enumerate((line(0.5, PLACES), 0.5 * np.minimum(PLACES, 1.0 - PLACES))):
        assert found.influence[0, :, j] == pytest.approx(unit, rel=1e-9, abs=1e-15)
        assert found.sensors[0, :, j] == pytest.approx(0.5 * G * unit + own[j] + other[j], rel=1e-9)


def test_variants_scale_with_weights_and_gravity() -> None:
    case = study(beam(modes=3, own_weight=True), oscillator(0.5, 40.0, WAY, wheel_mass=0.1), sensor=SENSORS)
    found = readings(case, carriage__car__mass=[0.5, 1.5], gravity=[9.81, 1.62])
    for variant, (own, pull) in enumerate(((0.5, 9.81), (1.5, 1.62))):
        alone = readings(case.with_values({"carriage.car.mass": own, "gravity": pull}))
        assert found.sensors[variant] == pytest.approx(alone.sensors[0], rel=1e-12)
        assert found.contacts[variant, :, 0] == pytest.approx(np.full(9, (own + 0.1) * pull))


def test_contacts_of_a_table_carry_by_levers() -> None:
    found = readings(riding(cruise(0.3, 0.7, 1.0), TWO, UNEVEN), [0.3, 0.5, 0.7])
    assert found.contacts[0] == pytest.approx(0.5 * G * np.array([[0.22, 0.08]] * 3) / 0.3)
    assert contact_names(base_scene(riding(cruise(0.3, 0.7, 1.0), TWO, UNEVEN))) == ["car.rear", "car.front"]


# ---- bodies that ride on contacts ----


@pytest.mark.parametrize("name", ["flexible", "frame", "own weight"])
def test_statics_are_what_a_slow_march_tends_to(name: str) -> None:
    cases: dict[str, Table] = {
        "flexible": {},
        "frame": {"contacts": SHOES, "table": FRAME},
        "own weight": {"bed": beam(own_weight=True, modes=4)},
    }
    case = quiet(**cases[name])
    plan = make_plan(case, check_steps=allow_any_steps)
    (group,) = plan.groups
    tables, values = group.tables, plan.values(group, padded(group.variants))
    counts = np.arange(0, 201, 20)
    found = march(tables, values, counts, 1).history[:, :, 0]
    unit, twin = tables.statics.at(counts), Twin(case)
    static = unit[:, :, 0] * twin.dead.sum() + unit[:, :, -1] * case.gravity
    for j, sensor in enumerate(tables.sensors):
        if sensor.quantity not in ("velocity", "acceleration"):
            assert np.abs(static[:, j] - found[:, j]).max() <= 2e-6 * np.abs(found[:, j]).max(), sensor.name
    places = tables.timeline.positions(0, counts.astype(np.float64))
    force = np.array([twin.static(float(s))[1] for s in places])
    names = [sensor.name for sensor in tables.sensors]
    for r, contact in enumerate(case.carriage["car"].contacts):  # type: ignore[attr-defined]
        assert np.abs(static[:, names.index(contact)] - force[:, r]).max() <= 1e-8 * np.abs(force).max()


def test_static_correction_is_felt_in_the_contacts() -> None:
    """Two kept modes with what they miss carry three contacts nearly as twenty do; without it they do not."""

    def middle(modes: int, correction: bool) -> float:
        bed, solver = beam(modes=modes), {"steps": 400, "static_correction": correction}
        (group,) = make_plan(quiet(bed=bed, solver=solver), check_steps=allow_any_steps).groups
        names = [sensor.name for sensor in group.tables.sensors]
        return float(group.tables.statics.at(np.array([0, 77]))[1, names.index("b"), 0])

    whole = middle(20, True)
    assert abs(middle(2, True) / whole - 1.0) < 1e-9 < 1e-3 < abs(middle(2, False) / whole - 1.0)


@pytest.mark.parametrize("correction", [True, False])
@pytest.mark.parametrize("heavy", [True, False])
def test_statics_where_contacts_are_off_the_bed(correction: bool, heavy: bool) -> None:
    """A table half on a bed whose end gives way: what is off it stands on level ground."""
    springs = [{"at": 0.0, "stiffness": 40.0}, {"at": 1.0, "stiffness": 60.0}]
    solver = {"steps": 200, "static_correction": correction}
    case = riding(
        cruise(-0.4, 1.4, 0.8), THREE, FLEXIBLE, beam(modes=3, supports=springs, own_weight=heavy), solver=solver
    )
    (group,) = make_plan(case).groups
    twin, model = Twin(case), group.scene
    places = np.array([-0.3, -0.06, 0.05, 0.5, 0.93, 1.1])
    found = static_values(model, build_sensors(model), VariantValues(case, {}, 1), frozen(model, places)).contacts[0]
    right = np.array([twin.static(float(place))[1] for place in places])
    assert np.abs(found - right).max() <= 1e-9 * np.abs(right).max()


def test_static_slopes_move_all_contacts() -> None:
    """By the reference's place, against static readings a little apart, whatever the fidelity."""
    way = shuttle(0.3, 0.7, 0.8, 0.1, 1)
    for fidelity in ("auto", "force"):
        case = riding(way, table=UNEVEN, sensor={"place": fixed(0.61)}, solver={"steps": 200, "fidelity": fidelity})
        (group,) = make_plan(case).groups
        tables, counts = group.tables, np.array([40])
        (place,) = tables.timeline.positions(0, counts)
        apart = frozen(group.scene, place + np.array([-1e-4, 1e-4]))
        left, right = static_values(
            group.scene, build_sensors(group.scene), VariantValues(case, {}, 1), apart
        ).influence[0, :, 0]
        assert abs(right - left) > 1e-7
        assert float(tables.statics.slope_at(counts)[0, 0, 0]) == pytest.approx((right - left) / 2e-4, rel=1e-4)


TRAIN = {"on": "bed", "kind": "force", "force": [3.0, 5.0], "spacing": [0.4]}
BRIDGE = {"supports": "pinned-pinned", "modes": 8}
READ = {"middle": fixed(0.5), "first": under("train_1")}


@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (1.0, 0.0)])
def test_trains_stand_on_their_body_until_the_last_axle_has_left(start: float, end: float) -> None:
    """They were followed until the first had, and a reaction of 544 kN under 32 axles was told as 365."""
    away = abs(start - end) + 0.4
    way = {"kind": "influence", "question": {"positions": 15, "unreduced": 15}, "sensor": READ}
    train = {"train": {"train": TRAIN | {"motion": cruise(start, end, 1.0)}}, "carriage": {}}
    found = studies.run(study(beam(**BRIDGE), {}, **way, **train))
    alone = study(beam(**BRIDGE), force(1.0, cruise(0.0, 1.0, 1.0)), kind="influence", question={"positions": 101})
    line = studies.run(alone.with_values({"sensor": {"middle": fixed(0.5)}})).middle
    first = found.position.values
    assert np.ptp(first) == pytest.approx(away)
    behind = first - np.sign(end - start) * 0.4
    here = (np.where((x > -1e-9) & (x < 1.0 + 1e-9), x, np.nan) for x in (first, behind))
    one, other = (np.interp(x, line.position, line) for x in here)
    expected = 3.0 * np.nan_to_num(one) + 5.0 * np.nan_to_num(other)
    assert found.middle.values == pytest.approx(expected, abs=1e-3 * expected.max())
    for axle, place in ((0, first), (1, behind)):
        on = (place > -1e-9) & (place < 1.0 + 1e-9)
        assert np.isfinite(found.contact_force.values[:, axle]).tolist() == on.tolist()
    assert np.isfinite(found["first"].values).tolist() == np.isfinite(found.middle_influence.values).tolist()
    assert np.isnan(found["first"].values).any()
    for name in ("first", "middle", "contact_force"):
        apart = found[f"{name}_difference"].values
        assert np.isfinite(apart).tolist() == np.isfinite(found[name].values).tolist()
        assert np.nanmax(np.abs(apart)) < 1e-3
