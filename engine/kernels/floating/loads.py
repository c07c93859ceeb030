"""Loads on bodies whose frames move, and springs between two of their places, in the equations of motion.

A grip is a place of a body, or several that share what acts by weights w_s: sum w_s (d_s, phi_i(d_s)) are what a force
needs, a torque has one place.
"""

from engine.kernels.floating.layout import (
    ARM,
    COURSE,
    FIRST,
    GRIP,
    IN_BODY,
    MISSED_BODY,
    MODES,
    PUSHED,
    SHORTENED,
    TWISTED,
    WEIGHT,
)
from engine.kernels.floating.tracks import combined, nearer, shorter_by, span_of
from engine.kernels.floating.vectors import (
    add,
    add_vector,
    cross,
    dot,
    matrix,
    no_vector,
    shared_vector,
    spin_of,
    times,
    turned_in,
    turned_out,
    vector,
)
from engine.kernels.floating.work import ATTITUDE, FORCE, POSITION, SPIN, TORQUE, VELOCITY, add_to
from engine.kernels.jit import called
from engine.kernels.vector import all_lanes, choose, lanes_at, root


@called
def load_forces(system, lane, q, x, work, out):
    """A force and a torque at a grip, as they are at this time."""
    p = system.load_table[q, GRIP]
    f, about = load_at(system, lane, q, work)
    push(system, p, f, x, work, out)
    twist(system, p, about, x, work, out)


@called
def load_at(system, lane, q, work):
    """The force and the torque of a load as they are at this time, in the axes of its body."""
    p, m = system.load_table[q, GRIP], system.load_table[q, COURSE]
    f, about = vector(lane.loads, q, 0), vector(lane.loads, q, 3)
    if not system.load_table[q, IN_BODY]:
        E = matrix(work.frames, system.gripped[p], ATTITUDE)
        f, about = turned_in(E, f), turned_in(E, about)
    if m >= 0:
        factor = lanes_at(work.motions, (m, 0))
        f, about = times(factor, f), times(factor, about)
    return f, about


@called
def push(system, p, f, x, work, out):
    """A force from outside at a grip, in the axes of its body."""
    b, widest = system.gripped[p], system.track.shape[4]
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    add_vector(work.frames, b, FORCE, times(-system.grips[p, WEIGHT], f))
    add_vector(work.frames, b, TORQUE, times(-1.0, cross(arm(system, p, x), f)))
    for i in range(n):
        r = dot(shared_vector(system.grip_modes, p * widest + i, PUSHED), f)
        if system.tree[b, SHORTENED]:
            r = r - shorter_by(system.grip_shorter, p, span_of(system, b), i, x.y, f)
        add_to(out, first + i, -1.0 * r)


@called
def twist(system, p, about, x, work, out):
    """A torque from outside at a grip, in the axes of its body."""
    b, row, weight = system.gripped[p], p * system.track.shape[4], system.grips[p, WEIGHT]
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    add_vector(work.frames, b, TORQUE, times(-weight, about))
    t = combined(system.grip_modes, row, TWISTED, n, x.y, first)
    for i in range(n):
        turning = spin_of(t, shared_vector(system.grip_modes, row + i, TWISTED))
        add_to(out, first + i, -weight * dot(turning, about))


@called
def arm(system, p, x):
    """Place of a grip in the frame of its body, times its weight."""
    b, row = system.gripped[p], p * system.track.shape[4]
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    d = add(combined(system.grip_modes, row, PUSHED, n, x.y, first), shared_vector(system.grips, p, ARM))
    if system.tree[b, SHORTENED]:
        d = add(d, times(-0.5, nearer(system.grip_shorter, p, span_of(system, b), x.y, x.y)))
    return d


@called
def link_forces(system, lane, k, x, work, out):
    """A spring and a damper between two grips, along the line between them."""
    for end in range(2):
        p = system.links[k, end]
        if system.gripped[p] >= 0:
            push(system, p, pull_at(system, lane, k, end, x, work), x, work, out)


@called
def pull_at(system, lane, k, end, x, work):
    """The force of a spring and its damper on the body at one of its ends, in the axes of that."""
    d, e, drift = between(system, k, x, work)
    length = root(dot(d, d))
    pull = lanes_at(lane.links, (k, 0)) * (length - lanes_at(lane.links, (k, 2)))
    f = times(pull + lanes_at(lane.links, (k, 1)) * dot(e, drift), e)
    own = turned_in(matrix(work.frames, system.gripped[system.links[k, end]], ATTITUDE), f)
    return own if end == 0 else times(-1.0, own)


@called
def missed_by_loads(system, lane, k, x, work):
    """What the modes of a body miss of a section force by loads and by springs across its track."""
    b, found = system.missed_sections[k, MISSED_BODY], all_lanes(0.0)
    for q in range(system.load_table.shape[0]):
        p = system.load_table[q, GRIP]
        if system.gripped[p] == b:
            f, about = load_at(system, lane, q, work)
            found = found + system.missed_grips[k, p] * f[2] + system.missed_twists[k, p] * about[1]
    for one in range(system.links.shape[0]):
        for end in range(2):
            p = system.links[one, end]
            if system.gripped[p] == b:
                found = found + system.missed_grips[k, p] * pull_at(system, lane, one, end, x, work)[2]
    return found


@called
def between(system, k, x, work):
    """From one end of a spring to the other: the way over the ground, its direction, and the rate of the way."""
    r, v = over_ground_at(system, system.links[k, 0], x, work)
    s, w = over_ground_at(system, system.links[k, 1], x, work)
    d, drift = add(s, times(-1.0, r)), add(w, times(-1.0, v))
    length = root(dot(d, d))
    return d, times(1.0 / choose(length > 0.0, length, 1.0), d), drift


@called
def over_ground_at(system, p, x, work):
    """Place and velocity of a grip of one place over the ground."""
    b, row = system.gripped[p], p * system.track.shape[4]
    if b < 0:
        return add(no_vector(), shared_vector(system.grips, p, ARM)), no_vector()
    n, first = system.tree[b, MODES], system.tree[b, FIRST]
    d, rate = arm(system, p, x), combined(system.grip_modes, row, PUSHED, n, x.u, first)
    if system.tree[b, SHORTENED]:
        rate = add(rate, times(-1.0, nearer(system.grip_shorter, p, span_of(system, b), x.y, x.u)))
    v = add(vector(work.frames, b, VELOCITY), add(cross(vector(work.frames, b, SPIN), d), rate))
    E = matrix(work.frames, b, ATTITUDE)
    return add(vector(work.frames, b, POSITION), turned_out(E, d)), turned_out(E, v)
