"""Robots on rails: arms of rigid links with their drives, and what each robot is told to do."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict, model_validator

from engine.bodies.modal.places import Vector
from engine.study_file.checks import Check
from engine.study_file.spec import KindOf, Noun, Several, Spec, Three
from engine.study_file.units import (
    Acceleration,
    Angle,
    AngularAcceleration,
    AngularJerk,
    AngularRate,
    Damping,
    Dimensionless,
    Inertia,
    Jerk,
    Length,
    Mass,
    RotationalDamping,
    RotationalStiffness,
    Speed,
    Stiffness,
    Time,
    fault,
)

MOST_LINKS, MOST_RAILS, MOST_MOVES = 7, 2, 64

Place = Three[Length]
Principal = Three[Annotated[Inertia, Field(ge=0)]]
Values = Several[Dimensionless]


class Drive(Spec):
    """What moves a joint. speed, acceleration, jerk: its limits. limits: between which the joint itself may stand.
    stiffness, damping: of the joint with its controller, PD towards the plan; without a stiffness it follows its plan
    whatever force that takes."""

    speed: float
    acceleration: float
    jerk: float
    limits: tuple[float, float] | None = None
    stiffness: float | None = None
    damping: float = 0.0

    @property
    def is_rigid(self) -> bool:
        """Whether it has no coordinate of its own."""
        return self.stiffness is None

    @model_validator(mode="after")
    def _spring_with_damper(self) -> Drive:
        if self.is_rigid and self.damping > 0.0:
            raise fault("a joint that follows its plan rigidly has no damper", expected="a stiffness beside it")
        if self.limits is not None and self.limits[0] >= self.limits[1]:
            raise fault("the limits of a joint", expected="the lower one first, and the other above it")
        return self


class Solid(Spec):
    """mass (kg), centre (m, in its axes) and principal inertia (kg m2, about that centre along its axes)."""

    mass: Mass = Field(default=0.0, ge=0)
    centre: Place = (0.0, 0.0, 0.0)
    inertia: Principal = (0.0, 0.0, 0.0)


class Sliding(Drive):
    """Of a joint that slides: m, N."""

    speed: Speed = Field(gt=0)
    acceleration: Acceleration = Field(gt=0)
    jerk: Jerk = Field(gt=0)
    limits: Annotated[tuple[Length, Length], Strict(False)] | None = None
    stiffness: Stiffness | None = Field(default=None, gt=0)
    damping: Damping = Field(default=0.0, ge=0)


class Turning(Drive):
    """Of a joint that turns: rad, N m."""

    speed: AngularRate = Field(gt=0)
    acceleration: AngularAcceleration = Field(gt=0)
    jerk: AngularJerk = Field(gt=0)
    limits: Annotated[tuple[Angle, Angle], Strict(False)] | None = None
    stiffness: RotationalStiffness | None = Field(default=None, gt=0)
    damping: RotationalDamping = Field(default=0.0, ge=0)


class Link(Solid):
    """A rigid link and the joint that moves it, which turns about or slides along axis. place: m, of the joint in the
    axes of the link before. turned: rotation vector (rad) of the link's axes before the joint moves."""

    slides: ClassVar[bool]
    axis: Vector
    place: Place = (0.0, 0.0, 0.0)
    turned: Three[Dimensionless] = (0.0, 0.0, 0.0)


class Prismatic(Sliding, Link):
    """A link that slides."""

    slides: ClassVar[bool] = True
    kind: Literal["prismatic"]


class Revolute(Turning, Link):
    """A link that turns."""

    slides: ClassVar[bool] = False
    kind: Literal["revolute"]


AnyLink = Annotated[Revolute | Prismatic, KindOf("link", {"revolute": Revolute, "prismatic": Prismatic})]


class Arm(Solid):
    """A sort of robot: the carriage on the rails (mass, centre, inertia, from its base point) with its drive along
    them, the links on it, and the tool centre point (m, in the axes of the last link)."""

    mass: Mass = Field(gt=0)
    rail: Sliding
    links: Annotated[Several[AnyLink], Field(max_length=MOST_LINKS)] = ()
    tool: Place = (0.0, 0.0, 0.0)

    @property
    def drives(self) -> tuple[Drive, ...]:
        """Of all joints, that along the rails first."""
        return (self.rail, *self.links)


