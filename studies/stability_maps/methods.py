"""The schemes that the maps compare, each with its place in the study file and its closed form."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from results_schema.arrays import Array
from studies.stability_maps.map_scene import AVERAGE

if TYPE_CHECKING:
    from engine.methods.comparison import ComparisonScheme


def newmark(x: Array, beta: float, gamma: float) -> Array:
    """(n,) spectral radius of Newmark's family, from trace and determinant of its 2 x 2 matrix (Hughes 1987, 9.1)."""
    part = x**2 / (1.0 + beta * x**2)
    half_trace, determinant = 1.0 - 0.5 * (gamma + 0.5) * part, 1.0 - (gamma - 0.5) * part
    root = np.sqrt((half_trace**2 - determinant).astype(np.complex128))
    return np.asarray(np.maximum(np.abs(half_trace + root), np.abs(half_trace - root)))


def scaled_fox_goodwin(x: Array) -> Array:
    """(n,) spectral radius of Fox-Goodwin where modes of omega h above 2 take so much mass that it is 2."""
    return newmark(np.minimum(x, 2.0), beta=1 / 12, gamma=0.5)


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


@dataclass(frozen=True)
class Method:
    """A scheme of the march by its table [solver], or one that is offered for comparison by its name.

    label: as in the archive. radius: closed form over omega h. limit: of omega h, infinite where there is none.
    """

    label: str
    radius: Callable[[Array], Array]
    limit: float = math.inf
    solver: Mapping[str, Any] | None = None
    compared: str = ""

    @property
    def scheme(self) -> ComparisonScheme | None:
        """The comparison scheme; None for one of the march."""
        from engine.methods.comparison import COMPARISON

        return COMPARISON[self.compared] if self.compared else None

    @property
    def table(self) -> Mapping[str, Any]:
        """The table [solver] of its scenes."""
        return self.solver or AVERAGE


def _newmark(label: str, weight: float, damped: float = 0.5, limit: float = math.inf, **solver: float) -> Method:
    radius = partial(newmark, beta=weight, gamma=damped)
    return Method(label, radius, limit, {"scheme": "newmark" if solver else label, **solver})


def _alpha(label: str, alpha_m: float, alpha_f: float, **solver: Any) -> Method:
    return Method(label, partial(generalized_alpha, alpha_m=alpha_m, alpha_f=alpha_f), solver=solver)


def hht(alpha: float) -> Method:
    """HHT-alpha: generalized-alpha with alpha_m = 0, alpha_f = -alpha."""
    return _alpha(f"hht-alpha ({alpha:g})", 0.0, -alpha, scheme="hht-alpha", alpha=alpha)


def generalized(rho: float) -> Method:
    """Generalized-alpha by the spectral radius of the highest frequencies."""
    alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    return _alpha(f"generalized-alpha ({rho:g})", alpha_m, alpha_f, scheme="generalized-alpha", rho_inf=rho)


#: Every scheme whose growth and overshoot are mapped.
METHODS: tuple[Method, ...] = (
    _newmark("average-acceleration", 1 / 4),
    _newmark("linear-acceleration", 1 / 6, limit=math.sqrt(12.0)),
    _newmark("fox-goodwin", 1 / 12, limit=math.sqrt(6.0)),
    _newmark("central-difference", 0.0, limit=2.0),
    _newmark("newmark (0.3025, 0.6)", 0.3025, 0.6, beta=0.3025, gamma=0.6),
    hht(-0.05),
    hht(-0.3),
    generalized(0.8),
    generalized(0.0),
    Method("wilson-theta (1.4)", partial(wilson, theta=1.4), compared="wilson-theta"),
    Method("rk4", runge_kutta, math.sqrt(8.0), compared="rk4"),
    Method("scaled-fox-goodwin", scaled_fox_goodwin, solver={"scheme": "scaled-fox-goodwin"}),
)
LABELS = tuple(method.label for method in METHODS)
