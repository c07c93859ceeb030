"""Time integration schemes, each a small object that names its coefficients, its limit and its phase.

A scheme brings a new acceleration x of every mode into displacement and velocity with the weights beta and gamma, on
top of predictors made of the step before. Everything else of the march is the same for all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol

import numpy as np

from engine.kernels.layout import Alpha, FloatArray, Newmark

# A scheme that takes 4 % a step or more out of a vibration with omega h = 5 keeps the highest mode from resonating with
# the march under a moving mass: measured, HHT-alpha -0.03, generalized-alpha 0.7 and gamma 0.53 do (growth at most 1.01
# with 0.3 to 1.1 times the rule's steps), -0.02, 0.85 and 0.52 do not (1.07 to 1.17).
_JUDGED_AT, _DAMPED = 5.0, 0.96
_FAR_BEYOND, _DAMPED_CONTACTS = 1e4, 0.906  # what HHT-alpha leaves with -0.05; with -0.02 contacts grow
_FAR = 1e100  # omega h beyond which nothing changes, and whose square is a number


class Scheme(Protocol):
    """What the program asks of a scheme.

    name: as in the study file. order: of its error on smooth, resolved scenes. coefficients: for the kernels.
    stability_limit: largest omega h of a body's undamped mode, infinite where there is none. oscillator_limit: the same
    of springs between bodies and what moves on them. scaled_from: omega h from which modes are marched with as much
    more mass, at this omega h whatever their own; infinite where none is. stride: steps that its coarsest march takes
    at once.
    """

    def __hash__(self) -> int: ...
    @property
    def name(self) -> str: ...
    @property
    def order(self) -> int: ...
    @property
    def stride(self) -> int: ...
    @property
    def coefficients(self) -> Newmark | Alpha: ...
    @property
    def stability_limit(self) -> float: ...
    @property
    def oscillator_limit(self) -> float: ...
    @property
    def scaled_from(self) -> float: ...

    def amplification(self, x: float) -> FloatArray:
        """Matrix of one step of an undamped oscillator of omega h = x, on its state in step units."""

    def velocity_at_kinks(self, x: FloatArray) -> FloatArray:
        """Velocity, over h^2, with which a mode of omega h = x starts where its load begins to grow at the rate of
        one, as velocities of the scheme may be other than derivatives; mostly none."""

    def velocity_part(self, x: FloatArray) -> FloatArray:
        """Velocity over that of a mode of omega h = x which swings freely, mostly one."""

    def phase(self, x: FloatArray) -> FloatArray:
        """Angle (0 to pi) by which an undamped oscillator of omega h = x turns in one step of the scheme."""


@dataclass(frozen=True)
class NewmarkScheme:
    """A member of Newmark's family: u and u' advance with weights beta and gamma (Newmark 1959).

    With ``scaled_from`` below the limit no mode of a body has one: those that are faster than a step can follow keep
    stiffness and damping and take as much more mass (selective mass scaling, Olovsson et al. 2005). With
    gamma = 1/2 this is Newmark's method with a larger beta for each of them,  beta + 1/scaled_from^2 - 1/(omega h)^2,
    but for the weights of the load.

    >>> NewmarkScheme("average-acceleration", beta=1 / 4, gamma=1 / 2).stability_limit
    inf
    >>> round(NewmarkScheme("linear-acceleration", beta=1 / 6, gamma=1 / 2).stability_limit, 3)
    3.464
    """

    name: str
    beta: float
    gamma: float
    order: int = 2
    stride: int = 1
    scaled_from: float = math.inf

    @property
    def coefficients(self) -> Newmark:
        """beta and gamma."""
        return Newmark(self.beta, self.gamma)

    def velocity_at_kinks(self, x: FloatArray) -> FloatArray:
        """Velocity, over h^2, with which a mode of omega h = x starts where its load begins to grow at the rate of one.

        Fox-Goodwin's velocity is q' + h^2 q'''/12. From rest a mode swings about r t/omega^2 by r/omega^3, as in truth,
        from  v = r/omega^2 (1 - s (1 - y^2/6)^1/2)  on, y = min(x, scaled_from), s = y/x.

        >>> scheme = NewmarkScheme("fox-goodwin", 1 / 12, 1 / 2, scaled_from=2.0)
        >>> scheme.velocity_at_kinks(np.array([0.0, 1e9])).round(6) + 0.0
        array([0.083333, 0.      ])
        """
        if math.isinf(self.scaled_from):
            return np.zeros_like(x)
        y = np.minimum(x, self.scaled_from)
        slower, root = np.where(x > y, y / np.maximum(x, 1.0), 1.0), np.sqrt(1.0 - y**2 / 6.0)
        return np.asarray(slower**2 * (1.0 / (6.0 * (1.0 + root)) + root * (1.0 - slower) / self.scaled_from**2))

    def velocity_part(self, x: FloatArray) -> FloatArray:
        """Velocity over that of a mode of omega h = x which swings freely:  s (1 + (beta - 1/4) y^2)^1/2  with
        gamma = 1/2, s and y as of `velocity_at_kinks`."""
        y = np.minimum(x, self.scaled_from)
        root = np.sqrt(np.maximum(1.0 + (self.beta - 0.25) * y**2, 0.0))  # beyond the limit nothing swings
        return np.asarray(np.where(x > y, y / np.maximum(x, 1.0), 1.0) * root)

    @property
    def stability_limit(self) -> float:
        """As of oscillators, and none where modes take mass."""
        return self.oscillator_limit if math.isinf(self.scaled_from) else math.inf

    @property
    def oscillator_limit(self) -> float:
        """(gamma/2 - beta)^-1/2, infinite from beta >= gamma/2 on."""
        slack = 0.5 * self.gamma - self.beta
        return math.inf if slack <= 0.0 else 1.0 / math.sqrt(slack)

    def amplification(self, x: float) -> FloatArray:
        """On (u, h u'): the accelerations -x^2 u at both ends put into Newmark's formulas."""
        x = min(x, self.scaled_from)
        new = np.array([[1.0 + self.beta * x**2, 0.0], [self.gamma * x**2, 1.0]])
        old = np.array([[1.0 - (0.5 - self.beta) * x**2, 1.0], [-(1.0 - self.gamma) * x**2, 1.0]])
        return np.asarray(np.linalg.solve(new, old))

    def phase(self, x: FloatArray) -> FloatArray:
        """Its cosine is half the trace of the amplification matrix over the root of its determinant."""
        square = np.minimum(x, min(self.scaled_from, _FAR)) ** 2
        part = square / (1.0 + self.beta * square)
        modulus = np.sqrt(np.maximum(1.0 - (self.gamma - 0.5) * part, np.finfo(float).tiny))
        return np.asarray(np.arccos(np.clip((1.0 - 0.5 * (self.gamma + 0.5) * part) / modulus, -1.0, 1.0)))


@dataclass(frozen=True)
class AlphaScheme:
    """Generalized-alpha (Chung and Hulbert 1993) in the form of Arnold and Bruels (2007).

    The equation of motion holds at every station with the true accelerations x, and an auxiliary acceleration a with
    (1 - m) a_new + m a = (1 - f) x_new + f x  enters Newmark's formulas: so a contact force that moves stays of second
    order. m, f: the weights alpha_m and alpha_f.

    >>> generalized_alpha(rho_inf=1.0).coefficients.gamma
    0.5
    """

    name: str
    m: float
    f: float
    order: int = 2
    stride: int = 1

    @property
    def gamma(self) -> float:
        """1/2 - m + f: of second order."""
        return 0.5 - self.m + self.f

    @property
    def beta(self) -> float:
        """(1 - m + f)^2/4: the most damping of the highest frequencies."""
        return 0.25 * (1.0 - self.m + self.f) ** 2

    @property
    def coefficients(self) -> Alpha:
        """Weights of x and of the memory e = (f x - m a)/(1 - m) of the step before, a = kappa x + e."""
        b, g, m, f = self.beta, self.gamma, self.m, self.f
        kappa, of_x, of_a = (1.0 - f) / (1.0 - m), f / (1.0 - m), -m / (1.0 - m)
        next_x, next_e = of_x + of_a * kappa, of_a
        return Alpha(
            beta=b * kappa,
            gamma=g * kappa,
            kappa=kappa,
            start_x=of_x,
            start_a=of_a,
            newmark_beta=b,
            newmark_gamma=g,
            next_x=next_x,
            next_e=next_e,
            velocity_x=(1.0 - g) * kappa + g * next_x,
            velocity_e=(1.0 - g) + g * next_e,
            displacement_x=(0.5 - b) * kappa + b * next_x,
            displacement_e=(0.5 - b) + b * next_e,
        )

    @property
    def stability_limit(self) -> float:
        """None: m <= f <= 1/2 and beta >= 1/4 + (f - m)/2 hold for every member offered."""
        return math.inf

    @property
    def oscillator_limit(self) -> float:
        """None either."""
        return math.inf

    @property
    def scaled_from(self) -> float:
        """Every mode keeps its mass."""
        return math.inf

    def velocity_at_kinks(self, x: FloatArray) -> FloatArray:
        """None."""
        return np.zeros_like(x)

    def velocity_part(self, x: FloatArray) -> FloatArray:
        """All of it."""
        return np.ones_like(x)

    def amplification(self, x: float) -> FloatArray:
        """On the predictors u*, v* and the memory e; the true acceleration is -x^2 u*/(1 + beta x^2)."""
        c = self.coefficients
        true = np.array([-(x**2) / (1.0 + c.beta * x**2), 0.0, 0.0])
        u, v, e = np.eye(3)
        u_now, v_now = u + c.beta * true, v + c.gamma * true
        v_next = v_now + c.velocity_x * true + c.velocity_e * e
        u_next = u_now + v_now + c.displacement_x * true + c.displacement_e * e
        return np.stack([u_next, v_next, c.next_x * true + c.next_e * e])

    def phase(self, x: FloatArray) -> FloatArray:
        """Of average acceleration, to which its phase is close where it damps little: 2 atan(x/2)."""
        return np.asarray(2.0 * np.arctan(0.5 * x))


@lru_cache(maxsize=64)
def is_damped(scheme: Scheme) -> bool:
    """Whether it damps high frequencies so much that a moving mass needs no alias rule."""
    return float(np.abs(np.linalg.eigvals(scheme.amplification(_JUDGED_AT))).max()) <= _DAMPED


@lru_cache(maxsize=64)
def damps_contacts(scheme: Scheme) -> bool:
    """Whether it damps what is far faster than its step so much that steps may be longer than periods of contacts."""
    return float(np.abs(np.linalg.eigvals(scheme.amplification(_FAR_BEYOND))).max()) <= _DAMPED_CONTACTS


def hht_alpha(alpha: float) -> AlphaScheme:
    """Hilber, Hughes and Taylor (1977), alpha from -1/3 (most damping) to 0 (average acceleration)."""
    return AlphaScheme("hht-alpha", 0.0, -alpha)


def generalized_alpha(rho_inf: float) -> AlphaScheme:
    """Chung and Hulbert (1993): rho_inf is the spectral radius of the highest frequencies, 0 to 1."""
    return AlphaScheme("generalized-alpha", (2.0 * rho_inf - 1.0) / (rho_inf + 1.0), rho_inf / (rho_inf + 1.0))


@dataclass(frozen=True)
class SchemeRow:
    """A scheme by its name in the study file, made of the parameters that stand there.

    parameters: the keys of [solver] that it takes, with what to write.
    """

    name: str
    make: Callable[[Mapping[str, float]], Scheme]
    parameters: Mapping[str, str] = field(default_factory=dict)

    def __call__(self, given: Mapping[str, float]) -> Scheme:
        """The scheme with these parameters."""
        return self.make(given)


def _newmark(name: str, beta: float, scaled_from: float = math.inf) -> SchemeRow:
    return SchemeRow(name, lambda given: NewmarkScheme(name, beta, 0.5, scaled_from=scaled_from))


#: omega h from which the scaled scheme gives modes more mass, inside Fox-Goodwin's limit of 2.45: passages took at
#: least 554, 472, 454, 470 and 467 modes x steps for 1e-3 with 1.2, 1.8, 2.0, 2.2 and 2.3, and 678 without it.
SCALED = 2.0

#: The scheme where the study names none and nothing speaks for another.
USUAL_SCHEME = "average-acceleration"

_ROWS = (
    _newmark("average-acceleration", 1 / 4),
    _newmark("linear-acceleration", 1 / 6),
    _newmark("fox-goodwin", 1 / 12),
    _newmark("scaled-fox-goodwin", 1 / 12, SCALED),
    _newmark("central-difference", 0.0),
    SchemeRow(
        "newmark",
        lambda given: NewmarkScheme("newmark", given["beta"], given["gamma"], 2 if given["gamma"] == 0.5 else 1),
        {"beta": "0.3025, say, from 0 to 1", "gamma": "0.6, say, from 0.5 to 1.5"},
    ),
    SchemeRow("hht-alpha", lambda given: hht_alpha(given["alpha"]), {"alpha": "-0.05, say, from -1/3 to 0"}),
    SchemeRow(
        "generalized-alpha", lambda given: generalized_alpha(given["rho_inf"]), {"rho_inf": "0.8, say, from 0 to 1"}
    ),
    # average acceleration with h and 2h: the march is the same, `engine.march.richardson` makes the pair
    SchemeRow("richardson", lambda given: NewmarkScheme("richardson", 1 / 4, 1 / 2, 4, 2)),
)

#: Every scheme of the program by its name.
SCHEMES: Mapping[str, SchemeRow] = {row.name: row for row in _ROWS}
