"""Which pilots are a variant's nearest, and the cheapest rung that holds for all of them."""

import numpy as np

from engine.kernels.jit import kernel, piece


@kernel
def nearest(points, pilots, found):
    """found (V, k): numbers of the k nearest pilots (D, P) of every point (V, D), the nearest first."""
    k = found.shape[1]
    distance, apart = np.empty(k), np.empty(pilots.shape[1])
    for v in range(points.shape[0]):
        distance[:] = np.inf
        found[v] = 0
        apart[:] = 0.0
        for d in range(points.shape[1]):
            at = points[v, d]
            for p in range(pilots.shape[1]):
                apart[p] += (at - pilots[d, p]) ** 2
        for p in range(pilots.shape[1]):
            if apart[p] < distance[k - 1]:
                place = k - 1
                while place > 0 and apart[p] < distance[place - 1]:
                    distance[place], found[v, place] = distance[place - 1], found[v, place - 1]
                    place -= 1
                distance[place], found[v, place] = apart[p], p


@piece
def worst_but_one(held, rung, near, limit):
    """The largest but one of the errors ``held`` (P, 2, rungs) on a rung of the pilots ``near`` (k,), the only one if
    k = 1: the first count over the variant's ``limit``, the second as they are."""
    worst, second = 0.0, 0.0
    for p in near:
        error = max(held[p, 0, rung] / limit, held[p, 1, rung])
        if error > worst:
            worst, second = error, worst
        elif error > second:
            second = error
    return second if near.size > 1 else worst


@kernel
def cheapest(held, worth, neighbours, limit, found):
    """found (V,): the first rung that holds by `worst_but_one` of a variant's neighbours (V, k) with its ``limit``
    (V,); where there is none, the first that is within ALIKE of the least among the first ``worth``."""
    rungs, spared = held.shape[2], 1 if neighbours.shape[1] > 1 else 0
    missed = np.empty(rungs, dtype=np.int64)  # by so many neighbours
    for v in range(neighbours.shape[0]):
        missed[:] = 0
        for p in neighbours[v]:
            for rung in range(rungs):
                missed[rung] += (held[p, 0, rung] > limit[v]) | (held[p, 1, rung] > 1.0)
        found[v] = -1
        for rung in range(rungs):
            if missed[rung] <= spared:
                found[v] = rung
                break
        if found[v] < 0:
            least = np.inf
            for rung in range(worth):
                least = min(least, worst_but_one(held, rung, neighbours[v], limit[v]))
            for rung in range(worth):
                if worst_but_one(held, rung, neighbours[v], limit[v]) <= ALIKE * least:
                    found[v] = rung
                    break
            found[v] = worth - 1 if found[v] < 0 else found[v]


ALIKE = 1.25  # times the least error: as good as that, where none is small enough


@kernel
def held_errors(held, rung, neighbours, limit, found):
    """found (V,): `worst_but_one` of every variant on its own rung (V,)."""
    for v in range(neighbours.shape[0]):
        found[v] = worst_but_one(held, rung[v], neighbours[v], limit[v])


@kernel
def told_errors(error, march, rung, neighbours, found):
    """found (R, V): the largest but one, the only one if k = 1, of the errors (M, R) of the marches (rungs, P) that
    tell a variant's neighbours (V, k) of its rung (V,); NaN where that is not finite: NaN counts as the largest."""
    few = neighbours.shape[1] == 1
    for v in range(neighbours.shape[0]):
        for r in range(error.shape[1]):
            worst = second = -np.inf
            for p in neighbours[v]:
                own = error[march[rung[v], p], r]
                own = own if np.isfinite(own) else np.inf
                if own > worst:
                    worst, second = own, worst
                elif own > second:
                    second = own
            told = worst if few else second
            found[r, v] = told if np.isfinite(told) else np.nan
