"""Rails under robots: how the axis of a track moves, per mode and as a whole, and what its modes miss."""

from engine.kernels.jit import called
from engine.kernels.robots.layout import AT, BY_ENDS, ELEMENT, ELEMENTS, FIRST, GRIP, LOADS, MISSING, MODES


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
def section(system, body, s, state, rows, sums):
    """The axis of a track at a place: rows (6, n), its motion per mode B; sums (6, 6): B y, B y', B y'', B' y, B' y'
    and B'' y of the modes of the body, derivatives of B by the place."""
    e, x = element_at(system, body, s)
    shapes, first = system.shapes[body, e], system.tracks[body, FIRST]
    for i in range(rows.shape[0]):
        q, v, a, dq, dv, ddq = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(system.tracks[body, MODES]):
            c1, c2, c3 = shapes[1, i, k], shapes[2, i, k], shapes[3, i, k]
            here = shapes[0, i, k] + x * (c1 + x * (c2 + x * c3))
            slope = c1 + x * (2.0 * c2 + 3.0 * x * c3)
            place, rate = state[first + k, 0], state[first + k, 1]
            rows[i, k] = here
            q += here * place
            v += here * rate
            a += here * state[first + k, 2]
            dq += slope * place
            dv += slope * rate
            ddq += (2.0 * c2 + 6.0 * x * c3) * place
        sums[0, i], sums[1, i], sums[2, i], sums[3, i], sums[4, i], sums[5, i] = q, v, a, dq, dv, ddq


@called
def hermite(system, body, s, grip):
    """The motion of the axis at a place by displacements and rotations of its element's ends, into columns of ``grip``:
    cubics of bending, u_y' = r_z and u_z' = -r_y."""
    e, x = element_at(system, body, s)
    length = system.ends[body, e + 1] - system.ends[body, e]
    u = x / length
    for k in range(BY_ENDS, AT):
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
    grip[ELEMENT] = e


@called
def give(system, grips):
    """Motions of all rails under all robots, at the places of ``grips`` (R, 2, GRIPPED), that their modes miss, under
    what carries these robots."""
    for r in range(grips.shape[0]):
        for g in range(2):
            if system.body[r, g] >= 0:
                own = grips[r, g]
                hermite(system, system.body[r, g], own[AT], own)
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
                for k in range(12):
                    moved = given(system, system.body[r, g], 6 * int(own[ELEMENT]) + k, grips)
                    for i in range(6):
                        own[MISSING + i] += own[BY_ENDS + 12 * i + k] * moved


@called
def given(system, body, row, grips):
    """One motion of an end on a body under all loads on that body."""
    found = 0.0
    for p in range(grips.shape[0]):
        for o in range(2):
            if system.body[p, o] == body:
                first = 6 * int(grips[p, o, ELEMENT])
                for m in range(12):
                    found += system.missed[body, row, first + m] * grips[p, o, LOADS + m]
    return found
