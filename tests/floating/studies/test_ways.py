"""Driven carriages whose motions lead over an end of their body."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.scene.sweep import expand
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.kinds.moving_frames import KIND
from studies.protocol.study import kind_of
from studies.results.results import Results
from tests.floating.studies.scenes import driven

SPEED = "carriage.trolley.motion.speed"
SOFT = {"kind": "revolute", "axis": [0, 1, 0], "stiffness": 1e4, "damping": 10.0}


def axis(of: str, *values: float) -> dict[str, Any]:
    return {"v": {"of": of, "values": list(values)}}


@pytest.mark.parametrize(
    ("way", "more", "words"),
    [
        ({"end": 14.0, "speed": 16.0}, {}, r"over an end of arm, where.*0 to 10 m.* 1 s, received 1 to 14 m; remedy"),
        ({"start": 9.0, "end": -1.0, "speed": 16.0}, {}, "received -1 to 9 m"),
        ({"end": 14.0}, {"sweep": axis(SPEED, 10.0, 12.0)}, "over an end of arm in every variant"),
        ({"start": -1.0}, {}, r"motion\.start: .*starts on its track.*received carriage.trolley.motion.start = -1"),
        ({"speed": 2.0}, {"sweep": axis("carriage.trolley.motion.start", 1.0, 11.0)}, r"start = 11.*in a passage"),
    ],
)
def test_what_runs_off_its_body_is_refused(way: dict[str, Any], more: dict[str, Any], words: str) -> None:
    """It went on as if the body were longer, and the status was ok."""
    given = driven(way, **more)
    with pytest.raises(BadInput, match=words):
        kind_of(given).parts(given)


def test_splines_that_pass_beyond_their_waypoints_are_refused() -> None:
    way = {"kind": "waypoints", "times": [0.0, 0.5, 1.0], "positions": [1.0, 10.0, 9.0]}
    carriage = {"trolley": {"kind": "mass", "on": "arm", "mass": 0.2, "motion": way}}
    given = driven(carriage=carriage)
    with pytest.raises(BadInput, match=r"received 1 to 10\.[0-9]+ m.*may pass beyond its waypoints"):
        kind_of(given).parts(given)
    within = driven(carriage=carriage).with_values({"carriage.trolley.motion.positions.1": 8.0})
    assert kind_of(within).parts(within).remarks == ()


@pytest.mark.parametrize("joint", [None, SOFT])
def test_variants_that_run_off_end_there(joint: dict[str, Any] | None) -> None:
    """As those in which a mass slides off by itself; one that comes to the end by rounding does not. The floating frame
    and the cheaper model alike."""
    joints = {} if joint is None else {"joints": [joint]}
    given = driven({"start": 0.1, "end": 14.0}, sweep=axis(SPEED, 5.0, 9.9, 12.0), **joints)
    said = "trolley runs over an end of arm in some variants, from 0.1 to 12.1 m of 10 m"
    assert any(said in remark for remark in kind_of(given).parts(given).remarks)
    found = studies.run(given)
    assert (found["status"] == Status.SEPARATED).values.tolist() == [False, False, True]
    assert found["duration"].values == pytest.approx([1.0, 1.0, 9.9 / 12.0], abs=2e-3)
    assert found["trolley_position_max"].values == pytest.approx([5.1, 10.0, 10.0], abs=2e-2)
    gone = np.isnan(found["trolley_contact_force"]).values
    assert not gone[:2].any() and not gone[2, 0] and gone[2, -1]
    answer = " ".join(KIND.findings(Results.of(found)))
    assert "A carriage goes over an end of its track in 1 variant of 3, soonest after 0.825 s at v 12 m/s" in answer


def test_shorter_marches_keep_it_on_its_body() -> None:
    given = driven({"end": 14.0, "speed": 16.0}, question={"duration": 0.5})
    remarks = " ".join(kind_of(given).parts(given).remarks)
    assert "goes on until 0.8125 s, and the march ends at 0.5 s" in remarks and "over an end" not in remarks


def test_places_do_not_pass_beyond_a_sudden_stop() -> None:
    """By parabolas through stations before and after it the trolley came 0.4 mm further."""
    found = studies.run(driven({"end": 10.0, "speed": 11.0}))
    assert float(found["trolley_position_max"]) == pytest.approx(10.0, abs=1e-12)


def test_who_sweeps_the_motion_of_a_joint_that_has_none_is_told() -> None:
    swept = {"time": {"of": "frame.arm.joints.0.motion.times.1", "values": [1.0]}}
    loose = driven(joints=[{"kind": "revolute", "axis": [0, 1, 0]}], sweep=swept)
    with pytest.raises(BadInput, match=r"no such number.*is frame\.arm\.joints\.0\.motion missing\?"):
        expand(loose)


@pytest.mark.parametrize(("turned", "lifts"), [(0.0, True), (30.0, True), (89.5, False), (90.0, False)])
def test_a_mast_holds_its_lift_from_both_sides(turned: float, lifts: bool) -> None:
    """What its foot's acceleration tears off a lying track is only pulled back by one that stands upright."""
    shaken = {"kind": "prismatic", "axis": [0, 0, 1], "motion": {"kind": "swing", "amplitude": 0.5, "frequency": 1.5}}
    frame = {"arm": {"turned": [0, f"{turned} deg", 0], "joints": [shaken]}}
    found = studies.run(driven(frame=frame, gravity=9.81, question={"duration": 0.9}))
    assert found["trolley_contact_force_min"] < 0.0
    assert (found["status"] == Status.SEPARATED) == lifts
