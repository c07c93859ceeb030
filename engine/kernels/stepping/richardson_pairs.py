"""Two marches of the same scene, one with half the steps of the other, made into one history, and what is observed of
it: extremes between stations, sums, the first negative value.

Average acceleration's error on smooth resolved scenes runs in even powers of the step (mechanics section 6), so
e = (x_h - x_2h)/3 is the leading part of the finer march's error x - x_h, and x_h + e is of fourth order.
"""

import numpy as np

from engine.kernels.jit import kernel, piece
from engine.kernels.layout import (
    BELOW_AT,
    BOUND,
    DIVERGED_AT,
    LANES,
    LARGEST,
    LARGEST_AT,
    SECONDS,
    SMALLEST,
    SMALLEST_AT,
    SQUARES,
)

# rows of the two values before a station that stay from one segment to the next, and whether they may be used
BEFORE, LAST, RUN = 0, 1, 2


@kernel
def extrapolate(fine, coarse, counted, gap):
    """Extrapolate the finer history in place.

    fine (blocks, 2 C + 1, signals, LANES), coarse (blocks, C + 1, signals, LANES), which becomes e;
    counted (2 C + 1, signals);  gap (blocks, signals, LANES): the largest |e| so far, over counted common stations.
    Between common stations e is interpolated by cubics, by straight lines where there are fewer than four.
    """
    last = coarse.shape[1] - 1
    for block in range(fine.shape[0]):
        for n in range(last + 1):
            for i in range(fine.shape[2]):
                for j in range(LANES):
                    e = (fine[block, 2 * n, i, j] - coarse[block, n, i, j]) / 3.0
                    coarse[block, n, i, j] = e
                    fine[block, 2 * n, i, j] += e
                    if counted[2 * n, i]:
                        old = gap[block, i, j]
                        gap[block, i, j] = old if abs(e) <= old else abs(e)
        for n in range(last):
            first = min(max(n - 1, 0), last - 3)
            for i in range(fine.shape[2]):
                for j in range(LANES):
                    if last < 3:
                        e = 0.5 * (coarse[block, n, i, j] + coarse[block, n + 1, i, j])
                    else:
                        e0, e1 = coarse[block, first, i, j], coarse[block, first + 1, i, j]
                        e2, e3 = coarse[block, first + 2, i, j], coarse[block, first + 3, i, j]
                        if first == n - 1:
                            e = (9.0 * (e1 + e2) - (e0 + e3)) / 16.0
                        elif first == n:
                            e = (5.0 * e0 + 15.0 * e1 - 5.0 * e2 + e3) / 16.0
                        else:
                            e = (e0 - 5.0 * e1 + 15.0 * e2 + 5.0 * e3) / 16.0
                    fine[block, 2 * n + 1, i, j] += e


@piece
def raise_to(statistics, i, j, x, at):
    """Take a value at a count among the extremes of a signal in a lane; a NaN goes in and stays."""
    high, low = statistics[i, LARGEST, j], statistics[i, SMALLEST, j]
    statistics[i, LARGEST_AT, j] = statistics[i, LARGEST_AT, j] if x <= high else at
    statistics[i, LARGEST, j] = high if x <= high else x
    statistics[i, SMALLEST_AT, j] = statistics[i, SMALLEST_AT, j] if x >= low else at
    statistics[i, SMALLEST, j] = low if x >= low else x


@piece
def judge(statistics, i, j, x, at):
    """Note where a signal is negative for the first time, and where it has left every meaning."""
    below, bad = statistics[i, BELOW_AT, j], statistics[i, DIVERGED_AT, j]
    statistics[i, BELOW_AT, j] = at if (x < 0.0) & (below < 0.0) else below
    statistics[i, DIVERGED_AT, j] = bad if (abs(x) <= statistics[i, BOUND, j]) | (bad >= 0.0) else at


@kernel
def survey(history, counted, statistics, carry, joined, count):
    """Observe a segment's history as the march observes its signals.

    history (blocks, S, signals, LANES);  counted (S, signals);  statistics (blocks, signals, STATISTICS, LANES);
    carry (blocks, signals, 3, LANES): the two values before, and how many of them are of equal step and no event
    away (0 to 2);  joined: whether this segment goes on from the one before at an equal step;  count: of the scene's
    stations at station 0. A station higher or lower than both its neighbours is replaced by the vertex of the parabola
    through the three.
    """
    stations = history.shape[1]
    before, last = np.empty(LANES), np.empty(LANES)
    highest, lowest = np.empty(LANES), np.empty(LANES)
    for block in range(history.shape[0]):
        one = statistics[block]
        for i in range(history.shape[2]):
            run = carry[block, i, RUN, 0] if joined else 0.0
            for j in range(LANES):
                highest[j], lowest[j] = one[i, LARGEST, j], one[i, SMALLEST, j]
                before[j], last[j] = carry[block, i, BEFORE, j], carry[block, i, LAST, j]
            for n in range(stations):
                now = float(count + n)
                if not counted[n, i]:
                    run = 0.0
                    continue
                news = 0
                for j in range(LANES):
                    x, b, a = history[block, n, i, j], last[j], before[j]
                    reach = 0.125 * abs(x - a) if (x - b) * (b - a) < 0.0 else 0.0  # a vertex is no farther from b
                    high, low = highest[j], lowest[j]
                    known = (x <= high) & (x >= low) & (b + reach <= high) & (b - reach >= low)
                    news |= 0 if known else 1
                if n == 0 and run > 0.0:
                    continue  # the last station of the segment before
                if news != 0:
                    for j in range(LANES):
                        x, b, a = history[block, n, i, j], last[j], before[j]
                        if run >= 2.0 and (x - b) * (b - a) < 0.0:
                            slope, bend = 0.5 * (x - a), (x - b) + (a - b)
                            away = -slope / bend
                            vertex = b + 0.5 * away * slope
                            raise_to(one, i, j, vertex, now - 1.0 + away)
                            judge(one, i, j, vertex, now - 1.0 + away)
                        falls = run >= 1.0 and b >= 0.0 and x < 0.0
                        raise_to(one, i, j, x, now)
                        judge(one, i, j, x, now - x / (x - b) if falls else now)
                        highest[j], lowest[j] = one[i, LARGEST, j], one[i, SMALLEST, j]
                for j in range(LANES):
                    before[j], last[j] = last[j], history[block, n, i, j]
                run = min(run + 1.0, 2.0)
            for j in range(LANES):
                carry[block, i, BEFORE, j], carry[block, i, LAST, j] = before[j], last[j]
                carry[block, i, RUN, j] = run


@kernel
def integrate(history, summed, statistics, step):
    """Integrate squares over a segment's history by Simpson's rule, on top of what was summed before.

    history, statistics: as in `survey`, an odd number of stations;  summed (signals): which;  step (blocks, LANES): s.
    """
    steps = history.shape[1] - 1
    squares = np.empty(LANES)
    for block in range(history.shape[0]):
        for i in range(history.shape[2]):
            if not summed[i]:
                continue
            squares[:] = 0.0
            for n in range(steps + 1):
                weight = (4.0 if n % 2 == 1 else 2.0 if 0 < n < steps else 1.0) / 3.0
                for j in range(LANES):
                    squares[j] += weight * history[block, n, i, j] * history[block, n, i, j]
            for j in range(LANES):
                statistics[block, i, SQUARES, j] += step[block, j] * squares[j]
                statistics[block, i, SECONDS, j] += step[block, j] * steps
