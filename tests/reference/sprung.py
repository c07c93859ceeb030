"""A sprung body crossing a pinned beam, on modal equations of its own (two-sided contact, wheel without mass).

z is the body's displacement from where its spring just carries the weight on a straight beam, w = phi.q at the contact:

    F = m g + k (z - w),   m z'' = -k (z - w),   q'' + omega^2 q = phi F
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tests.reference.values import SprungMass

Array = NDArray[np.floating[Any]]


class SprungPassage(NamedTuple):
    """t (S,) s, midspan (S,) m, body acceleration (S,) m/s2."""

    t: Array
    midspan: Array
    body_acceleration: Array


def cross(case: SprungMass, modes: int, samples: int, rtol: float, gravity: float = 9.81) -> SprungPassage:
    """The passage from entry (beam and body at rest) to exit, undamped, by DOP853."""
    total = case.mass_per_length * case.length
    k = math.pi * np.arange(1, modes + 1) / case.length
    stiffness = k**4 * case.youngs_modulus * case.second_moment / case.mass_per_length
    scale, weight = math.sqrt(2.0 / total), case.mass * gravity

    def slope(t: float, y: Array) -> Array:
        q, z = y[:modes], y[2 * modes]
        phi = scale * np.sin(k * (case.speed * t))
        spring = case.stiffness * (z - phi @ q)
        out = np.empty_like(y)
        out[:modes] = y[modes : 2 * modes]
        out[modes : 2 * modes] = phi * (weight + spring) - stiffness * q
        out[2 * modes] = y[2 * modes + 1]
        out[2 * modes + 1] = -spring / case.mass
        return out

    t = np.linspace(0.0, case.length / case.speed, samples)
    size = weight * scale / float(stiffness[0])
    solution = solve_ivp(
        slope, (t[0], t[-1]), np.zeros(2 * modes + 2), "DOP853", t_eval=t, rtol=rtol, atol=rtol * 1e-3 * size
    )
    if not solution.success:
        raise RuntimeError(solution.message)
    q, z = solution.y[:modes], solution.y[2 * modes]
    under = np.einsum("kt,kt->t", scale * np.sin(np.outer(k, case.speed * t)), q)
    row = scale * np.sin(0.5 * math.pi * np.arange(1, modes + 1))
    return SprungPassage(t, row @ q, -case.stiffness * (z - under) / case.mass)


def march(case: SprungMass, modes: int, steps: int, gravity: float = 9.81) -> tuple[float, float]:
    """Instant and value of the largest midspan w over equal steps of average acceleration, dense matrices."""
    k = math.pi * np.arange(1, modes + 1) / case.length
    omega2 = k**4 * case.youngs_modulus * case.second_moment / case.mass_per_length
    scale = math.sqrt(2.0 / (case.mass_per_length * case.length))
    mass = np.diag(np.append(np.ones(modes), case.mass))
    h = case.length / case.speed / steps
    x: Array = np.zeros(modes + 1)
    v: Array = np.zeros(modes + 1)
    a: Array = np.zeros(modes + 1)
    row = scale * np.sin(0.5 * math.pi * np.arange(1, modes + 1))
    best = (0.0, 0.0)
    for n in range(1, steps + 1):
        phi = scale * np.sin(k * case.speed * h * n)
        gap = np.append(phi, -1.0)
        stiffness = np.diag(np.append(omega2, 0.0)) + case.stiffness * np.outer(gap, gap)
        u_star, v_star = x + h * v + 0.25 * h**2 * a, v + 0.5 * h * a
        load = np.append(phi * case.mass * gravity, 0.0)
        a = np.linalg.solve(mass + 0.25 * h**2 * stiffness, load - stiffness @ u_star)
        x, v = u_star + 0.25 * h**2 * a, v_star + 0.5 * h * a
        best = max(best, (float(row @ x[:modes]), n * h))
    return best[1], best[0]
