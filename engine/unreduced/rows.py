"""Rows of ties and sensors of an unreduced scene at stations of its way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.modal.modal_body import Side
from engine.model.rider import Rider
from engine.scene.sensors import Sensor
from engine.unreduced.bodies import Track
from engine.unreduced.scene import Tie, Unreduced, contacts_of
from engine.unreduced.track import WIDTH, Rows, no_rows
from results_schema.arrays import Array, Counts, Mask
from results_schema.errors import BadInput


class Along(NamedTuple):
    """Riders at stations, all (S, R): places m, their first and second derivative by time, and whether they are on
    the body."""

    s: Array
    ds: Array
    dds: Array
    on: Mask

    @classmethod
    def at_rest(cls, places: Array, on: Mask, riders: Sequence[Rider]) -> Along:
        """Riders that stand still at places (S, R) of their tracks where they are on them."""
        still = np.zeros_like(places)
        lengths = [rider.length for rider in riders]
        return cls(np.where(on, np.clip(places, 0.0, lengths), 0.0), still, still, on)

    def some(self, which: Mask | slice) -> Along:
        """Some of the stations."""
        return Along(self.s[which], self.ds[which], self.dds[which], self.on[which])


def at_positions(model: Unreduced, positions: ArrayLike) -> Along:
    """All riders at rest where the carriages are: positions (P, C), NaN where one is away; (P,) for one carriage.

    Raises BadInput for another shape.
    """
    names = list(model.study.carriage)
    given = np.asarray(positions, dtype=np.float64)
    given = given[:, None] if given.ndim == 1 else given
    if given.ndim != 2 or given.shape[1] != len(names):
        raise BadInput("positions", where="positions", expected=f"(P, {len(names)}) numbers", received=str(given.shape))
    owners = [*range(len(names)), *(names.index(name) for name, _, _ in contacts_of(model.study))]
    offsets = np.array([rider.offset for rider in model.riders])
    lengths = np.array([rider.length for rider in model.riders])
    place = given[:, owners] + offsets
    with np.errstate(invalid="ignore"):
        on = (place >= -1e-12 * lengths) & (place <= lengths * (1.0 + 1e-12))
    return Along.at_rest(place, on, model.riders)


def nowhere(model: Unreduced) -> Along:
    """One station with all carriages on level rigid ground beside the bodies."""
    none = np.zeros((1, len(model.riders)))
    return Along(none, none, none, none > 0.0)


def tie_rows(model: Unreduced, along: Along, derivative: int = 0) -> Rows:
    """(S, T, 12) d^j/ds^j of the deflection under every tie (of a push the track's motion in its direction), zero where
    it is off the body."""
    shape = len(along.s), len(model.ties), WIDTH
    found = Rows(np.zeros(shape, dtype=np.int64), np.zeros(shape))
    for j, tie in enumerate(model.ties):
        rows = model.line(tie).rows(along.s[:, tie.rider], derivative)
        found.freedoms[:, j] = rows.freedoms + model.firsts[tie.body]
        found.values[:, j] = rows.values * along.on[:, tie.rider, None]
    return found


def softness(model: Unreduced, along: Along) -> Array:
    """(S, T, T) m/N: what the elements' own bending between their ends adds under each tie per unit force of another,
    on the body that is ridden, on that which rides, and on one that does both."""
    count = len(model.ties)
    found = np.zeros((len(along.s), count, count))
    for i, j in _together(model):
        one, other = model.ties[i], model.ties[j]
        on = along.on[:, one.rider] & along.on[:, other.rider]
        within = model.within(one, other, along.s[:, one.rider], along.s[:, other.rider])
        found[:, i, j] = np.where(on, within, 0.0)
    for i, one in enumerate(model.ties):
        for j, other in enumerate(model.ties):
            if one.rides and one.rides == other.rides and one.at is not None and other.at is not None:
                track = model.bodies[one.rides].track
                found[:, i, j] += track.within(np.array([one.at]), np.array([other.at]))
            if one.rides and one.rides == other.body and one.at is not None:
                s = along.s[:, other.rider]
                between = model.bodies[other.body].track.within(np.full_like(s, one.at), s)
                found[:, i, j] -= np.where(along.on[:, other.rider], between, 0.0)
                found[:, j, i] = found[:, i, j]
    return found


def softness_slopes(model: Unreduced, along: Along) -> tuple[Array, Array]:
    """(S, T, T) its first and second derivative by the way of a carriage, between ties of that carriage.

    With them what a load feels on its way is as smooth as the line of the body, whatever the shapes of the elements.
    """
    count = len(model.ties)
    first, second = np.zeros((len(along.s), count, count)), np.zeros((len(along.s), count, count))
    for i, j in _together(model):
        one, other = model.ties[i], model.ties[j]
        if one.carriage != other.carriage:
            continue
        track = model.line(one)
        (place, step), (load, _) = track.inside(along.s[:, one.rider]), track.inside(along.s[:, other.rider])
        before, here, after = (model.within(one, other, place + k * step, load + k * step) for k in (-1, 0, 1))
        on = along.on[:, one.rider] & along.on[:, other.rider]
        first[:, i, j] = np.where(on, (after - before) / (2.0 * step), 0.0)
        second[:, i, j] = np.where(on, (after - 2.0 * here + before) / step**2, 0.0)
    return first, second


def _together(model: Unreduced) -> Iterator[tuple[int, int]]:
    """Pairs of a tie whose force is not given and one on the same body."""
    for i, one in enumerate(model.ties):
        for j, other in enumerate(model.ties):
            if one.link != "force" and one.body == other.body:
                yield i, j


@dataclass(frozen=True, eq=False)
class Readings:
    """J sensors at S stations: index (S, J, 12), on displacements, velocities and accelerations (S, J, 12), on the
    ties' forces (S, J, T), and what is added (S, J)."""

    index: Counts
    on_u: Array
    on_v: Array
    on_a: Array
    on_force: Array
    added: Array

    def at(self, h: int, u: Array, v: Array, a: Array, forces: Array) -> Array:
        """(J,) at one station, from its state (n,) and forces (T,)."""
        index = self.index[h]
        found = self.on_u[h] * u[index] + self.on_v[h] * v[index] + self.on_a[h] * a[index]
        return np.asarray(found.sum(axis=1) + self.on_force[h] @ forces + self.added[h])

    def at_rest(self, u: Array, forces: Array) -> Array:
        """(S, J) from static states (S, n) and forces (S, T)."""
        taken = u[np.arange(len(u))[:, None, None], self.index]
        found = np.sum(self.on_u * taken, axis=2) + np.einsum("sjt,st->sj", self.on_force, forces)
        return np.asarray(found + self.added)

    def less(self, level: Array) -> Readings:
        """The same, counted from readings (S, J)."""
        return Readings(self.index, self.on_u, self.on_v, self.on_a, self.on_force, self.added - level)


def rider_of(model: Unreduced, sensor: Sensor) -> int | None:
    """The rider that must be on its body for a sensor to read anything."""
    if sensor.contact is not None:
        return next(tie.rider for tie in model.ties if _counts(tie, sensor))
    return None if sensor.rides is None else list(model.study.carriage).index(sensor.rides)


def _counts(tie: Tie, sensor: Sensor) -> float:
    """Part of a tie's force in a contact force: of a carriage altogether, at one of its contacts, or of its spring."""
    if sensor.reads.of_suspension:
        return float(tie.link == "spring" and sensor.carriage == tie.carriage)
    wanted = sensor.carriage if sensor.contact is None else f"{sensor.carriage}_{sensor.contact}"
    return float(tie.link != "push" and wanted == (tie.carriage if sensor.contact is None else tie.name))


class _Parts(NamedTuple):
    """A sensor's rows (S, 12) on u, v, a; they share their index."""

    u: Rows
    v: Array
    a: Array


def readings(model: Unreduced, along: Along) -> Readings:
    """Rows of all sensors of the study; those on bodies that ride, and of sprung masses, count from the unstressed
    place."""
    shape = len(along.s), len(model.study.sensor)
    index, (on_u, on_v, on_a) = np.zeros((*shape, WIDTH), dtype=np.int64), np.zeros((3, *shape, WIDTH))
    on_force, added = np.zeros((*shape, len(model.ties))), np.zeros(shape)
    for j, (name, sensor) in enumerate(model.study.sensor.items()):
        rows, on_v[:, j], on_a[:, j] = _parts(model, name, sensor, along)
        index[:, j], on_u[:, j] = rows
        if sensor.reads.of_contact:
            on_force[:, j] = [_counts(tie, sensor) for tie in model.ties]
        elif sensor.carriage is None and not sensor.reads.rate:
            on_force[:, j], added[:, j] = _between_ends(model, name, sensor, along)
    return Readings(index, on_u, on_v, on_a, on_force, added)


def _place(model: Unreduced, sensor: Sensor, along: Along) -> tuple[Array, int | None]:
    """Where a sensor reads (S,), and the rider under which it does."""
    if sensor.under is None:
        return np.full(len(along.s), 0.0 if sensor.at is None else sensor.at), None
    rider = list(model.study.carriage).index(sensor.under)
    return along.s[:, rider], rider


def _track(model: Unreduced, body: str, sensor: Sensor) -> Track:
    """The track on which a sensor reads, in its direction."""
    return model.bodies[body].track if sensor.side is None else model.bodies[body].sides[sensor.side]


def _parts(model: Unreduced, name: str, sensor: Sensor, along: Along) -> _Parts:
    count = len(along.s)
    none = np.zeros((count, WIDTH))
    if sensor.reads.of_contact:
        return _Parts(no_rows(count), none, none)
    if sensor.carriage is not None:
        rows = no_rows(count)
        rows.freedoms[:] = model.sprung[sensor.carriage]
        rows.values[:, 0] = 1.0
        return _of_rate(rows, sensor)
    body = model.study.body_of(name)
    track, first = _track(model, body, sensor), model.firsts[body]
    if sensor.spot is not None:
        gauge = model.bodies[body].gauges[name]
        rows = gauge.rows.moved(first).repeated(count)
        if gauge.rates is None:
            return _of_rate(rows, sensor)
        return _Parts(rows, *np.repeat(gauge.rates[:, None], count, axis=1))
    place, rider = _place(model, sensor, along)
    rate = sensor.reads.rate
    if sensor.reads.of_section:
        moved, inertia = model.bodies[body].track.sections(sensor.quantity, place)
        return _Parts(moved.moved(first), none, inertia.values)
    shape = track.rows(place).moved(first)
    if rate == 0:
        return _Parts(shape, none, none)
    on_u, on_v, on_a = none, none, shape.values
    if rate == 1:
        on_v, on_a = shape.values, none
    if rider is not None:
        slope, bend = (track.rows(place, order).values for order in (1, 2))
        ds, dds = along.ds[:, rider, None], along.dds[:, rider, None]
        if rate == 1:
            on_u = ds * slope
        else:
            on_u, on_v = ds**2 * bend + dds * slope, 2.0 * ds * slope
    return _Parts(Rows(shape.freedoms, on_u), on_v, on_a)


def _of_rate(rows: Rows, sensor: Sensor) -> _Parts:
    """A displacement, or its velocity or acceleration, at what does not move along its body."""
    on = [rows.values * (sensor.reads.rate == rate) for rate in range(3)]
    return _Parts(Rows(rows.freedoms, on[0]), on[1], on[2])


def _between_ends(model: Unreduced, name: str, sensor: Sensor, along: Along) -> tuple[Array, Array]:
    """(S, T) what the ties' forces on the sensor's own element add, and (S,) what own weight on it does."""
    body = model.study.body_of(name)
    if sensor.side is not None:
        return _between_ends_of_side(model, body, sensor.side, sensor, along)
    track, gauge = model.bodies[body].track, model.bodies[body].gauges.get(name)
    place, _ = _place(model, sensor, along)
    forces = np.zeros((len(along.s), len(model.ties)))

    def adds(s: Array) -> Array:
        if gauge is not None:
            return gauge.within(s)
        return track.within(place, s, sensor.quantity)

    for j, tie in enumerate(model.ties):
        if tie.body == body and tie.link != "push":
            forces[:, j] += np.where(along.on[:, tie.rider], adds(along.s[:, tie.rider]), 0.0)
        if tie.rides == body and tie.at is not None:
            forces[:, j] -= adds(np.full(len(place), tie.at))
    added = np.zeros(len(place))
    # That of a body that rides cancels, as it counts from its rest.
    if model.study.body[body].own_weight and body not in model.loose:
        spread = track.under_weight(place, sensor.quantity) if gauge is None else gauge.under_weight
        added += spread * model.study.gravity
    return forces, added


def _between_ends_of_side(model: Unreduced, body: str, side: Side, sensor: Sensor, along: Along) -> tuple[Array, Array]:
    """The same of a sensor along its track or across, which carriages alone push."""
    lines, (place, _) = model.bodies[body].lines, _place(model, sensor, along)
    forces, added = np.zeros((len(along.s), len(model.ties))), np.zeros(len(place))
    for j, tie in enumerate(model.ties):
        if tie.body == body:
            between = lines[side].within(place, along.s[:, tie.rider], loads=lines[tie.direction])
            forces[:, j] = np.where(along.on[:, tie.rider], between, 0.0)
    if model.study.body[body].own_weight:
        added += _track(model, body, sensor).under_weight(place) * model.study.gravity
    return forces, added
