"""Sine, cosine and decaying exponential in plain arithmetic, without branches: for numbers, arrays and rows of lanes.

The bits of a value depend on no library and on no neighbour. Within two units of the last place.
"""

from engine.kernels.jit import piece
from engine.kernels.vector import choose, two_to

# A sum with it is rounded to a whole number (less than 2^51), as long as nobody reorders it: "contract" does not.
ROUND = 1.5 * 2.0**52
PI = 3.141592653589793
# Minimax polynomials of sin x/x and cos x for |x| <= pi/4, error 3e-18: fdlibm's k_sin.c and k_cos.c (Sun, 1993).
SIN_2, SIN_4, SIN_6 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
SIN_8, SIN_10, SIN_12 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
COS_4, COS_6, COS_8 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
COS_10, COS_12, COS_14 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
# ln 2 = 0.693... in two parts (Cody and Waite): products of the first with whole numbers to 2^20 are exact.
STEEPEST = 40.0  # exp(-40) is nothing beside 1
LOG2_E, LN2_FIRST, LN2_REST = 1.4426950408889634, 6.93147180369123816490e-01, 1.90821492927058770002e-10


@piece
def sin_cos(turn):
    """sin(pi turn) and cos(pi turn), for |turn| < 2^50: half-turns, as their whole ones are split off exactly."""
    whole = (turn + ROUND) - ROUND
    part = turn - whole
    pairs = (0.5 * whole + ROUND) - ROUND
    odd = whole - 2.0 * pairs  # -1, 0, 1
    side = (2.0 * part + ROUND) - ROUND  # -1, 0, 1: the quarter of the half-turn
    x = PI * (part - 0.5 * side)
    z = x * x
    sine = x + x * z * (SIN_2 + z * (SIN_4 + z * (SIN_6 + z * (SIN_8 + z * (SIN_10 + z * SIN_12)))))
    cosine = COS_4 + z * (COS_6 + z * (COS_8 + z * (COS_10 + z * (COS_12 + z * COS_14))))
    cosine = 1.0 - z * (0.5 - z * cosine)
    sign = 1.0 - 2.0 * odd * odd
    level, tilt = sign * (1.0 - side * side), sign * side
    return level * sine + tilt * cosine, level * cosine - tilt * sine


@piece
def decay(x):
    """exp(-x) for x >= 0, by Taylor's series to the thirteenth power within ln(2)/2 of zero (error 6e-18); from x = 708
    on it is less than 1e-307."""
    whole = (LOG2_E * x + ROUND) - ROUND
    y = (whole * LN2_FIRST - x) + whole * LN2_REST
    high = 1.0 / 5040.0 + y * (1.0 / 40320.0 + y * (1.0 / 362880.0 + y * (1.0 / 3628800.0 + y * (
        1.0 / 39916800.0 + y * (1.0 / 479001600.0 + y * (1.0 / 6227020800.0))))))  # fmt: skip
    low = 0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0 + y * (1.0 / 720.0 + y * high))))
    return two_to(-1.0 * whole) * (1.0 + y * (1.0 + y * low))


@piece
def hyperbolic_tangent(x):
    """tanh of a row of lanes, to 1e-16 of 1."""
    steep = 2.0 * choose(x < 0.0, 0.0 - x, x)
    e = decay(choose(steep < STEEPEST, steep, STEEPEST))
    t = (1.0 - e) / (1.0 + e)
    return choose(x < 0.0, 0.0 - t, t)
