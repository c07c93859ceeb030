"""Implicit steps of bodies whose frames move: Newmark's formulas or generalized-alpha (Arnold and Bruels 2007; on the
rotation group Bruels and Cardona 2010), over the events of given motions, and what is kept of them."""

from typing import NamedTuple

import numpy as np

from engine.kernels.floating.equations import residual
from engine.kernels.floating.following import follow_frame, follow_rigid
from engine.kernels.floating.given import step_given
from engine.kernels.floating.layout import (
    COORDINATE,
    DIVERGED,
    FIRST,
    KIND,
    LENGTH,
    MASS,
    MODES,
    NOT_CONVERGED,
    OVER_THE_END,
    PLACE_COORDINATE,
    PLACE_MOTION,
    RIDDEN,
    SOUND,
    SPHERICAL,
    Coordinates,
    Lane,
)
from engine.kernels.floating.motions import copy, motions_at
from engine.kernels.floating.newton import bound_masses, factor_masses, raise_beta, settle, solve_accelerations, step
from engine.kernels.floating.observe import (
    apart,
    count,
    count_between,
    observe,
    observe_whole,
    of_way,
)
from engine.kernels.floating.state import (
    CODE,
    EVENT,
    FRESH,
    MEMORY,
    SCALE,
    TIME,
    Solver,
    State,
    of,
    put_where,
    size_of,
    solve,
    sound,
    take,
)
from engine.kernels.floating.vectors import add, after, keep_matrix, matrix, rotation, times
from engine.kernels.floating.work import room, three_at
from engine.kernels.jit import called, copied, kernel
from engine.kernels.layout import LANES, FloatArray
from engine.kernels.vector import all_lanes, choose, everywhere, lanes_at, put_lanes

#: Steps, for each residual that a tangent takes, after which those of all lanes are made anew: an eighth of a residual
#: for each step, which saves one correction in four of a mass that slides.
KEPT = 8
MOST_BENT = 10.0  # lengths of a body: beyond, a march has diverged, whatever is wrong
LOOKED = 9  # times of the march at which masses are looked at for what a step needs
UNBOUNDED = 1e300  # kg, or alike
NEAR = 1e-9  # of a step: an event so near to a station falls on it
JUMP = 1e-12  # of a rate: below it is rounding
LEFT, LEFT_BEFORE = 4, 3  # numbers of a tip; that of the last station, after the vector
OFF = 1e-9  # of a length: less over an end of a track is rounding of a given motion


class Room(NamedTuple):
    """What the march of a block of lanes works in; signals (signals, LANES) where they were observed last, at_event
    (signals, LANES) on one side of an event, past (2, K, LANES): those that are smooth, at the two stations before,
    tips_before (2 T, 3, LANES): how far tips were from where the rigid arm has them there, and left (T, LEFT, LANES):
    where tips come to rest, and how far from there they were after a stop at the last station."""

    state: State
    solver: Solver
    signals: FloatArray
    at_event: FloatArray
    past: FloatArray
    tips_before: FloatArray
    left: FloatArray


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
    if system.given and system.drives.size:
        residual(system, lane, state.now, solver.work, solver.other)
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
def observe_events(system, lane, who, begun, end, room, statistics):
    """Some lanes over an event that they have come to, with what is observed on both sides of it in the statistics
    (signals, STATISTICS, LANES). Squares are integrated by trapezoids: from begun (s) to it, and on to the step's end.
    """
    state, solver, signals, at_event = room.state, room.solver, room.signals, room.at_event
    time, h, near = of(solver.memory, TIME), lanes_at(lane.step, (0,)), near_of(lane)
    at, before, behind = time / h, 0.5 * (time - begun) / h, 0.5 * (end - time) / h
    watched = observe(system, lane, state.now, solver.work, time + near, at_event)
    count(who, signals, watched, at, -1.0 * behind, statistics)  # which stood for all up to the end
    count(who & (time > begun + near), at_event, watched, at, before, statistics)
    pass_events(system, lane, who, end, state, solver)
    observe(system, lane, state.now, solver.work, time + near, at_event)
    count(who, at_event, watched, at, behind, statistics)
    for j in range(watched):
        put_where(who, signals, (j,), lanes_at(at_event, (j,)))


@called
def go_through(system, lane, scheme, number, room, statistics):
    """All lanes through a step, over the events that come before its end; the part of it that is behind these."""
    state, solver, h, near = room.state, room.solver, lanes_at(lane.step, (0,)), near_of(lane)
    memory, start, end = solver.memory, (number - 1.0) * h, float(number) * h
    if number % (KEPT * (lane.start.shape[1] + 1)) == 0:
        put_lanes(memory, (FRESH,), all_lanes(0.0))
    while not everywhere(of(memory, EVENT) >= end - near):
        event = of(memory, EVENT)
        who = event < end - near
        apart = who & (event > of(memory, TIME) + near)
        put_where(apart, memory, (FRESH,), all_lanes(0.0))  # of another step
        begun = of(memory, TIME)
        go_on(system, lane, scheme, apart, event, state, solver)
        observe_events(system, lane, who & sound(memory), begun, end, room, statistics)
        next_events(lane.events, who, memory)
    begun = of(memory, TIME)
    shorter = begun > start + near
    go_on(system, lane, scheme, h > 0.0, end, state, solver)
    put_where(shorter, memory, (FRESH,), all_lanes(0.0))
    return choose(shorter, (end - begun) / h, 1.0)


