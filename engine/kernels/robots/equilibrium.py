"""Where robots rest on rails: springs of modes and joints against the weight of all links and payloads.

Corrections by the springs alone come first, as weight is as nothing beside most of them, and these cost one evaluation
each. Where they hardly come closer, or weight and springs are of a size, Newton's method takes over, whose matrix has
the stiffness of the weight in it. It goes from where joints are told to be in short steps, at each of which that matrix
is positive definite: so a joint goes as it would if gravity grew from nothing, and one that would fall over is found.
"""

import numpy as np

from engine.kernels.jit import called
from engine.kernels.layout import NOT_CONVERGED, SOUND
from engine.kernels.robots.dynamics import backward, evaluate, factorise, forward
from engine.kernels.robots.layout import BEFORE, CHANGE, FALLS_OVER, LIKELY, SOFT

MOST_SETTLING = 200  # corrections
SCALED_FOX_GOODWIN = 0.25  # of its elastic energy before: what a correction may be to leave Newton's method aside
#: m or rad by which coordinates are moved for differences, and that a joint goes at most by one correction.
MOVED_BY, FARTHEST = 1e-4, 0.1
HEAVY = 0.25  # of a spring's stiffness: that of the weight from which on all of it is looked at
BARELY = 1e-6  # of a spring's stiffness: what is left of it under the weight that counts as nothing


@called
def settle(system, close, state, work, left):
    """Static equilibrium of what is planned, which stands still, and whether that is stable; a code."""
    start = work.vectors[SOFT]
    for k in range(state.shape[0]):
        start[k] = state[k, 0]
    if by_springs(system, close, state, work, left):
        if weight_part(system, state, work, left) < HEAVY:
            return SOUND
        if is_steady(system, state, work, left):
            return SOUND
    for k in range(state.shape[0]):
        state[k, 0] = start[k]
    return by_newton(system, close, state, work, left)


@called
def by_springs(system, close, state, work, left):
    """Corrections by the springs alone; whether these came close, each much closer than the one before."""
    before = np.inf
    for _ in range(MOST_SETTLING):
        evaluate(system, state, work, left)
        change, largest = 0.0, 0.0
        for k in range(state.shape[0]):
            by = left[k] / system.springs[k, 0]
            state[k, 0] -= by
            change = max(change, by**2 * system.springs[k, 0])
            largest = max(largest, state[k, 0] ** 2 * system.springs[k, 0])
        if change <= close * largest:
            return True
        if not change <= SCALED_FOX_GOODWIN * before:
            return False
        before = change
    return False


@called
def by_newton(system, close, state, work, left):
    """Newton's method in steps of ``FARTHEST`` at most, as long as all on its way is stable."""
    change = work.vectors[CHANGE]
    modes = work.inverse.shape[0]
    for _ in range(MOST_SETTLING):
        if not is_steady(system, state, work, left):
            return FALLS_OVER
        evaluate(system, state, work, left)
        for k in range(state.shape[0]):
            change[k] = left[k]
        forward(work.tangent, state.shape[0], change)
        backward(work.tangent, state.shape[0], change)
        part, done, largest = 1.0, 0.0, 0.0
        for k in range(modes, state.shape[0]):
            part = min(part, FARTHEST / max(abs(change[k]), FARTHEST))
        for k in range(state.shape[0]):
            state[k, 0] -= part * change[k]
            done = max(done, change[k] ** 2 * system.springs[k, 0])
            largest = max(largest, state[k, 0] ** 2 * system.springs[k, 0])
        if done <= close * largest:
            return SOUND
        if not np.isfinite(done):
            return NOT_CONVERGED
    return NOT_CONVERGED


@called
def is_steady(system, state, work, left):
    """Whether springs and weight together bring back whatever moves: the factors of their stiffness, into
    ``work.tangent``, are those of a positive definite matrix."""
    tangent, least = work.tangent, work.vectors[BEFORE]
    N = state.shape[0]
    for k in range(N):
        y = state[k, 0]
        for sign in (1.0, -1.0):
            state[k, 0] = y + sign * MOVED_BY
            evaluate(system, state, work, left)
            for i in range(k + 1):
                before = 0.0 if sign > 0.0 else tangent[i, k]
                tangent[i, k] = before + sign * left[i] / (2.0 * MOVED_BY)
        state[k, 0] = y
        least[k] = np.sqrt(BARELY * system.springs[k, 0])
    factorise(tangent, N)
    held = True
    for k in range(N):
        held &= tangent[k, k] > least[k]  # not so of NaN
    return held


@called
def weight_part(system, state, work, left):
    """How stiff the weight is beside the springs, by one more power of that in the direction LIKELY, which is kept
    from one rest to the next; infinite at the first one."""
    likely, before = work.vectors[LIKELY], work.vectors[BEFORE]
    size, stiff, heavy = 0.0, 0.0, 0.0
    for k in range(state.shape[0]):
        size = max(size, abs(likely[k]))
    if size == 0.0:
        for k in range(state.shape[0]):
            likely[k] = 1.0 / (1.0 + k % 7)
        return np.inf
    evaluate(system, state, work, left)
    for k in range(state.shape[0]):
        before[k] = left[k]
        likely[k] *= MOVED_BY / size
        state[k, 0] += likely[k]
    evaluate(system, state, work, left)
    for k in range(state.shape[0]):
        state[k, 0] -= likely[k]
        by = left[k] - before[k] - system.springs[k, 0] * likely[k]
        stiff += likely[k] ** 2 * system.springs[k, 0]
        heavy += by**2 / system.springs[k, 0]
        likely[k] = by / system.springs[k, 0]
    return np.sqrt(heavy / stiff)
