"""Time integration schemes, each a small object that names its coefficients."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Scheme:
    """A member of Newmark's family: u and u' advance with weights beta and gamma (Newmark 1959).

    >>> Scheme(beta=1 / 4, gamma=1 / 2).stability_limit
    inf
    >>> round(Scheme(beta=1 / 6, gamma=1 / 2).stability_limit, 3)
    3.464
    """

    beta: float
    gamma: float

    @property
    def stability_limit(self) -> float:
        """Largest omega h of an undamped oscillator: (gamma/2 - beta)^-1/2, infinite from beta >= gamma/2 on."""
        slack = 0.5 * self.gamma - self.beta
        return math.inf if slack <= 0.0 else 1.0 / math.sqrt(slack)
