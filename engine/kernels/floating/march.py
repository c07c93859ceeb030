"""Implicit steps of bodies whose frames move: Newmark's formulas or generalized-alpha (Arnold and Bruels 2007; on the
rotation group Bruels and Cardona 2010), Newton's method in each step.

The tangent is made of differences of the residual, and kept for as many steps as the iteration converges fast. Lanes
go side by side, and each decides for itself: a lane that is done, or has failed, stays where it is while others go on,
so that its numbers do not depend on its neighbours.
"""

from typing import NamedTuple

import numpy as np

from engine.kernels.floating.equations import follow_frame, residual
from engine.kernels.floating.given import step_given
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
from engine.kernels.floating.state import (
    CODE,
    DONE,
    EVENT,
    FRESH,
    LAST,
    MEMORY,
    SCALE,
    TIME,
    Solver,
    State,
    advance,
    factor,
    going_on,
    of,
    or_one,
    put_where,
    size_of,
    solve,
    sound,
    take,
)
from engine.kernels.floating.vectors import after, dot, keep_matrix, matrix, rotation
from engine.kernels.floating.work import room, three_at
from engine.kernels.jit import called, kernel, piece
from engine.kernels.layout import LANES, FloatArray
from engine.kernels.vector import all_lanes, choose, everywhere, lanes_at, put_lanes, root

PART = 1e-3  # of the largest acceleration so far, by which accelerations are moved for differences
#: A correction, and what is left after one more, over the largest acceleration so far, at which the iteration ends.
SMALL, ENOUGH = 1e-6, 1e-10
STALLED = 0.5  # a small correction that is no smaller than so much of the one before is rounding
SLOW = 0.1  # a correction over the one before it, from which on the tangent of a lane is made anew
#: Steps, for each residual that a tangent takes, after which those of all lanes are made anew: an eighth of a residual
#: for each step, which saves one correction in four of a mass that slides.
KEPT = 8
MOST_ITERATIONS = 25
MOST_BENT = 10.0  # lengths of a body: beyond, a march has diverged, whatever is wrong
STILL = 1e-9  # of a length within a step: what moves by less rests
NEAR = 1e-9  # of a step: an event so near to a station falls on it
JUMP = 1e-12  # of a rate: below it is rounding


class Room(NamedTuple):
    """What the march of a block of lanes works in; signals (signals, LANES)."""

    state: State
    solver: Solver
    signals: FloatArray


@called
def tangent(system, lane, state, of_y, of_u, solver):
    """Derivative of the residual by the accelerations, coordinates and velocities following by of_y and of_u, into the
    fresh matrix: the residual is linear in accelerations, and nearly so in what a step makes of them."""
    x, M = state.tried, solver.fresh
    N = M.shape[0]
    residual(system, lane, x, solver.work, solver.other)
    for k in range(N):
        by = PART * or_one(of(solver.memory, SCALE)) / lanes_at(state.weight, (k,))
        y, u, a = lanes_at(x.y, (k,)), lanes_at(x.u, (k,)), lanes_at(x.a, (k,))
        put_lanes(x.y, (k,), y + of_y * by)
        put_lanes(x.u, (k,), u + of_u * by)
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
    tangent(system, lane, state, zero, zero, solver)
    least = least_scale(system, lane)
    put_lanes(memory, (SCALE,), choose(who & (least > kept), least, kept))
    put_where(who, memory, (FRESH,), zero)
    for k in range(N):
        own = lanes_at(solver.fresh, (k, k))
        put_where(who, state.weight, (k,), root(size_of(own)))
    return factor(solver.fresh)


@called
def copy(one, other):
    """Motions (M, 3, LANES) into others."""
    for m in range(one.shape[0]):
        for k in range(3):
            put_lanes(other, (m, k), lanes_at(one, (m, k)))


@called
def strike(system, lane, who, state, solver):
    """Velocities jump where a given motion's rate does, so that no momentum is lost: an impulse is to velocities what a
    force is to accelerations. What is given on the other side stands in solver.before."""
    before = solver.before
    motions, after_it, jumping = solver.work.motions, solver.after, all_lanes(0.0)
    for m in range(motions.shape[0]):
        one, other = lanes_at(before, (m, 1)), lanes_at(motions, (m, 1))
        gap, size = (other - one) * (other - one), one * one + other * other
        jumping = choose(who & (gap > JUMP * JUMP * size), 1.0, jumping)
    if everywhere(jumping < 0.5):
        return
    factor_masses(system, lane, who, state, solver)
    copy(motions, after_it)
    copy(before, motions)
    for m in range(motions.shape[0]):
        put_lanes(motions, (m, 2), all_lanes(0.0))
    residual(system, lane, state.tried, solver.work, solver.other)
    for m in range(motions.shape[0]):
        put_lanes(motions, (m, 2), lanes_at(after_it, (m, 1)) - lanes_at(before, (m, 1)))
    residual(system, lane, state.tried, solver.work, state.residual)
    copy(after_it, motions)
    for k in range(state.residual.shape[0]):
        put_lanes(state.residual, (k,), lanes_at(state.residual, (k,)) - lanes_at(solver.other, (k,)))
    solve(solver.fresh, state.residual)
    for k in range(state.residual.shape[0]):
        put_where(jumping > 0.5, state.now.u, (k,), lanes_at(state.now.u, (k,)) - lanes_at(state.residual, (k,)))


