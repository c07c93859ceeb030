"""What is observed of a block of lanes at a station: readings of sensors, carriages, points, frames, energy and
momentum."""

import numpy as np

from engine.kernels.floating.bodies import second_moments
from engine.kernels.floating.carriages import carried, has_attitude, inertia_times, missed_section, ridden
from engine.kernels.floating.following import follow_rigid
from engine.kernels.floating.layout import (
    COORDINATE,
    FIRST,
    HEIGHT,
    LARGEST,
    LARGEST_AT,
    MASS,
    MISSED_READING,
    MODES,
    MOMENT,
    MOTION,
    ORIGIN,
    OWN_MASS,
    RIDDEN,
    SECOND_ORDER,
    SHORTENED,
    SIGNAL,
    SMALLEST,
    SMALLEST_AT,
    SPRING,
    SPRUNG_COORDINATE,
    SPRUNG_MASS,
    SQUARES,
    STIFFNESS,
    TIP,
    TIP_BODY,
    TIP_PLACE,
    TIP_SENSOR,
    TIP_SHAPES,
    TIP_WAY,
    TRANSLATION,
)
from engine.kernels.floating.loads import between, missed_by_loads
from engine.kernels.floating.state import put_where
from engine.kernels.floating.tracks import (
    SHAPE,
    SLOPE,
    TURN,
    TURN_SLOPE,
    combined,
    combined_there,
    nearer,
    shapes_at,
    span_of,
)
from engine.kernels.floating.vectors import (
    add,
    axial,
    cross,
    dot,
    keep_vector,
    matrix,
    no_vector,
    rotation,
    shared_matrix,
    shared_vector,
    spin_of,
    times,
    turned_in,
    turned_out,
    vector,
)
from engine.kernels.floating.work import (
    ATTITUDE,
    CONTACT,
    JOINT_DRIVE,
    POSITION,
    SPIN,
    TOUCHED,
    VELOCITY,
    add_to,
    three_at,
)
from engine.kernels.jit import called
from engine.kernels.vector import all_lanes, choose, lanes_at, put_lanes, root

#: Signals of a carriage: place, speed and acceleration along its track; its acceleration resolved in the frame of its
#: body (3); the contact force, positive where it presses along z; place of its sprung mass. Of a point: place (3). Of a
#: body: place (3), velocity over the ground (3), spin in its frame (3), attitude as the rows of a matrix (9). Of the
#: whole: kinetic and potential energy, momentum (3) and angular momentum (3) about the ground's origin.
OF_CARRIAGE, OF_POINT, OF_BODY, OF_WHOLE = 8, 3, 18, 8
BODY_VELOCITY, BODY_SPIN, BODY_ATTITUDE = 3, 6, 9  # of a body's
CONTACT_FORCE = 6  # of a carriage's
CLOSER = 3  # corrections of where a vector is least: a fourth changes nothing beyond rounding


@called
def observe(system, lane, x, work, by, out):
    """Signals of lanes whose frames are followed and whose contact forces are known: of sensors, carriages, points, and
    after stops; by: the times (s) by which motions have ended. Returns how many."""
    first = system.read_under.shape[0]
    for r in range(first):
        read(system, r, x, work, out)
    for k in range(system.missed_sections.shape[0]):
        missed = missed_section(system, k, x, work) + missed_by_loads(system, lane, k, x, work)
        add_to(out, system.missed_sections[k, MISSED_READING], missed)
    for c in range(system.riders.shape[0]):
        carriage(system, lane, c, x, work, out, first)
        first += OF_CARRIAGE
    for p in range(system.pointed.size):
        b = system.pointed[p]
        d = add(no_vector(), shared_vector(system.points, p, 0))
        for i in range(system.tree[b, MODES]):
            moved = lanes_at(x.y, (system.tree[b, FIRST] + i,))
            d = add(d, times(moved, shared_vector(system.points, p, 3 + 3 * i)))
        if system.tree[b, SHORTENED]:
            d = add(d, times(-0.5, nearer(system.point_shorter, p, span_of(system, b), x.y, x.y)))
        keep(out, first, over_ground(work.frames, b, d))
        first += OF_POINT
    for d in range(system.drives.shape[0]):
        put_lanes(out, (system.drives[d, 0],), lanes_at(work.joints, (system.drives[d, 1], JOINT_DRIVE)))
    for k in range(system.carrying.size):
        follow_rigid(system, system.carrying[k], work)
    for t in range(system.tips.shape[0]):
        error = position_error(system, t, x, work)
        put_lanes(out, (system.tips[t, TIP_SENSOR],), error)
        put_lanes(out, (first,), choose(by >= lanes_at(lane.stops, (t,)), error, np.nan))
        first += 1
    return first


