"""Steps without iteration where frames and ways are given in time, for their equations are linear in what is left.

With the spin w of a frame, U = 2 [w]x and Y = [w']x + [w]x [w]x, a place d that moves in it by x has the acceleration
base + x'' + U x' + Y x: gyroscopic, Euler and centrifugal terms. The modes of a body are left with, by virtual work,

    sum_j int phi_i . (phi_j q_j'' + U phi_j q_j' + Y phi_j q_j) dm + d_i q_i' + k_ij q_j = -int phi_i . base dm

and with what a carriage needs at its place, (10)-(21). In a step q_j = q_j* + of_y q_j'' and q' = q'* + of_u q'', of_y
of each coordinate, so that 1 + of_u U + of_y Y stands for 1 in the mass matrix. What a carriage stiffens a track by is
linear in them, and directions of torques follow them in first order.
"""

from engine.kernels.floating.bodies import pulled, turned_by, turned_nearer
from engine.kernels.floating.carriages import acceleration_at, carried, pull_along, ridden, touched
from engine.kernels.floating.following import follow_frame
from engine.kernels.floating.layout import (
    DAMPER,
    FIRST,
    FIRST_ORDER,
    GRIP,
    MODES,
    ONE,
    OTHER,
    OWN_MASS,
    PUSHED,
    RESTS,
    RIDDEN,
    SECOND_ORDER,
    SHORTENED,
    SHORTER,
    SPRING,
    SPRUNG_COORDINATE,
    SPRUNG_MASS,
    STIFFNESS,
    TRANSLATION,
    TWISTED,
    WEIGHT,
)
from engine.kernels.floating.loads import load_at
from engine.kernels.floating.state import advance, factor, of_coordinate, solve, ways_of
from engine.kernels.floating.tracks import CURVE, SHAPE, SLOPE, pulled_nearer, shapes_at, weighed
from engine.kernels.floating.vectors import (
    add,
    add_vector,
    cross,
    dot,
    keep_matrix,
    keep_vector,
    matrix,
    shared_vector,
    times,
    vector,
)
from engine.kernels.floating.work import (
    ACCELERATION,
    ANGULAR,
    CONTACT,
    RATES,
    SPIN,
    TOUCHED,
    VALUES,
    add_to,
)
from engine.kernels.jit import called
from engine.kernels.vector import all_lanes, lanes_at, put_lanes


@called
def step_given(system, lane, scheme, h, state, solver):
    """One step of all lanes; 1 in the lanes in which its equations are regular, else 0."""
    ways, N = ways_of(state, scheme, h), state.residual.shape[0]
    for k in range(N):
        put_lanes(state.tried.a, (k,), all_lanes(0.0))
        put_lanes(state.residual, (k,), all_lanes(0.0))
        for j in range(N):
            put_lanes(solver.fresh, (k, j), all_lanes(0.0))
    advance(state, scheme, h)
    for b in range(system.tree.shape[0]):
        if not system.tree[b, RESTS]:
            follow_frame(system, lane, b, state.tried, solver.work)
    for b in range(system.tree.shape[0]):
        if system.tree[b, MODES]:
            turning(b, solver.work)
            body(system, lane, b, ways, state, solver)
    for k in range(system.pairing.shape[0]):
        pair(system, k, ways, state, solver)
    for c in range(system.riders.shape[0]):
        carriage(system, lane, c, ways, state, solver)
    for q in range(system.load_table.shape[0]):
        load(system, lane, q, ways, state, solver)
    regular = factor(solver.fresh)
    solve(solver.fresh, state.residual)
    for k in range(N):
        put_lanes(state.tried.a, (k,), -1.0 * lanes_at(state.residual, (k,)))
    advance(state, scheme, h)
    for c in range(system.riders.shape[0]):
        contact(system, lane, c, state.tried, solver.work)
    return regular


@called
def turning(b, work):
    """U and Y of a body's frame into work.turning."""
    w, al = vector(work.frames, b, SPIN), vector(work.frames, b, ANGULAR)
    zero = all_lanes(0.0)
    by_rate = (
        (zero, -2.0 * w[2], 2.0 * w[1]),
        (2.0 * w[2], zero, -2.0 * w[0]),
        (-2.0 * w[1], 2.0 * w[0], zero),
    )
    keep_matrix(work.turning, b, RATES, by_rate)
    keep_matrix(work.turning, b, VALUES, turned_by(w, al))


@called
def body(system, lane, b, ways, state, solver):
    """What the modes of a body have to themselves: what its undeformed places need, and damping."""
    n, first, widest, work = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4], solver.work
    base = vector(work.frames, b, ACCELERATION)
    for i in range(n):
        row, k = b * widest + i, first + i
        damping = lanes_at(lane.damping, (row,))
        left = dot(shared_vector(system.modes, row, TRANSLATION), base) + damping * lanes_at(state.tried.u, (k,))
        for a in range(3):
            if system.leans[b, a]:
                for e in range(3):
                    by = system.modes[row, FIRST_ORDER + 3 * e + a]
                    left = left + by * lanes_at(work.turning, (b, VALUES + 3 * a + e))
        add_to(state.residual, k, left)
        add_to_matrix(solver.fresh, k, k, ways.of_u * damping)


