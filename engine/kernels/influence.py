"""Influence functions of a uniform beam on restraints, dimensionless; derived in `bodies.beam_statics`."""

from typing import NamedTuple

import numpy as np

from engine.kernels.jit import kernel, piece
from engine.kernels.layout import FloatArray, IntArray


class Functionals(NamedTuple):
    """The entries of u: restraints at places at (n,), of deflection or slope (order (n,): 0 or 1), then rigid (R, 2)
    modes a + b x, then -1 and -x."""

    at: FloatArray
    order: IntArray
    rigid: FloatArray


@piece
def point_load(x, s, derivative):
    """d^n/dx^n of |x - s|^3/12; a jump is taken from the right, at x = 1 from the left."""
    u = x - s
    found = 0.0
    if derivative == 0:
        found = abs(u) * u * u / 12.0
    elif derivative == 1:
        found = abs(u) * u / 4.0
    elif derivative == 2:
        found = abs(u) / 2.0
    elif derivative == 3:
        found = 0.5 if u > 0.0 or (u == 0.0 and x < 1.0) else -0.5
    return found


@piece
def even_load(x, derivative):
    """d^n/dx^n of the integral over t in [0, 1] of |x - t|^3/12: the load 1."""
    y = 1.0 - x
    if derivative == 0:
        return (x * x * x * x + y * y * y * y) / 48.0
    if derivative == 1:
        return (x * x * x - y * y * y) / 12.0
    if derivative == 2:
        return (x * x + y * y) / 4.0
    return (x - y) / 2.0


@piece
def rising_load(x, derivative):
    """d^n/dx^n of the integral over t in [0, 1] of t |x - t|^3/12: the load t."""
    y = 1.0 - x
    if derivative == 0:
        return x * even_load(x, 0) + (y * y * y * y * y - x * x * x * x * x) / 60.0
    if derivative == 1:
        return x * even_load(x, 1) - (x * x * x * x + y * y * y * y) / 16.0
    if derivative == 2:
        return x * even_load(x, 2) + (y * y * y - x * x * x) / 6.0
    return x * x / 2.0 - 0.25


@piece
def functionals_at(of, x, derivative, found):
    """d^n/dx^n of u(x), into found (n + R + 2,)."""
    count = of.at.size
    for j in range(count):
        value = point_load(x, of.at[j], derivative + of.order[j])
        found[j] = value if of.order[j] == 0 else -value
    for r in range(of.rigid.shape[0]):
        found[count + r] = of.rigid[r, 0] * even_load(x, derivative) + of.rigid[r, 1] * rising_load(x, derivative)
    found[found.size - 2] = -1.0 if derivative == 0 else 0.0
    found[found.size - 1] = -x if derivative == 0 else (-1.0 if derivative == 1 else 0.0)


@kernel
def functionals(of, x, derivative, found):
    """The same at places x (S,), into found (S, n + R + 2)."""
    for i in range(x.size):
        functionals_at(of, x[i], derivative, found[i])


@kernel
def influence(of, inverse, x, s, derivative, found):
    """d^j/dx^j of  g(x, s) - u(x)^T S^-1 u(s)  for pairs of places, into found (pairs,).

    x, s: (pairs,), or (1,) where it is the same in all;  inverse: S^-1.
    """
    size = inverse.shape[0]
    left, right = np.empty(size), np.empty(size)
    for i in range(found.size):
        here, there = x[min(i, x.size - 1)], s[min(i, s.size - 1)]
        if i < x.size:
            functionals_at(of, here, derivative, left)
        if i < s.size:
            functionals_at(of, there, 0, right)
        value = point_load(here, there, derivative)
        for j in range(size):
            reaction = 0.0
            for k in range(size):
                reaction += inverse[j, k] * right[k]
            value -= left[j] * reaction
        found[i] = value
