"""Beam elements with twelve degrees of freedom, many at once, in their own axes.

Order at each end: displacements u, v, w along x, y, z, then rotations about them. Bending along y couples v with
theta_z = v', bending along z couples w with -theta_y = w'. Timoshenko elements use the exact static shapes
(Przemieniecki 1968, 5.6), Phi = 12 E I/(G A_s L^2); Phi = 0 is Euler-Bernoulli.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from engine.bodies.modal.modal_body import Array

AXIAL, TORSION = np.array([0, 6]), np.array([3, 9])
ALONG_Y, ALONG_Z = np.array([1, 5, 7, 11]), np.array([2, 4, 8, 10])
SIGN_Y, SIGN_Z = np.ones(4), np.array([1.0, -1.0, 1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Beams:
    """Uniform elements, all arrays (E,), SI.

    axial E A; torsion G J; bending_y, bending_z: E I of bending along y and z; shear_y, shear_z: G A_s, infinite for
    Euler-Bernoulli; mass per length; twist_inertia, turn_inertia_y, turn_inertia_z: rotary inertia per length of
    twist and of bending along y and z.
    """

    length: Array
    axial: Array
    torsion: Array
    bending_y: Array
    bending_z: Array
    shear_y: Array
    shear_z: Array
    mass: Array
    twist_inertia: Array
    turn_inertia_y: Array
    turn_inertia_z: Array

    def part(self, which: NDArray[np.int64]) -> Beams:
        """Some of the elements."""
        return Beams(*(getattr(self, field.name)[which] for field in fields(self)))

    @property
    def phi_y(self) -> Array:
        """(E,) shear parameter of bending along y."""
        return 12.0 * self.bending_y / (self.shear_y * self.length**2)

    @property
    def phi_z(self) -> Array:
        """(E,) shear parameter of bending along z."""
        return 12.0 * self.bending_z / (self.shear_z * self.length**2)


def deflection_shapes(x: Array, length: Array, phi: Array, derivative: int = 0) -> Array:
    """(4, S) d^j/dx^j of the static deflection at x in [0, length] for unit values of w, w', w, w' at the ends.

    All arguments (S,); w' means the rotation of the section.

    >>> deflection_shapes(np.array([0.5]), np.array([1.0]), np.array([0.0]))[:, 0]
    array([ 0.5  ,  0.125,  0.5  , -0.125])
    """
    z, one = x / length, 1.0 / (1.0 + phi)
    half = 0.5 * phi
    if derivative == 0:
        left, right = 1.0 + phi - phi * z - 3.0 * z**2 + 2.0 * z**3, phi * z + 3.0 * z**2 - 2.0 * z**3
        turn = (1.0 + half) * z - (2.0 + half) * z**2 + z**3, -half * z - (1.0 - half) * z**2 + z**3
    elif derivative == 1:
        left, right = -phi - 6.0 * z + 6.0 * z**2, phi + 6.0 * z - 6.0 * z**2
        turn = 1.0 + half - (4.0 + phi) * z + 3.0 * z**2, -half - (2.0 - phi) * z + 3.0 * z**2
    elif derivative == 2:
        left, right = -6.0 + 12.0 * z, 6.0 - 12.0 * z
        turn = -(4.0 + phi) + 6.0 * z, -(2.0 - phi) + 6.0 * z
    else:
        left, right, turn = 12.0 + 0.0 * z, -12.0 + 0.0 * z, (6.0 + 0.0 * z, 6.0 + 0.0 * z)
    found: Array = np.stack([left, length * turn[0], right, length * turn[1]])
    return found * (one / length**derivative)


def rotation_shapes(x: Array, length: Array, phi: Array) -> Array:
    """(4, S) the section's rotation that belongs to `deflection_shapes`."""
    z, one = x / length, 1.0 / (1.0 + phi)
    found: Array = np.stack(
        [
            6.0 * (z**2 - z) / length,
            3.0 * z**2 - (4.0 + phi) * z + 1.0 + phi,
            6.0 * (z - z**2) / length,
            3.0 * z**2 - (2.0 - phi) * z,
        ]
    )
    return found * one


