"""Frames, followed from the ground outward: (1)-(5) of Hartweg and Heckmann (2012), through joints; and those of
the rigid arm, where no body bends."""

from engine.kernels.floating.layout import (
    COORDINATE,
    END_JOINT,
    FIRST,
    FIRST_JOINT,
    HANGING_SHAPE,
    HANGING_TURN,
    KIND,
    MODES,
    MOTION,
    PARENT,
    PLACE,
    PRISMATIC,
    SHORTENED,
    SPHERICAL,
    TURNED,
)
from engine.kernels.floating.tracks import combined, nearer, span_of
from engine.kernels.floating.vectors import (
    add,
    add_vector,
    after,
    cross,
    keep_matrix,
    keep_vector,
    matrix,
    no_vector,
    rotation,
    shared_matrix,
    shared_vector,
    spin_change_of,
    spin_of,
    times,
    turned_in,
    turned_out,
    vector,
)
from engine.kernels.floating.work import (
    ACCELERATION,
    ANGULAR,
    ATTITUDE,
    FORCE,
    HANGING,
    HANGING_PLACE,
    HANGING_TURNED,
    JOINT_SHIFT,
    JOINT_TURNED,
    POSITION,
    SPIN,
    VELOCITY,
    three_at,
)
from engine.kernels.jit import called
from engine.kernels.vector import all_lanes, lanes_at, put_lanes


@called
def follow_frame(system, lane, b, x, work):
    """Position, attitude, velocities and accelerations of a frame, (1)-(5), from those of its parent."""
    frames, p = work.frames, system.tree[b, PARENT]
    place = add(no_vector(), shared_vector(system.bodies, b, PLACE))
    if p < 0:
        stand_on_ground(lane, b, frames)
        shift(frames, b, place, no_vector(), no_vector())
    else:
        for k in range(FORCE):
            put_lanes(frames, (b, k), lanes_at(frames, (p, k)))
        n, first, row = system.tree[p, MODES], system.tree[p, FIRST], b * system.track.shape[4]
        place = add(place, combined(system.modes, row, HANGING_SHAPE, n, x.y, first))
        rate = combined(system.modes, row, HANGING_SHAPE, n, x.u, first)
        change = combined(system.modes, row, HANGING_SHAPE, n, x.a, first)
        if system.tree[p, SHORTENED]:
            place, rate, change = drawn_in(system, b, x, (place, rate, change))
        shift(frames, b, place, rate, change)
        keep_vector(frames, b, HANGING_PLACE, place)
        if n:
            t = combined(system.modes, row, HANGING_TURN, n, x.y, first)
            dt = combined(system.modes, row, HANGING_TURN, n, x.u, first)
            ddt = combined(system.modes, row, HANGING_TURN, n, x.a, first)
            E = rotation(t)
            keep_vector(frames, b, HANGING, t)
            keep_matrix(frames, b, HANGING_TURNED, E)
            turn(frames, b, E, spin_of(t, dt), spin_change_of(t, dt, ddt))
    look_along(frames, b, shared_matrix(system.bodies, b, TURNED))
    for j in range(system.tree[b, FIRST_JOINT], system.tree[b, END_JOINT]):
        follow_joint(system, j, b, x, work)


@called
def drawn_in(system, b, x, moving):
    """Place, velocity and acceleration where a body hangs on one whose places come nearer as it bends, -1/2 q G q."""
    G, p, (d, rate, change) = system.hanging_shorter, system.tree[b, PARENT], moving
    span = span_of(system, p)
    coming = add(nearer(G, b, span, x.y, x.a), nearer(G, b, span, x.u, x.u))
    d = add(d, times(-0.5, nearer(G, b, span, x.y, x.y)))
    return d, add(rate, times(-1.0, nearer(G, b, span, x.y, x.u))), add(change, times(-1.0, coming))


@called
def stand_on_ground(lane, b, frames):
    """A frame that is the ground's, which gravity accelerates upward."""
    for k in range(FORCE):
        put_lanes(frames, (b, k), all_lanes(0.0))
    for k in range(3):
        put_lanes(frames, (b, ATTITUDE + 4 * k), all_lanes(1.0))
    keep_vector(frames, b, ACCELERATION, times(-1.0, three_at(lane.gravity, 0)))


