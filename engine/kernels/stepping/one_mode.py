"""One mode's step in each family of schemes: the first predictors, the correction with the next predictors, the end.

The functions named for what they do are chosen when a kernel is compiled, by the class of the scheme's coefficients,
so that Newmark's family does not pay for the memory of the alpha schemes (field E of the work array).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from engine.kernels.jit import chosen_for
from engine.kernels.layout import Alpha
from engine.kernels.stepping.record import CD, FIELDS, KD, RATE_1, RATE_2, C, E, U, V
from engine.kernels.vector import lanes_at, put_lanes


def fields_of(scheme):
    """Number of fields that a mode has in the work array."""
    return _family(type(scheme)).fields(scheme)


def remember(scheme, work, k, j, e):
    """Keep the memory of mode k of lane j for its first step."""
    return _family(type(scheme)).remember(scheme, work, k, j, e)


def first_predictors(scheme, q, v, a, memory):
    """u*, v* and the memory of the first step, from a state in step units."""
    return _family(type(scheme)).first(scheme, q, v, a, memory)


def advance(scheme, work, k, x):
    """Correct all lanes of mode k with their accelerations x and predict the next step; returns q, v, u*, v*, c*."""
    return _family(type(scheme)).advance(scheme, work, k, x)


def corrected(scheme, work, b, k, j, x):
    """Displacement, velocity, acceleration and memory of mode k of lane j in SI units, from its acceleration x."""
    return _family(type(scheme)).corrected(scheme, work, b, k, j, x)


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


def _advance_newmark(scheme, work, k, x):
    # correction and prediction in one: x comes with gamma + (1 - gamma) and with beta + gamma + (1/2 - beta)
    u, v = lanes_at(work, (k, U)), lanes_at(work, (k, V))
    v_next = v + x
    q_next = u + v + (0.5 + scheme.gamma) * x
    c = lanes_at(work, (k, CD)) * v_next + lanes_at(work, (k, KD)) * q_next
    put_lanes(work, (k, U), q_next)
    put_lanes(work, (k, V), v_next)
    put_lanes(work, (k, C), c)
    return u + scheme.beta * x, v + scheme.gamma * x, q_next, v_next, c


def _advance_alpha(scheme, work, k, x):
    e = lanes_at(work, (k, E))
    q = lanes_at(work, (k, U)) + scheme.beta * x
    v = lanes_at(work, (k, V)) + scheme.gamma * x
    v_next = v + (scheme.velocity_x * x + scheme.velocity_e * e)
    q_next = q + v + (scheme.displacement_x * x + scheme.displacement_e * e)
    c = lanes_at(work, (k, CD)) * v_next + lanes_at(work, (k, KD)) * q_next
    put_lanes(work, (k, U), q_next)
    put_lanes(work, (k, V), v_next)
    put_lanes(work, (k, C), c)
    put_lanes(work, (k, E), scheme.next_x * x + scheme.next_e * e)
    return q, v, q_next, v_next, c


def _corrected_newmark(scheme, work, b, k, j, x):
    q = work[k, U, j] + scheme.beta * x
    v = work[k, V, j] + scheme.gamma * x
    return q, v * b[RATE_1, j], x * b[RATE_2, j], 0.0


def _corrected_alpha(scheme, work, b, k, j, x):
    q = work[k, U, j] + scheme.beta * x
    v = work[k, V, j] + scheme.gamma * x
    memory = (scheme.kappa - 1.0) * x + work[k, E, j]
    return q, v * b[RATE_1, j], x * b[RATE_2, j], memory * b[RATE_2, j]


def _remember_alpha(scheme, work, k, j, e):
    work[k, E, j] = e


class Family(NamedTuple):
    """The functions of one family of schemes."""

    fields: Callable[..., int]
    first: Callable[..., Any]
    remember: Callable[..., None]
    advance: Callable[..., Any]
    corrected: Callable[..., Any]


_NEWMARK = Family(
    lambda scheme: FIELDS,
    _first_newmark,
    lambda scheme, work, k, j, e: None,
    _advance_newmark,
    _corrected_newmark,
)
_ALPHA = Family(lambda scheme: FIELDS + 1, _first_alpha, _remember_alpha, _advance_alpha, _corrected_alpha)


def _family(coefficients: type) -> Family:
    return _ALPHA if coefficients is Alpha else _NEWMARK


_STUBS: tuple[Callable[..., Any], ...] = (fields_of, first_predictors, remember, advance, corrected)
for _stub, _name in zip(_STUBS, Family._fields, strict=True):
    chosen_for(_stub)(lambda scheme, *others, name=_name: getattr(_family(scheme.instance_class), name))
