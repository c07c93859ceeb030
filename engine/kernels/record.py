"""Pieces of the march that observe the modes, make signals of them and keep extremes, sums and samples.

Extremes are judged by forms like ``old if x <= old else x``, which let a NaN through instead of swallowing it.
"""

import numpy as np

from engine.kernels.jit import piece
from engine.kernels.layout import (
    BELOW_AT,
    BOUND,
    DIVERGED_AT,
    LANES,
    LARGEST,
    LARGEST_AT,
    MARKS,
    SMALLEST,
    SMALLEST_AT,
    SQUARES,
)
from engine.kernels.vector import all_lanes, lanes_at, put_lanes

# rows of a block's work array, shared with the march; the forces of all ties stand from TIE on
SUM, FACTOR, LEAD, SECOND, GAIN, LOAD, GRAVITY, RATE_0, RATE_1, RATE_2, PUSH, TIE = range(12)
# fields of the per-mode work array; Newmark's family has the first six
U, V, C, D, CD, KD, E = range(7)
FIELDS = 6
# column of a block's own marks, beyond those of Record: the signal's value at the station
VALUE = MARKS
# fields of the array of corrected modes, which is filled where more than one channel is observed
Q_NOW, V_NOW, A_NOW = range(3)


@piece
def add_modes(marks, i, now, b, row, field, order):
    """Signal i += h^-order sum over the modes of row times one field; four modes a pass, so the modes come in fours."""
    total = all_lanes(0.0)
    for k in range(0, now.shape[0], 4):
        first = row[k] * lanes_at(now, (k, field)) + row[k + 1] * lanes_at(now, (k + 1, field))
        second = row[k + 2] * lanes_at(now, (k + 2, field)) + row[k + 3] * lanes_at(now, (k + 3, field))
        total = total + (first + second)
    put_lanes(marks, (i, VALUE), lanes_at(marks, (i, VALUE)) + lanes_at(b, (RATE_0 + order,)) * total)


@piece
def observe(marks, now, b, watch, n, leads):
    """Signals of station n in SI units: offset g + sums over the modes + static correction times contact force.

    leads: how many sums stand in b[LEAD] and after it already: all of them, or none.
    """
    for i in range(marks.shape[0]):
        offset, order = watch.offset[n, i], watch.offset_order[i]
        for j in range(LANES):
            marks[i, VALUE, j] = offset * b[GRAVITY, j] * b[RATE_0 + order, j]
        for r in range(watch.static.shape[2]):
            missed = watch.static[n, i, r]
            if missed != 0.0:
                for j in range(LANES):
                    marks[i, VALUE, j] += missed * (b[TIE + r, j] * b[RATE_2, j])
    of_q, of_v, of_a = watch.on_q.shape[1], watch.on_v.shape[1], watch.on_a.shape[1]
    for c in range(leads):
        i = watch.signal[c]
        for j in range(LANES):
            marks[i, VALUE, j] += b[LEAD + c, j]
    for c in range(leads, of_q):
        row = watch.on_q[n if watch.on_q.shape[0] > 1 else 0, c]
        add_modes(marks, watch.signal[c], now, b, row, Q_NOW, watch.order[c])
    for c in range(of_v):
        row = watch.on_v[n if watch.on_v.shape[0] > 1 else 0, c]
        add_modes(marks, watch.signal[of_q + c], now, b, row, V_NOW, watch.order[of_q + c])
    for c in range(of_a):
        row = watch.on_a[n if watch.on_a.shape[0] > 1 else 0, c]
        add_modes(marks, watch.signal[of_q + of_v + c], now, b, row, A_NOW, watch.order[of_q + of_v + c])


@piece
def copy_marks(to, of):
    """Copy the marks of one block; the march works on an array of its own, whose layout the compiler knows."""
    for i in range(to.shape[0]):
        for f in range(MARKS):
            for j in range(LANES):
                to[i, f, j] = of[i, f, j]


@piece
def keep(marks, history, watch, sample, n, now):
    """Update extremes, sums and samples of every signal with station n; ``now`` counts stations of the scene."""
    for i in range(marks.shape[0]):
        if watch.counted[n, i]:
            news = 0
            for j in range(LANES):
                x = marks[i, VALUE, j]
                news |= 0 if (x <= marks[i, LARGEST, j]) & (x >= marks[i, SMALLEST, j]) else 1
                marks[i, SQUARES, j] += x * x
            if news != 0:
                for j in range(LANES):
                    x, high, low = marks[i, VALUE, j], marks[i, LARGEST, j], marks[i, SMALLEST, j]
                    high_at, low_at, below_at = marks[i, LARGEST_AT, j], marks[i, SMALLEST_AT, j], marks[i, BELOW_AT, j]
                    bad_at, bound = marks[i, DIVERGED_AT, j], marks[i, BOUND, j]
                    marks[i, LARGEST, j] = high if x <= high else x
                    marks[i, LARGEST_AT, j] = high_at if x <= high else now
                    marks[i, SMALLEST, j] = low if x >= low else x
                    marks[i, SMALLEST_AT, j] = low_at if x >= low else now
                    marks[i, BELOW_AT, j] = now if (x < 0.0) & (below_at < 0.0) else below_at
                    marks[i, DIVERGED_AT, j] = bad_at if (abs(x) <= bound) | (bad_at >= 0.0) else now
        if sample >= 0 and i < history.shape[1]:
            for j in range(LANES):
                history[sample, i, j] = marks[i, VALUE, j] if watch.counted[n, i] else np.nan
