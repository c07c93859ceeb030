"""What is allowed of robots on rails and yet often a mistake is remarked."""

from typing import Any

import pytest

from engine.scene.study import Study
from engine.scene.sweep import expand
from results_schema.errors import BadInput
from studies.kinds.portal import KIND
from tests.robots.scenes import ARM, scene


def hung(stiffness: float, **robot: Any) -> tuple[str, ...]:
    """What is remarked of an arm whose last link is held by so many N m/rad, with another load."""
    first, last = ARM["links"]
    links = [first, last | {"stiffness": stiffness, "damping": 0.0}]
    own = scene()
    robots = dict(own.data["robot"])
    robots["hanging"] = robots["hanging"] | robot
    return tuple(KIND.remarks(scene(arm={**own.data["arm"], "swinger": ARM | {"links": links}}, robot=robots)))


def test_what_hangs_as_on_a_rope_and_is_told_the_plan_is_remarked() -> None:
    """60 kg half a metre below their hinge turn back with 294 N m; a load at the tool, 0.224 m away, adds to that."""
    (said,) = hung(1.0)
    assert said.startswith("link 1 of swinger is held by 1 N m/rad, and hangs with up to 294 N m: with robot.hanging.")
    assert 'is "gravity" meant?' in said
    assert hung(40.0) == hung(1.0, feedforward="gravity") == ()
    (loaded,) = hung(40.0, payload=100.0)
    assert "514 N m" in loaded


def test_an_ordinary_study_of_robots_is_not_remarked_and_odd_numbers_are() -> None:
    assert tuple(KIND.remarks(scene())) == ()
    (said,) = KIND.remarks(scene().with_values({"body.left.section.box.density": 7.85}))
    assert said.startswith("body.left.section.box.density = 7.85 kg/m3: no beam has this")


def test_robots_that_do_nothing_or_start_in_one_place_are_remarked() -> None:
    robots = dict(scene().data["robot"])
    still = scene(robot={**robots, "hanging": robots["hanging"] | {"moves": []}})
    (said,) = KIND.remarks(still)
    assert said.startswith("hanging has no moves and stands where it starts")
    beside = scene(robot={**robots, "hanging": robots["hanging"] | {"start": [3.0, 0.0, 0.0]}})
    (said,) = KIND.remarks(beside)
    assert said == "portal and hanging start at one place of their rails, 3 m, and nothing keeps robots apart"


def limited(limits: Any, **robot: Any) -> Study:
    """The scene with limits of the last joint of the arm that hangs, which is told to stand at 0, 0.7 and 0 rad."""
    own = scene()
    first, last = ARM["links"]
    arms = {**own.data["arm"], "swinger": ARM | {"links": [first, last | {"limits": limits}]}}
    robots = dict(own.data["robot"])
    robots["hanging"] = robots["hanging"] | robot
    return scene(arm=arms, robot=robots)


def test_joints_stay_within_their_limits() -> None:
    assert limited([-0.1, 0.7]).arm["swinger"].links[1].limits == (-0.1, 0.7)
    assert limited(["-45 deg", "45 deg"]).arm["swinger"].links[1].limits == pytest.approx(
        (-0.785398, 0.785398), rel=1e-5
    )
    said = r"robot\.hanging\.moves\.0\.to\.2: a joint beyond its limits; expected what lies between arm\.swinger\."
    with pytest.raises(BadInput, match=said):
        limited([-0.1, 0.6])
    with pytest.raises(BadInput, match=r"robot\.hanging\.start\.2: a joint beyond its limits"):
        limited([0.1, 0.8])
    with pytest.raises(BadInput, match="the lower one first"):
        limited([0.8, 0.1])
    swept = {"turn": {"of": "robot.hanging.moves.0.to.2", "values": [0.5, 0.9]}}
    given = limited([-0.1, 0.7]).with_values({"sweep": swept})
    with pytest.raises(BadInput, match=r"a joint beyond its limits.*0\.9"):
        expand(given)
