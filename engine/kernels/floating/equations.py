"""The equations of motion of bodies whose frames move, as what is left of them by coordinates, velocities and
accelerations: inertia less all forces, per coordinate (virtual power, (8) of Hartweg and Heckmann 2012).

Frames are followed from the ground outward, forces gathered back inward (recursive Newton-Euler with elastic bodies).
Gravity is an acceleration of the ground upward.
"""

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
    HANGING_SHORTER,
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
from engine.kernels.floating.loads import link_forces, load_forces
from engine.kernels.floating.tracks import (
    CURVE,
    SHAPE,
    SLOPE,
    TURN,
    TURN_CURVE,
    TURN_SLOPE,
    combined,
    combined_there,
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
    CONTACT,
    FORCE,
    HANGING,
    HANGING_PLACE,
    HANGING_TURNED,
    JOINT_SHIFT,
    JOINT_TURNED,
    POSITION,
    SPIN,
    TORQUE,
    TOUCHED,
    VELOCITY,
    add_to,
    three_at,
)
from engine.kernels.jit import called
from engine.kernels.sines import hyperbolic_tangent
from engine.kernels.vector import all_lanes, choose, everywhere, lanes_at, put_lanes, root

NOTHING = (0.0, 0.0, 0.0)


@called
def residual(system, lane, x, work, out):
    """What is left of the equations of a block of lanes, into out (N, LANES)."""
    for k in range(out.shape[0]):
        put_lanes(out, (k,), all_lanes(0.0))
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
    for q in range(system.load_table.shape[0]):
        load_forces(system, lane, q, x, work, out)
    for k in range(system.links.shape[0]):
        link_forces(system, lane, k, x, work, out)
    for b in range(bodies - 1, -1, -1):
        if not system.tree[b, RESTS]:
            gather(system, lane, b, x, work, out)


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
    look_along(frames, b, shared_matrix(system.bodies, b, TURNED))
    for j in range(system.tree[b, FIRST_JOINT], system.tree[b, END_JOINT]):
        follow_joint(system, j, b, x, work)


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
def given_or_free(k, m, x, work):
    """Value, rate and acceleration of a coordinate, or of the motion where that is -1."""
    if k >= 0:
        return lanes_at(x.y, (k,)), lanes_at(x.u, (k,)), lanes_at(x.a, (k,))
    return vector(work.motions, m, 0)


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
    S = add(combined(system.modes, b * widest, TRANSLATION, n, x.y, first), shared_vector(system.bodies, b, MOMENT))
    drift = combined(system.modes, b * widest, TRANSLATION, n, x.u, first)
    push = combined(system.modes, b * widest, TRANSLATION, n, x.a, first)
    P = second_moments(system, b, x, work)
    trace = P[0][0] + P[1][1] + P[2][2]
    Jal = add(times(trace, al), times(-1.0, turned_out(P, al)))
    Jw = add(times(trace, w), times(-1.0, turned_out(P, w)))
    force = add(times(system.bodies[b, MASS], acc), add(cross(al, S), cross(w, cross(w, S))))
    force = add(force, add(times(2.0, cross(w, drift)), push))
    torque = add(add(cross(S, acc), Jal), cross(w, Jw))
    for i in range(n):
        H, du, dda = matrix(work.moments, i, 0), lanes_at(x.u, (first + i,)), lanes_at(x.a, (first + i,))
        trace = H[0][0] + H[1][1] + H[2][2]
        torque = add(torque, times(dda, axial(H)))
        torque = add(torque, times(2.0 * du, add(times(trace, w), times(-1.0, turned_in(H, w)))))
    keep_vector(work.frames, b, FORCE, force)
    keep_vector(work.frames, b, TORQUE, torque)
    for i in range(n):
        mode_force(system, lane, b, i, x, work, out)


@called
def mode_force(system, lane, b, i, x, work, out):
    """What is left of the equation of a mode of a body whose frame moves, see `body_forces`."""
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    w, al, acc = vector(work.frames, b, SPIN), vector(work.frames, b, ANGULAR), vector(work.frames, b, ACCELERATION)
    row, H = b * widest + i, matrix(work.moments, i, 0)
    square = dot(w, w)
    across = square - w[0] * w[0]  # what turns the track's direction
    r = dot(shared_vector(system.modes, row, TRANSLATION), acc) + dot(axial(H), al) + dot(w, turned_out(H, w))
    r = r + lanes_at(lane.damping, (row,)) * lanes_at(x.u, (first + i,)) - (H[0][0] + H[1][1] + H[2][2]) * square
    for j in range(n):
        B = shared_matrix(system.pairs, (b * widest + j) * widest + i, SECOND_ORDER)
        r = r + 2.0 * dot(w, axial(B)) * lanes_at(x.u, (first + j,))
        r = r + (B[0][0] + B[1][1] + B[2][2]) * lanes_at(x.a, (first + j,))
        pair = row * widest + j
        stiffening = system.pairs[pair, STIFFENING + 1] * across - system.pairs[pair, STIFFENING] * acc[0]
        r = r + (system.pairs[pair, STIFFNESS] + stiffening) * lanes_at(x.y, (first + j,))
    add_to(out, first + i, r)


