"""Vectors and rotations of one scene in tables of numbers, beside those of `engine.kernels.floating.vectors`."""

import numpy as np

from engine.kernels.floating.vectors import add, cross, dot, times
from engine.kernels.jit import called
from engine.kernels.sines import PI, sin_cos

SMALL = 1e-8  # of the square of an angle: beyond the first terms of the series are 1e-18


@called
def keep_vector(table, i, k, a):
    """A vector into three columns of a row."""
    table[i, k], table[i, k + 1], table[i, k + 2] = a[0], a[1], a[2]


@called
def add_vector(table, i, k, a):
    """A vector added to three columns of a row."""
    table[i, k] += a[0]
    table[i, k + 1] += a[1]
    table[i, k + 2] += a[2]


@called
def keep_matrix(table, i, k, E):
    """A matrix into nine columns of a row."""
    for j in range(3):
        keep_vector(table, i, k + 3 * j, E[j])


@called
def rotation(t):
    """exp of a rotation vector t, as rows (Rodrigues)."""
    square = dot(t, t)
    if square < SMALL:
        a, b = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        angle = np.sqrt(square)
        sine, cosine = sin_cos(angle / PI)
        a, b = sine / angle, (1.0 - cosine) / square
    x, y, z = t
    return (
        (1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y),
        (b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x),
        (b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)),
    )


@called
def spin_of(t, d):
    """Angular velocity of exp(t) where t, a rotation of a rail, changes by d: to |t|^3/24 of d; of -t its transpose."""
    across = cross(t, d)
    return add(d, add(times(0.5, across), times(1.0 / 6.0, cross(t, across))))


@called
def spin_change_of(t, d, dd):
    """The rate of `spin_of`, t changing by d and d by dd."""
    return add(spin_of(t, dd), times(1.0 / 6.0, cross(d, cross(t, d))))
