"""Where the theory ends: bodies that turn fast without getting stiffer by it, and bodies that bend far."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from engine.floating.elastic import ElasticBody
from engine.kernels.floating.observe import BODY_SPIN, OF_BODY
from results_schema.arrays import Array, Mask

if TYPE_CHECKING:
    from engine.floating.march import Marched
    from engine.floating.model import FloatingModel

#: Of its own stiffness that a body may lack by its rotation: a cantilever's lowest frequency is off by 2.5 % then, at a
#: rate of a fifth of it.
MISSING = 0.05
DEEP = 0.1  # of the length, as of bodies that stand: a cantilever's deflection is off by 1 % then


def lacking(body: ElasticBody) -> float:
    """Stiffness that a body lacks which is not stiffened by its rotation, over its own, per square of the rate (s2):
    the largest eigenvalue of int x G dm over diag(omega^2), G the foreshortening. 0 where none lacks, or where that is
    not known, as of frames of beams."""
    if body.stiffens or not body.slender or not body.omega.size:
        return 0.0
    _, along = replace(body, stiffens=True).stiffening()
    return float(np.linalg.eigvalsh(along / np.multiply.outer(body.omega, body.omega))[-1])


def unstiffened_times(model: FloatingModel, marched: Marched) -> Array:
    """(V, B) s, the first station at which a body turns so fast that it lacks `MISSING` of its stiffness; NaN where
    none does."""
    first = model.signal_of("frames") + BODY_SPIN
    found = []
    for b, body in enumerate(model.bodies.values()):
        spin = marched.history[:, :, first + OF_BODY * b : first + OF_BODY * b + 3]
        across = spin[..., 1] ** 2 + spin[..., 2] ** 2  # what turns the track's direction
        found.append(_first(lacking(body) * across > MISSING, marched.times))
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
