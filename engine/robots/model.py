"""From a study's robots and rails to the arrays that the march knows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.bodies.frame.frame import Frame
from engine.kernels.layout import LANES
from engine.kernels.robots.layout import (
    CENTRE,
    ELEMENTS,
    INERTIA,
    JOINT_AXIS,
    JOINT_PLACE,
    JOINT_TURN,
    LINK,
    MASS,
    MODES,
    POWERS,
    SLIDES,
    System,
)
from engine.robots.plans import plans_of
from engine.robots.rails import Rail, rail
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.scene.robots import Arm, Solid
    from engine.scene.study import Study

SAME_PLACE = 1e-9  # m


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A scene of robots: its arrays, its rails by name, and when each robot has done what it is told (R,), s."""

    study: Study
    system: System
    rails: dict[str, Rail]
    done: Array

    @property
    def robots(self) -> tuple[str, ...]:
        """Names."""
        return tuple(self.study.robot)

    @property
    def modes(self) -> int:
        """Of all rails."""
        return int(self.system.tracks[:, MODES].sum())

    @property
    def first_omega(self) -> float:
        """Lowest natural frequency of a rail, rad/s."""
        return min(float(one.omega[0]) for one in self.rails.values())


def build(study: Study) -> RobotModel:
    """The model of a study without sweep. Raises BadInput."""
    if not study.robot:
        raise study.source.fault("robot", "there is no robot", expected="a table [robot.NAME]")
    used = dict.fromkeys(name for robot in study.robot.values() for name in robot.rails)
    rails = {name: _rail(study, name) for name in used}
    arms = [study.arm[robot.arm] for robot in study.robot.values()]
    robots = list(study.robot.values())
    plans, stands = plans_of(arms, robots), _stands(study, rails)
    coordinate, joints = _joints(arms, sum(one.omega.size for one in rails.values()))
    values = VariantValues(study, {}, 1)
    springs = [
        np.stack([one.omega**2, values.damping_rates(name, one.omega)[:, 0]], axis=1) for name, one in rails.items()
    ]
    J = coordinate.shape[1]
    system = System(
        np.array([(len(a.drives), len(r.moves), r.feedforward == "plan") for a, r in zip(arms, robots, strict=True)]),
        np.stack([chain_of(arm, J) for arm in arms]),
        np.concatenate([[arm.tool for arm in arms], stands.base], axis=1),
        study.gravity,
        coordinate,
        np.concatenate([*springs, joints]),
        stands.body,
        stands.share,
        *_tracks(list(rails.values()), study.solver.static_correction),
        plans.moves,
        plans.stays,
    )
    _check_ways(study, system)
    return RobotModel(study, system, rails, plans.done)


def _rail(study: Study, name: str) -> Rail:
    body = study.body[name]
    if not isinstance(body, Frame) or body.plane is not None:
        raise study.source.fault(f"body.{name}.kind", "robots stand on frames in space", expected='kind = "frame"')
    try:
        return rail(body)
    except BadInput as error:
        raise study.source.fault(
            f"body.{name}.{error.where}", error.what, expected=error.expected, received=error.received
        ) from None


def _joints(arms: list[Arm], first: int) -> tuple[Counts, Array]:
    """Coordinates (R, J) of joints, counted from ``first``, with their stiffnesses and damping (N, 2)."""
    found = np.full((len(arms), max(len(arm.drives) for arm in arms)), -1)
    soft = [(r, j, drive) for r, arm in enumerate(arms) for j, drive in enumerate(arm.drives) if not drive.is_rigid]
    for number, (r, j, _) in enumerate(soft):
        found[r, j] = first + number
    springs = [(float(drive.stiffness or 0.0), drive.damping) for _, _, drive in soft]
    return found, np.array(springs).reshape(len(soft), 2)


def chain_of(arm: Arm, most: int) -> Array:
    """(J, LINK): an arm, the carriage as link 0."""
    from scipy.spatial.transform import Rotation

    found = np.zeros((most, LINK))
    found[0, SLIDES] = 1.0
    solids: list[Solid] = [arm, *arm.links]
    for j, solid in enumerate(solids):
        found[j, MASS] = solid.mass
        found[j, CENTRE : CENTRE + 3], found[j, INERTIA : INERTIA + 3] = solid.centre, solid.inertia
    for j, link in enumerate(arm.links, start=1):
        axis = np.array(link.axis)
        found[j, SLIDES] = link.slides
        found[j, JOINT_AXIS : JOINT_AXIS + 3] = axis / np.linalg.norm(axis)
        found[j, JOINT_PLACE : JOINT_PLACE + 3] = link.place
        found[j, JOINT_TURN : JOINT_TURN + 9] = Rotation.from_rotvec(link.turned).as_matrix().reshape(9)
    return found


