"""Numbers that describe a cycle (mechanics.md, section 9), for many variants at once.

Fields have the shape (H + 1, ...): stations of a cycle from phase 0 to phase 1, both with their own value as a cycle
need not close; then sensors and variants. Sums run station by station, so that a variant's bits do not depend on which
others are computed with it. Peaks are in `studies.findings.peaks`.
"""

from typing import NamedTuple

import numpy as np

from engine.kernels.cycle_sums import add_legs
from results_schema.arrays import Array

FLAT = 1e-8  # of its largest value, below which a range is rounding
HARMONICS = 16
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


def evenly(phase: Array, field: Array) -> Array:
    """A field (H + 1, ...) at equidistant phases from 0 to 1; linear in between where its own are not so."""
    even = np.linspace(0.0, 1.0, len(phase))
    if np.abs(phase - even).max() < _EVEN_SPACING:
        return field
    left = np.clip(np.searchsorted(phase, even, side="right") - 1, 0, len(phase) - 2)
    part = ((even - phase[left]) / (phase[left + 1] - phase[left])).reshape(-1, *([1] * (field.ndim - 1)))
    return np.asarray((1.0 - part) * field[left] + part * field[left + 1])


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
    count = len(history) - 1
    out = np.arange(count // 2 + 1)
    back = count - out
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
    goes along the position, -1 against it. NaN where the static response does not vary but for rounding: of its own
    size or, as of a spring that carries nothing at rest, of what it swings by.
    """
    level = np.maximum.reduce([np.abs(part).max(axis=0) for part in (legs.static, legs.forward, legs.backward)])
    sums, rows = np.zeros((5, legs.size.size)), (legs.weight.size, legs.size.size)
    fields = (legs.forward, legs.backward, legs.static, forward * legs.slope)
    add_legs(legs.weight, *(np.ascontiguousarray(field).reshape(rows) for field in fields), sums)
    along, across, area, odd_square, even_square = sums.reshape(5, *legs.size.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = (across / along, area / legs.size, np.sqrt(odd_square) / legs.size, np.sqrt(even_square) / legs.size)
    varies = legs.size > FLAT * level
    return Asymmetry(*(np.where(np.isfinite(value) & varies, value, np.nan) for value in found))


def harmonics(cycle: Array) -> Array:
    """2 |c_k| (17, ...) of a cycle (H + 1, ...) at equidistant phases from 0 to 1, k = 0..16; NaN beyond half of H.

    c_k is the mean of w exp(-2 pi i k phase). The mean over stations is exact of what repeats itself; of a cycle that
    does not close, the ramp (w(1) - w(0)) phase is integrated in closed form, which leaves an error of second order.
    """
    count, gap = len(cycle) - 1, cycle[-1] - cycle[0]
    found = np.fft.rfft(cycle[:-1], axis=0)[: HARMONICS + 1] / count
    for k in range(len(found)):
        found[k] += gap * _missed_of_ramp(k, count)
    return _padded(2.0 * np.abs(found[: (count + 1) // 2]), HARMONICS + 1)


def _missed_of_ramp(k: int, count: int) -> complex:
    """Integral of x exp(-2 pi i k x) over [0, 1], less its mean over the stations n/count, n < count."""
    if k == 0:
        return 0.5 / count
    angle = np.pi * k / count
    return complex(0.5 / count, (1.0 - angle / np.tan(angle)) / (2.0 * np.pi * k))


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
