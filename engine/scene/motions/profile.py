"""From rest to rest over a distance as fast as limits of speed, acceleration and jerk allow."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from results_schema.arrays import Array

PHASES = 8  # three of speeding up, the top speed, three of slowing down, and the rest
DEGREE = 4  # coefficients of a phase's polynomial


class Profile(NamedTuple):
    """A move of unit length: jerk (1/s3) and the times (s) of one jerk, of speeding up, and at full speed."""

    jerk: float
    jerk_time: float
    up_time: float
    steady_time: float

    @property
    def duration(self) -> float:
        """s."""
        return 2.0 * self.up_time + self.steady_time

    @property
    def top_speed(self) -> float:
        """1/s; below the limit where the way is too short to reach that."""
        return 1.0 / (self.up_time + self.steady_time)

    @property
    def bounds(self) -> Array:
        """(7,) times at which its phases end, s; without a limit of jerk some last no time."""
        whole, (_, ramp, up, steady) = self.duration, self
        return np.array([ramp, up - ramp, up, up + steady, up + steady + ramp, whole - ramp, whole])

    def pieces(self) -> Array:
        """(8, 5) start of every phase (s) and coefficients of the way in the time since then, constant first."""
        _, ramp, up, _ = self
        top, constant = self.top_speed, up - 2.0 * ramp  # for how long the acceleration is
        push = top / (up - ramp)
        bow = push / ramp / 6.0 if ramp > 0.0 else 0.0
        way, rate = push * ramp**2 / 6.0, 0.5 * push * ramp  # after the first jerk
        further, faster = way + rate * constant + 0.5 * push * constant**2, rate + push * constant
        found = np.zeros((PHASES, 1 + DEGREE))
        found[1:, 0] = self.bounds
        found[:, 1:] = [
            (0.0, 0.0, 0.0, bow),
            (way, rate, 0.5 * push, 0.0),
            (further, faster, 0.5 * push, -bow),
            (0.5 * top * up, top, 0.0, 0.0),
            (1.0 - 0.5 * top * up, top, 0.0, -bow),
            (1.0 - further, faster, -0.5 * push, 0.0),
            (1.0 - way, rate, -0.5 * push, bow),
            (1.0, 0.0, 0.0, 0.0),
        ]
        return found


def profile(distance: float, speed: float, acceleration: float, jerk: float) -> Profile:
    """From rest to rest over a distance > 0, scaled to unit length; an infinite jerk makes a trapezoid of the speed.

    With T_j = a/j, T_a = T_j + v/a, where v j < a^2 T_j = sqrt(v/j), T_a = 2 T_j, and T_v = D/v - T_a; where that is
    negative the speed is never reached: T_a = T_j/2 + sqrt(T_j^2/4 + D/a) with T_j = a/j if that is 2 T_j at least,
    else T_j = (D/(2 j))^(1/3), T_a = 2 T_j.

    >>> profile(1.0, 10.0, 100.0, 2.0).duration  # 4 (D/(2 j))^(1/3)
    2.5198420997897464
    """
    if speed * jerk >= acceleration**2:
        ramp = acceleration / jerk
        up = ramp + speed / acceleration
    else:
        ramp = math.sqrt(speed / jerk)
        up = 2.0 * ramp
    steady = distance / speed - up
    if steady < 0.0:
        steady, ramp = 0.0, acceleration / jerk
        up = 0.5 * ramp + math.sqrt(0.25 * ramp**2 + distance / acceleration)
        if up < 2.0 * ramp:
            ramp = (distance / (2.0 * jerk)) ** (1.0 / 3.0)
            up = 2.0 * ramp
    return Profile(jerk=jerk / distance, jerk_time=ramp, up_time=up, steady_time=steady)
