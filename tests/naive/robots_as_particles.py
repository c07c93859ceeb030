"""Robots on rails as clouds of particles over the ground, in long doubles: positions alone are written down, velocities
and accelerations are differences of them. Another formulation than the chain that is followed from its base."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from engine.robots.model import RobotModel
from engine.scene.robots import Arm, Robot

Long = np.ndarray
STEP = np.longdouble(2e-3)
SECOND = np.array([1 / 90, -3 / 20, 3 / 2, -49 / 18, 3 / 2, -3 / 20, 1 / 90], dtype=np.longdouble)
FIRST = np.array([-1 / 60, 3 / 20, -3 / 4, 0, 3 / 4, -3 / 20, 1 / 60], dtype=np.longdouble)


def turn(vector: Long) -> Long:
    """exp of a rotation vector (Rodrigues)."""
    angle = np.sqrt(vector @ vector)
    if angle == 0:
        return np.eye(3, dtype=np.longdouble)
    x, y, z = vector / angle
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=np.longdouble)
    return np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * (across @ across)


def cloud(mass: float, centre: Sequence[float], inertia: Sequence[float]) -> tuple[Long, Long]:
    """Six particles with the mass, centre and principal inertia of a body, at equal distances on its axes."""
    total = sum(inertia) / 2.0
    reach = [np.sqrt(np.longdouble(max(3.0 * (total - own) / mass, 0.0))) for own in inertia]
    places = [np.array(centre) + sign * reach[k] * np.eye(3)[k] for k in range(3) for sign in (-1, 1)]
    return np.full(6, mass / 6.0, dtype=np.longdouble), np.array(places, dtype=np.longdouble)


def particles(arm: Arm, payload: float, place: Long, axes: Long, joints: Long) -> tuple[Long, Long, Long]:
    """Masses, places and the tool of an arm whose base is at a place with axes (columns); joints beyond the rail."""
    masses, places = cloud(arm.mass, arm.centre, arm.inertia)
    found = [(masses, place + places @ axes.T)]
    for link, value in zip(arm.links, joints, strict=True):
        place, axes = place + axes @ np.array(link.place, dtype=np.longdouble), axes @ turn(np.array(link.turned))
        axis = np.array(link.axis, dtype=np.longdouble) / np.sqrt(np.longdouble(np.dot(link.axis, link.axis)))
        if link.kind == "prismatic":
            place = place + axes @ axis * value
        else:
            axes = axes @ turn(axis * value)
        if link.mass:
            masses, places = cloud(link.mass, link.centre, link.inertia)
            found.append((masses, place + places @ axes.T))
    tool = place + axes @ np.array(arm.tool)
    masses, places = zip(*found, (np.array([payload], dtype=np.longdouble), tool[None]), strict=True)
    return np.concatenate(masses), np.concatenate(places), tool


def driven_by(arm: Arm, values: Long, rates: Long, pushes: Long, gravity: float, payload: float) -> Long:
    """What drives exert on a base that does not bend: m (a - g) . dx/dq of all particles."""

    def at(joints: Long) -> tuple[Long, Long]:
        place = np.array([joints[0], 0, 0], dtype=np.longdouble)
        return particles(arm, payload, place, np.eye(3, dtype=np.longdouble), joints[1:])[:2]

    return virtual_work(at, values, rates, pushes, gravity)


def virtual_work(
    at: Callable[[Long], tuple[Long, Long]], values: Long, rates: Long, pushes: Long, gravity: float
) -> Long:
    """m (a - g) . dx/dy of all particles, for every coordinate."""
    masses, _ = at(values)
    times = STEP * np.arange(-3, 4)
    path = np.array([at(values + t * rates + t * t / 2 * pushes)[1] for t in times])
    force = np.tensordot(SECOND, path, axes=1) / STEP**2 + np.array([0, 0, gravity])
    found = np.zeros(len(values), dtype=np.longdouble)
    for k in range(len(values)):
        unit = np.zeros(len(values), dtype=np.longdouble)
        unit[k] = 1
        moved = np.tensordot(FIRST, np.array([at(values + t * unit)[1] for t in times]), axes=1) / STEP
        found[k] = np.sum(masses[:, None] * force * moved)
    return found


def told(robot: Robot, arm: Arm, time: float) -> tuple[Long, float]:
    """(3, J) values, rates and accelerations of a plan, and what is carried, by adding up jerks."""
    start, clock, payload = np.array(robot.start, dtype=np.longdouble), 0.0, robot.payload
    for move in robot.moves:
        way = np.array(move.to, dtype=np.longdouble) - start
        clock = max(clock, move.after + robot.delay)
        if clock > time:
            break
        payload = payload if move.payload is None else move.payload
        limits = [
            min(getattr(d, key) * scale / abs(float(w)) for d, w in zip(arm.drives, way, strict=True) if w)
            for key, scale in (
                ("speed", robot.speed_scale),
                ("acceleration", robot.acceleration_scale),
                ("jerk", robot.acceleration_scale),
            )
        ]
        parts, state = pieces(*limits), np.zeros(3, dtype=np.longdouble)
        for length, jerk in parts:
            t = np.longdouble(min(length, max(time - clock, 0.0)))
            state = np.array(
                [
                    state[0] + state[1] * t + state[2] * t**2 / 2 + jerk * t**3 / 6,
                    state[1] + state[2] * t + jerk * t**2 / 2,
                    state[2] + jerk * t,
                ]
            )
            clock += length
            if clock > time:
                return np.array([start + way * state[0], way * state[1], way * state[2]]), payload
        start, clock = np.array(move.to, dtype=np.longdouble), clock + move.hold
    return np.array([start, 0 * start, 0 * start]), payload * robot.payload_scale


def pieces(speed: float, acceleration: float, jerk: float) -> list[tuple[float, float]]:
    """Lengths and jerks of a move of unit length, found by looking for the highest speed that its length allows."""

    def ramp(top: float) -> tuple[float, float]:
        tj = min(acceleration / jerk, np.sqrt(top / jerk))
        return tj, top / (jerk * tj) - tj

    low, high = 0.0, speed
    for _ in range(200):
        middle = 0.5 * (low + high)
        tj, ta = ramp(middle)
        low, high = (middle, high) if middle * (2 * tj + ta) <= 1.0 else (low, middle)
    tj, ta = ramp(low)
    steady = (1.0 - low * (2 * tj + ta)) / low
    up = [(tj, jerk), (ta, 0.0), (tj, -jerk)]
    return [*up, (steady, 0.0), *((length, -value) for length, value in up)]


class Scene:
    """A whole scene of robots on rails at one time: modes of rails, then all joints of all robots."""

    def __init__(self, model: RobotModel, time: float) -> None:
        self.model, self.study = model, model.study
        self.splines = [CubicSpline(rail.ends, rail.moved, axis=0) for rail in model.rails.values()]
        self.counts = [rail.omega.size for rail in model.rails.values()]
        self.arms = [self.study.arm[robot.arm] for robot in self.study.robot.values()]
        pairs = zip(self.study.robot.values(), self.arms, strict=True)
        self.plans, self.payloads = zip(*(told(robot, arm, time) for robot, arm in pairs), strict=True)

    def section(self, name: str, q: Long, place: np.longdouble) -> Long:
        """Six motions of a track's axis; by the polynomial of its element, in long doubles."""
        b = list(self.model.rails).index(name)
        spline, first = self.splines[b], sum(self.counts[:b])
        e = int(np.clip(np.searchsorted(spline.x, float(place), side="right") - 1, 0, len(spline.x) - 2))
        x = place - np.longdouble(spline.x[e])
        rows = sum(spline.c[3 - k, e].astype(np.longdouble) * x**k for k in range(4))
        return rows @ q[first : first + self.counts[b]]

    def at(self, values: Long) -> tuple[Long, Long]:
        """All particles."""
        found = [self.robot(r, values) for r in range(len(self.arms))]
        return np.concatenate([one[0] for one in found]), np.concatenate([one[1] for one in found])

    def robot(self, r: int, values: Long) -> tuple[Long, Long, Long]:
        """The particles of a robot, and its tool. A bridge on two rails is the plane through points above them."""
        robot, arm = list(self.study.robot.values())[r], self.arms[r]
        first = sum(self.counts) + sum(len(own.drives) for own in self.arms[:r])
        joints, q = values[first : first + len(arm.drives)], values[: sum(self.counts)]
        starts = [self.model.rails[name].start for name in robot.rails]
        base = np.mean(starts, axis=0) + np.array(robot.offset)
        base[0] = starts[0][0] + robot.offset[0]
        moved = []
        for name, start in zip(robot.rails, starts, strict=True):
            motion = self.section(name, q, joints[0] + starts[0][0] - start[0])
            lever = np.array([robot.offset[0], 0.0 if len(starts) == 2 else base[1] - start[1], base[2] - start[2]])
            moved.append((motion[:3] + np.cross(motion[3:], lever), motion[3:], start[1] - base[1]))
        if len(moved) == 1:
            shift, angles = moved[0][0], moved[0][1]
        else:
            (one, turn_one, y_one), (other, turn_other, y_other) = moved
            part = y_other / (y_other - y_one)
            shift = part * one + (1 - part) * other
            roll, yaw = (one[2] - other[2]) / (y_one - y_other), -(one[0] - other[0]) / (y_one - y_other)
            angles = np.array([roll, (turn_one[1] + turn_other[1]) / 2, yaw])
        place = base + np.array([joints[0], 0, 0]) + shift
        return particles(arm, self.payloads[r], place, turn(angles), joints[1:])

    def coordinates(self, state: np.ndarray) -> Long:
        """(3, all) values, rates and accelerations of modes and joints, from a record's coordinates (N, 3)."""
        modes, coordinate = sum(self.counts), self.model.system.coordinate
        found = [state[:modes].T.astype(np.longdouble)]
        for r, arm in enumerate(self.arms):
            own = np.array(self.plans[r], dtype=np.longdouble)
            for j in range(len(arm.drives)):
                if coordinate[r, j] >= 0:
                    own[:, j] += state[coordinate[r, j]]
            found.append(own)
        return np.concatenate(found, axis=1)
