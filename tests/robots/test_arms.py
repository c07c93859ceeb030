"""Chains of links and jerk-limited plans against published numbers and particles."""

import numpy as np
import pytest

from engine.robots.model import build
from engine.robots.plans import plans_of
from engine.scene.motions.profile import profile
from engine.scene.robots import Arm
from tests.naive.robots_as_particles import driven_by, pieces, told
from tests.robots.inverse import drive_forces
from tests.robots.scenes import ARM, GANTRY, marched, scene

# PUMA 560 (Corke and Armstrong-Helouvry 1994) by standard Denavit-Hartenberg: a, d, twist; mass, centre, inertia
PUMA = (
    (0.0, 0.0, 90.0, 0.0, (0, 0, 0), (0, 0.35, 0)),
    (0.4318, 0.0, 0.0, 17.4, (-0.3638, 0.006, 0.2275), (0.13, 0.524, 0.539)),
    (0.0203, 0.15005, -90.0, 4.8, (-0.0203, -0.0141, 0.070), (0.066, 0.086, 0.0125)),
    (0.0, 0.4318, 90.0, 0.82, (0, 0.019, 0), (1.8e-3, 1.3e-3, 1.8e-3)),
    (0.0, 0.0, -90.0, 0.34, (0, 0, 0), (3e-4, 4e-4, 3e-4)),
    (0.0, 0.0, 0.0, 0.09, (0, 0, 0.032), (1.5e-4, 1.5e-4, 4e-5)),
)
LIMITS = {"speed": 1.0, "acceleration": 1.0, "jerk": 1.0}


def puma() -> Arm:
    """The links in axes at their joints, before length, offset and twist."""
    links, place, turned = [], np.zeros(3), 0.0
    for a, d, twist, mass, centre, inertia in PUMA:
        angle = np.radians(twist)
        turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
        own = np.diag(turn @ np.diag(inertia) @ turn.T)
        link = {"place": place, "turned": (turned, 0.0, 0.0), "centre": turn @ centre + (a, 0, d), "inertia": own}
        plain = {key: tuple(float(x) for x in value) for key, value in link.items()}
        links.append({"kind": "revolute", "axis": (0, 0, 1), "mass": mass, **plain, **LIMITS})
        place, turned = np.array([a, 0, d]), float(angle)
    return Arm(mass=1.0, rail=LIMITS, links=links)


def test_gravity_load_of_the_puma_is_that_of_its_publication() -> None:
    joints = np.zeros((1, 7, 3))
    joints[0, 1:, 0] = 0, np.pi / 4, -np.pi, 0, np.pi / 4, 0
    found = drive_forces(puma(), joints, 9.81)[0, 1:]
    np.testing.assert_allclose(found, [0, 31.63988, 6.035138, 0, 0.0282528, 0], atol=5e-6)


SLIDE = {"kind": "prismatic", "axis": [1, 0, 1], "place": [0.2, 0, 0], "mass": 20, "inertia": [1, 1, 1], **LIMITS}
TELESCOPE = ARM | {"links": [*ARM["links"], SLIDE]}  # slides on what turns


@pytest.mark.parametrize("table", [GANTRY, ARM, TELESCOPE], ids=["gantry", "arm", "telescope"])
def test_inverse_dynamics_of_random_states_is_that_of_particles(table: dict[str, object]) -> None:
    arm, random = Arm(**table), np.random.default_rng(17)
    joints = random.uniform(-1.5, 1.5, (20, len(arm.drives), 3))
    found = drive_forces(arm, joints, 9.81, payload=7.0)
    for state, own in zip(joints, found, strict=True):
        twin = driven_by(arm, *state.T.astype(np.longdouble), 9.81, 7.0)
        np.testing.assert_allclose(own, twin.astype(float), atol=1e-10 * np.abs(twin).max())


@pytest.mark.parametrize(
    "limits",
    [(1.0, 10.0, 100.0), (10.0, 1.0, 100.0), (0.3, 1.0, 2.0), (10.0, 10.0, 2.0), (10.0, 1.9, 2.0), (1.0, 2.0, 3.9)],
)
def test_profiles_are_the_fastest_within_their_limits(limits: tuple[float, float, float]) -> None:
    """Against a search for the highest speed, and no limit is broken."""
    found, parts = profile(1.0, *limits), pieces(*limits)
    assert found.duration == pytest.approx(sum(length for length, _ in parts), rel=1e-12)
    assert found.jerk_time * found.jerk <= limits[1] * (1 + 1e-12)
    assert found.jerk * found.jerk_time * (found.up_time - found.jerk_time) <= limits[0] * (1 + 1e-12)


def test_plans_are_what_jerks_add_up_to() -> None:
    """Seen where rails hardly bend and joints follow their plans."""
    study = scene({"stiffer": 1e6})
    model, record = marched(study, 0.05)
    stations = np.flatnonzero(np.diff(record.coordinates[:, 0, 3], prepend=-1.0) > 0.0)[::5]
    for station in stations:
        time = record.coordinates[station, 0, 3]
        for r, (name, robot) in enumerate(study.robot.items()):
            values, _ = told(robot, study.arm[robot.arm], time + 1e-9)
            base = model.system.robots[r, 3]
            assert record.robots[station, r, 0] - base == pytest.approx(
                _tool_x(study.arm[robot.arm], values[0]), abs=1e-7
            ), name


def _tool_x(arm: Arm, values: np.ndarray) -> float:
    from tests.naive.robots_as_particles import particles

    place = np.array([values[0], 0, 0], dtype=np.longdouble)
    return float(particles(arm, 1.0, place, np.eye(3, dtype=np.longdouble), values[1:])[2][0])


def test_scales_and_delays_shift_plans() -> None:
    """Four times the acceleration and jerk at twice the speed: a short move takes as long as with jerk alone."""
    study = scene()
    arms, robots = [study.arm[robot.arm] for robot in study.robot.values()], list(study.robot.values())
    base = plans_of(arms, robots)
    faster = study.with_values({"robot.portal.acceleration_scale": 4.0, "robot.portal.speed_scale": 2.0})
    moves = plans_of(arms, list(faster.robot.values())).moves[0, 0]
    way = np.abs(np.array(robots[0].moves[0].to) - robots[0].start)
    told = profile(1.0, *(float(np.min(limit / way)) for limit in (3.0, 8.0, 40.0)))
    np.testing.assert_allclose(moves[1:], told)
    assert build(study.with_values({"robot.hanging.delay": 1.4})).done[1] == pytest.approx(base.done[1] + 1.0)
