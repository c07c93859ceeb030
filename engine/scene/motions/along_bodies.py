"""The motions that a carriage can have: cruise, out and back, sinusoidal, waypoints, sliding; and the table of all."""

from __future__ import annotations

import math
from functools import reduce
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from engine.scene.motions.base import Array, BetweenPlaces, Legs, Motion, Path, Reversal, Side, both_places, two_places
from engine.scene.motions.minimum_jerk import MinimumJerk
from engine.scene.motions.of_joints import AMPLITUDE, CONSTANT, PHASE, RATE, START, Number, blank, spline_pieces
from engine.scene.motions.point_to_point import PointToPoint, TimedMove
from engine.scene.motions.standing import Standing
from engine.study_file.checks import Check, on_body
from engine.study_file.spec import Hint, KindOf, Several, kinds
from engine.study_file.units import Damping, Dimensionless, Force, Frequency, Length, Speed, Time, fault
from results_schema.lazy_imports import interpolate


class Cruise(BetweenPlaces):
    """Constant speed from start to end; either may lie off the body. tau = 1 is one passage.

    after: free vibration afterwards, in first periods of the body.
    """

    pace = "speed"
    passes = True
    in_pieces = True
    kind: Literal["cruise"]
    speed: Annotated[Speed, Hint("end < start runs backward, and so does direction = -1")] = Field(gt=0)
    after: Dimensionless = Field(default=0.0, ge=0, le=1e6)

    @property
    def time_scale(self) -> float:
        return abs(self.end - self.start) / self.speed

    @property
    def max_speed(self) -> float:
        return abs(self.end - self.start)

    @property
    def free_vibration(self) -> float:
        return self.after

    def checks(self, here: str, length: str) -> list[Check]:
        start, end = f"{here}.start", f"{here}.end"
        touch = Check(here, (length, start, end), _line_touches, _NO_TOUCH, _TOUCHING)
        return [two_places(start, end), touch]

    def law(self, tau: Array, side: Side) -> Path:
        first, last = self.way
        return Path((1.0 - tau) * first + tau * last, np.full_like(tau, last - first), np.zeros_like(tau))

    def passing(self, place: float) -> tuple[float, ...]:
        first, last = self.way
        tau = (place - first) / (last - first)
        return (tau,) if 0.0 < tau < 1.0 else ()

    def pieces(self, number: Number) -> Array:
        (start, end), speed = both_places(number), number("speed")
        found = blank(start, 2)
        found[:, 0, CONSTANT], found[:, 0, CONSTANT + 1] = start, np.sign(end - start) * speed
        found[:, 1, START], found[:, 1, CONSTANT] = np.abs(end - start) / speed, end
        return found


