"""What a sensor reads at every step, and the rows of numbers that make it: at a place, under a carriage, aboard one.

Displacement, section forces, stress and strain are linear in w and its derivatives along the track and carry the static
residual of the modes left out (mechanics section 7.8): influence line minus kept modes, times the actual contact force.
Velocity and acceleration are those of the kept modes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from engine.model.attachment import carried_by_modes, holds, place
from engine.model.attachment import rows as shape_rows
from engine.model.station_path import Along, StationPath
from engine.model.ties import Attachment
from results_schema.arrays import Array, Mask
from results_schema.quantities import QUANTITIES

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Direction, Gauge, ModalBody, Sections
    from engine.model.scene_model import BodyPart, SceneModel
    from results_schema.quantities import Quantity

SILENT, PLACES = 1e-9, 33  # of the largest that its body's modes show at so many places: less is rounding


class Channel(NamedTuple):
    """A sum over the modes: what it multiplies ("q", "v", "a"), the power of 1/h, and rows (1 or S, N)."""

    of: str
    order: int
    rows: Array


@dataclass(frozen=True, eq=False)
class Sensor:
    """A quantity on a body, at a fixed place or under a carriage (its number).

    limit: Hz, up to which modes of its body count in a velocity or an acceleration at a fixed place.
    """

    name: str
    quantity: str
    body: int
    at: float
    under: int | None
    limit: float | None = field(default=None, kw_only=True)

    is_summed: ClassVar[bool] = True  # its squares

    def as_sensor(self, model: SceneModel) -> Sensor:
        """Itself."""
        return self

    @property
    def reads_whole(self) -> Sensor:
        """What reads the whole of what this one may read a part of: itself."""
        return self

    @property
    def reads(self) -> Quantity:
        """What it reads, as the table of quantities has it."""
        return QUANTITIES[self.quantity]

    def places(self, along: Along) -> Array:
        """Where it reads, m: one place, or one per station."""
        return np.array([self.at]) if self.under is None else along[self.under].s

    def shape(self, model: SceneModel, along: Along, derivative: int) -> Array:
        """(1 or stations, modes of its body) mode shapes where it reads."""
        body = model.bodies[self.body].modal
        return body.shape_at(self.at, derivative) if self.under is None else along[self.under].shape(body, derivative)

    def channels(self, model: SceneModel, along: Along) -> list[Channel]:
        """Its sums over the modes."""
        part = model.bodies[self.body]
        order = self.offset_order
        if not order:
            return [Channel("q", 0, _spread(model, part, self._rows(model, along)))]
        shape = self.shape(model, along, 0)
        if self.under is None:
            return [Channel("qva"[order], order, _spread(model, part, shape * self._counts(model)))]
        way = along[self.under]
        ds, dds = way.ds[:, None], way.dds[:, None]
        slope = self.shape(model, along, 1)
        if order == 1:
            material = {"q": ds * slope, "v": shape}
        else:
            material = {"q": ds**2 * self.shape(model, along, 2) + dds * slope, "v": 2.0 * ds * slope, "a": shape}
        return [Channel(of, order, _spread(model, part, rows)) for of, rows in material.items()]

    def missed(self, model: SceneModel, along: Along) -> Array:
        """(stations, ties): static response per unit force of each tie that the kept modes miss."""
        found = np.zeros((along[0].s.size, model.ties))
        if self.offset_order or not model.numerics.static_correction:
            return found
        known = dict[Attachment, Array]()
        for r, attachment in self._felt(model, along):
            if attachment.unit not in known:  # a carriage's weight and its springs hold the same places
                kept = self._kept(model, along, shape_rows(model, attachment, along))
                known[attachment.unit] = self.unit_reading(model, along, attachment) - kept
            found[:, r] += attachment.factor * known[attachment.unit]
        return found

    def unit_static(self, model: SceneModel, along: Along) -> Array:
        """(stations, ties) static reading per unit force of each tie, by what the march tends to when it is slow: the
        whole influence line with the static correction, else the kept modes."""
        found = np.zeros((along[0].s.size, model.ties))
        if self.offset_order == 0:
            for r, attachment in self._felt(model, along):
                found[:, r] += attachment.factor * self.unit_reading(model, along, attachment)
        return found

    def unit_reading(self, model: SceneModel, along: Along, attachment: Attachment) -> Array:
        """(1 or stations,) static reading per unit force where an attachment holds its body."""
        if not model.numerics.static_correction:
            return self._kept(model, along, shape_rows(model, attachment, along))
        whole = self._full(model, along, attachment)
        here = None if attachment.rider is None else along[attachment.rider].here
        return whole if here is None else np.where(here, whole, 0.0)

    def loose(self, model: SceneModel, along: Along) -> Array:
        """(1 or stations, N) what it reads of `equilibrium.unrestrained_coordinates`, which only contacts hold."""
        if self.offset_order:
            return np.zeros((1, model.omega.size))
        return _spread(model, model.bodies[self.body], self._rows(model, along))

    def silent(self, model: SceneModel) -> bool:
        """Whether no mode of its body says anything there, nor what it reads at rest, such as the deflection at a
        support: what it reads is rounding, and has no relative error."""
        if self.under is not None:
            return False
        modal = self._modal(model)
        places, sections = np.array([self.at, *np.linspace(0.0, modal.length, PLACES)]), self._sections(model)
        if sections is not None:
            rows = sections.rows(self.quantity, places)
        else:
            rows = modal.shape(places, self.reads.derivative)
        rows[0] = rows[0] * self._counts(model)
        here, *elsewhere = np.abs(rows).max(axis=1)
        return bool(here <= SILENT * max(elsewhere)) and (self.offset_order > 0 or self._still(model))

    def _still(self, model: SceneModel) -> bool:
        """Whether neither what pushes its body nor its own weight says anything there at rest, beside other places."""
        anywhere, places = replace(self, under=0), np.linspace(0.0, self._modal(model).length, PLACES)
        one, pairs = _at_rest(places), (np.repeat(places, places.size), np.tile(places, places.size))
        acting = (attachment.unit for ties in model.attachments for attachment in ties if attachment.body == self.body)
        for push in {unit if unit.rider is None else replace(unit, rider=1) for unit in acting}:
            here = self.unit_reading(model, (one, one), push)
            there = anywhere.unit_reading(model, tuple(map(_at_rest, pairs)), push)
            if np.abs(here).max() > SILENT * np.abs(there).max():
                return False
        weights = (reader.offset(model, (one,)) for reader in (self, anywhere))
        here, there = (np.abs(weight).max() for weight in weights)
        return bool(here <= SILENT * there)

    def largest_influence(self, model: SceneModel, places: Array) -> float:
        """Its largest static reading per unit force at places of its body's track; of a rate, of the displacement.
        Under a carriage it reads at any of them what a load at any other makes it read."""
        reader = replace(self, quantity="displacement") if self.offset_order else self
        loaded = _at_rest(places)
        if self.under is None:
            along: Along = (loaded, loaded)
        else:
            reader = replace(reader, under=0)
            along = (_at_rest(np.repeat(places, places.size)), _at_rest(np.tile(places, places.size)))
        return float(np.abs(reader.unit_reading(model, along, Attachment(1.0, self.body, 1))).max())

    def rides(self, model: SceneModel) -> int | None:
        """The rider that it moves with."""
        return self.under

    def _felt(self, model: SceneModel, along: Along) -> Iterator[tuple[int, Attachment]]:
        """The attachments of all ties on its body, with the ties' numbers."""
        for r, attachments in enumerate(model.attachments):
            for attachment in attachments:
                if attachment.body == self.body and holds(attachment, along):
                    yield r, attachment

    def _counts(self, model: SceneModel) -> Array:
        """(modes of its body,) 1 for those that it reads, 0 for those beyond its limit."""
        omega = self._modal(model).omega
        return np.ones_like(omega) if self.limit is None else (omega <= 2.0 * np.pi * self.limit).astype(np.float64)

    def _modal(self, model: SceneModel) -> ModalBody:
        return model.bodies[self.body].modal

    def _sections(self, model: SceneModel) -> Sections | None:
        """What reads section forces where the body is not one uniform beam."""
        return self._modal(model).sections if self.reads.of_section else None

    def _rows(self, model: SceneModel, along: Along) -> Array:
        """(1 or stations, modes of its body) what it reads of every mode."""
        sections = self._sections(model)
        if sections is not None:
            return sections.rows(self.quantity, self.places(along))
        return np.asarray(self._factor(model) * self.shape(model, along, self.reads.derivative))

    def _factor(self, model: SceneModel) -> float:
        """What a derivative of w is multiplied by."""
        return self.reads.factor(self._modal(model))

    def _full(self, model: SceneModel, along: Along, attachment: Attachment) -> Array:
        """Static reading per unit force where an attachment holds its body."""
        sections, loaded, modal = self._sections(model), place(attachment, along), self._modal(model)
        if isinstance(loaded, str):
            return self._under_point(model, along, loaded)
        if attachment.direction != "load":
            side = modal.sides[attachment.direction]
            if sections is not None:
                return side.section_at(self.quantity, self.places(along), loaded)
            line = side.influence_at("load", self.places(along), loaded, self.reads.derivative)
        elif sections is not None:
            return sections.influence_at(self.quantity, self.places(along), loaded)
        else:
            line = modal.influence_at(self.places(along), loaded, self.reads.derivative)
        return np.asarray(self._factor(model) * line)

    def _under_point(self, model: SceneModel, along: Along, point: str) -> Array:
        """Static reading per unit force at a point."""
        points, x = self._modal(model).points, self.places(along)
        assert points is not None
        if self._sections(model) is not None:
            return points.section_influence(self.quantity, point, x)
        return np.asarray(self._factor(model) * points.influence(point, x, self.reads.derivative))

    def _kept(self, model: SceneModel, along: Along, loaded: Array) -> Array:
        """The part of it that the kept modes carry; ``loaded`` (S, N) are the mode shapes where the force acts."""
        return carried_by_modes(self._modal(model), self._rows(model, along), loaded)

    def offset(self, model: SceneModel, along: Along) -> Array:
        """(stations,): what the body's own weight adds per unit gravity, in step units."""
        stations = along[0].s.size
        x = self.places(along)
        if not model.bodies[self.body].own_weight:
            return np.zeros(stations)
        sections = self._sections(model)
        if sections is not None:
            return np.broadcast_to(sections.own_weight(self.quantity, x), stations)
        if self.offset_order == 0:
            return np.broadcast_to(self._factor(model) * self._sag(model, x, self.reads.derivative), stations)
        if self.under is None:
            return np.zeros(stations)
        way = along[self.under]
        slope = self._sag(model, x, 1)
        if self.offset_order == 1:
            return way.ds * slope
        return np.asarray(way.ds**2 * self._sag(model, x, 2) + way.dds * slope)

    def _sag(self, model: SceneModel, x: Array, derivative: int) -> Array:
        """(S,) derivative of its body's motion under own weight per unit gravity."""
        return model.bodies[self.body].modal.own_weight_deflection(x, derivative)

    def sagging(self, model: SceneModel, along: Along) -> Array:
        """(stations,): its static reading by the body's own weight per unit gravity."""
        return self.offset(model, along) if self.offset_order == 0 else np.zeros(along[0].s.size)

    @property
    def offset_order(self) -> int:
        """The power of 1/h that makes the offset SI."""
        return self.reads.rate

    def counted(self, model: SceneModel, along: Along) -> Mask:
        """(stations,) bool: whether it reads anything there."""
        return np.full(along[0].s.size, True) if self.under is None else along[self.under].on


