"""Contact forces: of a carriage, or at every contact of a body that rides, and where on the way they count."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from engine.observation.readings import Sensor
from results_schema.arrays import Array, Mask

if TYPE_CHECKING:
    from engine.model.rider import Rider
    from engine.model.scene_model import SceneModel
    from engine.model.station_path import Along
    from engine.model.ties import Attachment
    from engine.model.timeline import Segment, Timeline
    from engine.observation.readings import Channel

SPAN_COUNTED = 0.98  # of the span: beyond, the contact force does not converge with the modes


class OfContact:
    """What is read of a force: the ties' own, and nothing of the modes."""

    carriage: int
    contact: int | None

    def channels(self, model: SceneModel, along: Along) -> list[Channel]:
        return []

    def missed(self, model: SceneModel, along: Along) -> Array:
        return np.broadcast_to(contact_row(model, self.carriage, self.contact), (along[0].s.size, model.ties))

    def offset(self, model: SceneModel, along: Along) -> Array:
        return np.zeros(along[0].s.size)

    def rides(self, model: SceneModel) -> int:
        """The rider whose place it is."""
        return self.carriage if self.contact is None else self.contact


@dataclass(frozen=True, eq=False)
class ContactForce(OfContact):
    """The force (N) between a carriage (its number) and its body, or at one contact of a body that rides (the number of
    its rider)."""

    is_summed: ClassVar[bool] = False

    carriage: int
    contact: int | None = None

    def as_sensor(self, model: SceneModel) -> Sensor:
        """The same as a sensor."""
        body = model.carriages[self.carriage].body
        return ContactSensor("", "contact_force", body, 0.0, self.carriage, self.carriage, self.contact)

    @property
    def offset_order(self) -> int:
        return 0

    def counted(self, model: SceneModel, along: Along) -> Mask:
        """Whether the carriage is on the body and off the last part of the span towards a held end."""
        rider = self.rides(model)
        way = along[rider]
        if not way.active:
            return np.zeros(way.s.size, dtype=np.bool_)
        body = next(load.body for load in model.carriages[self.carriage].loads if load.rider == rider)
        low, high = span_counted(model, model.riders[rider], body)
        return np.asarray(way.on & (way.s >= low) & (way.s <= high))


@dataclass(frozen=True, eq=False)
class ContactSensor(OfContact, Sensor):
    """The force at one contact of a body that rides (the number of its rider), or at all contacts of a carriage
    together, as a sensor with its history. It counts wherever the carriage's contact is on its body."""

    carriage: int
    contact: int | None

    def unit_static(self, model: SceneModel, along: Along) -> Array:
        return self.missed(model, along)

    def loose(self, model: SceneModel, along: Along) -> Array:
        return np.zeros((1, model.omega.size))

    def unit_reading(self, model: SceneModel, along: Along, attachment: Attachment) -> Array:
        return np.ones(1)

    def counted(self, model: SceneModel, along: Along) -> Mask:
        return along[self.rides(model)].on


@dataclass(frozen=True, eq=False)
class SuspensionSensor(ContactSensor):
    """What spring and damper under a sprung mass press with beyond its weight (mechanics section 4, compliant tie)."""

    def missed(self, model: SceneModel, along: Along) -> Array:
        row = np.zeros(model.ties)
        row[list(model.springs_of(self.carriage))] = 1.0
        return np.broadcast_to(row, (along[0].s.size, model.ties))


def contact_row(model: SceneModel, carriage: int, contact: int | None = None) -> Array:
    """(ties,) parts of all ties' forces that make the contact force of a carriage, or that at one of its contacts."""
    found, springs = np.zeros(model.ties), model.springs_of(carriage)
    if contact is None:
        found[[carriage, *springs]] = 1.0
    else:
        found[carriage] = next(load.share for load in model.carriages[carriage].loads if load.rider == contact)
        found[[r for r, spring in springs.items() if spring.rider == contact]] = 1.0
    return found


def contacts_that_react(model: SceneModel) -> tuple[ContactForce, ...]:
    """The contact forces that are marched for: not those of plain forces, which press as they are written."""
    known = model.study.carriage
    return tuple(one for one in contact_forces(model) if known[model.carriages[one.carriage].name].reacts)


class Way(NamedTuple):
    """A part of a carriage's way in one segment, from one scene time to another."""

    rider: Rider
    segment: Segment
    begin: float
    end: float

    def places(self, tau: Array) -> Array:
        """Where (m) the carriage is at scene times on it."""
        return self.rider.path_on_body(tau, self.segment.start, self.segment.end).S


def ways_counted(model: SceneModel, timeline: Timeline, carriage: int) -> Iterator[Way]:
    """The parts of a carriage's recorded way on which its contact force counts."""
    tie = model.carriages[carriage]
    low, high = span_counted(model, tie.rider, tie.body)
    for segment in timeline.segments:
        if segment.recorded and segment.active[carriage]:
            tau: Array = segment.start + np.arange(segment.steps + 1, dtype=np.float64) * segment.step
            whole = Way(tie.rider, segment, segment.start, segment.end)
            place = whole.places(tau)
            counted = np.flatnonzero((place >= low) & (place <= high))
            for run in np.split(counted, np.flatnonzero(np.diff(counted) > 1) + 1):
                if run.size:
                    beside = tau[max(run[0] - 1, 0)], tau[min(run[-1] + 1, tau.size - 1)]
                    ends = (_edge(whole, (low, high), *pair) for pair in zip(beside, tau[run[[0, -1]]], strict=True))
                    yield Way(tie.rider, segment, *ends)


def _edge(way: Way, span: tuple[float, float], outside: float, inside: float) -> float:
    """The scene time between two stations at which a carriage comes onto a span or leaves it: the one on it, if both
    are."""
    while abs(outside - inside) > 1e-12 * way.end:
        middle = 0.5 * (outside + inside)
        [place] = way.places(np.array([middle]))
        outside, inside = (outside, middle) if span[0] <= place <= span[1] else (middle, inside)
    return float(inside)


def contact_forces(model: SceneModel) -> tuple[ContactForce, ...]:
    """The contact force of every carriage; of a body that rides, that of every contact."""
    found: list[ContactForce] = []
    for number, carriage in enumerate(model.carriages):
        contacts = [None] if carriage.rides is None else [load.rider for load in carriage.loads]
        found += [ContactForce(number, contact) for contact in contacts]
    return tuple(found)


def span_counted(model: SceneModel, rider: Rider, body: int) -> tuple[float, float]:
    """Places between which a contact force counts: an end that is held along the load is left out where the way leads
    to it."""
    length = rider.length
    left, right = model.bodies[body].modal.held_ends
    low, high = (1.0 - SPAN_COUNTED) * length, SPAN_COUNTED * length
    forward = rider.stays or float(rider.motion.path(0.0).dS) > 0.0
    backward = rider.stays or not forward
    return (low if left and backward else 0.0), (high if right and forward else length)