@called
def turn_bases(joints, base, y):
    """The rotation of a step goes into the attitudes of spherical joints."""
    for j in range(joints.shape[0]):
        if joints[j, KIND] == SPHERICAL:
            k = joints[j, COORDINATE]
            keep_matrix(base, j, 0, after(matrix(base, j, 0), rotation(three_at(y, k))))
            for i in range(3):
                put_lanes(y, (k + i,), all_lanes(0.0))


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
    of_new = (1.0 - scheme.alpha_f) / (1.0 - scheme.alpha_m)
    tangent(system, lane, state, scheme.beta * of_new * h * h, scheme.gamma * of_new * h, solver)
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
def go_on(system, lane, scheme, who, end, state, solver):
    """Some lanes, those that are sound, go to another time (s) without an event between."""
    memory = solver.memory
    goes, start = who & sound(memory), of(memory, TIME)
    end = choose(goes, end, start)
    middle = choose(goes, 0.5 * (start + end), start - 2.0 * near_of(lane))
    motions_at(lane.motions, end, middle, solver.work.piece, solver.work.motions)
    if system.given:
        regular = step_given(system, lane, scheme, end - start, state, solver)
        put_where(goes & (regular < 0.5), memory, (CODE,), all_lanes(1.0 * NOT_CONVERGED))
    else:
        step(system, lane, scheme, goes, end - start, state, solver)
    arrived = goes & sound(memory)
    take(arrived, state, scheme)
    put_where(arrived, memory, (TIME,), end)


@called
def near_of(lane):
    """How near to a station an event falls on it, s."""
    return NEAR * lanes_at(lane.step, (0,))


@called
def pass_events(system, lane, who, end, state, solver):
    """Given motions of some lanes go on as other pieces: velocities and accelerations jump with them. end: of the
    step, s."""
    work, time = solver.work, of(solver.memory, TIME)
    copy(work.motions, solver.before)
    turn_bases(system.joint_table, work.base, state.now.y)
    motions_at(lane.motions, time, choose(who, 0.5 * (time + end), time), work.piece, work.motions)
    strike(system, lane, who, state, solver)
    solve_accelerations(system, lane, who, state, solver)


@called
def next_events(events, who, memory):
    """Each lane's next event behind the last one, of events (E, LANES); infinite where there is none."""
    found = all_lanes(np.inf)
    for e in range(events.shape[0] - 1, -1, -1):
        event = lanes_at(events, (e,))
        found = choose(event > of(memory, EVENT), event, found)
    put_where(who, memory, (EVENT,), found)


@called
def go_through(system, lane, scheme, number, state, solver):
    """All lanes through a step, over the events that come before its end."""
    memory, h, near = solver.memory, lanes_at(lane.step, (0,)), near_of(lane)
    start, end = (number - 1.0) * h, float(number) * h
    if number % (KEPT * (lane.start.shape[1] + 1)) == 0:
        put_lanes(memory, (FRESH,), all_lanes(0.0))
    while not everywhere(of(memory, EVENT) >= end - near):
        event = of(memory, EVENT)
        who = event < end - near
        apart = who & (event > of(memory, TIME) + near)
        put_where(apart, memory, (FRESH,), all_lanes(0.0))  # of another step
        go_on(system, lane, scheme, apart, event, state, solver)
        pass_events(system, lane, who & sound(memory), end, state, solver)
        next_events(lane.events, who, memory)
    shorter = of(memory, TIME) > start + near
    go_on(system, lane, scheme, h > 0.0, end, state, solver)
    put_where(shorter, memory, (FRESH,), all_lanes(0.0))


@piece
def room_to_march(system, lane, record):
    """Room for a block of lanes."""
    N, M = lane.start.shape[1], lane.motions.shape[0]
    rows = np.zeros((11, N, LANES))
    now, tried = Coordinates(rows[0], rows[1], rows[2]), Coordinates(rows[3], rows[4], rows[5])
    state = State(now, tried, rows[6], rows[7], rows[8], rows[9], rows[10])
    two, both = np.zeros((2, N, N, LANES)), np.zeros((2, M, 3, LANES))
    memory, signals = np.zeros((MEMORY, LANES)), np.zeros((record.statistics.shape[1], LANES))
    solver = Solver(room(system, lane), np.zeros((N, LANES)), two[0], two[1], both[0], both[1], memory)
    return Room(state, solver, signals)


