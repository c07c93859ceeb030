"""What every motion has: a path in normalised time with exact derivatives.

Every motion is a path S(tau), tau = t/time_scale, that does not depend on its speed or frequency (mechanics.md,
section 3). It lasts from tau = 0 to `duration`; before, the carriage waits at the start; afterwards it is gone.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, Field

from engine.study_file.checks import Check, on_body
from engine.study_file.spec import Noun, SpecOfKind
from engine.study_file.units import Length, Time

if TYPE_CHECKING:
    from engine.scene.motions.of_joints import Number

Array = NDArray[np.float64]
Side = Literal["left", "right"]

PROBED = 4000  # places of a motion per unit of its own time, between which it passes another one once at most
ROUNDING = 1e-12  # tau may pass the end by this part of the duration, as sums of steps do


class Path(NamedTuple):
    """Position S in m and its derivatives by tau, arrays of one shape; NaN where the carriage is gone."""

    S: Array
    dS: Array
    ddS: Array


class Reversal(NamedTuple):
    """An instant change of the speed: tau, and dS/dtau in m before and after."""

    tau: float
    before: float
    after: float


class Legs(NamedTuple):
    """The stroke of a motion that comes back: from start to end, m; the parts of it at either end in which the speed
    changes; tau at the beginning and end of the constant speed on the way there (back: 1 minus these)."""

    start: float
    end: float
    turn: float
    cruise: tuple[float, float]


class Motion(SpecOfKind):
    """Base of all motions. Positions in m along the body's track, tau without unit."""

    period: ClassVar[float | None] = None  # tau after which the path repeats
    pace: ClassVar[Literal["speed", "frequency"] | None] = None  # the key of a number that all its speeds grow with
    passes: ClassVar[bool] = False  # whether the carriage is on the body while it moves only
    slides: ClassVar[bool] = False  # whether its place is an unknown of the equations of motion
    is_harmonic: ClassVar[bool] = False  # whether it swings as a sine about the middle of its range
    ends: ClassVar[tuple[str, ...]] = ()  # keys of where its way begins and ends, where it is on the body all the time
    in_pieces: ClassVar[bool] = False  # whether bodies in frames that move know it, by `pieces`

    @property
    @abstractmethod
    def time_scale(self) -> float:
        """Seconds per unit of tau."""

    @property
    def smoothed_by(self) -> str:
        """The key of a limit that is not set and with which its acceleration would not jump; "" where there is none."""
        return ""

    @property
    def duration(self) -> float:
        """Length of the motion in tau."""
        return 1.0

    @property
    @abstractmethod
    def max_speed(self) -> float:
        """Largest |dS/dtau| in m."""

    @abstractmethod
    def range(self) -> tuple[float, float]:
        """Smallest and largest position in m."""

    @abstractmethod
    def checks(self, here: str, length: str) -> list[Check]:
        """Conditions on this motion at the dotted key `here` on a body whose length has the key `length`."""

    @abstractmethod
    def law(self, tau: Array, side: Side) -> Path:
        """The law for 0 <= tau <= duration."""

    def pieces(self, number: Number) -> Array:
        """(V, pieces, 10) place in m over the time in s, its columns as in `engine.scene.motions.of_joints`, for
        variants whose numbers are asked by key; the carriage stays where the last one ends."""
        raise NotImplementedError

    @property
    def rests_from(self) -> float:
        """tau from which it is at rest where it ends."""
        return self.duration

    @property
    def free_vibration(self) -> float:
        """First periods of the body for which free vibration is marched afterwards."""
        return 0.0

    def passing(self, place: float) -> tuple[float, ...]:
        """tau at which it passes a place of its track, ascending; not where it begins, ends or turns back there."""
        return _passing(self, place)

    @property
    def reached(self) -> Mapping[str, float]:
        """What it reaches of the limits that it has, by their keys."""
        return {}

    @property
    def legs(self) -> Legs | None:
        """Its ways there and back at constant speed but for their ends; it has the keys of an out-and-back then."""
        return None

    def breaks(self) -> Array:
        """tau inside (0, duration), ascending, where dS or ddS jumps."""
        return np.array([reversal.tau for reversal in self.reversals()])

    def reversals(self) -> tuple[Reversal, ...]:
        """The breaks at which dS jumps."""
        return ()

    def path(self, tau: ArrayLike, side: Side = "right") -> Path:
        """The path at any tau; at a break the limit from `side`, at 0 and at the end the limit from inside.

        >>> from engine.scene.motions.along_bodies import Cruise
        >>> Cruise(kind="cruise", start=1.0, end=3.0, speed=5.0).path([-1.0, 0.0, 0.5, 1.0, 2.0]).S
        array([ 1.,  1.,  2.,  3., nan])
        """
        times = np.asarray(tau, dtype=np.float64)
        inside = self.law(np.clip(times, 0.0, self.duration), side)
        waiting, gone = times < 0.0, times > self.duration * (1.0 + ROUNDING)
        if not (waiting.any() or gone.any()):
            return inside
        moves = (np.where(waiting, 0.0, part) for part in inside[1:])
        return Path(*(np.where(gone, np.nan, part) for part in (inside.S, *moves)))

    def path_on(self, tau: ArrayLike, segment_start: float, segment_end: float) -> Path:
        """The path on a segment without a break inside, with one-sided limits at the segment's ends.

        tau outside the segment is evaluated at the nearer end.
        """
        times = np.minimum(np.maximum(np.asarray(tau, dtype=np.float64), segment_start), segment_end)
        found, last = self.law(times, "right"), times == segment_end
        if segment_end < self.duration and last.any():  # at its own end a motion has one limit
            for part, at_end in zip(found, self.law(times[last], "left"), strict=True):
                part[last] = at_end
        return found


