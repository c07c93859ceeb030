"""Which pilots are a variant's nearest, the cheapest rung that holds for all of them but one, and what they tell.

The logarithm of an error on a rung is a plane over the places of variants, ``slopes`` (D, rungs), and what each pilot
leaves of it.
"""

import numpy as np

from engine.kernels.jit import kernel, piece

#: Of pilots, of which the nearest ones tell how far is far enough: by 32 and 64 it took 1.2 and 2 times as long.
GROUPS = 16


@kernel
def nearest(points, pilots, found):
    """found (V, k): numbers of the k nearest pilots (D, P) of every point (V, D), the nearest first, of two as near the
    one with the smaller number."""
    count, k = pilots.shape[1], found.shape[1]
    apart = np.full(-(-count // GROUPS) * GROUPS, np.inf)
    near, distance, rank = np.empty(count, np.int32), np.empty(count), np.empty(max(count, GROUPS), np.int64)
    least = np.empty(GROUPS)
    for v in range(points.shape[0]):
        apart[:count] = 0.0
        for d in range(points.shape[1]):
            at = points[v, d]
            for p in range(count):
                apart[p] += (at - pilots[d, p]) ** 2
        _least_of_groups(apart, least)
        enough = _smallest(least, k, rank)  # of so many groups, so that k pilots are no farther
        some = 0
        for p in range(count):
            near[some], distance[some] = p, apart[p]
            some += apart[p] <= enough
        _ranks(distance[:some], rank)
        for n in range(some):
            if rank[n] < k:
                found[v, rank[n]] = near[n]


@piece
def _least_of_groups(apart, least):
    """least (GROUPS,): of every so many-th of ``apart``."""
    least[:] = np.inf
    for first in range(0, apart.size, GROUPS):
        for group in range(GROUPS):
            least[group] = min(least[group], apart[first + group])


@piece
def _smallest(values, k, rank):
    """The k-th smallest of some values; rank: room for as many numbers."""
    _ranks(values, rank)
    found = np.inf
    for n in range(values.size):
        found = min(found, values[n] if rank[n] == k - 1 else np.inf)
    return found


@piece
def _ranks(values, rank):
    """rank: how many of the values come before each, of two that are equal the first."""
    rank[: values.size] = 0
    for m in range(values.size):
        for n in range(values.size):
            rank[n] += (values[m] < values[n]) | ((values[m] == values[n]) & (m < n))


@piece
def worst_but_one(held, rung, near, limit):
    """The largest but one of ``held`` (P, 2, rungs), logarithms of errors less the plane, on a rung of the pilots
    ``near`` (k,), the only one if k = 1: the first count less the variant's ``limit``, the second as they are."""
    worst, second = -np.inf, -np.inf
    for p in near:
        error = max(held[p, 0, rung] - limit, held[p, 1, rung])
        if error > worst:
            worst, second = error, worst
        elif error > second:
            second = error
    return second if near.size > 1 else worst


@piece
def plane_at(slopes, rung, place):
    """What the plane of a rung says at a place (D,)."""
    found = 0.0
    for d in range(place.size):
        found += slopes[d, rung] * place[d]
    return found


@kernel
def cheapest(held, planes, worth, neighbours, limit, found):
    """found (V,): the first rung that holds by `worst_but_one` of a variant's neighbours (V, k) with its ``limit``
    (V,), a logarithm; where there is none, the first that is within ALIKE of the least among the first ``worth``.
    planes: slopes (D, rungs), and places (V, D)."""
    slopes, places = planes
    missed, plane = np.empty(AT_ONCE, dtype=np.int64), np.empty(AT_ONCE)
    for v in range(neighbours.shape[0]):
        found[v] = -1
        for first in range(0, held.shape[2], AT_ONCE):
            _planes_at(slopes, first, places[v], plane)
            found[v] = _first_held(held, plane, first, neighbours[v], limit[v], missed)
            if found[v] >= 0:
                break
        if found[v] < 0:
            found[v] = _least_held(held, slopes, places[v], worth, neighbours[v], limit[v])


@piece
def _planes_at(slopes, first, place, found):
    """found (AT_ONCE,): what the planes of rungs, from ``first`` on, say at a place (D,)."""
    found[:] = 0.0
    for d in range(place.size):
        for rung in range(min(AT_ONCE, slopes.shape[1] - first)):
            found[rung] += slopes[d, first + rung] * place[d]


@piece
def _first_held(held, plane, first, near, limit, missed):
    """The first of AT_ONCE rungs, from ``first`` on, that all but one of the pilots ``near`` (k,) hold, all if k = 1;
    -1 where there is none. plane (AT_ONCE,): at the variant. missed (AT_ONCE,): room for by how many each is missed."""
    missed[:] = 0
    for p in near:
        following, own = held[p, 0][first : first + AT_ONCE], held[p, 1][first : first + AT_ONCE]
        for rung in range(following.size):
            missed[rung] += (following[rung] + plane[rung] > limit) | (own[rung] + plane[rung] > 0.0)
    for rung in range(min(AT_ONCE, held.shape[2] - first)):
        if missed[rung] <= (1 if near.size > 1 else 0):
            return first + rung
    return -1


@piece
def _least_held(held, slopes, place, worth, near, limit):
    """The first of the rungs before ``worth`` that is within ALIKE of the least error of these."""
    least = np.inf
    for rung in range(worth):
        least = min(least, worst_but_one(held, rung, near, limit) + plane_at(slopes, rung, place))
    for rung in range(worth):
        if worst_but_one(held, rung, near, limit) + plane_at(slopes, rung, place) <= least + ALIKE:
            return rung
    return worth - 1


AT_ONCE = 64  # rungs that are looked at together: most variants find theirs among the first
ALIKE = 0.2231435513142098  # log(1.25): of an error beside the least: as good, where none is small enough


@kernel
def held_errors(held, rung, planes, neighbours, limit, found):
    """found (V,): by `worst_but_one` the logarithm of the error of a variant on its own rung (V,); as `cheapest`."""
    slopes, places = planes
    for v in range(neighbours.shape[0]):
        worst = worst_but_one(held, rung[v], neighbours[v], limit[v])
        found[v] = worst + plane_at(slopes, rung[v], places[v])


@kernel
def rises(slopes, rung, places, pilots, neighbours, found):
    """found (V, k): what planes of slopes (D, rungs) rise by on a variant's rung (V,) to its place (V, D) from those of
    the pilots (D, P) that are its neighbours (V, k)."""
    found[:] = 0.0
    for v in range(neighbours.shape[0]):
        for d in range(places.shape[1]):
            slope = slopes[d, rung[v]]
            for n in range(neighbours.shape[1]):
                found[v, n] += slope * (places[v, d] - pilots[d, neighbours[v, n]])


@kernel
def told_errors(error, march, rung, times, neighbours, found):
    """found (R, V): the largest but one, the only one if k = 1, of the errors (M, R) of the marches (rungs, P) that
    tell a variant's neighbours (V, k) of its rung (V,), each times what the plane rises by from there (V, k); NaN where
    that is not finite: NaN counts as the largest."""
    few = neighbours.shape[1] == 1
    worst, second = np.empty(error.shape[1]), np.empty(error.shape[1])
    for v in range(neighbours.shape[0]):
        worst[:] = second[:] = -np.inf
        for n in range(neighbours.shape[1]):
            of_march = error[march[rung[v], neighbours[v, n]]]
            for r in range(worst.size):
                own = times[v, n] * of_march[r]
                own = own if np.isfinite(own) else np.inf
                second[r] = max(second[r], min(worst[r], own))
                worst[r] = max(worst[r], own)
        for r in range(worst.size):
            told = worst[r] if few else second[r]
            found[r, v] = told if np.isfinite(told) else np.nan
