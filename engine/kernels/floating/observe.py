"""What is observed of a lane at a station: readings of sensors, carriages, points, frames, energy and momentum."""

import numpy as np

from engine.kernels.floating.equations import (
    ATTITUDE,
    CONTACT,
    POSITION,
    SPIN,
    VELOCITY,
    carriage_acceleration,
    has_attitude,
    inertia_times,
    ridden,
    second_moments,
)
from engine.kernels.floating.layout import (
    COORDINATE,
    FIRST,
    HEIGHT,
    MASS,
    MODES,
    MOMENT,
    MOTION,
    ORIGIN,
    OWN_MASS,
    RIDDEN,
    SECOND_ORDER,
    SPRING,
    SPRUNG_COORDINATE,
    SPRUNG_MASS,
    STIFFNESS,
    TRANSLATION,
)
from engine.kernels.floating.tracks import SHAPE, SLOPE, TURN, TURN_SLOPE, combined, shapes_at
from engine.kernels.floating.vectors import (
    add,
    axial,
    cross,
    dot,
    matrix,
    rotation,
    spin_of,
    times,
    turned_in,
    turned_out,
    vector,
)
from engine.kernels.jit import called

#: Signals of a carriage: place, speed and acceleration along its track; its acceleration resolved in the frame of its
#: body (3); the contact force, positive where it presses along z; place of its sprung mass. Of a point: place (3). Of a
#: body: place (3), attitude as a quaternion (4), velocity over the ground (3), spin in its frame (3). Of the whole:
#: kinetic and potential energy, momentum (3) and angular momentum (3) about the ground's origin.
OF_CARRIAGE, OF_POINT, OF_BODY, OF_WHOLE = 8, 3, 13, 8
CONTACT_FORCE = 6  # of a carriage's


@called
def observe(system, lane, x, work, out):
    """Signals of a lane whose frames are followed and whose contact forces are known: of sensors, carriages and points.
    Returns how many."""
    first = system.read_under.shape[0]
    sensors(system, x, work, out)
    for c in range(system.riders.shape[0]):
        carriage(system, lane, c, x, work, out[first:])
        first += OF_CARRIAGE
    for p in range(system.pointed.size):
        b = system.pointed[p]
        d = vector(system.points, p, 0)
        for i in range(system.tree[b, MODES]):
            d = add(d, times(x.y[system.tree[b, FIRST] + i], vector(system.points, p, 3 + 3 * i)))
        keep(out, first, over_ground(work.frames, b, d))
        first += OF_POINT
    return first


@called
def observe_whole(system, lane, x, work, out):
    """The signals behind those: of bodies and of the whole."""
    bodies = system.tree.shape[0]
    for b in range(bodies):
        frame(work.frames, b, out[OF_BODY * b :])
    whole(system, lane, x, work, out[OF_BODY * bodies :])


@called
def keep(out, k, a):
    """A vector becomes three signals."""
    out[k], out[k + 1], out[k + 2] = a[0], a[1], a[2]


@called
def over_ground(frames, b, d):
    """Where a place of a frame is."""
    return add(vector(frames, b, POSITION), turned_out(matrix(frames, b, ATTITUDE), d))


@called
def sensors(system, x, work, out):
    """Readings: linear in the coordinates at a place; under a carriage the displacement there."""
    for r in range(system.read_under.shape[0]):
        c = system.read_under[r, 0]
        out[r] = 0.0
        if c < 0:
            rate = system.read_under[r, 2]
            for k in range(x.y.size):
                out[r] += system.readings[r, k] * (x.y[k] if rate == 0 else x.u[k] if rate == 1 else x.a[k])
        else:
            b = system.riders[c, RIDDEN]
            shapes_at(system, b, ridden(system, c, x, work)[0], system.tree[b, MODES], 3, work.modes)
            moved = combined(work.modes, 0, SHAPE, system.tree[b, MODES], x.y, system.tree[b, FIRST])
            out[r] = moved[system.read_under[r, 1]]


