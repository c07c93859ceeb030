"""Masses that act in fewer directions than their tracks move, as a study has it: what its frequencies would be if they
acted in all of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from engine.model.station_path import frozen
from engine.model.ties import PushTie
from engine.scene.carriages import Carriage
from engine.scene.references import check_inertia
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import coupled_frequencies
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Direction
    from engine.model.scene_model import SceneModel
    from engine.scene.study import Study

LOWER = 1e-3  # relative: a frequency that would be lower by more is told
LOWEST, PLACES = 6, 5  # frequencies that are looked at, and places of the first carriage


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


def told_of(model: SceneModel) -> str:
    """The same of a scene, looked at in some places of the first carriage's way."""
    whole, rider = in_all_directions(model), model.carriages[0].rider
    if whole is model:
        return ""
    low, high = np.clip(rider.range, 0.0, rider.length)
    places, values = np.linspace(low, high, PLACES), VariantValues(model.study, {}, 1)
    now, then = (coupled_frequencies(one, values, frozen(one, places), LOWEST)[0] for one in (model, whole))
    return told(model.study, places, now / (2.0 * np.pi), then / (2.0 * np.pi))
