"""Natural frequencies of a whole scene with its carriages frozen at given places: bodies, what rides on them, masses.

Nothing moves along the track, so there are no convective terms, and nothing is damped. Coordinates x are the modes of
all bodies, the sprung masses, and one more for every mass that touches its body. Masses, springs and rigid joints are
ties: each pulls the rows of G together with a force h over a compliance,

    M x'' + K x + G h = 0,    G^T x = S h,    S = diag(1/k) + R,

with M and K diagonal, R the static flexibility between ties that the kept modes miss
(`attachment.residual_flexibility`), and 1/k = 0 for masses and joints. S may be singular, so the inverse is what is
computed, shifted by sigma M, as rigid-body motions have no stiffness: with D = (K + sigma M)^-1

    (K + sigma M + G S^-1 G^T)^-1 = D - D G (S + G^T D G)^-1 G^T D,

whose eigenvalues in the metric of M are 1/(omega^2 + sigma).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.model.attachment import residual_flexibility, shared, tie_shapes
from engine.model.lane_table import from_blocks, in_whole_blocks, lane_table
from engine.model.scene_model import SceneModel
from engine.model.station_path import Along
from engine.scene.variants import VariantValues
from results_schema.arrays import Array

UNRESISTED = 1e-10  # of the shift: omega^2 below it is a motion that nothing resists, and rounding
ENDLESS = 1e-13  # of the largest: what no force moves, as a joint or a massless wheel forbids it
MASSLESS = 1e-12  # of the body's mass: wheels without mass, which follow the track
MOST_BYTES = 32 * 2**20  # of matrices at a time


class CoupledModes(NamedTuple):
    """omega (V, S, K) in rad/s, ascending, and shapes (V, S, N, K) over the modes of all bodies and the sprung masses,
    of unit modal mass. Motions that nothing resists are left out, and NaN stands where there are no more."""

    omega: Array
    shapes: Array


@dataclass(frozen=True, eq=False)
class _System:
    """stiffness (n,), mass (V, n), rows (S, n, T), missed (S, T, T), compliance (V, T), shift sigma in 1/s2."""

    stiffness: Array
    mass: Array
    rows: Array
    missed: Array
    compliance: Array
    shift: float

    def inverse(self, variants: slice) -> Array:
        """(V, S, n, n) of some variants, scaled by the root of the mass."""
        mass = self.mass[variants]
        soft = 1.0 / (self.stiffness + self.shift * mass)
        wide = soft[:, None, :, None] * self.rows
        small = np.swapaxes(self.rows, 1, 2) @ wide + self.missed
        small += self.compliance[variants, None, None, :] * np.eye(small.shape[-1])
        wide = np.sqrt(mass)[:, None, :, None] * wide
        found = -wide @ np.linalg.solve(small, np.swapaxes(wide, 2, 3))
        diagonal = np.arange(self.stiffness.size)
        found[:, :, diagonal, diagonal] += (mass * soft)[:, None, :]
        return np.asarray(0.5 * (found + np.swapaxes(found, 2, 3)))


def coupled_frequencies(model: SceneModel, values: VariantValues, along: Along, count: int) -> Array:
    """(V, S, count) lowest natural frequencies in rad/s of some variants of a scene, with the riders at `along`."""
    system = _system(model, values, along)
    found = np.full((values.size, along[0].s.size, count), np.nan)
    for variants in _parts(system, values.size):
        inverse = np.asarray(np.linalg.eigvalsh(system.inverse(variants)), dtype=np.float64)
        found[variants] = _lowest(inverse, system.shift, count)[0]
    return found


def coupled_modes(model: SceneModel, values: VariantValues, along: Along, count: int) -> CoupledModes:
    """The same with their shapes, which are those of the kept modes."""
    system, modes = _system(model, values, along), model.omega.size
    omega = np.full((values.size, along[0].s.size, count), np.nan)
    shapes = np.full((*omega.shape[:2], modes, count), np.nan)
    for variants in _parts(system, values.size):
        inverse, vectors = np.linalg.eigh(system.inverse(variants))
        omega[variants], order = _lowest(inverse, system.shift, count)
        lines = np.take_along_axis(vectors, order[:, :, None, :], axis=3)
        root = np.sqrt(system.mass[variants, None, :modes, None])
        lines = np.divide(lines[:, :, :modes], root, out=np.zeros_like(lines[:, :, :modes]), where=root > 0.0)
        shapes[variants, :, :, : order.shape[2]] = np.where(
            np.isnan(omega[variants, :, None, : order.shape[2]]), np.nan, lines
        )
    return CoupledModes(omega, shapes)


def _lowest(inverse: Array, shift: float, count: int) -> tuple[Array, NDArray[np.int64]]:
    """The lowest omega (V, S, count), and which eigenvalues (V, S, up to count) they belong to."""
    known = inverse > ENDLESS * inverse.max(axis=2, keepdims=True)
    square = np.where(known, 1.0 / np.where(known, inverse, 1.0) - shift, np.inf)
    square = np.where(square > UNRESISTED * shift, square, np.inf)
    order = np.argsort(square, axis=2, kind="stable")[:, :, :count]
    square = np.take_along_axis(square, order, axis=2)
    found = np.full((*square.shape[:2], count), np.nan)
    found[:, :, : order.shape[2]] = np.where(np.isfinite(square), np.sqrt(square), np.nan)
    return found, order


def _parts(system: _System, size: int) -> Iterator[slice]:
    """Variants in parts of bounded memory."""
    stations, unknowns = system.rows.shape[:2]
    step = max(1, MOST_BYTES // (8 * 3 * stations * unknowns**2))
    for first in range(0, size, step):
        yield slice(first, min(first + step, size))


def _system(model: SceneModel, values: VariantValues, along: Along) -> _System:
    """The matrices of all variants at all stations."""
    lanes = lane_table(model, in_whole_blocks(values))
    masses = [number for number, carriage in enumerate(model.carriages) if carriage.inertia != "force"]
    masses += range(model.first_push, model.ties)
    ties = np.array([*masses, *range(model.first_spring, model.first_push)], dtype=np.int64)
    on_track = from_blocks(lanes.mass, values.size)[masses]
    least = MASSLESS * model.leading_body.modal.mass
    mobile = from_blocks(lanes.inverse_modal_mass, values.size)
    own = np.divide(1.0, mobile, out=np.zeros_like(mobile), where=mobile > 0.0)  # pulsating forces swing by themselves
    mass = np.concatenate([own, np.maximum(on_track, least)])
    mass[model.residuals] = 0.0  # what kept modes miss between ties is among what these yield
    spring = from_blocks(lanes.spring, values.size)[ties]
    stiffness = np.concatenate([model.omega**2, np.zeros(len(masses))])
    stiffness[model.pulses] = model.first_omega**2
    return _System(
        stiffness=stiffness,
        mass=np.ascontiguousarray(mass.T),
        rows=_rows(model, along, ties, len(masses)),
        missed=_missed(model, along, ties),
        compliance=np.divide(1.0, spring, out=np.zeros_like(spring), where=spring > 0.0).T,
        shift=model.first_omega**2,
    )


def _rows(model: SceneModel, along: Along, ties: NDArray[np.int64], masses: int) -> Array:
    """(S, n, T) what every tie holds together: the track, and the mass or what rides."""
    touching = np.zeros((along[0].s.size, masses, len(ties)))
    touching[:, np.arange(masses), np.arange(masses)] = -1.0
    return np.concatenate([tie_shapes(model, ties.tolist(), along), touching], axis=1)


def _missed(model: SceneModel, along: Along, ties: NDArray[np.int64]) -> Array:
    """(S, T, T) flexibility that the kept modes miss between ties, m/N; masses feel it here as springs do."""
    found = np.zeros((along[0].s.size, len(ties), len(ties)))
    if not model.numerics.static_correction:
        return found
    for i, r in enumerate(ties):
        for j, s in enumerate(ties[: i + 1]):
            for one, other in shared(model, int(r), int(s), along):
                found[:, i, j] += residual_flexibility(model, one, other, along)
            found[:, j, i] = found[:, i, j]
    return found
