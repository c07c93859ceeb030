"""Staying where it is."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from engine.scene.motions.base import Array, Motion, Path, Side
from engine.scene.motions.of_joints import CONSTANT, Number, blank
from engine.study_file.checks import Check, on_body
from engine.study_file.units import Length, Time


class Standing(Motion):
    """Stays at a place. time: s that the run goes on, where nothing else moves for longer. tau = 1 is that.

    >>> Standing(kind="standing", at=2.0).path([0.0, 0.5]).S.tolist()
    [2.0, 2.0]
    """

    in_pieces = True
    kind: Literal["standing"]
    at: Length
    time: Time = Field(default=1.0, gt=0)

    @property
    def time_scale(self) -> float:
        return self.time

    @property
    def max_speed(self) -> float:
        return 0.0

    @property
    def rests_from(self) -> float:
        return 0.0

    def range(self) -> tuple[float, float]:
        return self.at, self.at

    def checks(self, here: str, length: str) -> list[Check]:
        return [on_body(f"{here}.at", (f"{here}.at", length), "a carriage that stands is on its body")]

    def law(self, tau: Array, side: Side) -> Path:
        return Path(np.full_like(tau, self.at), np.zeros_like(tau), np.zeros_like(tau))

    def pieces(self, number: Number) -> Array:
        place = number("at")
        found = blank(place, 1)
        found[:, 0, CONSTANT] = place
        return found