@called
def observe_whole(system, lane, x, work, out, first):
    """The signals from ``first`` on: of bodies and of the whole."""
    for b in range(system.tree.shape[0]):
        E = matrix(work.frames, b, ATTITUDE)
        keep(out, first, vector(work.frames, b, POSITION))
        keep(out, first + BODY_VELOCITY, turned_out(E, vector(work.frames, b, VELOCITY)))
        keep(out, first + BODY_SPIN, vector(work.frames, b, SPIN))
        for k in range(9):
            put_lanes(out, (first + BODY_ATTITUDE + k,), lanes_at(work.frames, (b, ATTITUDE + k)))
        first += OF_BODY
    whole(system, lane, x, work, out, first)


@called
def keep(out, k, a):
    """A vector becomes three signals."""
    put_lanes(out, (k,), a[0])
    put_lanes(out, (k + 1,), a[1])
    put_lanes(out, (k + 2,), a[2])


@called
def over_ground(frames, b, d):
    """Where a place of a frame is."""
    return add(vector(frames, b, POSITION), turned_out(matrix(frames, b, ATTITUDE), d))


@called
def position_error(system, t, x, work):
    """How far a place is from where the rigid arm would have it, the length of that, or along a direction; the vector
    into work.tips."""
    a = apart(system, t, x, work)
    keep_vector(work.tips, t, 0, a)
    return of_way(system, t, a)


@called
def of_way(system, t, a):
    """A vector at a tip as it is read: its length, or along a direction."""
    way = shared_vector(system.tip_places, t, TIP_WAY)
    if dot(way, way) > 0.0:
        return dot(a, way)
    return root(dot(a, a))


@called
def apart(system, t, x, work):
    """From where the rigid arm would have a place to where it is."""
    b = system.tips[t, TIP_BODY]
    d = add(no_vector(), shared_vector(system.tip_places, t, TIP_PLACE))
    told = over_ground(work.rigid, b, d)
    for i in range(system.tree[b, MODES]):
        moved = lanes_at(x.y, (system.tree[b, FIRST] + i,))
        d = add(d, times(moved, shared_vector(system.tip_places, t, TIP_SHAPES + 3 * i)))
    if system.tree[b, SHORTENED]:
        d = add(d, times(-0.5, nearer(system.tip_shorter, t, span_of(system, b), x.y, x.y)))
    return add(over_ground(work.frames, b, d), times(-1.0, told))


@called
def read(system, r, x, work, out):
    """A reading: linear in the coordinates at a place; under a carriage the displacement there."""
    c = system.read_under[r, 0]
    if c < 0:
        rate, found = system.read_under[r, 2], all_lanes(0.0)
        of = x.y if rate == 0 else x.u if rate == 1 else x.a
        for k in range(of.shape[0]):
            found = found + system.readings[r, k] * lanes_at(of, (k,))
        put_lanes(out, (r,), found)
    else:
        b = system.riders[c, RIDDEN]
        s, _, _ = ridden(system, c, x, work)
        shapes_at(system, b, s, 3, work)
        moved = combined_there(work.modes, SHAPE, system.tree[b, MODES], x.y, system.tree[b, FIRST])
        put_lanes(out, (r,), moved[system.read_under[r, 1]])


@called
def carriage(system, lane, c, x, work, out, first):
    """Signals of a carriage."""
    b, z = system.riders[c, RIDDEN], system.riders[c, SPRUNG_COORDINATE]
    weight = turned_in(matrix(work.frames, b, ATTITUDE), three_at(lane.gravity, 0))
    keep(out, first, ridden(system, c, x, work))
    keep(out, first + 3, add(vector(work.contacts, c, TOUCHED), weight))
    put_lanes(out, (first + CONTACT_FORCE,), -1.0 * lanes_at(work.contacts, (c, CONTACT + 2)))
    put_lanes(out, (first + 7,), lanes_at(x.y, (z,)) if z >= 0 else all_lanes(0.0))


@called
def whole(system, lane, x, work, out, first):
    """Energies and momenta of everything that moves, as signals from ``first`` on; forces that are given do work that
    is not in them."""
    for k in range(OF_WHOLE):
        put_lanes(out, (first + k,), all_lanes(0.0))
    for b in range(system.tree.shape[0]):
        of_body(system, lane, b, x, work, out, first)
    for c in range(system.riders.shape[0]):
        of_carriage(system, lane, c, x, work, out, first)
    for j in range(system.axes.shape[0]):
        k, m = system.joint_table[j, COORDINATE], system.joint_table[j, MOTION]
        if k >= 0:
            value = lanes_at(x.y, (k,))
            if m >= 0:
                value = value - lanes_at(work.motions, (m, 0))
            add_to(out, first + 1, 0.5 * lanes_at(lane.joints, (j, 0)) * value * value)
    for k in range(system.links.shape[0]):
        d, _, _ = between(system, k, x, work)
        longer = root(dot(d, d)) - lanes_at(lane.links, (k, 2))
        add_to(out, first + 1, 0.5 * lanes_at(lane.links, (k, 0)) * longer * longer)


