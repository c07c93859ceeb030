"""Vectors and rotations in space, as tuples of three and of three rows: of numbers that all lanes share, or of rows of
lanes (`engine.kernels.vector`)."""

from math import factorial

from engine.kernels.jit import called
from engine.kernels.sines import PI, sin_cos
from engine.kernels.vector import all_lanes, choose, everywhere, lanes_at, put_lanes, root

#: Terms of the series of `coefficients`, (-1)^k / (2 k + 1, 2 or 3)!, highest first: what is left out is below 1e-17
#: for x < 0.3. Of the last two the derivatives.
POWERS = range(6, -1, -1)
FIRST, SECOND, THIRD = (tuple((-1.0) ** k / factorial(2 * k + n) for k in POWERS) for n in (1, 2, 3))
SECOND_RATE, THIRD_RATE = (
    tuple(k * term for k, term in zip(POWERS, terms, strict=True) if k) for terms in (SECOND, THIRD)
)


@called
def add(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@called
def times(k, a):
    """k a."""
    return k * a[0], k * a[1], k * a[2]


@called
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@called
def cross(a, b):
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@called
def turned_out(E, a):
    """E a: from the new axes, the columns of E, to the old ones."""
    return dot(E[0], a), dot(E[1], a), dot(E[2], a)


@called
def turned_in(E, a):
    """E^T a: from the old axes to the new ones."""
    return (
        E[0][0] * a[0] + E[1][0] * a[1] + E[2][0] * a[2],
        E[0][1] * a[0] + E[1][1] * a[1] + E[2][1] * a[2],
        E[0][2] * a[0] + E[1][2] * a[1] + E[2][2] * a[2],
    )


@called
def after(E, D):
    """E D: the rotation D and then E."""
    return row_of(E[0], D), row_of(E[1], D), row_of(E[2], D)


@called
def row_of(e, D):
    """e^T D: a row of E D by that row of E."""
    return (
        e[0] * D[0][0] + e[1] * D[1][0] + e[2] * D[2][0],
        e[0] * D[0][1] + e[1] * D[1][1] + e[2] * D[2][1],
        e[0] * D[0][2] + e[1] * D[1][2] + e[2] * D[2][2],
    )


@called
def shared_vector(table, i, k):
    """Three columns of a row of a table that all lanes share."""
    return table[i, k], table[i, k + 1], table[i, k + 2]


@called
def shared_matrix(table, i, k):
    """Nine columns of a row of a table that all lanes share."""
    return shared_vector(table, i, k), shared_vector(table, i, k + 3), shared_vector(table, i, k + 6)


@called
def no_vector():
    """Zeros in every lane."""
    return all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)


@called
def vector(table, i, k):
    """Three columns of a row of a table of lanes."""
    return lanes_at(table, (i, k)), lanes_at(table, (i, k + 1)), lanes_at(table, (i, k + 2))


@called
def matrix(table, i, k):
    """Nine columns of a row of a table of lanes."""
    return vector(table, i, k), vector(table, i, k + 3), vector(table, i, k + 6)


@called
def keep_vector(table, i, k, a):
    """A vector into three columns of a row."""
    put_lanes(table, (i, k), a[0])
    put_lanes(table, (i, k + 1), a[1])
    put_lanes(table, (i, k + 2), a[2])


@called
def add_vector(table, i, k, a):
    """A vector added to three columns of a row."""
    keep_vector(table, i, k, add(vector(table, i, k), a))


@called
def keep_matrix(table, i, k, E):
    """A matrix into nine columns of a row."""
    keep_vector(table, i, k, E[0])
    keep_vector(table, i, k + 3, E[1])
    keep_vector(table, i, k + 6, E[2])


@called
def axial(H):
    """int d x phi dm of H = int d phi^T dm."""
    return H[1][2] - H[2][1], H[2][0] - H[0][2], H[0][1] - H[1][0]


@called
def series(terms, x):
    """A power series, the highest power first."""
    found = all_lanes(0.0)
    for term in terms:
        found = found * x + term
    return found


@called
def coefficients(x):
    """sin(t)/t, (1 - cos t)/t^2, (t - sin t)/t^3 for x = t^2, and the derivatives of the last two by x."""
    a, b, c = series(FIRST, x), series(SECOND, x), series(THIRD, x)
    db, dc = series(SECOND_RATE, x), series(THIRD_RATE, x)
    near = x < 0.3
    if everywhere(near):
        return a, b, c, db, dc
    x = choose(near, 1.0, x)
    t = root(x)
    sine, cosine = sin_cos(t / PI)
    far_a = sine / t
    far_b = (1.0 - cosine) / x
    far_c = (1.0 - far_a) / x
    return (
        choose(near, a, far_a),
        choose(near, b, far_b),
        choose(near, c, far_c),
        choose(near, db, 0.5 * (far_a - 2.0 * far_b) / x),
        choose(near, dc, 0.5 * (far_b - 3.0 * far_c) / x),
    )


@called
def rotation(t):
    """exp of a rotation vector t, as rows."""
    a, b, _, _, _ = coefficients(dot(t, t))
    x, y, z = t
    return (
        (1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y),
        (b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x),
        (b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)),
    )


@called
def spin_of(t, d):
    """Angular velocity, in the old axes, of exp(t) where t changes by d: d + b t x d + c t x (t x d)."""
    _, b, c, _, _ = coefficients(dot(t, t))
    across = cross(t, d)
    return add(d, add(times(b, across), times(c, cross(t, across))))


@called
def spin_change_of(t, d, dd):
    """The rate of `spin_of`, t changing by d and d by dd."""
    _, _, c, db, dc = coefficients(dot(t, t))
    x = 2.0 * dot(t, d)
    across = cross(t, d)
    found = add(spin_of(t, dd), add(times(db * x, across), times(dc * x, cross(t, across))))
    return add(found, times(c, cross(d, across)))
