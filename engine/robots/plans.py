"""When robots do what: the moves of every robot in time."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.kernels.robots.layout import MOVE, START
from engine.scene.motions.profile import Profile, profile
from engine.scene.robots import Drive
from results_schema.arrays import Array

if TYPE_CHECKING:
    from collections.abc import Sequence

    from engine.scene.robots import Arm, Robot


ON_WAY = 9  # places of a move at which a reach is looked at


def slowest(drives: Sequence[Drive], robot: Robot, way: Array) -> Profile:
    """A move of all joints together over their ways (J,), as fast as all of them may go."""
    faster = robot.acceleration_scale
    with np.errstate(divide="ignore"):
        speed = np.min(np.array([drive.speed for drive in drives]) / np.abs(way)) * robot.speed_scale
        acceleration = np.min(np.array([drive.acceleration for drive in drives]) / np.abs(way)) * faster
        jerk = np.min(np.array([drive.jerk for drive in drives]) / np.abs(way)) * faster
    return profile(1.0, float(speed), float(acceleration), float(jerk))


def reach(arm: Arm, robot: Robot) -> float:
    """m, how far a tool comes from the base point of its robot at most, at rest and on its planned ways."""
    from scipy.spatial.transform import Rotation

    stays = np.array([robot.start, *(move.to for move in robot.moves)])
    on_way = np.linspace(stays[:-1], stays[1:], ON_WAY).reshape(-1, stays.shape[1])
    most = 0.0
    for joints in np.concatenate([stays, on_way]):
        turn, place = Rotation.identity(), np.zeros(3)
        for link, value in zip(arm.links, joints[1:], strict=True):
            place, turn = place + turn.apply(link.place), turn * Rotation.from_rotvec(link.turned)
            along = value * np.array(link.axis) / np.linalg.norm(link.axis)
            if link.slides:
                place = place + turn.apply(along)
            else:
                turn = turn * Rotation.from_rotvec(along)
        most = max(most, float(np.linalg.norm(place + turn.apply(arm.tool))))
    return most


class Plans(NamedTuple):
    """What robots are told, as `layout.System` has it, and when each has done it (R,), s."""

    moves: Array
    stays: Array
    done: Array


def plans_of(arms: Sequence[Arm], robots: Sequence[Robot]) -> Plans:
    """The plans of robots, with joints as many as the longest arm has."""
    R, M = len(robots), max((len(robot.moves) for robot in robots), default=0)
    J = max(len(arm.drives) for arm in arms)
    found = Plans(np.zeros((R, M, MOVE)), np.zeros((R, M + 1, J + 2)), np.zeros(R))
    found.moves[:, :, START], found.stays[:, :, -1] = np.inf, -np.inf
    for r, (arm, robot) in enumerate(zip(arms, robots, strict=True)):
        own, stays = len(arm.drives), found.stays[r]
        time, values, payload = 0.0, np.array(robot.start), robot.payload
        stays[0, :own], stays[0, J] = values, payload * robot.payload_scale
        for m, move in enumerate(robot.moves):
            way, values = np.array(move.to) - values, np.array(move.to)
            payload = payload if move.payload is None else move.payload
            time = max(time, move.after + robot.delay)
            found.moves[r, m, START] = time
            stays[m + 1, :own], stays[m + 1, J] = values, payload * robot.payload_scale
            if way.any():
                told = slowest(arm.drives, robot, way)
                found.moves[r, m, START + 1 :] = told
                time += told.duration
            time += move.hold
            stays[m + 1, -1] = time if move.process else -np.inf
        found.done[r] = time
    return found
