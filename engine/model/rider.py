"""Who rides where, in normalised time: a way along a body, the events on it, and where it touches the body."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from engine.scene.motions.base import PROBED, Motion, Path
from results_schema.arrays import Array

AT_END = 1e-9  # of the body's length: a contact beyond an end by no more touches it, for its offset is rounded


@dataclass(frozen=True)
class Rider:
    """A way in scene time: a carriage's motion on a body of a length (m), started late, at its own pace.

    pace: units of the motion's own tau per unit of scene time. delay: scene time at which it sets off. offset: m by
    which a contact of the carriage is ahead of it.
    """

    motion: Motion
    length: float
    pace: float = 1.0
    delay: float = 0.0
    offset: float = 0.0

    @property
    def end(self) -> float:
        """Scene time at which the motion ends."""
        return self.delay + self.motion.duration / self.pace

    @property
    def rests_from(self) -> float:
        """Scene time from which it is at rest where it ends, or gone."""
        return self.delay + self.motion.rests_from / self.pace

    @property
    def stays(self) -> bool:
        """Whether the carriage stands on its place before and after its motion; a cruise only passes."""
        return not self.motion.passes

    @property
    def top_speed(self) -> float:
        """Largest |dS/dtau| per unit of scene time, m."""
        return self.motion.max_speed * self.pace

    def path(self, tau: Array, start: float, end: float) -> Path:
        """Position and its derivatives by scene time on a segment without a break inside, one-sided at its ends."""
        first, last = (self._own(t) for t in (start, end))
        middle = 0.5 * (first + last)  # and not an end, which rounding may put on the other side
        if not 0.0 < middle < self.motion.duration:
            place = self.motion.path(0.0 if middle <= 0.0 else self.motion.duration).S + self.offset
            return Path(np.full_like(tau, place), np.zeros_like(tau), np.zeros_like(tau))
        own = first + (tau - start) / (end - start) * (last - first)
        found = self.motion.path_on(own, max(first, 0.0), min(last, self.motion.duration))
        return Path(found.S + self.offset, found.dS * self.pace, found.ddS * self.pace**2)

    def path_on_body(self, tau: Array, start: float, end: float) -> Path:
        """`path` on a segment on which it is on the body, which rounding must not leave."""
        path = self.path(tau, start, end)
        return path._replace(S=np.clip(path.S, 0.0, self.length))

    def _own(self, tau: float) -> float:
        """The motion's own time; exactly that of an event where rounding puts it beside one."""
        own = (tau - self.delay) * self.pace
        place = bisect.bisect_left(self._own_events, own)
        closest = min(self._own_events[max(0, place - 1) : place + 1], key=lambda event: abs(event - own))
        return closest if abs(closest - own) <= 1e-9 * self.motion.duration else own

    @cached_property
    def _own_events(self) -> tuple[float, ...]:
        """The motion's own times at which its law changes, ascending."""
        return (0.0, *map(float, self.motion.breaks()), self.motion.duration)

    def touches(self, start: float, end: float) -> bool:
        """Whether the carriage is on the body between two neighbouring events."""
        middle = 0.5 * (start + end)
        if not self.stays and not self.delay <= middle <= self.end:
            return False
        if not self.leaves:
            return True
        place = float(self.path(np.array([middle]), start, end).S[0])
        return -self._slack <= place <= self.length + self._slack

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest place along the body, m."""
        low, high = self.motion.range()
        return low + self.offset, high + self.offset

    @cached_property
    def leaves(self) -> bool:
        """Whether it passes an end of the body."""
        return self.range[0] < -self._slack or self.range[1] > self.length + self._slack

    @property
    def _slack(self) -> float:
        """m by which a contact may be beyond an end that it touches; a carriage itself is where its motion says."""
        return AT_END * self.length if self.offset else 0.0

    @cached_property
    def speed_jumps(self) -> tuple[Array, Array]:
        """Scene times, ascending, at which the speed of a carriage on its place jumps, and by how much per tau: at
        instant reversals, and where one that stays sets off or stops at once."""
        found = [(reversal.tau, reversal.after - reversal.before) for reversal in self.motion.reversals()]
        if self.stays:
            ends = self.motion.path(np.array([0.0, self.motion.duration])).dS
            found = [(0.0, float(ends[0])), *found, (self.motion.duration, -float(ends[1]))]
        jumps = np.array([jump for jump in found if jump[1] != 0.0]).reshape(-1, 2)
        return self.delay + jumps[:, 0] / self.pace, jumps[:, 1] * self.pace

    def is_jolted(self, alone: bool) -> bool:
        """Whether its speed jumps while anything is computed; where it is alone the scene ends with its motion."""
        return any(0.0 < t < self.end or not (alone or t == 0.0) for t in self.speed_jumps[0])

    def events(self) -> Iterator[float]:
        """Scene times that must be step boundaries, in no order."""
        yield from (self.delay, self.end)
        for tau in (*self.motion.breaks(), *self._crossings()):
            yield self.delay + float(tau) / self.pace

    def _crossings(self) -> Iterator[float]:
        """The motion's own times at which it passes an end of the body."""
        low, high = self.range
        beyond = ((0.0, low < -self._slack), (self.length, high > self.length + self._slack))
        for place, passed in beyond:
            if passed:
                yield from self.motion.passing(place - self.offset)

    def passes(self, place: float) -> Iterator[float]:
        """Scene times at which it passes a place of the body."""
        for tau in self.motion.passing(place - self.offset):
            yield self.delay + tau / self.pace

    def meets(self, other: Rider) -> tuple[float, ...]:
        """Scene times at which it passes another one on the same body."""
        return _meetings(self, other)

    def places(self, times: Array) -> Array:
        """Where it is at scene times, m; before and after its motion where that begins and ends."""
        own = np.clip((times - self.delay) * self.pace, 0.0, self.motion.duration)
        return self.motion.path(own).S + self.offset


@lru_cache(maxsize=256)
def _meetings(one: Rider, other: Rider) -> tuple[float, ...]:
    from scipy.optimize import brentq

    def ahead(times: Array) -> Array:
        return one.places(times) - other.places(times)

    longest = max(one.motion.duration, other.motion.duration)
    times = np.linspace(0.0, max(one.end, other.end), PROBED * math.ceil(longest) + 1)
    gap = ahead(times)
    apart = np.abs(gap) > AT_END * one.length  # those side by side all the way never pass
    times, gap = times[apart], gap[apart]
    changes = np.flatnonzero(np.diff(np.signbit(gap)))
    return tuple(float(brentq(ahead, times[i], times[i + 1], xtol=1e-15)) for i in changes)
