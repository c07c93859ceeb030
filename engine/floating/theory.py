"""Where the theory ends: bodies that turn fast without getting stiffer by it, that buckle under what they carry, that
bend far, and ends of tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.floating.lanes import lanes
from engine.kernels.floating.layout import OWN_MASS, REVOLUTE, SPRUNG_MASS, Lane
from engine.kernels.floating.observe import BODY_ATTITUDE, BODY_SPIN, OF_BODY, OF_CARRIAGE
from engine.scene.motions.of_joints import AMPLITUDE, CONSTANT, PHASE, RATE, START
from results_schema.arrays import Array, Mask

if TYPE_CHECKING:
    from engine.floating.bodies.shortening import Shortening
    from engine.floating.march import Marched
    from engine.floating.model import FloatingModel
    from engine.scene.variants import VariantValues

#: Of its own stiffness that a body may lack by its rotation: a cantilever's lowest frequency is off by 2.5 % then, at a
#: rate of a fifth of it.
MISSING = 0.05
RATES = 513  # times at which given motions are looked at beforehand
PRESSED = 0.05  # of the weight that makes a body buckle: less softens it by no more than rotation may go untold
DEEP = 0.1  # of the length, as of bodies that stand: a cantilever's deflection is off by 1 % then


def lacking(model: FloatingModel, name: str) -> Array:
    """(3,) stiffness that a body lacks which is not stiffened by its rotation, over its own, per square of the rate
    about each axis of its frame (s2): the eigenvalue furthest from 0 of what rotation stiffens it by over
    diag(omega^2), with the masses of the bodies that hang on it. 0 where none lacks, or where that is not known, as of
    bodies out of finite-element files."""
    body = model.bodies[name]
    if body.stiffens or body.shortening is None or not body.omega.size:
        return np.zeros(3)
    moments = body.shortening.integrals[1].copy()
    for other in model.bodies:
        if model.frame(other).on == name:
            at = model.frame(other).at
            x = body.length if at is None else at
            moments[:, 0] += _carried(model, other) * x * body.shortening.along(np.array([x]))[0, 0]
    found = []
    for axis in np.eye(3):
        across = (np.eye(3) - np.outer(axis, axis))[: len(moments)]  # places are drawn away from the axis
        ratio = np.einsum("ab,abij->ij", across, moments) / np.multiply.outer(body.omega, body.omega)
        found.append(np.abs(np.linalg.eigvalsh(ratio)).max())
    return np.array(found)


def softened_by_weight(model: FloatingModel, name: str) -> float:
    """By how much of its stiffness the weight that a body bears stiffens or softens one that stands, carriages at the
    end of its track, with the study's own numbers."""
    from scipy.spatial.transform import Rotation

    body, study = model.bodies[name], model.study
    if body.shortening is None or not body.omega.size:
        return 0.0
    pull = study.gravity * Rotation.from_rotvec(model.frame(name).turned).as_matrix()[2, : body.shortening.axes]
    borne = sum(_carried(model, other) for other in model.bodies if model.frame(other).on == name)
    for carriage, own in study.carriage.items():
        if name in model.carriers(own.on):
            borne += sum(float(study.value(f"carriage.{carriage}.{key}") or 0.0) for key in own.masses)
    whole = body.shortening.integrals[0] + borne * body.shortening.along(np.array([body.length]))[0, 0]
    ratio = np.einsum("a,aij->ij", pull, whole) / np.multiply.outer(body.omega, body.omega)
    return float(np.abs(np.linalg.eigvalsh(ratio)).max())


def buckling_ratios(model: FloatingModel, table: Lane, signals: Array) -> Array:
    """(V, B) the weight that stands on each body, its own and that of all that hangs and rides on it, over that under
    which it buckles, as variants of a table stand by their signals (V, ...) at time 0: the largest eigenvalue of what
    weight softens the body by over diag(omega^2). NaN below `PRESSED`, and where it is not known, as of bodies out of
    finite-element files."""
    found = np.full((len(signals), len(model.bodies)), np.nan)
    first = model.signal_of("frames") + BODY_ATTITUDE
    for b, (name, body) in enumerate(model.bodies.items()):
        shorter = body.shortening
        if shorter is None or not body.omega.size:
            continue
        nine = slice(first + OF_BODY * b, first + OF_BODY * b + 9)
        pull = np.einsum("vi,vij->vj", table.gravity, signals[:, nine].reshape(-1, 3, 3))[:, : shorter.axes]
        borne = _borne_by(model, name, shorter, table, signals) / np.multiply.outer(body.omega, body.omega)
        softer = -np.einsum("va,vaij->vij", pull, borne)
        known = np.isfinite(softer).all(axis=(1, 2))
        found[known, b] = np.linalg.eigvalsh(softer[known])[:, -1]
    return np.where(found > PRESSED, found, np.nan)


def _borne_by(model: FloatingModel, name: str, shorter: Shortening, table: Lane, signals: Array) -> Array:
    """(V, A, N, N) the integral of G dm over a body and all that hangs and rides on it."""
    places, masses = [], []
    for other in model.bodies:
        if model.frame(other).on == name:
            at = model.frame(other).at
            places.append(np.full(len(signals), model.bodies[name].length if at is None else at))
            masses.append(_borne(model, other, table))
    for c, carriage in enumerate(model.study.carriage.values()):
        if carriage.on == name:
            places.append(signals[:, model.signal_of("carriages") + OF_CARRIAGE * c])
            masses.append(table.carriages[:, c, OWN_MASS] + table.carriages[:, c, SPRUNG_MASS])
    found = np.repeat(shorter.integrals[0][None], len(signals), axis=0)
    for x, mass in zip(places, masses, strict=True):
        known = np.isfinite(x)  # not of variants that have no place to begin at
        distinct, of = np.unique(np.clip(np.where(known, x, 0.0), 0.0, model.bodies[name].length), return_inverse=True)
        found = found + np.where(known, mass, np.nan)[:, None, None, None] * shorter.along(distinct)[0][of]
    return found


