"""The equations of several ties at one station: their sums over the modes, four a pass, and the small dense system.

See ``march`` for the equations. Loops over lanes stand inside, so that every sum is a row of lanes.
"""

from typing import NamedTuple

import numpy as np

from engine.kernels.jit import piece
from engine.kernels.layout import CLOSED, CURVE, FORCE, LANES, RATE, FloatArray
from engine.kernels.record import GRAVITY, PUSH, TIE, C, D, U, V


class Sums(NamedTuple):
    """Sums over the modes at one station.

    motion, gap (reacting, LANES): w.c* - A.v* - B.u*  and  p.(beta c* - u*) of every reacting tie;  factor, soft
    (reacting, ties in pairs, LANES): w.(D p) and p.(D p), the p being that of the other tie.
    """

    motion: FloatArray
    gap: FloatArray
    factor: FloatArray
    soft: FloatArray


@piece
def four(k):
    """Numbers of four modes from k on; without a sign, so that no index is taken from the end."""
    return np.uint64(k), np.uint64(k + 1), np.uint64(k + 2), np.uint64(k + 3)


@piece
def pair(ties, s):
    """Numbers of the ties s and s + 1, and 0.0 in place of 1.0 where there is no second one."""
    last = ties.rows.shape[2] - 1
    return np.uint64(s), np.uint64(min(s + 1, last)), 1.0 if s < last else 0.0


@piece
def sum_motion(sums, i, work, ties, n):
    """Kinematic sums of reacting tie i at station n, with the products with the first two ties."""
    motion, factor, rows, r = sums.motion, sums.factor, ties.rows, np.uint64(ties.reacting[i])
    modes, (s, t, second) = rows.shape[1], pair(ties, 0)
    for k in range(0, modes - 3, 4):
        k0, k1, k2, k3 = four(k)
        w0, a0, b0 = rows[n, k0, r, CLOSED], rows[n, k0, r, RATE], rows[n, k0, r, CURVE]
        w1, a1, b1 = rows[n, k1, r, CLOSED], rows[n, k1, r, RATE], rows[n, k1, r, CURVE]
        w2, a2, b2 = rows[n, k2, r, CLOSED], rows[n, k2, r, RATE], rows[n, k2, r, CURVE]
        w3, a3, b3 = rows[n, k3, r, CLOSED], rows[n, k3, r, RATE], rows[n, k3, r, CURVE]
        s0, s1, s2, s3 = (
            w0 * rows[n, k0, s, FORCE],
            w1 * rows[n, k1, s, FORCE],
            w2 * rows[n, k2, s, FORCE],
            w3 * rows[n, k3, s, FORCE],
        )
        t0, t1, t2, t3 = (
            second * w0 * rows[n, k0, t, FORCE],
            second * w1 * rows[n, k1, t, FORCE],
            second * w2 * rows[n, k2, t, FORCE],
            second * w3 * rows[n, k3, t, FORCE],
        )
        for j in range(LANES):
            motion[i, j] += (
                (w0 * work[k0, C, j] - (a0 * work[k0, V, j] + b0 * work[k0, U, j]))
                + (w1 * work[k1, C, j] - (a1 * work[k1, V, j] + b1 * work[k1, U, j]))
            ) + (
                (w2 * work[k2, C, j] - (a2 * work[k2, V, j] + b2 * work[k2, U, j]))
                + (w3 * work[k3, C, j] - (a3 * work[k3, V, j] + b3 * work[k3, U, j]))
            )
            d0, d1, d2, d3 = work[k0, D, j], work[k1, D, j], work[k2, D, j], work[k3, D, j]
            factor[i, 0, j] += (s0 * d0 + s1 * d1) + (s2 * d2 + s3 * d3)
            factor[i, 1, j] += (t0 * d0 + t1 * d1) + (t2 * d2 + t3 * d3)
    for k in range(modes - modes % 4, modes):
        w, a, b = rows[n, k, r, CLOSED], rows[n, k, r, RATE], rows[n, k, r, CURVE]
        ws, wt = w * rows[n, k, s, FORCE], second * w * rows[n, k, t, FORCE]
        for j in range(LANES):
            motion[i, j] += w * work[k, C, j] - (a * work[k, V, j] + b * work[k, U, j])
            factor[i, 0, j] += ws * work[k, D, j]
            factor[i, 1, j] += wt * work[k, D, j]


