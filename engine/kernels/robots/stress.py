"""Bending stresses of a rail under robots, station by station."""

from typing import NamedTuple

import numpy as np

from engine.kernels.jit import called, kernel
from engine.kernels.layout import FloatArray
from engine.kernels.robots.layout import ALONG, GRIP


class Bending(NamedTuple):
    """How a rail of E elements bends: stress (Pa) of the extreme fibre at both ends of every element by its moments
    about y and z, by modes (n, 4 E) and by loads on the ends of elements that modes miss (6 (E + 1), 4 E); ends
    (E + 1): m; across (E, 2, 3): y and z of elements; per_moment (E, 2): Pa per N m, NaN where a section has no fibre
    distances."""

    modes: FloatArray
    missed: FloatArray
    ends: FloatArray
    across: FloatArray
    per_moment: FloatArray


@kernel
def largest_stress(rail, y, grips):
    """(S,) at any place, by coordinates of modes y (S, n) under robots whose ``grips`` are (S, P, OF_GRIP): at the ends
    of elements and on both sides of robots, whose wrenches an element takes as a beam that its ends hold."""
    S, P = grips.shape[:2]
    found, row, loads = np.zeros(S), np.zeros(rail.modes.shape[1]), np.zeros((P, 12))
    on, into = np.zeros(P, dtype=np.int64), np.zeros(P)
    for s in range(S):
        row[:] = 0.0
        for k in range(y.shape[1]):
            add_row(row, y[s, k], rail.modes[k])
        for p in range(P):
            e = min(max(np.searchsorted(rail.ends, grips[s, p, ALONG], side="right") - 1, 0), row.shape[0] // 4 - 1)
            on[p], into[p] = e, grips[s, p, ALONG] - rail.ends[e]
            to_ends(into[p], rail.ends[e + 1] - rail.ends[e], grips[s, p], loads[p])
            for i in range(12):
                add_row(row, loads[p, i], rail.missed[6 * e + i])
        for p in range(P):
            e = on[p]
            for m in range(2):
                axis, part = rail.across[e, m], rail.per_moment[e, m]
                for i in range(3):
                    row[4 * e + m] += part * axis[i] * loads[p, 3 + i]
                    row[4 * e + 2 + m] -= part * axis[i] * loads[p, 9 + i]
        for i in range(0, row.shape[0], 2):
            found[s] = max(found[s], abs(row[i]) + abs(row[i + 1]))
        for p in range(P):
            for beyond in range(2):
                found[s] = max(found[s], beside(rail, row, p, beyond, on, into, grips[s]))
    return found


@called
def add_row(row, part, other):
    """row += part other."""
    for i in range(row.shape[0]):
        row[i] += part * other[i]


@called
def to_ends(x, length, grip, loads):
    """The wrench of a robot as loads (12) on the ends of its element, by cubics of bending."""
    u = x / length
    slope = 6.0 * u * (u - 1.0) / length
    for end in range(2):
        if end == 0:
            a, n, h, dn, dh = 1.0 - u, 1.0 - u * u * (3.0 - 2.0 * u), x * (1.0 - u) ** 2, slope, (1 - u) * (1 - 3 * u)
        else:
            a, n, h, dn, dh = u, u * u * (3.0 - 2.0 * u), x * u * (u - 1.0), -slope, u * (3.0 * u - 2.0)
        first = 6 * end
        loads[first], loads[first + 3] = -a * grip[GRIP], -a * grip[GRIP + 3]
        loads[first + 1] = -n * grip[GRIP + 1] - dn * grip[GRIP + 5]
        loads[first + 2] = -n * grip[GRIP + 2] + dn * grip[GRIP + 4]
        loads[first + 4] = h * grip[GRIP + 2] - dh * grip[GRIP + 4]
        loads[first + 5] = -h * grip[GRIP + 1] - dh * grip[GRIP + 5]


@called
def beside(rail, row, p, beyond, on, into, grips):
    """The stress on one side of robot p: that of its element without loads between, and of these on two supports."""
    e, x = on[p], into[p]
    length, found = rail.ends[e + 1] - rail.ends[e], 0.0
    for m in range(2):
        moment, along, other = 0.0, rail.across[e, m], rail.across[e, 1 - m]
        for o in range(grips.shape[0]):
            if on[o] != e:
                continue
            by_force = (2 * m - 1.0) * min(x, into[o]) * (length - max(x, into[o])) / length
            by_moment = -x / length + (x > into[o] or (o == p and beyond == 1))
            for i in range(3):
                moment += by_force * other[i] * grips[o, GRIP + i] + by_moment * along[i] * grips[o, GRIP + 3 + i]
        own = row[4 * e + m] * (1.0 - x / length) + row[4 * e + 2 + m] * x / length
        found += abs(own + moment * rail.per_moment[e, m])
    return found
