"""How far joints have turned or slid: closed forms, and what is refused."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.scene.study import Study
from results_schema.errors import BadInput
from studies.findings.absolute_errors import absolute_errors
from studies.protocol.study import kind_of
from studies.results.results import Results
from tests.engine.build import beam, cruise, force, steel, study

GRAVITY, MASS, LENGTH, INERTIA, STIFFNESS = 9.81, 3.0, 0.8, 0.2, 5e3
ARM = {"kind": "rigid", "length": LENGTH, "mass": MASS, "inertia": INERTIA, "own_weight": True}
SPRUNG = {"kind": "prismatic", "axis": [0, 0, 1], "stiffness": STIFFNESS}
SWINGS = {"kind": "revolute", "axis": [0, 1, 0], "start": 1.2}
DRIVEN = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "steady", "rate": 1.0}}
ANGLE, SHIFT = {"body": "arm", "quantity": "joint_angle"}, {"body": "arm", "quantity": "joint_displacement"}


def held_by(joints: list[dict[str, Any]], sensor: dict[str, Any], arm: Any = ARM, duration: float = 2.0) -> Study:
    return Study(
        kind="moving-frames",
        gravity=GRAVITY,
        body={"arm": arm},
        frame={"arm": {"joints": joints}},
        sensor={"joint": sensor} if "body" in sensor else sensor,
        question={"duration": duration},
    )


def test_what_falls_into_a_spring() -> None:
    """m g/k (1 - cos wt), and no error told too small."""
    found = studies.run(held_by([SPRUNG], SHIFT))
    sag, omega = MASS * GRAVITY / STIFFNESS, np.sqrt(STIFFNESS / MASS)
    assert found["joint"].attrs["units"] == found["joint_max"].attrs["units"] == "m"
    apart = abs(float(found["joint_max"]) - 2.0 * sag)
    assert apart <= float(absolute_errors(Results.of(found), "joint_max")) < 2e-3 * sag
    wanted = sag * (1.0 - np.cos(omega * found["elapsed"].values))
    assert np.abs(found["joint"].values - wanted).max() < 2e-3 * sag


def test_a_pendulum_swings_as_far_to_the_other_side() -> None:
    """About y, from 1.2 rad above the level: it hangs at -pi/2."""
    found = studies.run(held_by([SWINGS], ANGLE))
    assert found["joint_max"].attrs["units"] == "rad"
    assert float(found["joint_max"]) == pytest.approx(1.2, abs=1e-9)
    assert float(found["joint_min"]) == pytest.approx(-np.pi - 1.2, rel=1e-3)


def test_one_of_several_joints_by_its_number() -> None:
    along = SPRUNG | {"axis": [1, 0, 0], "stiffness": 1e7}
    angle = studies.run(held_by([SWINGS, along], ANGLE | {"joint": 0}))
    shift = studies.run(held_by([SWINGS, along], SHIFT | {"joint": 1}))
    assert float(angle["joint_min"]) == pytest.approx(-np.pi - 1.2, rel=1e-2)
    assert 0.0 < float(shift["joint_max"]) < 1e-4


def test_a_pinned_beam_turns_at_its_pin_by_its_mean_axis_less_its_slope() -> None:
    """As the same beam does whose clamped shapes do not turn there, as far as their modes go."""
    section = {"area": 3.7e-4, "second_moment": 2.1e-9, "youngs_modulus": 70e9, "density": 2700.0}
    sensors, found = {"joint": ANGLE, "slope": {"body": "arm", "at": 0.0, "quantity": "rotation"}}, {}
    for end in ("pinned", "clamped"):
        body = steel(2.0, **section, supports=f"{end}-free", modes=7, damping_ratio=0.02)
        found[end] = studies.run(held_by([SWINGS | {"start": -0.5}], sensors, body, 1.0))
    axis, slope = (found["pinned"][name].values for name in ("joint", "slope"))
    clamped = found["clamped"]["joint"].values
    assert np.abs(found["clamped"]["slope"].values).max() < 1e-15
    assert np.abs(axis - slope - clamped).max() < 0.3 * np.abs(axis - clamped).max()
    assert np.abs(slope).max() > 5e-3


@pytest.mark.parametrize(
    ("joints", "sensor", "words"),
    [
        ([DRIVEN], ANGLE, r"sensor\.joint\.joint: the joint of arm whose angle this reads is not one.*none is"),
        ([SPRUNG, SPRUNG], SHIFT, "received 2 such"),
        ([SPRUNG], SHIFT | {"joint": 1}, "the joint 1 of arm"),
        ([SPRUNG], ANGLE, r"joints\.0 slides; expected joint_displacement"),
        ([SWINGS], SHIFT, r"joints\.0 turns; expected joint_angle"),
    ],
)
def test_joints_that_are_not_there_are_refused(joints: Any, sensor: Any, words: str) -> None:
    given = held_by(joints, sensor)
    with pytest.raises(BadInput, match=words):
        kind_of(given).parts(given)


@pytest.mark.parametrize("sensor", [ANGLE | {"at": 0.5}, {"body": "arm", "at": 0.1, "joint": 0}])
def test_a_joint_has_no_place(sensor: Any) -> None:
    with pytest.raises(BadInput, match="joint"):
        held_by([SWINGS], sensor)


def test_where_bodies_stand_there_are_no_joints() -> None:
    standing = study(beam(), force(1.0, cruise(0.0, 1.0, 1.0)), sensor={"joint": ANGLE | {"body": "bed"}})
    with pytest.raises(BadInput, match="no joints carry an arm"):
        studies.run(standing)
