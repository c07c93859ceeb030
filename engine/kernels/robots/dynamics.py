"""Robots on rails: what is left of the equations of motion by coordinates, velocities and accelerations, and the
matrix that their accelerations are solved with.

A rail feels a robot as a wrench; the robot's base goes with the rail: for a base at s(t) that moves by B(s) q,
velocity B q' + s' (B' q + e) and acceleration B q'' + 2 s' B' q' + s'^2 B'' q + s'' (B' q + e), e along the rail
((16), (17) of Hartweg and Heckmann 2012, for all six). Rotations of rails are small; those of robots are not.
"""

import numpy as np

from engine.kernels.floating.vectors import shared_vector
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
    TOLD,
    TOOL,
    TOTALS,
    VALUE,
    VECTORS,
    WHOLE,
    WRENCH,
    Work,
)
from engine.kernels.robots.timing import planned
from engine.kernels.robots.tracks import along_track, push_on, section
from engine.kernels.robots.vectors import rotation
from engine.kernels.vector import all_lanes, lanes_at, put_lanes


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
        np.zeros((R, 2, 6, n)),
        np.zeros((6, n)),
        np.zeros((N, N)),
        np.zeros((6 + J, 6 + J)),
    )


@called
def plan_at(system, t, work):
    """What every robot is told at a time, the forces of its drives for that on a rigid base, and where that leads."""
    for r in range(work.robots.shape[0]):
        links, count, which = work.links[r], system.counts[r, JOINTS], PLANNED
        phase = planned(system, r, t, work.doing[r, BEGUN], links)
        if phase > 0 and phase == work.doing[r, PHASE]:
            continue  # it stands as before
        work.doing[r, PHASE] = phase
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
    turn = rotation((moved[3], moved[4], moved[5]))
    return place, turn, (rate[3], rate[4], rate[5]), acceleration, (push[3], push[4], push[5])


@called
def evaluate(system, state, work, left):
    """What is left (N) of the equations of motion: inertia less all forces. state (N, 3); after `plan_at`."""
    modes = work.elastic.shape[0]
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
    leaves an inertia of its base; with these the matrix of the rails' modes is factorised."""
    elastic, found, J = work.elastic, work.inertia, system.coordinate.shape[1]
    N = elastic.shape[0]
    for k in range(N):
        for m in range(k, N):
            elastic[k, m] = 0.0
        elastic[k, k] = 1.0 + work.vectors[EXTRA, k] + of_rate * system.springs[k, 1] + of_place * system.springs[k, 0]
    for r in range(work.robots.shape[0]):
        lower, robot, joints = work.lower[r], work.robots[r], system.counts[r, JOINTS]
        solid, tool = work.six[SOLID:TOTALS].reshape(12), shared_vector(system.robots, r, TOOL)
        weigh(system.chain[r], joints, robot, tool, work.links[r], found, solid)
        count = 0
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
            for o in range(work.six.shape[1]):
                for c in range(count):
                    found[i, o] -= lower[c, J + i] * lower[c, J + o]
        add_base(system, r, found, work)
    factorise(elastic, N)


@called
def add_base(system, r, inertia, work):
    """What the base of robot r, with an inertia (6, 6), adds to the matrix of the modes (upper half)."""
    for g in range(2):
        body = system.body[r, g]
        if body >= 0:
            share, pairs, modes = system.share[r, g], work.pairs[r, g], system.tracks[body, MODES]
            for o in range(pairs.shape[0]):
                for k in range(modes):
                    pairs[o, k] = 0.0
            for i in range(pairs.shape[0]):
                for k in range(modes):
                    here = along_track(system, body, work.grips[r, g], i, k)
                    for o in range(pairs.shape[0]):
                        pairs[o, k] += share[o, i] * here
    for h in range(2):
        other = system.body[r, h]
        if other < 0:
            continue
        second, modes = system.tracks[other, FIRST], system.tracks[other, MODES]
        for i in range(work.across.shape[0]):
            across = work.across[i]
            for k in range(modes):
                across[k] = 0.0
            for o in range(work.across.shape[0]):
                row, part = work.pairs[r, h, o], inertia[i, o]
                for k in range(modes):
                    across[k] += part * row[k]
        for g in range(2):
            one = system.body[r, g]
            if one < 0 or one > other:
                continue
            for m in range(system.tracks[one, MODES]):
                row = work.elastic[system.tracks[one, FIRST] + m]
                for i in range(work.across.shape[0]):
                    across, part = work.across[i], work.pairs[r, g, i, m]
                    for k in range(modes):
                        row[second + k] += part * across[k]


@called
def solve(system, work, x):
    """x (N) becomes the solution for a right-hand side x of the matrix of `prepare`."""
    modes, J, totals = work.elastic.shape[0], system.coordinate.shape[1], work.six[TOTALS]
    first = modes
    for r in range(work.robots.shape[0]):
        count, lower = compliant(system, r), work.lower[r]
        forward(lower, count, x[first:])
        for i in range(totals.shape[0]):
            totals[i] = 0.0
            for c in range(count):
                totals[i] += lower[c, J + i] * x[first + c]
        for g in range(2):
            body = system.body[r, g]
            if body >= 0:
                begin = system.tracks[body, FIRST]
                for i in range(totals.shape[0]):
                    row, part = work.pairs[r, g, i], totals[i]
                    for k in range(system.tracks[body, MODES]):
                        x[begin + k] -= part * row[k]
        first += count
    forward(work.elastic, modes, x)
    backward(work.elastic, modes, x)
    first = modes
    for r in range(work.robots.shape[0]):
        count, lower = compliant(system, r), work.lower[r]
        along_base(system, r, x, work, totals)
        for c in range(count):
            for i in range(totals.shape[0]):
                x[first + c] -= lower[c, J + i] * totals[i]
        backward(lower, count, x[first:])
        first += count


@called
def along_base(system, r, x, work, totals):
    """The six motions of the base of robot r by x of the modes."""
    for i in range(totals.shape[0]):
        totals[i] = 0.0
    for g in range(2):
        body = system.body[r, g]
        if body >= 0:
            begin = system.tracks[body, FIRST]
            for k in range(system.tracks[body, MODES]):
                for i in range(totals.shape[0]):
                    totals[i] += work.pairs[r, g, i, k] * x[begin + k]


@called
def compliant(system, r):
    """How many joints of robot r have coordinates; these stand in a row, robot by robot."""
    count = 0
    for j in range(system.counts[r, JOINTS]):
        count += system.coordinate[r, j] >= 0
    return count
