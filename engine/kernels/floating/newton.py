"""Newton's method for the accelerations at the end of a step, where a march or a piece of a motion begins, and for
static equilibrium before that.

The tangent is made of differences of the residual, and kept for as many steps as the iteration converges fast. Lanes
go side by side, and each decides for itself: a lane that is done, or has failed, stays where it is while others go on,
so that its numbers do not depend on its neighbours.
"""

import numpy as np

from engine.kernels.floating.equations import residual
from engine.kernels.floating.layout import (
    COORDINATE,
    DIVERGED,
    FIRST,
    KIND,
    LENGTH,
    MASS,
    MODES,
    NOT_CONVERGED,
    SPHERICAL,
    SPRING,
    SPRUNG_COORDINATE,
    SPRUNG_MASS,
    STIFFNESS,
)
from engine.kernels.floating.state import (
    CODE,
    DONE,
    FRESH,
    LAST,
    SCALE,
    Ways,
    advance,
    factor,
    going_on,
    of,
    of_coordinate,
    or_one,
    put_where,
    size_of,
    solve,
    sound,
    ways_of,
)
from engine.kernels.floating.vectors import dot
from engine.kernels.floating.work import three_at
from engine.kernels.jit import called
from engine.kernels.vector import all_lanes, choose, everywhere, lanes_at, put_lanes, root

PART = 1e-3  # of the largest acceleration so far, by which accelerations are moved for differences
#: A correction, and what is left after one more, over the largest acceleration so far, at which the iteration ends.
SMALL, ENOUGH = 1e-6, 1e-10
STALLED = 0.5  # a small correction that is no smaller than so much of the one before is rounding
SLOW = 0.1  # a correction over the one before it, from which on the tangent of a lane is made anew
MOST_ITERATIONS = 25
SHARE = 0.5  # of the bounds of masses that steps may take: coordinates that move change the mass matrix
OF_SPRUNG = 0.1  # of a mass on a spring
POWERS, GOLDEN = 16, 0.618  # steps of the power method, from a vector that is along no mode
STILL = 1e-9  # of a length within a step: what moves by less rests
#: Of statics, whose coordinates are counted in lengths of their body, rad or m: by how much they are moved for
#: differences, how far they go at most by a correction, and the correction at which the iteration ends, as the next
#: one is far below rounding.
MOVED_BY, FARTHEST, CLOSE = 1e-7, 0.1, 1e-9
MOST_CORRECTIONS = 100


@called
def tangent(system, lane, state, ways, solver):
    """Derivative of the residual by the accelerations, coordinates and velocities following in their ways, into the
    fresh matrix: the residual is linear in accelerations, and nearly so in what a step makes of them."""
    x, M = state.tried, solver.fresh
    N = M.shape[0]
    residual(system, lane, x, solver.work, solver.other)
    for k in range(N):
        by = PART * or_one(of(solver.memory, SCALE)) / lanes_at(state.weight, (k,))
        y, u, a = lanes_at(x.y, (k,)), lanes_at(x.u, (k,)), lanes_at(x.a, (k,))
        put_lanes(x.y, (k,), y + of_coordinate(ways, k) * by)
        put_lanes(x.u, (k,), u + ways.of_u * by)
        put_lanes(x.a, (k,), a + by)
        residual(system, lane, x, solver.work, state.residual)
        for i in range(N):
            put_lanes(M, (i, k), (lanes_at(state.residual, (i,)) - lanes_at(solver.other, (i,))) / by)
        put_lanes(x.y, (k,), y)
        put_lanes(x.u, (k,), u)
        put_lanes(x.a, (k,), a)


@called
def solve_accelerations(system, lane, who, state, solver):
    """Accelerations of some lanes as they follow from the state, in which the equations are linear; lanes in which
    there are none do not converge."""
    x, memory = state.tried, solver.memory
    regular = factor_masses(system, lane, who, state, solver)
    for _ in range(2):
        residual(system, lane, x, solver.work, state.residual)
        solve(solver.fresh, state.residual)
        for k in range(x.a.shape[0]):
            a = lanes_at(x.a, (k,)) - lanes_at(state.residual, (k,))
            put_lanes(x.a, (k,), a)
            heavy = lanes_at(state.weight, (k,)) * size_of(a)
            put_where(who & (heavy > of(memory, SCALE)), memory, (SCALE,), heavy)
    residual(system, lane, x, solver.work, state.residual)
    for k in range(x.a.shape[0]):
        a = lanes_at(x.a, (k,))
        put_where(who, state.now.a, (k,), a)
        put_where(who, state.inner, (k,), a)
        put_where(who, state.before, (k,), a)
        put_where(who, state.earlier, (k,), a)
    put_where(who & (regular < 0.5), memory, (CODE,), all_lanes(1.0 * NOT_CONVERGED))