@called
def shift(frames, b, d, rate, acceleration):
    """The frame goes on to a place d of it, which moves in it."""
    w, al = vector(frames, b, SPIN), vector(frames, b, ANGULAR)
    add_vector(frames, b, POSITION, turned_out(matrix(frames, b, ATTITUDE), d))
    of_spin = add(cross(al, d), add(cross(w, cross(w, d)), times(2.0, cross(w, rate))))
    add_vector(frames, b, ACCELERATION, add(of_spin, acceleration))
    add_vector(frames, b, VELOCITY, add(cross(w, d), rate))


@called
def turn(frames, b, E, rate, acceleration):
    """The frame turns by E, whose angular velocity and acceleration are resolved in the old axes."""
    w = vector(frames, b, SPIN)
    angular = add(add(vector(frames, b, ANGULAR), acceleration), cross(w, rate))
    keep_vector(frames, b, ANGULAR, angular)
    keep_vector(frames, b, SPIN, add(w, rate))
    look_along(frames, b, E)


@called
def look_along(frames, b, E):
    """What is known of the frame is resolved in the columns of E."""
    for k in (VELOCITY, SPIN, ACCELERATION, ANGULAR):
        keep_vector(frames, b, k, turned_in(E, vector(frames, b, k)))
    keep_matrix(frames, b, ATTITUDE, after(matrix(frames, b, ATTITUDE), E))


@called
def follow_joint(system, j, b, x, work):
    """The frame of a body goes on from before one of its joints to behind it."""
    k, m, kind = system.joint_table[j, COORDINATE], system.joint_table[j, MOTION], system.joint_table[j, KIND]
    if kind == SPHERICAL:
        E = after(matrix(work.base, j, 0), rotation(three_at(x.y, k)))
        keep_matrix(work.joints, j, JOINT_TURNED, E)
        turn(work.frames, b, E, turned_out(E, three_at(x.u, k)), turned_out(E, three_at(x.a, k)))
        return
    axis = shared_vector(system.axes, j, 0)
    value, rate, change = given_or_free(k, m, x, work)
    if kind == PRISMATIC:
        d = times(value, axis)
        keep_vector(work.joints, j, JOINT_SHIFT, d)
        shift(work.frames, b, d, times(rate, axis), times(change, axis))
    else:
        E = rotation(times(value, axis))
        keep_matrix(work.joints, j, JOINT_TURNED, E)
        turn(work.frames, b, E, times(rate, axis), times(change, axis))


@called
def follow_rigid(system, b, work):
    """Attitude and position of a frame of the rigid arm, from those of its parent: bodies as if they did not bend, and
    all joints where their motions are, also those that only steer towards them."""
    p, rigid = system.tree[b, PARENT], work.rigid
    if p < 0:
        one, zero = all_lanes(1.0), all_lanes(0.0)
        E, r = ((one, zero, zero), (zero, one, zero), (zero, zero, one)), no_vector()
    else:
        E, r = matrix(rigid, p, ATTITUDE), vector(rigid, p, POSITION)
    r = add(r, turned_out(E, shared_vector(system.bodies, b, PLACE)))
    E = after(E, shared_matrix(system.bodies, b, TURNED))
    for j in range(system.tree[b, FIRST_JOINT], system.tree[b, END_JOINT]):
        along = times(lanes_at(work.motions, (system.joint_table[j, MOTION], 0)), shared_vector(system.axes, j, 0))
        if system.joint_table[j, KIND] == PRISMATIC:
            r = add(r, turned_out(E, along))
        elif system.joint_table[j, COORDINATE] < 0:  # driven: its frame is turned alike
            E = after(E, matrix(work.joints, j, JOINT_TURNED))
        else:
            E = after(E, rotation(along))
    keep_matrix(rigid, b, ATTITUDE, E)
    keep_vector(rigid, b, POSITION, r)


@called
def given_or_free(k, m, x, work):
    """Value, rate and acceleration of a coordinate, or of the motion where that is -1."""
    if k >= 0:
        return lanes_at(x.y, (k,)), lanes_at(x.u, (k,)), lanes_at(x.a, (k,))
    return vector(work.motions, m, 0)