@called
def pair(system, number, ways, state, solver):
    """What a mode does in the equation of another of the same body, or in its own."""
    b, i, j = system.pairing[number, 0], system.pairing[number, 1], system.pairing[number, 2]
    widest, first, work = system.track.shape[4], system.tree[b, FIRST], solver.work
    row, k, m = (b * widest + i) * widest + j, first + i, first + j
    mass, by_rate, by_value = 0.0, all_lanes(0.0), all_lanes(system.pairs[row, STIFFNESS])
    if system.tree[b, SHORTENED]:
        turning, base = matrix(work.turning, b, VALUES), vector(work.frames, b, ACCELERATION)
        by_value = by_value - turned_nearer(system, b, row, turning) - pulled(system, b, row, base)
    for a in range(3):
        mass += system.pairs[row, SECOND_ORDER + 4 * a]
        for e in range(3):
            if system.leans[b, a] and system.leans[b, e]:
                both = system.pairs[row, SECOND_ORDER + 3 * a + e]
                by_rate = by_rate + both * lanes_at(work.turning, (b, RATES + 3 * a + e))
                by_value = by_value + both * lanes_at(work.turning, (b, VALUES + 3 * a + e))
    add_to(state.residual, k, by_rate * lanes_at(state.tried.u, (m,)) + by_value * lanes_at(state.tried.y, (m,)))
    add_to_matrix(solver.fresh, k, m, mass + ways.of_u * by_rate + of_coordinate(ways, m) * by_value)


@called
def carriage(system, lane, c, ways, state, solver):
    """A carriage, with what it carries on its spring, on the modes of its body; its accelerations as far as they are
    known before the step is solved, and what each coordinate adds to them, stay for `contact`."""
    work, x, b, z = solver.work, state.tried, system.riders[c, RIDDEN], system.riders[c, SPRUNG_COORDINATE]
    n, along, row = system.tree[b, MODES], ridden(system, c, x, work), c * (system.track.shape[4] + 1)
    shapes_at(system, b, along[0], 3, work)
    d, rate, change, _ = touched(system, b, along, x, work.modes)
    acceleration, mass = acceleration_at(system, work, b, d, rate, change), carried(lane, c, OWN_MASS)
    keep_vector(work.contacts, c, TOUCHED, acceleration)
    f = times(mass, acceleration)
    for j in range(n):
        keep_vector(work.implied, row + j, 0, implied(system, b, j, along, ways, work))
    if z >= 0:
        mass = mass + carried(lane, c, SPRUNG_MASS)
        f = add(f, sprung(system, lane, c, ways, state, solver))
    for i in range(n):
        k = system.tree[b, FIRST] + i
        add_to(state.residual, k, leaning(system, b, vector(work.modes, i, SHAPE), f))
        for j in range(n):
            by = leaning(system, b, vector(work.modes, i, SHAPE), vector(work.implied, row + j, 0))
            add_to_matrix(solver.fresh, k, system.tree[b, FIRST] + j, mass * by)
    if system.tree[b, SHORTENED]:
        stiffen(system, b, pull_along(system, lane, c, along, work), ways, state, solver)


@called
def leaning(system, b, shape, f):
    """Displacement of a mode times a force, in the directions in which the body bends."""
    found = all_lanes(0.0)
    if system.leans[b, 0]:
        found = found + shape[0] * f[0]
    if system.leans[b, 1]:
        found = found + shape[1] * f[1]
    if system.leans[b, 2]:
        found = found + shape[2] * f[2]
    return found


@called
def sprung(system, lane, c, ways, state, solver):
    """What a carriage carries on its spring: the force that it needs, as far as it is known, and its own equation."""
    work, b, z = solver.work, system.riders[c, RIDDEN], system.riders[c, SPRUNG_COORDINATE]
    own, row = carried(lane, c, SPRUNG_MASS), c * (system.track.shape[4] + 1)
    y, u = lanes_at(state.tried.y, (z,)), lanes_at(state.tried.u, (z,))
    by_rate, by_value = column(work.turning, b, RATES + 2), column(work.turning, b, VALUES + 2)
    acceleration = add(vector(work.contacts, c, TOUCHED), add(times(u, by_rate), times(y, by_value)))
    keep_vector(work.contacts, c, CONTACT, acceleration)
    of_y, up = of_coordinate(ways, z), (all_lanes(0.0), all_lanes(0.0), all_lanes(1.0))
    f, rising = times(own, acceleration), add(up, add(times(ways.of_u, by_rate), times(of_y, by_value)))
    keep_vector(work.implied, row + system.track.shape[4], 0, rising)
    spring, damper = carried(lane, c, SPRING), carried(lane, c, DAMPER)
    add_to(state.residual, z, f[2] + spring * y + damper * u)
    add_to_matrix(solver.fresh, z, z, own * rising[2] + of_y * spring + ways.of_u * damper)
    for i in range(system.tree[b, MODES]):
        k = system.tree[b, FIRST] + i
        add_to_matrix(solver.fresh, k, z, own * dot(vector(work.modes, i, SHAPE), rising))
        add_to_matrix(solver.fresh, z, k, own * lanes_at(work.implied, (row + i, 2)))
    return f