@dataclass(frozen=True, eq=False)
class SideSensor(Sensor):
    """The motion under a carriage along the track, or across it and its loads."""

    direction: Direction = field(kw_only=True)

    def shape(self, model: SceneModel, along: Along, derivative: int) -> Array:
        assert self.under is not None
        body = model.bodies[self.body].modal
        return np.asarray(along[self.under].shapes(body, derivative, self.direction)[derivative])

    def largest_influence(self, model: SceneModel, places: Array) -> float:
        """By a force in its own direction too: loads may move it by inertia alone."""
        own = self._modal(model).flexibility_between(places, places, (self.direction, self.direction))
        return max(super().largest_influence(model, places), float(np.abs(own).max()))

    def _full(self, model: SceneModel, along: Along, attachment: Attachment) -> Array:
        modal, loaded, x = self._modal(model), place(attachment, along), self.places(along)
        if isinstance(loaded, str):
            return modal.sides[self.direction].of_point(loaded, x)
        return modal.flexibility_between(x, loaded, (self.direction, attachment.direction))

    def _sag(self, model: SceneModel, x: Array, derivative: int) -> Array:
        return self._modal(model).sides[self.direction].own_weight_motion(x, derivative)


@dataclass(frozen=True, eq=False)
class SpotSensor(Sensor):
    """The motion of a place of a body off its track, or what one of its supports carries, which the modal body knows by
    the sensor's name; ``at`` is NaN."""

    def shape(self, model: SceneModel, along: Along, derivative: int) -> Array:
        return self._gauge(model).row[None]

    def missed(self, model: SceneModel, along: Along) -> Array:
        found, dampers = super().missed(model, along), self._gauge(model).dampers
        for r, tie in enumerate(model.dampers, start=len(model.carriages)):
            if tie.body == self.body:
                found[:, r] -= dampers.get(tie.at, 0.0)  # whose force pushes the body back
        return found

    def offset(self, model: SceneModel, along: Along) -> Array:
        weighs = model.bodies[self.body].own_weight and self.offset_order == 0
        return np.full(along[0].s.size, self._gauge(model).own_weight() if weighs else 0.0)

    def silent(self, model: SceneModel) -> bool:
        """Whether neither a load on the track nor own weight moves it, nor its body as a rigid one."""
        modal = self._modal(model)
        places = np.linspace(0.0, modal.length, PLACES)
        usual = 1.0 if self.reads.of_support else np.abs(modal.influence_at(places, places)).max()
        hangs = abs(self._gauge(model).own_weight()) if model.bodies[self.body].own_weight else 0.0
        moved = max(self.largest_influence(model, places), hangs / modal.mass)
        return bool(not modal.rigid_modes and moved <= SILENT * usual)

    def largest_influence(self, model: SceneModel, places: Array) -> float:
        gauge = self._gauge(model)
        pushed = [gauge.influence(places, direction) for direction in model.pushed(self.body)]
        return float(np.abs([*gauge.along(places), *gauge.points.values(), *np.ravel(pushed)]).max())

    def _full(self, model: SceneModel, along: Along, attachment: Attachment) -> Array:
        return self._gauge(model).influence(place(attachment, along), attachment.direction)

    def _gauge(self, model: SceneModel) -> Gauge:
        return self._modal(model).gauges[self.name]


