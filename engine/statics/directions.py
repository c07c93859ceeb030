"""Masses that act in fewer directions than their tracks move, as a study has it: what its frequencies would be if they
acted in all of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from engine.model.scene_model import UNFELT
from engine.model.station_path import frozen
from engine.model.ties import PushTie
from engine.scene.carriages import Carriage
from engine.scene.references import check_inertia
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import CoupledModes, coupled_modes
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Direction
    from engine.model.scene_model import SceneModel
    from engine.scene.study import Study

LOWER = 1e-3  # relative: a frequency that would be lower by more is told
LOWEST, PLACES = 6, 5  # frequencies that are looked at, and places of the first carriage
ALONG = 33  # places of a track


def left_out(study: Study) -> dict[str, tuple[Direction, ...]]:
    """By the names of carriages, the directions in which their masses could act, and do not."""
    if study.solver.fidelity in ("force", "static"):
        return {}
    found = {
        name: tuple(way for way in carriage.may_push if way not in carriage.pushes and _could(study, carriage, way))
        for name, carriage in study.carriage.items()
    }
    return {name: ways for name, ways in found.items() if ways}


def _could(study: Study, carriage: Carriage, direction: Direction) -> bool:
    try:
        check_inertia(study, carriage, direction)
    except BadInput:
        return False
    return True


def in_all_directions(model: SceneModel) -> SceneModel:
    """The same scene, at rest, with masses that act in all of these in which their tracks move."""
    missing = left_out(model.study)
    added = [
        PushTie(number, tie.body, direction, True)
        for number, tie in enumerate(model.carriages)
        for direction in missing.get(tie.name, ())
        if direction in model.bodies[tie.body].modal.sides
    ]
    return replace(model, pushes=(*model.pushes, *added)) if added else model


def told(study: Study, places: Array, now: Array, then: Array) -> str:
    """The sentence on it, from frequencies (P, K) in Hz with the first carriage at places (P,), m, as they are and as
    they would be; "" where none would be lower."""
    with np.errstate(invalid="ignore"):
        lower = np.nan_to_num(1.0 - then / now) > LOWER
    if not lower.any():
        return ""
    mode = int(np.argmax(lower.any(axis=0)))
    place = int(np.nanargmin(np.where(lower[:, mode], then[:, mode], np.nan)))
    owners = {axle: f"train.{name}" for axle, name in study.axles.items()}
    ways = {owners.get(name, f"carriage.{name}"): found for name, found in left_out(study).items()}
    masses = "; ".join(
        f"the mass of {owner.split('.')[1]} does not act {' or '.join(found)} its track"
        for owner, found in ways.items()
    )
    keys = ", ".join(f"{owner}.inertia_{way} = true" for owner, found in ways.items() for way in found)
    which = "the lowest frequency" if mode == 0 else f"frequency {mode + 1}"
    would = f"{which} would be {then[place, mode]:.4g} Hz, not {now[place, mode]:.4g} Hz"
    return f"{masses}: if it did ({keys}), {would}, with {next(iter(study.carriage))} at {places[place]:.4g} m"


def told_of(model: SceneModel, of_loads: bool = False) -> str:
    """The same of a scene, looked at in some places of the first carriage's way. of_loads: only where frequencies of
    shapes that loads push would be lower, as sensors without a direction tell of no others, such as those along a
    straight bridge."""
    whole, rider = in_all_directions(model), model.carriages[0].rider
    if whole is model:
        return ""
    low, high = np.clip(rider.range, 0.0, rider.length)
    places, values = np.linspace(low, high, PLACES), VariantValues(model.study, {}, 1)
    now, then = (coupled_modes(one, values, frozen(one, places), LOWEST) for one in (model, whole))
    sideways = any(one.direction is not None or one.point is not None for one in model.study.sensor.values())
    if of_loads and not sideways:
        pushed, would_be = _pushed(model, now), _pushed(whole, then)
        if not told(model.study, places, pushed, would_be):
            return ""
    return told(model.study, places, now.omega[0] / (2.0 * np.pi), then.omega[0] / (2.0 * np.pi))


def _pushed(model: SceneModel, found: CoupledModes) -> Array:
    """(P, K) Hz: the frequencies of shapes that move a track as its loads push, or a sprung mass; NaN behind these."""
    shapes, moved = found.shapes[0], np.zeros(found.omega[0].shape)
    for part in model.bodies:
        track = part.modal.shape(np.linspace(0.0, part.modal.length, ALONG))
        moved = np.maximum(moved, np.abs(np.einsum("sn,pnk->psk", track, shapes[:, part.modes])).max(axis=1))
    sprung = slice(model.body_modes, model.body_modes + len(model.sprung))
    moved = np.maximum(moved, np.abs(shapes[:, sprung]).max(axis=1, initial=0.0))
    with np.errstate(invalid="ignore"):
        felt = moved > UNFELT * np.nanmax(moved)
    return np.sort(np.where(felt, found.omega[0], np.nan), axis=1) / (2.0 * np.pi)
