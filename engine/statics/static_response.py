"""Static readings of a scene with its carriages at rest at given places, or where they are at stations of a march."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.model.lane_table import weights
from engine.model.station_path import Along, standing
from engine.observation.contact_forces import contact_forces, contact_row
from engine.observation.kinks import stops
from engine.observation.readings import Sensor
from engine.statics.equilibrium import static_state
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.model.timeline import Timeline
    from engine.observation.signals import Signal
    from engine.scene.variants import VariantValues


STATIONS = 1024  # at which the largest static reading of a sensor is looked for
SLOPE_STEP = 1e-5  # of the body's length, between places of a static derivative


class StaticReadings(NamedTuple):
    """sensors (V, S, J) and contact forces (V, S, K) of `signals.contact_forces` under all weights and forces, and
    sensors per unit weight of the first carriage alone, (S, J)."""

    sensors: Array
    contacts: Array
    influence: Array


def static_readings(model: SceneModel, sensors: Sequence[Sensor], along: Along) -> Array:
    """(S, J, C + 1) static readings of sensors per unit weight of each carriage, and last per unit gravity."""
    state = static_state(model, along)
    found = np.zeros((along[0].s.size, len(sensors), len(model.carriages) + 1))
    for j, sensor in enumerate(sensors):
        read = np.einsum("sr,srl->sl", *_together(sensor.unit_static(model, along), state.force))
        if state.loose.size:
            loose = sensor.loose(model, along)[:, state.loose]
            read = read + np.einsum("sm,sml->sl", *_together(loose, state.coordinate))
        found[:, j] = read
        found[:, j, -1] += sensor.sagging(model, along)
        rider = sensor.rides(model)
        # one of several contacts may be on its body while the others, and the place that moves, are not
        if rider is not None and rider == sensor.under and (here := along[rider].here) is not None:
            found[~here, j] = 0.0
    return found


def left_out(model: SceneModel, signals: Sequence[Signal], along: Along) -> Array | None:
    """(S, J, C + 1) the static readings that signals leave out of the whole; None where none does."""
    readers = [signal.as_sensor(model) for signal in signals]
    parts = [j for j, reader in enumerate(readers) if reader.reads_whole is not reader]
    if not parts:
        return None
    found = np.zeros((along[0].s.size, len(signals), len(model.carriages) + 1))
    found[:, parts] = static_readings(model, [readers[j].reads_whole for j in parts], along)
    return found


def static_values(model: SceneModel, sensors: Sequence[Sensor], values: VariantValues, along: Along) -> StaticReadings:
    """Static readings of sensors and of all contacts, for some variants of a scene."""
    unit, loads = static_readings(model, sensors, along), _loads(model, values)
    force = static_state(model, along).force
    parts = np.array([contact_row(model, c.carriage, c.contact) for c in contact_forces(model)])
    contacts = np.einsum("kr,srl->skl", parts, np.broadcast_to(force, (along[0].s.size, *force.shape[1:])))
    return StaticReadings(
        np.einsum("sjl,lv->vsj", unit, loads), np.einsum("skl,lv->vsk", contacts, loads), unit[:, :, 0]
    )


def static_shapes(model: SceneModel, values: VariantValues, along: Along, body: int, x: Array) -> Array:
    """(V, S, X) deflection of a body at places x (X,) of its track, m, as a sensor there reads it."""
    places = [Sensor("", "displacement", body, float(place), None) for place in x]
    return np.asarray(np.einsum("sxl,lv->vsx", static_readings(model, places, along), _loads(model, values)))


def contact_names(model: SceneModel) -> list[str]:
    """The names of `signals.contact_forces`: the carriage, or the carriage and its contact with a dot."""
    found = []
    for force in contact_forces(model):
        name, contacts = model.carriages[force.carriage].name, model.contact_names(force.carriage)
        found.append(name if force.contact is None else f"{name}.{contacts[force.contact]}")
    return found


def _loads(model: SceneModel, values: VariantValues) -> Array:
    """(C + 1, V) weight of every carriage in N, and gravity."""
    return np.stack([*weights(model, values), values.gravity])


def _together(one: Array, other: Array) -> tuple[Array, Array]:
    """Two arrays with as many stations as the one that has more."""
    stations = max(len(one), len(other))
    return np.broadcast_to(one, (stations, *one.shape[1:])), np.broadcast_to(other, (stations, *other.shape[1:]))


class StaticUnit(NamedTuple):
    """Static readings at some stations: per unit force of each carriage (H, J, C), and per unit gravity (H, J)."""

    force: Array
    gravity: Array


@dataclass(eq=False)
class Statics:
    """Static readings of sensors by one model along one timeline; what was asked for once is kept, as most marches of
    a study ask for the same."""

    model: SceneModel
    timeline: Timeline
    sensors: tuple[Sensor, ...]
    _kept: dict[bytes, StaticUnit] = field(default_factory=dict)
    _slopes: dict[bytes, Array] = field(default_factory=dict)

    @cached_property
    def counts(self) -> Array:
        """Stations, by their count, spread over the recorded part, and where a carriage passes a sensor, as influence
        lines have their kinks there."""
        first, last = self.timeline.window
        last = min([last, *(segment.first for segment in self.timeline.segments if segment.free)])
        counts = np.linspace(first, last, STATIONS)
        places = {sensor.at for sensor in self.sensors if sensor.under is None}
        ways = [self.timeline.positions(rider, counts) for rider in range(len(self.model.carriages)) if places]
        passing = [_crossings(counts, way, at) for way in ways for at in places]
        bounds = np.array([segment.first for segment in self.timeline.segments if first <= segment.first <= last])
        met = self.timeline.counts_at(np.array(list(stops(self.model, self.sensors))))
        met = met[(met >= first) & (met <= last)]
        return np.unique(np.concatenate([counts, bounds, *passing, met]))

    @cached_property
    def over_window(self) -> StaticUnit:
        """Readings at `counts`, whole ones of sensors that read a part."""
        return self._at(self.counts, tuple(sensor.reads_whole for sensor in self.sensors))

    def at(self, counts: Array | Counts) -> StaticUnit:
        """Readings at stations by their count."""
        key = counts.tobytes()
        if key not in self._kept:
            self._kept[key] = self._at(counts, self.sensors)
        return self._kept[key]

    def _at(self, counts: Array | Counts, sensors: tuple[Sensor, ...]) -> StaticUnit:
        readings = static_readings(self.model, sensors, standing(self.timeline, counts))
        return StaticUnit(readings[:, :, :-1], readings[:, :, -1])

    def slope_at(self, counts: Array | Counts) -> Array:
        """(H, J) derivative of the readings per unit force of the first carriage by its position; 0 where it is not."""
        key = counts.tobytes()
        if key not in self._slopes:
            along = standing(self.timeline, counts)
            here, active = along[0].here, along[0].active
            assert here is not None
            none = np.zeros((counts.size, len(self.sensors)))
            self._slopes[key] = np.where(here[:, None], self._slope(along), 0.0) if active else none
        return self._slopes[key]

    def _slope(self, along: Along) -> Array:
        """(S, J) derivative of the readings per unit weight of the first carriage by its position, from places a little
        apart, which it reaches with all its contacts."""
        riders, apart = self.model.riders, SLOPE_STEP * self.model.carriages[0].rider.length
        own = {0, *(load.rider for load in self.model.carriages[0].loads)}
        lowest = np.minimum.reduce([along[r].s for r in own])
        highest = np.minimum.reduce([riders[r].length - along[r].s for r in own])
        before, after = -np.minimum(apart, lowest), np.minimum(apart, highest)
        moved = [
            tuple(replace(way, _shapes={}, s=way.s + shift) if r in own else way for r, way in enumerate(along))
            for shift in (before, after)
        ]
        left, right = (static_readings(self.model, self.sensors, ways)[:, :, 0] for ways in moved)
        return np.asarray((right - left) / (after - before)[:, None])


def _crossings(counts: Array, places: Array, at: float) -> Array:
    """Fractional counts at which a carriage passes a place, by interpolation between stations."""
    gap = places - at
    before = np.flatnonzero(gap[:-1] * gap[1:] < 0.0)
    part = gap[before] / (gap[before] - gap[before + 1])
    return np.asarray(counts[before] + part * (counts[before + 1] - counts[before]))