class OutAndBack(BetweenPlaces):
    """From start to end and back, `cycles` times, at constant speed v but for smooth turns. tau = 1 is one cycle.

    With d = turn |end - start| and t_r = pi d/v it starts at rest in the middle of a turn, s = start + d (1 -
    cos(pi u/t_r)) for 0 <= u <= t_r/2, cruises until d before the end, turns likewise, comes back, and ends at rest
    at the start (references.md, "Asymmetry"). A cycle takes 2 (pi d + stroke - 2 d)/v and is symmetric about its
    middle. turn = 0 reverses at an instant.
    """

    pace = "speed"
    period = 1.0
    ends = ("start", "end")
    in_pieces = True
    kind: Literal["out-and-back"]
    speed: Speed = Field(gt=0)
    turn: Dimensionless = Field(ge=0, le=0.5)
    cycles: int = Field(ge=1, le=1_000_000)

    @property
    def stroke(self) -> float:
        """Distance between the ends, m."""
        return abs(self.end - self.start)

    @property
    def time_scale(self) -> float:
        return self.max_speed / self.speed

    @property
    def duration(self) -> float:
        return float(self.cycles)

    @property
    def max_speed(self) -> float:
        return 2.0 * ((math.pi - 2.0) * self.turn + 1.0) * self.stroke

    @property
    def half_turn(self) -> float:
        """tau from the middle of a turn to the cruise."""
        return 0.5 * math.pi * self.turn * self.stroke / self.max_speed

    @property
    def legs(self) -> Legs:
        return Legs(*self.way, self.turn, (self.half_turn, 0.5 - self.half_turn))

    def reversals(self) -> tuple[Reversal, ...]:
        if self.turn > 0.0:
            return ()
        there = math.copysign(self.max_speed, self._sign)
        halves = range(1, 2 * self.cycles)
        return tuple(Reversal(k / 2, there, -there) if k % 2 else Reversal(k / 2, -there, there) for k in halves)

    def checks(self, here: str, length: str) -> list[Check]:
        start, end = f"{here}.start", f"{here}.end"
        return [
            two_places(start, end),
            *(on_body(key, (key, length), "an out-and-back path must stay on its body") for key in (start, end)),
        ]

    def law(self, tau: Array, side: Side) -> Path:
        phase = np.mod(tau, 1.0)
        if side == "left":
            phase = np.where((phase == 0.0) & (tau > 0.0), 1.0, phase)
            back = phase > 0.5
        else:
            phase = np.where((phase == 0.0) & (tau >= self.duration), 1.0, phase)
            back = phase >= 0.5
        folded = self._there(np.where(back, 1.0 - phase, phase))
        way = self._sign
        velocity = np.where(back, -way * folded.dS, way * folded.dS)
        position = np.clip(self.way[0] + way * folded.S, *self.range())  # rounding must not leave the body
        return Path(position, velocity, way * folded.ddS)

    def pieces(self, number: Number) -> Array:
        """Half a turn, then by turns ways and turns, half a turn at last."""
        (start, end), speed, turn = both_places(number), number("speed"), number("turn")
        stroke = end - start
        depth, quarter = turn * stroke, 0.5 * np.pi * turn * np.abs(stroke) / speed
        way = (1.0 - 2.0 * turn) * np.abs(stroke) / speed
        found, ways = blank(start, 4 * self.cycles + 2), 2 * self.cycles
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.where(depth != 0.0, speed / np.abs(depth), 0.0)
        for k in range(ways + 1):
            near, into = (end, -depth) if k % 2 else (start, depth)
            begins = np.zeros_like(way) if k == 0 else k * (way + 2.0 * quarter) - quarter
            bow = found[:, 2 * k]  # near + into (1 - cos(rate (t - middle)))
            bow[:, START], bow[:, CONSTANT], bow[:, AMPLITUDE], bow[:, RATE] = begins, near + into, -into, rate
            bow[:, PHASE] = 0.5 * np.pi if k == 0 else 0.0  # a later one begins a quarter before its middle
            straight = found[:, 2 * k + 1]
            straight[:, START] = begins + (quarter if k in (0, ways) else 2.0 * quarter)
            straight[:, CONSTANT] = near + into if k < ways else start
            straight[:, CONSTANT + 1] = np.sign(stroke) * speed * (1.0 if k % 2 == 0 else -1.0) if k < ways else 0.0
        return found

    @property
    def _sign(self) -> float:
        """Of the speed on the way there."""
        first, last = self.way
        return math.copysign(1.0, last - first)

    def _there(self, tau: Array) -> Path:
        """StationPath gone on the way out, 0 <= tau <= 1/2; the three branches of the law."""
        depth, fast, half = self.turn * self.stroke, self.max_speed, self.half_turn
        way, speed, change = depth + fast * (tau - half), np.full_like(tau, fast), np.zeros_like(tau)
        if depth == 0.0:
            return Path(way, speed, change)
        near, far = tau < half, tau > 0.5 - half
        angle = fast / depth * np.where(near, tau, 0.5 - tau)
        bow, sine, cosine = 2.0 * depth * np.sin(0.5 * angle) ** 2, np.sin(angle), fast**2 / depth * np.cos(angle)
        return Path(
            np.where(near, bow, np.where(far, self.stroke - bow, way)),
            np.where(near | far, fast * sine, speed),
            np.where(near, cosine, np.where(far, -cosine, change)),
        )


