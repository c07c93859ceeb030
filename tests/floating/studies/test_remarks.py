"""What is allowed of bodies in moving frames and yet often a mistake is remarked."""

from typing import Any

import pytest

from engine.scene.study import Study
from studies.kinds.moving_frames import KIND
from studies.moving.remarks import REMARKS
from tests.floating.studies.scenes import TOOL, TURN, driven


def turned_to(*values: Any, **more: Any) -> Study:
    """The arm, told by waypoints."""
    return driven(joints=[TURN | {"motion": {"kind": "waypoints", "times": [0, 1], "values": list(values)}}], **more)


HUNG = {"arm": {"joints": [TURN]}, "tool": {"on": "arm"}}
HINGE = {"kind": "revolute", "axis": [0, 1, 0]}
SPIN = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "spin-up", "rate": 0.1, "time": 2.0}}
SLIDE = {"kind": "prismatic", "axis": [0, 1, 0], "motion": {"kind": "waypoints", "times": [0, 1], "values": [0, 0.1]}}
STRETCHED = {"arm": {"joints": [TURN], "axial_modes": 2}}
SPEEDS = {"v": {"of": "carriage.trolley.motion.speed", "values": [4.0, 24.0]}}
LATER = TURN | {"motion": {"kind": "waypoints", "times": [0, 1.5], "values": [0, -0.1]}}
ASIDE = {"body": "arm", "at": 10.0, "quantity": "position_error", "direction": "y"}
MOMENT = {"quantity": "bending_moment"}


def with_tool(**more: Any) -> Study:
    """The arm, and a tool beside it."""
    bodies = driven().data["body"] | {"tool": TOOL}
    return driven(body=bodies, **more)


def heavy(**more: Any) -> Study:
    """The arm under gravity."""
    return driven(arm={"own_weight": True}, gravity=9.81, **more)


SAID = {
    'body.arm.youngs_modulus = 70 Pa: no beam has this, expected 1e5 to 2e12 Pa, steel 2.1e11; did you mean "70 GPa"': (
        driven(arm={"youngs_modulus": 70.0})
    ),
    "body.arm.youngs_modulus = 7e+22 Pa: no beam has this, expected 1e5 to 2e12 Pa, steel 2.1e11; is the unit": (
        driven(arm={"youngs_modulus": 7e22})
    ),
    'frame.arm.joints.0.motion.values.1 = 45 rad is 7.16 turns: is "45 deg" meant?': turned_to(0, 45),
    'frame.arm.joints.0.motion.values.1 = -30 rad is 4.77 turns: is "-30 deg" meant?': turned_to(
        0, -1, sweep={"v": {"of": "frame.arm.joints.0.motion.values.1", "values": [-1, -30]}}
    ),
    'frame.arm.turned.1 = -20 rad is 3.18 turns: is "-20 deg" meant?': driven(
        frame={"arm": {"joints": [TURN], "turned": [0, -20, 0]}}
    ),
    "frame.arm.joints.0.motion goes on until 1.5 s, and the march ends at 1 s": driven(joints=[LATER]),
    "frame.arm.joints.0.motion goes on until 2 s, and the march ends at 1 s": driven(joints=[SPIN]),
    "carriage.trolley.motion goes on until 4 s, and the march ends at 1 s": driven({"speed": 2.0}),
    "trolley stops within no time at the end of its way, from up to 24 m/s, which strikes its track along": driven(
        {"end": 8.0, "speed": 4.0}, frame=STRETCHED, sweep=SPEEDS
    ),
    "no body has a joint, so that all frames stand still": driven(joints=()),
    "nothing moves tool, which stands on the ground without a joint, and nothing rides or hangs on it": with_tool(),
    "sensor low reads 0: its body has no displacement as it does not bend": with_tool(
        frame=HUNG, sensor={"low": {"body": "tool", "at": 0.5}}
    ),
    "frame.arm.joints.0 turns arm across the plane in which it bends: a lateral_second_moment of frame.arm": driven(
        joints=[TURN | {"axis": [0, 0, 1]}]
    ),
    "frame.arm.joints.1 pushes arm across the plane in which it bends": driven(joints=[TURN, SLIDE]),
    "sensor side reads 0: nothing that carries it moves or bends along y over the ground: a lateral_second_moment of": (
        driven(sensor={"side": ASIDE})
    ),
    'arm starts undeformed, so that weight sets it swinging at time 0; initial = "equilibrium"': heavy(),
    "arm is clamped where frame.arm.joints.0 turns freely: no moment acts there, and clamped shapes need many modes": (
        driven(joints=[HINGE])
    ),
    "sensor low reads 0: its body has no bending moment there, as at a support, a free end or by symmetry": driven(
        sensor={"low": {"body": "arm", "at": 10.0, "quantity": "bending_moment"}}
    ),
}


@pytest.mark.parametrize("words", SAID)
def test_what_is_often_a_mistake_is_remarked(words: str) -> None:
    assert any(words in said for said in KIND.remarks(SAID[words]))


def test_nothing_is_remarked_of_ordinary_studies() -> None:
    """Not of angles with a unit, of turns in parts of a radian, of bodies that hang, nor of what is read at places that
    move."""
    read = {"mid": {"body": "arm", "at": 5.0}, "at": {"under": "trolley"}, "foot": {"body": "arm", "at": 0.0, **MOMENT}}
    slow = {"frame": {"arm": {"joints": [TURN], "turned": [0, "-200 deg", 0], "stiffening": True}}}
    assert KIND.remarks(driven(sensor=read)) == ()
    assert KIND.remarks(driven(**slow)) == ()
    assert KIND.remarks(driven(sensor={"torque": {"body": "arm", "quantity": "drive_torque"}})) == ()
    assert KIND.remarks(with_tool(frame=HUNG)) == ()
    assert KIND.remarks(driven(sensor={"far": ASIDE | {"direction": "z"}})) == ()
    bends = {"joints": [TURN], "lateral_second_moment": 2e-7}
    assert KIND.remarks(driven(sensor={"side": ASIDE}, frame={"arm": bends})) == ()
    about_z = TURN | {"axis": [0, 0.1, 1]}
    assert KIND.remarks(driven(sensor={"side": ASIDE}, joints=[about_z, TURN])) == ()
    assert KIND.remarks(heavy(initial="equilibrium")) == ()
    aside = {"joints": [TURN | {"axis": [0, 0, 1]}], "turned": ["90 deg", 0, 0]}
    (said,) = KIND.remarks(heavy(frame={"arm": aside}))  # its weight does not set it swinging, nor does its joint
    assert said.startswith("frame.arm.joints.0 turns arm across the plane in which it bends")
    assert KIND.remarks(heavy(frame={"arm": {"joints": [TURN], "turned": [0, "90 deg", 0]}})) == ()  # upright
    pinned = driven(arm={"supports": "pinned-free"}, joints=[HINGE])
    assert KIND.remarks(pinned) == KIND.remarks(driven(joints=[HINGE | {"stiffness": 1e4}])) == ()
    assert KIND.remarks(driven({"end": 8.0, "speed": 7.0}, frame=STRETCHED)) == ()  # when the run has ended
    assert KIND.remarks(driven({"end": 8.0, "speed": 12.0})) == ()  # nothing gives way along the track
    assert len(REMARKS) == 12
