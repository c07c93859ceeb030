"""What all ways to make a step share: the state of a block of lanes, what is remembered of each, the formulas of
Newmark and of generalized-alpha, and small systems of equations."""

from typing import NamedTuple

from engine.kernels.floating.layout import SOUND, Coordinates
from engine.kernels.floating.work import Work
from engine.kernels.jit import called
from engine.kernels.layout import FloatArray
from engine.kernels.vector import all_lanes, choose, lanes_at, put_lanes


class State(NamedTuple):
    """A block of lanes under way: where it is, and where it is tried to be at the end of the step; all (N, LANES):
    accelerations of generalized-alpha, those of the step before, the residual, how heavy each coordinate is,
    kg^(1/2) or alike, and its beta."""

    now: Coordinates
    tried: Coordinates
    inner: FloatArray
    before: FloatArray
    earlier: FloatArray
    residual: FloatArray
    weight: FloatArray
    beta: FloatArray


class Solver(NamedTuple):
    """Factors of the tangents (N, N, LANES) that are in use and of new ones; motions before and after an event; how it
    goes with each lane, (MEMORY, LANES): see the rows below."""

    work: Work
    other: FloatArray
    matrix: FloatArray
    fresh: FloatArray
    before: FloatArray
    after: FloatArray
    memory: FloatArray


class Ways(NamedTuple):
    """How coordinates and velocities follow accelerations in a step: by of_y beta (N, LANES) and by of_u."""

    of_y: FloatArray
    of_u: FloatArray
    beta: FloatArray


# rows of Solver.memory: largest weighted acceleration so far, 1 where the tangent is of use, the last correction, 1
# where the lane's iteration has ended, its code; time at which the lane stands, and the time of its next event
SCALE, FRESH, LAST, DONE, CODE, TIME, EVENT, MEMORY = 0, 1, 2, 3, 4, 5, 6, 7


@called
def of(memory, row):
    """A row of the memory."""
    return lanes_at(memory, (row,))


@called
def put_where(who, table, index, value):
    """Store a row in some lanes."""
    put_lanes(table, index, choose(who, value, lanes_at(table, index)))


@called
def sound(memory):
    """Lanes with which nothing has happened."""
    return of(memory, CODE) < SOUND + 0.5


@called
def factor(M):
    """LU factors of matrices in their place, the pivots inverted, without exchanges, as masses lead; 1 in the lanes
    where they are regular, else 0."""
    N, regular = M.shape[0], all_lanes(1.0)
    for i in range(N):
        for j in range(N):
            found = lanes_at(M, (i, j))
            for k in range(min(i, j)):
                found = found - lanes_at(M, (i, k)) * lanes_at(M, (k, j))
            if j < i:
                found = found * lanes_at(M, (j, j))
            elif j == i:
                regular = choose(found * found > 0.0, regular, 0.0)
                found = 1.0 / found
            put_lanes(M, (i, j), found)
    return regular


@called
def solve(M, x):
    """x (N, LANES) by the factors, in its place."""
    N = M.shape[0]
    for k in range(1, N):
        found = lanes_at(x, (k,))
        for j in range(k):
            found = found - lanes_at(M, (k, j)) * lanes_at(x, (j,))
        put_lanes(x, (k,), found)
    for back in range(N):
        k = N - 1 - back
        found = lanes_at(x, (k,))
        for j in range(k + 1, N):
            found = found - lanes_at(M, (k, j)) * lanes_at(x, (j,))
        put_lanes(x, (k,), found * lanes_at(M, (k, k)))


@called
def advance(state, scheme, h):
    """Coordinates and velocities by the accelerations that are tried: Newmark's formulas with those of
    generalized-alpha, (1 - m) inner_new + m inner = (1 - f) a_new + f a."""
    gamma, x, new = scheme.gamma, state.now, state.tried
    for k in range(state.inner.shape[0]):
        beta = lanes_at(state.beta, (k,))
        own, inner, u = inner_of(state, scheme, k), lanes_at(state.inner, (k,)), lanes_at(x.u, (k,))
        put_lanes(new.y, (k,), lanes_at(x.y, (k,)) + h * u + h * h * ((0.5 - beta) * inner + beta * own))
        put_lanes(new.u, (k,), u + h * ((1.0 - gamma) * inner + gamma * own))


@called
def ways_of(state, scheme, h):
    """How coordinates and velocities follow accelerations in a step h of a scheme."""
    of_new = (1.0 - scheme.alpha_f) / (1.0 - scheme.alpha_m)
    return Ways(of_new * h * h, scheme.gamma * of_new * h, state.beta)


@called
def of_coordinate(ways, k):
    """How a coordinate follows its acceleration."""
    return lanes_at(ways.beta, (k,)) * ways.of_y


@called
def inner_of(state, scheme, k):
    """The acceleration of generalized-alpha that follows from the one that is tried."""
    m, f = scheme.alpha_m, scheme.alpha_f
    new, old, inner = lanes_at(state.tried.a, (k,)), lanes_at(state.now.a, (k,)), lanes_at(state.inner, (k,))
    return ((1.0 - f) * new + f * old - m * inner) / (1.0 - m)


@called
def going_on(state, k):
    """The acceleration at the end of a step, if it goes on as it did in three steps."""
    now, before, earlier = lanes_at(state.now.a, (k,)), lanes_at(state.before, (k,)), lanes_at(state.earlier, (k,))
    return 3.0 * (now - before) + earlier


@called
def take(who, state, scheme):
    """What is tried becomes the state of some lanes."""
    x, new = state.now, state.tried
    for k in range(state.inner.shape[0]):
        own = inner_of(state, scheme, k)
        put_where(who, x.y, (k,), lanes_at(new.y, (k,)))
        put_where(who, x.u, (k,), lanes_at(new.u, (k,)))
        put_where(who, state.earlier, (k,), lanes_at(state.before, (k,)))
        put_where(who, state.before, (k,), lanes_at(x.a, (k,)))
        put_where(who, x.a, (k,), lanes_at(new.a, (k,)))
        put_where(who, state.inner, (k,), own)


@called
def size_of(row):
    """Without sign."""
    return choose(row < 0.0, -1.0 * row, row)


@called
def or_one(row):
    """1 where it is 0."""
    return choose(row > 0.0, row, 1.0)