class Sinusoidal(Motion):
    """s = centre + amplitude sin(2 pi f t). tau = 1 is one cycle."""

    pace = "frequency"
    is_harmonic = True
    period = 1.0
    in_pieces = True
    kind: Literal["sinusoidal"]
    centre: Length
    amplitude: Length = Field(gt=0)
    frequency: Frequency = Field(gt=0)
    cycles: int = Field(ge=1, le=1_000_000)

    @property
    def time_scale(self) -> float:
        return 1.0 / self.frequency

    @property
    def duration(self) -> float:
        return float(self.cycles)

    @property
    def max_speed(self) -> float:
        return 2.0 * math.pi * self.amplitude

    def range(self) -> tuple[float, float]:
        return self.centre - self.amplitude, self.centre + self.amplitude

    def checks(self, here: str, length: str) -> list[Check]:
        needs = (f"{here}.centre", f"{here}.amplitude", length)
        what = "a sinusoidal path must stay on its body"
        return [Check(here, needs, lambda c, a, el: (c - a >= 0) & (c + a <= el), what, "0 to the body's length")]

    def law(self, tau: Array, side: Side) -> Path:
        angle, rate = 2.0 * np.pi * np.mod(tau, 1.0), 2.0 * np.pi
        sine = self.amplitude * np.sin(angle)
        return Path(self.centre + sine, rate * self.amplitude * np.cos(angle), -(rate**2) * sine)

    def pieces(self, number: Number) -> Array:
        centre, frequency = number("centre"), number("frequency")
        found = blank(centre, 2)
        found[:, :, CONSTANT] = centre[:, None]
        found[:, 0, AMPLITUDE], found[:, 0, RATE] = number("amplitude"), 2.0 * np.pi * frequency
        found[:, 1, START] = self.cycles / frequency
        return found


Places = Several[Length]
Times = Several[Time]


class Waypoints(Motion):
    """The C2 cubic spline through positions at times, at rest at both ends. tau = 1 is the whole way."""

    in_pieces = True
    kind: Literal["waypoints"]
    times: Times = Field(min_length=2, max_length=1000)
    positions: Places = Field(min_length=2, max_length=1000)

    @model_validator(mode="after")
    def _equal_lengths(self) -> Waypoints:
        if len(self.times) != len(self.positions):
            lengths = f"{len(self.times)} times, {len(self.positions)} positions"
            raise fault("times and positions must be equally many", received=lengths)
        return self

    @property
    def time_scale(self) -> float:
        return self.times[-1]

    @property
    def max_speed(self) -> float:
        knots, slopes, curvatures = self._derivatives()
        with np.errstate(divide="ignore", invalid="ignore"):
            part = curvatures[:-1] / (curvatures[:-1] - curvatures[1:])
        inner = knots[:-1] + np.where((part > 0.0) & (part < 1.0), part, 0.0) * np.diff(knots)
        return float(max(np.abs(slopes).max(), np.abs(self.path(inner).dS).max()))

    def range(self) -> tuple[float, float]:
        low, high = _spline_range(np.array(self.times), np.array(self.positions)[:, None])
        return float(low[0]), float(high[0])

    def checks(self, here: str, length: str) -> list[Check]:
        count = len(self.times)
        times = tuple(f"{here}.times.{index}" for index in range(count))
        places = tuple(f"{here}.positions.{index}" for index in range(count))
        return [
            Check(f"{here}.times.0", times[:1], lambda t: t == 0.0, "the first time must be 0", "0 s"),
            Check(f"{here}.times", times, _ascending, "times must ascend", "each later than the one before"),
            Check(f"{here}.positions", (length, *places, *times), _spline_touches, _NO_TOUCH, _TOUCHING),
        ]

    def law(self, tau: Array, side: Side) -> Path:
        spline = _spline_at_rest(np.array(self.times) / self.times[-1], np.array(self.positions))
        return Path(*(np.asarray(spline(tau, order), dtype=np.float64) for order in range(3)))

    def pieces(self, number: Number) -> Array:
        return spline_pieces(number, len(self.times), "positions")

    def _derivatives(self) -> tuple[Array, Array, Array]:
        knots = np.array(self.times) / self.times[-1]
        return knots, *self.path(knots)[1:]