@called
def start(system, lane, state, solver):
    """A block of lanes at its start, with the accelerations there."""
    work, memory = solver.work, solver.memory
    for k in range(state.weight.shape[0]):
        put_lanes(state.now.y, (k,), lanes_at(lane.start, (0, k)))
        put_lanes(state.now.u, (k,), lanes_at(lane.start, (1, k)))
    turn_bases(system.joint_table, work.base, state.now.y)
    motions_at(lane.motions, all_lanes(0.0), all_lanes(0.0), work.piece, work.motions)
    for b in range(system.tree.shape[0]):  # those that rest are followed once
        follow_frame(system, lane, b, state.now, work)
    everyone = lanes_at(lane.step, (0,)) > 0.0
    put_lanes(memory, (EVENT,), near_of(lane))
    next_events(lane.events, everyone, memory)
    solve_accelerations(system, lane, everyone, state, solver)


@called
def march_block(system, lane, scheme, steps, block, room, record):
    """One block of lanes from the start to the end, its signals and codes into the record."""
    state, solver, signals = room
    work, memory, kept = solver.work, solver.memory, 0
    start(system, lane, state, solver)
    for number in range(steps + 1):
        if number:
            go_through(system, lane, scheme, number, state, solver)
        goes = sound(memory)
        if everywhere(of(memory, CODE) > SOUND + 0.5):
            break
        note_last(memory, number, block, record.last)
        watched = observe(system, lane, state.now, work, signals)
        count(goes, signals, watched, number, 0.5 if number in (0, steps) else 1.0, record.statistics, block)
        if kept < record.stations.size and record.stations[kept] == number:
            observe_whole(system, lane, state.now, work, signals, watched)
            for k in range(signals.shape[0]):
                put_lanes(record.history, (block, kept, k), choose(goes, lanes_at(signals, (k,)), np.nan))
            kept += 1
        turn_bases(system.joint_table, work.base, state.now.y)
        check(system, state.now.y, memory)
    for j in range(LANES):
        record.codes[block, j] = int(memory[CODE, j])


@called
def note_last(memory, number, block, last):
    """The station at which sound lanes have arrived."""
    for j in range(LANES):
        if memory[CODE, j] < SOUND + 0.5:
            last[block, j] = number


@called
def check(system, y, memory):
    """Whether a carriage of a lane has slid over an end of its track, or a body bends by many times its length."""
    for c in range(system.riders.shape[0]):
        k = system.riders[c, PLACE_COORDINATE]
        if k >= 0:
            s, length = lanes_at(y, (k,)), system.bodies[system.riders[c, RIDDEN], LENGTH]
            put_where(sound(memory) & ((s < 0.0) | (s > length)), memory, (CODE,), all_lanes(1.0 * OVER_THE_END))
    for b in range(system.tree.shape[0]):
        most = MOST_BENT * system.bodies[b, LENGTH] * np.sqrt(system.bodies[b, MASS])  # modal masses are 1
        for k in range(system.tree[b, FIRST], system.tree[b, FIRST] + system.tree[b, MODES]):
            bent = choose(size_of(lanes_at(y, (k,))) <= most, 0.0, 1.0)  # NaN too
            put_where(sound(memory) & (bent > 0.5), memory, (CODE,), all_lanes(1.0 * DIVERGED))


@called
def count(who, signals, watched, number, weight, statistics, block):
    """The first signals of a station go into the statistics of some lanes."""
    at = all_lanes(float(number))
    for j in range(watched):
        value = lanes_at(signals, (j,))
        larger = who & (value > lanes_at(statistics, (block, j, LARGEST)))
        put_where(larger, statistics, (block, j, LARGEST), value)
        put_where(larger, statistics, (block, j, LARGEST_AT), at)
        smaller = who & (value < lanes_at(statistics, (block, j, SMALLEST)))
        put_where(smaller, statistics, (block, j, SMALLEST), value)
        put_where(smaller, statistics, (block, j, SMALLEST_AT), at)
        squares = lanes_at(statistics, (block, j, SQUARES))
        put_where(who, statistics, (block, j, SQUARES), squares + weight * value * value)


@kernel
def march(system, lanes, scheme, steps, record):
    """All blocks of lanes in so many steps, into the record."""
    for block in range(lanes.step.shape[0]):
        lane = Lane(
            lanes.gravity[block],
            lanes.damping[block],
            lanes.joints[block],
            lanes.carriages[block],
            lanes.motions[block],
            lanes.events[block],
            lanes.start[block],
            lanes.loads[block],
            lanes.links[block],
            lanes.step[block],
        )
        march_block(system, lane, scheme, steps, block, room_to_march(system, lane, record), record)
