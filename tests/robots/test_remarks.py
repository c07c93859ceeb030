"""What is allowed of robots on rails and yet often a mistake is remarked."""

from typing import Any

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