@called
def least_scale(system, lane):
    """The least that weighted accelerations are measured by: gravity's, and `STILL` of a length within a step. Forces
    that are balanced leave accelerations that are rounding alone, and differences by parts of these no tangent."""
    mass, length, g = 0.0, 0.0, three_at(lane.gravity, 0)
    for b in range(system.bodies.shape[0]):
        mass += system.bodies[b, MASS]
        length = max(length, system.bodies[b, LENGTH])
    h = lanes_at(lane.step, (0,))
    weight, still = root(mass * dot(g, g)), np.sqrt(mass) * STILL * length / (h * h)
    return choose(weight > still, weight, still)


@called
def factor_masses(system, lane, who, state, solver):
    """Factors of the mass matrix into the fresh matrix, and of some lanes how heavy each coordinate is; 1 where it is
    regular. What is tried stands at the state, without accelerations."""
    memory, N = solver.memory, state.weight.shape[0]
    kept, zero = of(memory, SCALE), all_lanes(0.0)
    put_lanes(memory, (SCALE,), all_lanes(1.0))
    for k in range(N):
        put_lanes(state.tried.y, (k,), lanes_at(state.now.y, (k,)))
        put_lanes(state.tried.u, (k,), lanes_at(state.now.u, (k,)))
        put_lanes(state.tried.a, (k,), zero)
        put_where(who, state.weight, (k,), all_lanes(1.0))
    tangent(system, lane, state, Ways(zero, zero, state.beta), solver)
    least = least_scale(system, lane)
    put_lanes(memory, (SCALE,), choose(who & (least > kept), least, kept))
    put_where(who, memory, (FRESH,), zero)
    for k in range(N):
        own = lanes_at(solver.fresh, (k, k))
        put_where(who, state.weight, (k,), root(size_of(own)))
    return factor(solver.fresh)


@called
def own_stiffness(system, lane, out):
    """Of each coordinate by itself, into out (N, LANES): of modes, of springs that carry masses, and of joints."""
    for k in range(out.shape[0]):
        put_lanes(out, (k,), all_lanes(0.0))
    widest = system.track.shape[4]
    for b in range(system.tree.shape[0]):
        for i in range(system.tree[b, MODES]):
            row = (b * widest + i) * widest + i
            put_lanes(out, (system.tree[b, FIRST] + i,), all_lanes(system.pairs[row, STIFFNESS]))
    for c in range(system.riders.shape[0]):
        if system.riders[c, SPRUNG_COORDINATE] >= 0:
            put_lanes(out, (system.riders[c, SPRUNG_COORDINATE],), lanes_at(lane.carriages, (c, SPRING)))
    for j in range(system.joint_table.shape[0]):
        if system.joint_table[j, COORDINATE] >= 0 and system.joint_table[j, KIND] != SPHERICAL:
            put_lanes(out, (system.joint_table[j, COORDINATE],), lanes_at(lane.joints, (j, 0)))


@called
def bound_masses(system, lane, state, solver):
    """Numbers c of coordinates that have a stiffness, with M > diag(c) for the mass matrix whose factors are the fresh
    ones, into the state's beta, where they are less than what stands there: 1/c_i = P_ii times the largest eigenvalue
    of P_ij/sqrt(P_ii P_jj), P = M^-1 of these coordinates."""
    P, K, column, N = solver.matrix, solver.other, state.residual, state.beta.shape[0]
    own_stiffness(system, lane, K)
    for j in range(N):
        for i in range(N):
            put_lanes(column, (i,), all_lanes(1.0 if i == j else 0.0))
        solve(solver.fresh, column)
        for i in range(N):
            counts = (lanes_at(K, (i,)) > 0.0) & (lanes_at(K, (j,)) > 0.0)
            put_lanes(P, (i, j), choose(counts, lanes_at(column, (i,)), 1.0 if i == j else 0.0))
    largest = largest_eigenvalue(P, column, state.tried.u)
    for i in range(N):
        bound, least = 1.0 / (largest * lanes_at(P, (i, i))), lanes_at(state.beta, (i,))
        bound = choose(bound > 0.0, bound, 0.0)  # 0 of NaN too
        put_lanes(state.beta, (i,), choose(bound < least, bound, least))


