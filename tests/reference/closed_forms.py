"""Closed forms: beams' modes, moving forces, influence lines, residual vibration, trains, impulses.

Lengths, stiffnesses and masses in any consistent units; w positive along the load.
"""

import cmath
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class PinnedBeam:
    """Uniform pinned beam; modes k = 1..N: sqrt(2/(m L)) sin(k pi s/L), omega_k = (k pi/L)^2 sqrt(EI/m)."""

    modes: int
    length: float = 1.0
    bending_stiffness: float = 1.0
    mass_per_length: float = 1.0

    @property
    def wave_numbers(self) -> Array:
        """k pi/L, shape (N,)."""
        return np.arange(1, self.modes + 1) * math.pi / self.length

    @property
    def omega(self) -> Array:
        """Circular frequencies, shape (N,)."""
        omega: Array = self.wave_numbers**2 * math.sqrt(self.bending_stiffness / self.mass_per_length)
        return omega

    def phi(self, s: float, derivative: int) -> Array:
        """Unit-mass shape functions' derivative at s, shape (N,): sin shifted by a quarter wave per derivative."""
        k = self.wave_numbers
        scale = math.sqrt(2.0 / (self.mass_per_length * self.length))
        row: Array = scale * k**derivative * np.sin(k * s + 0.5 * math.pi * derivative)
        return row

    @property
    def own_weight(self) -> Array:
        """Integral of m phi over the span, shape (N,): modal force of the body's own weight per unit gravity."""
        k = np.arange(1, self.modes + 1)
        scale = math.sqrt(2.0 * self.mass_per_length * self.length)
        return np.where(k % 2 == 1, 2.0, 0.0) * scale / (k * math.pi)


def moving_force(beam: PinnedBeam, force: float, speed: float, x: float, t: Array) -> Array:
    """Deflection at x while a constant force crosses a resting undamped pinned beam, shape of t.

    Each mode: q'' + w^2 q = f sin(O t), O = k pi v/L, hence q = f (sin O t - (O/w) sin w t)/(w^2 - O^2), and at
    resonance O = w: q = f (sin w t - w t cos w t)/(2 w^2).
    """
    frequencies, wave_numbers = beam.omega, beam.wave_numbers
    row = beam.phi(x, 0)
    scale = math.sqrt(2.0 / (beam.mass_per_length * beam.length)) * force
    total = np.zeros_like(t)
    for k in range(beam.modes):
        w, driven = float(frequencies[k]), float(wave_numbers[k]) * speed
        if abs(driven - w) < 1e-9 * w:
            q = scale * (np.sin(w * t) - w * t * np.cos(w * t)) / (2.0 * w * w)
        else:
            q = scale * (np.sin(driven * t) - driven / w * np.sin(w * t)) / (w * w - driven * driven)
        total += row[k] * q
    return total


def midspan_static(beam: PinnedBeam, force: float) -> float:
    """P L^3/(48 E I)."""
    return force * beam.length**3 / (48.0 * beam.bending_stiffness)


def residual_amplitude(alpha: float) -> float:
    """Amplitude of mode 1 at midspan after the exit over 2 P L^3/(pi^4 E I), undamped.

    2 alpha |cos(pi/(2 alpha))|/|1 - alpha^2|, pi/2 at alpha = 1.
    """
    if abs(alpha - 1.0) < 1e-9:
        return 0.5 * math.pi
    return 2.0 * alpha * abs(math.cos(0.5 * math.pi / alpha)) / abs(1.0 - alpha**2)


def train_gain(forces: int, zeta: float, cycles_between: float) -> float:
    """Mode-1 amplitude after the last of equal forces over that of one; cycles_between = f1 d/v.

    |1 + z + ... + z^(n-1)|, z = exp((-zeta + i sqrt(1 - zeta^2)) 2 pi cycles_between).
    """
    z = cmath.exp(complex(-zeta, math.sqrt(1.0 - zeta**2)) * 2.0 * math.pi * cycles_between)
    return abs(sum(z**n for n in range(forces)))


def influence_pinned(x: float, s: float, length: float = 1.0, stiffness: float = 1.0) -> float:
    """Static deflection at x of a pinned beam per unit force at s: b x (L^2 - b^2 - x^2)/(6 E I L); x <= s, b = L-s."""
    x, s = (x, s) if x <= s else (s, x)
    b = length - s
    return b * x * (length**2 - b**2 - x**2) / (6.0 * stiffness * length)


