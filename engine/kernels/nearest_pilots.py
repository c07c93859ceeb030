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
def told_of(held, rung, near, limit, spare):
    """What the pilots ``near`` (k,) tell of a rung: the largest of their errors ``held`` (2, rungs, P), or with 1 to
    ``spare`` the largest but one; the first of both count over the variant's ``limit``, the second as they are."""
    worst, second = 0.0, 0.0
    for p in near:
        error = max(held[0, rung, p] / limit, held[1, rung, p])
        if error > worst:
            worst, second = error, worst
        elif error > second:
            second = error
    return second if spare > 0 and near.size > 1 else worst


@kernel
def cheapest(held, order, worth, neighbours, limit, spare, found):
    """found (V,): the first rung in this order that holds for a variant by what its neighbours (V, k) tell, with its
    ``limit`` (V,); where there is none, the first that is within ALIKE of the least among the first ``worth``."""
    for v in range(neighbours.shape[0]):
        found[v] = -1
        least = np.inf
        for place in range(order.shape[0]):
            told = told_of(held, order[place], neighbours[v], limit[v], spare)
            if told <= 1.0:
                found[v] = order[place]
                break
            if place < worth:
                least = told if told < least else least
        if found[v] < 0:
            for rung in order[:worth]:
                if told_of(held, rung, neighbours[v], limit[v], spare) <= ALIKE * least:
                    found[v] = rung
                    break
            found[v] = order[worth - 1] if found[v] < 0 else found[v]


ALIKE = 1.25  # times the least error: as good as that, where none is small enough
