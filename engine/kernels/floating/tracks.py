"""Shapes of a body at places of its track that depend on the state, from polynomials in cells."""

from engine.kernels.floating.layout import AXIS, FIRST, LENGTH, MISSED_BODY, MISSED_PLACE, MODES, SHORTENED
from engine.kernels.jit import called
from engine.kernels.layout import LANES
from engine.kernels.vector import all_lanes, lanes_at, put_lanes

# columns of what is known of each mode at a place: displacement and its first two derivatives by the place, likewise of
# the rotation
SHAPE, SLOPE, CURVE, TURN, TURN_SLOPE, TURN_CURVE, AT_PLACE = 0, 3, 6, 9, 12, 15, 18
# rows of a gathered polynomial behind its six coefficients: places, and where in their cells they are (0 to 1)
POWERS, AT, WITHIN, GATHERED = 6, 6, 7, 8


@called
def enter_cells(system, b, s, cells, gathered):
    """The cell of each lane's place, and where in it that is; the outermost cells go on. Returns cells per metre."""
    count = system.track.shape[1]
    rate = count / system.bodies[b, LENGTH]
    put_lanes(gathered, (AT,), s * rate)
    for j in range(LANES):
        at = gathered[AT, j]
        inside = at if at > 0.0 else 0.0  # NaN too
        cells[j] = int(min(inside, count - 1.0))
        gathered[WITHIN, j] = at - cells[j]
    return rate


@called
def shapes_at(system, b, s, components, work):
    """The columns above of each mode, into work.modes (n, AT_PLACE, LANES), of the first ``components`` of 6."""
    c, rate = work.gathered, enter_cells(system, b, s, work.cells, work.gathered)
    x = lanes_at(c, (WITHIN,))
    for component in range(components):
        k = component if component < 3 else TURN + component - 3
        for i in range(system.tree[b, MODES]):
            if not system.bends[b, component, i]:
                put_lanes(work.modes, (i, k), all_lanes(0.0))
                put_lanes(work.modes, (i, k + SLOPE), all_lanes(0.0))
                put_lanes(work.modes, (i, k + CURVE), all_lanes(0.0))
                continue
            for j in range(LANES):
                for power in range(POWERS):
                    c[power, j] = system.track[b, work.cells[j], power, component, i]
            c1, c2, c3 = lanes_at(c, (1,)), lanes_at(c, (2,)), lanes_at(c, (3,))
            c4, c5 = lanes_at(c, (4,)), lanes_at(c, (5,))
            shape = lanes_at(c, (0,)) + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
            slope = rate * (c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * (5.0 * c5)))))
            curve = rate * rate * (2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * (20.0 * c5))))
            put_lanes(work.modes, (i, k), shape)
            put_lanes(work.modes, (i, k + SLOPE), slope)
            put_lanes(work.modes, (i, k + CURVE), curve)


@called
def missed_line(system, k, s, gathered):
    """What the modes miss of a section force by a unit force at places s of the track, just beyond one at its own."""
    place, length = system.missed[k, MISSED_PLACE], system.bodies[system.missed_sections[k, MISSED_BODY], LENGTH]
    count = system.missed_lines.shape[2]
    put_lanes(gathered, (AT,), s)
    for j in range(LANES):
        at = gathered[AT, j]
        before = place > 0.0 and (at <= place or place >= length)
        side, low, width = (0, 0.0, place / count) if before else (1, place, (length - place) / count)
        part = (at - low) / width
        cell = int(min(part if part > 0.0 else 0.0, count - 1.0))  # NaN too
        y, found = 2.0 * (part - cell) - 1.0, 0.0
        for power in range(system.missed_lines.shape[3] - 1, -1, -1):
            found = found * y + system.missed_lines[k, side, cell, power]
        gathered[0, j] = found
    return lanes_at(gathered, (0,))


@called
def foreshortening_at(system, number, work):
    """G along an axis of a pair of modes at the place whose cells were entered last, 1/(kg m): that comes nearer by
    half of sum G_ij q_i q_j."""
    c, table = work.gathered, system.foreshortening
    for j in range(LANES):  # one number of each lane: six rows of them take three times as long
        cell, x, found = work.cells[j], c[WITHIN, j], 0.0
        for power in range(POWERS - 1, -1, -1):
            found = found * x + table[number, cell, power]
        c[0, j] = found
    return lanes_at(c, (0,))


@called
def pulled_nearer(system, number, pull, work):
    """G there times the part of a force along its axis."""
    axis = system.shortening[number, AXIS]
    part = pull[0]
    if axis == 1:
        part = pull[1]
    if axis == 2:
        part = pull[2]
    return foreshortening_at(system, number, work) * part


@called
def span_of(system, b):
    """Of a body: along how many axes its places come nearer, its first elastic coordinate, and how many it has."""
    return system.tree[b, SHORTENED], system.tree[b, FIRST], system.tree[b, MODES]


@called
def weighed(table, place, axes, pair, f):
    """G of a pair of modes at a place of a table (places, A, n, n) times a vector, along so many axes."""
    i, j = pair
    found = table[place, 0, i, j] * f[0]
    if axes > 1:
        found = found + table[place, 1, i, j] * f[1] + table[place, 2, i, j] * f[2]
    return found


@called
def shorter_by(table, place, span, i, q, f):
    """sum_j G_ij q_j there times a vector; span: as of `span_of`."""
    axes, first, n = span
    found = all_lanes(0.0)
    for j in range(n):
        found = found + weighed(table, place, axes, (i, j), f) * lanes_at(q, (first + j,))
    return found


@called
def nearer(table, place, span, q, p):
    """sum_ij G_ij q_i p_j there: a place comes nearer by half of that of q and q."""
    axes, first, n = span
    x, y, z = all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)
    for i in range(n):
        for j in range(n):
            both = lanes_at(q, (first + i,)) * lanes_at(p, (first + j,))
            x = x + table[place, 0, i, j] * both
            if axes > 1:
                y = y + table[place, 1, i, j] * both
                z = z + table[place, 2, i, j] * both
    return x, y, z


@called
def combined(table, first_row, column, modes, q, first):
    """sum_i of three columns, which all lanes share, times coordinates q, the first of which has that number."""
    x, y, z = all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)
    for i in range(modes):
        own = lanes_at(q, (first + i,))
        x = x + table[first_row + i, column] * own
        y = y + table[first_row + i, column + 1] * own
        z = z + table[first_row + i, column + 2] * own
    return x, y, z


@called
def combined_there(at, column, modes, q, first):
    """sum_i of three columns of modes at a place (n, AT_PLACE, LANES) times coordinates q."""
    x, y, z = all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)
    for i in range(modes):
        own = lanes_at(q, (first + i,))
        x = x + lanes_at(at, (i, column)) * own
        y = y + lanes_at(at, (i, column + 1)) * own
        z = z + lanes_at(at, (i, column + 2)) * own
    return x, y, z