@piece
def sum_gap(sums, i, work, ties, n, beta):
    """Sums of the gap of reacting tie i at station n, with the products with the first two ties."""
    gap, soft, rows, r = sums.gap, sums.soft, ties.rows, np.uint64(ties.reacting[i])
    modes, (s, t, second) = rows.shape[1], pair(ties, 0)
    for k in range(0, modes - 3, 4):
        k0, k1, k2, k3 = four(k)
        p0, p1, p2, p3 = rows[n, k0, r, FORCE], rows[n, k1, r, FORCE], rows[n, k2, r, FORCE], rows[n, k3, r, FORCE]
        s0, s1, s2, s3 = (
            p0 * rows[n, k0, s, FORCE],
            p1 * rows[n, k1, s, FORCE],
            p2 * rows[n, k2, s, FORCE],
            p3 * rows[n, k3, s, FORCE],
        )
        t0, t1, t2, t3 = (
            second * p0 * rows[n, k0, t, FORCE],
            second * p1 * rows[n, k1, t, FORCE],
            second * p2 * rows[n, k2, t, FORCE],
            second * p3 * rows[n, k3, t, FORCE],
        )
        for j in range(LANES):
            gap[i, j] += (
                p0 * (beta * work[k0, C, j] - work[k0, U, j]) + p1 * (beta * work[k1, C, j] - work[k1, U, j])
            ) + (p2 * (beta * work[k2, C, j] - work[k2, U, j]) + p3 * (beta * work[k3, C, j] - work[k3, U, j]))
            d0, d1, d2, d3 = work[k0, D, j], work[k1, D, j], work[k2, D, j], work[k3, D, j]
            soft[i, 0, j] += (s0 * d0 + s1 * d1) + (s2 * d2 + s3 * d3)
            soft[i, 1, j] += (t0 * d0 + t1 * d1) + (t2 * d2 + t3 * d3)
    for k in range(modes - modes % 4, modes):
        p = rows[n, k, r, FORCE]
        ps, pt = p * rows[n, k, s, FORCE], second * p * rows[n, k, t, FORCE]
        for j in range(LANES):
            gap[i, j] += p * (beta * work[k, C, j] - work[k, U, j])
            soft[i, 0, j] += ps * work[k, D, j]
            soft[i, 1, j] += pt * work[k, D, j]


@piece
def sum_pair(matrix, i, s, work, ties, n, column):
    """matrix[i, s] and the next += (column of reacting tie i).(D p of ties s and s + 1) at station n."""
    rows, r = ties.rows, np.uint64(ties.reacting[i])
    modes, (one, other, second) = rows.shape[1], pair(ties, s)
    for k in range(0, modes - 3, 4):
        k0, k1, k2, k3 = four(k)
        w0, w1, w2, w3 = rows[n, k0, r, column], rows[n, k1, r, column], rows[n, k2, r, column], rows[n, k3, r, column]
        s0, s1, s2, s3 = (
            w0 * rows[n, k0, one, FORCE],
            w1 * rows[n, k1, one, FORCE],
            w2 * rows[n, k2, one, FORCE],
            w3 * rows[n, k3, one, FORCE],
        )
        t0, t1, t2, t3 = (
            second * w0 * rows[n, k0, other, FORCE],
            second * w1 * rows[n, k1, other, FORCE],
            second * w2 * rows[n, k2, other, FORCE],
            second * w3 * rows[n, k3, other, FORCE],
        )
        for j in range(LANES):
            d0, d1, d2, d3 = work[k0, D, j], work[k1, D, j], work[k2, D, j], work[k3, D, j]
            matrix[i, s, j] += (s0 * d0 + s1 * d1) + (s2 * d2 + s3 * d3)
            matrix[i, s + 1, j] += (t0 * d0 + t1 * d1) + (t2 * d2 + t3 * d3)
    for k in range(modes - modes % 4, modes):
        w = rows[n, k, r, column]
        ws, wt = w * rows[n, k, one, FORCE], second * w * rows[n, k, other, FORCE]
        for j in range(LANES):
            matrix[i, s, j] += ws * work[k, D, j]
            matrix[i, s + 1, j] += wt * work[k, D, j]


