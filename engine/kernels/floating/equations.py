"""The equations of motion of bodies whose frames move, as what is left of them by coordinates, velocities and
accelerations: inertia less all forces, per coordinate (virtual power, (8) of Hartweg and Heckmann 2012).

Frames are followed from the ground outward, forces gathered back inward (recursive Newton-Euler with elastic bodies).
Gravity is an acceleration of the ground upward.
"""

from typing import NamedTuple

import numpy as np

from engine.kernels.floating.layout import (
    COORDINATE,
    COULOMB,
    DAMPER,
    DRIVE,
    END_JOINT,
    FIRST,
    FIRST_JOINT,
    FIRST_ORDER,
    HANGING_SHAPE,
    HANGING_TURN,
    HEIGHT,
    INERTIA,
    KIND,
    MASS,
    MODAL_MASS,
    MODES,
    MOMENT,
    MOTION,
    ORIGIN,
    OWN_MASS,
    PARENT,
    PLACE,
    PLACE_COORDINATE,
    PLACE_MOTION,
    PRISMATIC,
    RESTS,
    REVOLUTE,
    RIDDEN,
    SECOND,
    SECOND_ORDER,
    SLIP,
    SPHERICAL,
    SPRING,
    SPRUNG_COORDINATE,
    SPRUNG_MASS,
    STIFFENING,
    STIFFENS,
    STIFFNESS,
    TRANSLATION,
    TURNED,
    VISCOUS,
)
from engine.kernels.floating.tracks import (
    AT_PLACE,
    CURVE,
    SHAPE,
    SLOPE,
    TURN,
    TURN_CURVE,
    TURN_SLOPE,
    combined,
    foreshortening_at,
    shapes_at,
)
from engine.kernels.floating.vectors import (
    add,
    add_vector,
    after,
    axial,
    cross,
    dot,
    keep_matrix,
    keep_vector,
    matrix,
    rotation,
    spin_change_of,
    spin_of,
    times,
    turned_in,
    turned_out,
    vector,
)
from engine.kernels.jit import called
from engine.kernels.layout import FloatArray

NOTHING = (0.0, 0.0, 0.0)
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

# columns of Work.frames: attitude to the ground and position over it; velocity, spin, acceleration less gravity and
# angular acceleration, resolved in the frame; force, and torque about its origin, that the body needs; the place where
# it hangs on its parent, the rotation vector there and its matrix
ATTITUDE, POSITION, VELOCITY, SPIN, ACCELERATION, ANGULAR, FORCE, TORQUE = 0, 9, 12, 15, 18, 21, 24, 27
HANGING_PLACE, HANGING, HANGING_TURNED, FRAME = 30, 33, 36, 45
# columns of Work.joints: its rotation, or its shift
JOINT_TURNED, JOINT_SHIFT, JOINT = 0, 9, 12
# columns of Work.contacts: force of the track on a carriage
CONTACT, CONTACTS = 0, 3


class Work(NamedTuple):
    """Room for one lane's frames (B, FRAME), joints (J, JOINT), contacts (C, CONTACTS), modes at a place (n, AT_PLACE)
    and first moments of a body's modes (n, 9); the motions (M, 3) as given now: value, rate and acceleration; base
    (J, 9): attitudes of spherical joints at the start of the step."""

    frames: FloatArray
    joints: FloatArray
    contacts: FloatArray
    modes: FloatArray
    moments: FloatArray
    motions: FloatArray
    base: FloatArray


@called
def room(system, lane):
    """Work for a lane, its joints not turned yet."""
    base = np.zeros((system.axes.shape[0], 9))
    base[:, 0], base[:, 4], base[:, 8] = 1.0, 1.0, 1.0
    return Work(
        np.zeros((system.tree.shape[0], FRAME)),
        np.zeros((system.axes.shape[0], JOINT)),
        np.zeros((system.riders.shape[0], CONTACTS)),
        np.zeros((system.track.shape[4], AT_PLACE)),
        np.zeros((system.track.shape[4], 9)),
        np.zeros((lane.motions.shape[0], 3)),
        base,
    )


