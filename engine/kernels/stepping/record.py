"""Pieces of the march that observe the modes, make signals of them and keep extremes, sums and samples.

Extremes are judged by forms like ``old if x <= old else x``, which let a NaN through instead of swallowing it.
"""

import numpy as np

from engine.kernels.jit import copied, piece
from engine.kernels.layout import (
    BELOW_AT,
    BOUND,
    DIVERGED,
    DIVERGED_AT,
    LANES,
    LARGEST,
    LARGEST_AT,
    SECONDS,
    SMALLEST,
    SMALLEST_AT,
    SQUARES,
    STATISTICS,
    VALUE,
)
from engine.kernels.vector import all_lanes, choose, everywhere, lanes_at, put_lanes

# rows of a block's work array, shared with the march; the forces of all ties stand from TIE on, then all weights
SUM, FACTOR, LEAD, SECOND, GAIN, LOAD, GRAVITY, RATE_0, RATE_1, RATE_2, PUSH, TIE = range(12)
# fields of the per-mode work array; Newmark's family has the first six
U, V, C, D, CD, KD, E = range(7)
FIELDS = 6
# fields of the array of corrected modes, which is filled where more than one channel is observed
Q_NOW, V_NOW, A_NOW = range(3)
# in place of a number of leading channels, where all are summed over the corrected modes
KEPT = -1


@piece
def leading(watch):
    """How many channels the pass over the modes sums itself: up to two of displacements, or KEPT."""
    channels = watch.signal.shape[0]
    return channels if channels <= 2 and watch.on_q.shape[1] == channels else KEPT


@piece
def put_leads(b, leads, first, second):
    """Keep the sums of the leading channels."""
    if leads > 0:
        put_lanes(b, (LEAD,), first)
        put_lanes(b, (SECOND,), second)


@piece
def put_modes(now, k, q, v, a):
    """Keep the corrected mode k for the channels to come."""
    put_lanes(now, (k, Q_NOW), q)
    put_lanes(now, (k, V_NOW), v)
    put_lanes(now, (k, A_NOW), a)


@piece
def add_modes(statistics, i, now, b, row, field, order):
    """Signal i += h^-order sum over the modes of row times one field; four modes a pass, so the modes come in fours.

    Mode after mode, as the pass sums the leading channels: the same sensor in other company has the same bits.
    """
    total = all_lanes(0.0)
    for k in range(0, now.shape[0], 4):
        total = total + row[k] * lanes_at(now, (k, field))
        total = total + row[k + 1] * lanes_at(now, (k + 1, field))
        total = total + row[k + 2] * lanes_at(now, (k + 2, field))
        total = total + row[k + 3] * lanes_at(now, (k + 3, field))
    put_lanes(statistics, (i, VALUE), lanes_at(statistics, (i, VALUE)) + lanes_at(b, (RATE_0 + order,)) * total)


@piece
def load_weights(b, lanes, block):
    """The weights of the carriages, in step units, behind the forces of all ties."""
    ties = lanes.load.shape[1]
    for c in range(lanes.weight.shape[1]):
        for j in range(LANES):
            b[TIE + ties + c, j] = lanes.weight[block, c, j] * (lanes.step[block, j] * lanes.step[block, j])


@copied
def observe(statistics, now, b, watch, n, leads):
    """Signals of station n in SI units: offset g + sums over the modes + static correction times contact force (and,
    of dynamic parts, times what carriages weigh).

    leads: how many sums stand in b[LEAD] and after it already, all of them, or KEPT.
    """
    for i in range(statistics.shape[0]):
        value, offset = all_lanes(0.0), watch.offset[n, i]
        if offset != 0.0:
            value = offset * lanes_at(b, (GRAVITY,)) * lanes_at(b, (RATE_0 + watch.offset_order[i],))
        for r in range(watch.static.shape[2]):
            missed = watch.static[n, i, r]
            if missed != 0.0:
                value = value + missed * (lanes_at(b, (TIE + r,)) * lanes_at(b, (RATE_2,)))
        put_lanes(statistics, (i, VALUE), value)
    of_q, of_v, of_a = watch.on_q.shape[1], watch.on_v.shape[1], watch.on_a.shape[1]
    for c in range(leads):
        i = watch.signal[c]
        put_lanes(statistics, (i, VALUE), lanes_at(statistics, (i, VALUE)) + lanes_at(b, (LEAD + c,)))
    if leads != KEPT:
        return
    for c in range(of_q):
        row = watch.on_q[n if watch.on_q.shape[0] > 1 else 0, c]
        add_modes(statistics, watch.signal[c], now, b, row, Q_NOW, watch.order[c])
    for c in range(of_v):
        row = watch.on_v[n if watch.on_v.shape[0] > 1 else 0, c]
        add_modes(statistics, watch.signal[of_q + c], now, b, row, V_NOW, watch.order[of_q + c])
    for c in range(of_a):
        row = watch.on_a[n if watch.on_a.shape[0] > 1 else 0, c]
        add_modes(statistics, watch.signal[of_q + of_v + c], now, b, row, A_NOW, watch.order[of_q + of_v + c])