@called
def modal_forces(system, lane, b, x, work, out):
    """The same of a body whose frame rests: its modes alone."""
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    acc = vector(work.frames, b, ACCELERATION)
    for i in range(n):
        row = b * widest + i
        r = dot(shared_vector(system.modes, row, TRANSLATION), acc)
        r = r + lanes_at(lane.damping, (row,)) * lanes_at(x.u, (first + i,))
        for j in range(n):
            pair = row * widest + j
            r = r + system.pairs[pair, MODAL_MASS] * lanes_at(x.a, (first + j,))
            r = r + system.pairs[pair, STIFFNESS] * lanes_at(x.y, (first + j,))
        add_to(out, first + i, r)
    keep_vector(work.frames, b, FORCE, no_vector())
    keep_vector(work.frames, b, TORQUE, no_vector())


@called
def second_moments(system, b, x, work):
    """int d d^T dm of the deformed body, as rows; H_i of all its modes into work.moments."""
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    P = shared_matrix(system.bodies, b, SECOND)
    xx, xy, xz = add(no_vector(), P[0])
    yy, yz, zz = add(no_vector(), (P[1][1], P[1][2], P[2][2]))
    for i in range(n):
        q, H = lanes_at(x.y, (first + i,)), first_moments(system, b, i, x)
        F = shared_matrix(system.modes, b * widest + i, FIRST_ORDER)
        keep_matrix(work.moments, i, 0, H)
        xx = xx + q * (H[0][0] + F[0][0])
        yy = yy + q * (H[1][1] + F[1][1])
        zz = zz + q * (H[2][2] + F[2][2])
        xy = xy + q * (0.5 * (H[0][1] + H[1][0] + F[0][1] + F[1][0]))
        xz = xz + q * (0.5 * (H[0][2] + H[2][0] + F[0][2] + F[2][0]))
        yz = yz + q * (0.5 * (H[1][2] + H[2][1] + F[1][2] + F[2][1]))
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


@called
def first_moments(system, b, i, x):
    """H_i = int d phi_i^T dm of the deformed body, as rows."""
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    F = shared_matrix(system.modes, b * widest + i, FIRST_ORDER)
    one, two, three = add(no_vector(), F[0]), add(no_vector(), F[1]), add(no_vector(), F[2])
    for j in range(n):
        B = shared_matrix(system.pairs, (b * widest + j) * widest + i, SECOND_ORDER)
        q = lanes_at(x.y, (first + j,))
        one, two, three = add(one, times(q, B[0])), add(two, times(q, B[1])), add(three, times(q, B[2]))
    return one, two, three


@called
def ridden(system, c, x, work):
    """Place, speed and acceleration of a carriage along its track."""
    return given_or_free(system.riders[c, PLACE_COORDINATE], system.riders[c, PLACE_MOTION], x, work)


@called
def carried(lane, c, column):
    """A number of a carriage in every lane."""
    return lanes_at(lane.carriages, (c, column))


@called
def has_attitude(lane, c):
    """Whether it matters how a carriage is turned, in any lane."""
    turning = carried(lane, c, INERTIA) + carried(lane, c, INERTIA + 1) + carried(lane, c, INERTIA + 2)
    height = carried(lane, c, HEIGHT)
    return not everywhere((turning <= 0.0) & (height * height <= 0.0))


@called
def touched(system, b, along, x, at):
    """Place, velocity and acceleration in the frame of a point that slides on the deformed track, (16) and (17), and
    the track's tangent there; along: its place, speed and acceleration on the track, at (n, AT_PLACE): the shapes
    there."""
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    s, ds, dds = along
    slope = combined_there(at, SLOPE, n, x.y, first)
    tangent = (1.0 + slope[0], slope[1], slope[2])
    origin = shared_vector(system.bodies, b, ORIGIN)
    d = add((s + origin[0], origin[1], origin[2]), combined_there(at, SHAPE, n, x.y, first))
    rate = add(combined_there(at, SHAPE, n, x.u, first), times(ds, tangent))
    change = add(combined_there(at, SHAPE, n, x.a, first), times(2.0 * ds, combined_there(at, SLOPE, n, x.u, first)))
    change = add(change, add(times(ds * ds, combined_there(at, CURVE, n, x.y, first)), times(dds, tangent)))
    return d, rate, change, tangent