@called
def residual(system, lane, x, work, out):
    """What is left of the equations of a lane, into out (N)."""
    for k in range(out.size):
        out[k] = 0.0
    bodies = system.tree.shape[0]
    for b in range(bodies):
        if not system.tree[b, RESTS]:
            follow_frame(system, lane, b, x, work)
    for b in range(bodies):
        if system.tree[b, RESTS]:
            modal_forces(system, lane, b, x, work, out)
        else:
            body_forces(system, lane, b, x, work, out)
    for c in range(system.riders.shape[0]):
        carriage_forces(system, lane, c, x, work, out)
    for b in range(bodies - 1, -1, -1):
        if not system.tree[b, RESTS]:
            gather(system, lane, b, x, work, out)


@called
def follow_frame(system, lane, b, x, work):
    """Position, attitude, velocities and accelerations of a frame, (1)-(5), from those of its parent."""
    frames, p = work.frames, system.tree[b, PARENT]
    place = vector(system.bodies, b, PLACE)
    if p < 0:
        keep_matrix(frames, b, ATTITUDE, IDENTITY)
        for k in range(POSITION, FORCE):
            frames[b, k] = 0.0
        g = lane.gravity
        keep_vector(frames, b, ACCELERATION, (-g[0], -g[1], -g[2]))
        shift(frames, b, place, NOTHING, NOTHING)
    else:
        for k in range(FORCE):
            frames[b, k] = frames[p, k]
        n, first, row = system.tree[p, MODES], system.tree[p, FIRST], b * system.track.shape[4]
        place = add(place, combined(system.modes, row, HANGING_SHAPE, n, x.y, first))
        rate = combined(system.modes, row, HANGING_SHAPE, n, x.u, first)
        shift(frames, b, place, rate, combined(system.modes, row, HANGING_SHAPE, n, x.a, first))
        keep_vector(frames, b, HANGING_PLACE, place)
        if n:
            t = combined(system.modes, row, HANGING_TURN, n, x.y, first)
            dt = combined(system.modes, row, HANGING_TURN, n, x.u, first)
            ddt = combined(system.modes, row, HANGING_TURN, n, x.a, first)
            E = rotation(t)
            keep_vector(frames, b, HANGING, t)
            keep_matrix(frames, b, HANGING_TURNED, E)
            turn(frames, b, E, spin_of(t, dt), spin_change_of(t, dt, ddt))
    turn(frames, b, matrix(system.bodies, b, TURNED), NOTHING, NOTHING)
    for j in range(system.tree[b, FIRST_JOINT], system.tree[b, END_JOINT]):
        follow_joint(system, j, b, x, work)


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
    keep_vector(frames, b, ANGULAR, turned_in(E, angular))
    keep_vector(frames, b, SPIN, turned_in(E, add(w, rate)))
    keep_vector(frames, b, VELOCITY, turned_in(E, vector(frames, b, VELOCITY)))
    keep_vector(frames, b, ACCELERATION, turned_in(E, vector(frames, b, ACCELERATION)))
    keep_matrix(frames, b, ATTITUDE, after(matrix(frames, b, ATTITUDE), E))


@called
def follow_joint(system, j, b, x, work):
    """The frame of a body goes on from before one of its joints to behind it."""
    k, m, kind = system.joint_table[j, COORDINATE], system.joint_table[j, MOTION], system.joint_table[j, KIND]
    axis = vector(system.axes, j, 0)
    if kind == SPHERICAL:
        E = after(matrix(work.base, j, 0), rotation((x.y[k], x.y[k + 1], x.y[k + 2])))
        keep_matrix(work.joints, j, JOINT_TURNED, E)
        rate, change = (x.u[k], x.u[k + 1], x.u[k + 2]), (x.a[k], x.a[k + 1], x.a[k + 2])
        turn(work.frames, b, E, turned_out(E, rate), turned_out(E, change))
        return
    value, rate, change = (x.y[k], x.u[k], x.a[k]) if k >= 0 else vector(work.motions, m, 0)
    if kind == PRISMATIC:
        d = times(value, axis)
        keep_vector(work.joints, j, JOINT_SHIFT, d)
        shift(work.frames, b, d, times(rate, axis), times(change, axis))
    else:
        E = turned_about(axis, value)
        keep_matrix(work.joints, j, JOINT_TURNED, E)
        turn(work.frames, b, E, times(rate, axis), times(change, axis))


