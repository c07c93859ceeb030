"""Where a pendulum on a soft joint rests, hanging and standing, on a rail that sags to one side."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import studies
from engine.robots.march import rest, stretches
from engine.robots.model import RobotModel, build
from engine.scene.study import Study
from results_schema.status import Status
from studies.commands.preview import preview
from studies.protocol.study import kind_of
from studies.results.results import Results
from studies.robots.findings import answer
from tests.robots.scenes import drive, marched, rail, scene

MASS, LEVER, GRAVITY = 40.0, 0.8, 9.81
WEIGHT = MASS * GRAVITY * LEVER  # N m, of the joint for a radian
UPRIGHT, HANGING, MIDDLE = 0.0, np.pi, 4  # the last: an end of elements of the rail


def sagging() -> dict[str, Any]:
    """A rail that goes down at its west end."""
    soft, hard = {"stiffness": [4e6, 4e6, 1e4]}, {"stiffness": [4e6, 4e6, 2e8]}
    turning = {"rotational": [2e7, 10.0, 5e6]}
    ends = {"west": {"node": "west", **soft, **turning}, "east": {"node": "east", **hard, **turning}}
    return rail(0.0) | {"spring": ends}


def pendulum(stiffness: float, told: float, **more: Any) -> Study:
    """A mass on a rod at a joint about y, told to stand at an angle from upright; its drive is told its weight there
    on a rail that does not sag."""
    joint = {"kind": "revolute", "axis": [0, 1, 0], "mass": MASS, "centre": [0, 0, LEVER], **drive(stiffness, 50.0)}
    arm = {"mass": 100.0, "inertia": [5, 5, 5], "rail": drive(), "links": [joint]}
    tables = {
        "body": {"left": sagging()},
        "arm": {"pendulum": arm},
        "robot": {"one": {"arm": "pendulum", "rails": ["left"], "start": [6.0, told]}},
        "solver": {"tolerance": 1e-6},
    }
    return scene(**(tables | more))


def tilt(model: RobotModel, state: np.ndarray) -> float:
    """How far the rail is turned about y under the robot."""
    return float(model.rails["left"].moved[MIDDLE, 4] @ state[: model.modes])


def root(stiffness: float, told: float, turned: float) -> float:
    """The least y of k y = m g l (sin(told + turned + y) - sin told), as far as one joint alone."""

    def off(y: float) -> float:
        return stiffness * y - WEIGHT * (np.sin(told + turned + y) - np.sin(told))

    reach = np.linspace(0.0, np.pi, 4001) * np.sign(-off(0.0))
    first = int(np.flatnonzero(np.sign([off(y) for y in reach]) != np.sign(off(0.0)))[0])
    return float(brentq(off, *sorted(reach[[first - 1, first]]), xtol=1e-14))


@pytest.mark.parametrize("told", [HANGING, HANGING - 0.7, 2.0])
@pytest.mark.parametrize("part", [1e-3, 0.2, 0.999, 1.001, 1.2, 30.0])
def test_what_hangs_rests_at_any_stiffness(told: float, part: float) -> None:
    model = build(pendulum(part * WEIGHT, told))
    record, status = rest(model, stretches(model, 0.05, 0.05, 1))
    state = record.coordinates[0, :, 0]
    turned = tilt(model, state)
    assert status == Status.OK and abs(turned) > 5e-3
    assert state[-1] == pytest.approx(root(part * WEIGHT, told, turned), rel=1e-6)


@pytest.mark.parametrize("told", [UPRIGHT, 0.3])
@pytest.mark.parametrize("part", [1.05, 1.1, 2.0, 30.0])
def test_what_stands_rests_where_its_joint_is_stiffer_than_its_weight(told: float, part: float) -> None:
    """Corrections by the springs alone would take hundreds of evaluations where these are stiffer by a twentieth."""
    model = build(pendulum(part * WEIGHT, told))
    record, status = rest(model, stretches(model, 0.05, 0.05, 1))
    state = record.coordinates[0, :, 0]
    found = root(part * WEIGHT, told, tilt(model, state))
    assert status == Status.OK and state[-1] == pytest.approx(found, rel=1e-6)
    assert part > 1.05 or abs(found) > 0.05


@pytest.mark.parametrize("told", [UPRIGHT, 0.3])
@pytest.mark.parametrize("part", [0.01, 0.5, 0.95])
def test_what_stands_on_a_softer_joint_falls_over(told: float, part: float) -> None:
    """Upright on a rail that does not sag it would balance, as its drive is told its weight."""
    stiff = {"body": {"left": rail(0.0, stiffer=1e6)}}
    for more in ({}, stiff):
        study = pendulum(part * WEIGHT, told, **more)
        model = build(study)
        assert rest(model, stretches(model, 0.05, 0.05, 1))[1] == Status.FALLS_OVER
        assert np.isnan(marched(study, 0.01, 0.05)[1].coordinates).all()


def test_a_march_of_a_soft_joint_begins_at_rest() -> None:
    """As nothing moves, nothing does until the end."""
    _, record = marched(pendulum(0.2 * WEIGHT, HANGING), 0.01, 0.5)
    places = record.coordinates[:, :, 0]
    np.testing.assert_allclose(places, np.broadcast_to(places[0], places.shape), atol=1e-8 * np.abs(places).max())


def test_a_study_marks_the_variants_that_fall_over() -> None:
    """Also those that do later on, when a move has raised them."""
    moves = [{"to": [6.0, 0.5], "hold": 0.2}]
    robot = {"one": {"arm": "pendulum", "rails": ["left"], "start": [6.0, 2.5], "moves": moves}}
    swept = {"stiffness": {"of": "arm.pendulum.links.0.stiffness", "values": [0.5 * WEIGHT, 8.0 * WEIGHT]}}
    study = pendulum(1.0, 0.0, robot=robot, sweep=swept, solver={"tolerance": 0.05})
    found = studies.run(study)
    assert found["status"].values.tolist() == [Status.FALLS_OVER, Status.OK]
    assert np.isnan(found["error_largest"][0]).all() and np.isfinite(found["error_largest"][1]).all()
    answers = " ".join(answer(Results.of(found)))
    assert (
        "In 1 of 2 variants a joint cannot hold up what stands on it and falls over, as at stiffness 157 N m" in answers
    )
    (remark,) = preview(kind_of(study).parts(study), 1).remarks
    assert remark.startswith("1 of 2 variants that were tried fall over")