DIRECTIONS = {"forward": 1, "backward": -1}


def read_direction(value: Any) -> Any:
    """A word for a direction as its number; anything else unchanged."""
    return DIRECTIONS.get(value, value) if isinstance(value, str) else value


_WORDS = Literal[1, -1, "forward", "backward"]
Direction = Annotated[
    Literal[1, -1], BeforeValidator(read_direction, json_schema_input_type=_WORDS), Noun('"forward" or "backward"')
]


class BetweenPlaces(Motion):
    """Base of the motions between two places: from `start` to `end`, or the other way round where `direction` is -1."""

    start: Length
    end: Length
    direction: Direction = 1

    @property
    def way(self) -> tuple[float, float]:
        """Where it sets off, and where that way ends, m."""
        return (self.start, self.end) if self.direction > 0 else (self.end, self.start)

    def range(self) -> tuple[float, float]:
        return min(self.start, self.end), max(self.start, self.end)


class FromRestToRest(BetweenPlaces):
    """From rest at the start to rest at the end, then `dwell` seconds of rest there. tau = 1 is all of it."""

    ends = ("start", "end")
    in_pieces = True
    kind: str
    dwell: Time = Field(default=0.0, ge=0)

    @property
    @abstractmethod
    def seconds(self) -> float:
        """How long it moves, s."""

    @property
    def time_scale(self) -> float:
        return self.seconds + self.dwell

    def checks(self, here: str, length: str) -> list[Check]:
        start, end = f"{here}.start", f"{here}.end"
        what = f"a {self.kind} path must stay on its body"
        return [two_places(start, end), *(on_body(key, (key, length), what) for key in (start, end))]


def both_places(number: Number) -> tuple[Array, Array]:
    """(V,) each where variants set off, and where that way ends, m (`BetweenPlaces.way`)."""
    start, end, forward = number("start"), number("end"), number("direction") > 0.0
    return np.where(forward, start, end), np.where(forward, end, start)


def two_places(start: str, end: str) -> Check:
    """The condition that a stroke, by the keys of its ends, has a length."""
    what, remedy = "start and end are the same place", 'kind = "standing" with `at` stays there'
    return Check(end, (start, end), lambda a, b: a != b, what, "two places", remedy=remedy)


@lru_cache(maxsize=256)
def _passing(motion: Motion, place: float) -> tuple[float, ...]:
    low, high = motion.range()
    if not low < place < high:
        return ()
    from scipy.optimize import brentq

    tau = np.linspace(0.0, motion.duration, PROBED * math.ceil(motion.duration) + 1)
    beyond = np.signbit(motion.path(tau).S - place)
    return tuple(
        float(brentq(lambda t: float(motion.path(t).S) - place, tau[i], tau[i + 1], xtol=1e-15))
        for i in np.flatnonzero(np.diff(beyond))
    )