@called
def turned_about(e, t):
    """Rotation by any angle about a unit axis, as rows."""
    s, c = np.sin(t), 1.0 - np.cos(t)
    x, y, z = e
    return (
        (1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y),
        (c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x),
        (c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)),
    )


@called
def body_forces(system, lane, b, x, work, out):
    """Inertia, elastic and damping forces of a body, (9): with H_i = int d phi_i^T dm of the deformed d = c + phi q,

    force   m a + al x S + w x (w x S) + 2 w x sum t_i q_i' + sum t_i q_i'',          S = m c + sum t_i q_i
    torque  S x a + J al + w x J w + sum ax(H_i) q_i'' + 2 (w tr N - N^T w),          N = sum H_i q_i'
    mode i  t_i . a + ax(H_i) . al + w.H_i w - tr(H_i) w.w + 2 w . sum ax(H_ji) q_j' + sum M_ij q_j''
            + k q + d q'
    """
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    w, al, acc = vector(work.frames, b, SPIN), vector(work.frames, b, ANGULAR), vector(work.frames, b, ACCELERATION)
    S = add(combined(system.modes, b * widest, TRANSLATION, n, x.y, first), vector(system.bodies, b, MOMENT))
    drift = combined(system.modes, b * widest, TRANSLATION, n, x.u, first)
    push = combined(system.modes, b * widest, TRANSLATION, n, x.a, first)
    P = second_moments(system, b, x, work)
    trace = P[0][0] + P[1][1] + P[2][2]
    Jal = add(times(trace, al), times(-1.0, turned_out(P, al)))
    Jw = add(times(trace, w), times(-1.0, turned_out(P, w)))
    force = add(times(system.bodies[b, MASS], acc), add(cross(al, S), cross(w, cross(w, S))))
    force = add(force, add(times(2.0, cross(w, drift)), push))
    torque = add(add(cross(S, acc), Jal), cross(w, Jw))
    square = dot(w, w)
    across = square - w[0] * w[0]  # what turns the track's direction
    for i in range(n):
        row = b * widest + i
        H = matrix(work.moments, i, 0)
        trace = H[0][0] + H[1][1] + H[2][2]
        torque = add(torque, times(x.a[first + i], axial(H)))
        torque = add(torque, times(2.0 * x.u[first + i], add(times(trace, w), times(-1.0, turned_in(H, w)))))
        r = dot(vector(system.modes, row, TRANSLATION), acc) + dot(axial(H), al) + dot(w, turned_out(H, w))
        r += lane.damping[row] * x.u[first + i] - trace * square
        for j in range(n):
            B = matrix(system.pairs, (b * widest + j) * widest + i, SECOND_ORDER)
            r += 2.0 * dot(w, axial(B)) * x.u[first + j] + (B[0][0] + B[1][1] + B[2][2]) * x.a[first + j]
            pair = row * widest + j
            stiffening = system.pairs[pair, STIFFENING + 1] * across - system.pairs[pair, STIFFENING] * acc[0]
            r += (system.pairs[pair, STIFFNESS] + stiffening) * x.y[first + j]
        out[first + i] += r
    keep_vector(work.frames, b, FORCE, force)
    keep_vector(work.frames, b, TORQUE, torque)


