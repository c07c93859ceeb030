"""What is read, and where."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, Field, model_validator

from engine.spec import Spec, one_of
from engine.units import Length, fault

Quantity = Literal["displacement", "velocity", "acceleration", "bending_moment", "shear_force", "stress"]
OF_A_MASS = ("displacement", "velocity", "acceleration")
_MEANT = {"deflection": "displacement", "moment": "bending_moment", "shear": "shear_force"}


class Sensor(Spec):
    """A quantity at a fixed place `at` (m along the track) of a body, at the point that a carriage touches (`under`),
    or of a carriage's own sprung mass (`carriage`).

    With `under` or `carriage`, the body is that of the carriage and need not be named.
    """

    body: str | None = None
    at: Length | None = Field(default=None, ge=0)
    under: str | None = None
    carriage: str | None = None
    quantity: Annotated[str, AfterValidator(one_of(*get_args(Quantity), meant=_MEANT))] = "displacement"

    @model_validator(mode="after")
    def _one_place(self) -> Sensor:
        if [self.at, self.under, self.carriage].count(None) != 2:
            expected = 'at = metres, under = "a carriage", or carriage = "a carriage"'
            raise fault("a sensor has exactly one place", expected=expected)
        if self.at is not None and self.body is None:
            raise fault("a sensor at a fixed place needs its body", expected='body = "a body"')
        if self.carriage is not None and self.quantity not in OF_A_MASS:
            raise fault(f"a sprung mass has no {self.quantity}", expected=f"quantity: one of {', '.join(OF_A_MASS)}")
        return self

    @property
    def rides(self) -> str | None:
        """The carriage that it moves with, if any."""
        return self.carriage if self.under is None else self.under
