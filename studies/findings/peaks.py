"""Peaks of a cycle (mechanics.md, section 9), for many variants at once."""

from typing import NamedTuple

import numpy as np

from results_schema.arrays import Array, Counts, Mask
from studies.findings.indices import FLAT

PROMINENCE = 0.02  # of the cycle's range: smaller bumps are no peaks
KINK = 8.0  # times the bends beside it: a sharper one is a kink
PEAKS = 8


class Peaks(NamedTuple):
    """number (...): prominent peaks in the cycle. value, phase (K, ...): of the K highest, by phase, then NaN."""

    number: Array
    value: Array
    phase: Array


def peaks(phase: Array, cycle: Array) -> Peaks:
    """Maxima of a cycle (H + 1, ...) with a prominence above 2 % of its range, at phases (H + 1,) from 0 to 1.

    The cycle is taken to begin again after its last station; where it does not close, its ends are no peaks. Each peak
    is refined by the parabola through three stations, or by the lines on both sides of a kink.
    """
    lanes = cycle.reshape(len(cycle), -1)
    at, lane = _prominent(lanes)
    inside = ~(_torn(lanes)[lane] & ((at == 0) | (at == len(lanes) - 1)))
    at, lane = at[inside], lane[inside]
    number = np.bincount(lane, minlength=lanes.shape[1]).astype(np.float64)
    by_height = np.lexsort((at, -lanes[at, lane], lane))
    kept = by_height[_places(lane[by_height]) < PEAKS]
    at, lane = at[kept], lane[kept]
    value, where = _vertices(phase, lanes, at, lane)
    by_phase = np.lexsort((where, lane))
    slots = _places(lane[by_phase]), lane[by_phase]
    found = np.full((2, PEAKS, lanes.shape[1]), np.nan)
    found[0][slots], found[1][slots] = value[by_phase], where[by_phase]
    shape = cycle.shape[1:]
    return Peaks(number.reshape(shape), *found.reshape(2, PEAKS, *shape))


def _prominent(lanes: Array) -> tuple[Counts, Counts]:
    """Stations and lanes of all prominent maxima of cycles (H + 1, V) that begin again after the last station.

    Going round once from the lowest station, a maximum counts as soon as the cycle has fallen below it by more than
    the threshold, after a rise of more than the threshold: these are exactly the peaks of that prominence. The walk
    goes from one turning point to the next, for what lies between decides nothing.
    """
    lowest, highest = lanes.min(axis=0), lanes.max(axis=0)
    first = np.argmax(lanes == lowest, axis=0)  # quicker than argmin
    span = highest - lowest
    varies = np.isfinite(span) & (span > FLAT * np.maximum(np.abs(highest), np.abs(lowest)))  # rounding has no peaks
    turns = _turns(lanes, varies, first)
    longest = np.argsort(-turns.number, kind="stable")  # those that are still on their way are the first ones
    bottom, top, top_at, threshold = lowest[longest], lowest[longest], first[longest], PROMINENCE * span[longest]
    rising = np.zeros(longest.size, dtype=bool)
    found = [(first[:0], first[:0])]
    for step in range(1, int(turns.number.max(initial=0)) + 1):
        lane = longest[: np.count_nonzero(turns.number >= step)]
        on, at = slice(lane.size), turns.at(step, lane)
        value = lanes[at, lane]
        fell = rising[on] & (top[on] - value > threshold[on])
        rose = ~rising[on] & (value - bottom[on] > threshold[on])
        found.append((top_at[on][fell], lane[fell]))
        higher = rose | (rising[on] & (value > top[on]))
        top[on], top_at[on] = np.where(higher, value, top[on]), np.where(higher, at, top_at[on])
        bottom[on] = np.where(fell, value, np.minimum(bottom[on], value))
        rising[on] = (rising[on] & ~fell) | rose
    stations, of_lanes = (np.concatenate(part) for part in zip(*found, strict=True))
    return stations, of_lanes


