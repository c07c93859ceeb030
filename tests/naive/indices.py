"""The indices of an asymmetry and of a double peak, written out as they are defined, sample by sample.

Plain lists or arrays go in. An asymmetry compares the way out (forward: from start to end) with the way back at equal
positions over the cruise; a double peak looks at one periodic cycle whose samples are equally spaced in phase, the
first sample not repeated at the end.
"""

import cmath
import math
from collections.abc import Sequence
from typing import NamedTuple

PROMINENCE = 0.02  # of the cycle's range


def integral(x: Sequence[float], y: Sequence[float]) -> float:
    """Trapezoidal rule."""
    return sum(0.5 * (y[i] + y[i + 1]) * (x[i + 1] - x[i]) for i in range(len(x) - 1))


class Asymmetry(NamedTuple):
    """lag in m (negative: the response trails); the others without unit."""

    lag: float
    loop_area: float
    odd_rms: float
    even_excess: float


class Legs(NamedTuple):
    """Responses at the same positions, ascending along forward, and the static response and its slope d/ds there."""

    position: Sequence[float]
    forward: Sequence[float]
    backward: Sequence[float]
    static: Sequence[float]
    static_slope: Sequence[float]


def asymmetry(legs: Legs) -> Asymmetry:
    """odd = (f - b)/2, even = (f + b)/2, R = range of the static response.

    lag = <odd, w_s'>/<w_s', w_s'>; loop area = integral of (f - b) ds over (cruise length x R), signed;
    odd rms = rms(odd)/R; even excess = rms(even - w_s)/R.

    >>> shifted = Legs([0, 1, 2], [0.1, 1.1, 2.1], [-0.1, 0.9, 1.9], [0, 1, 2], [1, 1, 1])
    >>> [round(value, 12) for value in asymmetry(shifted)]
    [0.1, 0.1, 0.05, 0.0]
    """
    x, forward, backward, static, slope = legs
    length = x[-1] - x[0]
    size = max(static) - min(static)
    odd = [0.5 * (f - b) for f, b in zip(forward, backward, strict=True)]
    excess = [0.5 * (f + b) - w for f, b, w in zip(forward, backward, static, strict=True)]
    across = integral(x, [o * d for o, d in zip(odd, slope, strict=True)])
    return Asymmetry(
        lag=across / integral(x, [d * d for d in slope]),
        loop_area=integral(x, [2.0 * o for o in odd]) / (length * size),
        odd_rms=math.sqrt(integral(x, [o * o for o in odd]) / length) / size,
        even_excess=math.sqrt(integral(x, [e * e for e in excess]) / length) / size,
    )


class Peak(NamedTuple):
    """phase in 0..1 of the cycle, value and prominence of one local maximum."""

    phase: float
    value: float
    prominence: float


def prominence(cycle: Sequence[float], at: int) -> float:
    """Height of a maximum over the higher of the two lowest points between it and higher ground, around the cycle."""
    count = len(cycle)
    feet = []
    for direction in (1, -1):
        lowest = cycle[at]
        for step in range(1, count):
            value = cycle[(at + direction * step) % count]
            if value > cycle[at]:
                break
            lowest = min(lowest, value)
        feet.append(lowest)
    return cycle[at] - max(feet)


def peaks(cycle: Sequence[float], threshold: float = PROMINENCE) -> list[Peak]:
    """Local maxima of a periodic cycle whose prominence is above `threshold` of the cycle's range, by phase.

    >>> import math
    >>> wave = [math.cos(4 * math.pi * i / 100) for i in range(100)]
    >>> [(p.phase, p.value) for p in peaks(wave)]
    [(0.0, 1.0), (0.5, 1.0)]
    """
    count = len(cycle)
    size = max(cycle) - min(cycle)
    found = []
    for i in range(count):
        if cycle[i] <= cycle[i - 1]:
            continue
        after = (i + 1) % count
        while cycle[after] == cycle[i] and after != i:
            after = (after + 1) % count
        if cycle[after] < cycle[i]:
            height = prominence(cycle, i)
            if height > threshold * size:
                found.append(Peak(i / count, cycle[i], height))
    return found


def harmonics(cycle: Sequence[float], highest: int = 16) -> list[float]:
    """2 |c_k| for k = 0..highest with c_k = mean of w exp(-2 pi i k phase); k = 0 gives twice the mean's size."""
    count = len(cycle)
    return [
        2.0 * abs(sum(w * cmath.exp(-2j * math.pi * k * n / count) for n, w in enumerate(cycle))) / count
        for k in range(highest + 1)
    ]


def odd_even_ratio(cycle: Sequence[float], highest: int = 16) -> float:
    """Root of the sum of squares of the odd harmonics over that of the even ones, 1 <= k <= highest."""
    h = harmonics(cycle, highest)
    return math.sqrt(sum(x * x for x in h[1::2])) / math.sqrt(sum(x * x for x in h[2::2]))


def dynamic_amplification(response: Sequence[float], static: Sequence[float]) -> float:
    """Largest absolute response over largest absolute static response of the same model."""
    return max(abs(w) for w in response) / max(abs(w) for w in static)


class Extremes(NamedTuple):
    """Largest and smallest value over the instants and the carriage's position then (NaN off the body)."""

    largest: float
    largest_position: float
    smallest: float
    smallest_position: float


def extremes(response: Sequence[float], position: Sequence[float]) -> Extremes:
    """Extremes over all instants; of equal values the first.

    >>> extremes([0.0, 2.0, -1.0], [0.1, 0.2, float("nan")])
    Extremes(largest=2.0, largest_position=0.2, smallest=-1.0, smallest_position=nan)
    """
    top = max(range(len(response)), key=lambda i: response[i])
    bottom = min(range(len(response)), key=lambda i: response[i])
    return Extremes(response[top], position[top], response[bottom], position[bottom])
