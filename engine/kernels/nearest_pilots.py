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
    """The largest but one of the errors ``held`` (2, rungs, P) on a rung of the pilots ``near`` (k,), the only one if
    k = 1: the first count over the variant's ``limit``, the second as they are."""
    worst, second = 0.0, 0.0
    for p in near:
        error = max(held[0, rung, p] / limit, held[1, rung, p])
        if error > worst:
            worst, second = error, worst
        elif error > second:
            second = error
    return second if near.size > 1 else worst


@kernel
def cheapest(held, order, worth, neighbours, limit, found):
    """found (V,): the first rung in this order that holds by `worst_but_one` of a variant's neighbours (V, k) with its
    ``limit`` (V,); where there is none, the first that is within ALIKE of the least among the first ``worth``."""
    for v in range(neighbours.shape[0]):
        found[v] = -1
        least = np.inf
        for place in range(order.shape[0]):
            worst = worst_but_one(held, order[place], neighbours[v], limit[v])
            if worst <= 1.0:
                found[v] = order[place]
                break
            if place < worth:
                least = worst if worst < least else least
        if found[v] < 0:
            for rung in order[:worth]:
                if worst_but_one(held, rung, neighbours[v], limit[v]) <= ALIKE * least:
                    found[v] = rung
                    break
            found[v] = order[worth - 1] if found[v] < 0 else found[v]


ALIKE = 1.25  # times the least error: as good as that, where none is small enough
