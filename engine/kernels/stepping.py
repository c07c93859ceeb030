"""One mode's step in each family of schemes: the first predictors, the correction with the next predictors, the end.

The functions named for what they do are chosen when a kernel is compiled, by the class of the scheme's coefficients,
so that Newmark's family does not pay for the memory of the alpha schemes (``carry``, one number per mode and lane).
"""

from numba.extending import overload

from engine.kernels.layout import Alpha
from engine.kernels.record import CD, KD, RATE_1, RATE_2, C, U, V


def first_predictors(scheme, q, v, a, memory):
    """u*, v* and the memory of the first step, from a state in step units."""
    return _BODIES[isinstance(scheme, Alpha)][0](scheme, q, v, a, memory)


def advance(scheme, work, carry, k, j, x):
    """Correct mode k of lane j with its acceleration x and predict the next step; returns q, v, u*, v*, c*."""
    return _BODIES[isinstance(scheme, Alpha)][1](scheme, work, carry, k, j, x)


def corrected(scheme, work, carry, b, k, j, x):
    """Displacement, velocity, acceleration and memory of mode k of lane j in SI units, from its acceleration x."""
    return _BODIES[isinstance(scheme, Alpha)][2](scheme, work, carry, b, k, j, x)


def _first_newmark(scheme, q, v, a, memory):
    return q + v + (0.5 - scheme.beta) * a, v + (1.0 - scheme.gamma) * a, 0.0


def _first_alpha(scheme, q, v, a, memory):
    auxiliary = a + memory
    e = scheme.start_x * a + scheme.start_a * auxiliary
    return (
        q + v + (0.5 - scheme.newmark_beta) * auxiliary + scheme.newmark_beta * e,
        v + (1.0 - scheme.newmark_gamma) * auxiliary + scheme.newmark_gamma * e,
        e,
    )


def _advance_newmark(scheme, work, carry, k, j, x):
    q = work[k, U, j] + scheme.beta * x
    v = work[k, V, j] + scheme.gamma * x
    v_next = v + (1.0 - scheme.gamma) * x
    q_next = q + v + (0.5 - scheme.beta) * x
    c = work[k, CD, j] * v_next + work[k, KD, j] * q_next
    work[k, U, j] = q_next
    work[k, V, j] = v_next
    work[k, C, j] = c
    return q, v, q_next, v_next, c


def _advance_alpha(scheme, work, carry, k, j, x):
    e = carry[k, j]
    q = work[k, U, j] + scheme.beta * x
    v = work[k, V, j] + scheme.gamma * x
    v_next = v + (scheme.velocity_x * x + scheme.velocity_e * e)
    q_next = q + v + (scheme.displacement_x * x + scheme.displacement_e * e)
    c = work[k, CD, j] * v_next + work[k, KD, j] * q_next
    work[k, U, j] = q_next
    work[k, V, j] = v_next
    work[k, C, j] = c
    carry[k, j] = scheme.next_x * x + scheme.next_e * e
    return q, v, q_next, v_next, c


def _corrected_newmark(scheme, work, carry, b, k, j, x):
    q = work[k, U, j] + scheme.beta * x
    v = work[k, V, j] + scheme.gamma * x
    return q, v * b[RATE_1, j], x * b[RATE_2, j], 0.0


def _corrected_alpha(scheme, work, carry, b, k, j, x):
    q = work[k, U, j] + scheme.beta * x
    v = work[k, V, j] + scheme.gamma * x
    memory = (scheme.kappa - 1.0) * x + carry[k, j]
    return q, v * b[RATE_1, j], x * b[RATE_2, j], memory * b[RATE_2, j]


_BODIES = (
    (_first_newmark, _advance_newmark, _corrected_newmark),
    (_first_alpha, _advance_alpha, _corrected_alpha),
)


@overload(first_predictors, inline="always")
def _choose_first(scheme, q, v, a, memory):
    return _BODIES[scheme.instance_class is Alpha][0]


@overload(advance, inline="always")
def _choose_advance(scheme, work, carry, k, j, x):
    return _BODIES[scheme.instance_class is Alpha][1]


@overload(corrected, inline="always")
def _choose_corrected(scheme, work, carry, b, k, j, x):
    return _BODIES[scheme.instance_class is Alpha][2]
