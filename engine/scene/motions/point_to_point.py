"""From rest to rest over a distance, of a carriage: within limits of speed, acceleration and jerk, or in a time."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from engine.scene.motions.base import Array, FromRestToRest, Path, Side, both_places
from engine.scene.motions.of_joints import Number, move_pieces, reached_in, timed_pieces
from engine.scene.motions.profile import PHASES, Profile, profile
from engine.study_file.units import Acceleration, Jerk, Speed, Time


class InPhases(FromRestToRest):
    """By a profile of constant jerks."""

    @property
    def seconds(self) -> float:
        return self._move.duration

    @property
    def max_speed(self) -> float:
        return abs(self.end - self.start) * self._move.top_speed * self.time_scale

    @property
    def rests_from(self) -> float:
        return float(self._bounds[-1])

    def breaks(self) -> Array:
        """Where its phases meet: there the acceleration jumps or bends."""
        inside = np.unique(self._bounds)
        return inside[(inside > 0.0) & (inside < self.duration)]

    def law(self, tau: Array, side: Side) -> Path:
        times = np.asarray(tau, dtype=np.float64)
        phase = np.clip(np.searchsorted(self._bounds, times, side=side), *self._phases)
        path = self._in_phase(times, int(phase.min(initial=PHASES)))
        for later in np.unique(phase)[1:]:
            here = phase == later
            for part, values in zip(path, self._in_phase(times[here], int(later)), strict=True):
                part[here] = values
        return path

    def path_on(self, tau: ArrayLike, segment_start: float, segment_end: float) -> Path:
        times = np.minimum(np.maximum(np.asarray(tau, dtype=np.float64), segment_start), segment_end)
        reached = int(np.searchsorted(self._bounds, 0.5 * (segment_start + segment_end)))  # all of it in one phase
        first, last = self._phases
        return self._in_phase(times, min(max(reached, first), last))

    @property
    def _phases(self) -> tuple[int, int]:
        """The first phase, without a jerk the second, as that one takes no time then; and the last one."""
        first = int(np.searchsorted(self._bounds, 0.0, side="right"))
        return first, PHASES - 1 if self.dwell > 0.0 else PHASES - 2 - first

    def _in_phase(self, times: Array, phase: int) -> Path:
        """At times (S,) in a phase. Its second half, and the rest, are the first one backward, so that it comes to rest
        exactly."""
        (first, last), scale, back = self.way, self.time_scale, phase >= PHASES // 2
        way = last - first
        k = max(PHASES - 2 - phase, 0) if back else phase
        (begins, c0, c1, c2, c3), ends = self._pieces[k], self._pieces[k + 1, 0]
        since = self._move.duration - times * scale if back else times * scale
        u = np.minimum(np.maximum(since, begins), ends) - begins  # rounding must not leave the phase
        gone, rate = c0 + u * (c1 + u * (c2 + u * c3)), c1 + u * (2.0 * c2 + 3.0 * u * c3)
        push = 2.0 * c2 + 6.0 * u * c3
        if back:
            return Path(last - way * gone, way * scale * rate, -way * scale**2 * push)
        return Path(first + way * gone, way * scale * rate, way * scale**2 * push)

    @property
    @abstractmethod
    def _move(self) -> Profile:
        """How fast it goes, over a way of unit length."""

    @property
    def _pieces(self) -> Array:
        """(8, 5) as of `Profile`."""
        return _tables(self._move)[0]

    @property
    def _bounds(self) -> Array:
        """(7,) tau at which its phases end."""
        return _tables(self._move)[1] / self.time_scale


class PointToPoint(InPhases):
    """Within limits of speed, acceleration and jerk. Without a jerk the speed is a trapezoid. Where the way is too
    short for the speed, or the speed for the acceleration, these are not reached (`profile`).

    >>> move = PointToPoint(kind="point-to-point", start=1.0, end=3.0, speed=1.0, acceleration=2.0, dwell=0.5)
    >>> move.time_scale, move.path([0.0, 0.5, 1.0]).S.tolist()
    (3.0, [1.0, 2.25, 3.0])
    """

    kind: Literal["point-to-point"]
    speed: Speed = Field(gt=0)
    acceleration: Acceleration = Field(gt=0)
    jerk: Jerk | None = Field(default=None, gt=0)

    @property
    def smoothed_by(self) -> str:
        return "" if self.jerk else "jerk"

    @property
    def reached(self) -> Mapping[str, float]:
        top = abs(self.end - self.start) * self._move.top_speed
        return {"speed": top, "acceleration": top / (self._move.up_time - self._move.jerk_time)}

    def pieces(self, number: Number) -> Array:
        return move_pieces(*both_places(number), number)

    @cached_property
    def _move(self) -> Profile:
        jerk = math.inf if self.jerk is None else self.jerk
        return profile(abs(self.end - self.start), self.speed, self.acceleration, jerk)


class TimedMove(InPhases):
    """In so many seconds, the jerk constant in each quarter of them: over a way D in T it reaches a speed of 2 D/T, an
    acceleration of 8 D/T^2 and a jerk of 32 D/T^3.

    >>> move = TimedMove(kind="timed-move", start=1.0, end=3.0, time=2.0, dwell=2.0)
    >>> move.time_scale, move.path([0.0, 0.125, 0.25, 0.5, 1.0]).S.round(12).tolist()
    (4.0, [1.0, 1.166666666667, 2.0, 3.0, 3.0])
    """

    kind: Literal["timed-move"]
    time: Time = Field(gt=0)

    def pieces(self, number: Number) -> Array:
        return timed_pieces(*both_places(number), number("time"))

    @cached_property
    def _move(self) -> Profile:
        way = abs(self.end - self.start)
        return profile(way, **reached_in(way, self.time))


@lru_cache(maxsize=256)
def _tables(move: Profile) -> tuple[Array, Array]:
    """Its pieces and bounds, which every segment of every march asks for; motions, which are compared, keep no
    arrays."""
    return move.pieces(), move.bounds