@copied
def room_to_march(system, lane, record):
    """Room for a block of lanes."""
    N, M = lane.start.shape[1], lane.motions.shape[0]
    rows = np.zeros((12, N, LANES))
    now, tried = Coordinates(rows[0], rows[1], rows[2]), Coordinates(rows[3], rows[4], rows[5])
    state = State(now, tried, rows[6], rows[7], rows[8], rows[9], rows[10], rows[11])
    two, both = np.zeros((2, N, N, LANES)), np.zeros((2, M, 3, LANES))
    memory, signals = np.zeros((MEMORY, LANES)), np.zeros((2, record.statistics.shape[1], LANES))
    solver = Solver(room(system, lane), np.zeros((N, LANES)), two[0], two[1], both[0], both[1], memory)
    past, tips = np.zeros((2, system.smooth.shape[0], LANES)), system.tips.shape[0]
    return Room(
        state, solver, signals[0], signals[1], past, np.zeros((2 * tips, 3, LANES)), np.zeros((tips, LEFT, LANES))
    )


@called
def note_rest(system, state, solver, left):
    """Where tips are, from where the rigid arm would have them, in the equilibrium of the state; NaN of lanes that
    found none."""
    for k in range(system.carrying.size):
        follow_rigid(system, system.carrying[k], solver.work)
    for t in range(left.shape[0]):
        a = apart(system, t, state.now, solver.work)
        for i in range(3):
            put_lanes(left, (t, i), choose(sound(solver.memory), a[i], np.nan))
        put_lanes(left, (t, LEFT_BEFORE), all_lanes(0.0))
    put_lanes(solver.memory, (CODE,), all_lanes(0.0))


@called
def start(system, lane, scheme, end, state, solver, left):
    """A block of lanes at its start, with the accelerations there; before it where tips rest at the end, s."""
    work, memory = solver.work, solver.memory
    for k in range(state.weight.shape[0]):
        put_lanes(state.now.y, (k,), lanes_at(lane.start, (0, k)))
        put_lanes(state.now.u, (k,), lanes_at(lane.start, (1, k)))
    turn_bases(system.joint_table, work.base, state.now.y)
    for k in range(state.weight.shape[0]):
        put_lanes(state.earlier, (k,), lanes_at(state.now.y, (k,)))
    everyone = lanes_at(lane.step, (0,)) > 0.0
    for time, needed in ((end, system.bands.shape[1] > 0), (0.0 * end, system.settles)):
        motions_at(lane.motions, time, time, work.piece, work.motions)
        for b in range(system.tree.shape[0]):  # those that rest are followed once
            follow_frame(system, lane, b, state.now, work)
        if needed:
            copy(work.motions, solver.before)
            settle(system, lane, everyone, state, solver)
            copy(solver.before, work.motions)
        if system.bands.shape[1] and not everywhere(time <= 0.0):
            note_rest(system, state, solver, left)
            for k in range(state.weight.shape[0]):
                put_lanes(state.now.y, (k,), lanes_at(state.earlier, (k,)))
    for k in range(state.weight.shape[0]):
        put_lanes(state.earlier, (k,), all_lanes(0.0))
    put_lanes(memory, (EVENT,), near_of(lane))
    next_events(lane.events, everyone, memory)
    for k in range(state.beta.shape[0]):
        put_lanes(state.beta, (k,), all_lanes(UNBOUNDED if scheme.raised else scheme.beta))
    for back in range(LOOKED if scheme.raised else 0, -1, -1):
        put_lanes(memory, (SCALE,), all_lanes(0.0))
        time = end * (max(back - 1, 0) / (LOOKED - 1))
        motions_at(lane.motions, time, time, work.piece, work.motions)
        solve_accelerations(system, with_light_carriages(lane) if back else lane, everyone, state, solver)
        if back:
            bound_masses(system, lane, state, solver)
    if scheme.raised:
        raise_beta(system, lane, scheme, state, solver.other)


@called
def with_light_carriages(lane):
    """The lane as if next to nothing rode along: wherever carriages are, they only add to that mass matrix."""
    return Lane(
        lane.gravity,
        lane.damping,
        lane.joints,
        lane.light,
        lane.light,
        lane.motions,
        lane.events,
        lane.start,
        lane.loads,
        lane.links,
        lane.stops,
        lane.step,
    )