def _borne(model: FloatingModel, name: str, table: Lane) -> Array:
    """(V,) kg of a body and of all that hangs and rides on it."""
    own = np.full(len(table.gravity), _carried(model, name))
    for c, carriage in enumerate(model.study.carriage.values()):
        if name in model.carriers(carriage.on):
            own += table.carriages[:, c, OWN_MASS] + table.carriages[:, c, SPRUNG_MASS]
    return own


def _carried(model: FloatingModel, name: str) -> float:
    """kg of a body and of all that hangs on it."""
    own = sum(_carried(model, other) for other in model.bodies if model.frame(other).on == name)
    return model.bodies[name].mass + own


def given_rates(model: FloatingModel, values: VariantValues, duration: float) -> dict[str, Array]:
    """(V,) rad/s, the largest rate at which given motions alone turn each body, its own joints' and those of what holds
    it; within a duration (s)."""
    motions = lanes(model, values, np.ones(values.size)).motions
    times = np.linspace(0.0, duration, RATES)
    found: dict[str, Array] = {}
    for name in model.bodies:
        rate = found.get(model.frame(name).on, np.zeros(values.size))
        for joint in model.joints:
            if joint.body == name and joint.kind == REVOLUTE and joint.motion >= 0:
                rate = rate + np.abs(rates_at(motions[:, joint.motion], times)).max(axis=1)
        found[name] = rate
    return found


def rates_at(pieces: Array, times: Array) -> Array:
    """(V, T) rates of motions in pieces (V, pieces, 10) at times (T,) s."""
    own, x = _under_way(pieces, times)
    powers = sum(k * own[:, :, CONSTANT + k] * x ** (k - 1) for k in range(1, AMPLITUDE - CONSTANT))
    rate = own[:, :, RATE]
    return np.asarray(powers + own[:, :, AMPLITUDE] * rate * np.cos(rate * x + own[:, :, PHASE]))


def given_way(model: FloatingModel, values: VariantValues, duration: Array, carriage: str) -> tuple[Array, Array]:
    """(V,) twice, m: the least and the largest place of a carriage with a given motion within a duration (V,) s."""
    number = model.motions.index(f"carriage.{carriage}.motion")
    pieces = lanes(model, values, np.ones(values.size)).motions[:, number]
    times = np.linspace(np.zeros(values.size), duration, RATES, axis=1)
    found = places_at(pieces, np.concatenate([times, np.minimum(pieces[:, :, START], duration[:, None])], axis=1))
    return found.min(axis=1), found.max(axis=1)


def ends_of_motions(model: FloatingModel, values: VariantValues) -> dict[str, Array]:
    """(V,) s, when each given motion, and each course of a load, comes to its last piece; by dotted key."""
    starts = lanes(model, values, np.ones(values.size)).motions[:, :, :, START]
    ends = np.where(np.isfinite(starts), starts, 0.0).max(axis=2, initial=0.0)
    return {key: ends[:, m] for m, key in enumerate(model.motions)}


def places_at(pieces: Array, times: Array) -> Array:
    """(V, T) values of motions in pieces (V, pieces, 10) at times (V, T) s."""
    own, x = _under_way(pieces, times)
    powers = sum(own[:, :, CONSTANT + k] * x**k for k in range(AMPLITUDE - CONSTANT))
    return np.asarray(powers + own[:, :, AMPLITUDE] * np.sin(own[:, :, RATE] * x + own[:, :, PHASE]))


def _under_way(pieces: Array, times: Array) -> tuple[Array, Array]:
    """(V, T, 10) the pieces of motions (V, pieces, 10) that last at times (T,) or (V, T) s, and (V, T) since when."""
    number = (pieces[:, None, :, START] <= times[..., None]).sum(axis=2) - 1
    own = np.take_along_axis(pieces, number[:, :, None], axis=1)
    return own, times - own[:, :, START]


def unstiffened_times(model: FloatingModel, marched: Marched) -> Array:
    """(V, B) s, the first station at which a body turns so fast that it lacks `MISSING` of its stiffness; NaN where
    none does."""
    first = model.signal_of("frames") + BODY_SPIN
    found = []
    for b, name in enumerate(model.bodies):
        spin = marched.history[:, :, first + OF_BODY * b : first + OF_BODY * b + 3]
        found.append(_first(spin**2 @ lacking(model, name) > MISSING, marched.times))
    return np.stack(found, axis=1)


def bent_times(model: FloatingModel, marched: Marched) -> Array:
    """(V, B) s, the first station at which the middle or the end of a track is further than `DEEP` of its length from
    where it is undeformed; NaN where none is."""
    found = []
    for name, body in model.bodies.items():
        rows = model.depths[name]
        squares = marched.history[:, :, rows].reshape(*marched.times.shape, -1, 2) ** 2
        furthest = squares.sum(axis=-1).max(axis=-1, initial=0.0)
        found.append(_first(furthest > (DEEP * body.length) ** 2, marched.times))
    return np.stack(found, axis=1)


def _first(beyond: Mask, times: Array) -> Array:
    """(V,) of times (V, stations) the first at which something is so; NaN where it never is."""
    found: Array = np.where(beyond, times, np.inf).min(axis=1)
    return np.where(np.isfinite(found), found, np.nan)
