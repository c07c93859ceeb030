"""The equations of motion of bodies whose frames move, as what is left of them by coordinates, velocities and
accelerations: inertia less all forces, per coordinate (virtual power, (8) of Hartweg and Heckmann 2012).

Frames are followed from the ground outward, forces gathered back inward (recursive Newton-Euler with elastic bodies).
Gravity is an acceleration of the ground upward.
"""

from engine.kernels.floating.bodies import body_forces, modal_forces
from engine.kernels.floating.carriages import carriage_forces
from engine.kernels.floating.following import follow_frame
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
    PRISMATIC,
    RESTS,
    SHORTENED,
    SPHERICAL,
    TURNED,
)
from engine.kernels.floating.loads import link_forces, load_forces
from engine.kernels.floating.tracks import shorter_by, span_of
from engine.kernels.floating.vectors import (
    add,
    add_vector,
    cross,
    dot,
    matrix,
    shared_matrix,
    shared_vector,
    spin_of,
    turned_out,
    vector,
)
from engine.kernels.floating.work import (
    FORCE,
    HANGING,
    HANGING_PLACE,
    HANGING_TURNED,
    JOINT_DRIVE,
    JOINT_SHIFT,
    JOINT_TURNED,
    TORQUE,
    add_to,
)
from engine.kernels.jit import called
from engine.kernels.vector import all_lanes, lanes_at, put_lanes


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
def gather(system, lane, b, x, work, out):
    """What a body needs goes through its joints, last to first, to the modes and the frame of its parent."""
    F, T = vector(work.frames, b, FORCE), vector(work.frames, b, TORQUE)
    for j in range(system.tree[b, END_JOINT] - 1, system.tree[b, FIRST_JOINT] - 1, -1):
        k, kind = system.joint_table[j, COORDINATE], system.joint_table[j, KIND]
        own = dot(shared_vector(system.axes, j, 0), F if kind == PRISMATIC else T)
        put_lanes(work.joints, (j, JOINT_DRIVE), own)
        if k >= 0:
            joint_forces(system, lane, j, x, work, (own, T), out)
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
            if system.tree[p, SHORTENED]:
                add_to(out, first + i, -1.0 * shorter_by(system.hanging_shorter, b, span_of(system, p), i, x.y, F))
    add_vector(work.frames, p, FORCE, F)
    add_vector(work.frames, p, TORQUE, add(T, cross(vector(work.frames, b, HANGING_PLACE), F)))


@called
def joint_forces(system, lane, j, x, work, wrench, out):
    """What the coordinates of a joint need of the force or torque about its axis and of all three behind it, and its
    spring and damper about 0 or about a motion."""
    own, T = wrench
    k, kind, m = system.joint_table[j, COORDINATE], system.joint_table[j, KIND], system.joint_table[j, MOTION]
    stiffness, damping = lanes_at(lane.joints, (j, 0)), lanes_at(lane.joints, (j, 1))
    if kind == SPHERICAL:
        for i in range(3):
            add_to(out, k + i, T[i] + damping * lanes_at(x.u, (k + i,)))
        return
    value, rate = lanes_at(x.y, (k,)), lanes_at(x.u, (k,))
    if m >= 0:
        value, rate = value - lanes_at(work.motions, (m, 0)), rate - lanes_at(work.motions, (m, 1))
    add_to(out, k, own + stiffness * value + damping * rate)