class _Turns(NamedTuple):
    """Stations at which lanes turn, lane after lane: of each the first one's place, their number, and the place of the
    lowest."""

    station: Counts
    begin: Counts
    number: Counts
    lowest: Counts

    def at(self, step: int, lane: Counts) -> Counts:
        """The station so many turning points after the lowest, once round."""
        begin = self.begin[lane]
        return np.asarray(self.station[begin + (self.lowest[lane] - begin + step) % self.number[lane]])


def _turns(lanes: Array, varies: Mask, first: Counts) -> _Turns:
    """Where cycles (H + 1, V) neither go on rising nor go on falling. first (V,): the lowest station."""
    goes_on = np.zeros(lanes.shape, dtype=bool)
    for compare in (np.greater, np.less):
        way = np.empty(lanes.shape, dtype=bool)
        compare(lanes[1:], lanes[:-1], out=way[1:])
        compare(lanes[0], lanes[-1], out=way[0])
        goes_on[:-1] |= way[:-1] & way[1:]
        goes_on[-1] |= way[-1] & way[0]
    lane, station = np.divmod(np.flatnonzero(np.ascontiguousarray((~goes_on & varies).T)), len(lanes))
    count = np.bincount(lane, minlength=varies.size)
    begin = np.cumsum(count) - count
    lowest = begin.copy()
    lowest[varies] = np.flatnonzero(station == first[lane])
    return _Turns(station, begin, count, lowest)


def _torn(lanes: Array) -> Mask:
    """(V,) whether cycles (H + 1, V) do not close, as they have not settled, by more than what makes a peak."""
    return np.asarray(np.abs(lanes[-1] - lanes[0]) > PROMINENCE * (lanes.max(axis=0) - lanes.min(axis=0)))


def _vertices(phase: Array, lanes: Array, at: Counts, lane: Counts) -> tuple[Array, Array]:
    """(P,) values and phases of maxima between stations, given the highest station of each: the vertices of parabolas
    through it and its neighbours, or where the lines on both sides of a kink meet."""
    _, _, bend = _slopes(phase, lanes, at, lane, np.ones_like(at))
    side = np.where(bend[1] < bend[3], -1, 1)  # a kink bends the stations on both its sides
    gap, slope, bend = _slopes(phase, lanes, at, lane, side)
    width = 0.5 * (gap[1:] + gap[:-1])
    # Of waves of six stations those two beside a peak do not bend, but the next ones do.
    rate = np.abs(bend / width)
    smooth = np.maximum(rate[1] + rate[4], rate[0] + rate[5]) * 0.5 * (width[2] + width[3])
    gap, slope, bend, width = gap[1:6], slope[1:6], bend[1:5], width[1:5]
    sharp = (slope[3] < 0.0) & (bend[2] <= 0.0) & (bend[1] + bend[2] < -KINK * smooth)
    with np.errstate(divide="ignore", invalid="ignore"):
        meet = gap[2] * (slope[2] - slope[3]) / (slope[1] - slope[3])
        tangent = (slope[1] * gap[2] + slope[2] * gap[1]) / (2.0 * width[1])
        top = np.clip(-tangent * width[1] / bend[1], -0.5 * gap[1], 0.5 * gap[2])
    top = np.where(bend[1] < 0.0, top, 0.0)
    value = lanes[at, lane] + np.where(sharp, slope[1] * meet, tangent * top + 0.5 * bend[1] / width[1] * top**2)
    return value, np.mod(phase[at] + side * np.where(sharp, meet, top), 1.0)


def _slopes(phase: Array, lanes: Array, at: Counts, lane: Counts, side: Counts) -> tuple[Array, Array, Array]:
    """Of three intervals before and four after each of P stations, seen in the direction ``side``: lengths and slopes
    (7, P), and the changes of slopes from one to the next (6, P). None goes from the cycle's end to its beginning."""
    first = (at + side * np.arange(-3, 4)[:, None] - (side < 0)) % (len(lanes) - 1)
    gap = phase[first + 1] - phase[first]
    slope = side * (lanes[first + 1, lane] - lanes[first, lane]) / gap
    return gap, slope, np.diff(slope, axis=0)


def _places(groups: Counts) -> Counts:
    """(P,) the place of each within its group, which come one after the other."""
    count = np.bincount(groups)
    return np.asarray(np.arange(groups.size) - (np.cumsum(count) - count)[groups])
