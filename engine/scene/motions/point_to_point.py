"""From rest to rest over a distance as fast as limits of speed, acceleration and jerk allow: of a carriage, and of the
joints of robots."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from engine.scene.motions.base import Array, Motion, Path, Side, two_places
from engine.scene.motions.of_joints import CONSTANT, START, Number, blank
from engine.study_file.checks import Check, on_body
from engine.study_file.units import Acceleration, Jerk, Length, Speed, Time

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


class PointToPoint(Motion):
    """From rest at the start to rest at the end within limits of speed, acceleration and jerk, then `dwell` seconds of
    rest there. tau = 1 is all of it.

    Without a jerk the speed is a trapezoid. Where the way is too short for the speed, or the speed for the
    acceleration, these are not reached (`profile`).

    >>> move = PointToPoint(kind="point-to-point", start=1.0, end=3.0, speed=1.0, acceleration=2.0, dwell=0.5)
    >>> move.time_scale, move.path([0.0, 0.5, 1.0]).S.tolist()
    (3.0, [1.0, 2.25, 3.0])
    """

    ends = ("start", "end")
    in_pieces = True
    kind: Literal["point-to-point"]
    start: Length
    end: Length
    speed: Speed = Field(gt=0)
    acceleration: Acceleration = Field(gt=0)
    jerk: Jerk | None = Field(default=None, gt=0)
    dwell: Time = Field(default=0.0, ge=0)

    @property
    def smoothed_by(self) -> str:
        return "" if self.jerk else "jerk"

    @property
    def time_scale(self) -> float:
        return self._move.duration + self.dwell

    @property
    def max_speed(self) -> float:
        return abs(self.end - self.start) * self._move.top_speed * self.time_scale

    @property
    def rests_from(self) -> float:
        return float(self._bounds[-1])

    @property
    def reached(self) -> Mapping[str, float]:
        top = abs(self.end - self.start) * self._move.top_speed
        return {"speed": top, "acceleration": top / (self._move.up_time - self._move.jerk_time)}

    def range(self) -> tuple[float, float]:
        return min(self.start, self.end), max(self.start, self.end)

    def checks(self, here: str, length: str) -> list[Check]:
        start, end = f"{here}.start", f"{here}.end"
        what = "a point-to-point path must stay on its body"
        return [two_places(start, end), *(on_body(key, (key, length), what) for key in (start, end))]

    def breaks(self) -> Array:
        """Where its phases meet: there the acceleration jumps or bends."""
        inside = np.unique(self._bounds)
        return inside[(inside > 0.0) & (inside < self.duration)]

    def law(self, tau: Array, side: Side) -> Path:
        """Its second half, and the rest, are the first one backward, so that it comes to rest exactly."""
        times, way, scale = np.asarray(tau, dtype=np.float64), self.end - self.start, self.time_scale
        reached = np.searchsorted(self._bounds, times, side=side)
        first = np.searchsorted(self._bounds, 0.0, side="right")  # without a jerk the first phase takes no time
        phase = np.clip(reached, first, PHASES - 1 if self.dwell > 0.0 else PHASES - 2 - first)
        back = phase >= PHASES // 2
        k = np.where(back, np.maximum(PHASES - 2 - phase, 0), phase)
        starts, own = self._move.pieces()[:, 0], self._move.pieces()[k, 1:]
        since = np.where(back, self._move.duration - times * scale, times * scale)
        u = np.clip(since, starts[k], starts[k + 1]) - starts[k]  # rounding must not leave the phase
        c0, c1, c2, c3 = np.moveaxis(own, -1, 0)
        gone, rate = c0 + u * (c1 + u * (c2 + u * c3)), c1 + u * (2.0 * c2 + 3.0 * u * c3)
        push = np.where(back, -1.0, 1.0) * (2.0 * c2 + 6.0 * u * c3)
        place = np.where(back, self.end - way * gone, self.start + way * gone)
        return Path(place, way * scale * rate, way * scale**2 * push)

    def pieces(self, number: Number) -> Array:
        start, end, *limits = (number(key) for key in ("start", "end", "speed", "acceleration"))
        jerk = np.where(number("jerk") > 0.0, number("jerk"), math.inf)  # 0 where none is set
        found = blank(start, PHASES)
        for v, (way, *own) in enumerate(zip(np.abs(end - start), *limits, jerk, strict=True)):
            found[v, :, START : CONSTANT + DEGREE] = profile(way, *own).pieces()
        found[:, :, CONSTANT : CONSTANT + DEGREE] *= (end - start)[:, None, None]
        found[:, :, CONSTANT] += start[:, None]
        return found

    @cached_property
    def _move(self) -> Profile:
        jerk = math.inf if self.jerk is None else self.jerk
        return profile(abs(self.end - self.start), self.speed, self.acceleration, jerk)

    @property
    def _bounds(self) -> Array:
        """(7,) tau at which its phases end."""
        return self._move.bounds / self.time_scale
