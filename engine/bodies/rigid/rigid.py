"""A rigid body as the user describes it: it rises, falls and pitches, and does not bend."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from engine.bodies.modal.description import Body
from engine.bodies.modal.modal_body import ModalBody
from engine.bodies.modal.outline import ALONG, DOWN, Line, Lump, Outline, straight
from engine.study_file.checks import Check, on_body
from engine.study_file.units import Inertia, Length, Mass
from results_schema.quantities import OF_SECTION

BOX = 0.1  # height over length, as it is drawn


class Rigid(Body):
    """A rigid body: a vehicle or a table on its contacts.

    length: of its track, m. mass: kg. inertia: kg m2, of pitch about its centre of mass. centre: m along its track,
    the middle if not given.
    """

    kind: Literal["rigid"]
    length: Length = Field(gt=0)
    mass: Mass = Field(gt=0)
    inertia: Inertia = Field(gt=0)
    centre: Length | None = None

    @property
    def untold(self) -> tuple[str, ...]:
        return OF_SECTION

    @property
    def centre_of_mass(self) -> float:
        """m along its track."""
        return 0.5 * self.length if self.centre is None else self.centre

    def with_modes(self, count: int) -> Rigid:
        """Itself: it has no modes that bend."""
        return self

    @property
    def whole(self) -> Rigid:
        return self

    def build(self) -> ModalBody:
        from engine.bodies.rigid.body import rigid_body

        return rigid_body(self)

    def outline(self, modal: ModalBody) -> Outline:
        """A box, as nothing else of it is known."""
        found = straight(modal)
        line, top = found.lines[0], -BOX * self.length * DOWN
        corners = [line.points, line.points[::-1] + top, line.points[:1]]
        box = Line(np.concatenate(corners), np.concatenate([line.motion, line.motion[::-1], line.motion[:1]]))
        centre = Lump("centre of mass", self.centre_of_mass * ALONG, self.mass)
        return replace(found, lines=(box,), masses=(centre,))

    def checks(self, here: str) -> list[Check]:
        if self.centre is None:
            return []
        where = f"{here}.centre"
        return [on_body(where, (where, f"{here}.length"), "a centre of mass off the body")]