@dataclass(frozen=True, eq=False)
class SprungSensor(Sensor):
    """The motion of a carriage's sprung mass, whose coordinate stands at ``mode``; its static reading is the deflection
    under its carriage, which its spring feels."""

    mode: int

    def channels(self, model: SceneModel, along: Along) -> list[Channel]:
        row = np.zeros((1, model.omega.size))
        row[0, self.mode] = 1.0
        return [Channel("qva"[self.offset_order], self.offset_order, row)]

    def missed(self, model: SceneModel, along: Along) -> Array:
        return np.zeros((along[0].s.size, model.ties))

    def unit_static(self, model: SceneModel, along: Along) -> Array:
        return np.zeros((along[0].s.size, model.ties))

    def loose(self, model: SceneModel, along: Along) -> Array:
        found = np.zeros((1, model.omega.size))
        found[0, self.mode] = float(self.offset_order == 0)
        return found

    def offset(self, model: SceneModel, along: Along) -> Array:
        return np.zeros(along[0].s.size)

    def sagging(self, model: SceneModel, along: Along) -> Array:
        return np.zeros(along[0].s.size)


def _at_rest(places: Array) -> StationPath:
    """A rider that stands at places of its track, m."""
    return StationPath(places, np.zeros_like(places), np.zeros_like(places), True)


def _spread(model: SceneModel, part: BodyPart, rows: Array) -> Array:
    """Rows of one body in the row of all modes."""
    found = np.zeros((rows.shape[0], model.omega.size))
    found[:, part.modes] = rows
    return found
