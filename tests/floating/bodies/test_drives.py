"""What drives of joints exert: closed forms, power beside energy, equilibrium, and what is refused."""

from typing import Any

import numpy as np
import pytest

from engine.floating.march import march
from engine.floating.model import build
from engine.floating.results import outcome
from engine.scene.motions.point_to_point import PointToPoint
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput
from studies.protocol.study import kind_of
from tests.floating.scenes import ARM, history, steps
from tests.floating.scenes import AVERAGE_ACCELERATION as AVERAGE

GRAVITY, MASS, LENGTH, INERTIA = 9.81, 3.0, 0.8, 0.2
RIGID = {"kind": "rigid", "length": LENGTH, "mass": MASS, "inertia": INERTIA, "own_weight": True}
SWING: dict[str, Any] = {"kind": "swing", "centre": 0.4, "amplitude": 0.5, "frequency": 0.7}
TURNS: dict[str, Any] = {"kind": "revolute", "axis": [0, 1, 0]}
SLIDES: dict[str, Any] = {"kind": "prismatic", "axis": [0, 0, 2]}
TORQUE, FORCE = {"body": "arm", "quantity": "drive_torque"}, {"body": "arm", "quantity": "drive_force"}


def driven(joints: list[dict[str, Any]], sensor: dict[str, Any], body: Any = None, **tables: Any) -> Study:
    return Study(
        kind="moving-frames",
        body={"arm": body or RIGID, "beside": ARM | {"modes": 1, "own_weight": True}} | tables.pop("bodies", {}),
        frame={"arm": {"joints": joints}} | tables.pop("frames", {}),
        sensor={"drive": sensor},
        question={"duration": 2.0},
        **({"gravity": GRAVITY} | tables),
    )