@piece
def gather_ties(sums, work, ties, beta, n):
    """Add all modes to the sums of every reacting tie at station n."""
    for i in range(ties.reacting.shape[0]):
        r = ties.reacting[i]
        if ties.moves[r]:
            sum_motion(sums, i, work, ties, n)
            for s in range(2, ties.rows.shape[2], 2):
                sum_pair(sums.factor, i, s, work, ties, n, CLOSED)
        if ties.springs[r]:
            sum_gap(sums, i, work, ties, n, beta)
            for s in range(2, ties.rows.shape[2], 2):
                sum_pair(sums.soft, i, s, work, ties, n, FORCE)


@piece
def set_ties(b, sums, ties, lanes, beta, block, n):
    """Right-hand sides of one block at station n in b, and the matrix I + gain w.(D p) + stiff beta p.(D p) in
    ``factor``; the other sums are cleared."""
    motion, gap, factor, soft = sums.motion, sums.gap, sums.factor, sums.soft
    for i in range(ties.reacting.shape[0]):
        r = ties.reacting[i]
        drive, level = ties.drive[n, r], ties.level[n, r]
        for j in range(LANES):
            gain, stiff = lanes.gain[block, r, j], lanes.stiff[block, r, j]
            b[TIE + r, j] = lanes.load[block, r, j] + (
                gain * (motion[i, j] - drive * b[GRAVITY, j]) + stiff * (gap[i, j] - level * b[GRAVITY, j])
            )
            motion[i, j] = 0.0
            gap[i, j] = 0.0
        for s in range(lanes.gain.shape[1]):
            one = 1.0 if r == s else 0.0
            for j in range(LANES):
                factor[i, s, j] = one + (
                    lanes.gain[block, r, j] * factor[i, s, j] + lanes.stiff[block, r, j] * beta * soft[i, s, j]
                )
                soft[i, s, j] = 0.0


@piece
def solve_ties(b, factor, ties, lanes, block):
    """Solve for the forces of one block and clear the matrix.

    Dead loads go to the right-hand side. Gauss without pivoting: the matrix is the identity plus a product that is
    positive wherever the march is stable.
    """
    count = ties.reacting.shape[0]
    for s in range(ties.given.shape[0]):
        for j in range(LANES):
            b[TIE + ties.given[s], j] = lanes.load[block, ties.given[s], j]
        for i in range(count):
            for j in range(LANES):
                b[TIE + ties.reacting[i], j] -= factor[i, ties.given[s], j] * b[TIE + ties.given[s], j]
    for i in range(count):
        r = ties.reacting[i]
        for j in range(LANES):
            factor[i, r, j] = 1.0 / factor[i, r, j]
        for m in range(i + 1, count):
            row = TIE + ties.reacting[m]
            for j in range(LANES):
                factor[m, r, j] *= factor[i, r, j]
            for j in range(LANES):
                b[row, j] -= factor[m, r, j] * b[TIE + r, j]
            for t in range(i + 1, count):
                for j in range(LANES):
                    factor[m, ties.reacting[t], j] -= factor[m, r, j] * factor[i, ties.reacting[t], j]
    for i in range(count - 1, -1, -1):
        r = ties.reacting[i]
        for m in range(i + 1, count):
            for j in range(LANES):
                b[TIE + r, j] -= factor[i, ties.reacting[m], j] * b[TIE + ties.reacting[m], j]
        for j in range(LANES):
            b[TIE + r, j] *= factor[i, r, j]
    factor[:] = 0.0


@piece
def push_four(rows, n, k, r):
    """p of mode k at station n in the four ties from r on, 0 where there are fewer."""
    many = rows.shape[2]
    return (
        rows[n, k, r, FORCE],
        rows[n, k, r + 1, FORCE] if r + 1 < many else 0.0,
        rows[n, k, r + 2, FORCE] if r + 2 < many else 0.0,
        rows[n, k, r + 3, FORCE] if r + 3 < many else 0.0,
    )


@piece
def push_on_mode(b, rows, n, k, first):
    """b[PUSH] = sum over the ties from ``first`` on of p F of mode k at station n; b ends with rows of zeros."""
    for j in range(LANES):
        b[PUSH, j] = 0.0
    for r in range(first, rows.shape[2], 4):
        p0, p1, p2, p3 = push_four(rows, n, k, r)
        for j in range(LANES):
            b[PUSH, j] += (p0 * b[TIE + r, j] + p1 * b[TIE + r + 1, j]) + (
                p2 * b[TIE + r + 2, j] + p3 * b[TIE + r + 3, j]
            )
