"""A mass that slides freely, without friction, on a one-mode pinned beam (Lagrange's equations, z down, w = phi q).

[[1 + m phi^2, m phi w'], [m phi w', m (1 + w'^2)]] (q'', s'') =
    (C_t g + m phi (g - conv) - 2 zeta omega q' - omega^2 q,  m w' (g - conv)),
conv = 2 phi' q' s' + phi'' q s'^2, so that s'' = w' (g - a_z) with a_z the mass's vertical acceleration.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.floating[Any]]

LENGTH, AREA, SECOND_MOMENT, YOUNGS_MODULUS, DENSITY = 15.0, 0.01, 8.33e-6, 2.1e11, 7850.0
MASS, GRAVITY, START = 100.0, 9.81, 2.0

AMPLITUDE = math.sqrt(2.0 / (DENSITY * AREA * LENGTH))
OMEGA = (math.pi / LENGTH) ** 2 * math.sqrt(YOUNGS_MODULUS * SECOND_MOMENT / (DENSITY * AREA))
WEIGHT_COEFFICIENT = DENSITY * AREA * AMPLITUDE * 2.0 * LENGTH / math.pi


class Sliding(NamedTuple):
    """t, s, along (s'' in m/s2) and across (g - a_z in m/s2), each (S,); instants of midspan crossings."""

    t: Array
    s: Array
    along: Array
    across: Array
    crossings: tuple[float, ...]


def accelerations(y: Array, rate: float) -> tuple[float, float, float]:
    """q'', s'' and a_z for y = (q, q', s, s'); rate = 2 zeta omega in 1/s."""
    q, dq, s, ds = y
    k = math.pi / LENGTH
    phi, slope = AMPLITUDE * math.sin(k * s), AMPLITUDE * k * math.cos(k * s)
    conv = 2.0 * slope * dq * ds - k**2 * phi * q * ds**2
    incline = slope * q
    matrix = np.array([[1.0 + MASS * phi**2, MASS * phi * incline], [MASS * phi * incline, MASS * (1.0 + incline**2)]])
    modal = WEIGHT_COEFFICIENT * GRAVITY + MASS * phi * (GRAVITY - conv) - rate * dq - OMEGA**2 * q
    ddq, dds = np.linalg.solve(matrix, np.array([modal, MASS * incline * (GRAVITY - conv)]))
    return float(ddq), float(dds), float(phi * ddq + conv + incline * dds)


def slide(rate: float, end: float, samples: int) -> Sliding:
    """Free sliding from s = 2 m at rest on the undeformed beam until `end` s, rate = 2 zeta omega in 1/s."""

    def slope(_: float, y: Array) -> Array:
        ddq, dds, _az = accelerations(y, rate)
        return np.array([y[1], ddq, y[3], dds])

    def midspan(_: float, y: Array) -> float:
        return float(y[2]) - 0.5 * LENGTH

    t = np.linspace(0.0, end, samples)
    y0 = np.array([0.0, 0.0, START, 0.0])
    solution = solve_ivp(slope, (0.0, end), y0, "DOP853", t_eval=t, events=midspan, rtol=1e-11, atol=1e-12)
    if not solution.success:
        raise RuntimeError(solution.message)
    values = np.array([accelerations(y, rate) for y in solution.y.T])
    return Sliding(t, solution.y[2], values[:, 1], GRAVITY - values[:, 2], tuple(solution.t_events[0]))


def slide_as_printed(end: float) -> float:
    """Instant in s at which the mass leaves the beam at s = 0 if equation (30) is used as printed, zeta = 0.02.

    s'' = tan(w') (a_z - g) with a_z = phi q'' + conv + w' s'', in place of Lagrange's second equation.
    """
    rate = 2.0 * 0.02 * OMEGA

    def slope(_: float, y: Array) -> Array:
        q, dq, s, ds = y
        k = math.pi / LENGTH
        phi, tilt = AMPLITUDE * math.sin(k * s), AMPLITUDE * k * math.cos(k * s)
        conv = 2.0 * tilt * dq * ds - k**2 * phi * q * ds**2
        incline, printed = tilt * q, math.tan(tilt * q)
        # unknowns q'' and s'': the modal equation and the printed one, a_z written out in both
        matrix = np.array([[1.0 + MASS * phi**2, MASS * phi * incline], [-printed * phi, 1.0 - printed * incline]])
        modal = WEIGHT_COEFFICIENT * GRAVITY + MASS * phi * (GRAVITY - conv) - rate * dq - OMEGA**2 * q
        ddq, dds = np.linalg.solve(matrix, np.array([modal, printed * (conv - GRAVITY)]))
        return np.array([dq, ddq, ds, dds])

    def leaves(_: float, y: Array) -> float:
        return float(y[2])

    leaves.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(slope, (0.0, end), [0.0, 0.0, START, 0.0], "DOP853", events=leaves, rtol=1e-11, atol=1e-12)
    return float(solution.t_events[0][0])