@called
def modal_forces(system, lane, b, x, work, out):
    """The same of a body whose frame rests: its modes alone."""
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    acc = vector(work.frames, b, ACCELERATION)
    for i in range(n):
        row = b * widest + i
        r = dot(vector(system.modes, row, TRANSLATION), acc) + lane.damping[row] * x.u[first + i]
        for j in range(n):
            pair = row * widest + j
            r += system.pairs[pair, MODAL_MASS] * x.a[first + j] + system.pairs[pair, STIFFNESS] * x.y[first + j]
        out[first + i] += r
    keep_vector(work.frames, b, FORCE, NOTHING)
    keep_vector(work.frames, b, TORQUE, NOTHING)


@called
def second_moments(system, b, x, work):
    """int d d^T dm of the deformed body, as rows; H_i of all its modes into work.moments."""
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    P = matrix(system.bodies, b, SECOND)
    xx, xy, xz = P[0]
    yy, yz, zz = P[1][1], P[1][2], P[2][2]
    for i in range(n):
        q, H, F = x.y[first + i], first_moments(system, b, i, x), matrix(system.modes, b * widest + i, FIRST_ORDER)
        keep_matrix(work.moments, i, 0, H)
        xx += q * (H[0][0] + F[0][0])
        yy += q * (H[1][1] + F[1][1])
        zz += q * (H[2][2] + F[2][2])
        xy += q * 0.5 * (H[0][1] + H[1][0] + F[0][1] + F[1][0])
        xz += q * 0.5 * (H[0][2] + H[2][0] + F[0][2] + F[2][0])
        yz += q * 0.5 * (H[1][2] + H[2][1] + F[1][2] + F[2][1])
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


@called
def first_moments(system, b, i, x):
    """H_i = int d phi_i^T dm of the deformed body, as rows."""
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    one, two, three = matrix(system.modes, b * widest + i, FIRST_ORDER)
    for j in range(n):
        B = matrix(system.pairs, (b * widest + j) * widest + i, SECOND_ORDER)
        q = x.y[first + j]
        one, two, three = add(one, times(q, B[0])), add(two, times(q, B[1])), add(three, times(q, B[2]))
    return one, two, three


@called
def ridden(system, c, x, work):
    """Place, speed and acceleration of a carriage along its track."""
    k, m = system.riders[c, PLACE_COORDINATE], system.riders[c, PLACE_MOTION]
    if k >= 0:
        return x.y[k], x.u[k], x.a[k]
    return vector(work.motions, m, 0)


@called
def has_attitude(lane, c):
    """Whether it matters how a carriage is turned."""
    carriages = lane.carriages
    turning = carriages[c, INERTIA] + carriages[c, INERTIA + 1] + carriages[c, INERTIA + 2]
    return turning > 0.0 or carriages[c, HEIGHT] != 0.0


@called
def carriage_acceleration(system, c, x, work):
    """Acceleration of the point that a carriage touches, less gravity, resolved in the frame of its body."""
    b, at = system.riders[c, RIDDEN], work.modes
    along = ridden(system, c, x, work)
    shapes_at(system, b, along[0], system.tree[b, MODES], 3, at)
    d, rate, change, _ = touched(system, b, along, x, at)
    return inertia_force(system, work, b, 1.0, d, rate, change)


@called
def touched(system, b, along, x, at):
    """Place, velocity and acceleration in the frame of a point that slides on the deformed track, (16) and (17), and
    the track's tangent there; along: its place, speed and acceleration on the track, at (n, AT_PLACE): the shapes
    there."""
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    s, ds, dds = along
    slope = combined(at, 0, SLOPE, n, x.y, first)
    tangent = (1.0 + slope[0], slope[1], slope[2])
    d = add(add((s, 0.0, 0.0), vector(system.bodies, b, ORIGIN)), combined(at, 0, SHAPE, n, x.y, first))
    rate = add(combined(at, 0, SHAPE, n, x.u, first), times(ds, tangent))
    change = add(combined(at, 0, SHAPE, n, x.a, first), times(2.0 * ds, combined(at, 0, SLOPE, n, x.u, first)))
    change = add(change, add(times(ds * ds, combined(at, 0, CURVE, n, x.y, first)), times(dds, tangent)))
    return d, rate, change, tangent