@called
def march_block(system, lane, scheme, steps, block, room, record):
    """One block of lanes from the start to the end, its signals and codes into the record."""
    state, solver, signals, left = room.state, room.solver, room.signals, room.left
    work, memory, statistics, kept, behind = solver.work, solver.memory, record.statistics[block], 0, all_lanes(0.0)
    start(system, lane, scheme, steps * lanes_at(lane.step, (0,)), state, solver, left)
    for number in range(steps + 1):
        if number:
            behind = go_through(system, lane, scheme, number, room, statistics)
        goes = sound(memory)
        if record.stop[0] != 0 or everywhere(of(memory, CODE) > SOUND + 0.5):
            break
        note_last(memory, number, block, record.last)
        watched = observe(system, lane, state.now, work, of(memory, TIME) + near_of(lane), signals)
        weight = 0.5 * behind + (0.5 if number < steps else 0.0)
        count(goes, signals, watched, all_lanes(float(number)), weight, statistics)
        count_between(system, goes, room, number, statistics)
        if system.bands.shape[1]:
            count_settling(system, lane, state.now, solver, left, number, record.settled[block])
        if kept < record.stations.size and record.stations[kept] == number:
            observe_whole(system, lane, state.now, work, signals, watched)
            for k in range(signals.shape[0]):
                put_lanes(record.history, (block, kept, k), choose(goes, lanes_at(signals, (k,)), np.nan))
            kept += 1
        turn_bases(system.joint_table, work.base, state.now.y)
        check(system, state.now.y, work.motions, memory)
    for j in range(LANES):
        record.codes[block, j] = int(memory[CODE, j])


@called
def note_last(memory, number, block, last):
    """The station at which sound lanes have arrived."""
    for j in range(LANES):
        if memory[CODE, j] < SOUND + 0.5:
            last[block, j] = number


@called
def check(system, y, motions, memory):
    """Whether a carriage of a lane is over an end of its track, or a body bends by many times its length."""
    for c in range(system.riders.shape[0]):
        k, length = system.riders[c, PLACE_COORDINATE], system.bodies[system.riders[c, RIDDEN], LENGTH]
        if k >= 0:
            s, near = lanes_at(y, (k,)), 0.0
        else:  # what is given may come to an end by rounding
            s, near = lanes_at(motions, (system.riders[c, PLACE_MOTION], 0)), OFF * length
        off = (s < -near) | (s > length + near)
        put_where(sound(memory) & off, memory, (CODE,), all_lanes(1.0 * OVER_THE_END))
    for b in range(system.tree.shape[0]):
        most = MOST_BENT * system.bodies[b, LENGTH] * np.sqrt(system.bodies[b, MASS])  # modal masses are 1
        for k in range(system.tree[b, FIRST], system.tree[b, FIRST] + system.tree[b, MODES]):
            bent = choose(size_of(lanes_at(y, (k,))) <= most, 0.0, 1.0)  # NaN too
            put_where(sound(memory) & (bent > 0.5), memory, (CODE,), all_lanes(1.0 * DIVERGED))


@called
def count_settling(system, lane, x, solver, left, number, settled):
    """When tips come within bands of where they rest for good, after stops, along a line between stations; NaN where
    they do not rest."""
    memory = solver.memory
    by = of(memory, TIME) + near_of(lane)
    for t in range(left.shape[0]):
        who, a = sound(memory) & (by >= lanes_at(lane.stops, (t,))), apart(system, t, x, solver.work)
        off = size_of(of_way(system, t, add(a, times(-1.0, three_at(left[t], 0)))))
        before, now = lanes_at(left, (t, LEFT_BEFORE)), choose(who, off, 0.0)
        put_lanes(left, (t, LEFT_BEFORE), now)
        for k in range(system.bands.shape[1]):
            band = system.bands[t, k]
            comes = who & (now <= band) & (before > band)
            part = (before - band) / choose(comes, before - now, 1.0)
            at = choose(comes, number - 1.0 + part, float(number))
            beyond = who & (choose(now <= band, 0.0, 1.0) > 0.5)  # NaN too
            put_where(comes | beyond, settled, (t, k), choose(now >= 0.0, at, np.nan))


@kernel
def march(system, lanes, scheme, steps, record):
    """All blocks of lanes in so many steps, into the record."""
    for block in range(lanes.step.shape[0]):
        lane = Lane(
            lanes.gravity[block],
            lanes.damping[block],
            lanes.joints[block],
            lanes.carriages[block],
            lanes.light[block],
            lanes.motions[block],
            lanes.events[block],
            lanes.start[block],
            lanes.loads[block],
            lanes.links[block],
            lanes.stops[block],
            lanes.step[block],
        )
        march_block(system, lane, scheme, steps, block, room_to_march(system, lane, record), record)
