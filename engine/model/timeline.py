"""The scene in normalised time: which events cut it into segments, how many steps each gets.

Scene time tau counts in units of the first carriage's time scale, one passage or one cycle, so that all variants of a
shared scene step through the same stations, each at its own pace (mechanics section 3). An event (a carriage sets
off, enters, leaves, reverses at an instant, stops) falls on a step boundary.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.model.rider import Rider
from engine.scene.motions.base import Path
from results_schema.arrays import Array, Counts

Window = Literal["whole", "last-cycle"]

MOST_STATIONS = 4096  # of one table; longer segments are marched in slices, so memory does not grow with the steps
_SAME = 1e-12  # events closer than this part of the scene are one


class Impact(NamedTuple):
    """A carriage that arrives at the beginning of a segment with a speed, or whose speed jumps there (m per tau)."""

    rider: int
    arrives: bool
    speed: float


class Segment(NamedTuple):
    """Steps between two events, or a slice of them.

    start, end: scene time; for free vibration both are the scene's end, and its duration follows from the body.
    first: count of the scene's stations at which it begins. active: per rider, whether it is in contact.
    fresh: an event precedes it, so accelerations are solved for anew. recorded: whether extremes count. rests: all
    carriages are at rest where they end, or gone. jumps: whether it begins, and ends, where a load passes a place at
    which readings may jump.
    """

    start: float
    end: float
    steps: int
    first: int
    active: tuple[bool, ...]
    fresh: bool
    strikes: tuple[Impact, ...]
    recorded: bool
    free: bool
    rests: bool
    jumps: tuple[bool, bool]

    @property
    def step(self) -> float:
        """Scene time per step."""
        return (self.end - self.start) / self.steps


@dataclass(frozen=True)
class Timeline:
    """All segments of a scene for a number of steps per unit of scene time.

    window: first and last count of the recorded part. repeats: the path repeats itself every unit of scene time.
    free_periods: first periods of free vibration after the last carriage.
    """

    riders: tuple[Rider, ...]
    segments: tuple[Segment, ...]
    window: tuple[int, int]
    repeats: bool
    free_periods: float

    @property
    def steps(self) -> int:
        """All steps from the beginning to the end."""
        last = self.segments[-1]
        return last.first + last.steps

    def moments(self, counts: Array | Counts) -> tuple[NDArray[np.int64], Array]:
        """Segment and scene time of stations by their count; a boundary belongs to the segment that ends there."""
        firsts, starts, steps, _ = self._columns
        index = np.maximum(np.searchsorted(firsts, counts, side="left") - 1, 0)
        return index, starts[index] + (counts - firsts[index]) * steps[index]

    def counts_at(self, tau: Array) -> Array:
        """Fractional counts of scene times before any free vibration, between their neighbouring stations."""
        firsts, starts, steps, _ = self._columns
        driven = [not segment.free for segment in self.segments]
        index = np.maximum(np.searchsorted(starts[driven], tau, side="right") - 1, 0)
        return np.asarray(firsts[index] + (tau - starts[index]) / steps[index])

    @cached_property
    def _columns(self) -> tuple[Counts, Array, Array, NDArray[np.bool_]]:
        """First count, start and step of every segment, and (segments, riders) who is in contact."""
        firsts, starts, steps = ([getattr(s, name) for s in self.segments] for name in ("first", "start", "step"))
        active = np.array([segment.active for segment in self.segments])
        return np.array(firsts, dtype=np.int64), np.array(starts), np.array(steps), active

    def motion(self, rider: int, counts: Array | Counts) -> Path:
        """Place of a rider (m) and its derivatives by scene time at stations by their count; NaN where it is off the
        body or the count is negative."""
        found = Path(*(np.full(counts.shape, np.nan) for _ in range(3)))
        index, tau = self.moments(counts)
        firsts, _, _, active = self._columns
        on = active[:, rider]
        following = np.minimum(index + 1, len(self.segments) - 1)
        index = np.where(~on[index] & (counts == firsts[following]), following, index)  # an arrival
        shown = (counts >= 0) & on[index]
        for number in np.flatnonzero(np.bincount(index[shown], minlength=len(self.segments))):
            segment = self.segments[number]
            here = shown & (index == number)
            path = self.riders[rider].path_on_body(tau[here], segment.start, segment.end)
            for part, values in zip(found, path, strict=True):
                part[here] = values
        return found

    def positions(self, rider: int, counts: Array | Counts) -> Array:
        """Only the place of a rider, as in `motion`."""
        return self.motion(rider, counts).S


def build_timeline(
    riders: tuple[Rider, ...], steps: int, window: Window, free_steps: int = 200, stops: Iterable[float] = ()
) -> Timeline:
    """Cut the scene at its events and spread the steps.

    steps: wanted per unit of scene time. window: what is recorded. free_steps: per first period of free vibration.
    stops: further scene times that must be step boundaries, at which nothing happens.

    >>> from engine.scene.motions.along_bodies import Cruise
    >>> bed = Cruise(kind="cruise", start=-1.0, end=3.0, speed=1.0)
    >>> [(s.start, s.steps, s.active) for s in build_timeline((Rider(bed, length=2.0),), 8, "whole").segments]
    [(0.0, 2, (False,)), (0.25, 4, (True,)), (0.75, 2, (False,))]
    """
    return build_grid(riders, steps, window, free_steps, stops).timeline(1, 1)


@dataclass(frozen=True)
class Grid:
    """A scene cut at its events with some steps in every part. All timelines on it cut each of these into equal ones,
    so that marches with different numbers of steps meet at its stations.

    parts: without steps of their own; counts: steps of every part; free: of the free vibration after the last one.
    """

    riders: tuple[Rider, ...]
    parts: tuple[Segment, ...]
    counts: tuple[int, ...]
    free: int
    free_periods: float

    def timeline(self, by: int, free_by: int) -> Timeline:
        """The timeline with ``by`` steps in one of the grid's, and ``free_by`` in one of the free vibration."""
        segments: list[Segment] = []
        for part, count in zip(self.parts, self.counts, strict=True):
            segments += _stepped(part, count * by, segments[-1].first + segments[-1].steps if segments else 0)
        if self.free:
            end = self.parts[-1].end
            parked = tuple(rider.stays and rider.touches(end, end) for rider in self.riders)
            segments += _free_vibration(segments[-1]._replace(active=parked), self.free * free_by)
        kept = [segment for segment in segments if segment.recorded]
        span = (kept[0].first, kept[-1].first + kept[-1].steps)
        repeats = all(r.motion.period == 1.0 and r.pace == 1.0 and r.delay == 0.0 for r in self.riders)
        return Timeline(self.riders, tuple(segments), span, repeats, self.free_periods)

    def stations(self, by: int, free_by: int, most: int) -> Counts:
        """The grid's own stations in the recorded part, by their count on such a timeline; of more than about ``most``
        some, the ends of its parts among them."""
        pieces = [(count, by, part.recorded) for part, count in zip(self.parts, self.counts, strict=True)]
        if self.free:
            pieces.append((self.free, free_by, self.parts[-1].recorded))
        every = max(1, sum(count for count, _, recorded in pieces if recorded) // most)
        found, reached = [], 0
        for count, cut, recorded in pieces:
            if recorded:
                found += [reached + cut * np.arange(0, count, every), np.array([reached + cut * count])]
            reached += cut * count
        return np.unique(np.concatenate(found))


def build_grid(
    riders: tuple[Rider, ...], steps: int, window: Window, free_steps: int = 200, stops: Iterable[float] = ()
) -> Grid:
    """Cut the scene at its events; otherwise as `build_timeline`."""
    parts = _parts(riders, window, tuple(stops))
    counts = tuple(max(1, math.ceil(steps * (part.end - part.start) - 1e-9 * steps)) for part in parts)
    free = max(r.motion.free_vibration for r in riders)
    return Grid(riders, parts, counts, math.ceil(free * free_steps) if free > 0.0 else 0, free)


def refined(timeline: Timeline, by: int) -> Timeline:
    """The same timeline with every step cut into ``by`` equal ones: its station n is the new station n times ``by``.

    >>> from engine.scene.motions.along_bodies import Cruise
    >>> whole = build_timeline((Rider(Cruise(kind="cruise", start=0.0, end=1.0, speed=1.0), 1.0),), 5, "whole")
    >>> refined(whole, 2).window
    (0, 10)
    """
    segments = tuple(s._replace(steps=s.steps * by, first=s.first * by) for s in timeline.segments)
    first, last = timeline.window
    return replace(timeline, segments=segments, window=(first * by, last * by))


def coarsened(timeline: Timeline, by: int) -> Timeline:
    """The same timeline with ``by`` steps in one; every segment must have a multiple of so many. Raises ValueError."""
    if any(segment.steps % by for segment in timeline.segments):
        raise ValueError(f"by: expected a divisor of all segments' steps, received {by}")
    segments = tuple(s._replace(steps=s.steps // by, first=s.first // by) for s in timeline.segments)
    first, last = timeline.window
    return replace(timeline, segments=segments, window=(first // by, last // by))


def _stepped(part: Segment, total: int, count: int) -> Iterator[Segment]:
    """Slices of a part with so many steps in all, counted from ``count``; an event precedes the first."""
    bounds = _slices(total)
    at = [part.start + (part.end - part.start) * n / total for n in bounds[:-1]] + [part.end]
    for i, (first, last) in enumerate(pairwise(bounds)):
        fresh, strikes = (part.fresh, part.strikes) if i == 0 else (False, ())
        own = part._replace(start=at[i], end=at[i + 1], steps=last - first, first=count + first)
        jumps = part.jumps[0] and i == 0, part.jumps[1] and last == total
        yield own._replace(fresh=fresh, strikes=strikes, jumps=jumps)


@lru_cache(maxsize=64)
def _parts(riders: tuple[Rider, ...], window: Window, stops: tuple[float, ...]) -> tuple[Segment, ...]:
    """The scene cut at its events, its cycles and ``stops``; a study asks for the same with many numbers of steps."""
    leading, end, recorded = riders[0], max(rider.end for rider in riders), _recorded(riders, window)
    hard = _merged([0.0, end, *(t for rider in riders for t in rider.events())], end)
    seams, passed = list(stops), sorted(stops)
    if leading.motion.period is not None:
        seams += [leading.delay + k / leading.pace for k in range(1, math.ceil(leading.motion.duration))]
    rest = max(rider.rests_from for rider in riders)
    found: list[Segment] = []
    before = tuple(False for _ in riders)
    for start, stop in pairwise(_merged([*hard, *seams, *recorded], end)):
        active = tuple(rider.touches(start, stop) for rider in riders)
        fresh = _near(hard, start, end)
        seen = recorded[0] - _SAME * end <= start < recorded[1] - _SAME * end
        strikes = tuple(_strikes(riders, active, before, (start, stop))) if fresh else ()
        rests = start >= rest - _SAME * end
        jumps = (_near(passed, start, end), _near(passed, stop, end))
        found.append(Segment(start, stop, 0, 0, active, fresh, strikes, seen, False, rests, jumps))
        before = active
    return tuple(found)


def _recorded(riders: tuple[Rider, ...], window: Window) -> tuple[float, float]:
    """Scene times between which something is recorded."""
    leading = riders[0]
    if window == "last-cycle" and leading.motion.period is not None:
        return leading.end - leading.motion.period / leading.pace, leading.end
    return 0.0, max(rider.end for rider in riders)


def _free_vibration(last: Segment, total: int) -> list[Segment]:
    """Slices after the end of the scene; who stands on a body and what is recorded is as ``last`` says."""
    count, still = (
        last.first + last.steps,
        last._replace(start=last.end, strikes=(), free=True, rests=True, jumps=(False, False)),
    )
    return [
        still._replace(steps=stop - first, first=count + first, fresh=first == 0)
        for first, stop in pairwise(_slices(total))
    ]


def _near(times: list[float], time: float, end: float) -> bool:
    """Whether a time is one of some ascending times."""
    place = bisect.bisect(times, time)
    return any(abs(time - near) <= _SAME * end for near in times[max(0, place - 1) : place + 1])


def _merged(times: list[float], end: float) -> list[float]:
    """Ascending times within the scene, those that are the same but for rounding once."""
    found: list[float] = []
    for time in sorted(min(max(t, 0.0), end) for t in times):
        if not found or time - found[-1] > _SAME * end:
            found.append(time)
    return found


def _slices(total: int) -> list[int]:
    """Boundaries of nearly equal slices that fit a table."""
    parts = math.ceil(total / MOST_STATIONS)
    return [total * part // parts for part in range(parts + 1)]


def _strikes(
    riders: tuple[Rider, ...], active: tuple[bool, ...], before: tuple[bool, ...], ends: tuple[float, float]
) -> Iterator[Impact]:
    """Arrivals and jumps of speed at the beginning of a segment; at time 0 the initial state holds just after."""
    start, stop = ends
    for number, rider in enumerate(riders):
        if not active[number]:
            continue
        if not before[number]:
            if start > 0.0:
                yield Impact(number, True, float(rider.path(np.array([start]), start, stop).dS[0]))
            continue
        times, jumps = rider.speed_jumps
        place = int(np.searchsorted(times, start))
        for near in range(max(0, place - 1), min(place + 1, times.size)):
            if abs(times[near] - start) <= _SAME * rider.end:
                yield Impact(number, False, float(jumps[near]))
