"""Loads on bodies in frames that move, and springs between two of their places."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from engine.scene.frames import GROUND, Place
from engine.scene.motions.of_joints import AnyCourse
from engine.study_file.checks import Check, on_body
from engine.study_file.spec import Noun, Spec, Three
from engine.study_file.units import Damping, Force, ForcePerMetre, Length, Stiffness, Torque, TorquePerMetre, fault

Forces = Three[Force]
Torques = Three[Torque]
ForcesPerMetre = Three[ForcePerMetre]
TorquesPerMetre = Three[TorquePerMetre]
Part = Annotated[tuple[Length, Length], Strict(False)]


class Load(Spec):
    """A force and a torque on a body at a place of its track, or evenly along a part of it.

    at: m along the track, its end if not given; force N, torque N m. between: from there to there, m; force_per_metre,
    torque_per_metre. axes: in which they are resolved, those of the "ground", or of the "body", with whose frame they
    turn. course: a factor that changes in time, 1 if not given.
    """

    on: str
    at: Length | None = Field(default=None, ge=0)
    between: Part | None = None
    force: Forces | None = None
    torque: Torques | None = None
    force_per_metre: ForcesPerMetre | None = None
    torque_per_metre: TorquesPerMetre | None = None
    axes: Literal["ground", "body"] = "ground"
    course: AnyCourse | None = None

    @property
    def keys(self) -> tuple[str, str]:
        """The keys of its force and of its torque."""
        return ("force_per_metre", "torque_per_metre") if self.between else ("force", "torque")

    @model_validator(mode="after")
    def _fitting_keys(self) -> Load:
        if self.between is not None and self.at is not None:
            raise fault("a load is at a place, or between two", expected="one of `at` and `between`")
        others = ("force", "torque") if self.between else ("force_per_metre", "torque_per_metre")
        wrong = [key for key in others if getattr(self, key) is not None]
        if wrong:
            expected = f"{' or '.join(self.keys)}, as it is {'between two places' if self.between else 'at a place'}"
            raise fault(f"{wrong[0]} does not fit this load", expected=expected)
        if all(getattr(self, key) is None for key in self.keys):
            raise fault("a load without a force", expected=" or ".join(self.keys))
        return self

    def checks(self, name: str) -> Iterator[Check]:
        """Conditions between its numbers and those of bodies."""
        here, length = f"load.{name}", f"body.{self.on}.length"
        if self.at is not None:
            yield on_body(f"{here}.at", (f"{here}.at", length), "a load off its body")
        if self.between is not None:
            ends = f"{here}.between.0", f"{here}.between.1"
            for end in ends:
                yield on_body(end, (end, length), "a load off its body")
            what = "a load between two places begins at the one that comes first"
            yield Check(f"{here}.between", ends, lambda a, b: a < b, what, "two places, the nearer one first")


class SpringEnd(Spec):
    """Where a spring is fixed: on a body, at m along its track (its end if not given), or at a position over the
    ground, m."""

    on: Annotated[str, Noun('"ground" or the name of a body')] = GROUND
    at: Length | None = Field(default=None, ge=0)
    position: Place | None = None

    @model_validator(mode="after")
    def _fitting_keys(self) -> SpringEnd:
        if (self.on == GROUND) != (self.position is not None):
            raise fault(
                "an end of a spring is on a body or over the ground",
                expected='{ on = "NAME", at = metres } or { position = [x, y, z] }',
            )
        if self.on == GROUND and self.at is not None:
            raise fault("the ground has no track", expected="position = [x, y, z], m")
        return self


class Spring(Spec):
    """A spring and a damper between two places, along the line between them. stiffness: N/m; damping: N s/m; length: at
    which it neither pulls nor pushes, m."""

    ends: Annotated[tuple[SpringEnd, SpringEnd], Strict(False)]
    stiffness: Stiffness = Field(default=0.0, ge=0)
    damping: Damping = Field(default=0.0, ge=0)
    length: Length = Field(ge=0)

    def checks(self, name: str) -> Iterator[Check]:
        """Conditions between its numbers and those of bodies."""
        for number, end in enumerate(self.ends):
            if end.at is not None:
                here = f"spring.{name}.ends.{number}.at"
                yield on_body(here, (here, f"body.{end.on}.length"), "a spring off the body that holds it")