@called
def largest_eigenvalue(P, x, y):
    """Of P_ij/sqrt(P_ii P_jj), by so many steps of the power method; x, y (N, LANES): room."""
    N = P.shape[0]
    for i in range(N):
        put_lanes(x, (i,), all_lanes(1.0 + (i * GOLDEN) % 1.0))
    found = all_lanes(1.0)
    for _ in range(POWERS):
        size = all_lanes(0.0)
        for i in range(N):
            whole = all_lanes(0.0)
            for j in range(N):
                whole = whole + lanes_at(P, (i, j)) * (lanes_at(x, (j,)) / root(lanes_at(P, (j, j))))
            whole = whole / root(lanes_at(P, (i, i)))
            put_lanes(y, (i,), whole)
            size = size + whole * whole
        found = root(size)
        for i in range(N):
            put_lanes(x, (i,), lanes_at(y, (i,)) / found)
    return found


@called
def raise_beta(system, lane, scheme, state, stiffness):
    """Newmark's beta of each coordinate from the bounds of its masses; stiffness (N, LANES): room.

    Where stiffness K couples no coordinates, y = h^2 (1/delta + beta) a, by central differences delta of a step, makes
    s^2 (M + h^2 K (beta - 1/4)) + s C + K = 0 of M a + C v + K y = 0, with s = 2/h (z - 1)/(z + 1): it is stable while
    M > diag(h^2 K (1/4 - beta)), whatever C >= 0 damps. The mass on a carriage's spring counts by a part, as little of
    it is felt where many modes give way under the carriage."""
    h = lanes_at(lane.step, (0,))
    own_stiffness(system, lane, stiffness)
    for c in range(system.riders.shape[0]):
        if system.riders[c, SPRUNG_COORDINATE] >= 0:
            mass = lanes_at(lane.carriages, (c, SPRUNG_MASS))
            put_lanes(state.beta, (system.riders[c, SPRUNG_COORDINATE],), OF_SPRUNG * mass)
    for k in range(state.beta.shape[0]):
        square, bound = h * h * lanes_at(stiffness, (k,)), SHARE * lanes_at(state.beta, (k,))
        fast = square * (0.25 - scheme.beta) > bound
        raised = 0.25 - bound / choose(fast, square, 1.0)
        put_lanes(state.beta, (k,), choose(fast, raised, scheme.beta))


@called
def correct(who, state, solver):
    """One correction of the accelerations of some lanes; its size over the largest so far."""
    solve(solver.matrix, state.residual)
    change, scale, a = all_lanes(0.0), of(solver.memory, SCALE), state.tried.a
    for k in range(a.shape[0]):
        by, weight = lanes_at(state.residual, (k,)), lanes_at(state.weight, (k,))
        new = lanes_at(a, (k,)) - by
        put_where(who, a, (k,), new)
        heavy = weight * size_of(new)
        scale = choose(who & (heavy > scale), heavy, scale)
        change = change + (weight * by) * (weight * by)
    put_lanes(solver.memory, (SCALE,), scale)
    return root(change) / or_one(scale)


@called
def renew(system, lane, scheme, h, state, solver):
    """New tangents, and their factors, for the lanes that need them."""
    memory, M, new = solver.memory, solver.matrix, solver.fresh
    stale = (of(memory, FRESH) < 0.5) & (of(memory, DONE) < 0.5)
    if everywhere((of(memory, FRESH) > 0.5) | (of(memory, DONE) > 0.5)):
        return
    tangent(system, lane, state, ways_of(state, scheme, h), solver)
    regular = factor(new)
    for i in range(M.shape[0]):
        for j in range(M.shape[0]):
            put_where(stale, M, (i, j), lanes_at(new, (i, j)))
    put_where(stale, memory, (FRESH,), all_lanes(1.0))
    put_where(stale, memory, (LAST,), all_lanes(np.inf))
    singular = stale & (regular < 0.5)
    put_where(singular, memory, (CODE,), all_lanes(1.0 * NOT_CONVERGED))
    put_where(singular, memory, (DONE,), all_lanes(1.0))


@called
def judge(change, memory):
    """Whose iteration ends with a correction of that size, and whose tangent is too old."""
    last, going = of(memory, LAST), of(memory, DONE) < 0.5
    rate = choose((last < np.inf) & (last > 0.0), change / last, SLOW)
    ends = (change * rate * rate <= ENOUGH) | (change > STALLED * last)
    put_where(going & (rate > SLOW), memory, (FRESH,), all_lanes(0.0))
    put_where(going, memory, (LAST,), change)
    put_where(going & (change <= SMALL) & ends, memory, (DONE,), all_lanes(1.0))
    lost = choose(change < np.inf, 0.0, 1.0) > 0.5  # NaN too
    put_where(going & lost, memory, (CODE,), all_lanes(1.0 * DIVERGED))
    put_where(going & lost, memory, (DONE,), all_lanes(1.0))


