"""Robots on rails: what is left of the equations of motion by coordinates, velocities and accelerations, and the
matrix that their accelerations are solved with.

A rail feels a robot as a wrench; the robot's base goes with the rail: for a base at s(t) that moves by B(s) q,
velocity B q' + s' (B' q + e) and acceleration B q'' + 2 s' B' q' + s'^2 B'' q + s'' (B' q + e), e along the rail
((16), (17) of Hartweg and Heckmann 2012, for all six). The motion has a rotation vector in it, of which the robot takes
the whole rotation; that of the rail's own points beside its axis is first order.
"""

import numpy as np

from engine.kernels.floating.vectors import no_vector, shared_vector, times
from engine.kernels.jit import called, kernel
from engine.kernels.layout import LANES
from engine.kernels.robots.chain import STILL, driven, follow, weigh
from engine.kernels.robots.layout import (
    ACTUAL,
    ACTUAL_TOOL,
    AHEAD,
    BASE,
    BEGUN,
    COLUMNS,
    CUBICS,
    DRIVE,
    EXTRA,
    FIRST,
    GRIP,
    GRIPPED,
    JOINTS,
    LOADED,
    MODES,
    MOVED,
    PAYLOAD,
    PHASE,
    PLANNED,
    PLANNED_TOOL,
    PUSH,
    RATE,
    ROBOT,
    SIXES,
    SOLID,
    TILT,
    TOLD,
    TOOL,
    VALUE,
    VECTORS,
    WHOLE,
    WRENCH,
    Work,
)
from engine.kernels.robots.timing import planned
from engine.kernels.robots.tracks import along_track, push_on, section
from engine.kernels.robots.vectors import keep_vector, rotation, spin_change_of, spin_of
from engine.kernels.vector import all_lanes, lanes_at, put_lanes, total

#: Of the largest inertia of a base: what is added to all, as those are singular along joints that are free (1e-16 is
#: what rounding leaves of them), and of a base without any, kg.
NOTHING, TINY = 1e-12, 1e-30


@kernel
def room(system):
    """Empty arrays for a system."""
    R, J = system.coordinate.shape
    n, N = system.shapes.shape[2], system.tracks[:, MODES].sum()
    return Work(
        np.zeros((R, J, COLUMNS)),
        np.zeros((R, ROBOT)),
        np.zeros((R, 2), dtype=np.int64),
        np.zeros((R, 2, GRIPPED)),
        np.zeros((SIXES, 6)),
        np.zeros((VECTORS, system.springs.shape[0])),
        np.zeros((CUBICS, LANES)),
        np.zeros((MOVED + 6, LANES)),
        np.ones(1),
        np.zeros((R, J, J + 6)),
        np.zeros((R, 2, n, LANES)),
        np.zeros(N),
        np.zeros(6 * R),
        np.zeros((6 * R, 6 * R)),
        np.zeros((6 + J, 6 + J)),
        np.zeros((system.springs.shape[0], system.springs.shape[0])),
    )


@called
def plan_at(system, t, work):
    """What every robot is told at a time, the forces of its drives for that on a rigid base, and where that leads;
    whether any of that is new."""
    new = False
    for r in range(work.robots.shape[0]):
        links, count, which = work.links[r], system.counts[r, JOINTS], PLANNED
        phase = planned(system, r, t, work.doing[r, BEGUN], links)
        if phase > 0 and phase == work.doing[r, PHASE]:
            continue  # it stands as before
        work.doing[r, PHASE], new = phase, True
        push = links[0, PLANNED + PUSH]
        if system.counts[r, WHOLE] == 0:
            which, push = ACTUAL, 0.0
            for j in range(count):
                links[j, ACTUAL + VALUE] = links[j, PLANNED + VALUE]
                links[j, ACTUAL + RATE], links[j, ACTUAL + PUSH] = 0.0, 0.0
        x, y, z = shared_vector(system.robots, r, BASE)
        place, still = (x + links[0, PLANNED + VALUE], y, z), (0.0, 0.0, 0.0)
        base = place, STILL, still, (push, 0.0, system.gravity), still
        tool = shared_vector(system.robots, r, TOOL)
        force, _, end = follow(system.chain[r], count, base, work.robots[r, PAYLOAD], tool, links, which)
        links[0, TOLD] = force[0]
        for j in range(1, count):
            links[j, TOLD] = driven(system.chain[r], j, links, place)
        for k in range(3):
            work.robots[r, PLANNED_TOOL + k] = end[k]
    return new