def _tracks(rails: list[Rail], corrected: bool) -> tuple[Counts, Array, Array, Array]:
    """tracks, ends, shapes and missed of `layout.System`."""
    most, modes = max(one.ends.size for one in rails), np.array([one.omega.size for one in rails])
    tracks = np.stack([np.cumsum(modes) - modes, modes, [one.ends.size - 1 for one in rails]], axis=1)
    ends = np.full((len(rails), most), np.inf)
    shapes = np.zeros((len(rails), most - 1, modes.max(), POWERS, LANES))
    missed = np.zeros((len(rails), 6 * most * corrected, 6 * most * corrected))
    for b, one in enumerate(rails):
        size = one.ends.size
        ends[b, :size] = one.ends
        shapes[b, : size - 1, : one.omega.size, :, :6] = np.moveaxis(one.shapes, 3, 1)
        if corrected:
            missed[b, : 6 * size, : 6 * size] = one.missed
    return tracks, ends, shapes, missed


class _Stands(NamedTuple):
    """base (R, 3), and body and share of `layout.System`."""

    base: Array
    body: Counts
    share: Array


def _stands(study: Study, rails: dict[str, Rail]) -> _Stands:
    R, names = len(study.robot), list(rails)
    found = _Stands(np.zeros((R, 3)), np.full((R, 2), -1), np.zeros((R, 2, 7, 6)))
    for r, (name, robot) in enumerate(study.robot.items()):
        ridden = [rails[own] for own in robot.rails]
        found.base[r] = np.mean([one.start for one in ridden], axis=0) + robot.offset
        found.base[r, 0] = ridden[0].start[0] + robot.offset[0]
        arms = [np.array([robot.offset[0], *(found.base[r] - one.start)[1:]]) for one in ridden]
        if len(arms) == 2 and abs(arms[0][1] - arms[1][1]) < SAME_PLACE:
            raise study.source.fault(f"robot.{name}.rails", "these rails lie above each other", expected="a gauge in y")
        for g, one in enumerate(ridden):
            found.body[r, g] = names.index(robot.rails[g])
            found.share[r, g, 6, 0] = ridden[0].start[0] - one.start[0]
        found.share[r, : len(arms), :6] = shares(arms)
    return found


def shares(arms: list[Array]) -> Array:
    """(G, 6, 6) motion of a base point by that of the axes of its rails, which it is an arm (3,) m away from.

    On one rail a robot goes with it as one. On two a rigid bridge stands on points above (or below) their axes: it goes
    across, along and down by their mean where it stands, rolls and yaws by their difference over the gauge, and pitches
    by the mean of their slopes; rails may twist under it.
    """
    if len(arms) == 1:
        return _carried(arms[0])[None]
    found = np.zeros((2, 6, 6))
    gauge = arms[1][1] - arms[0][1]  # the base is y of its arm away from a rail: positive where the rail is at lower y
    for g, sign in ((0, 1.0), (1, -1.0)):
        lever = np.array([arms[g][0], 0.0, arms[g][2]])
        point = _carried(lever)
        part = 0.5 + sign * (arms[0][1] + arms[1][1]) / (2.0 * gauge)
        found[g, :3] = part * point[:3]
        found[g, 3] = sign * point[2] / gauge  # roll: z = r_x y
        found[g, 5] = -sign * point[0] / gauge  # yaw: x = -r_z y
        found[g, 4] = 0.5 * point[4]
    return found


def _carried(arm: Array) -> Array:
    """(6, 6) motion of a point that is an arm away from another one of the same rigid body."""
    x, y, z = arm
    found = np.eye(6)
    found[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return found


def _check_ways(study: Study, system: System) -> None:
    """Refuse plans that leave a rail."""
    for r, (name, robot) in enumerate(study.robot.items()):
        places = system.stays[r, : len(robot.moves) + 1, 0]
        for g, rail_name in enumerate(robot.rails):
            body = system.body[r, g]
            length, own = float(system.ends[body, system.tracks[body, ELEMENTS]]), places + system.share[r, g, 6, 0]
            off = np.flatnonzero((own < 0.0) | (own > length))
            if off.size:
                raise study.source.fault(
                    f"robot.{name}.{'start' if off[0] == 0 else f'moves.{off[0] - 1}.to'}",
                    "this place is off a rail of the robot",
                    expected=f"0 to {length:.10g} m along {rail_name}",
                    received=f"{own[off[0]]:.10g}",
                )
