"""Bodies that ride on contacts, at rest: against a dense twin, levers and slow marches."""

import numpy as np
import pytest

from engine.batch.plan import make_plan
from engine.march.march import march
from engine.march.step_rules import allow_any_steps
from engine.model.lane_table import padded
from engine.model.station_path import frozen
from engine.observation.signals import build_sensors
from engine.scene.variants import VariantValues
from engine.statics.static_response import static_values
from tests.engine.bodies_on_contacts import FLEXIBLE, FRAME, SHOES, THREE, UNEVEN, quiet, riding
from tests.engine.bodies_on_contacts_dense import Twin
from tests.engine.build import Table, beam, cruise, fixed, shuttle


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
    static = unit.force[:, :, 0] * twin.dead.sum() + unit.gravity * case.gravity
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
        return float(group.tables.statics.at(np.array([0, 77])).force[1, names.index("b"), 0])

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
        ).influence[:, 0]
        assert abs(right - left) > 1e-7
        assert float(tables.statics.slope_at(counts)[0, 0]) == pytest.approx((right - left) / 2e-4, rel=1e-4)
