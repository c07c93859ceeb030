"""Coupled natural frequencies against closed forms, the transcendental equation and dense matrices of many modes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from engine.model.distinct_models import base_scene
from engine.model.station_path import frozen
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import coupled_frequencies, coupled_modes
from results_schema.arrays import Array
from tests.bodies.frames import PINNED, straight
from tests.engine.bodies_on_contacts import FLEXIBLE, FRAME, RIGID, SHOES, THREE, TWO, UNEVEN, riding
from tests.engine.build import Table, beam, cruise, force, mass, oscillator, steel, study, swing

WAY = cruise(0.0, 1.0, 1.0)
PLAIN: Table = {"static_correction": False}


def frequencies(case: Study, places: Any, count: int, **columns: Any) -> Array:
    """(V, S, count) rad/s; columns: swept numbers by dotted key with _ for dots."""
    model = base_scene(case)
    swept = {path.replace("__", "."): np.asarray(column, dtype=float) for path, column in columns.items()}
    size = max((len(column) for column in swept.values()), default=1)
    values = VariantValues(model.study, swept, size)
    return coupled_frequencies(model, values, frozen(model, np.asarray(places, dtype=float)), count)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 5.0])
def test_a_mass_at_midspan_obeys_the_transcendental_equation(ratio: float) -> None:
    """Symmetric modes of a pinned beam with a mass in its middle: mu x (tan x - tanh x) = 2, omega = (2x/L)^2."""
    found = frequencies(study(beam(modes=12), mass(ratio, WAY)), [0.5], 3)[0, 0]

    def gap(x: float) -> float:
        return ratio * x * (np.tan(x) - np.tanh(x)) - 2.0

    first = brentq(gap, 1e-3, 0.5 * np.pi - 1e-9)
    third = brentq(gap, 0.5 * np.pi + 1e-9, 1.5 * np.pi - 1e-9)
    assert found[0] == pytest.approx((2.0 * first) ** 2, rel=1e-7)
    assert found[1] == pytest.approx((2.0 * np.pi) ** 2, rel=1e-12)  # the mass stands in its node
    assert found[2] == pytest.approx((2.0 * third) ** 2, rel=1e-4)


def test_what_the_modes_miss_is_felt_by_masses() -> None:
    """Four modes with static correction do what four alone do not."""
    exact = frequencies(study(beam(modes=64), mass(1.0, WAY)), [0.3], 1)[0, 0, 0]
    corrected, plain = (
        frequencies(study(beam(modes=4), mass(1.0, WAY), solver={"static_correction": on}), [0.3], 1)[0, 0, 0]
        for on in (True, False)
    )
    assert abs(corrected / exact - 1.0) < 1e-6 < 3e-4 < plain / exact - 1.0


@pytest.mark.parametrize("wheel", [0.0, 0.3])
def test_a_sprung_mass_on_one_mode_has_two_degrees_of_freedom(wheel: float) -> None:
    car = oscillator(0.5, 40.0, WAY, wheel_mass=wheel)
    found = frequencies(study(beam(modes=1), car, solver=PLAIN), [0.5, 0.2], 2)[0]
    for place, pair in zip((0.5, 0.2), found, strict=True):
        shape = np.sqrt(2.0) * np.sin(np.pi * place)
        stiffness = [[np.pi**4 + 40.0 * shape**2, -40.0 * shape], [-40.0 * shape, 40.0]]
        expected = np.sqrt(eigh(stiffness, np.diag([1.0 + wheel * shape**2, 0.5]), eigvals_only=True))
        assert pair == pytest.approx(expected, rel=1e-9)


def test_a_rigid_table_on_a_rigid_bed_stands_on_its_springs() -> None:
    """Heave and pitch of a rigid body on two springs."""
    bed = beam(modes=4, youngs_modulus=1e9)
    found = frequencies(riding(cruise(0.3, 0.7, 1.0), TWO, UNEVEN, bed), [0.5], 2)[0, 0]
    arms, springs = np.array([0.05, 0.35]) - 0.13, np.array([400.0, 500.0])
    rows = np.stack([np.ones(2), arms])
    expected = np.sqrt(eigh((rows * springs) @ rows.T, np.diag([0.5, 0.01]), eigvals_only=True))
    assert found == pytest.approx(expected, rel=1e-5)


def test_a_mass_that_stands_on_a_rigid_table_is_part_of_it() -> None:
    """For tables of two masses, as lanes of one scene."""
    way = cruise(0.3, 0.7, 1.0)
    head = {"on": "table", "kind": "mass", "mass": 0.2, "motion": {"kind": "standing", "at": 0.3}}
    car = {"on": "bed", "kind": "body", "body": "table", "contacts": TWO, "motion": way}
    masses = [0.5, 1.3]
    found = frequencies(riding(way, carriage={"car": car, "head": head}), [0.4, 0.5], 5, body__table__mass=masses)
    for lane, own in enumerate(masses):
        centre = (0.2 * own + 0.3 * 0.2) / (own + 0.2)
        inertia = RIGID["inertia"] + own * (centre - 0.2) ** 2 + 0.2 * (centre - 0.3) ** 2
        both = RIGID | {"mass": own + 0.2, "inertia": inertia, "centre": centre}
        assert found[lane] == pytest.approx(frequencies(riding(way, TWO, both), [0.4, 0.5], 5)[0], rel=1e-9)


def test_on_one_rigid_joint_a_table_is_a_mass() -> None:
    """Its free pitch, which nothing resists, is left out."""
    one = {"only": {"at": 0.2, "stiffness": "rigid"}}
    joined = frequencies(riding(cruise(0.3, 0.7, 1.0), one, RIGID), [0.3, 0.42], 4)
    single = frequencies(study(beam(damping_ratio=0.02, modes=5), mass(0.5, WAY)), [0.3, 0.42], 4)
    assert joined == pytest.approx(single, rel=1e-9)


SCENES: dict[str, Callable[[], Study]] = {
    "rigid on two": lambda: riding(cruise(0.3, 0.7, 0.8), TWO, RIGID, solver=PLAIN),
    "flexible on three": lambda: riding(cruise(0.3, 0.7, 0.8), THREE, FLEXIBLE, solver=PLAIN),
    "frame on points": lambda: riding(cruise(0.3, 0.7, 0.8), SHOES, FRAME, solver=PLAIN),
}


@pytest.mark.parametrize("name", SCENES)
def test_contacts_are_springs_between_modes(name: str) -> None:
    """K = diag(omega^2) + sum k (phi, -v)(phi, -v)^T, written down plainly."""
    case = SCENES[name]()
    bed, table = (part.modal for part in base_scene(case).bodies)
    carriage: Any = case.carriage["car"]
    for place in (0.4, 0.55):
        stiffness = np.diag(np.concatenate([bed.omega, table.omega]) ** 2)
        for contact in carriage.contacts.values():
            ahead = contact.offset if contact.at is None else contact.at - 0.5 * table.length
            assert table.points is not None or contact.point is None
            held = table.shape([contact.at])[0] if contact.at else table.points.row(f"point.{contact.point}")
            row = np.concatenate([bed.shape([place + ahead])[0], -held])
            stiffness += contact.stiffness * np.outer(row, row)
        square = np.linalg.eigvalsh(stiffness)
        expected = np.sqrt(square[square > 1e-6])[:6]
        assert frequencies(case, [place], 6)[0, 0] == pytest.approx(expected, rel=1e-9)


def test_residual_flexibility_stands_for_the_modes_left_out() -> None:
    whole = frequencies(riding(cruise(0.3, 0.7, 0.8), THREE, FLEXIBLE | {"modes": 40}, beam(modes=64)), [0.4], 4)
    table = FLEXIBLE | {"modes": 4}
    few = frequencies(riding(cruise(0.3, 0.7, 0.8), THREE, table, beam(modes=5)), [0.4], 4)
    plain = frequencies(riding(cruise(0.3, 0.7, 0.8), THREE, table, beam(modes=5), solver=PLAIN), [0.4], 4)
    assert np.abs(few / whole - 1.0).max() < 5e-5 < 1e-3 < np.abs(plain / whole - 1.0).max()


def test_other_carriages_stand_where_they_start_and_forces_have_no_inertia() -> None:
    second = study(beam(modes=8), {"car": mass(0.3, WAY), "other": mass(0.6, swing(0.4, 0.1, 1.0, 1))})
    plain = frequencies(second, [0.2], 2)[0, 0]
    swapped = study(beam(modes=8), {"other": mass(0.6, WAY), "car": mass(0.3, swing(0.2, 0.1, 1.0, 1))})
    assert plain == pytest.approx(frequencies(swapped, [0.4], 2)[0, 0], rel=1e-9)
    assert plain[0] < frequencies(study(beam(modes=8), mass(0.3, WAY)), [0.2], 1)[0, 0, 0]
    forced = study(beam(modes=8), {"car": mass(0.3, WAY), "push": force(5.0, swing(0.4, 0.1, 1.0, 1))})
    alone = frequencies(study(beam(modes=8), mass(0.3, WAY)), [0.2], 2)
    assert frequencies(forced, [0.2], 2) == pytest.approx(alone, rel=1e-12)


def test_off_the_body_a_mass_does_nothing_and_missing_modes_are_missing() -> None:
    found = frequencies(study(beam(modes=3), mass(0.3, cruise(-1.0, 2.0, 1.0))), [-0.5, 1.5, 0.5], 4)[0]
    assert found[0, :3] == pytest.approx((np.arange(1, 4) * np.pi) ** 2, rel=1e-12)
    assert np.isnan(found[:2, 3]).all() and np.isfinite(found[2, 3])


def test_shapes_have_unit_modal_mass_and_solve_the_equations() -> None:
    case = riding(cruise(0.3, 0.7, 1.0), THREE, FLEXIBLE, solver=PLAIN)
    model = base_scene(case)
    found = coupled_modes(model, VariantValues(model.study, {}, 1), frozen(model, np.array([0.4])), 6)
    shapes, omega = found.shapes[0, 0], found.omega[0, 0]
    assert shapes.T @ shapes == pytest.approx(np.eye(6), abs=1e-9)
    assert omega == pytest.approx(frequencies(case, [0.4], 6)[0, 0], rel=1e-12)
    energy = np.sum((model.omega[:, None] * shapes) ** 2, axis=0)
    assert (energy < omega**2).all()  # the rest is in the contacts


def test_more_masses_that_push_across_than_modes() -> None:
    """Residual modes of more pushes than there are modes had no modal mass: `check` of a train of 12 axles ended in a
    bug. A few of as much mass altogether are as heavy."""

    def low(count: int) -> Array:
        car = mass(120.0 / count, cruise(7.5, 15.0, 1.0), on="rail", inertia_across=True)
        axles = {f"m{number}": car for number in range(count)}
        rail = {"rail": straight(PINNED, modes=2)}
        return frequencies(study(steel(15.0), axles, body=rail, sensor={}), [7.5], 2)[0, 0]

    assert low(5) == pytest.approx(low(1), rel=1e-6)