@called
def carriage(system, lane, c, x, work, out):
    """Signals of a carriage, the first OF_CARRIAGE of out."""
    b, z = system.riders[c, RIDDEN], system.riders[c, SPRUNG_COORDINATE]
    g = lane.gravity
    weight = turned_in(matrix(work.frames, b, ATTITUDE), (g[0], g[1], g[2]))
    keep(out, 0, ridden(system, c, x, work))
    keep(out, 3, add(carriage_acceleration(system, c, x, work), weight))
    out[CONTACT_FORCE] = -work.contacts[c, CONTACT + 2]
    out[7] = x.y[z] if z >= 0 else 0.0


@called
def frame(frames, b, out):
    """Signals of a body, the first OF_BODY of out."""
    E = matrix(frames, b, ATTITUDE)
    keep(out, 0, vector(frames, b, POSITION))
    out[3], out[4], out[5], out[6] = quaternion(E)
    keep(out, 7, turned_out(E, vector(frames, b, VELOCITY)))
    keep(out, 10, vector(frames, b, SPIN))


@called
def quaternion(E):
    """Scalar first and not negative; from the largest component, as no division by a small one may happen."""
    trace = E[0][0] + E[1][1] + E[2][2]
    best, largest = 0, trace
    for i in range(3):
        if E[i][i] > largest:
            best, largest = i + 1, E[i][i]
    r = np.sqrt(max(1.0 + 2.0 * largest - trace, 0.0))
    k = 0.5 / r
    if best == 0:
        return 0.5 * r, k * (E[2][1] - E[1][2]), k * (E[0][2] - E[2][0]), k * (E[1][0] - E[0][1])
    if best == 1:
        w, x, y, z = k * (E[2][1] - E[1][2]), 0.5 * r, k * (E[0][1] + E[1][0]), k * (E[0][2] + E[2][0])
    elif best == 2:
        w, x, y, z = k * (E[0][2] - E[2][0]), k * (E[0][1] + E[1][0]), 0.5 * r, k * (E[1][2] + E[2][1])
    else:
        w, x, y, z = k * (E[1][0] - E[0][1]), k * (E[0][2] + E[2][0]), k * (E[1][2] + E[2][1]), 0.5 * r
    sign = 1.0 if w >= 0.0 else -1.0
    return sign * w, sign * x, sign * y, sign * z


@called
def whole(system, lane, x, work, out):
    """Energies and momenta of everything that moves, the first OF_WHOLE of out; forces that are given do work that is
    not in them."""
    for k in range(OF_WHOLE):
        out[k] = 0.0
    for b in range(system.tree.shape[0]):
        of_body(system, lane, b, x, work, out)
    for c in range(system.riders.shape[0]):
        of_carriage(system, lane, c, x, work, out)
    for j in range(system.axes.shape[0]):
        k, m = system.joint_table[j, COORDINATE], system.joint_table[j, MOTION]
        if k >= 0:
            value = x.y[k] if m < 0 else x.y[k] - work.motions[m, 0]
            out[1] += 0.5 * lane.joints[j, 0] * value * value


@called
def of_body(system, lane, b, x, work, out):
    """Adds energies, J, momentum and angular momentum of a body."""
    n, q, widest = system.tree[b, MODES], system.tree[b, FIRST], system.track.shape[4]
    v, w = vector(work.frames, b, VELOCITY), vector(work.frames, b, SPIN)
    S = add(combined(system.modes, b * widest, TRANSLATION, n, x.y, q), vector(system.bodies, b, MOMENT))
    drift = combined(system.modes, b * widest, TRANSLATION, n, x.u, q)
    P = second_moments(system, b, x, work)
    Jw = add(times(P[0][0] + P[1][1] + P[2][2], w), times(-1.0, turned_out(P, w)))
    inner, deformation, own = (0.0, 0.0, 0.0), 0.0, 0.0
    for i in range(n):
        inner = add(inner, times(x.u[q + i], axial(matrix(work.moments, i, 0))))
        for j in range(n):
            pair = (b * widest + i) * widest + j
            B = matrix(system.pairs, pair, SECOND_ORDER)
            own += 0.5 * x.u[q + i] * x.u[q + j] * (B[0][0] + B[1][1] + B[2][2])
            deformation += 0.5 * x.y[q + i] * x.y[q + j] * system.pairs[pair, STIFFNESS]
    m = system.bodies[b, MASS]
    kinetic = own + 0.5 * m * dot(v, v) + dot(v, add(cross(w, S), drift)) + 0.5 * dot(w, Jw) + dot(w, inner)
    momentum = add(times(m, v), add(cross(w, S), drift))
    place = matrix(work.frames, b, ATTITUDE)
    r, p = vector(work.frames, b, POSITION), turned_out(place, momentum)
    turning = turned_out(place, add(cross(S, v), add(Jw, inner)))
    height = falling(lane, add(times(m, r), turned_out(place, S)))
    include(out, kinetic, deformation - height, p, add(cross(r, p), turning))


