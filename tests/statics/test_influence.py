"""Static readings over the position against closed forms, lever rules and slow marches."""

from typing import Any

import numpy as np
import pytest

from engine.model.distinct_models import base_scene
from engine.model.station_path import frozen
from engine.observation.signals import build_sensors
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.statics.static_response import StaticReadings, contact_names, static_values
from results_schema.arrays import Array
from tests.engine.bodies_on_contacts import TWO, UNEVEN, riding
from tests.engine.build import beam, cruise, fixed, force, mass, oscillator, study, swing, under

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
    assert found.influence == pytest.approx(expected, rel=1e-9, abs=1e-15)
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
        assert found.influence[:, j] == pytest.approx(unit, rel=1e-9, abs=1e-15)
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
