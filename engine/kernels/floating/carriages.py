"""Carriages that slide on deformed tracks and their forces, (10)-(21) of Hartweg and Heckmann (2012)."""

from engine.kernels.floating.following import given_or_free
from engine.kernels.floating.layout import (
    COULOMB,
    DAMPER,
    DRIVE,
    FIRST,
    HEIGHT,
    INERTIA,
    MISSED_BODY,
    MISSED_SPUN,
    MISSED_TURNING,
    MISSED_UNIFORM,
    MODES,
    ONE,
    ORIGIN,
    OTHER,
    OWN_MASS,
    PLACE_COORDINATE,
    PLACE_MOTION,
    RESTS,
    RIDDEN,
    SHORTER,
    SLIP,
    SPRING,
    SPRUNG_COORDINATE,
    SPRUNG_MASS,
    VISCOUS,
)
from engine.kernels.floating.tracks import (
    CURVE,
    SHAPE,
    SLOPE,
    TURN,
    TURN_CURVE,
    TURN_SLOPE,
    combined_there,
    missed_line,
    pulled_nearer,
    shapes_at,
)
from engine.kernels.floating.vectors import (
    add,
    add_vector,
    cross,
    dot,
    keep_vector,
    no_vector,
    rotation,
    shared_vector,
    spin_change_of,
    spin_of,
    times,
    turned_in,
    turned_out,
    vector,
)
from engine.kernels.floating.work import ACCELERATION, ANGULAR, CONTACT, FORCE, SPIN, TORQUE, TOUCHED, add_to
from engine.kernels.jit import called
from engine.kernels.sines import hyperbolic_tangent
from engine.kernels.vector import all_lanes, choose, everywhere, lanes_at, root


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
    push_modes(system, b, x, work, (f, pull_along(system, lane, c, along, work)), out)
    if turns:
        turn_modes(system, c, x, work, about, out)


@called
def push_frame(work, b, d, f):
    """A force that a frame needs besides at a place of it."""
    add_vector(work.frames, b, FORCE, f)
    add_vector(work.frames, b, TORQUE, cross(d, f))


@called
def pull_along(system, lane, c, along, work):
    """The force that a carriage needs on an undeformed body, which stiffens the bent one: products of deflections are
    left out with what the shortening adds to its acceleration, which would balance them."""
    b, (s, ds, dds) = system.riders[c, RIDDEN], along
    origin, zero, height = shared_vector(system.bodies, b, ORIGIN), all_lanes(0.0), carried(lane, c, HEIGHT)
    own, sprung = carried(lane, c, OWN_MASS), carried(lane, c, SPRUNG_MASS)
    d, rate, change = (s + origin[0], zero + origin[1], zero + origin[2]), (ds, zero, zero), (dds, zero, zero)
    below = acceleration_at(system, work, b, (d[0], d[1], d[2] + height), rate, change)
    return add(times(own, below), times(sprung, acceleration_at(system, work, b, d, rate, change)))


@called
def push_modes(system, b, x, work, forces, out):
    """A force of a carriage on the modes at its place; where that comes nearer as the body bends, what pulls at the
    undeformed one through that too."""
    first, (f, pull) = system.tree[b, FIRST], forces
    for i in range(system.tree[b, MODES]):
        add_to(out, first + i, dot(vector(work.modes, i, SHAPE), f))
    for k in range(system.shortening.shape[0]):
        if system.shortening[k, SHORTER] == b:
            i, j = first + system.shortening[k, ONE], first + system.shortening[k, OTHER]
            pulled = -1.0 * pulled_nearer(system, k, pull, work)
            add_to(out, i, pulled * lanes_at(x.y, (j,)))
            if i != j:
                add_to(out, j, pulled * lanes_at(x.y, (i,)))


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
def missed_section(system, k, x, work):
    """What the modes of a body miss of a section force: by its carriages' forces across the track, and by its own
    inertia and weight as its frame moves, which at a place x of the track accelerates by a_z + x (w_x w_z - al_y)."""
    b = system.missed_sections[k, MISSED_BODY]
    found = -1.0 * system.missed[k, MISSED_UNIFORM] * vector(work.frames, b, ACCELERATION)[2]
    if not system.tree[b, RESTS]:
        w, al = vector(work.frames, b, SPIN), vector(work.frames, b, ANGULAR)
        found = found - system.missed[k, MISSED_TURNING] * al[1] - system.missed[k, MISSED_SPUN] * w[0] * w[2]
    for c in range(system.riders.shape[0]):
        if system.riders[c, RIDDEN] == b:
            s, _, _ = ridden(system, c, x, work)
            found = found - lanes_at(work.contacts, (c, CONTACT + 2)) * missed_line(system, k, s, work.gathered)
    return found


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
