"""Fast enough references: many variants of one motion on a pinned beam at once, by DOP853 on the modal equations.

Shares nothing with the naive march: here F is eliminated by hand (Sherman and Morrison) instead of assembling matrices,

    F = (m g - m conv + m phi.(2 zeta omega q' + omega^2 q)) / (1 + m phi.phi)
    q'' = phi F - 2 zeta omega q' - omega^2 q
    conv = 2 s' phi'.q' + (s'^2 phi'' + s'' phi').q
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.floating[Any]]
Motion = Callable[[float], tuple[float, float, float]]


class Variants(NamedTuple):
    """Arrays (C,): mass, damping ratio, and 1 or 0 for with or without convective terms; wave numbers (N,)."""

    mass: Array
    zeta: Array
    convective: Array
    k: Array
    weight: float = 48.0

    @property
    def modes(self) -> int:
        return len(self.k)


class Passage(NamedTuple):
    """t, s: (S,). midspan, under, contact_force: (S, C). q and v at the end: (C, N)."""

    t: Array
    s: Array
    midspan: Array
    under: Array
    contact_force: Array
    q: Array
    v: Array


def variants(modes: int, rows: list[tuple[float, float, float]]) -> Variants:
    """Variants from rows (mass, zeta, convective)."""
    table = np.array(rows, dtype=np.float64)
    return Variants(table[:, 0], table[:, 1], table[:, 2], math.pi * np.arange(1, modes + 1))


Force = Callable[[tuple[float, float, float], Array, Array], tuple[Array, Array, Array]]


def _force(case: Variants) -> Force:
    """Of a motion's s, s' and s'', q and q' (C, N): phi (N,), elastic and damping forces (C, N), contact force (C,)."""
    k, root = case.k, math.sqrt(2.0) * np.ones(case.modes)
    root_k, k2, k4, damping = root * k, k**2, k**4, 2.0 * case.zeta[:, None] * k**2
    convective_mass = case.mass * case.convective

    def force(motion: tuple[float, float, float], q: Array, v: Array) -> tuple[Array, Array, Array]:
        s, ds, dds = motion
        ks = k * s
        phi, slope = root * np.sin(ks), root_k * np.cos(ks)
        inner = damping * v + k4 * q
        convective = v @ (2.0 * ds * slope) + q @ (dds * slope - ds**2 * k2 * phi)
        numerator = case.weight + case.mass * (inner @ phi) - convective_mass * convective
        return phi, inner, numerator / (1.0 + case.mass * (phi @ phi))

    return force


def equilibrium(case: Variants, s: float) -> Array:
    """Static coordinates (C, N) with the weight at s."""
    row = case.weight * math.sqrt(2.0) * np.sin(case.k * s) / case.k**4
    return np.repeat(row[None, :], len(case.mass), axis=0)


def integrate(case: Variants, motion: Motion, times: Array, start: Array, rtol: float = 1e-11) -> Passage:
    """Histories at `times` from coordinates `start` (C, N) at rest; dense output of order 7 between steps."""
    shape = (len(case.mass), case.modes)
    half = shape[0] * shape[1]
    force_of = _force(case)

    def slope(t: float, y: Array) -> Array:
        phi, inner, force = force_of(motion(t), y[:half].reshape(shape), y[half:].reshape(shape))
        found = np.empty_like(y)
        found[:half] = y[half:]
        np.subtract(force[:, None] * phi, inner, out=found[half:].reshape(shape))
        return found

    y0 = np.concatenate([start.ravel(), np.zeros(half)])
    solution = solve_ivp(slope, (times[0], times[-1]), y0, "DOP853", t_eval=times, rtol=rtol, atol=1e-3 * rtol)
    if not solution.success:
        raise RuntimeError(solution.message)
    return _observed(case, motion, times, solution.y.T)


