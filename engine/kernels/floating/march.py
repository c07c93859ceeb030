"""Implicit steps of bodies whose frames move: Newmark's formulas or generalized-alpha (Arnold and Bruels 2007; on the
rotation group Bruels and Cardona 2010), Newton's method in each step.

The tangent is made of differences of the residual, and kept for as many steps as the iteration converges fast.
"""

from typing import NamedTuple

import numpy as np

from engine.kernels.floating.equations import Work, follow_frame, residual, room
from engine.kernels.floating.layout import (
    COORDINATE,
    DIVERGED,
    FIRST,
    KIND,
    LARGEST,
    LARGEST_AT,
    LENGTH,
    MASS,
    MODES,
    NOT_CONVERGED,
    OVER_THE_END,
    PLACE_COORDINATE,
    RIDDEN,
    SMALLEST,
    SMALLEST_AT,
    SOUND,
    SPHERICAL,
    SQUARES,
    Coordinates,
    Lane,
)
from engine.kernels.floating.motions import motions_at
from engine.kernels.floating.observe import observe, observe_whole
from engine.kernels.floating.vectors import after, keep_matrix, matrix, rotation
from engine.kernels.jit import called, kernel, piece
from engine.kernels.layout import FloatArray, IntArray

PART = 1e-3  # of the largest acceleration so far, by which accelerations are moved for differences
#: A correction, and what it leaves, over the largest acceleration so far, at which the iteration ends. What is
#: observed is of before the last correction.
SMALL, ENOUGH = 1e-7, 1e-10
STALLED = 0.5  # a small correction that is no smaller than so much of the one before is rounding
SLOW = 0.05  # a correction over the one before it, from which on the tangent is made anew
MOST_ITERATIONS = 25
MOST_BENT = 10.0  # lengths of a body: beyond, a march has diverged, whatever is wrong
NEAR = 1e-9  # of a step: an event so near to a station falls on it
JUMP = 1e-12  # of a rate: below it is rounding


class State(NamedTuple):
    """One lane under way: where it is, and where it is tried to be at the end of the step; all (N): accelerations of
    generalized-alpha, those of the step before, the residual, and how heavy each coordinate is, kg^(1/2) or alike."""

    now: Coordinates
    tried: Coordinates
    inner: FloatArray
    before: FloatArray
    residual: FloatArray
    weight: FloatArray


class Solver(NamedTuple):
    """The tangent's factors, and how it goes: memory holds the largest weighted acceleration so far, the rate of
    convergence, and 1 where the tangent is of use."""

    work: Work
    other: FloatArray
    matrix: FloatArray
    order: IntArray
    memory: FloatArray


SCALE, RATE, FRESH = 0, 1, 2


@called
def tangent(system, lane, state, of_y, of_u, solver):
    """Derivative of the residual by the accelerations, coordinates and velocities following by of_y and of_u: the
    residual is linear in accelerations, and nearly so in what a step makes of them."""
    x, M = state.tried, solver.matrix
    N = x.y.size
    residual(system, lane, x, solver.work, solver.other)
    for k in range(N):
        by = PART * solver.memory[SCALE] / state.weight[k]
        y, u, a = x.y[k], x.u[k], x.a[k]
        x.y[k], x.u[k], x.a[k] = y + of_y * by, u + of_u * by, a + by
        residual(system, lane, x, solver.work, state.residual)
        for i in range(N):
            M[i, k] = (state.residual[i] - solver.other[i]) / by
        x.y[k], x.u[k], x.a[k] = y, u, a


