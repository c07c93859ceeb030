"""Chains of rigid links on a base that moves: inverse dynamics (recursive Newton-Euler), inertia by composite bodies.

Everything is in the axes of the ground; moments and spatial inertias are about the base point.
"""

from engine.kernels.floating.vectors import (
    add,
    after,
    cross,
    dot,
    shared_matrix,
    shared_vector,
    times,
    turned_in,
    turned_out,
)
from engine.kernels.jit import called
from engine.kernels.robots.layout import (
    AHEAD,
    AXIS,
    CENTRE,
    FORCE,
    INERTIA,
    JOINT_AXIS,
    JOINT_PLACE,
    JOINT_TURN,
    MASS,
    MOMENT,
    PAYLOAD,
    PLACE,
    PUSH,
    RATE,
    SLIDES,
    TILT,
    TURN,
    VALUE,
)
from engine.kernels.robots.vectors import add_vector, keep_matrix, keep_vector, rotation, spin_of

STILL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@called
def swung(spin, change, arm):
    """Acceleration of a point of a body that is an arm away from one at rest."""
    return add(cross(change, arm), cross(spin, cross(spin, arm)))


@called
def follow(chain, count, base, payload, tool, links, which):
    """The links of a robot outward, then what accelerates them inward.

    chain (J, LINK), of which ``count`` are there;  base: its place, axes (rows), angular velocity, acceleration less
    that of gravity, and angular acceleration;  payload (kg) at ``tool`` (3,) of the last link;  links (J, COLUMNS):
    filled, by the joints in their columns ``which``. Returns force and moment on the base about its point, and where
    the tool is.
    """
    place, turn, spin, acceleration, change = base
    for j in range(count):
        if j > 0:
            arm = turned_out(turn, shared_vector(chain, j, JOINT_PLACE))
            turn = after(turn, shared_matrix(chain, j, JOINT_TURN))
            along = shared_vector(chain, j, JOINT_AXIS)
            axis = turned_out(turn, along)
            value, rate, push = links[j, which + VALUE], links[j, which + RATE], links[j, which + PUSH]
            if chain[j, SLIDES] > 0.0:
                arm = add(arm, times(value, axis))
            place = add(place, arm)
            acceleration = add(acceleration, swung(spin, change, arm))
            if chain[j, SLIDES] > 0.0:
                acceleration = add(acceleration, add(times(push, axis), times(2.0 * rate, cross(spin, axis))))
            else:
                turn = after(turn, rotation(times(value, along)))
                change = add(change, add(times(push, axis), times(rate, cross(spin, axis))))
                spin = add(spin, times(rate, axis))
            keep_vector(links, j, AXIS, axis)
        keep_vector(links, j, PLACE, place)
        keep_matrix(links, j, TURN, turn)
        out = turned_out(turn, shared_vector(chain, j, CENTRE))
        force = times(chain[j, MASS], add(acceleration, swung(spin, change, out)))
        own = turned(turn, shared_vector(chain, j, INERTIA), spin)
        moment = add(turned(turn, shared_vector(chain, j, INERTIA), change), cross(spin, own))
        lever = add(add(place, out), times(-1.0, base[0]))
        keep_vector(links, j, FORCE, force)
        keep_vector(links, j, MOMENT, add(moment, cross(lever, force)))
    last = count - 1
    out = turned_out(turn, tool)
    end = add(place, out)
    force = times(payload, add(acceleration, swung(spin, change, out)))
    add_vector(links, last, FORCE, force)
    add_vector(links, last, MOMENT, cross(add(end, times(-1.0, base[0])), force))
    for j in range(last, 0, -1):
        add_vector(links, j - 1, FORCE, shared_vector(links, j, FORCE))
        add_vector(links, j - 1, MOMENT, shared_vector(links, j, MOMENT))
    return shared_vector(links, 0, FORCE), shared_vector(links, 0, MOMENT), end


@called
def turned(turn, inertia, spin):
    """An inertia tensor, principal in axes that are turned, times a vector."""
    own = turned_in(turn, spin)
    return turned_out(turn, (inertia[0] * own[0], inertia[1] * own[1], inertia[2] * own[2]))


