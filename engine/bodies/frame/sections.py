"""Section forces along the track of a frame: of every mode, of a load on the track, and of own weight.

On the face whose outward normal runs along the track: N, Q_y, Q_z, T, M_y, M_z. In the plane of load and track, with
(n_y, n_z) the load's direction across it: bending moment n_z M_y - n_y M_z, positive when it sags (tension on the side
to which the load points), shear force n_y Q_y + n_z Q_z = dM/ds. The fibre of stress lies on that side, at
(n_y c_y, n_z c_z): sigma = N/A + M_y z/I_y - M_z y/I_z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.frame.elements import deflection_shapes, stiffness
from engine.bodies.frame.shapes import FORCES, ModeForces
from engine.bodies.frame.statics import TrackStatics, places_on
from engine.bodies.frame.track import Line, TrackBeams, track_places
from engine.bodies.modal.modal_body import Array, refuse_loose
from results_schema.arrays import Counts
from results_schema.errors import BadInput

QUANTITIES = ("bending_moment", "shear_force", "axial_force", "torque", "stress", "strain")


@dataclass(frozen=True, eq=False)
class TrackSections:
    """Section forces on a track, of loads and of modes; within an element those of modes are cubics."""

    statics: TrackStatics
    modes: ModeForces

    def rows(self, quantity: str, s: ArrayLike) -> Array:
        """(S, N) a section force, stress or strain of every mode at stations `s`; at a joint from the right."""
        track = self.statics.track
        place = track_places(s, self.statics.length)
        element, x = track.at(place)
        weights = section_weights(track, quantity)[element]
        cubic = deflection_shapes(x, track.beams.length[element], np.zeros_like(x))
        found = np.zeros((len(place), self.modes.forces.shape[3]))
        for force in range(FORCES):
            for end in range(2):
                value = cubic[2 * end][:, None] * self.modes.forces[element, end, force]
                value += cubic[2 * end + 1][:, None] * self.modes.changes[element, end, force]
                found += weights[:, force, None] * value
        return found

    def influence_at(self, quantity: str, x: ArrayLike, s: ArrayLike) -> Array:
        """The same at `x` per unit force at `s`, for pairs that are broadcast against each other."""
        place, load = (places_on(one, self.statics.length, 0) for one in (x, s))
        return self.statics.pairs(quantity, partial(self._read, quantity), partial(self._held, quantity)).at(
            place, load
        )

    def _read(self, quantity: str, x: Array) -> Array:
        """(X, 12) the same at `x` of displacements and rotations of its element's ends."""
        track = self.statics.track
        element, at = track.at(x)
        each = np.repeat(np.arange(len(x)), 12)
        ends = forces_from_ends(track, element[each], at[each], np.tile(np.eye(12), (len(x), 1)))
        return np.asarray(np.sum(section_weights(track, quantity)[element[each]] * ends, axis=1)).reshape(-1, 12)

    def _held(self, quantity: str, x: Array, s: Array) -> Array:
        """(S,) the same at `x` of an element with held ends per unit force at `s`."""
        track = self.statics.track
        forces = held_forces(track, x, s, self.statics.loads)
        return np.asarray(np.sum(section_weights(track, quantity)[track.at(x)[0]] * forces, axis=1))

    def own_weight(self, quantity: str, x: ArrayLike) -> Array:
        """The same at `x` under own weight per unit gravity. Raises BadInput for a body that nothing holds."""
        refuse_loose(self.statics.rigid)
        track = self.statics.track
        element, at = track.at(track_places(x, self.statics.length))
        spread = spread_forces(track, element, at, self.statics.spread[element])
        found = np.sum(section_weights(track, quantity)[element] * spread, axis=1)
        return np.asarray(found + self.under_response(quantity, self.statics.weight, x))

    def under_response(self, quantity: str, response: Array, x: ArrayLike) -> Array:
        """The same at `x` where the track's points move by `response` (6 (E + 1),)."""
        track = self.statics.track
        element, at = track.at(track_places(x, self.statics.length))
        ends = response.reshape(-1, 6)
        forces = forces_from_ends(track, element, at, np.concatenate([ends[element], ends[element + 1]], axis=1))
        return np.asarray(np.sum(section_weights(track, quantity)[element] * forces, axis=1))


def section_weights(track: TrackBeams, quantity: str) -> Array:
    """(E, 6) a quantity as a sum of N, Q_y, Q_z, T, M_y, M_z. Raises BadInput for an unknown one."""
    if quantity not in QUANTITIES:
        expected = f"one of {', '.join(QUANTITIES)}"
        raise BadInput("no such section force", where="quantity", expected=expected, received=repr(quantity))
    _, y, z = track.parts
    size = np.hypot(y, z)
    y, z = y / size, z / size
    found = np.zeros((len(y), FORCES))
    if quantity == "bending_moment":
        found[:, 4], found[:, 5] = z, -y
    elif quantity == "shear_force":
        found[:, 1], found[:, 2] = y, z
    elif quantity in ("axial_force", "torque"):
        found[:, 0 if quantity == "axial_force" else 3] = 1.0
    else:
        modulus = track.beams.axial / track.area
        part = modulus if quantity == "stress" else 1.0
        fibre_y, fibre_z = (np.where(np.abs(n) > 0.0, n * c, 0.0) for n, c in zip((y, z), track.fibres.T, strict=True))
        found[:, 0] = part / track.beams.axial
        found[:, 4] = part * fibre_z / track.beams.bending_z
        found[:, 5] = -part * fibre_y / track.beams.bending_y
    return found


def forces_from_ends(track: TrackBeams, element: Counts, x: Array, moved: Array) -> Array:
    """(S, 6) section forces from displacements (S, 12) of the ends of elements without load."""
    axes, beams = track.axes[element], track.beams.part(element)
    local = np.einsum("sij,sbj->sbi", axes, moved.reshape(-1, 4, 3)).reshape(-1, 12)
    found: Array = -np.einsum("sij,sj->si", stiffness(beams)[:, :6], local)
    found[:, 4] += found[:, 2] * x
    found[:, 5] -= found[:, 1] * x
    return found


def held_forces(track: TrackBeams, x: Array, s: Array, loads: Line) -> Array:
    """(S, 6) section forces of an element with held ends under the unit load of a line at s, from `held_parts`."""
    element, _ = track.at(x)
    beams = track.beams.part(element)
    along, y, z = (loads.held_parts(x, s, derivative) for derivative in (1, 2, 3))
    found = np.zeros((len(x), FORCES))
    found[:, 0], found[:, 3] = along[0] * beams.axial, along[3] * beams.torsion
    found[:, 1], found[:, 2] = -beams.bending_y * z[1], -beams.bending_z * z[2]
    found[:, 4], found[:, 5] = -beams.bending_z * y[2], beams.bending_y * y[1]
    return found


def spread_forces(track: TrackBeams, element: Counts, x: Array, load: Array) -> Array:
    """(S, 6) section forces of an element with held ends under force per length `load` (S, 3)."""
    length, (along, y, z) = track.beams.length[element], load.T
    curve = (length**2 - 6.0 * x * (length - x)) / 12.0
    found = np.zeros((len(x), FORCES))
    found[:, 0], found[:, 1], found[:, 2] = ((0.5 * length - x) * part for part in (along, y, z))
    found[:, 4], found[:, 5] = -z * curve, y * curve
    return found