@called
def factor(M, order):
    """LU factors of a matrix in its place, rows exchanged by ``order``; whether it is regular."""
    N = order.size
    for k in range(N):
        pivot = k
        for i in range(k + 1, N):
            if abs(M[i, k]) > abs(M[pivot, k]):
                pivot = i
        order[k] = pivot
        if not abs(M[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(k, N):
                M[k, j], M[pivot, j] = M[pivot, j], M[k, j]
        for i in range(k + 1, N):
            M[i, k] /= M[k, k]
            for j in range(k + 1, N):
                M[i, j] -= M[i, k] * M[k, j]
    return True


@called
def solve(M, order, x):
    """x by the factors, in its place."""
    N = order.size
    for k in range(N):
        pivot = order[k]
        x[k], x[pivot] = x[pivot], x[k]
        for i in range(k + 1, N):
            x[i] -= M[i, k] * x[k]
    for back in range(N):
        k = N - 1 - back
        for j in range(k + 1, N):
            x[k] -= M[k, j] * x[j]
        x[k] /= M[k, k]


@called
def solve_accelerations(system, lane, state, solver):
    """Accelerations as they follow from the state, in which the equations are linear; whether there are such."""
    x = state.now
    x.a[:] = 0.0
    if not factor_masses(system, lane, state, solver):
        return False
    for _ in range(2):
        residual(system, lane, x, solver.work, state.residual)
        solve(solver.matrix, solver.order, state.residual)
        for k in range(x.a.size):
            x.a[k] -= state.residual[k]
            solver.memory[SCALE] = max(solver.memory[SCALE], state.weight[k] * abs(x.a[k]))
    residual(system, lane, x, solver.work, state.residual)
    state.inner[:] = x.a
    state.before[:] = x.a
    return True


@piece
def factor_masses(system, lane, state, solver):
    """Factors of the mass matrix in place of those of the tangent, and how heavy each coordinate is; whether it is
    regular. What is tried stands at the state, without accelerations."""
    g = lane.gravity
    kept = solver.memory[SCALE]
    solver.memory[SCALE], state.weight[:] = 1.0, 1.0
    state.tried.y[:], state.tried.u[:], state.tried.a[:] = state.now.y, state.now.u, 0.0
    tangent(system, lane, state, 0.0, 0.0, solver)
    weight = np.sqrt((g[0] ** 2 + g[1] ** 2 + g[2] ** 2) * system.bodies[:, MASS].sum())
    solver.memory[SCALE], solver.memory[FRESH] = max(kept, weight), 0.0
    for k in range(state.weight.size):
        state.weight[k] = np.sqrt(abs(solver.matrix[k, k]))
    return factor(solver.matrix, solver.order)


@piece
def strike(system, lane, before, state, solver):
    """Velocities jump where a given motion's rate does, so that no momentum is lost: an impulse is to velocities what a
    force is to accelerations. before (M, 3): the motions on the other side."""
    motions = solver.work.motions
    jumps = False
    for m in range(motions.shape[0]):
        jumps = jumps or abs(motions[m, 1] - before[m, 1]) > JUMP * (abs(before[m, 1]) + abs(motions[m, 1]))
    if not jumps:
        return
    factor_masses(system, lane, state, solver)
    after_it = motions.copy()
    motions[:] = before
    motions[:, 2] = 0.0
    residual(system, lane, state.tried, solver.work, solver.other)
    motions[:, 2] = after_it[:, 1] - before[:, 1]
    residual(system, lane, state.tried, solver.work, state.residual)
    motions[:] = after_it
    for k in range(state.residual.size):
        state.residual[k] -= solver.other[k]
    solve(solver.matrix, solver.order, state.residual)
    for k in range(state.residual.size):
        state.now.u[k] -= state.residual[k]


@called
def turn_bases(joints, base, y):
    """The rotation of a step goes into the attitudes of spherical joints."""
    for j in range(joints.shape[0]):
        if joints[j, KIND] == SPHERICAL:
            k = joints[j, COORDINATE]
            keep_matrix(base, j, 0, after(matrix(base, j, 0), rotation((y[k], y[k + 1], y[k + 2]))))
            y[k], y[k + 1], y[k + 2] = 0.0, 0.0, 0.0


@called
def advance(state, scheme, h):
    """Coordinates and velocities by the accelerations that are tried: Newmark's formulas with those of
    generalized-alpha, (1 - m) inner_new + m inner = (1 - f) a_new + f a."""
    beta, gamma, m, f = scheme
    x, new, inner = state.now, state.tried, state.inner
    for k in range(inner.size):
        own = ((1.0 - f) * new.a[k] + f * x.a[k] - m * inner[k]) / (1.0 - m)
        new.y[k] = x.y[k] + h * x.u[k] + h * h * ((0.5 - beta) * inner[k] + beta * own)
        new.u[k] = x.u[k] + h * ((1.0 - gamma) * inner[k] + gamma * own)


@called
def take(state, scheme):
    """What is tried becomes the state."""
    m, f = scheme.alpha_m, scheme.alpha_f
    x, new = state.now, state.tried
    for k in range(state.inner.size):
        own = ((1.0 - f) * new.a[k] + f * x.a[k] - m * state.inner[k]) / (1.0 - m)
        x.y[k], x.u[k] = new.y[k], new.u[k]
        state.before[k], x.a[k], state.inner[k] = x.a[k], new.a[k], own


@called
def correct(state, solver):
    """One correction of the accelerations; its size over the largest so far."""
    solve(solver.matrix, solver.order, state.residual)
    change, scale, a = 0.0, solver.memory[SCALE], state.tried.a
    for k in range(a.size):
        a[k] -= state.residual[k]
        scale = max(scale, state.weight[k] * abs(a[k]))
        change += (state.weight[k] * state.residual[k]) ** 2
    solver.memory[SCALE] = scale
    return np.sqrt(change) / scale if change > 0.0 else change


@called
def step(system, lane, scheme, h, state, solver):
    """Newton's method for one step, from accelerations that go on as they did; a code."""
    of_new = (1.0 - scheme.alpha_f) / (1.0 - scheme.alpha_m)
    of_y, of_u = scheme.beta * of_new * h * h, scheme.gamma * of_new * h
    for k in range(state.before.size):
        state.tried.a[k] = 2.0 * state.now.a[k] - state.before[k]
    before, memory = np.inf, solver.memory
    for _ in range(MOST_ITERATIONS):
        advance(state, scheme, h)
        if memory[FRESH] == 0.0:
            tangent(system, lane, state, of_y, of_u, solver)
            if not factor(solver.matrix, solver.order):
                return NOT_CONVERGED
            memory[FRESH], memory[RATE], before = 1.0, 1.0, np.inf
        residual(system, lane, state.tried, solver.work, state.residual)
        change = correct(state, solver)
        if not change < np.inf:
            return DIVERGED
        if before < np.inf and before > 0.0:
            memory[RATE] = change / before
        small = change <= SMALL
        if small and (change * memory[RATE] <= ENOUGH or change > STALLED * before):
            advance(state, scheme, h)
            return SOUND
        if change > SLOW * before:
            memory[FRESH] = 0.0
        before = change
    return NOT_CONVERGED


@piece
def go_on(system, lane, scheme, start, end, state, solver):
    """From one time to another (s) without an event between them; a code."""
    motions_at(lane.motions, end, 0.5 * (start + end), solver.work.motions)
    code = step(system, lane, scheme, end - start, state, solver)
    if code == SOUND:
        take(state, scheme)
    return code


@piece
def pass_event(system, lane, time, later, state, solver):
    """A given motion goes on as another piece: velocities and accelerations jump with it; whether that could be."""
    work = solver.work
    before = work.motions.copy()
    turn_bases(system.joint_table, work.base, state.now.y)
    motions_at(lane.motions, time, later, work.motions)
    strike(system, lane, before, state, solver)
    return solve_accelerations(system, lane, state, solver)


@called
def room_to_march(system, lane):
    """State and solver of a lane at its start, accelerations not known yet."""
    N = lane.start.shape[1]
    rows = np.zeros((10, N))
    now, tried = Coordinates(rows[0], rows[1], rows[2]), Coordinates(rows[3], rows[4], rows[5])
    now.y[:], now.u[:] = lane.start[0], lane.start[1]
    state = State(now, tried, rows[6], rows[7], rows[8], rows[9])
    work = room(system, lane)
    turn_bases(system.joint_table, work.base, now.y)
    motions_at(lane.motions, 0.0, 0.0, work.motions)
    for b in range(system.tree.shape[0]):  # those that rest are followed once
        follow_frame(system, lane, b, now, work)
    return state, Solver(work, np.zeros(N), np.zeros((N, N)), np.zeros(N, np.int64), np.zeros(3))


@piece
def march_lane(system, lane, scheme, steps, h, number_of_lane, record):
    """One lane from its start to the end, its signals into the record. Returns how it went, and the last station."""
    statistics, history = record.statistics[number_of_lane], record.history[number_of_lane]
    state, solver = room_to_march(system, lane)
    signals, kept, event = np.zeros(statistics.shape[0]), 0, 0
    if not solve_accelerations(system, lane, state, solver):
        return NOT_CONVERGED, 0
    for number in range(steps + 1):
        now, end = (number - 1) * h, number * h
        while number and event < lane.events.size and lane.events[event] < end - NEAR * h:
            passing, code = lane.events[event], SOUND
            if passing > now + NEAR * h:
                solver.memory[FRESH] = 0.0  # of another step
                code = go_on(system, lane, scheme, now, passing, state, solver)
                now = passing
            event += 1
            if code == SOUND and not pass_event(system, lane, now, 0.5 * (now + end), state, solver):
                code = NOT_CONVERGED
            if code != SOUND:
                return code, number - 1
        if number:
            code = go_on(system, lane, scheme, now, end, state, solver)
            if code != SOUND:
                return code, number - 1
            if now > (number - 1) * h:
                solver.memory[FRESH] = 0.0
        watched = observe(system, lane, state.now, solver.work, signals)
        count(signals, watched, number, 0.5 if number in (0, steps) else 1.0, statistics)
        if kept < record.stations.size and record.stations[kept] == number:
            observe_whole(system, lane, state.now, solver.work, signals[watched:])
            history[kept] = signals
            kept += 1
        turn_bases(system.joint_table, solver.work.base, state.now.y)
        if has_left(system, state.now.y):
            return OVER_THE_END, number
        if is_meaningless(system, state.now.y):
            return DIVERGED, number
    return SOUND, steps


@called
def has_left(system, y):
    """Whether a carriage has slid over an end of its track."""
    for c in range(system.riders.shape[0]):
        k = system.riders[c, PLACE_COORDINATE]
        if k >= 0 and not 0.0 <= y[k] <= system.bodies[system.riders[c, RIDDEN], LENGTH]:
            return True
    return False


@called
def is_meaningless(system, y):
    """Whether a body bends by many times its length."""
    for b in range(system.tree.shape[0]):
        most = MOST_BENT * system.bodies[b, LENGTH] * np.sqrt(system.bodies[b, MASS])  # modal masses are 1
        for k in range(system.tree[b, FIRST], system.tree[b, FIRST] + system.tree[b, MODES]):
            if not abs(y[k]) <= most:
                return True
    return False


@called
def count(signals, watched, number, weight, statistics):
    """The first signals of a station go into the statistics."""
    for j in range(watched):
        value = signals[j]
        if value > statistics[j, LARGEST]:
            statistics[j, LARGEST], statistics[j, LARGEST_AT] = value, number
        if value < statistics[j, SMALLEST]:
            statistics[j, SMALLEST], statistics[j, SMALLEST_AT] = value, number
        statistics[j, SQUARES] += weight * value * value


@kernel
def march(system, lanes, scheme, steps, h, record):
    """All lanes, each with its step h (L) in s, into the record."""
    for k in range(h.size):
        lane = Lane(
            lanes.gravity[k],
            lanes.damping[k],
            lanes.joints[k],
            lanes.carriages[k],
            lanes.motions[k],
            lanes.events[k],
            lanes.start[k],
        )
        record.codes[k], record.last[k] = march_lane(system, lane, scheme, steps, h[k], k, record)