class Move(Spec):
    """A move of all joints together, at rest at both ends: straight in the joints' values, as fast as the slowest of
    them may go, jerk-limited.

    to: values, the place along the rail (m) first. after: s, it sets off no earlier. hold: s that the robot stays
    there; process: whether it works then. payload: kg at the tool from the beginning of the move on, as before if not
    given: picked up at rest, or put down.
    """

    to: Values
    after: Time = Field(default=0.0, ge=0)
    hold: Time = Field(default=0.0, ge=0)
    process: bool = False
    payload: Mass | None = Field(default=None, ge=0)


class Robot(Spec):
    """A robot on one or two parallel rails, which are tracks of frames along x.

    arm: its sort. rails: names of bodies. offset: m, of its base point from the axis of the first rail's track, or from
    the middle between two. start: values of its joints at time 0, the place along the first rail first. delay: s by
    which all its moves set off later. payload: kg at time 0. speed_scale, acceleration_scale, payload_scale: factors
    of all limits of speed, of acceleration and jerk, and of all payloads. feedforward: what the drives are told beside
    the plan: the forces of the whole plan on a rigid base, or those of gravity alone.
    """

    arm: Annotated[str, Noun("the name of a table [arm.NAME]")]
    rails: Annotated[Several[str], Field(min_length=1, max_length=MOST_RAILS)]
    offset: Place = (0.0, 0.0, 0.0)
    start: Values
    moves: Annotated[Several[Move], Field(max_length=MOST_MOVES)] = ()
    delay: Time = Field(default=0.0, ge=0)
    payload: Mass = Field(default=0.0, ge=0)
    speed_scale: Dimensionless = Field(default=1.0, gt=0)
    acceleration_scale: Dimensionless = Field(default=1.0, gt=0)
    payload_scale: Dimensionless = Field(default=1.0, ge=0)
    feedforward: Literal["plan", "gravity"] = "plan"

    @model_validator(mode="after")
    def _distinct_rails(self) -> Robot:
        if len(set(self.rails)) < len(self.rails):
            raise fault("a robot stands on two different rails", expected="names of two bodies, or one name")
        return self


def check_robots(
    arms: Mapping[str, Arm], robots: Mapping[str, Robot], bodies: Collection[str]
) -> Iterator[tuple[str, str, str]]:
    """What does not fit together: dotted key, what is wrong, what is expected."""
    for name, robot in robots.items():
        here = f"robot.{name}"
        if robot.arm not in arms:
            yield f"{here}.arm", "no such arm", f"one of {', '.join(arms)}" if arms else "a table [arm.NAME]"
            continue
        for number, rail in enumerate(robot.rails):
            if rail not in bodies:
                yield f"{here}.rails.{number}", "no such body", f"one of {', '.join(bodies)}"
        wanted = len(arms[robot.arm].drives)
        given = {"start": robot.start} | {f"moves.{number}.to": move.to for number, move in enumerate(robot.moves)}
        for key, values in given.items():
            if len(values) != wanted:
                what = f"one value for each joint: the place along the rail, and then the links of arm.{robot.arm}"
                numbers = f"{wanted} number{'s' * (wanted > 1)}, and not {len(values)}"
                yield f"{here}.{key}", what, numbers


def limit_checks(arms: Mapping[str, Arm], robots: Mapping[str, Robot]) -> Iterator[Check]:
    """That no joint starts beyond its limits, or is told to go there."""
    for name, robot in robots.items():
        for number, drive in enumerate(arms[robot.arm].drives):
            joint = f"arm.{robot.arm}.links.{number - 1}" if number else f"arm.{robot.arm}.rail"
            places = ["start", *(f"moves.{move}.to" for move in range(len(robot.moves)))] if drive.limits else []
            for place in places:
                key = f"robot.{name}.{place}.{number}"
                needs = key, f"{joint}.limits.0", f"{joint}.limits.1"
                what = "a joint beyond its limits"
                yield Check(key, needs, _between, what, f"what lies between {joint}.limits")


def _between(value: Any, low: Any, high: Any) -> Any:
    return (value >= low) & (value <= high)