@called
def carriage_forces(system, lane, c, x, work, out):
    """Inertia, weight and friction of a carriage on its body, (10)-(21)."""
    b, at = system.riders[c, RIDDEN], work.modes
    turns = has_attitude(lane, c)
    along = ridden(system, c, x, work)
    shapes_at(system, b, along[0], 6 if turns else 3, work)
    d, rate, change, tangent = touched(system, b, along, x, at)
    acc = acceleration_at(system, work, b, d, rate, change)
    keep_vector(work.contacts, c, TOUCHED, acc)
    about, mass = no_vector(), carried(lane, c, OWN_MASS)
    if turns:
        own, own_change, arm, about = attitude(system, lane, c, along, x, work)
        swing = add(cross(own_change, arm), cross(own, cross(own, arm)))
        place = add(d, arm)
        f = times(mass, acceleration_at(system, work, b, place, add(rate, cross(own, arm)), add(change, swing)))
        add_vector(work.frames, b, TORQUE, about)
        about = add(about, cross(arm, f))
        push_frame(work, b, place, f)
    else:
        f = times(mass, acc)
        push_frame(work, b, d, f)
    z = system.riders[c, SPRUNG_COORDINATE]
    if z >= 0:
        up = (d[0], d[1], d[2] + lanes_at(x.y, (z,)))
        rising = (rate[0], rate[1], rate[2] + lanes_at(x.u, (z,)))
        lifting = (change[0], change[1], change[2] + lanes_at(x.a, (z,)))
        own_force = times(carried(lane, c, SPRUNG_MASS), acceleration_at(system, work, b, up, rising, lifting))
        push_frame(work, b, up, own_force)
        spring = carried(lane, c, SPRING) * lanes_at(x.y, (z,)) + carried(lane, c, DAMPER) * lanes_at(x.u, (z,))
        add_to(out, z, own_force[2] + spring)
        f = add(f, own_force)
    keep_vector(work.contacts, c, CONTACT, f)
    k = system.riders[c, PLACE_COORDINATE]
    if k >= 0:
        add_to(out, k, dot(tangent, f) - along_track(lane, c, along[1], f, tangent))
    push_modes(system, b, x, work, f, out)
    if turns:
        turn_modes(system, c, x, work, about, out)


@called
def push_frame(work, b, d, f):
    """A force that a frame needs besides at a place of it."""
    add_vector(work.frames, b, FORCE, f)
    add_vector(work.frames, b, TORQUE, cross(d, f))


@called
def push_modes(system, b, x, work, f, out):
    """A force of a carriage on the modes at its place; where the track between its origin and there grows shorter as it
    bends, through that too."""
    n, first, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    for i in range(n):
        r = dot(vector(work.modes, i, SHAPE), f)
        if system.bodies[b, STIFFENS] > 0.0:
            for j in range(n):
                r = r - foreshortening_at(system, b, i * widest + j, work) * lanes_at(x.y, (first + j,)) * f[0]
        add_to(out, first + i, r)


@called
def turn_modes(system, c, x, work, about, out):
    """A torque of a carriage on the modes at its place, and on its way as the track turns along it."""
    b, at = system.riders[c, RIDDEN], work.modes
    n, first, k = system.tree[b, MODES], system.tree[b, FIRST], system.riders[c, PLACE_COORDINATE]
    t = combined_there(at, TURN, n, x.y, first)
    for i in range(n):
        add_to(out, first + i, dot(spin_of(t, vector(at, i, TURN)), about))
    if k >= 0:
        add_to(out, k, dot(spin_of(t, combined_there(at, TURN_SLOPE, n, x.y, first)), about))