def stiffness(beams: Beams) -> Array:
    """(E, 12, 12) element stiffness matrices."""
    bars = np.stack([beams.axial / beams.length, beams.torsion / beams.length])
    along_y = _bending(beams.length, beams.bending_y, beams.phi_y)
    along_z = _bending(beams.length, beams.bending_z, beams.phi_z)
    return _in_place(bars[:, :, None, None] * np.array([[1.0, -1.0], [-1.0, 1.0]]), along_y, along_z)


def _in_place(bars: Array, along_y: Array, along_z: Array) -> Array:
    """(E, 12, 12) from matrices of extension and twist (2, E, 2, 2), and of bending along y and z (E, 4, 4)."""
    found = np.zeros((len(along_y), 12, 12))
    found[:, AXIAL[:, None], AXIAL], found[:, TORSION[:, None], TORSION] = bars
    found[:, ALONG_Y[:, None], ALONG_Y] = along_y * np.outer(SIGN_Y, SIGN_Y)
    found[:, ALONG_Z[:, None], ALONG_Z] = along_z * np.outer(SIGN_Z, SIGN_Z)
    return found


def _bending(length: Array, bending: Array, phi: Array) -> Array:
    """(E, 4, 4) on w, w', w, w'."""
    one, h = np.ones_like(length), length
    near, far = (4.0 + phi) * h**2, (2.0 - phi) * h**2
    rows = [
        [12.0 * one, 6.0 * h, -12.0 * one, 6.0 * h],
        [6.0 * h, near, -6.0 * h, far],
        [-12.0 * one, -6.0 * h, 12.0 * one, -6.0 * h],
        [6.0 * h, far, -6.0 * h, near],
    ]
    return np.moveaxis(np.array(rows), 2, 0) * (bending / (h**3 * (1.0 + phi)))[:, None, None]


def consistent_mass(beams: Beams) -> Array:
    """(E, 12, 12) masses of the same shapes, by quadrature that is exact for them."""
    bars = np.stack([beams.mass * beams.length, beams.twist_inertia * beams.length])
    along_y = _bending_mass(beams, beams.phi_y, beams.turn_inertia_y)
    along_z = _bending_mass(beams, beams.phi_z, beams.turn_inertia_z)
    return _in_place(bars[:, :, None, None] * (np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0), along_y, along_z)


def _bending_mass(beams: Beams, phi: Array, turn_inertia: Array) -> Array:
    """(E, 4, 4) translation and rotary inertia on w, w', w, w'."""
    found = np.zeros((len(beams.length), 4, 4))
    for point, weight in zip(*np.polynomial.legendre.leggauss(4), strict=True):
        place = 0.5 * (1.0 + point) * beams.length
        width = 0.5 * weight * beams.length
        for shapes, inertia in (
            (deflection_shapes(place, beams.length, phi), beams.mass),
            (rotation_shapes(place, beams.length, phi), turn_inertia),
        ):
            found += np.einsum("ae,be,e->eab", shapes, shapes, inertia * width)
    return found


def lumped_mass(beams: Beams) -> Array:
    """(E, 12, 12) half of the element at each end, without inertia against the rotations of bending."""
    found = np.zeros((len(beams.length), 12, 12))
    for end in (0, 6):
        for direction in range(3):
            found[:, end + direction, end + direction] = 0.5 * beams.mass * beams.length
        found[:, end + 3, end + 3] = 0.5 * beams.twist_inertia * beams.length
        found[:, end + 4, end + 4] = 0.5 * beams.turn_inertia_z * beams.length
        found[:, end + 5, end + 5] = 0.5 * beams.turn_inertia_y * beams.length
    return found