@called
def ride(system, r, state, work):
    """The base of robot r: place, axes, angular velocity, acceleration less that of gravity, angular acceleration."""
    joint, motions, ahead = work.links[r, 0], work.motions, work.robots[r, AHEAD : AHEAD + 6]
    for o in range(work.six.shape[1]):
        put_lanes(motions, (MOVED + o,), all_lanes(0.0))
    for g in range(2):
        body, share = system.body[r, g], system.share[r, g]
        if body >= 0:
            section(system, body, joint[ACTUAL + VALUE] + share[6, 0], state, work, work.grips[r, g])
            for o in range(work.six.shape[1]):
                own = lanes_at(motions, (MOVED + o,))
                for i in range(work.six.shape[1]):
                    if share[o, i] != 0.0:
                        own = own + share[o, i] * lanes_at(motions, (i,))
                put_lanes(motions, (MOVED + o,), own)
    moved, rate, push = motions[MOVED : MOVED + 6, 0], motions[MOVED : MOVED + 6, 1], motions[MOVED : MOVED + 6, 2]
    speed = joint[ACTUAL + RATE]
    for k in range(work.six.shape[1]):
        own = motions[MOVED + k]
        ahead[k] = own[3] + (k == 0)
        rate[k] += speed * ahead[k]
        push[k] += 2.0 * speed * own[4] + speed * speed * own[5] + joint[ACTUAL + PUSH] * ahead[k]
    x, y, z = shared_vector(system.robots, r, BASE)
    place = (x + joint[ACTUAL + VALUE] + moved[0], y + moved[1], z + moved[2])
    acceleration = (push[0], push[1], push[2] + system.gravity)
    tilt, change = (moved[3], moved[4], moved[5]), (rate[3], rate[4], rate[5])
    keep_vector(work.robots, r, TILT, tilt)
    spin, own = spin_of(tilt, change), spin_change_of(tilt, change, (push[3], push[4], push[5]))
    return place, rotation(tilt), spin, acceleration, own


@called
def evaluate(system, state, work, left):
    """What is left (N) of the equations of motion: inertia less all forces. state (N, 3); after `plan_at`."""
    modes = work.inverse.shape[0]
    for k in range(left.shape[0]):
        left[k] = system.springs[k, 1] * state[k, 1] + system.springs[k, 0] * state[k, 0]
        left[k] += (work.vectors[EXTRA, k] + (k < modes)) * state[k, 2]
    for r in range(work.robots.shape[0]):
        links, robot, count = work.links[r], work.robots[r], system.counts[r, JOINTS]
        for j in range(count):
            k = system.coordinate[r, j]
            for order in range(3):
                links[j, ACTUAL + order] = links[j, PLANNED + order] + (state[k, order] if k >= 0 else 0.0)
        base, tool = ride(system, r, state, work), shared_vector(system.robots, r, TOOL)
        force, moment, end = follow(system.chain[r], count, base, robot[PAYLOAD], tool, links, ACTUAL)
        moment = spin_of(times(-1.0, shared_vector(work.robots, r, TILT)), moment)
        for k in range(3):
            robot[WRENCH + k], robot[WRENCH + 3 + k], robot[ACTUAL_TOOL + k] = force[k], moment[k], end[k]
        for j in range(count):
            if j > 0:
                needed = driven(system.chain[r], j, links, base[0])
            else:
                needed = 0.0
                for k in range(work.six.shape[1]):
                    needed += robot[AHEAD + k] * robot[WRENCH + k]
            k = system.coordinate[r, j]
            links[j, DRIVE] = needed
            if k >= 0:
                links[j, DRIVE] = links[j, TOLD] - left[k] + work.vectors[EXTRA, k] * state[k, 2]
                left[k] += needed - links[j, TOLD]
        load(system, r, work, left)


