"""Static readings of a scene with its carriages at rest at given places: what sensors and contacts tell there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.model.lane_table import weights
from engine.observation.contact_forces import contact_forces, contact_row
from engine.observation.readings import Sensor
from engine.statics.equilibrium import static_state
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.model.station_path import Along
    from engine.observation.contact_forces import ContactForce
    from engine.scene.variants import VariantValues


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
        if sensor.under is not None and (here := along[sensor.under].here) is not None:
            found[~here, j] = 0.0
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
    return [_name(model, contact) for contact in contact_forces(model)]


def _name(model: SceneModel, contact: ContactForce) -> str:
    carriage = model.carriages[contact.carriage].name
    if contact.contact is None:
        return carriage
    return f"{carriage}.{model.contact_names(contact.carriage)[contact.contact]}"


def _loads(model: SceneModel, values: VariantValues) -> Array:
    """(C + 1, V) weight of every carriage in N, and gravity."""
    return np.stack([*weights(model, values), values.gravity])


def _together(one: Array, other: Array) -> tuple[Array, Array]:
    """Two arrays with as many stations as the one that has more."""
    stations = max(len(one), len(other))
    return np.broadcast_to(one, (stations, *one.shape[1:])), np.broadcast_to(other, (stations, *other.shape[1:]))