@called
def carriage_forces(system, lane, c, x, work, out):
    """Inertia, weight and friction of a carriage on its body, (10)-(21)."""
    b, at = system.riders[c, RIDDEN], work.modes
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    turns = has_attitude(lane, c)
    along = ridden(system, c, x, work)
    s, ds, _ = along
    shapes_at(system, b, s, n, 6 if turns else 3, at)
    d, rate, change, tangent = touched(system, b, along, x, at)
    f, arm, about = NOTHING, NOTHING, NOTHING
    mass = lane.carriages[c, OWN_MASS]
    if turns:
        own, own_change, arm, about = attitude(system, lane, c, along, x, work)
        swing = add(cross(own_change, arm), cross(own, cross(own, arm)))
        f = inertia_force(system, work, b, mass, add(d, arm), add(rate, cross(own, arm)), add(change, swing))
        add_vector(work.frames, b, TORQUE, about)
        about = add(about, cross(arm, f))
    else:
        f = inertia_force(system, work, b, mass, d, rate, change)
    add_vector(work.frames, b, FORCE, f)
    add_vector(work.frames, b, TORQUE, cross(add(d, arm), f))
    z = system.riders[c, SPRUNG_COORDINATE]
    if z >= 0:
        up, rising, lifting = add(d, (0.0, 0.0, x.y[z])), add(rate, (0.0, 0.0, x.u[z])), add(change, (0.0, 0.0, x.a[z]))
        own = inertia_force(system, work, b, lane.carriages[c, SPRUNG_MASS], up, rising, lifting)
        add_vector(work.frames, b, FORCE, own)
        add_vector(work.frames, b, TORQUE, cross(up, own))
        out[z] += own[2] + lane.carriages[c, SPRING] * x.y[z] + lane.carriages[c, DAMPER] * x.u[z]
        f = add(f, own)
    keep_vector(work.contacts, c, CONTACT, f)
    t = combined(at, 0, TURN, n, x.y, first) if turns else NOTHING
    k = system.riders[c, PLACE_COORDINATE]
    if k >= 0:
        out[k] += dot(tangent, f) - along_track(lane, c, ds, f, tangent)
        if turns:
            out[k] += dot(spin_of(t, combined(at, 0, TURN_SLOPE, n, x.y, first)), about)
    for i in range(n):
        r = dot(vector(at, i, SHAPE), f)
        if turns:
            r += dot(spin_of(t, vector(at, i, TURN)), about)
        if system.bodies[b, STIFFENS] > 0.0:  # the track between its origin and the carriage grows shorter as it bends
            for j in range(n):
                r -= foreshortening_at(system, b, s, i * widest + j) * x.y[first + j] * f[0]
        out[first + i] += r


@called
def attitude(system, lane, c, along, x, work):
    """Of a carriage that turns with its track, (12) and (14): angular velocity and acceleration in the frame, the arm
    from the track to its centre of mass, and the torque that it needs."""
    b, at = system.riders[c, RIDDEN], work.modes
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    _, ds, dds = along
    slope = combined(at, 0, TURN_SLOPE, n, x.y, first)
    t = combined(at, 0, TURN, n, x.y, first)
    dt = add(combined(at, 0, TURN, n, x.u, first), times(ds, slope))
    ddt = add(combined(at, 0, TURN, n, x.a, first), times(2.0 * ds, combined(at, 0, TURN_SLOPE, n, x.u, first)))
    ddt = add(ddt, add(times(ds * ds, combined(at, 0, TURN_CURVE, n, x.y, first)), times(dds, slope)))
    E, own, own_change = rotation(t), spin_of(t, dt), spin_change_of(t, dt, ddt)
    arm = turned_out(E, (0.0, 0.0, lane.carriages[c, HEIGHT]))
    w = vector(work.frames, b, SPIN)
    whole, whole_change = add(w, own), add(add(vector(work.frames, b, ANGULAR), own_change), cross(w, own))
    torque = add(inertia_times(E, lane, c, whole_change), cross(whole, inertia_times(E, lane, c, whole)))
    return own, own_change, arm, torque


