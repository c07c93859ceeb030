"""Numbers that describe a cycle (mechanics.md, section 9), for many variants at once.

Fields have the shape (H, ...): H stations of a cycle, then sensors and variants. Sums run station by station, so that
a variant's bits do not depend on which others are computed with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PROMINENCE = 0.02  # of the cycle's range: smaller bumps are no peaks
FLAT = 1e-8  # of its largest value, below which a range is rounding
PEAKS = 8
HARMONICS = 16
TORN = 3.0  # times the largest step beside it: a larger one where a cycle closes is a gap
_EVEN_SPACING = 1e-9


class Legs(NamedTuple):
    """A cycle folded at the far turn: fields (P, ...) at equal positions on the way out and on the way back.

    weight (P,): of each station in an integral over the cruise part, over its length; they sum to 1.
    size (...): range of the static response over the cruise part.
    """

    weight: Array
    forward: Array
    backward: Array
    static: Array
    slope: Array
    size: Array


class Asymmetry(NamedTuple):
    """Indices of each sensor and variant; lag in m, negative where the response trails, the others by R."""

    lag: Array
    loop_area: Array
    odd_rms: Array
    even_excess: Array


class Peaks(NamedTuple):
    """number (...): prominent peaks in the cycle. value, phase (K, ...): of the K highest, by phase, then NaN."""

    number: Array
    value: Array
    phase: Array


def evenly(phase: Array, field: Array) -> Array:
    """A periodic field (H, ...) at H equidistant phases from 0; linear in between where the phases are not so."""
    count = len(phase)
    even = np.arange(count) / count
    if np.abs(phase - even).max() < _EVEN_SPACING:
        return field
    right = np.searchsorted(phase, even, side="right")
    left, right = right - 1, right % count
    gap = np.mod(phase[right] - phase[left], 1.0)
    part = np.mod(even - phase[left], 1.0) / np.where(gap > 0.0, gap, 1.0)
    part = part.reshape(-1, *([1] * (field.ndim - 1)))
    return np.asarray((1.0 - part) * field[left] + part * field[right])


def interval_weights(nodes: Array, low: float, high: float) -> Array:
    """Weights (P,) of values at ascending nodes in the mean over [low, high] of what is linear between the nodes.

    >>> interval_weights(np.array([0.0, 1.0, 2.0]), 0.5, 2.0)
    array([0.08333333, 0.58333333, 0.33333333])
    """
    width = np.diff(nodes)
    start = np.clip((low - nodes[:-1]) / width, 0.0, 1.0)
    stop = np.clip((high - nodes[:-1]) / width, 0.0, 1.0)
    right = 0.5 * width * (stop**2 - start**2)
    left = width * (stop - start) - right
    weights = np.zeros(len(nodes))
    weights[:-1] += left
    weights[1:] += right
    return np.asarray(weights / weights.sum())


def folded(cruise: tuple[float, float], history: Array, static: Array, slope: Array) -> Legs:
    """Both ways of an out-and-back cycle at equidistant phases, symmetric about its middle.

    cruise: phases where the cruise part begins and ends on the way out. On the cruise the speed is constant, so that
    an integral over the position is one over the phase.
    """
    count = len(history)
    out = np.arange(count // 2 + 1)
    back = (count - out) % count
    weight = interval_weights(out / count, *cruise)
    size = _range_between(static, cruise[0] * count, cruise[1] * count)
    return Legs(weight, history[out], history[back], static[out], slope[out], size)


def _range_between(field: Array, low: float, high: float) -> Array:
    """Range of a field (H, ...) between two places counted in stations, linear between stations."""
    ends = []
    for place in (low, high):
        left = min(int(place), len(field) - 2)
        part = place - left
        ends.append((1.0 - part) * field[left] + part * field[left + 1])
    values = np.concatenate([np.stack(ends), field[int(np.ceil(low)) : int(high) + 1]])
    return np.asarray(values.max(axis=0) - values.min(axis=0))


def asymmetry(legs: Legs, forward: float) -> Asymmetry:
    """Lag, loop area, odd rms and even excess of the cruise part.

    With odd = (f - b)/2, even = (f + b)/2 and R the range of the static response w_s: lag = <odd, w_s'>/<w_s', w_s'>,
    loop area = integral of (f - b) over the length x R, rms(odd)/R, rms(even - w_s)/R. forward: 1 where the way out
    goes along the position, -1 against it. NaN where the static response does not vary but for rounding.
    """
    level = np.abs(legs.static).max(axis=0)
    along, across, area, odd_square, even_square = (np.zeros(legs.size.shape) for _ in range(5))
    fields = zip(legs.weight, legs.forward, legs.backward, legs.static, legs.slope, strict=True)
    for weight, out, back, static, slope in fields:
        odd, excess, rise = 0.5 * (out - back), 0.5 * (out + back) - static, forward * slope
        along += weight * (rise * rise)
        across += weight * (odd * rise)
        area += weight * (2.0 * odd)
        odd_square += weight * (odd * odd)
        even_square += weight * (excess * excess)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = (across / along, area / legs.size, np.sqrt(odd_square) / legs.size, np.sqrt(even_square) / legs.size)
    varies = legs.size > FLAT * level
    return Asymmetry(*(np.where(np.isfinite(value) & varies, value, np.nan) for value in found))


def prominent(cycle: Array) -> Mask:
    """Where a periodic cycle (H, ...) has a maximum with a prominence above 2 % of its range.

    Going round once from the lowest station, a maximum counts as soon as the cycle has fallen below it by more than
    the threshold, after a rise of more than the threshold: these are exactly the peaks of that prominence.
    """
    count = len(cycle)
    lanes = cycle.reshape(count, -1)
    first, lane = np.argmin(lanes, axis=0), np.arange(lanes.shape[1])
    lowest = lanes[first, lane]
    span = lanes.max(axis=0) - lowest
    flat = span <= FLAT * np.abs(lanes).max(axis=0)  # rounding has no peaks
    threshold = np.where(flat, np.inf, PROMINENCE * span)
    found = np.zeros(lanes.shape, dtype=bool)
    rising = np.zeros(len(lane), dtype=bool)
    bottom, top, top_at = lowest.copy(), lowest.copy(), first.copy()
    for step in range(1, count + 1):
        at = (first + step) % count
        value = lanes[at, lane]
        fell = rising & (top - value > threshold)
        found[top_at[fell], lane[fell]] = True
        rose = ~rising & (value - bottom > threshold)
        higher = rose | (rising & (value > top))
        top, top_at = np.where(higher, value, top), np.where(higher, at, top_at)
        bottom = np.where(fell, value, np.minimum(bottom, value))
        rising = (rising & ~fell) | rose
    found[[0, -1]] &= ~_torn(lanes)
    return found.reshape(cycle.shape)


def _torn(lanes: Array) -> Mask:
    """(V,) whether cycles (H, V) do not close, as they have not settled: their ends are then no peaks."""
    near = np.maximum(np.abs(lanes[1] - lanes[0]), np.abs(lanes[-1] - lanes[-2]))
    return np.asarray(np.abs(lanes[0] - lanes[-1]) > TORN * near)


def peaks(cycle: Array) -> Peaks:
    """Peaks of a periodic cycle (H, ...) at equidistant phases, each refined by the parabola through three stations."""
    count = len(cycle)
    found = prominent(cycle)
    ranked = np.where(found, -cycle, np.inf)
    kept = min(PEAKS, count)
    at = np.argpartition(ranked, kept - 1, axis=0)[:kept]
    is_peak = np.take_along_axis(found, at, axis=0)
    left, middle, right = (np.take_along_axis(cycle, (at + step) % count, axis=0) for step in (-1, 0, 1))
    bend = left - 2.0 * middle + right
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0.0, 0.5 * (left - right) / bend, 0.0)
    value = np.where(is_peak, middle - 0.25 * (left - right) * shift, np.nan)
    phase = np.where(is_peak, np.mod((at + shift) / count, 1.0), np.nan)
    order = np.argsort(phase, axis=0)  # NaN comes last
    ordered = (np.take_along_axis(field, order, axis=0) for field in (value, phase))
    value, phase = (_padded(field, PEAKS) for field in ordered)
    return Peaks(found.sum(axis=0).astype(np.float64), value, phase)


def harmonics(cycle: Array) -> Array:
    """2 |c_k| (17, ...) of a periodic cycle (H, ...) at equidistant phases, k = 0..16; NaN beyond half of H.

    c_k is the mean of w exp(-2 pi i k phase).
    """
    count = len(cycle)
    amplitudes = 2.0 * np.abs(np.fft.rfft(cycle, axis=0)[: HARMONICS + 1]) / count
    resolved = (count + 1) // 2
    return _padded(amplitudes[:resolved], HARMONICS + 1)


def odd_even_ratio(amplitudes: Array) -> Array:
    """Rms of the odd over rms of the even harmonics (k >= 1) of amplitudes (17, ...); NaN without even ones."""
    squares = np.where(np.isnan(amplitudes), 0.0, amplitudes**2)
    odd, even = (_sum(squares[first::2]) for first in (1, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(odd) / np.sqrt(even)
    return np.where(np.isfinite(ratio), ratio, np.nan)


def _sum(rows: Array) -> Array:
    total = np.zeros(rows.shape[1:])
    for row in rows:
        total += row
    return total


def _padded(field: Array, size: int) -> Array:
    missing = size - len(field)
    if missing <= 0:
        return field[:size]
    return np.concatenate([field, np.full((missing, *field.shape[1:]), np.nan)])
