"""The tables of a scene at one number of steps, built when they are first needed and shared by all its chunks."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from engine.kernels.layout import Alpha, Newmark, Observation, Ties
from engine.march.step_rules import free_steps
from engine.model.attachment import residual
from engine.model.scene_model import SceneModel
from engine.model.station_path import Along, ways
from engine.model.timeline import MOST_STATIONS, Segment, Timeline, Window, build_timeline, coarsened, refined
from engine.model.track import closed, force_rates, tie_rows, ties_of
from engine.observation import kinks, signals
from engine.observation.contact_forces import contacts_that_react
from engine.observation.readings import Sensor
from engine.observation.signals import Signal, build_sensors, last_signals, tabulate_missed, tabulate_watch
from engine.statics.static_response import Statics, left_out
from results_schema.arrays import Array, Counts

SegmentKey = tuple[float, float, int, tuple[bool, ...]]
Missed = list[Array]  # of one segment: residual flexibility between ties, and of the signals; or empty

KEPT_BYTES = 96 * 2**20  # tables kept per scene; those beyond are built again


class SegmentTable(NamedTuple):
    """What the march needs of one segment besides its lanes. numbers: of the scene's ties that count in it. rates: of
    `force_rates`, (2, C, N) at its beginning and end."""

    numbers: Counts
    ties: Ties
    watch: Observation
    unrecorded: Observation
    rates: Array

    @property
    def bytes(self) -> int:
        """Size in memory."""
        return sum(array.nbytes for part in self[1:] for array in part)


@dataclass(eq=False)
class SceneTables:
    """Timeline, signals and tables of a scene at ``steps`` per unit of scene time.

    refinement: every step of a timeline with so many times fewer steps is cut into so many. stops: what falls on step
    boundaries: events, and in whole runs where loads pass sensors whose influence lines have a kink there. companions:
    of the marches with the same steps that watch envelopes. kept_bytes: of tables that are kept for other marches or
    cycles; the memory of those that are not is used again, which takes an eighth of the time.
    """

    model: SceneModel
    steps: int
    window: Window
    readings: Literal["sensors", "contacts", "accelerations"] = "contacts"
    refinement: int = 1
    stops: Literal["events", "kinks"] = "events"
    companions: tuple[SceneTables, ...] = ()
    kept_bytes: int = KEPT_BYTES
    _kept: dict[SegmentKey, SegmentTable] = field(default_factory=dict, init=False)
    _next: dict[SegmentKey, SegmentTable] = field(default_factory=dict, init=False)
    _missed: dict[SegmentKey, Missed] = field(default_factory=dict, init=False)
    _held: int = field(default=0, init=False)  # bytes of those that are kept
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)

    @cached_property
    def timeline(self) -> Timeline:
        """The scene cut into segments."""
        free = free_steps(self.model)
        if self.refinement > 1:
            free = max(free, self.steps)  # more steps bring the whole history of a pair closer, free vibration too
        steps, free = (-(-wanted // self.refinement) for wanted in (self.steps, free))
        stops = kinks.stops(self.model, self.sensors) if self.stops == "kinks" and self.window == "whole" else ()
        return refined(build_timeline(self.model.riders, steps, self.window, free, stops), self.refinement)

    @cached_property
    def signals(self) -> tuple[Signal, ...]:
        """Sensors, then contact forces unless only sensors are read; between them every carriage's acceleration across,
        where that is read."""
        return self.sensors if self.readings == "sensors" else (*self.sensors, *contacts_that_react(self.model))

    @cached_property
    def coarser(self) -> SceneTables:
        """The same with half the steps, for a Richardson pair; ``refinement`` must be even."""
        if self.refinement % 2:
            raise ValueError(f"refinement: expected an even number, received {self.refinement}")
        half = self.steps // 2, self.refinement // 2
        found = replace(self, steps=half[0], refinement=half[1], companions=(), kept_bytes=KEPT_BYTES)
        found.timeline = coarsened(self.timeline, 2)
        return found

    @cached_property
    def sensors(self) -> tuple[Sensor, ...]:
        """The sensors among the signals, the study's first."""
        return build_sensors(self.model, self.model.carriages if self.readings == "accelerations" else ())

    @cached_property
    def kinks(self) -> tuple[kinks.Side, ...]:
        """Kinks of the study's sensors between the stations of a cycle."""
        own = self.sensors[: len(self.model.study.sensor)]
        return kinks.sides(self.model, own, self.timeline) if self.window == "last-cycle" else ()

    @cached_property
    def scheme(self) -> Newmark | Alpha:
        """The scheme's coefficients."""
        return self.model.scheme.coefficients

    @property
    def free_seconds(self) -> float:
        """How long the free vibration lasts, s."""
        periods = self.timeline.free_periods
        return periods * (2.0 * math.pi / self.model.first_omega) if periods > 0.0 else 0.0

    def table(self, segment: Segment) -> SegmentTable:
        """The table of a segment; a path that repeats itself is tabulated once per unit of scene time."""
        unit = np.floor(segment.start + 1e-9) if self.timeline.repeats else 0.0
        shifted = segment._replace(start=segment.start - unit, end=segment.end - unit)
        key = _key(shifted)
        with self._lock:
            found = self._kept.get(key)
            if found is None:
                if key not in self._next:
                    several = (shifted,) if self.timeline.repeats else self._from(segment)
                    built = self._build(several, self._missed_of(key))
                    self._next = dict(zip(map(_key, several), built, strict=True))
                found = self._next.pop(key)
                if self._held + found.bytes <= self.kept_bytes:
                    self._kept[key] = found  # and no other goes: marches ask for all in turn, the oldest first
                    self._held += found.bytes
        return found

    def _from(self, segment: Segment) -> tuple[Segment, ...]:
        """A segment and those that follow, as many as are tabulated at once: short ones take hardly longer together,
        and those at rest, which are the last ones, need one station each."""
        if segment.rests:
            return (segment,)
        following = [one for one in self.timeline.segments if one.first > segment.first and not one.rests]
        stations = np.cumsum([segment.steps + 1, *(one.steps + 1 for one in following)])
        return (segment, *following[: np.count_nonzero(stations[1:] <= MOST_STATIONS)])

    def _build(self, segments: Sequence[Segment], missed: Missed) -> list[SegmentTable]:
        along = ways(self.model, *segments)
        if segments[0].rests:
            along = tuple(way.at(0) for way in along)
        numbers = ties_of(self.model, np.any([segment.active for segment in segments], axis=0))
        if not missed:
            found = residual(self.model, along, numbers), tabulate_missed(self.model, self.signals, along, numbers)
            if self.timeline.repeats:
                missed.extend(found)
        else:
            found = missed[0], missed[1]
        watch = tabulate_watch(self.model, self.signals, along, found[1], left_out(self.model, self.signals, along))
        contacts = len(self.signals) - len(self.sensors)
        unrecorded, others = (
            (last_signals(watch, contacts), self.signals[-contacts:]) if contacts else (watch, self.signals)
        )
        rows = tie_rows(self.model, along, numbers, found[0])
        if segments[0].rests:
            stations = segments[0].steps + 1
            rows = rows.held(stations)
            watch, unrecorded = (signals.held(one, stations) for one in (watch, unrecorded))
        if len(segments) == 1:
            rates = self._rates(along, (0, -1))
            return [SegmentTable(numbers, closed(self.model, rows, self.scheme), watch, unrecorded, rates)]
        tables, ends = list[SegmentTable](), np.cumsum([segment.steps + 1 for segment in segments])
        rates = self._rates(along, np.stack([[0, *ends[:-1]], ends - 1], axis=1).reshape(-1).tolist())
        for number, (segment, part) in enumerate(zip(segments, map(slice, [0, *ends[:-1]], ends), strict=True)):
            own = ties_of(self.model, segment.active)
            places = np.searchsorted(numbers, own)
            ties = closed(self.model, rows.part(part, own), self.scheme)
            watched, unseen = (
                signals.along_part(whole, of, part, places, numbers.size)
                for whole, of in ((watch, self.signals), (unrecorded, others))
            )
            tables.append(SegmentTable(own, ties, watched, unseen, rates[2 * number : 2 * number + 2]))
        return tables

    def _rates(self, along: Along, stations: Sequence[int]) -> Array:
        """(stations, C, N) of `force_rates`, where the scheme asks for them; else (stations, 0, 0)."""
        if math.isinf(self.model.scheme.scaled_from):
            return np.zeros((len(stations), 0, 0))
        return force_rates(self.model, along, stations)

    def _missed_of(self, key: SegmentKey) -> Missed:
        """Where the responses that the kept modes miss are kept from cycle to cycle: they take much longer to tabulate
        than the rows, and much less memory. Empty where they are not known."""
        found = self._missed.get(key, [])
        if sum(part.nbytes for one in self._missed.values() for part in one) <= KEPT_BYTES:
            self._missed[key] = found
        return found

    def forget(self) -> None:
        """Drop the tables, when no chunk needs them any more."""
        with self._lock:
            self._kept.clear()
            self._held = 0
            self._next.clear()
            self._missed.clear()
        for companion in self.companions:
            companion.forget()
        self.__dict__.pop("coarser", None)

    @property
    def watches_rest(self) -> bool:
        """Whether it is told how far sensors swing when all carriages have come to rest or left."""
        return self.model.study.output.residual and bool(self.at_rest.size)

    @cached_property
    def at_rest(self) -> Array:
        """(1,) a moment in that part of the run, by its count; none where the run has no such part."""
        last = self.timeline.segments[-1]
        return np.array([last.first + 0.5 * last.steps] if last.rests else [])

    @cached_property
    def statics(self) -> Statics:
        """Static readings of the sensors while the carriages go their way."""
        return Statics(self.model, self.timeline, self.sensors)

    @cached_property
    def silent(self) -> list[int]:
        """Numbers of the study's sensors that read nothing but rounding."""
        own = self.sensors[: len(self.model.study.sensor)]
        return [j for j, sensor in enumerate(own) if sensor.silent(self.model)]

    @cached_property
    def static_scales(self) -> Array:
        """(sensors,) a sensor's largest static reading per unit force anywhere on its body; of a rate that of the
        displacement times powers of the highest frequency kept."""
        highest = np.array([self.model.bodies[sensor.body].modal.omega.max() for sensor in self.sensors])
        orders = np.array([sensor.offset_order for sensor in self.sensors])
        return np.asarray(self.statics.largest_influences * highest**orders)


def _key(segment: Segment) -> SegmentKey:
    return round(segment.start, 12), round(segment.end, 12), segment.steps, segment.active