@called
def inertia_force(system, work, b, mass, d, rate, change):
    """Force that a mass at a place d of a frame needs, less its weight, by (13)."""
    if system.tree[b, RESTS]:
        return times(mass, add(vector(work.frames, b, ACCELERATION), change))
    w, al = vector(work.frames, b, SPIN), vector(work.frames, b, ANGULAR)
    acc = add(vector(work.frames, b, ACCELERATION), add(cross(al, d), cross(w, cross(w, d))))
    return times(mass, add(acc, add(times(2.0, cross(w, rate)), change)))


@called
def inertia_times(E, lane, c, w):
    """E diag(I) E^T w."""
    own, about = turned_in(E, w), vector(lane.carriages, c, INERTIA)
    return turned_out(E, (about[0] * own[0], about[1] * own[1], about[2] * own[2]))


@called
def along_track(lane, c, ds, f, tangent):
    """Drive force and friction along the coordinate of a carriage, N: viscous, and Coulomb's, smoothed by tanh."""
    stretch = np.sqrt(dot(tangent, tangent))
    found = lane.carriages[c, DRIVE] - lane.carriages[c, VISCOUS] * ds * stretch
    if lane.carriages[c, COULOMB] > 0.0:
        along = dot(f, tangent) / stretch
        normal = dot(f, f) - along * along
        if normal > 0.0:
            found -= lane.carriages[c, COULOMB] * np.sqrt(normal) * np.tanh(ds * stretch / lane.carriages[c, SLIP])
    return found * stretch


@called
def gather(system, lane, b, x, work, out):
    """What a body needs goes through its joints, last to first, to the modes and the frame of its parent."""
    F, T = vector(work.frames, b, FORCE), vector(work.frames, b, TORQUE)
    for j in range(system.tree[b, END_JOINT] - 1, system.tree[b, FIRST_JOINT] - 1, -1):
        k, kind = system.joint_table[j, COORDINATE], system.joint_table[j, KIND]
        if k >= 0:
            joint_forces(system, lane, j, x, work, (F, T), out)
        if kind == PRISMATIC:
            T = add(T, cross(vector(work.joints, j, JOINT_SHIFT), F))
        else:
            E = matrix(work.joints, j, JOINT_TURNED)
            F, T = turned_out(E, F), turned_out(E, T)
    p, row = system.tree[b, PARENT], b * system.track.shape[4]
    if p < 0:
        return
    E0 = matrix(system.bodies, b, TURNED)
    F, T = turned_out(E0, F), turned_out(E0, T)
    n, first = system.tree[p, MODES], system.tree[p, FIRST]
    if n:
        E, t = matrix(work.frames, b, HANGING_TURNED), vector(work.frames, b, HANGING)
        F, T = turned_out(E, F), turned_out(E, T)
        for i in range(n):
            turning = spin_of(t, vector(system.modes, row + i, HANGING_TURN))
            out[first + i] += dot(vector(system.modes, row + i, HANGING_SHAPE), F) + dot(turning, T)
    add_vector(work.frames, p, FORCE, F)
    add_vector(work.frames, p, TORQUE, add(T, cross(vector(work.frames, b, HANGING_PLACE), F)))


@called
def joint_forces(system, lane, j, x, work, wrench, out):
    """What the coordinates of a joint need of the force and torque behind it, and its spring and damper about 0 or
    about a motion."""
    F, T = wrench
    k, kind, m = system.joint_table[j, COORDINATE], system.joint_table[j, KIND], system.joint_table[j, MOTION]
    if kind == SPHERICAL:
        for i in range(3):
            out[k + i] += T[i] + lane.joints[j, 1] * x.u[k + i]
        return
    value, rate = x.y[k], x.u[k]
    if m >= 0:
        value, rate = value - work.motions[m, 0], rate - work.motions[m, 1]
    own = dot(vector(system.axes, j, 0), T) if kind == REVOLUTE else dot(vector(system.axes, j, 0), F)
    out[k] += own + lane.joints[j, 0] * value + lane.joints[j, 1] * rate
