"""The state of a scene at time 0: undeformed and at rest, or in static equilibrium."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.kernels.layout import State
from engine.model.attachment import residual, rows, without_negative
from engine.model.station_path import Along, StationPath
from engine.model.track import rate_rows
from engine.statics.equilibrium import static_state
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.model.lane_table import LaneTable
    from engine.model.scene_model import SceneModel
    from engine.statics.equilibrium import StaticState


NOW = 1e-12  # of a rider's time: an event so early is that of time 0


def initial_state(model: SceneModel, lanes: LaneTable) -> State:
    """Modal state at time 0, (blocks, N, LANES): undeformed and at rest, or the static equilibrium under the weights
    at their first places. Coordinates count from the body's own sag where its weight acts."""
    shape = lanes.rates.shape
    q, v = np.zeros(shape), np.zeros(shape)
    for part in model.bodies:
        if part.own_weight and model.study.start == "rest":
            sag = part.modal.participation / part.modal.omega**2
            q[:, part.modes] = -sag[:, None] * lanes.gravity[:, None]
    along = _first_places(model)
    if model.study.start == "equilibrium":
        found = _coordinates(model, along, static_state(model, along))
        for load in range(lanes.of_carriages.shape[1]):
            q += found[:, load, None] * lanes.of_carriages[:, load, None]
        q += found[:, -1, None] * lanes.gravity[:, None]
    if model.has_constant:
        q[:, -1] = 1.0
    if model.pulsating:
        q[:, model.pulses], v[:, model.pulses] = np.sin(lanes.phase), np.cos(lanes.phase) * lanes.omega[:, model.pulses]
    _meet(model, lanes, along, (q, v))
    return State(q, v, np.zeros(shape), np.zeros(shape))


def _first_places(model: SceneModel) -> Along:
    """Where all riders are at time 0, and their speed per unit of scene time."""
    found = []
    for rider in model.riders:
        change = min(time for time in rider.events() if time > NOW * rider.end)
        path = rider.path(np.zeros(1), 0.0, change)
        found.append(StationPath(np.clip(path.S, 0.0, rider.length), path.dS, path.ddS, rider.touches(0.0, change)))
    return tuple(found)


def _coordinates(model: SceneModel, along: Along, state: StaticState) -> Array:
    """(N, L) static modal coordinates per unit of each of `lane_table.static_loads`."""
    found = np.zeros((model.omega.size, state.force.shape[2]))
    for r, attachments in enumerate(model.attachments):
        for attachment in attachments:
            if attachment.rider is None or along[attachment.rider].active:
                part = model.bodies[attachment.body]
                soft = attachment.factor * rows(model, attachment, along)[0] * part.modal.modal_flexibility
                found[part.modes] += soft[:, None] * state.force[0, r]
    if (ties := model.corrected).size:
        found[model.residuals] = without_negative(residual(model, along, ties))[0] @ state.force[0, ties]
    found[state.loose] = state.coordinate[0]
    return found


def _meet(model: SceneModel, lanes: LaneTable, along: Along, state: tuple[Array, Array]) -> None:
    """Speeds at which bodies on rigid joints follow the track from the first instant, while that is at rest like under
    a rigid mass: the smallest ones,  y' = v (v.v)^-1 s' (phi'.q + sag')."""
    joints = [r for r, spring in enumerate(model.springs, start=model.first_spring) if spring.rigid]
    if not joints:
        return
    q, v = state
    rows, slope, sag = rate_rows(model, joints, along)
    for place, r in enumerate(joints):
        rows[model.bodies[model.attachments[r][0].body].modes, place] = 0.0
    rate = np.einsum("kr,bkj->rbj", slope, q) + sag[:, None, None] * lanes.gravity
    pull = np.linalg.lstsq(rows.T @ rows, (rate / lanes.time_scale).reshape(len(joints), -1), rcond=None)[0]
    v -= np.einsum("kr,rbj->bkj", rows, pull.reshape(rate.shape))