def influence_end_springs(x: float, s: float, springs: tuple[float, float]) -> float:
    """The same with L = E I = 1 on springs k_a, k_b at its ends: the rigid part (1-s)(1-x)/k_a + s x/k_b is added."""
    k_a, k_b = springs
    return influence_pinned(x, s) + (1.0 - s) * (1.0 - x) / k_a + s * x / k_b


def influence_cantilever(x: float, s: float) -> float:
    """Clamped at 0, free at 1, L = E I = 1: a^2 (3 b - a)/6 with a the smaller and b the larger of x, s."""
    a, b = min(x, s), max(x, s)
    return a**2 * (3.0 * b - a) / 6.0


def influence_clamped(x: float, s: float) -> float:
    """Clamped at both ends, L = E I = 1: x^2 b^2 (3 s - x (3 s + b))/6 for x <= s, b = 1 - s."""
    x, s = (x, s) if x <= s else (s, x)
    b = 1.0 - s
    return x**2 * b**2 * (3.0 * s - x * (3.0 * s + b)) / 6.0


def own_weight_pinned(x: float) -> float:
    """Deflection under unit load per length, L = E I = 1: x (1 - 2 x^2 + x^3)/24."""
    return x * (1.0 - 2.0 * x**2 + x**3) / 24.0


def quasi_static_contact_force(mu: float, alpha: float) -> float:
    """F/mg at midspan of a pinned beam, F = m (g - v^2 d^2/ds^2 [mg s^2 (L-s)^2/(3 E I L)]): 1 + pi^2 mu alpha^2/3."""
    return 1.0 + math.pi**2 * mu * alpha**2 / 3.0


def reversal_impulse(mass: float, row: Array, slope_row: Array, q: Array, speed_jump: float) -> Array:
    """dq' of one mass whose speed jumps: -(I + m phi phi^T)^-1 m phi ds' phi'.q, by Sherman and Morrison; (N,)."""
    return -mass * row * speed_jump * (slope_row @ q) / (1.0 + mass * (row @ row))


def arrival_impulse(mass: float, row: Array, mismatch: float) -> Array:
    """dq' by one arriving mass; mismatch = phi.q' + s' phi'.q - w'_before; (N,)."""
    return -mass * row * mismatch / (1.0 + mass * (row @ row))


@dataclass(frozen=True)
class End:
    """One end of a beam with L = E I = 1: springs against deflection and rotation; inf is a rigid support."""

    deflection: float
    rotation: float


PINNED, CLAMPED, FREE = End(math.inf, 0.0), End(math.inf, math.inf), End(0.0, 0.0)


def _waves(b: float, x: float, derivative: int) -> Array:
    """sin bx, cos bx, exp(-bx), exp(-b(1-x)) differentiated and divided by b^derivative, shape (4,)."""
    shift = 0.5 * math.pi * derivative
    return np.array(
        [math.sin(b * x + shift), math.cos(b * x + shift), (-1.0) ** derivative * math.exp(-b * x), math.exp(b * x - b)]
    )


def _end_rows(b: float, x: float, outward: float, end: End) -> tuple[Array, Array]:
    """The two conditions of an end; outward = -1 at x = 0, +1 at x = 1.

    The beam's force and moment on the spring: w''' outward = k w, w'' outward = -k_r w'.
    """
    w, slope, bend, shear = (_waves(b, x, j) for j in range(4))
    force = w if math.isinf(end.deflection) else outward * b**3 * shear - end.deflection * w
    moment = slope if math.isinf(end.rotation) else outward * b * bend + end.rotation * slope
    return force / np.abs(force).max(), moment / np.abs(moment).max()


def characteristic_determinant(b: float, left: End, right: End) -> float:
    """Zero where b^4 = omega^2 m L^4/(E I) belongs to a mode; well scaled for every b > 0."""
    rows = (*_end_rows(b, 0.0, -1.0, left), *_end_rows(b, 1.0, 1.0, right))
    return float(np.linalg.det(np.array(rows)))


def characteristic_values(left: End, right: End, count: int) -> list[float]:
    """The first `count` positive b = beta L of a uniform beam; rigid-body modes (b = 0) are not among them."""
    found: list[float] = []
    step = 0.02
    b = 0.1
    below = characteristic_determinant(b, left, right)
    while len(found) < count:
        above = characteristic_determinant(b + step, left, right)
        if below * above < 0.0:
            found.append(float(brentq(characteristic_determinant, b, b + step, args=(left, right), xtol=1e-14)))
        b, below = b + step, above
    return found
