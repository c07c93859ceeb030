"""A rigid body, which rises, falls and pitches and does not bend: as the user describes it, and its two modes.

These are heave and pitch about its centre of mass, each with unit modal mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, field_validator, model_validator

from engine.bodies.modal.description import Body
from engine.bodies.modal.modal_body import Array, ModalBody
from engine.bodies.modal.outline import ALONG, DOWN, Line, Lump, Outline, straight
from engine.bodies.modal.section_doubts import Doubt
from engine.study_file.checks import Check, on_body
from engine.study_file.units import Inertia, Length, Mass, fault, unit_of
from results_schema.errors import BadInput
from results_schema.quantities import OF_SECTION

WIDE = 5.0  # lengths: a radius of gyration of what is short beside its track, as a tool at a flange
#: Lengths: with a ten-thousandth, which is no body's, a wagon of 14 t on springs of 1e6 N/m has contacts of 7 kHz.
NARROW = 1e-4
BOX = 0.1  # height over length, as it is drawn


class Rigid(Body):
    """A rigid body: a vehicle or a table on its contacts.

    length: of its track, m. mass: kg. inertia: kg m2, of pitch about its centre of mass; both may be 0 in a frame that
    moves, as of a payload that is not there. centre: m along its track, the middle if not given.
    """

    kind: Literal["rigid"]
    length: Length = Field(gt=0)
    mass: Mass = Field(ge=0)
    inertia: Inertia = Field(ge=0)
    centre: Length | None = None

    @field_validator("inertia", mode="before")
    @classmethod
    def _of_pitch(cls, value: Any) -> Any:
        if isinstance(value, list):
            remedy = "one number here, and inertia = [about x, about y, about z] in [frame.NAME] of a body that moves"
            raise fault("several moments of inertia", expected="that of pitch", received=str(value), remedy=remedy)
        return value

    @model_validator(mode="after")
    def _bends_nowhere(self) -> Rigid:
        if self.damping_ratio != 0.0 or self.modes != "auto":
            what, remedy = "a rigid body has no modes that bend", "damping of what it stands on, or of its joints"
            raise fault(what, expected="neither damping_ratio nor modes", remedy=remedy)
        return self

    @property
    def untold(self) -> tuple[str, ...]:
        return OF_SECTION

    @property
    def modal_masses(self) -> tuple[str, ...]:
        return ("mass", "inertia")

    @property
    def is_free(self) -> bool:
        return True

    @property
    def centre_of_mass(self) -> float:
        """m along its track."""
        return 0.5 * self.length if self.centre is None else self.centre

    def with_modes(self, count: int) -> Rigid:
        """Itself: it has no modes that bend."""
        return self

    def finer(self) -> Rigid:
        return self

    @property
    def whole(self) -> Rigid:
        return self

    def build(self) -> ModalBody:
        return rigid_body(self)

    def outline(self, modal: ModalBody) -> Outline:
        """A box, as nothing else of it is known."""
        found = straight(modal)
        line, top = found.lines[0], -BOX * self.length * DOWN
        corners = [line.points, line.points[::-1] + top, line.points[:1]]
        box = Line(np.concatenate(corners), np.concatenate([line.motion, line.motion[::-1], line.motion[:1]]))
        centre = Lump("centre of mass", self.centre_of_mass * ALONG, self.mass)
        return replace(found, lines=(box,), masses=(centre,))

    def doubts(self, here: str) -> list[Doubt]:
        keys = tuple(f"{here}.{key}" for key in ("mass", "inertia", "length"))
        what = "its radius of gyration is more than five times its length"
        expected, unit = "at least inertia/(5 length)^2, in kg", unit_of(Mass)
        too_light = Doubt(keys[0], keys, _fills_its_length, what, expected, unit, ("t",))
        what = "next to nothing turns: on its contacts it swings so fast that no march follows"
        expected, turns = "at least mass (length/10000)^2, in kg m2", (keys[1], keys[0], keys[2])
        return [too_light, Doubt(keys[1], turns, _turns_slowly, what, expected, unit_of(Inertia), ("t m2",))]

    def checks(self, here: str) -> list[Check]:
        if self.centre is None:
            return []
        where = f"{here}.centre"
        return [on_body(where, (where, f"{here}.length"), "a centre of mass off the body")]


@dataclass(frozen=True)
class RigidShapes:
    """phi = (1/sqrt(m), (s - centre)/sqrt(J))."""

    body: Rigid

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j phi / ds^j at the stations `s` (S,) for several j, as (orders, S, 2)."""
        arm = np.asarray(s, dtype=np.float64) - self.body.centre_of_mass
        none = np.zeros_like(arm)
        shapes = {0: (none + 1.0, arm), 1: (none, none + 1.0)}
        sizes = np.sqrt([self.body.mass or 1.0, self.body.inertia or 1.0])  # of what is nothing they are drawn alone
        return np.stack([np.stack(shapes.get(order, (none, none)), axis=1) / sizes for order in orders])


class RigidStatics:
    """Nothing bends."""

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int) -> Array:
        """Zero, for pairs."""
        return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(s)))

    def own_weight_deflection(self, x: ArrayLike, derivative: int) -> Array:
        """Raises BadInput: no static state carries a free body."""
        raise BadInput("own weight of a rigid body that nothing holds", where="own_weight", expected="false")


def _fills_its_length(mass: Any, inertia: Any, length: Any) -> Any:
    """Whether its mass lies no farther out than its track is long, about; one without mass has nothing there."""
    return (inertia <= mass * (WIDE * length) ** 2) | (mass == 0.0)


def _turns_slowly(inertia: Any, mass: Any, length: Any) -> Any:
    """Whether its radius of gyration is no point's; what has no inertia at all is meant so."""
    return (inertia >= mass * (NARROW * length) ** 2) | (inertia == 0.0)


def rigid_body(body: Rigid) -> ModalBody:
    """The two modes of a rigid body.

    >>> table = rigid_body(Rigid(kind="rigid", length=2.0, mass=4.0, inertia=9.0))
    >>> table.shape([0.0, 1.0]).tolist()
    [[0.5, -0.3333333333333333], [0.5, 0.0]]
    """
    return ModalBody(
        length=body.length,
        mass=body.mass,
        omega=np.zeros(2),
        participation=np.array([np.sqrt(body.mass), 0.0]),
        wave_number=np.zeros(2),
        bending_stiffness=np.nan,
        dampers=(),
        shapes=RigidShapes(body),
        statics=RigidStatics(),
    )
