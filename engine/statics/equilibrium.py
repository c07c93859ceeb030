"""The static state of a scene with its carriages at given places: forces of all ties, and what only contacts hold.

Springs F and coordinates z that nothing but springs hold (sprung masses, rigid motion of bodies that ride):

    F/k + C F + P z = -level g - C_d W,    P^T F = -P_d^T W

with C the elastic flexibility between ties (kept modes, and what they miss), P the ties' rows of z, and W the weights
of the carriages on the ties d. A body without supports that is ridden is balanced by its inertia, as in its influence
lines. Where contacts have lanes' own stiffnesses, F follows from W alone, and z grows by -P^+ F for each unit by which
1/k is larger than the model's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from engine.model.attachment import modal_flexibility_between, residual, shared, tie_shapes
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.model.station_path import Along

UNFELT = 1e-9  # of the largest row of a loose coordinate: what springs feel of one that they do not hold is rounding


@dataclass(frozen=True, eq=False)
class StaticState:
    """Per unit of each of `lane_table.static_loads`: forces of all ties (S or 1, ties, L), and the loose coordinates
    (S or 1, m, L), whose numbers among all modes are ``loose``."""

    force: Array
    loose: Counts
    coordinate: Array


def unrestrained_coordinates(model: SceneModel) -> Counts:
    """Numbers of the coordinates that nothing but springs hold."""
    found: list[int] = []
    for carriage in model.carriages:
        if carriage.rides is not None:
            part = model.bodies[carriage.rides]
            found += (part.modes.start + np.flatnonzero(part.modal.omega == 0.0)).tolist()
    return np.array([*found, *(spring.mode for spring in model.sprung)], dtype=np.int64)


def static_state(model: SceneModel, along: Along) -> StaticState:
    """The static state at the stations of some ways."""
    count = len(model.carriages)
    weights = np.zeros((1, model.ties, count + 1))
    weights[0, np.arange(count), np.arange(count)] = 1.0
    loose = unrestrained_coordinates(model)
    if not model.springs:
        return StaticState(weights, loose, np.zeros((1, len(loose), count + 1)))
    stations, first = along[0].s.size, model.first_spring
    springs, numbers = slice(first, model.first_push), (range(first, model.first_push), range(count))
    held, pushed = (np.swapaxes(tie_shapes(model, ties, along)[:, loose], 1, 2) for ties in numbers)
    soft = flexibility(model, along)
    gap = np.zeros((stations, len(model.springs), count + 1))
    gap[:, :, :count] = soft[:, springs, :count]
    gap[:, :, count] = _level(model, along)
    own = np.array([0.0 if s.rigid else 1.0 / model.study.value(s.keys.stiffness) for s in model.springs])
    force, coordinate = _solved(soft[:, springs, springs] + np.diag(own), held, gap, pushed, model.varying)
    whole = np.zeros((stations, model.ties, force.shape[2]))
    whole[:, :, :count] = weights[:, :, :count]
    whole[:, springs] = force
    return StaticState(whole, loose, coordinate)


def flexibility(model: SceneModel, along: Along) -> Array:
    """(S, ties, ties) elastic flexibility between ties as the march has it, m/N; rows of springs only."""
    found = np.zeros((along[0].s.size, model.ties, model.ties))
    for r in range(model.first_spring, model.first_push):
        for s in range(model.ties):
            for one, other in shared(model, r, s, along):
                found[:, r, s] += modal_flexibility_between(model, one, other, along)
    missed = residual(model, along, np.arange(model.ties))
    return found + missed if missed.size else found


def _level(model: SceneModel, along: Along) -> Array:
    """(S, R) gaps of the springs by the body's own sag, per unit gravity."""
    found = np.zeros((along[0].s.size, len(model.springs)))
    for place, spring in enumerate(model.springs):
        way = along[spring.rider]
        if way.active:
            sag = model.sag(spring.body, way.s, 0)
            found[:, place] = sag if way.here is None else np.where(way.here, sag, 0.0)
    return found


def _solved(matrix: Array, held: Array, gap: Array, pushed: Array, varying: Sequence[int]) -> tuple[Array, Array]:
    """Forces (S, R, L) and loose coordinates (S, m, L); what no spring feels stays at rest. varying: numbers of the
    springs that may be softer, of which the columns before the last tell.

    Rows and columns are scaled to one size, so that one small number tells what is not held.
    """
    springs, count, loads = matrix.shape[1], held.shape[2], gap.shape[2]
    unit = np.maximum(np.trace(matrix, axis1=1, axis2=2), 1e-30)[:, None, None]
    size = np.abs(held).max(axis=(0, 1), initial=0.0)
    felt = size > UNFELT * size.max(initial=0.0)
    held, size = np.where(felt, held, 0.0), np.where(felt, size, 1.0)
    whole = np.zeros((len(matrix), springs + count, springs + count))
    whole[:, :springs, :springs] = matrix / unit
    whole[:, :springs, springs:] = held / size
    whole[:, springs:, :springs] = np.swapaxes(held / size, 1, 2)
    right = np.zeros((len(matrix), springs + count, loads))
    right[:, :springs] = -gap / unit
    right[:, springs:, : pushed.shape[1]] = -np.swapaxes(pushed / size, 1, 2)
    inverse = np.linalg.pinv(whole, rcond=1e-11)
    found = inverse @ right
    force, coordinate = found[:, :springs], found[:, springs:] * unit / size[:, None]
    yielding = -inverse[:, springs:, :springs] / size[:, None]
    softer = [yielding[:, :, number, None] * force[:, number, None, :-1] for number in varying]
    unmoved = np.zeros((len(matrix), springs, len(varying) * (loads - 1)))
    return (
        np.concatenate([force[:, :, :-1], unmoved, force[:, :, -1:]], axis=2),
        np.concatenate([coordinate[:, :, :-1], *softer, coordinate[:, :, -1:]], axis=2),
    )
