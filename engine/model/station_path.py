"""Where every rider is at the stations of a segment.

Derivatives by time are counted per step: ds = S' h and dds = S'' h^2 in scene time (mechanics section 3).
"""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Direction, ModalBody
    from engine.model.rider import Rider
    from engine.model.scene_model import SceneModel
    from engine.model.timeline import Segment, Timeline


BESIDE = 1e-12  # of the length: a segment that ends where readings jump is read so far inside of it
NEAR = 1e-12  # of the length: what is beyond an end by no more is at the end


@dataclass(frozen=True, eq=False)
class StationPath:
    """One rider along one segment, station by station: place (m), its first and second change per step, and whether
    it touches the body; where it does not, its rows are zero. here: at which stations, where that differs. highest:
    derivative of the mode shapes that its ties read."""

    s: Array
    ds: Array
    dds: Array
    active: bool
    here: NDArray[np.bool_] | None = None
    highest: int = 0
    _shapes: dict[tuple[int, Direction], Array] = field(default_factory=dict)

    @property
    def on(self) -> NDArray[np.bool_]:
        """(S,) at which stations it touches."""
        return np.full(self.s.size, self.active) if self.here is None else self.here

    def at(self, *stations: int) -> StationPath:
        """It at some stations alone."""
        own = list(stations)
        here = None if self.here is None else self.here[own]
        return replace(self, s=self.s[own], ds=self.ds[own], dds=self.dds[own], here=here, _shapes={})

    def shape(self, body: ModalBody, derivative: int = 0) -> Array:
        """(S, N) mode shapes of its body along the way."""
        return np.asarray(self.shapes(body, derivative)[derivative])

    def shapes(self, body: ModalBody, highest: int, direction: Direction = "load") -> Array:
        """(``highest`` + 1 or more, S, N) the same in a direction with their derivatives, evaluated together once."""
        found = self._shapes.get((id(body), direction))
        if found is None or len(found) <= highest:
            found = body.shapes_in(direction).derivatives(self.s, range(max(highest, self.highest) + 1))
            self._shapes[id(body), direction] = found
        return found


Along = tuple[StationPath, ...]  # all riders along some stations


def ways(model: SceneModel, *segments: Segment) -> Along:
    """The ways of all riders at the stations 0..steps of segments, one after the other."""
    times, found = [station_times(segment) for segment in segments], list[StationPath]()
    for number, (rider, highest) in enumerate(zip(model.riders, _highest(model), strict=True)):
        parts = [
            _way(rider, span, segments[own], np.concatenate(times[own]), highest)
            for span, own in _spans(rider, number, segments)
        ]
        found.append(_joined(parts))
    return tuple(found)


class Span(NamedTuple):
    """Scene time between two events of a rider, and whether it is on its body; nothing matters where it is not."""

    start: float
    end: float
    active: bool


NOWHERE = Span(0.0, 0.0, active=False)


def _spans(rider: Rider, number: int, segments: Sequence[Segment]) -> list[tuple[Span, slice]]:
    """Neighbouring segments, by their places, between the same events of a rider: the path along them is one."""
    events, found = sorted(rider.events()), list[Span]()
    for segment in segments:
        place = bisect.bisect(events, 0.5 * (segment.start + segment.end))
        inside = 0 < place < len(events) and not segment.free
        ends = (events[place - 1], events[place]) if inside else (segment.start, segment.end)
        found.append(Span(*ends, active=True) if segment.active[number] else NOWHERE)
    firsts = [n for n, span in enumerate(found) if n == 0 or span != found[n - 1]]
    return [(found[n], slice(n, end)) for n, end in zip(firsts, [*firsts[1:], len(found)], strict=True)]


def station_times(segment: Segment) -> Array:
    """Scene times of the stations of a segment."""
    tau = segment.start + np.arange(segment.steps + 1, dtype=np.float64) * segment.step
    tau[-1] = segment.end
    return tau


def _joined(parts: Sequence[StationPath]) -> StationPath:
    """One rider along several segments."""
    if len(parts) == 1:
        return parts[0]
    s, ds, dds, on = (np.concatenate([getattr(part, name) for part in parts]) for name in ("s", "ds", "dds", "on"))
    return StationPath(s, ds, dds, bool(on.any()), None if on.all() or not on.any() else on, parts[0].highest)


def _highest(model: SceneModel) -> list[int]:
    """Per rider, the highest derivative that its ties read: convection needs two, dampers one."""
    found = [2 if carriage.inertia == "mass" else 0 for carriage in model.carriages] + [0] * len(model.contacts)
    for spring in model.springs:
        found[spring.rider] = max(found[spring.rider], 2 if spring.rigid else int(spring.damped))
    return found


def standing(timeline: Timeline, counts: Array | Counts) -> Along:
    """All riders at rest where they are at stations by their count; ``active`` says whether one is on its body at any
    of them."""
    found = []
    for rider in range(len(timeline.riders)):
        place = timeline.positions(rider, counts)
        here, still = np.isfinite(place), np.zeros_like(place)
        found.append(StationPath(np.where(here, place, 0.0), still, still, bool(here.any()), here))
    return tuple(found)


def frozen(model: SceneModel, places: Array) -> Along:
    """The ways of all riders at rest, with the first carriage at `places` (S,) in m along its track, the other axles of
    its train behind it, and every other one where it starts; whoever is off the body does not touch it."""
    along = [in_row(model, carriage.name, places) for carriage in model.carriages]
    owners = {load.rider: number for number, carriage in enumerate(model.carriages) for load in carriage.loads}
    still, found = np.zeros_like(places), []
    for number, rider in enumerate(model.riders):
        place = along[number if number < len(along) else owners[number]] + rider.offset
        here = (place >= -NEAR * rider.length) & (place <= rider.length * (1.0 + NEAR))
        found.append(
            StationPath(np.where(here, np.clip(place, 0.0, rider.length), 0.0), still, still, bool(here.any()), here)
        )
    return tuple(found)


def in_row(model: SceneModel, name: str, places: Array) -> Array:
    """(S,) where a carriage stands while the first is at `places`: axles keep their distances."""
    trains, first, carriage = model.study.axles, model.carriages[0].name, model.study.carriage[name]
    start, end = (float(carriage.motion.path(tau).S) for tau in (0.0, carriage.motion.duration))
    behind = np.sign(end - start) * (carriage.headway or 0.0) if name in trains else 0.0
    if name == first or (name in trains and trains[name] == trains.get(first)):
        behind += float(model.study.carriage[first].motion.path(0.0).S) - start
        return np.asarray(places - behind)
    return np.full_like(places, start - behind)


def _way(rider: Rider, span: Span, segments: Sequence[Segment], tau: Array, highest: int) -> StationPath:
    """A rider at the stations of segments within a span, whose scene times are tau."""
    if not span.active:
        nowhere = np.zeros_like(tau)
        return StationPath(nowhere, nowhere, nowhere, span.active, highest=highest)
    path, stations = rider.path_on_body(tau, span.start, span.end), [segment.steps + 1 for segment in segments]
    place, step = path.S, np.repeat([segment.step for segment in segments], stations)
    for segment, after in zip(segments, np.cumsum(stations), strict=True):
        ends = (after - segment.steps - 1, 1.0, segment.jumps[0]), (after - 1, -1.0, segment.jumps[1])
        for end, inward, jumps in ends:
            if jumps:
                place[end] += inward * BESIDE * rider.length * np.sign(path.dS[end])
    return StationPath(place, path.dS * step, path.ddS * step**2, span.active, highest=highest)
