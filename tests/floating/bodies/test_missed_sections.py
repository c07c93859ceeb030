"""Section forces of few modes, with what the others follow at once, beside those of many."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
import xarray as xr

import studies
from engine.floating import tables
from engine.floating.attachments import Grip
from engine.floating.model import FloatingModel, build
from engine.floating.sections import missed_sections
from engine.kernels.floating.layout import MISSED, MISSED_SPUN, MISSED_TURNING, MISSED_UNIFORM
from engine.scene.study import Study
from tests.floating.bodies.test_frames_of_beams import arm
from tests.floating.bodies.test_stiffened_frames import study
from tests.floating.scenes import ARM, AVERAGE_ACCELERATION, history, steps

STIFF = {"youngs_modulus": 7e12}
#: About an axis that is across the arm and along it, so that its places are also pulled across.
SWING = {"kind": "swing", "centre": 0.0, "amplitude": 1.0, "frequency": 1.0}
TURNED = {"joints": [{"kind": "revolute", "axis": [0.6, 0.48, 0.64], "motion": SWING}]}
TABLE = {"kind": "mass", "on": "portal", "mass": 3.0, "bilateral": True}
CRUISE = {"kind": "cruise", "start": 3.0, "end": 9.0, "speed": 4.0}
ROPE = {"stiffness": 2e3, "length": 8.0}
LOADED = {
    "carriage": {"table": TABLE | {"motion": CRUISE}},
    "load": {
        "hook": {"on": "portal", "at": 6.0, "force": [0.0, 300.0, 2e3]},
        "wind": {"on": "portal", "between": [3.0, 9.0], "force_per_metre": [0.0, 0.0, 400.0]},
    },
    "spring": {
        "rope": {"ends": [{"on": "portal", "at": 8.0}, {"position": [0, 0, -6]}], "stiffness": 2e3, "length": 8.0}
    },
}
SENSORS = {
    "root": {"body": "portal", "at": 0.0, "quantity": "bending_moment"},
    "inner": {"body": "portal", "at": 2.2, "quantity": "bending_moment"},
    "shear": {"body": "portal", "at": 2.2, "quantity": "shear_force"},
}


def beam(modes: int) -> dict[str, object]:
    return ARM | STIFF | {"modes": modes, "own_weight": True, "damping_ratio": 0.02}


def frame(modes: int) -> dict[str, object]:
    return arm(modes) | {"damping_ratio": 0.02, "section": {"all": arm(modes)["section"]["all"] | STIFF}}


def loaded(body: dict[str, object], **more: object) -> Study:
    return study(body, TURNED, sensor=SENSORS, initial="equilibrium", **(LOADED | more))


def forces(given: Study) -> np.ndarray:
    """(stations, 3) of the sensors in 1.5 s, after a second."""
    model, marched = steps(given, 1.5, 3000, 60, AVERAGE_ACCELERATION)
    return history(model, marched, "sensors", 0, 3)[40:]


@pytest.fixture(scope="module")
def of_many() -> np.ndarray:
    """Those of 12 modes, beyond which there is 1 % at most."""
    return forces(loaded(beam(12)))


def off(found: np.ndarray, of_many: np.ndarray) -> np.ndarray:
    """(3,) largest differences, over the largest values."""
    return np.abs(found - of_many).max(axis=0) / np.abs(of_many).max(axis=0)


@pytest.mark.parametrize("body", [beam, frame])
def test_two_modes_have_the_section_forces_of_many(
    body: Callable[[int], dict[str, object]], of_many: np.ndarray
) -> None:
    """By modes alone they are off by 17 %, and twelve by 1 %."""
    assert off(forces(loaded(body(12))), of_many).max() < 3e-4
    assert off(forces(loaded(body(2))), of_many).max() < 3e-3
    bare = [off(forces(loaded(body(modes), solver={"static_correction": False})), of_many) for modes in (2, 12)]
    assert bare[0].min() > 0.05 and 2e-3 < bare[1].max() < 3e-2


def without(column: int) -> tuple[np.ndarray, ...]:
    return np.where(np.arange(MISSED) == column, 0.0, 1.0), np.ones(1), np.ones(1)


def without_grips(*grips: int) -> tuple[np.ndarray, ...]:
    return np.ones(1), np.ones(1), np.where(np.isin(np.arange(4), grips), 0.0, 1.0)


@pytest.mark.parametrize(
    "parts",
    [
        pytest.param(without(MISSED_UNIFORM), id="acceleration of the frame"),
        pytest.param(without(MISSED_TURNING), id="its angular acceleration"),
        pytest.param(without(MISSED_SPUN), id="its rotation"),
        pytest.param((np.ones(1), np.zeros(1), np.ones(1)), id="carriages"),
        pytest.param(without_grips(0), id="a load at a place"),
        pytest.param(without_grips(1), id="a load along a part"),
        pytest.param(without_grips(2, 3), id="a spring"),
    ],
)
def test_every_part_counts(parts: tuple[np.ndarray, ...], of_many: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    def some(model: FloatingModel, grips: Sequence[Grip]) -> tuple[np.ndarray, ...]:
        own: tuple[np.ndarray, ...] = missed_sections(model, grips)
        return own[0], *(one * part for one, part in zip(own[1:], parts, strict=True))

    monkeypatch.setattr(tables, "missed_sections", some)
    assert off(forces(loaded(beam(2))), of_many)[0] > 6e-3


def test_free_bodies_take_no_section_force_from_their_own_weight() -> None:
    """As they fall, nothing bends them; at rest their modes miss nothing of what a motion as a rigid body takes."""
    body = beam(4) | {"supports": "free-free"}
    model = build(study(body, {"joints": [{"kind": "free"}]}, sensor=SENSORS))
    numbers = model.system.missed[:, MISSED_UNIFORM : MISSED_SPUN + 1]
    assert np.abs(numbers).max() < 1e-9 * body_moment(model)


def body_moment(model: FloatingModel) -> float:
    """kg m, by which its weight would bend it if it were held."""
    return model.bodies["portal"].mass * model.bodies["portal"].length


def test_torques_along_a_part_are_followed_too() -> None:
    """Of 62 modes a moment was 1.5e-3 off and told to be 9e-5: sums of slopes converge slowly."""
    drag = {"load": {"drag": {"on": "portal", "between": [1.0, 7.0], "torque_per_metre": [0.0, 2e3, 0.0]}}}
    many = forces(loaded(beam(12), **drag))
    for body in (beam, frame):
        assert off(forces(loaded(body(4), **drag)), many).max() < 2e-4
    assert off(forces(loaded(beam(4), **drag, solver={"static_correction": False})), many).min() > 0.01


def hung_out(motion: dict[str, object], at: float) -> xr.Dataset:
    """The largest and smallest shear force at a place of a resting arm on which a mass of 3 kg moves slowly."""
    sensor = {"shear": {"body": "portal", "at": at, "quantity": "shear_force"}}
    carriage = {"table": TABLE | {"motion": motion}}
    given = study(beam(4), {}, carriage=carriage, sensor=sensor, initial="equilibrium", question={"duration": 20.0})
    return studies.run(given)


def test_a_shear_force_jumps_as_a_mass_passes() -> None:
    """To what hangs beyond; a parabola across the jump exceeded it by an eighth, told as exact."""
    found = hung_out({"kind": "timed-move", "start": 3.0, "end": 9.0, "time": 20.0}, 5.3)
    beyond = 9.81 * 3000.0 * 4e-4 * (10.0 - 5.3)
    assert float(found.shear_min) == pytest.approx(beyond, rel=2e-3)
    assert float(found.shear_max) == pytest.approx(beyond + 9.81 * 3.0, rel=2e-3)


def test_where_a_mass_stands_the_shear_force_is_that_just_beyond() -> None:
    found = hung_out({"kind": "standing", "at": 8.0}, 8.0)
    assert float(found.shear_max) == pytest.approx(9.81 * 3000.0 * 4e-4 * 2.0, rel=1e-6)
