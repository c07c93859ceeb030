"""The schemes that the maps compare, each with its place in the study file and its closed form."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from results_schema.arrays import Array
from studies.maps import amplification
from studies.maps.map_scene import AVERAGE

if TYPE_CHECKING:
    from engine.methods.comparison import ComparisonScheme


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
    radius = partial(amplification.newmark, beta=weight, gamma=damped)
    return Method(label, radius, limit, {"scheme": "newmark" if solver else label, **solver})


def _alpha(label: str, alpha_m: float, alpha_f: float, **solver: Any) -> Method:
    return Method(label, partial(amplification.generalized_alpha, alpha_m=alpha_m, alpha_f=alpha_f), solver=solver)


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
    Method("wilson-theta (1.4)", partial(amplification.wilson, theta=1.4), compared="wilson-theta"),
    Method("rk4", amplification.runge_kutta, math.sqrt(8.0), compared="rk4"),
)
LABELS = tuple(method.label for method in METHODS)