def swung(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The angle and its acceleration."""
    w = 2.0 * np.pi * 0.7
    return 0.4 + 0.5 * np.sin(w * t), -0.5 * w * w * np.sin(w * t)


def test_a_drive_swings_a_rigid_arm_against_its_weight() -> None:
    """(I + m l^2) angle'' - m g l cos(angle), about y with z down: where the arm points down it is pulled on."""
    model, marched = steps(driven([TURNS | {"motion": SWING}], TORQUE), 2.0, 400)
    angle, change = swung(marched.times[0])
    half = 0.5 * LENGTH
    wanted = (INERTIA + MASS * half**2) * change + MASS * GRAVITY * half * np.cos(angle)
    assert history(model, marched, "sensors")[:, 0] == pytest.approx(wanted, abs=1e-9)


def test_a_drive_lifts_what_it_carries() -> None:
    """m (z'' - g) along z, which points down, whatever the length of the axis that is written."""
    model, marched = steps(driven([SLIDES | {"motion": SWING}], FORCE), 2.0, 400)
    _, change = swung(marched.times[0])
    assert history(model, marched, "sensors")[:, 0] == pytest.approx(MASS * (change - GRAVITY), abs=1e-9)


@pytest.mark.parametrize("carried", [{}, {"stiffness": 5e3}], ids=["given", "controlled"])
def test_the_power_of_a_drive_is_the_change_of_energy(carried: dict[str, Any]) -> None:
    """Of an arm that bends with a body at its end and a trolley on it: order 2. A controller's spring is part of
    that energy, and its other end moves as it is told."""
    arm = ARM | {"own_weight": True, "modes": 3, "second_moment": 2e-6}
    tool = {"kind": "rigid", "length": 0.3, "mass": 0.5, "inertia": 0.01, "own_weight": True}
    way = {"kind": "waypoints", "times": [0, 1], "positions": [4.0, 4.0]}
    study = driven(
        [TURNS | carried | {"motion": SWING}],
        TORQUE,
        arm,
        bodies={"tool": tool},
        frames={"tool": {"on": "arm"}},
        carriage={"trolley": {"kind": "mass", "on": "arm", "mass": 1.0, "motion": way}},
    )
    gaps = []
    for count in (8000, 16000):
        model, marched = steps(study, 2.0, count)
        w = 2.0 * np.pi * 0.7
        power = history(model, marched, "sensors")[:, 0] * 0.5 * w * np.cos(w * marched.times[0])
        work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) * (2.0 / count)])
        energy = history(model, marched, "whole", 0, 2).sum(axis=1)
        gaps.append(np.abs(energy - energy[0] - work).max() / np.ptp(energy))
    assert gaps[1] < 1e-4
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2.0, abs=0.3)


def test_a_controller_holds_the_weight_of_what_it_carries() -> None:
    still = {"kind": "waypoints", "times": [0, 1], "values": [0.3, 0.3]}
    study = driven([TURNS | {"motion": still, "stiffness": 1e9}], TORQUE, initial="equilibrium")
    model, marched = steps(study, 0.1, 10)
    wanted = -MASS * GRAVITY * 0.5 * LENGTH * np.cos(0.3)
    assert np.abs(history(model, marched, "sensors")[:, 0]) == pytest.approx(abs(wanted), rel=1e-6)


@pytest.mark.parametrize(
    ("joints", "sensor", "words"),
    [
        ([TURNS], TORQUE, r"sensor\.drive\.joint: the joint of arm whose drive this reads is not one with a motion"),
        ([TURNS | {"motion": SWING}], TORQUE | {"joint": 1}, "the joint 1 of arm"),
        ([TURNS | {"motion": SWING}] * 2, TORQUE, "received 2 such"),
        ([TURNS | {"motion": SWING}], FORCE, r"joints\.0 turns; expected drive_torque, received drive_force"),
        ([SLIDES | {"motion": SWING}], TORQUE, r"joints\.0 slides"),
    ],
)
def test_drives_that_are_not_there_are_refused(joints: Any, sensor: Any, words: str) -> None:
    study = driven(joints, sensor)
    with pytest.raises(BadInput, match=words):
        kind_of(study).parts(study)


@pytest.mark.parametrize("sensor", [TORQUE | {"at": 0.5}, {"body": "arm", "at": 0.1, "joint": 0}])
def test_sensors_of_drives_have_a_joint_and_no_place(sensor: Any) -> None:
    with pytest.raises(BadInput, match="joint"):
        driven([TURNS | {"motion": SWING}], sensor)


IN_TIME, SMOOTH = ({"kind": kind, "time": 0.3} for kind in ("timed-move", "minimum-jerk"))


@pytest.mark.parametrize("jerk", [None, 60.0])
def test_a_joint_moves_from_point_to_point_as_a_carriage_does(jerk: float | None) -> None:
    """Angles, and the torque by their accelerations, in variants with limits of their own; it stays at the end."""
    limits = {"speed": 2.0, "acceleration": 8.0} | ({} if jerk is None else {"jerk": jerk})
    move = {"kind": "point-to-point", "start": 0.2, "end": 1.1} | limits
    study = driven([TURNS | {"motion": move}], TORQUE, gravity=0.0)
    key, speeds = "frame.arm.joints.0.motion.speed", np.array([0.9, 2.0])
    found = march(build(study), VariantValues(study, {key: speeds}, 2), np.full(2, 1.5), 600, np.arange(601), AVERAGE)
    inertia = INERTIA + MASS * (0.5 * LENGTH) ** 2
    for v, speed in enumerate(speeds):
        own = PointToPoint(**(move | {"speed": speed, "dwell": 1.0}))
        t = found.times[v]
        path = own.path(np.minimum(t / own.time_scale, 1.0), "right")
        smooth = np.abs(np.subtract.outer(t, own.breaks() * own.time_scale)).min(axis=1) > 2.0 * t[1]
        torque = found.history[v, :, 0]
        assert torque[smooth] == pytest.approx(inertia * path.ddS[smooth] / own.time_scale**2, abs=1e-9)
        assert torque[-1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("gravity", [GRAVITY, 0.0])
def test_what_jumps_between_stations_is_observed_on_both_sides(gravity: float) -> None:
    """The largest torque is that of the last moment of braking, downwards; its mean square that of constant pieces."""
    down = {"kind": "point-to-point", "start": 1.1, "end": 0.2, "speed": 2.0, "acceleration": 8.0}
    model, marched = steps(driven([TURNS | {"motion": down}], TORQUE, gravity=gravity), 1.5, 37)
    found = outcome(model, marched).numbers
    half, inertia = 0.5 * LENGTH, INERTIA + MASS * (0.5 * LENGTH) ** 2
    most = 8.0 * inertia + MASS * gravity * half * np.cos(0.2)
    assert found["drive_max"][0] == pytest.approx(most, rel=1e-9)
    if gravity > 0.0:
        assert found["drive_max_time"][0] == pytest.approx(0.7, rel=1e-9)
    else:
        assert found["drive_rms"][0] == pytest.approx(8.0 * inertia * np.sqrt(2.0 * 0.25 / 1.5), rel=1e-9)


def by_quarters(part: np.ndarray) -> np.ndarray:
    """The acceleration over its largest, 8 D/T^2, where the jerk is constant in each quarter."""
    return np.interp(part, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])


def of_least_jerk(part: np.ndarray) -> np.ndarray:
    """The same of the polynomial of least jerk, over 8 D/T^2 too."""
    x = np.minimum(part, 1.0)
    return 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / 8.0


@pytest.mark.parametrize(("kind", "shape"), [("timed-move", by_quarters), ("minimum-jerk", of_least_jerk)])
def test_a_joint_moves_in_a_time(kind: str, shape: Any) -> None:
    """The torque by the acceleration, in variants of their own."""
    move = {"kind": kind, "start": 0.2, "end": -0.7, "time": 1.0}
    study = driven([TURNS | {"motion": move}], TORQUE, gravity=0.0)
    seconds = np.array([0.6, 1.2])
    values = VariantValues(study, {"frame.arm.joints.0.motion.time": seconds}, 2)
    found = march(build(study), values, np.full(2, 1.5), 600, np.arange(601), AVERAGE)
    inertia = INERTIA + MASS * (0.5 * LENGTH) ** 2
    for v, time in enumerate(seconds):
        part = found.times[v] / time
        most = 8.0 * -0.9 / time**2
        wanted = inertia * most * shape(part)
        assert found.history[v, :, 0] == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("more", [{"kind": "point-to-point", "speed": 1.0, "acceleration": 8.0}, IN_TIME, SMOOTH])
def test_a_joint_whose_ends_are_one_stands_still(more: dict[str, Any]) -> None:
    move = {"start": 0.2, "end": 0.2} | more
    model, marched = steps(driven([TURNS | {"motion": move}], TORQUE), 0.5, 50)
    wanted = MASS * GRAVITY * 0.5 * LENGTH * np.cos(0.2)
    assert np.abs(history(model, marched, "sensors")[:, 0]) == pytest.approx(wanted, rel=1e-12)
