"""Closed forms: what one step of a scheme makes of an undamped oscillator of omega h = x, as textbooks give it.

They share nothing with the march and are drawn over what it does.
"""

from __future__ import annotations

import math

import numpy as np

from results_schema.arrays import Array


def newmark(x: Array, beta: float, gamma: float) -> Array:
    """(n,) spectral radius of Newmark's family, from trace and determinant of its 2 x 2 matrix (Hughes 1987, 9.1)."""
    part = x**2 / (1.0 + beta * x**2)
    half_trace, determinant = 1.0 - 0.5 * (gamma + 0.5) * part, 1.0 - (gamma - 0.5) * part
    root = np.sqrt((half_trace**2 - determinant).astype(np.complex128))
    return np.asarray(np.maximum(np.abs(half_trace + root), np.abs(half_trace - root)))


def generalized_alpha(x: Array, alpha_m: float, alpha_f: float) -> Array:
    """(n,) spectral radius of generalized-alpha on (u, h u', h^2 a) (Chung and Hulbert 1993, equation 13)."""
    gamma = 0.5 - alpha_m + alpha_f
    beta = 0.25 * (1.0 - alpha_m + alpha_f) ** 2
    one = np.ones_like(x)
    # (1 - am) a' + am a + x^2 ((1 - af) u' + af u) = 0, with u' = u + v + (1/2 - beta) a + beta a'
    left = 1.0 - alpha_m + x**2 * (1.0 - alpha_f) * beta
    new = -np.stack([x**2, x**2 * (1.0 - alpha_f), alpha_m + x**2 * (1.0 - alpha_f) * (0.5 - beta)]) / left
    place = np.stack([one, one, (0.5 - beta) * one]) + beta * new
    speed = np.stack([0.0 * one, one, (1.0 - gamma) * one]) + gamma * new
    return _radius(np.stack([place, speed, new]))


def wilson(x: Array, theta: float) -> Array:
    """(n,) spectral radius of Wilson-theta on (u, h u', h^2 u''): linear acceleration over theta h."""
    one = np.ones_like(x)
    ahead = -(x**2) * np.stack([one, theta * one, theta**2 / 3.0 * one]) / (1.0 + x**2 * theta**2 / 6.0)
    new = ahead / theta + np.stack([0.0 * one, 0.0 * one, (1.0 - 1.0 / theta) * one])
    place = np.stack([one, one, one / 3.0]) + new / 6.0
    speed = np.stack([0.0 * one, one, 0.5 * one]) + 0.5 * new
    return _radius(np.stack([place, speed, new]))


def runge_kutta(x: Array) -> Array:
    """(n,) magnitude of the classic Runge-Kutta method's polynomial at i x."""
    return np.asarray(np.abs(sum((1j * x) ** k / math.factorial(k) for k in range(5))))


def _radius(matrix: Array) -> Array:
    """(n,) spectral radius of a matrix (3, 3, n)."""
    return np.asarray(np.abs(np.linalg.eigvals(np.moveaxis(matrix, -1, 0))).max(axis=-1))
