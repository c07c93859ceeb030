"""Mode shapes along the track of a frame, from nodal displacements and the section forces of the mode.

Between two nodes a quintic takes deflection, slope and curvature of both (mechanics section 1: phi needs a meaningful
second derivative; linear interpolation never converges). Slope and curvature come from rotations and section forces:
w' = rotation + Q/(G A_s) of bending, N/(E A) of extension, T/(G J) of twist, and w'' likewise from their changes. The
forces on an element's ends, K u - omega^2 M u, are far more exact than second derivatives of its cubic.
A concentrated force at a node bends the line of twist, extension and shear there: the mean slope keeps it C1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.frame.elements import stiffness
from engine.bodies.frame.track import TrackBeams, track_places
from engine.bodies.modal.modal_body import Array
from engine.kernels.shapes import rows_between

FORCES = 6  # N, Q_y, Q_z, T, M_y, M_z
SOURCES = 6  # of a quintic: value, slope and curvature at both ends

# Of value, slope and curvature at the left end, then at the right one: coefficients of x^0 to x^5 on [0, 1].
_QUINTIC = (
    (1.0, 0.0, 0.0, -10.0, 15.0, -6.0),
    (0.0, 1.0, 0.0, -6.0, 8.0, -3.0),
    (0.0, 0.0, 0.5, -1.5, 1.5, -0.5),
    (0.0, 0.0, 0.0, 10.0, -15.0, 6.0),
    (0.0, 0.0, 0.0, -4.0, 7.0, -3.0),
    (0.0, 0.0, 0.0, 0.5, -1.0, 0.5),
)


@dataclass(frozen=True, eq=False)
class TrackShapes:
    """Shapes of N modes: values and slopes (E + 1, N) at places (E + 1,), curvatures (E, 2, N) at elements' ends.

    kg^(-1/2), per metre and per square metre.
    """

    places: Array
    values: Array
    slopes: Array
    curvatures: Array

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j phi_k/ds^j at the stations `s` (S,) for several j, as (orders, S, N); at a joint from the right."""
        place = track_places(s, float(self.places[-1]), *orders)
        found = np.empty((len(orders), len(place), self.values.shape[1]))
        tables = differentiated(_QUINTIC, tuple(orders))
        rows_between(self.places, *tables, self._sources, SOURCES, place, found)
        return found

    @cached_property
    def _sources(self) -> Array:
        """(6 E, N) value, slope and curvature at the left end of every element, then at its right one."""
        left = (self.values[:-1], self.slopes[:-1], self.curvatures[:, 0])
        right = (self.values[1:], self.slopes[1:], self.curvatures[:, 1])
        return np.stack([*left, *right], axis=1).reshape(-1, self.values.shape[1])


@lru_cache(maxsize=32)
def differentiated(table: tuple[tuple[float, ...], ...], orders: tuple[int, ...]) -> tuple[Array, Array]:
    """Polynomials (n, n), coefficients of powers, differentiated as often as orders say (orders, n, n), and these."""
    found = np.zeros((len(orders), len(table), len(table)))
    for one, order in zip(found, orders, strict=True):
        left = np.array(table)
        for _ in range(order):
            left = (left * np.arange(left.shape[1]))[:, 1:]
        one[:, : left.shape[1]] = left
    return found, np.array(orders, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class ModeForces:
    """Section forces of N modes: forces, changes (E, 2, 6, N) at both ends of the elements and per metre there."""

    forces: Array
    changes: Array


def mode_forces(track: TrackBeams, moved: Array, inertia: Array, masses: Array) -> ModeForces:
    """From displacements and rotations (E + 1, 6, N) of the track's points, and the accelerations, times -1, under
    which these are in balance: of modes omega^2 times as much; masses (E, 12, 12) in local axes."""
    beams = track.beams
    local, driven = (_local(track, np.concatenate([one[:-1], one[1:]], axis=1)) for one in (moved, inertia))
    ends = stiffness(beams) @ local - masses @ driven
    forces = np.stack([-ends[:, :6], ends[:, 6:]], axis=1)
    at = np.stack([driven[:, :6], driven[:, 6:]], axis=1)
    changes = np.zeros_like(forces)
    changes[:, :, :3] = -beams.mass[:, None, None, None] * at[:, :, :3]
    changes[:, :, 3] = -beams.twist_inertia[:, None, None] * at[:, :, 3]
    changes[:, :, 4] = forces[:, :, 2] - beams.turn_inertia_z[:, None, None] * at[:, :, 4]
    changes[:, :, 5] = -forces[:, :, 1] - beams.turn_inertia_y[:, None, None] * at[:, :, 5]
    return ModeForces(forces, changes)


def track_shapes(track: TrackBeams, moved: Array, forces: ModeForces) -> TrackShapes:
    """Shapes from displacements and rotations (E + 1, 6, N) of the track's points and the modes' section forces."""
    tangent, arm = track.axes[0, 0], np.cross(track.offset, track.direction)
    values = np.einsum("c,icn->in", track.direction, moved[:, :3]) + np.einsum("c,icn->in", arm, moved[:, 3:])
    slopes = np.einsum("c,icn->in", np.cross(tangent, track.direction), moved[:, 3:])
    beside, curvatures = _strains(track, forces.forces), _strains(track, forces.changes)
    slopes[0] += beside[0, 0]
    slopes[1:-1] += 0.5 * (beside[:-1, 1] + beside[1:, 0])
    slopes[-1] += beside[-1, 1]
    _, across_y, across_z = (part[:, None, None] for part in track.parts)
    bending_y, bending_z = (bending[:, None, None] for bending in (track.beams.bending_y, track.beams.bending_z))
    curvatures += across_y * forces.forces[:, :, 5] / bending_y - across_z * forces.forces[:, :, 4] / bending_z
    return TrackShapes(track.places, values, slopes, curvatures)


@dataclass(frozen=True, eq=False)
class AlongShapes:
    """Motion of a track along itself: that of its axis, less what the axis' slope takes from a line beside it.

    lever: m, by which the track is off its axis; beside: the axis' deflections that way, None on the axis.
    """

    axis: TrackShapes
    lever: float = 0.0
    beside: TrackShapes | None = None

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j psi_k/ds^j at the stations `s` (S,) for several j up to 2, as (orders, S, N)."""
        found = self.axis.derivatives(s, orders)
        if self.beside is None:
            return found
        return np.asarray(found - self.lever * self.beside.derivatives(s, [order + 1 for order in orders]))


def _strains(track: TrackBeams, forces: Array) -> Array:
    """(E, 2, N) slope of the track's line by extension, shear and twist, from section forces (E, 2, 6, N)."""
    along, across_y, across_z = track.parts
    beams = track.beams
    soft = (along / beams.axial, across_y / beams.shear_y, across_z / beams.shear_z, track.torque / beams.torsion)
    found = np.zeros((*forces.shape[:2], forces.shape[3]))
    for force, one in enumerate(soft):
        found += one[:, None, None] * forces[:, :, force]
    return found


def _local(track: TrackBeams, moved: Array) -> Array:
    """(E, 12, N) in the elements' axes."""
    blocks = moved.reshape(len(moved), 4, 3, -1)
    turned: Array = np.einsum("eij,ebjn->ebin", track.axes, blocks)
    return turned.reshape(len(moved), 12, -1)