@called
def attitude(system, lane, c, along, x, work):
    """Of a carriage that turns with its track, (12) and (14): angular velocity and acceleration in the frame, the arm
    from the track to its centre of mass, and the torque that it needs."""
    b, at = system.riders[c, RIDDEN], work.modes
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    _, ds, dds = along
    slope = combined_there(at, TURN_SLOPE, n, x.y, first)
    t = combined_there(at, TURN, n, x.y, first)
    dt = add(combined_there(at, TURN, n, x.u, first), times(ds, slope))
    ddt = combined_there(at, TURN, n, x.a, first)
    ddt = add(ddt, times(2.0 * ds, combined_there(at, TURN_SLOPE, n, x.u, first)))
    ddt = add(ddt, add(times(ds * ds, combined_there(at, TURN_CURVE, n, x.y, first)), times(dds, slope)))
    E, own, own_change = rotation(t), spin_of(t, dt), spin_change_of(t, dt, ddt)
    arm = times(carried(lane, c, HEIGHT), (E[0][2], E[1][2], E[2][2]))
    w = vector(work.frames, b, SPIN)
    whole, whole_change = add(w, own), add(add(vector(work.frames, b, ANGULAR), own_change), cross(w, own))
    torque = add(inertia_times(E, lane, c, whole_change), cross(whole, inertia_times(E, lane, c, whole)))
    return own, own_change, arm, torque


@called
def acceleration_at(system, work, b, d, rate, change):
    """Acceleration of a place d of a frame, less gravity, by (13)."""
    acc = add(vector(work.frames, b, ACCELERATION), change)
    if system.tree[b, RESTS]:
        return acc
    w, al = vector(work.frames, b, SPIN), vector(work.frames, b, ANGULAR)
    acc = add(acc, add(cross(al, d), cross(w, cross(w, d))))
    return add(acc, times(2.0, cross(w, rate)))


@called
def inertia_times(E, lane, c, w):
    """E diag(I) E^T w."""
    own, about = turned_in(E, w), vector(lane.carriages, c, INERTIA)
    return turned_out(E, (about[0] * own[0], about[1] * own[1], about[2] * own[2]))


@called
def along_track(lane, c, ds, f, tangent):
    """Drive force and friction along the coordinate of a carriage, N: viscous, and Coulomb's, smoothed by tanh."""
    stretch = root(dot(tangent, tangent))
    found = carried(lane, c, DRIVE) - carried(lane, c, VISCOUS) * ds * stretch
    coulomb = carried(lane, c, COULOMB)
    if not everywhere(coulomb <= 0.0):
        along = dot(f, tangent) / stretch
        normal = dot(f, f) - along * along
        size = root(choose(normal > 0.0, normal, 0.0))
        found = found - coulomb * size * hyperbolic_tangent(ds * stretch / carried(lane, c, SLIP))
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
    E0 = shared_matrix(system.bodies, b, TURNED)
    F, T = turned_out(E0, F), turned_out(E0, T)
    n, first = system.tree[p, MODES], system.tree[p, FIRST]
    if n:
        E, t = matrix(work.frames, b, HANGING_TURNED), vector(work.frames, b, HANGING)
        F, T = turned_out(E, F), turned_out(E, T)
        for i in range(n):
            turning = spin_of(t, shared_vector(system.modes, row + i, HANGING_TURN))
            add_to(out, first + i, dot(shared_vector(system.modes, row + i, HANGING_SHAPE), F) + dot(turning, T))
            if system.bodies[p, STIFFENS] > 0.0:  # the track up to there grows shorter as it bends
                for j in range(n):
                    shorter = system.pairs[(row + i) * system.track.shape[4] + j, HANGING_SHORTER]
                    add_to(out, first + i, -shorter * lanes_at(x.y, (first + j,)) * F[0])
    add_vector(work.frames, p, FORCE, F)
    add_vector(work.frames, p, TORQUE, add(T, cross(vector(work.frames, b, HANGING_PLACE), F)))


@called
def joint_forces(system, lane, j, x, work, wrench, out):
    """What the coordinates of a joint need of the force and torque behind it, and its spring and damper about 0 or
    about a motion."""
    F, T = wrench
    k, kind, m = system.joint_table[j, COORDINATE], system.joint_table[j, KIND], system.joint_table[j, MOTION]
    stiffness, damping = lanes_at(lane.joints, (j, 0)), lanes_at(lane.joints, (j, 1))
    if kind == SPHERICAL:
        for i in range(3):
            add_to(out, k + i, T[i] + damping * lanes_at(x.u, (k + i,)))
        return
    value, rate = lanes_at(x.y, (k,)), lanes_at(x.u, (k,))
    if m >= 0:
        value, rate = value - lanes_at(work.motions, (m, 0)), rate - lanes_at(work.motions, (m, 1))
    own = dot(shared_vector(system.axes, j, 0), T if kind == REVOLUTE else F)
    add_to(out, k, own + stiffness * value + damping * rate)