@called
def add_to_matrix(M, k, j, row):
    """A row of lanes added to an entry of matrices."""
    put_lanes(M, (k, j), lanes_at(M, (k, j)) + row)


@called
def column(table, i, k):
    """A column of nine numbers that are a matrix."""
    return lanes_at(table, (i, k)), lanes_at(table, (i, k + 3)), lanes_at(table, (i, k + 6))


@called
def implied(system, b, j, along, ways, work):
    """What the acceleration of mode j adds to that of the contact, at the step's end: itself, by its rate and by its
    value, where slopes slide by."""
    _, ds, dds = along
    shape, slope = vector(work.modes, j, SHAPE), vector(work.modes, j, SLOPE)
    by_rate = times(2.0 * ds, slope)
    by_value = add(times(ds * ds, vector(work.modes, j, CURVE)), times(dds, slope))
    for e in range(3):
        if system.leans[b, e]:
            by_rate = add(by_rate, times(shape[e], column(work.turning, b, RATES + e)))
            by_value = add(by_value, times(shape[e], column(work.turning, b, VALUES + e)))
            by_value = add(by_value, times(ds * slope[e], column(work.turning, b, RATES + e)))
    of_y = of_coordinate(ways, system.tree[b, FIRST] + j)
    return add(shape, add(times(ways.of_u, by_rate), times(of_y, by_value)))


@called
def stiffen(system, b, pull, ways, state, solver):
    """A force at the place that was looked up last, which comes nearer as the body bends."""
    first = system.tree[b, FIRST]
    for k in range(system.shortening.shape[0]):
        if system.shortening[k, SHORTER] == b:
            i, j = first + system.shortening[k, ONE], first + system.shortening[k, OTHER]
            by = -1.0 * pulled_nearer(system, k, pull, solver.work)
            add_to(state.residual, i, by * lanes_at(state.tried.y, (j,)))
            add_to_matrix(solver.fresh, i, j, of_coordinate(ways, j) * by)
            if i != j:
                add_to(state.residual, j, by * lanes_at(state.tried.y, (i,)))
                add_to_matrix(solver.fresh, j, i, of_coordinate(ways, i) * by)


@called
def load(system, lane, q, ways, state, solver):
    """A force and a torque at a grip."""
    work, p, widest = solver.work, system.load_table[q, GRIP], system.track.shape[4]
    f, about = load_at(system, lane, q, work)
    b, weight = system.gripped[p], system.grips[p, WEIGHT]
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    for i in range(n):
        row = p * widest + i
        turned = shared_vector(system.grip_modes, row, TWISTED)
        left = -1.0 * (dot(shared_vector(system.grip_modes, row, PUSHED), f) + weight * dot(turned, about))
        for j in range(n):
            other = shared_vector(system.grip_modes, p * widest + j, TWISTED)
            by = (-0.5 * weight) * dot(cross(other, turned), about)
            if system.tree[b, SHORTENED]:
                by = by + weighed(system.grip_shorter, p, system.tree[b, SHORTENED], (i, j), f)
            left = left + by * lanes_at(state.tried.y, (first + j,))
            add_to_matrix(solver.fresh, first + i, first + j, of_coordinate(ways, first + j) * by)
        add_to(state.residual, first + i, left)


@called
def contact(system, lane, c, x, work):
    """Acceleration at a contact and its force, now that the step is solved."""
    b, z = system.riders[c, RIDDEN], system.riders[c, SPRUNG_COORDINATE]
    row = c * (system.track.shape[4] + 1)
    for j in range(system.tree[b, MODES]):
        by = times(lanes_at(x.a, (system.tree[b, FIRST] + j,)), vector(work.implied, row + j, 0))
        add_vector(work.contacts, c, TOUCHED, by)
        add_vector(work.contacts, c, CONTACT, by)
    f = times(carried(lane, c, OWN_MASS), vector(work.contacts, c, TOUCHED))
    if z >= 0:
        rising = times(lanes_at(x.a, (z,)), vector(work.implied, row + system.track.shape[4], 0))
        f = add(f, times(carried(lane, c, SPRUNG_MASS), add(vector(work.contacts, c, CONTACT), rising)))
    keep_vector(work.contacts, c, CONTACT, f)
