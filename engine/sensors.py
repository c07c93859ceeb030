"""What is read, and where."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, Field, model_validator

from engine.spec import Spec, one_of
from engine.units import Length, fault

Quantity = Literal["displacement", "velocity", "acceleration", "bending_moment", "shear_force", "stress"]
_MEANT = {"deflection": "displacement", "moment": "bending_moment", "shear": "shear_force"}


class Sensor(Spec):
    """A quantity at a fixed place `at` (m along the track) of a body, or at the point that a carriage touches.

    With `under`, the body is that of the carriage and need not be named.
    """

    body: str | None = None
    at: Length | None = Field(default=None, ge=0)
    under: str | None = None
    quantity: Annotated[str, AfterValidator(one_of(*get_args(Quantity), meant=_MEANT))] = "displacement"

    @model_validator(mode="after")
    def _one_place(self) -> Sensor:
        if (self.at is None) == (self.under is None):
            raise fault("a sensor has exactly one place", expected='at = metres, or under = "a carriage"')
        if self.under is None and self.body is None:
            raise fault("a sensor at a fixed place needs its body", expected='body = "a body"')
        return self
