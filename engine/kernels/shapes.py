"""Mode shapes along a track: all asked derivatives of all modes in one pass over the stations."""

from typing import NamedTuple

import numpy as np

from engine.kernels.jit import kernel, piece
from engine.kernels.layout import LANES, FloatArray
from engine.kernels.sines import decay, sin_cos
from engine.kernels.vector import all_lanes, lanes_at, put_lanes


class Span(NamedTuple):
    """Modes of a uniform beam between two neighbouring restraints, at places x in [-1, 1] between them.

    The lowest modes, which bend little there, are Legendre series: series (4, terms, low), of the derivatives 0 to 3.
    Every other one is four waves: with the half-turns t = turns x, the way a = rate (1 + x) from the left end and
    b = rate (1 - x) to the right one (rate = pi turns, half the wave number times the span's length), and waves (high,
    4) = (A, B, C, D):  phi = A sin(pi t) + B cos(pi t) + C exp(-a) + D exp(-b).  wave_number (high).
    """

    series: FloatArray
    turns: FloatArray
    rate: FloatArray
    waves: FloatArray
    wave_number: FloatArray


@piece
def _series(series, x, orders, basis, block):
    """The lowest modes: P_(m+1) = ((2m+1) x P_m - m P_(m-1))/(m+1), then a sum over them for every value."""
    put_lanes(basis, (0,), all_lanes(1.0))
    put_lanes(basis, (1,), x)
    for m in range(1, basis.shape[0] - 1):
        last, before = (2.0 * m + 1.0) / (m + 1.0) * lanes_at(basis, (m,)), lanes_at(basis, (m - 1,))
        put_lanes(basis, (m + 1,), x * last - m / (m + 1.0) * before)
    for j in range(orders.size):
        for k in range(series.shape[2]):
            total = all_lanes(0.0)
            for m in range(series.shape[1]):
                total = total + series[orders[j], m, k] * lanes_at(basis, (m,))
            put_lanes(block, (j, k), total)


@piece
def _waves(span, x, orders, block):
    """The other modes: each derivative turns the sine by a quarter and changes the sign of C."""
    low = span.series.shape[2]
    for k in range(span.turns.size):
        sine, cosine = sin_cos(span.turns[k] * x)
        even = span.waves[k, 0] * sine + span.waves[k, 1] * cosine
        odd = span.waves[k, 0] * cosine - span.waves[k, 1] * sine
        grows, falls = all_lanes(0.0), all_lanes(0.0)
        if span.waves[k, 2] != 0.0 or span.waves[k, 3] != 0.0:
            near = span.waves[k, 2] * decay(span.rate[k] * (1.0 + x))
            far = span.waves[k, 3] * decay(span.rate[k] * (1.0 - x))
            grows, falls = far + near, far - near
        for j in range(orders.size):
            factor = span.wave_number[k] ** orders[j]
            if orders[j] == 0:
                put_lanes(block, (j, low + k), grows + even)
            elif orders[j] == 1:
                put_lanes(block, (j, low + k), factor * (falls + odd))
            elif orders[j] == 2:
                put_lanes(block, (j, low + k), factor * (grows - even))
            else:
                put_lanes(block, (j, low + k), factor * (falls - odd))


@kernel
def beam_shapes(places, stations, span, orders, scale, found):
    """Mode shapes at places (n,) of a span, into the rows ``stations`` (n,) of found (derivatives, stations, modes).

    orders (derivatives,): which derivatives;  scale (derivatives,): what each is multiplied by.
    """
    low = span.series.shape[2]
    at, basis = np.empty((1, LANES)), np.empty((max(2, span.series.shape[1]), LANES))
    block = np.empty((orders.size, low + span.turns.size, LANES))
    for first in range(0, places.size, LANES):
        for lane in range(LANES):
            at[0, lane] = places[min(first + lane, places.size - 1)]
        x = lanes_at(at, (0,))
        if low > 0:
            _series(span.series, x, orders, basis, block)
        _waves(span, x, orders, block)
        for j in range(orders.size):
            for lane in range(min(LANES, places.size - first)):
                row = stations[first + lane]
                for k in range(block.shape[1]):
                    found[j, row, k] = scale[j] * block[j, k, lane]


@kernel
def rows_between(places, polynomials, orders, ends, stride, stations, found):
    """Polynomials of elements between places (E + 1,) by what is known at their ends: found (derivatives, stations,
    modes), at a joint from the right.

    polynomials (derivatives, n, n): that of each of the n numbers at both ends, a value and its derivatives at the left
    one first, on [0, 1], differentiated as often as orders (derivatives,) say;  ends (rows, modes): these numbers of an
    element from row stride times its own number on.
    """
    count, element = polynomials.shape[1], 0
    for s in range(stations.size):
        while element > 0 and stations[s] < places[element]:
            element -= 1
        while element < places.size - 2 and stations[s] >= places[element + 1]:
            element += 1
        length = places[element + 1] - places[element]
        x = min(max((stations[s] - places[element]) / length, 0.0), 1.0)
        for j in range(orders.size):
            for k in range(ends.shape[1]):
                found[j, s, k] = 0.0
            scale = 1.0
            for _ in range(orders[j]):
                scale /= length
            weight_scale = scale
            for i in range(count):
                weight_scale = scale if i == 0 or i == count // 2 else weight_scale * length
                weight = 0.0
                for p in range(count - 1, -1, -1):
                    weight = weight * x + polynomials[j, i, p]
                weight *= weight_scale
                row = stride * element + i
                for k in range(ends.shape[1]):
                    found[j, s, k] += weight * ends[row, k]
