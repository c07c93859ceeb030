"""Shapes of a body at places of its track that depend on the state, from polynomials in cells."""

from engine.kernels.floating.layout import LENGTH
from engine.kernels.jit import called

# columns of what is known of each mode at a place: displacement and its first two derivatives by the place, likewise of
# the rotation
SHAPE, SLOPE, CURVE, TURN, TURN_SLOPE, TURN_CURVE, AT_PLACE = 0, 3, 6, 9, 12, 15, 18


@called
def cell_at(system, b, s):
    """The cell of a place, where in it that is (0 to 1), and cells per metre; the outermost cells go on."""
    cells = system.track.shape[1]
    rate = cells / system.bodies[b, LENGTH]
    cell = min(max(int(s * rate), 0), cells - 1)
    return cell, s * rate - cell, rate


@called
def shapes_at(system, b, s, modes, components, out):
    """The columns above of each mode, into out (n, AT_PLACE), of the first ``components`` of 6."""
    cell, x, rate = cell_at(system, b, s)
    for i in range(modes):
        for component in range(components):
            c = system.track[b, cell, :, component, i]
            c0, c1, c2, c3, c4, c5 = c[0], c[1], c[2], c[3], c[4], c[5]
            k = component if component < 3 else TURN + component - 3
            out[i, k] = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
            out[i, k + SLOPE] = rate * (c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5))))
            out[i, k + CURVE] = rate * rate * (2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5)))


@called
def foreshortening_at(system, b, s, pair):
    """G of a pair of modes at a place, 1/(kg m): up to there the track is shorter by half of sum G_ij q_i q_j."""
    cell, x, _ = cell_at(system, b, s)
    found = 0.0
    for power in range(6):
        found = found * x + system.foreshortening[b, cell, 5 - power, pair]
    return found


@called
def combined(table, first_row, column, modes, q, first):
    """sum_i of three columns times coordinates q, the first of which has that number."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(modes):
        x += table[first_row + i, column] * q[first + i]
        y += table[first_row + i, column + 1] * q[first + i]
        z += table[first_row + i, column + 2] * q[first + i]
    return x, y, z