@called
def load(system, r, work, left):
    """The wrench of robot r on its rails, and added to what is left of their modes."""
    for g in range(2):
        body = system.body[r, g]
        if body >= 0:
            for i in range(work.six.shape[1]):
                total = 0.0
                for o in range(work.six.shape[1]):
                    total += system.share[r, g, o, i] * work.robots[r, WRENCH + o]
                work.grips[r, g, GRIP + i] = total
            push_on(system, body, work.grips[r, g], work, left)


@called
def factorise(matrix, count):
    """Cholesky of a symmetric positive matrix (upper half): its factor L takes the place of the lower half, and L^T
    that of the upper, so that both are read along rows."""
    for k in range(count):
        own = matrix[k]
        own[k] = np.sqrt(own[k])
        by = 1.0 / own[k]
        for j in range(k + 1, count):
            own[j] *= by
            matrix[j, k] = own[j]
        for i in range(k + 1, count):
            row, part = matrix[i], own[i]
            for j in range(i, count):
                row[j] -= part * own[j]


@called
def forward(factors, count, x):
    """x = L^-1 x."""
    for k in range(count):
        row = factors[k]
        part = x[k] / row[k]
        x[k] = part
        for i in range(k + 1, count):
            x[i] -= part * row[i]


@called
def backward(factors, count, x):
    """x = L^-T x."""
    for k in range(count - 1, -1, -1):
        row = factors[k]
        part = x[k] / row[k]
        x[k] = part
        for i in range(k):
            x[i] -= part * row[i]


@called
def prepare(system, of_rate, of_place, work):
    """The matrix M + of_rate C + of_place K where `evaluate` was last: joints are eliminated robot by robot, which
    leaves an inertia of its base. To those of the modes, D, all bases add Q^T Q; what is factorised is 1 + Q D^-1 Q^T,
    six rows a robot, however many modes there are (Woodbury)."""
    found, J = work.inertia, system.coordinate.shape[1]
    for k in range(work.inverse.shape[0]):
        own = 1.0 + work.vectors[EXTRA, k] + of_rate * system.springs[k, 1] + of_place * system.springs[k, 0]
        work.inverse[k] = 1.0 / own
    for i in range(work.between.shape[0]):
        for o in range(i, work.between.shape[0]):
            work.between[i, o] = 1.0 * (i == o)
    for r in range(work.robots.shape[0]):
        lower, robot, joints = work.lower[r], work.robots[r], system.counts[r, JOINTS]
        solid, tool = work.six[SOLID:SIXES].reshape(12), shared_vector(system.robots, r, TOOL)
        weigh(system.chain[r], joints, robot, tool, work.links[r], found, solid)
        count, largest = 0, TINY
        for i in range(work.six.shape[1]):
            largest = max(largest, found[i, i])
        for j in range(joints):
            k = system.coordinate[r, j]
            if k < 0:
                continue
            own = 0
            for i in range(j + 1):
                if system.coordinate[r, i] >= 0:
                    lower[own, count] = found[6 + i, 6 + j]
                    own += 1
            lower[count, count] += of_rate * system.springs[k, 1] + of_place * system.springs[k, 0]
            lower[count, count] += work.vectors[EXTRA, k]
            for i in range(work.six.shape[1]):
                lower[count, J + i] = found[i, 6 + j]
            count += 1
        factorise(lower, count)
        for i in range(work.six.shape[1]):
            forward(lower, count, lower[:, J + i])
        for i in range(work.six.shape[1]):
            found[i, i] += NOTHING * largest
            for o in range(work.six.shape[1]):
                for c in range(count):
                    found[i, o] -= lower[c, J + i] * lower[c, J + o]
        factorise(found, 6)
        for c in range(count):
            forward(found, 6, lower[c, J:])
        add_base(system, r, found, work)
    factorise(work.between, work.between.shape[0])