@called
def falling(lane, moment):
    """Gravity times a mass's moment (kg m) over the ground: the energy that it has lost by falling, J."""
    return lane.gravity[0] * moment[0] + lane.gravity[1] * moment[1] + lane.gravity[2] * moment[2]


@called
def include(out, kinetic, potential, momentum, angular):
    """Adds a part's energies, momentum and angular momentum to the whole's."""
    out[0] += kinetic
    out[1] += potential
    for i in range(3):
        out[2 + i] += momentum[i]
        out[5 + i] += angular[i]


@called
def of_carriage(system, lane, c, x, work, out):
    """Adds energies and momenta of a carriage and of what it carries on its spring."""
    b, z, at = system.riders[c, RIDDEN], system.riders[c, SPRUNG_COORDINATE], work.modes
    n, q = system.tree[b, MODES], system.tree[b, FIRST]
    s, ds, _ = ridden(system, c, x, work)
    turns = has_attitude(lane, c)
    shapes_at(system, b, s, n, 6 if turns else 3, at)
    along = combined(at, 0, SLOPE, n, x.y, q)
    d = add(add(vector(system.bodies, b, ORIGIN), (s, 0.0, 0.0)), combined(at, 0, SHAPE, n, x.y, q))
    rate = add(combined(at, 0, SHAPE, n, x.u, q), times(ds, (1.0 + along[0], along[1], along[2])))
    arm, swing = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if turns:
        t = combined(at, 0, TURN, n, x.y, q)
        own = spin_of(t, add(combined(at, 0, TURN, n, x.u, q), times(ds, combined(at, 0, TURN_SLOPE, n, x.y, q))))
        E = rotation(t)
        w, arm = add(vector(work.frames, b, SPIN), own), turned_out(E, (0.0, 0.0, lane.carriages[c, HEIGHT]))
        swing, momentum = cross(own, arm), inertia_times(E, lane, c, w)
        turning = turned_out(matrix(work.frames, b, ATTITUDE), momentum)
        include(out, 0.5 * dot(w, momentum), 0.0, (0.0, 0.0, 0.0), turning)
    of_mass(lane, b, lane.carriages[c, OWN_MASS], add(d, arm), add(rate, swing), work, out)
    if z >= 0:
        up, rising = add(d, (0.0, 0.0, x.y[z])), add(rate, (0.0, 0.0, x.u[z]))
        of_mass(lane, b, lane.carriages[c, SPRUNG_MASS], up, rising, work, out)
        out[1] += 0.5 * lane.carriages[c, SPRING] * x.y[z] * x.y[z]


@called
def of_mass(lane, b, mass, d, rate, work, out):
    """A mass at a place d of a frame that moves in it."""
    moving = add(vector(work.frames, b, VELOCITY), add(cross(vector(work.frames, b, SPIN), d), rate))
    velocity = turned_out(matrix(work.frames, b, ATTITUDE), moving)
    r, p = over_ground(work.frames, b, d), times(mass, velocity)
    include(out, 0.5 * mass * dot(velocity, velocity), -falling(lane, times(mass, r)), p, cross(r, p))