class Sliding(Motion):
    """Slides on its own from a place, with a speed: its place is unknown (mechanics.md, section 12).

    friction: viscous, N s/m. coulomb: coefficient of dry friction, which sets in over the speed slip_speed (tanh).
    drive: force along the track, N.
    """

    slides = True
    kind: Literal["free"]
    start: Length
    speed: Speed = 0.0
    friction: Damping = Field(default=0.0, ge=0)
    coulomb: Dimensionless = Field(default=0.0, ge=0)
    slip_speed: Speed = Field(default=1e-3, gt=0)
    drive: Force = 0.0

    @property
    def time_scale(self) -> float:
        return 1.0

    @property
    def max_speed(self) -> float:
        return abs(self.speed)

    def range(self) -> tuple[float, float]:
        return self.start, self.start

    def checks(self, here: str, length: str) -> list[Check]:
        return [on_body(f"{here}.start", (f"{here}.start", length), "a carriage that slides starts on its body")]

    def law(self, tau: Array, side: Side) -> Path:
        """Where it starts: nothing else is known beforehand."""
        return Path(np.full_like(tau, self.start), np.zeros_like(tau), np.zeros_like(tau))


ALL = (Cruise, OutAndBack, Sinusoidal, Waypoints, PointToPoint, TimedMove, MinimumJerk, Standing, Sliding)
MOTIONS = kinds("motion", "wanderlast.motions", Motion, *ALL)
AnyMotion = Annotated[Motion, KindOf("motion", MOTIONS)]

_NO_TOUCH = "the path never touches its body"
_TOUCHING = "a path with a part between 0 and the body's length"


def _line_touches(length: Any, start: Any, end: Any) -> Any:
    return (np.maximum(start, end) > 0.0) & (np.minimum(start, end) < length)


def _ascending(*times: Any) -> Any:
    return reduce(np.logical_and, (later > earlier for earlier, later in pairwise(times)))


def _spline_at_rest(times: Array, positions: Array) -> Any:
    """The C2 cubic spline through positions (K,) or (K, V) at ascending times (K,), of zero slope at both ends."""
    return interpolate.CubicSpline(times, positions, bc_type="clamped")


def _spline_range(times: Array, positions: Array) -> tuple[Array, Array]:
    """Smallest and largest value of splines at rest at both ends: times (K,), positions (K, V) -> (V,), (V,).

    The extremes lie at knots or where the quadratic derivative of a piece is zero.
    """
    spline = _spline_at_rest(times, positions)
    low, high = positions.min(axis=0), positions.max(axis=0)
    c3, c2, c1, c0 = spline.c
    spans = np.diff(times)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(c2**2 - 3.0 * c3 * c1)
        stable = -(c2 + np.copysign(root, c2))
        for inner in (stable / (3.0 * c3), c1 / stable):
            value = ((c3 * inner + c2) * inner + c1) * inner + c0
            valid = (inner > 0.0) & (inner < spans)
            low = np.minimum(low, np.where(valid, value, np.inf).min(axis=0))
            high = np.maximum(high, np.where(valid, value, -np.inf).max(axis=0))
    return low, high


def _spline_touches(length: Any, *numbers: Any) -> Any:
    """Whether splines through positions at times, both as columns, have a part on the body."""
    columns = np.broadcast_arrays(length, *numbers)
    shape, flat = columns[0].shape, np.array([column.ravel() for column in columns], dtype=np.float64)
    places, times = np.split(flat[1:], 2)
    verdict = np.zeros(flat.shape[1], dtype=bool)
    sets, member = np.unique(times, axis=1, return_inverse=True)
    for index in range(sets.shape[1]):
        chosen = np.flatnonzero(np.ravel(member) == index)
        low, high = _spline_range(sets[:, index], places[:, chosen])
        verdict[chosen] = (high > 0.0) & (low < flat[0, chosen])
    return verdict.reshape(shape)