def _observed(case: Variants, motion: Motion, times: Array, y: Array) -> Passage:
    shape = (len(case.mass), case.modes)
    row = math.sqrt(2.0) * np.sin(0.5 * math.pi * np.arange(1, case.modes + 1))
    under, force, s = np.empty((len(times), shape[0])), np.empty((len(times), shape[0])), np.empty(len(times))
    q, v = y[:, : y.shape[1] // 2].reshape(-1, *shape), y[:, y.shape[1] // 2 :].reshape(-1, *shape)
    force_of = _force(case)
    for n, t in enumerate(times):
        now = motion(t)
        phi, _, force[n] = force_of(now, q[n], v[n])
        under[n], s[n] = q[n] @ phi, now[0]
    return Passage(times, s, q @ row, under, force, q[-1], v[-1])


def cruise(case: Variants, alpha: float, focus: Sequence[float]) -> Passage:
    """A whole passage at v = pi alpha: 2000 equal stations and 400 more within 1e-3 of each position in `focus`.

    Under a mass the highest mode has hundreds of waves per passage, hence the finer places for smallest forces.
    """
    speed = math.pi * alpha
    fine = [np.linspace(max(at - 1e-3, 0.0), min(at + 1e-3, 1.0), 401) for at in focus]
    stations = np.unique(np.concatenate([np.linspace(0.0, 1.0, 2001), *fine]).round(12))
    start = np.zeros((len(case.mass), case.modes))
    return integrate(case, lambda t: (speed * t, speed, 0.0), stations / speed, start)


def largest(t: Array, y: Array) -> tuple[float, float]:
    """Instant and value of the maximum, by the parabola through the largest sample and its neighbours."""
    i = int(np.argmax(y))
    if i in (0, len(y) - 1):
        return float(t[i]), float(y[i])
    left, middle, right = (float(y[i + j]) for j in (-1, 0, 1))
    offset = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return float(t[i]) + offset * float(t[i + 1] - t[i]), middle - 0.25 * (left - right) * offset


def periodic(case: Variants, circular: float, amplitude: float, samples: int) -> Array:
    """Steady midspan response (samples, C) of the shuttle s = 1/2 + a sin(Om t), by Fourier collocation.

    The periodic solution is looked for at an odd number of equally spaced phases with the spectral derivative matrix,
    one linear system per variant; unlike a march it knows nothing of a start.
    """
    theta = 2.0 * math.pi * np.arange(samples) / samples
    s = 0.5 + amplitude * np.sin(theta)
    ds, dds = amplitude * circular * np.cos(theta), -amplitude * circular**2 * np.sin(theta)
    row = math.sqrt(2.0) * np.sin(0.5 * math.pi * np.arange(1, case.modes + 1))
    columns = [_collocated(case, c, circular, (s, ds, dds)) @ row for c in range(len(case.mass))]
    return np.stack(columns, axis=1)


def _collocated(case: Variants, c: int, circular: float, motion: tuple[Array, Array, Array]) -> Array:
    """Periodic coordinates (samples, N) of variant c."""
    s, ds, dds = motion
    k = math.pi * np.arange(1, case.modes + 1)
    mass, convective = case.mass[c], case.mass[c] * case.convective[c]
    phi, slope = math.sqrt(2.0) * np.sin(np.outer(s, k)), math.sqrt(2.0) * k * np.cos(np.outer(s, k))
    position = dds[:, None] * slope - ds[:, None] ** 2 * k**2 * phi
    inertia = np.eye(case.modes) + mass * phi[:, :, None] * phi[:, None, :]
    damping = np.diag(2.0 * case.zeta[c] * k**2) + convective * phi[:, :, None] * (2.0 * ds[:, None] * slope)[:, None]
    stiffness = np.diag(k**4) + convective * phi[:, :, None] * position[:, None]
    first = circular * _fourier_derivative(len(s))
    second = first @ first
    # axes (i, a, j, b): equation a at phase i, coordinate b at phase j
    whole = inertia[:, :, None, :] * second[:, None, :, None] + damping[:, :, None, :] * first[:, None, :, None]
    for i in range(len(s)):
        whole[i, :, i, :] += stiffness[i]
    size = len(s) * case.modes
    return np.linalg.solve(whole.reshape(size, size), (case.weight * phi).ravel()).reshape(len(s), case.modes)


def _fourier_derivative(samples: int) -> Array:
    """d/dtheta on an odd number of equally spaced points, shape (samples, samples)."""
    if samples % 2 == 0:
        raise ValueError("an odd number of samples, so that the second derivative is the square of the first")
    i = np.arange(samples)
    difference = i[:, None] - i[None, :]
    with np.errstate(divide="ignore"):
        matrix = 0.5 * (-1.0) ** difference / np.sin(math.pi * difference / samples)
    matrix[i, i] = 0.0
    return matrix