@called
def driven(chain, j, links, origin):
    """What the drive of joint j > 0 exerts along or about its axis, after `follow`."""
    axis, force = shared_vector(links, j, AXIS), shared_vector(links, j, FORCE)
    if chain[j, SLIDES] > 0.0:
        return dot(axis, force)
    lever = add(shared_vector(links, j, PLACE), times(-1.0, origin))
    return dot(axis, add(shared_vector(links, j, MOMENT), times(-1.0, cross(lever, force))))


@called
def add_solid(sums, mass, lever, turn, inertia):
    """A body's mass, first and second moments about the base point, added to (10,): m, h, Ixx, Iyy, Izz, Ixy, Ixz,
    Iyz."""
    sums[0] += mass
    square = dot(lever, lever)
    for k in range(3):
        sums[1 + k] += mass * lever[k]
        own = turn[k]
        sums[4 + k] += mass * (square - lever[k] ** 2)
        for i in range(3):
            sums[4 + k] += own[i] ** 2 * inertia[i]
    for number, i, k in ((7, 0, 1), (8, 0, 2), (9, 1, 2)):
        sums[number] -= mass * lever[i] * lever[k]
        for p in range(3):
            sums[number] += turn[i][p] * turn[k][p] * inertia[p]


@called
def momenta(sums, motion):
    """Momentum and angular momentum about the base point of what moves as one: motion (velocity there, spin)."""
    velocity, spin = motion
    h = (sums[1], sums[2], sums[3])
    linear = add(times(sums[0], velocity), cross(spin, h))
    angular = (
        sums[4] * spin[0] + sums[7] * spin[1] + sums[8] * spin[2],
        sums[7] * spin[0] + sums[5] * spin[1] + sums[9] * spin[2],
        sums[8] * spin[0] + sums[9] * spin[1] + sums[6] * spin[2],
    )
    return linear, add(angular, cross(h, velocity))


@called
def screw(chain, j, links, origin):
    """Velocity at the base point and angular velocity of a unit rate of joint j > 0."""
    axis = shared_vector(links, j, AXIS)
    if chain[j, SLIDES] > 0.0:
        return axis, (0.0, 0.0, 0.0)
    return cross(add(shared_vector(links, j, PLACE), times(-1.0, origin)), axis), axis


@called
def weigh(chain, count, robot, tool, links, found, sums):
    """The inertia of a robot after `follow`: found (6 + J, 6 + J) of its base, then its joints, the upper half.

    robot (ROBOT): of which its payload, its rotation vector, and how the base moves per unit rate of joint 0.
    sums (10): used.
    """
    origin, tilt = shared_vector(links, 0, PLACE), (robot[TILT], robot[TILT + 1], robot[TILT + 2])
    forward = (
        (robot[AHEAD], robot[AHEAD + 1], robot[AHEAD + 2]),
        spin_of(tilt, (robot[AHEAD + 3], robot[AHEAD + 4], robot[AHEAD + 5])),
    )
    for k in range(10):
        sums[k] = 0.0
    turn = shared_matrix(links, count - 1, TURN)
    end = add(shared_vector(links, count - 1, PLACE), turned_out(turn, tool))
    add_solid(sums, robot[PAYLOAD], add(end, times(-1.0, origin)), turn, (0.0, 0.0, 0.0))
    for j in range(count - 1, -1, -1):
        turn = shared_matrix(links, j, TURN)
        centre = add(shared_vector(links, j, PLACE), turned_out(turn, shared_vector(chain, j, CENTRE)))
        lever = add(centre, times(-1.0, origin))
        add_solid(sums, chain[j, MASS], lever, turn, shared_vector(chain, j, INERTIA))
        motion = screw(chain, j, links, origin) if j > 0 else forward
        linear, angular = momenta(sums, motion)
        along = spin_of(times(-1.0, tilt), angular)
        for k in range(3):
            found[k, 6 + j], found[3 + k, 6 + j] = linear[k], along[k]
        for i in range(j + 1):
            velocity, spin = screw(chain, i, links, origin) if i > 0 else forward
            found[6 + i, 6 + j] = dot(velocity, linear) + dot(spin, angular)
    for k in range(6):
        velocity = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
        spin = spin_of(tilt, (1.0 * (k == 3), 1.0 * (k == 4), 1.0 * (k == 5)))
        linear, angular = momenta(sums, (velocity, spin))
        along = spin_of(times(-1.0, tilt), angular)
        for i in range(3):
            found[i, k], found[3 + i, k] = linear[i], along[i]
