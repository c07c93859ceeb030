"""Rails under robots: how the axis of a track moves, per mode and as a whole, and what its modes miss."""

from engine.kernels.floating.vectors import no_vector
from engine.kernels.jit import called
from engine.kernels.robots.layout import (
    BY_ENDS,
    CUBIC,
    ELEMENT,
    ELEMENTS,
    FIRST,
    GIVEN,
    GRIP,
    INTO,
    LOADED,
    LOADS,
    MISSING,
    MODES,
    POWERS,
    UP_THERE,
)
from engine.kernels.vector import lanes_at, put_lanes, total


@called
def element_at(system, body, s):
    """The element of a track at a place, and the distance from its beginning, m."""
    low, high = 0, system.tracks[body, ELEMENTS] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if system.ends[body, middle] <= s:
            low = middle
        else:
            high = middle - 1
    return low, s - system.ends[body, low]


@called
def section(system, body, s, state, work, grip):
    """The axis of a track at a place, into work.motions (6, 6): B y, B y', B y'', B' y, B' y' and B'' y of the modes of
    the body, derivatives of the motion per mode B by the place; the place into columns of ``grip``."""
    e, x = element_at(system, body, s)
    first, motions, cubics = system.tracks[body, FIRST], work.motions, work.cubics
    for power in range(0, POWERS, 2):  # twelve registers of sums at once are what the processor has room for
        y_low, v_low, a_low = no_vector()
        y_high, v_high, a_high = no_vector()
        for k in range(system.tracks[body, MODES]):
            low = lanes_at(system.shapes, (body, e, k, power))
            high = lanes_at(system.shapes, (body, e, k, power + 1))
            y, v, a = state[first + k, 0], state[first + k, 1], state[first + k, 2]
            y_low, v_low, a_low = y_low + y * low, v_low + v * low, a_low + a * low
            y_high, v_high, a_high = y_high + y * high, v_high + v * high, a_high + a * high
        put_lanes(cubics, (CUBIC + 3 * power,), y_low)
        put_lanes(cubics, (CUBIC + 3 * power + 1,), v_low)
        put_lanes(cubics, (CUBIC + 3 * power + 2,), a_low)
        put_lanes(cubics, (CUBIC + 3 * power + 3,), y_high)
        put_lanes(cubics, (CUBIC + 3 * power + 4,), v_high)
        put_lanes(cubics, (CUBIC + 3 * power + 5,), a_high)
    for i in range(work.six.shape[1]):
        for order in range(3):
            c0, c1 = cubics[CUBIC + order, i], cubics[CUBIC + 3 + order, i]
            c2, c3 = cubics[CUBIC + 6 + order, i], cubics[CUBIC + 9 + order, i]
            motions[i, order] = c0 + x * (c1 + x * (c2 + x * c3))
            motions[i, 3 + order] = c1 + x * (2.0 * c2 + 3.0 * x * c3)  # that of B' y'' gives way
        motions[i, 5] = 2.0 * cubics[CUBIC + 6, i] + 6.0 * x * cubics[CUBIC + 9, i]
    grip[ELEMENT], grip[INTO], grip[UP_THERE] = e, x, motions[2, 0]


@called
def push_on(system, body, grip, work, left):
    """The wrench of a robot on a rail, in columns of ``grip``, added to what is left (N) of the modes."""
    e, power, cubics = int(grip[ELEMENT]), 1.0, work.cubics
    for row in range(LOADED, LOADED + POWERS):
        for i in range(6):
            cubics[row, i] = power * grip[GRIP + i]
        power *= grip[INTO]
    by_0, by_1 = lanes_at(cubics, (LOADED,)), lanes_at(cubics, (LOADED + 1,))
    by_2, by_3 = lanes_at(cubics, (LOADED + 2,)), lanes_at(cubics, (LOADED + 3,))
    for k in range(system.tracks[body, MODES]):
        even = by_0 * lanes_at(system.shapes, (body, e, k, 0)) + by_2 * lanes_at(system.shapes, (body, e, k, 2))
        odd = by_1 * lanes_at(system.shapes, (body, e, k, 1)) + by_3 * lanes_at(system.shapes, (body, e, k, 3))
        left[system.tracks[body, FIRST] + k] += total(even + odd)


@called
def along_track(system, body, grip, i, k):
    """Motion i of the axis of a track, where a robot stands on it, by mode k."""
    e, x = int(grip[ELEMENT]), grip[INTO]
    cubic = system.shapes[body, e, k]
    return cubic[0, i] + x * (cubic[1, i] + x * (cubic[2, i] + x * cubic[3, i]))


@called
def hermite(system, body, grip):
    """The motion of the axis at the place of ``grip`` by displacements and rotations of its element's ends, into other
    columns of it: cubics of bending, u_y' = r_z and u_z' = -r_y."""
    e, x = int(grip[ELEMENT]), grip[INTO]
    length = system.ends[body, e + 1] - system.ends[body, e]
    u = x / length
    for k in range(BY_ENDS, ELEMENT):
        grip[k] = 0.0
    shapes = (1.0 - u * u * (3.0 - 2.0 * u), x * (1.0 - u) ** 2, u * u * (3.0 - 2.0 * u), x * u * (u - 1.0))
    slopes = (6.0 * u * (u - 1.0) / length, (1.0 - u) * (1.0 - 3.0 * u), 6.0 * u * (1.0 - u) / length, u * (3 * u - 2))
    for end in range(2):
        linear = u if end else 1.0 - u
        first, shape, turn = BY_ENDS + 6 * end, shapes[2 * end], shapes[2 * end + 1]
        slope, turn_slope = slopes[2 * end], slopes[2 * end + 1]
        grip[first], grip[36 + first + 3] = linear, linear
        grip[12 + first + 1], grip[12 + first + 5] = shape, turn
        grip[60 + first + 1], grip[60 + first + 5] = slope, turn_slope
        grip[24 + first + 2], grip[24 + first + 4] = shape, -turn
        grip[48 + first + 2], grip[48 + first + 4] = -slope, turn_slope


@called
def give(system, grips):
    """Motions of all rails under all robots, at the places of ``grips`` (R, 2, GRIPPED), that their modes miss, under
    what carries these robots."""
    for r in range(grips.shape[0]):
        for g in range(2):
            if system.body[r, g] >= 0:
                own = grips[r, g]
                hermite(system, system.body[r, g], own)
                for k in range(12):
                    own[LOADS + k] = 0.0
                    for i in range(6):
                        own[LOADS + k] -= own[BY_ENDS + 12 * i + k] * own[GRIP + i]
    for r in range(grips.shape[0]):
        for g in range(2):
            own = grips[r, g]
            for i in range(6):
                own[MISSING + i] = 0.0
            if system.body[r, g] >= 0:
                give_ends(system, system.body[r, g], own, grips)
                for i in range(6):
                    for k in range(12):
                        own[MISSING + i] += own[BY_ENDS + 12 * i + k] * own[GIVEN + k]


@called
def give_ends(system, body, own, grips):
    """Motions of the ends of an element on a body under all loads on that body."""
    row = 6 * int(own[ELEMENT])
    for k in range(12):
        own[GIVEN + k] = 0.0
    for p in range(grips.shape[0]):
        for o in range(2):
            if system.body[p, o] == body:
                first = 6 * int(grips[p, o, ELEMENT])
                for m in range(12):
                    load = grips[p, o, LOADS + m]
                    for k in range(12):
                        own[GIVEN + k] += system.missed[body, first + m, row + k] * load
