"""Inertia, elastic and damping forces of bodies, (6)-(9) of Hartweg and Heckmann (2012)."""

from engine.kernels.floating.layout import (
    FIRST,
    FIRST_ORDER,
    MASS,
    MODAL_MASS,
    MODES,
    MOMENT,
    NEARING,
    NEARING_MOMENT,
    SECOND,
    SECOND_ORDER,
    SHORTENED,
    STIFFNESS,
    TRANSLATION,
)
from engine.kernels.floating.tracks import combined
from engine.kernels.floating.vectors import (
    add,
    axial,
    cross,
    dot,
    keep_matrix,
    keep_vector,
    matrix,
    no_vector,
    shared_matrix,
    shared_vector,
    times,
    turned_in,
    turned_out,
    vector,
)
from engine.kernels.floating.work import ACCELERATION, ANGULAR, FORCE, SPIN, TORQUE, add_to
from engine.kernels.jit import called
from engine.kernels.vector import all_lanes, lanes_at


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
    square, turning = dot(w, w), turned_by(w, al)
    r = dot(shared_vector(system.modes, row, TRANSLATION), acc) + dot(axial(H), al) + dot(w, turned_out(H, w))
    r = r + lanes_at(lane.damping, (row,)) * lanes_at(x.u, (first + i,)) - (H[0][0] + H[1][1] + H[2][2]) * square
    for j in range(n):
        B = shared_matrix(system.pairs, (b * widest + j) * widest + i, SECOND_ORDER)
        r = r + 2.0 * dot(w, axial(B)) * lanes_at(x.u, (first + j,))
        r = r + (B[0][0] + B[1][1] + B[2][2]) * lanes_at(x.a, (first + j,))
        pair = row * widest + j
        stiffness = all_lanes(system.pairs[pair, STIFFNESS])
        if system.tree[b, SHORTENED]:
            stiffness = stiffness - pulled(system, b, pair, acc) - turned_nearer(system, b, pair, turning)
        r = r + stiffness * lanes_at(x.y, (first + j,))
    add_to(out, first + i, r)


@called
def turned_by(w, al):
    """[al]x + [w]x [w]x, as rows: the acceleration of places of a frame by its rotation is that times the places."""
    square = dot(w, w)
    return (
        (w[0] * w[0] - square, w[0] * w[1] - al[2], w[0] * w[2] + al[1]),
        (w[1] * w[0] + al[2], w[1] * w[1] - square, w[1] * w[2] - al[0]),
        (w[2] * w[0] - al[1], w[2] * w[1] + al[0], w[2] * w[2] - square),
    )


@called
def pulled(system, b, pair, acc):
    """int G dm of a pair of modes times the acceleration of their body."""
    found = system.pairs[pair, NEARING] * acc[0]
    if system.tree[b, SHORTENED] > 1:
        found = found + system.pairs[pair, NEARING + 1] * acc[1] + system.pairs[pair, NEARING + 2] * acc[2]
    return found


@called
def turned_nearer(system, b, pair, turning):
    """int G_a c_b dm times what accelerates places by rotation, as of `turned_by`."""
    found = system.pairs[pair, NEARING_MOMENT] * turning[0][0]
    if system.tree[b, SHORTENED] > 1:
        moment = shared_matrix(system.pairs, pair, NEARING_MOMENT)
        found = found + moment[0][1] * turning[0][1] + moment[0][2] * turning[0][2]
        found = found + dot(moment[1], turning[1]) + dot(moment[2], turning[2])
    return found


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
            stiffness = all_lanes(system.pairs[pair, STIFFNESS])
            if system.tree[b, SHORTENED]:
                stiffness = stiffness - pulled(system, b, pair, acc)
            r = r + stiffness * lanes_at(x.y, (first + j,))
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
