"""How the floating frame of a body moves: where it hangs, and the joints between it and what it hangs on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from engine.bodies.modal.places import Vector
from engine.scene.motions.of_joints import AnySliding, AnyTurning, TimeMotion
from engine.study_file.checks import Check, on_body
from engine.study_file.spec import KindOf, Noun, Several, Spec, SpecOfKind, Three, kinds
from engine.study_file.units import (
    Angle,
    AngularRate,
    Damping,
    Inertia,
    Length,
    Pressure,
    RotationalDamping,
    RotationalStiffness,
    SecondMoment,
    Speed,
    Stiffness,
    fault,
)
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.bodies.modal.description import Body

GROUND = "ground"
NOTHING = "> 0; 0 stands for nothing where a table [frame.NAME] moves or holds it"
MOST_JOINTS = 6

RotationVector = Three[Angle]
Spin = Three[AngularRate]
Velocity = Three[Speed]
Place = Three[Length]
Inertias = Three[Annotated[Inertia, Field(gt=0)]]


class Joint(SpecOfKind):
    """Base of all joints. freedoms: how many coordinates it has; turns: whether it turns what it holds; slides:
    whether it moves that as a whole."""

    freedoms: ClassVar[int] = 1
    turns: ClassVar[bool] = True
    slides: ClassVar[bool] = False
    floats: ClassVar[bool] = False

    @property
    def is_driven(self) -> bool:
        """Whether its motion is given, whatever force that takes."""
        return False

    @property
    def is_told(self) -> bool:
        """Whether a motion says where it is, or what a controller steers towards."""
        return False

    @property
    def is_held(self) -> bool:
        """Whether a motion or a spring holds it."""
        return False

    @property
    def told_start(self) -> str:
        """The key that tells where it starts or how fast, "" if none does."""
        return ""

    @property
    def turned_about(self) -> Vector | None:
        """The axis about which a motion turns what it holds, if there is one."""
        return None

    @property
    def turns_freely(self) -> bool:
        """Whether what it holds turns by itself, without a motion, a spring or a damper."""
        return self.turns

    @property
    def at_start(self) -> tuple[Array, Array]:
        """Rotation vector (3,), rad, and shift (3,), m, of what it holds at time 0, in the axes of what it hangs on."""
        return np.zeros(3), np.zeros(3)


class AxisJoint(Joint):
    """A joint about or along one axis, a vector of any length in the axes of what stands before it.

    start, rate: coordinate and its rate at time 0, where nothing drives it. stiffness, damping: of a spring and a
    damper towards 0. motion: drives the coordinate; with a stiffness it is what a controller steers towards instead,
    with that stiffness and that damping (PD).
    """

    axis: Vector
    start: float | None = None
    rate: float | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    motion: TimeMotion | None = None

    @property
    def is_told(self) -> bool:
        return self.motion is not None

    @property
    def is_driven(self) -> bool:
        return self.motion is not None and self.stiffness == 0.0 and self.damping == 0.0

    @property
    def is_held(self) -> bool:
        return self.is_driven or self.stiffness > 0.0

    @property
    def told_start(self) -> str:
        return next((key for key in ("start", "rate") if getattr(self, key) is not None), "")

    @property
    def at_start(self) -> tuple[Array, Array]:
        value = self.motion.at_start if self.motion is not None and self.is_driven else self.start or 0.0
        along = value * np.array(self.axis) / np.linalg.norm(self.axis)
        return along * self.turns, along * (not self.turns)

    @property
    def turns_freely(self) -> bool:
        return self.turns and self.motion is None and not self.stiffness and not self.damping

    @model_validator(mode="after")
    def _start_of_motion(self) -> AxisJoint:
        if self.is_driven and (self.start is not None or self.rate is not None):
            raise fault("a driven joint starts where its motion does", expected="start and rate left out")
        return self


class Revolute(AxisJoint):
    """Turns about an axis."""

    kind: Literal["revolute"]
    start: Angle | None = None
    rate: AngularRate | None = None
    stiffness: RotationalStiffness = Field(default=0.0, ge=0)
    damping: RotationalDamping = Field(default=0.0, ge=0)
    motion: AnyTurning | None = None

    @property
    def turned_about(self) -> Vector | None:
        return self.axis if self.motion is not None else None


class Prismatic(AxisJoint):
    """Slides along an axis."""

    turns: ClassVar[bool] = False
    slides: ClassVar[bool] = True
    kind: Literal["prismatic"]
    start: Length | None = None
    rate: Speed | None = None
    stiffness: Stiffness = Field(default=0.0, ge=0)
    damping: Damping = Field(default=0.0, ge=0)
    motion: AnySliding | None = None


class Spherical(Joint):
    """Turns freely. rate: in the frame of its body, at time 0."""

    freedoms: ClassVar[int] = 3
    kind: Literal["spherical"]
    rate: Spin = (0.0, 0.0, 0.0)
    damping: RotationalDamping = Field(default=0.0, ge=0)


class Free(Joint):
    """Moves freely in space. velocity: over the ground, at time 0; rate: in the frame of its body."""

    freedoms: ClassVar[int] = 6
    slides: ClassVar[bool] = True
    floats: ClassVar[bool] = True
    kind: Literal["free"]
    velocity: Velocity = (0.0, 0.0, 0.0)
    rate: Spin = (0.0, 0.0, 0.0)


JOINTS = kinds("joint", "wanderlast.joints", Joint, Revolute, Prismatic, Spherical, Free)
AnyJoint = Annotated[Joint, KindOf("joint", JOINTS)]


class Frame(Spec):
    """The floating frame of the body of that name: at the beginning of its track, x along it, z the way it bends
    under its loads (down, where nothing turns it).

    on: "ground" or the body that it hangs on. at: m along the track of that body, its end if not given. position: m
    over the ground, of a body that hangs there. turned: rotation vector (rad) of the frame before its joints. joints:
    from what it hangs on outward; none: it is fixed. inertia: of a rigid body about its centre of mass (kg m2), about
    its pitch inertia in all directions if not given. lateral_second_moment, lateral_modes: bending across the track,
    by as many modes as along its loads if not given; its supports are those of bending. axial_modes: stretching;
    torsion_modes, with shear_modulus and torsion_constant: twisting; both held where the track begins, unless both its
    ends are free. stiffening: places come nearer as the body bends, so that what pulls at them stiffens it (first
    order); left out, it is taken where it changes what is held by more than a small part of the tolerance.
    """

    on: Annotated[str, Noun('"ground" or the name of a body')] = GROUND
    at: Length | None = Field(default=None, ge=0)
    position: Place = (0.0, 0.0, 0.0)
    turned: RotationVector = (0.0, 0.0, 0.0)
    joints: Annotated[Several[AnyJoint], Field(max_length=MOST_JOINTS)] = ()
    inertia: Inertias | None = None
    lateral_second_moment: SecondMoment | None = Field(default=None, gt=0)
    lateral_modes: int | None = Field(default=None, ge=0, le=32)
    axial_modes: int = Field(default=0, ge=0, le=32)
    torsion_constant: SecondMoment | None = Field(default=None, gt=0)
    shear_modulus: Pressure | None = Field(default=None, gt=0)
    torsion_modes: int = Field(default=0, ge=0, le=32)
    stiffening: bool | None = None

    @property
    def stands(self) -> bool:
        """Whether it is fixed over the ground."""
        return self.on == GROUND and not self.joints

    def driven(self, joint: int | None) -> list[int]:
        """The numbers of its joints that have a motion, or of these the one that is asked for."""
        return [k for k, own in enumerate(self.joints) if own.is_told and joint in (None, k)]

    def left_to_move(self, joint: int | None) -> list[int]:
        """The numbers of its joints about or along one axis that no drive holds, or of these the one asked for."""
        left = [k for k, own in enumerate(self.joints) if own.freedoms == 1 and not own.is_driven]
        return [k for k in left if joint in (None, k)]

    @model_validator(mode="after")
    def _fitting_keys(self) -> Frame:
        if self.on == GROUND and self.at is not None:
            raise fault("the ground has no track", expected="position = [x, y, z], m")
        if self.on != GROUND and any(self.position):
            raise fault("a body that hangs on another one is there where `at` says", expected="at = metres")
        if self.lateral_modes and self.lateral_second_moment is None:
            raise fault("bending across the track needs its second moment", expected="lateral_second_moment")
        if self.torsion_modes and None in (self.torsion_constant, self.shear_modulus):
            raise fault("twisting needs a stiffness", expected="torsion_constant and shear_modulus")
        if self.torsion_modes and self.stiffening:
            what = "a beam with torsion modes that stiffens is not built"
            raise fault(what, expected="one of both", remedy="a body of the kind frame with one member has both")
        return self

    def checks(self, name: str) -> Iterator[Check]:
        """Conditions between its numbers and those of bodies; ``name``: of its body."""
        if self.at is not None:
            here = f"frame.{name}.at"
            yield on_body(here, (here, f"body.{self.on}.length"), "a place off the track of the body that holds it")


def inertia_checks(frames: Mapping[str, Frame], bodies: Mapping[str, Body]) -> Iterator[Check]:
    """That what moves freely has a mass, and an inertia of its own where it turns, and what has no frame both."""
    for name, body in bodies.items():
        keys = [f"body.{name}.{key}" for key in body.modal_masses]
        if name not in frames:
            for key in keys:
                yield Check(
                    key, (key,), lambda own: own > 0.0, "a body without a frame has a mass and an inertia", NOTHING
                )
            continue
        loose = [joint for joint in frames[name].joints if not joint.is_driven]
        held = "> 0, or a joint with a motion, or none"
        carried = [other for other in bodies if other in frames and name in (other, *_holders(frames, other))]
        masses = [f"body.{other}.mass" for other in carried if bodies[other].modal_masses]
        if keys and any(joint.slides for joint in loose) and len(masses) == len(carried):
            yield Check(keys[0], tuple(masses), _some, "this joint moves nothing that has a mass", held)
        if keys and any(joint.turns for joint in loose) and frames[name].inertia is None:
            what = "this joint turns freely what has no inertia"
            yield Check(keys[1], (keys[1],), lambda own: own > 0.0, what, held)


def _some(*masses: Any) -> Any:
    return sum(masses) > 0.0


def _holders(frames: Mapping[str, Frame], name: str) -> list[str]:
    """What a body hangs on, inward."""
    found: list[str] = []
    while name in frames and frames[name].on not in (GROUND, *found):
        name = frames[name].on
        found.append(name)
    return found