@piece
def copy_statistics(to, of):
    """Copy the statistics of one block; the march works on an array of its own, whose layout the compiler knows."""
    for i in range(to.shape[0]):
        for f in range(STATISTICS):
            for j in range(LANES):
                to[i, f, j] = of[i, f, j]


@piece
def open_statistics(statistics, of):
    """Take the statistics of one block along a segment, over which squares are summed anew: its first station, the last
    one observed before, counts half."""
    copy_statistics(statistics, of)
    for i in range(statistics.shape[0]):
        for j in range(LANES):
            statistics[i, SQUARES, j] = 0.5 * statistics[i, VALUE, j] * statistics[i, VALUE, j]


@piece
def close_statistics(to, statistics, watch, step, steps):
    """Put the statistics of one block back at the end of a segment: the sums of squares, whose last station counts
    half, as an integral over time on top of what was there (the trapezoidal rule). step (LANES): s."""
    for i in range(statistics.shape[0]):
        for j in range(LANES):
            squares, seconds = to[i, SQUARES, j], to[i, SECONDS, j]
            if watch.summed[i]:
                squares += step[j] * (
                    statistics[i, SQUARES, j] - 0.5 * statistics[i, VALUE, j] * statistics[i, VALUE, j]
                )
                seconds += step[j] * steps
            statistics[i, SQUARES, j], statistics[i, SECONDS, j] = squares, seconds
    copy_statistics(to, statistics)


@piece
def judge_lanes(status, statistics, q, v, block):
    """Note the lanes of a block that have diverged: a signal was beyond its bound, or the state q, v is not finite."""
    for j in range(LANES):
        for i in range(statistics.shape[0]):
            if statistics[i, DIVERGED_AT, j] >= 0.0:
                status[block, j] = DIVERGED
        for k in range(q.shape[1]):
            if not (np.isfinite(q[block, k, j]) and np.isfinite(v[block, k, j])):
                status[block, j] = DIVERGED


@copied
def judge(statistics, i, now):
    """Update the extremes of signal i with its value, and what is known where its value is an extreme for the first
    time: that it is negative, and that it has left every meaning."""
    value = lanes_at(statistics, (i, VALUE))
    high, low = lanes_at(statistics, (i, LARGEST)), lanes_at(statistics, (i, SMALLEST))
    below, above = value <= high, value >= low
    if not everywhere(below & above):
        put_lanes(statistics, (i, LARGEST), choose(below, high, value))
        put_lanes(statistics, (i, LARGEST_AT), choose(below, lanes_at(statistics, (i, LARGEST_AT)), now))
        put_lanes(statistics, (i, SMALLEST), choose(above, low, value))
        put_lanes(statistics, (i, SMALLEST_AT), choose(above, lanes_at(statistics, (i, SMALLEST_AT)), now))
        before = lanes_at(statistics, (i, BELOW_AT))
        put_lanes(statistics, (i, BELOW_AT), choose((value < 0.0) & (before < 0.0), now, before))
        bound, bad = lanes_at(statistics, (i, BOUND)), lanes_at(statistics, (i, DIVERGED_AT))
        sound = (value <= bound) & (value >= 0.0 - bound)
        put_lanes(statistics, (i, DIVERGED_AT), choose(sound | (bad >= 0.0), bad, now))


@piece
def keep(statistics, history, watch, sample, n, now):
    """Update extremes, sums and samples of every signal with station n; ``now`` counts stations of the scene."""
    for i in range(statistics.shape[0]):
        if watch.counted[n, i]:
            judge(statistics, i, now)
        if watch.summed[i]:
            value = lanes_at(statistics, (i, VALUE))
            put_lanes(statistics, (i, SQUARES), lanes_at(statistics, (i, SQUARES)) + value * value)
    if sample >= 0:
        for i in range(min(statistics.shape[0], history.shape[1])):
            put_lanes(
                history, (sample, i), lanes_at(statistics, (i, VALUE)) if watch.counted[n, i] else all_lanes(np.nan)
            )
