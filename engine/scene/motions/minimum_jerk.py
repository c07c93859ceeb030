"""From rest to rest in a time as smoothly as can be: the polynomial of degree 5 of least squared jerk."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from engine.scene.motions.base import Array, FromRestToRest, Path, Side, both_places
from engine.scene.motions.of_joints import Number, minimum_jerk_pieces
from engine.study_file.units import Time


class MinimumJerk(FromRestToRest):
    """Over a way D in T seconds D (10 x^3 - 15 x^4 + 6 x^5), x = t/T (Flash and Hogan 1985): it reaches a speed of
    1.875 D/T, an acceleration of 5.774 D/T^2 and a jerk of 60 D/T^3.

    >>> move = MinimumJerk(kind="minimum-jerk", start=1.0, end=3.0, time=2.0, dwell=2.0)
    >>> move.time_scale, move.path([0.0, 0.125, 0.25, 0.5, 1.0]).S.tolist()
    (4.0, [1.0, 1.20703125, 2.0, 3.0, 3.0])
    """

    kind: Literal["minimum-jerk"]
    time: Time = Field(gt=0)

    @property
    def seconds(self) -> float:
        return self.time

    @property
    def max_speed(self) -> float:
        return 1.875 * abs(self.end - self.start) / self.rests_from

    @property
    def rests_from(self) -> float:
        return self.time / self.time_scale

    def breaks(self) -> Array:
        return np.array([self.rests_from] if self.dwell > 0.0 else [])

    def law(self, tau: Array, side: Side) -> Path:
        first, last = self.way
        way, x = last - first, np.minimum(tau / self.rests_from, 1.0)
        to = np.minimum(x, 1.0 - x)  # the second half is the first one backward, so that it comes to rest exactly
        gone = way * to**3 * (10.0 + to * (6.0 * to - 15.0))
        rate, push = 30.0 * (x * (1.0 - x)) ** 2, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
        place = np.where(x < 0.5, first + gone, last - gone)
        return Path(place, way / self.rests_from * rate, way / self.rests_from**2 * push)

    def pieces(self, number: Number) -> Array:
        return minimum_jerk_pieces(*both_places(number), number("time"))