@called
def of_body(system, lane, b, x, work, out, first):
    """Adds energies, J, momentum and angular momentum of a body."""
    n, q, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    v, w = vector(work.frames, b, VELOCITY), vector(work.frames, b, SPIN)
    S = add(combined(system.modes, b * widest, TRANSLATION, n, x.y, q), shared_vector(system.bodies, b, MOMENT))
    drift = combined(system.modes, b * widest, TRANSLATION, n, x.u, q)
    P = second_moments(system, b, x, work)
    Jw = add(times(P[0][0] + P[1][1] + P[2][2], w), times(-1.0, turned_out(P, w)))
    inner, deformation, own = no_vector(), all_lanes(0.0), all_lanes(0.0)
    for i in range(n):
        y, u = lanes_at(x.y, (q + i,)), lanes_at(x.u, (q + i,))
        inner = add(inner, times(u, axial(matrix(work.moments, i, 0))))
        for j in range(n):
            pair = (b * widest + i) * widest + j
            B = shared_matrix(system.pairs, pair, SECOND_ORDER)
            own = own + (0.5 * (B[0][0] + B[1][1] + B[2][2])) * u * lanes_at(x.u, (q + j,))
            deformation = deformation + (0.5 * system.pairs[pair, STIFFNESS]) * y * lanes_at(x.y, (q + j,))
    m = system.bodies[b, MASS]
    kinetic = own + 0.5 * m * dot(v, v) + dot(v, add(cross(w, S), drift)) + 0.5 * dot(w, Jw) + dot(w, inner)
    momentum = add(times(m, v), add(cross(w, S), drift))
    place = matrix(work.frames, b, ATTITUDE)
    r, p = vector(work.frames, b, POSITION), turned_out(place, momentum)
    turning = turned_out(place, add(cross(S, v), add(Jw, inner)))
    height = falling(lane, add(times(m, r), turned_out(place, S)))
    include(out, first, (kinetic, deformation - height), p, add(cross(r, p), turning))


@called
def falling(lane, moment):
    """Gravity times a mass's moment (kg m) over the ground: the energy that it has lost by falling, J."""
    return dot(three_at(lane.gravity, 0), moment)


@called
def include(out, first, energies, momentum, angular):
    """Adds a part's energies, momentum and angular momentum to the whole's."""
    add_to(out, first, energies[0])
    add_to(out, first + 1, energies[1])
    for i in range(3):
        add_to(out, first + 2 + i, momentum[i])
        add_to(out, first + 5 + i, angular[i])


@called
def of_carriage(system, lane, c, x, work, out, first):
    """Adds energies and momenta of a carriage and of what it carries on its spring."""
    b, z, at = system.riders[c, RIDDEN], system.riders[c, SPRUNG_COORDINATE], work.modes
    n, q = system.tree[b, MODES], system.tree[b, FIRST]
    s, ds, _ = ridden(system, c, x, work)
    turns = has_attitude(lane, c)
    shapes_at(system, b, s, 6 if turns else 3, work)
    along, origin = combined_there(at, SLOPE, n, x.y, q), shared_vector(system.bodies, b, ORIGIN)
    d = add((s + origin[0], origin[1], origin[2]), combined_there(at, SHAPE, n, x.y, q))
    rate = add(combined_there(at, SHAPE, n, x.u, q), times(ds, (1.0 + along[0], along[1], along[2])))
    arm, swing = no_vector(), no_vector()
    if turns:
        t = combined_there(at, TURN, n, x.y, q)
        dt = add(combined_there(at, TURN, n, x.u, q), times(ds, combined_there(at, TURN_SLOPE, n, x.y, q)))
        E, own = rotation(t), spin_of(t, dt)
        w, arm = add(vector(work.frames, b, SPIN), own), times(carried(lane, c, HEIGHT), (E[0][2], E[1][2], E[2][2]))
        swing, momentum = cross(own, arm), inertia_times(E, lane, c, w)
        turning = turned_out(matrix(work.frames, b, ATTITUDE), momentum)
        include(out, first, (0.5 * dot(w, momentum), all_lanes(0.0)), no_vector(), turning)
    of_mass(lane, b, carried(lane, c, OWN_MASS), (add(d, arm), add(rate, swing)), work, out, first)
    if z >= 0:
        deflection, rising = lanes_at(x.y, (z,)), lanes_at(x.u, (z,))
        moving = ((d[0], d[1], d[2] + deflection), (rate[0], rate[1], rate[2] + rising))
        of_mass(lane, b, carried(lane, c, SPRUNG_MASS), moving, work, out, first)
        add_to(out, first + 1, 0.5 * carried(lane, c, SPRING) * deflection * deflection)