@called
def step(system, lane, scheme, who, h, state, solver):
    """Newton's method for one step of some lanes, from accelerations that go on as they did. Each ends with one
    correction more, which is not judged: what is observed is of before it."""
    memory = solver.memory
    put_lanes(memory, (DONE,), choose(who, all_lanes(0.0), 1.0))
    for k in range(state.before.shape[0]):
        put_lanes(state.tried.a, (k,), going_on(state, k))
    put_lanes(memory, (LAST,), all_lanes(np.inf))
    for _ in range(MOST_ITERATIONS):
        advance(state, scheme, h)
        renew(system, lane, scheme, h, state, solver)
        residual(system, lane, state.tried, solver.work, state.residual)
        judge(correct(of(memory, DONE) < 0.5, state, solver), memory)
        if everywhere(of(memory, DONE) > 0.5):
            break
    put_where(of(memory, DONE) < 0.5, memory, (CODE,), all_lanes(1.0 * NOT_CONVERGED))
    advance(state, scheme, h)
    residual(system, lane, state.tried, solver.work, state.residual)
    correct(who & sound(memory), state, solver)
    advance(state, scheme, h)


@called
def settle(system, lane, who, state, solver):
    """Static equilibrium of some lanes, whose motions stand still where they begin, into the state; lanes that would
    fall over, or find none, do not converge."""
    memory, work, x = solver.memory, solver.work, state.tried
    N = state.weight.shape[0]
    for m in range(work.motions.shape[0]):
        put_lanes(work.motions, (m, 1), all_lanes(0.0))
        put_lanes(work.motions, (m, 2), all_lanes(0.0))
    for k in range(N):
        put_lanes(x.y, (k,), lanes_at(state.now.y, (k,)))
        put_lanes(x.u, (k,), all_lanes(0.0))
        put_lanes(x.a, (k,), all_lanes(0.0))
    measure(system, state.weight)
    put_lanes(memory, (DONE,), choose(who, all_lanes(0.0), 1.0))
    stable = all_lanes(1.0)
    for _ in range(MOST_CORRECTIONS):
        stable = stiffness(system, lane, state, solver)
        put_where(come_closer(state, solver) <= CLOSE, memory, (DONE,), all_lanes(1.0))
        if everywhere(of(memory, DONE) > 0.5):
            break
    lost = who & ((of(memory, DONE) < 0.5) | (stable < 0.5))
    put_where(lost, memory, (CODE,), all_lanes(1.0 * NOT_CONVERGED))
    for k in range(N):
        put_where(who, state.now.y, (k,), lanes_at(x.y, (k,)))


@called
def measure(system, weight):
    """One length of a body in its elastic coordinates, whose modal masses are 1; else 1."""
    for k in range(weight.shape[0]):
        put_lanes(weight, (k,), all_lanes(1.0))
    for b in range(system.tree.shape[0]):
        for k in range(system.tree[b, FIRST], system.tree[b, FIRST] + system.tree[b, MODES]):
            put_lanes(weight, (k,), all_lanes(system.bodies[b, LENGTH] * np.sqrt(system.bodies[b, MASS])))


@called
def stiffness(system, lane, state, solver):
    """What is left of statics into the residual, and the factors of its derivative by the coordinates into the fresh
    matrix; 1 where that is positive definite."""
    x, M = state.tried, solver.fresh
    N = M.shape[0]
    for k in range(N):
        by, y = MOVED_BY * lanes_at(state.weight, (k,)), lanes_at(x.y, (k,))
        put_lanes(x.y, (k,), y + by)
        residual(system, lane, x, solver.work, solver.other)
        put_lanes(x.y, (k,), y - by)
        residual(system, lane, x, solver.work, state.residual)
        for i in range(N):
            put_lanes(M, (i, k), (lanes_at(solver.other, (i,)) - lanes_at(state.residual, (i,))) / (2.0 * by))
        put_lanes(x.y, (k,), y)
    residual(system, lane, x, solver.work, state.residual)
    found = factor(M)
    for k in range(N):
        found = choose(lanes_at(M, (k, k)) > 0.0, found, 0.0)
    return found


@called
def come_closer(state, solver):
    """One correction of the lanes that are under way; its size, infinite where there is none."""
    y, size, going = state.tried.y, all_lanes(0.0), of(solver.memory, DONE) < 0.5
    solve(solver.fresh, state.residual)
    for k in range(y.shape[0]):
        part = lanes_at(state.residual, (k,)) / lanes_at(state.weight, (k,))
        size = size + part * part  # NaN too
    size = root(size)
    share = choose(size > FARTHEST, FARTHEST / size, 1.0)
    for k in range(y.shape[0]):
        put_where(going, y, (k,), lanes_at(y, (k,)) - share * lanes_at(state.residual, (k,)))
    return choose(size < np.inf, size, np.inf)