@called
def add_base(system, r, factors, work):
    """Q of the base of robot r, by factors (6, 6) of its inertia, and what it adds to the matrix of bases."""
    for g in range(2):
        body = system.body[r, g]
        if body < 0:
            continue
        for i in range(work.six.shape[1]):
            for o in range(work.six.shape[1]):
                part = 0.0
                for c in range(o, work.six.shape[1]):
                    part += factors[o, c] * system.share[r, g, c, i]
                work.motions[i, o] = part
            for o in range(work.six.shape[1], LANES):
                work.motions[i, o] = 0.0
        for k in range(system.tracks[body, MODES]):
            own = all_lanes(0.0)
            for i in range(work.six.shape[1]):
                own = own + along_track(system, body, work.grips[r, g], i, k) * lanes_at(work.motions, (i,))
            put_lanes(work.bases, (r, g, k), own)
        for p in range(r + 1):
            for h in range(2):
                if system.body[p, h] == body and (p < r or h == g):
                    add_between(system, (p, h), (r, g), work)


@called
def add_between(system, one, other, work):
    """Q D^-1 Q^T of two bases on the same body, added to the rows of the first."""
    (p, h), (r, g) = one, other
    body = system.body[r, g]
    first = system.tracks[body, FIRST]
    for half in (0, 3):
        sums = no_vector()
        for k in range(system.tracks[body, MODES]):
            own = work.inverse[first + k] * lanes_at(work.bases, (r, g, k))
            a, b, c = work.bases[p, h, k, half], work.bases[p, h, k, half + 1], work.bases[p, h, k, half + 2]
            sums = sums[0] + a * own, sums[1] + b * own, sums[2] + c * own
        for i in range(3):
            put_lanes(work.cubics, (LOADED,), sums[i])
            for o in range(work.six.shape[1]):
                work.between[6 * p + half + i, 6 * r + o] += work.cubics[LOADED, o]


@called
def solve(system, work, x):
    """x (N) becomes the solution for a right-hand side x of the matrix of `prepare`."""
    modes, J, pushed = work.inverse.shape[0], system.coordinate.shape[1], work.pushed
    first = modes
    for r in range(work.robots.shape[0]):
        count, lower = compliant(system, r), work.lower[r]
        forward(lower, count, x[first:])
        first += count
    for k in range(modes):
        x[k] *= work.inverse[k]
    first = modes
    for r in range(work.robots.shape[0]):
        count, lower = compliant(system, r), work.lower[r]
        along_base(system, r, x, work)
        for i in range(work.six.shape[1]):
            part = 0.0
            for c in range(count):
                part += lower[c, J + i] * x[first + c]
            pushed[6 * r + i] += part
        first += count
    forward(work.between, pushed.shape[0], pushed)
    backward(work.between, pushed.shape[0], pushed)
    for r in range(work.robots.shape[0]):
        take_off(system, r, x, work)
    first = modes
    for r in range(work.robots.shape[0]):
        count, lower = compliant(system, r), work.lower[r]
        along_base(system, r, x, work)
        for i in range(work.six.shape[1]):
            for c in range(count):
                x[first + c] -= lower[c, J + i] * pushed[6 * r + i]
        backward(lower, count, x[first:])
        first += count


@called
def along_base(system, r, x, work):
    """Q x, the six motions of the base of robot r by x of the modes, into ``pushed``."""
    found = all_lanes(0.0)
    for g in range(2):
        body = system.body[r, g]
        if body >= 0:
            for k in range(system.tracks[body, MODES]):
                found = found + x[system.tracks[body, FIRST] + k] * lanes_at(work.bases, (r, g, k))
    put_lanes(work.cubics, (LOADED,), found)
    for o in range(work.six.shape[1]):
        work.pushed[6 * r + o] = work.cubics[LOADED, o]


@called
def take_off(system, r, x, work):
    """x -= D^-1 Q^T of what pushes the base of robot r."""
    for o in range(work.six.shape[1]):
        work.cubics[LOADED, o] = work.pushed[6 * r + o]
    push = lanes_at(work.cubics, (LOADED,))
    for g in range(2):
        body = system.body[r, g]
        if body >= 0:
            first = system.tracks[body, FIRST]
            for k in range(system.tracks[body, MODES]):
                x[first + k] -= work.inverse[first + k] * total(push * lanes_at(work.bases, (r, g, k)))


@called
def compliant(system, r):
    """How many joints of robot r have coordinates; these stand in a row, robot by robot."""
    count = 0
    for j in range(system.counts[r, JOINTS]):
        count += system.coordinate[r, j] >= 0
    return count