@called
def of_mass(lane, b, mass, moving, work, out, first):
    """A mass at a place of a frame, with a velocity in it."""
    d, rate = moving
    velocity = add(vector(work.frames, b, VELOCITY), add(cross(vector(work.frames, b, SPIN), d), rate))
    velocity = turned_out(matrix(work.frames, b, ATTITUDE), velocity)
    r, p = over_ground(work.frames, b, d), times(mass, velocity)
    energies = (0.5 * mass * dot(velocity, velocity), -1.0 * falling(lane, times(mass, r)))
    include(out, first, energies, p, cross(r, p))


@called
def count(who, signals, watched, at, weight, statistics):
    """The first signals, so many steps from the start, go into the statistics of some lanes, by the steps that they
    stand for."""
    for j in range(watched):
        value, squares = lanes_at(signals, (j,)), lanes_at(statistics, (j, SQUARES))
        keep_larger(who, value, at, j, statistics)
        keep_smaller(who, value, at, j, statistics)
        put_where(who, statistics, (j, SQUARES), squares + weight * value * value)


@called
def keep_larger(who, value, at, j, statistics):
    """A value of a signal beside its largest."""
    larger = who & (value > lanes_at(statistics, (j, LARGEST)))
    put_where(larger, statistics, (j, LARGEST), value)
    put_where(larger, statistics, (j, LARGEST_AT), at)


@called
def keep_smaller(who, value, at, j, statistics):
    """A value of a signal beside its smallest."""
    smaller = who & (value < lanes_at(statistics, (j, SMALLEST)))
    put_where(smaller, statistics, (j, SMALLEST), value)
    put_where(smaller, statistics, (j, SMALLEST_AT), at)


@called
def count_between(system, who, room, number, statistics):
    """Extremes of smooth signals between stations: the vertices of parabolas through three, near the middle one; the
    smallest of lengths where a parabola of their vectors comes nearest to 0."""
    smooth, signals, past, tips = system.smooth, room.signals, room.past, room.solver.work.tips
    for k in range(smooth.shape[0]):
        j, t = smooth[k, SIGNAL], smooth[k, TIP]
        one, two, three = lanes_at(past, (0, k)), lanes_at(past, (1, k)), lanes_at(signals, (j,))
        put_lanes(past, (0, k), two)
        put_lanes(past, (1, k), three)
        if number < 2:
            continue
        turns, bend, value, at = vertex(one, two, three)
        keep_larger(who & turns & (bend < 0.0), value, at + (number - 1.0), j, statistics)
        if t >= 0:
            turns, bend, value, at = nearest(one, two, three, room.tips_before, tips, t)
        keep_smaller(who & turns & (bend > 0.0), value, at + (number - 1.0), j, statistics)
    for t in range(tips.shape[0]):
        keep_vector(room.tips_before, 2 * t, 0, vector(room.tips_before, 2 * t + 1, 0))
        keep_vector(room.tips_before, 2 * t + 1, 0, vector(tips, t, 0))


@called
def nearest(one, two, three, before, now, t):
    """Whether a parabola through the vectors of a tip at three stations comes near to 0 between these, by their
    lengths; the bend of the squares, its length where it is nearest, and how many steps that is behind the middle."""
    slope, bend = 0.5 * (three * three - one * one), one * one - 2.0 * (two * two) + three * three
    turns = (bend > 0.0) & (slope * slope <= bend * bend)
    at = -1.0 * slope / choose(turns, bend, 1.0)
    first, middle, last = vector(before, 2 * t, 0), vector(before, 2 * t + 1, 0), vector(now, t, 0)
    rate = times(0.5, add(last, times(-1.0, first)))
    curve = times(0.5, add(add(first, last), times(-2.0, middle)))
    for _ in range(CLOSER):
        p, v = add(middle, times(at, add(rate, times(at, curve)))), add(rate, times(2.0 * at, curve))
        grows = dot(v, v) + 2.0 * dot(p, curve)
        at = at - choose(grows > 0.0, dot(p, v) / choose(grows > 0.0, grows, 1.0), 0.0)
        at = choose(at > 1.0, 1.0, choose(at < -1.0, -1.0, at))
    p = add(middle, times(at, add(rate, times(at, curve))))
    return turns, bend, root(dot(p, p)), at


@called
def vertex(one, two, three):
    """Whether a parabola through three stations turns near the middle one, its bend, its value where it does, and how
    many steps that is behind the middle."""
    slope, bend = 0.5 * (three - one), one - 2.0 * two + three
    turns = (bend * bend > 0.0) & (4.0 * slope * slope <= bend * bend)
    at = -1.0 * slope / choose(turns, bend, 1.0)
    return turns, bend, two + 0.5 * slope * at, at
