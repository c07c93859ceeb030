"""Motions of joints that are given in time, as pieces of polynomials and sines."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from math import inf, pi
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, create_model, model_validator

from engine.scene.motions.profile import DEGREE, PHASES, profile
from engine.study_file.spec import KindOf, Several, SpecOfKind, kinds
from engine.study_file.units import (
    Acceleration,
    Angle,
    AngularAcceleration,
    AngularJerk,
    AngularRate,
    Dimensionless,
    Frequency,
    Jerk,
    Length,
    Rate,
    Speed,
    Time,
    fault,
)
from results_schema.arrays import Array

#: Columns of a piece: start (s); coefficients of a polynomial of degree 5 in the time since then, constant first;
#: amplitude, rate (rad/s) and phase of a sine.
START, CONSTANT, AMPLITUDE, RATE, PHASE, COLUMNS = 0, 1, 7, 8, 9, 10

TWO_OR_MORE = Field(min_length=2, max_length=1000)
Number = Callable[[str], Array]  # (V,) of a key of the motion, for every variant


class TimeMotion(SpecOfKind):
    """Base of the motions of joints, and of the courses of loads, which are factors without a unit."""

    @abstractmethod
    def pieces(self, number: Number) -> Array:
        """(V, pieces, 10): the columns above."""

    @property
    def at_start(self) -> float:
        """Its value at time 0."""
        piece = self.pieces(self._number)[0, 0]
        return float(piece[CONSTANT] + piece[AMPLITUDE] * np.sin(piece[PHASE]))

    def _number(self, key: str) -> Array:
        """(1,) a number of its own, such as "values.2"; 0 where none is set."""
        name, _, place = key.partition(".")
        found = getattr(self, name)[int(place)] if place else getattr(self, name)
        return np.array([0.0 if found is None else float(found)])


def blank(like: Array, count: int) -> Array:
    """(V, count, 10) pieces of nothing for numbers (V,)."""
    return np.zeros((like.size, count, COLUMNS))


class Steady(TimeMotion):
    """start + rate t."""

    kind: Literal["steady"]
    start: Dimensionless = 0.0
    rate: Rate

    def pieces(self, number: Number) -> Array:
        found = blank(number("rate"), 1)
        found[:, 0, CONSTANT], found[:, 0, CONSTANT + 1] = number("start"), number("rate")
        return found


class Swing(TimeMotion):
    """centre + amplitude sin(2 pi f t)."""

    kind: Literal["swing"]
    centre: Dimensionless = 0.0
    amplitude: Dimensionless
    frequency: Frequency = Field(gt=0)

    def pieces(self, number: Number) -> Array:
        found = blank(number("frequency"), 1)
        found[:, 0, CONSTANT], found[:, 0, AMPLITUDE] = number("centre"), number("amplitude")
        found[:, 0, RATE] = 2.0 * pi * number("frequency")
        return found


class SpinUp(TimeMotion):
    """From rest to a rate in some time, smoothly: its rate is (rate/T) t - (rate/2 pi) sin(2 pi t/T), then constant
    (Kane, Ryan and Banerjee 1987)."""

    kind: Literal["spin-up"]
    rate: float
    time: Time = Field(gt=0)

    def pieces(self, number: Number) -> Array:
        rate, time = number("rate"), number("time")
        found = blank(rate, 2)
        bow = rate * time / (4.0 * pi**2)
        found[:, 0, CONSTANT], found[:, 0, CONSTANT + 2] = -bow, 0.5 * rate / time
        found[:, 0, AMPLITUDE], found[:, 0, RATE], found[:, 0, PHASE] = bow, 2.0 * pi / time, 0.5 * pi
        found[:, 1, START], found[:, 1, CONSTANT], found[:, 1, CONSTANT + 1] = time, 0.5 * rate * time, rate
        return found


class Move(TimeMotion):
    """From rest at the start to rest at the end as fast as limits of speed, acceleration and jerk allow; it stays there
    (`engine.scene.motions.profile`). Without a jerk the speed is a trapezoid."""

    kind: Literal["point-to-point"]
    start: Dimensionless = 0.0
    end: Dimensionless
    speed: Dimensionless = Field(gt=0)
    acceleration: Dimensionless = Field(gt=0)
    jerk: Dimensionless | None = Field(default=None, gt=0)

    def pieces(self, number: Number) -> Array:
        return move_pieces(number("start"), number("end"), number)


class TimedMove(TimeMotion):
    """From rest at the start to rest at the end in so many seconds, the jerk constant in each quarter of them."""

    kind: Literal["timed-move"]
    start: Dimensionless = 0.0
    end: Dimensionless
    time: Time = Field(gt=0)

    def pieces(self, number: Number) -> Array:
        return timed_pieces(number("start"), number("end"), number("time"))


class MinimumJerk(TimeMotion):
    """From rest at the start to rest at the end in so many seconds by the polynomial of least squared jerk."""

    kind: Literal["minimum-jerk"]
    start: Dimensionless = 0.0
    end: Dimensionless
    time: Time = Field(gt=0)

    def pieces(self, number: Number) -> Array:
        return minimum_jerk_pieces(number("start"), number("end"), number("time"))


class Points(TimeMotion):
    """The C2 cubic spline through values at times, at rest at both ends; it stays at the last."""

    kind: Literal["waypoints"]
    times: Annotated[Several[Time], TWO_OR_MORE]
    values: Annotated[Several[Dimensionless], TWO_OR_MORE]

    @model_validator(mode="after")
    def _ascending(self) -> Points:
        if len(self.times) != len(self.values):
            lengths = f"{len(self.times)} times, {len(self.values)} values"
            raise fault("times and values must be equally many", received=lengths)
        if self.times[0] != 0.0 or not np.all(np.diff(self.times) > 0.0):
            raise fault("times must start at 0 and ascend", received=", ".join(f"{t:g}" for t in self.times[:6]))
        return self

    def pieces(self, number: Number) -> Array:
        return spline_pieces(number, len(self.times), "values")


def _of_a_joint(base: type[TimeMotion], way: Literal["Turn", "Slide"], **fields: Any) -> type[TimeMotion]:
    """The same motion of a joint that turns or slides, with the dimensions (and defaults, `...` for none) of that."""
    words = {"Turn": "Of a joint that turns.", "Slide": "Of a joint that slides."}
    return create_model(f"{base.__name__}{way}", __base__=base, __module__=__name__, __doc__=words[way], **fields)


SteadyTurn = _of_a_joint(Steady, "Turn", start=(Angle, 0.0), rate=(AngularRate, ...))
SwingTurn = _of_a_joint(Swing, "Turn", centre=(Angle, 0.0), amplitude=(Angle, ...))
SpinUpTurn = _of_a_joint(SpinUp, "Turn", rate=(AngularRate, ...))
MoveTurn = _of_a_joint(
    Move,
    "Turn",
    start=(Angle, 0.0),
    end=(Angle, ...),
    speed=(Annotated[AngularRate, Field(gt=0)], ...),
    acceleration=(Annotated[AngularAcceleration, Field(gt=0)], ...),
    jerk=(Annotated[AngularJerk, Field(gt=0)] | None, None),
)
TimedTurn = _of_a_joint(TimedMove, "Turn", start=(Angle, 0.0), end=(Angle, ...))
SmoothTurn = _of_a_joint(MinimumJerk, "Turn", start=(Angle, 0.0), end=(Angle, ...))
PointsTurn = _of_a_joint(Points, "Turn", values=(Annotated[Several[Angle], TWO_OR_MORE], ...))
SteadySlide = _of_a_joint(Steady, "Slide", start=(Length, 0.0), rate=(Speed, ...))
SwingSlide = _of_a_joint(Swing, "Slide", centre=(Length, 0.0), amplitude=(Length, ...))
SpinUpSlide = _of_a_joint(SpinUp, "Slide", rate=(Speed, ...))
MoveSlide = _of_a_joint(
    Move,
    "Slide",
    start=(Length, 0.0),
    end=(Length, ...),
    speed=(Annotated[Speed, Field(gt=0)], ...),
    acceleration=(Annotated[Acceleration, Field(gt=0)], ...),
    jerk=(Annotated[Jerk, Field(gt=0)] | None, None),
)
TimedSlide = _of_a_joint(TimedMove, "Slide", start=(Length, 0.0), end=(Length, ...))
SmoothSlide = _of_a_joint(MinimumJerk, "Slide", start=(Length, 0.0), end=(Length, ...))
PointsSlide = _of_a_joint(Points, "Slide", values=(Annotated[Several[Length], TWO_OR_MORE], ...))

_TURNING, _SLIDING = "motion of a joint that turns", "motion of a joint that slides"
_TURNS = SteadyTurn, SwingTurn, SpinUpTurn, PointsTurn, MoveTurn, TimedTurn, SmoothTurn
_SLIDES = SteadySlide, SwingSlide, SpinUpSlide, PointsSlide, MoveSlide, TimedSlide, SmoothSlide
TURNING = kinds(_TURNING, "wanderlast.turning_motions", TimeMotion, *_TURNS)
SLIDING = kinds(_SLIDING, "wanderlast.sliding_motions", TimeMotion, *_SLIDES)
COURSES = kinds("course of a load", "wanderlast.courses", TimeMotion, Steady, Swing, Points)
AnyTurning = Annotated[TimeMotion, KindOf(_TURNING, TURNING)]
AnySliding = Annotated[TimeMotion, KindOf(_SLIDING, SLIDING)]
AnyCourse = Annotated[TimeMotion, KindOf("course of a load", COURSES)]


def reached_in(way: Any, time: Any) -> dict[str, Any]:
    """What a move over a way in a time reaches, which it takes as limits: 2 D/T, 8 D/T^2 and 32 D/T^3."""
    return {"speed": 2.0 * way / time, "acceleration": 8.0 * way / time**2, "jerk": 32.0 * way / time**3}


def move_pieces(start: Array, end: Array, number: Number) -> Array:
    """(V, pieces, 10) of moves between places (V,) within `speed`, `acceleration` and `jerk` (0: no limit)."""
    limits = number("speed"), number("acceleration")
    jerk = np.where(number("jerk") > 0.0, number("jerk"), inf)
    found = blank(start, PHASES)
    for v, (way, *own) in enumerate(zip(np.abs(end - start), *limits, jerk, strict=True)):
        if way > 0.0:
            found[v, :, START : CONSTANT + DEGREE] = profile(way, *own).pieces()
    found[:, :, CONSTANT : CONSTANT + DEGREE] *= (end - start)[:, None, None]
    found[:, :, CONSTANT] += start[:, None]
    return found


def timed_pieces(start: Array, end: Array, time: Array) -> Array:
    """(V, pieces, 10) of moves between places (V,) in times (V,) s."""
    return move_pieces(start, end, reached_in(np.abs(end - start), time).__getitem__)


def minimum_jerk_pieces(start: Array, end: Array, time: Array) -> Array:
    """(V, 2, 10) of moves of least jerk between places (V,) in times (V,) s, and rests at their ends."""
    found = blank(start, 2)
    found[:, 0, CONSTANT], found[:, 1, START], found[:, 1, CONSTANT] = start, time, end
    for power, factor in ((3, 10.0), (4, -15.0), (5, 6.0)):
        found[:, 0, CONSTANT + power] = factor * (end - start) / time**power
    return found


def spline_pieces(number: Number, count: int, key: str) -> Array:
    """(V, pieces, 10) of the cubic splines through so many values of a key at `times`, see `_spline_pieces`."""
    columns = (np.stack([number(f"{word}.{k}") for k in range(count)], axis=1) for word in ("times", key))
    return np.stack([_spline_pieces(*pair) for pair in zip(*columns, strict=True)])


def _spline_pieces(times: Array, values: Array) -> Array:
    """(pieces, 10) of the cubic spline at rest at both ends, and the last value from then on."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, values, bc_type="clamped")
    found = np.zeros((times.size, COLUMNS))
    found[:, START], found[-1, CONSTANT] = times, values[-1]
    found[:-1, CONSTANT : CONSTANT + 4] = spline.c[::-1].T
    return found
