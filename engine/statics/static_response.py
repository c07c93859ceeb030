"""Static readings of a scene with its carriages at rest at given places, or where they are at stations of a march."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.model.lane_table import loads_of, static_loads
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


PROBED = 65  # places along a body at which the largest reading per unit force is looked for: one in a wave of 64 modes
STATIONS = 1024  # at which the largest static reading of a sensor is looked for
SLOPE_STEP = 1e-5  # of the body's length, between places of a static derivative


class StaticReadings(NamedTuple):
    """sensors (V, S, J) and contact forces (V, S, K) of `signals.contact_forces` under all weights and forces, and
    sensors per unit weight of the first carriage alone, (V, S, J)."""

    sensors: Array
    contacts: Array
    influence: Array


def static_readings(model: SceneModel, sensors: Sequence[Sensor], along: Along) -> Array:
    """(S, J, L) static readings of sensors per unit of each of `lane_table.static_loads`, last per unit gravity."""
    state = static_state(model, along)
    found = np.zeros((along[0].s.size, len(sensors), state.force.shape[2]))
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
    """(S, J, L) the static readings that signals leave out of the whole; None where none does."""
    readers = [signal.as_sensor(model) for signal in signals]
    parts = [j for j, reader in enumerate(readers) if reader.reads_whole is not reader]
    if not parts:
        return None
    own = static_readings(model, [readers[j].reads_whole for j in parts], along)
    found = np.zeros((len(own), len(signals), own.shape[2]))
    found[:, parts] = own
    return found


def static_values(model: SceneModel, sensors: Sequence[Sensor], values: VariantValues, along: Along) -> StaticReadings:
    """Static readings of sensors and of all contacts, for some variants of a scene."""
    unit, loads = static_readings(model, sensors, along), static_loads(model, values)
    alone = loads_of(model, values, np.eye(len(model.carriages), 1) * np.ones(values.size))
    force = static_state(model, along).force
    parts = np.array([contact_row(model, c.carriage, c.contact) for c in contact_forces(model)])
    contacts = np.einsum("kr,srl->skl", parts, np.broadcast_to(force, (along[0].s.size, *force.shape[1:])))
    return StaticReadings(
        np.einsum("sjl,lv->vsj", unit, loads),
        np.einsum("skl,lv->vsk", contacts, loads),
        np.einsum("sjl,lv->vsj", unit[:, :, :-1], alone),
    )


def static_shapes(model: SceneModel, values: VariantValues, along: Along, body: int, x: Array) -> Array:
    """(V, S, X) deflection of a body at places x (X,) of its track, m, as a sensor there reads it."""
    places = [Sensor("", "displacement", body, float(place), None) for place in x]
    return np.asarray(np.einsum("sxl,lv->vsx", static_readings(model, places, along), static_loads(model, values)))


def contact_names(model: SceneModel) -> list[str]:
    """The names of `signals.contact_forces`: the carriage, or the carriage and its contact with a dot."""
    found = []
    for force in contact_forces(model):
        name, contacts = model.carriages[force.carriage].name, model.contact_names(force.carriage)
        found.append(name if force.contact is None else f"{name}.{contacts[force.contact]}")
    return found


def _together(one: Array, other: Array) -> tuple[Array, Array]:
    """Two arrays with as many stations as the one that has more."""
    stations = max(len(one), len(other))
    return np.broadcast_to(one, (stations, *one.shape[1:])), np.broadcast_to(other, (stations, *other.shape[1:]))


@dataclass(eq=False)
class Statics:
    """Static readings (H, J, L) of sensors by one model along one timeline, as of `static_readings`; what was asked for
    once is kept, as most marches of a study ask for the same. coarser: the same along a coarser timeline; by: into how
    many each of its steps is cut here, and each of its free vibration."""

    model: SceneModel
    timeline: Timeline
    sensors: tuple[Sensor, ...]
    coarser: Statics | None = None
    by: tuple[int, int] = (1, 1)
    _kept: dict[bytes, Array] = field(default_factory=dict)
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
    def over_window(self) -> Array:
        """Readings at `counts`, whole ones of sensors that read a part; of the coarsest timeline."""
        if self.coarser is not None:
            return self.coarser.over_window
        return self._at(self.counts, tuple(sensor.reads_whole for sensor in self.sensors))

    @cached_property
    def largest_influences(self) -> Array:
        """(J,) the largest static reading per unit force anywhere on a sensor's body; of rates, of displacements."""
        if self.coarser is not None:
            return self.coarser.largest_influences
        lengths = [self.model.bodies[sensor.body].modal.length for sensor in self.sensors]
        places = [np.linspace(0.0, length, PROBED) for length in lengths]
        return np.array([s.largest_influence(self.model, x) for s, x in zip(self.sensors, places, strict=True)])

    def at(self, counts: Array | Counts) -> Array:
        """Readings at stations by their count."""
        if self.coarser is not None and self._on_coarser(counts):
            return self.coarser.at(counts // self.by[0])
        key = counts.tobytes()
        if key not in self._kept:
            self._kept[key] = self._at(counts, self.sensors)
        return self._kept[key]

    def _on_coarser(self, counts: Array | Counts) -> bool:
        """Whether all of these are stations of the coarser timeline."""
        return self.by[0] == self.by[1] and not np.any(counts % self.by[0])

    def _at(self, counts: Array | Counts, sensors: tuple[Sensor, ...]) -> Array:
        return static_readings(self.model, sensors, standing(self.timeline, counts))

    def slope_at(self, counts: Array | Counts) -> Array:
        """(H, J, L) derivative of the readings by the position of the first carriage; 0 where it is not."""
        if self.coarser is not None and self._on_coarser(counts):
            return self.coarser.slope_at(counts // self.by[0])
        key = counts.tobytes()
        if key not in self._slopes:
            along = standing(self.timeline, counts)
            here, active = along[0].here, along[0].active
            assert here is not None
            slope = self._slope(along) if active else np.zeros_like(self.at(counts))
            self._slopes[key] = np.where(here[:, None, None], slope, 0.0)
        return self._slopes[key]

    def _slope(self, along: Along) -> Array:
        """(S, J, L) derivative of the readings by the position of the first carriage, from places a little apart, which
        it reaches with all its contacts."""
        riders, apart = self.model.riders, SLOPE_STEP * self.model.carriages[0].rider.length
        own = {0, *(load.rider for load in self.model.carriages[0].loads)}
        lowest = np.minimum.reduce([along[r].s for r in own])
        highest = np.minimum.reduce([riders[r].length - along[r].s for r in own])
        before, after = -np.minimum(apart, lowest), np.minimum(apart, highest)
        moved = [
            tuple(replace(way, _shapes={}, s=way.s + shift) if r in own else way for r, way in enumerate(along))
            for shift in (before, after)
        ]
        left, right = (static_readings(self.model, self.sensors, ways) for ways in moved)
        return np.asarray((right - left) / (after - before)[:, None, None])


def _crossings(counts: Array, places: Array, at: float) -> Array:
    """Fractional counts at which a carriage passes a place, by interpolation between stations."""
    gap = places - at
    before = np.flatnonzero(gap[:-1] * gap[1:] < 0.0)
    part = gap[before] / (gap[before] - gap[before + 1])
    return np.asarray(counts[before] + part * (counts[before + 1] - counts[before]))
