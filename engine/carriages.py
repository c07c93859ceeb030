"""What rides on a body: a force, a mass or a mass on a spring, with its motion and its start."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from engine.motions import AnyMotion
from engine.spec import KindOf, Spec
from engine.units import Damping, Force, Length, Mass, Stiffness, Time, fault


class Carriage(Spec):
    """Base of all carriages.

    on: name of the body. delay: s after time 0 at which it sets off, 0 if not given.
    headway: instead of a delay, the metres of its own way by which it trails a carriage that sets off at time 0.
    masses: keys that hold parts of its mass in kg.
    """

    masses: ClassVar[tuple[str, ...]] = ()

    on: str
    motion: AnyMotion
    delay: Time | None = Field(default=None, ge=0)
    headway: Length | None = Field(default=None, ge=0)

    @property
    def moving_mass(self) -> float:
        """kg of the whole carriage."""
        return float(sum(getattr(self, key) for key in self.masses))

    @abstractmethod
    def weight(self, gravity: float) -> float:
        """Force along gravity on a body at rest, N; gravity in m/s2."""

    @property
    def inertial(self) -> bool:
        """Whether the contact force depends on the body's acceleration."""
        return self.moving_mass > 0.0

    @property
    def start_time(self) -> float:
        """s after time 0 at which the carriage sets off."""
        if self.headway is None:
            return self.delay or 0.0
        return self.headway * self.motion.time_scale / self.motion.max_speed

    @model_validator(mode="after")
    def _one_start(self) -> Carriage:
        if self.headway is None:
            return self
        if self.delay is not None:
            raise fault("a carriage has a delay or a headway, not both", expected="delay (s) or headway (m)")
        if not hasattr(self.motion, "speed"):
            raise fault("a headway needs a motion with a constant speed", expected="delay (s)")
        return self


class ForceCarriage(Carriage):
    """A constant force in N along gravity; negative lifts."""

    kind: Literal["force"]
    force: Force

    def weight(self, gravity: float) -> float:
        return self.force


class MassCarriage(Carriage):
    """A rigid mass in kg that stays in contact; its weight acts."""

    masses: ClassVar[tuple[str, ...]] = ("mass",)

    kind: Literal["mass"]
    mass: Mass = Field(gt=0)

    def weight(self, gravity: float) -> float:
        return self.moving_mass * gravity


class OscillatorCarriage(Carriage):
    """A sprung mass (kg) on a spring (N/m) and a damper (N s/m) over a wheel (kg) that stays in contact; the weights of
    both masses act."""

    masses: ClassVar[tuple[str, ...]] = ("mass", "wheel_mass")

    kind: Literal["oscillator"]
    mass: Mass = Field(gt=0)
    wheel_mass: Mass = Field(default=0.0, ge=0)
    stiffness: Stiffness = Field(gt=0)
    damping: Damping = Field(default=0.0, ge=0)

    def weight(self, gravity: float) -> float:
        return self.moving_mass * gravity


CARRIAGES: Mapping[str, type[Spec]] = {"force": ForceCarriage, "mass": MassCarriage, "oscillator": OscillatorCarriage}
AnyCarriage = Annotated[Carriage, KindOf("carriage", CARRIAGES, planned=("body",))]
