"""Exact statics of a uniform Euler-Bernoulli beam on any set of rigid or elastic restraints.

Place and deflection are made dimensionless with L and L^3/EI. A unit force at s on an endless beam gives
g(x, s) = |x - s|^3/12 up to a linear function, and every restraint is a linear functional r_j of the deflection
(its value or its slope at x_j) with a compliance d_j (0 = rigid) and a reaction lambda_j:

    w(x) = g(x, s) - sum_j lambda_j r_j[g(x, .)] + z_0 + z_1 x
    r_i[w] = d_i lambda_i                    every restraint
    sum_j lambda_j r_j[1, x] = (1, s)        equilibrium of forces and moments

The equations have one symmetric matrix S and the right-hand side u(s) = (r_j[g(., s)], -1, -s), so that

    w(x) = g(x, s) - u(x)^T S^-1 u(s),

which is symmetric in x and s (Maxwell) and needs two rows of u per value. A rigid-body mode phi_r is one more
functional, r[w] = integral of phi_r w = 0, whose reaction is the inertia load phi_r(s) phi_r(x): inertia relief.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.modal.modal_body import SAME_PLACE, Array, frozen, refuse_loose
from engine.kernels.influence import Functionals, functionals, influence
from results_schema.errors import BadInput

HIGHEST_DERIVATIVE = 3
_ON_BODY = 1e-12  # stations this far off the ends (in lengths) are taken as the ends


@dataclass(frozen=True, order=True)
class Restraint:
    """One restrained quantity at one place, dimensionless.

    at: place in [0, 1]; order: 0 deflection, 1 slope; compliance: E I/(k L^3) or E I/(k_r L), 0 = rigid.
    """

    at: float
    order: int
    compliance: float


def merge(restraints: Iterable[Restraint]) -> tuple[Restraint, ...]:
    """One restraint per place and kind, sorted; stiffnesses add up, places within 1e-9 lengths are one place.

    >>> merge([Restraint(0.5, 0, 1.0), Restraint(0.5, 0, 1.0), Restraint(0.0, 0, 0.0)])
    (Restraint(at=0.0, order=0, compliance=0.0), Restraint(at=0.5, order=0, compliance=0.5))
    """
    found: dict[tuple[float, int], float] = {}
    place = 0.0
    for one in sorted(restraints):
        if one.at - place > SAME_PLACE:
            place = one.at if 1.0 - one.at > SAME_PLACE else 1.0
        compliance, other = one.compliance, found.get((place, one.order), np.inf)
        if other < np.inf:
            compliance = 0.0 if 0.0 in (compliance, other) else 1.0 / (1.0 / compliance + 1.0 / other)
        found[place, one.order] = compliance
    return tuple(Restraint(at, order, compliance) for (at, order), compliance in sorted(found.items()))


def rigid_body_modes(restraints: Sequence[Restraint]) -> Array:
    """(R, 2) coefficients (a, b) of the rigid motions a + b x that no restraint resists, orthonormal on [0, 1].

    >>> rigid_body_modes([Restraint(0.0, 0, 0.0)]).shape
    (1, 2)
    """
    held = {one.at for one in restraints if one.order == 0}
    if any(one.order == 1 for one in restraints):
        return np.zeros((0, 2)) if held else np.array([[1.0, 0.0]])
    if not held:
        return np.array([[1.0, 0.0], [np.sqrt(3.0), -2.0 * np.sqrt(3.0)]])
    if len(held) > 1:
        return np.zeros((0, 2))
    (pivot,) = held
    line: Array = np.array([[-pivot, 1.0]]) / np.sqrt(1.0 / 3.0 - pivot + pivot**2)
    return line


def stations(places: ArrayLike, length: float, *derivatives: int) -> Array:
    """Dimensionless places in [0, 1]; raises BadInput for one off the body or a derivative outside 0..3."""
    for derivative in (one for one in derivatives if one not in range(HIGHEST_DERIVATIVE + 1)):
        raise BadInput(
            "derivative of a shape",
            where="derivative",
            expected=f"an integer from 0 to {HIGHEST_DERIVATIVE}",
            received=repr(derivative),
            remedy="the bending moment needs the second, the shear force the third",
        )
    x = np.atleast_1d(np.asarray(places, dtype=np.float64)) / length
    if x.size and not (x.min() >= -_ON_BODY and x.max() <= 1.0 + _ON_BODY):  # in this form NaN is outside
        outside = ~((x >= -_ON_BODY) & (x <= 1.0 + _ON_BODY))
        received, remedy = f"{x[outside][0] * length:g} m", "leave out the time when the load is off the body"
        raise BadInput("place off the body", where="s", expected=f"0 to {length:g} m", received=received, remedy=remedy)
    return np.asarray(np.minimum(np.maximum(x, 0.0), 1.0))


def _functionals(restraints: Sequence[Restraint], rigid: Array) -> Functionals:
    at, order = ([getattr(one, name) for one in restraints] for name in ("at", "order"))
    return Functionals(np.array(at, dtype=np.float64), np.array(order, dtype=np.int64), np.ascontiguousarray(rigid))


def _at(of: Functionals, x: ArrayLike, derivative: int) -> Array:
    """(S, n) d^j/dx^j of u at x (S,)."""
    places = np.atleast_1d(np.asarray(x, dtype=np.float64))
    found = np.empty((places.size, of.at.size + len(of.rigid) + 2))
    functionals(of, places, derivative, found)
    return found


def _even_load(x: ArrayLike, derivative: int) -> Array:
    """(S,) d^j/dx^j of the integral over t in [0, 1] of g(x, t)."""
    return _at(Functionals(np.zeros(0), np.zeros(0, dtype=np.int64), np.array([[1.0, 0.0]])), x, derivative)[:, 0]


def beam_statics(
    length: float, bending_stiffness: float, mass_per_length: float, restraints: Iterable[Restraint]
) -> BeamStatics:
    """Statics of a uniform beam: m, N m^2, kg/m, and its restraints in dimensionless form.

    A pinned beam under a unit force at midspan deflects by L^3/48EI:

    >>> pinned = beam_statics(2.0, 1.0, 1.0, [Restraint(0.0, 0, 0.0), Restraint(1.0, 0, 0.0)])
    >>> round(float(pinned.influence_at(1.0, 1.0)[0]) * 48 / 8, 12)
    1.0
    """
    merged = merge(restraints)
    return BeamStatics(length, bending_stiffness, mass_per_length, merged, rigid_body_modes(merged), _inverse(merged))


@lru_cache(maxsize=256)
def _inverse(restraints: tuple[Restraint, ...]) -> Array:
    """The inverse of the matrix S: each functional applied to u, compliances on the diagonal."""
    rigid = rigid_body_modes(restraints)
    count, of = len(restraints), _functionals(restraints, rigid)
    size = count + len(rigid) + 2
    system = np.zeros((size, size))
    for i, one in enumerate(restraints):
        system[i] = system[:, i] = _at(of, one.at, one.order)[0]
        system[i, i] += one.compliance
    if len(rigid):
        points, weights = np.polynomial.legendre.leggauss(4)  # exact up to degree 7; phi_r times u is of degree 6
        x = 0.5 + 0.5 * points
        rows = _at(of, x, 0)[:, count:].T
        for i, (a, b) in enumerate(rigid, start=count):
            system[i, count:] = rows @ (0.5 * weights * (a + b * x))
            system[count:, i] = system[i, count:]
    return frozen(_equilibrated_inverse(system))


def _equilibrated_inverse(system: Array) -> Array:
    """Symmetric inverse; rows and columns are first scaled to one, as springs may differ by twenty decades."""
    scale = np.ones(len(system))
    for _ in range(20):
        largest = np.abs(system * scale[:, None] * scale[None, :]).max(axis=1)
        scale /= np.sqrt(largest)
    inverse = np.linalg.inv(system * scale[:, None] * scale[None, :])
    return 0.5 * (inverse + inverse.T) * scale[:, None] * scale[None, :]


@dataclass(frozen=True, eq=False)
class BeamStatics:
    """Influence function of a uniform beam; build it with `beam_statics`.

    length m; bending_stiffness N m^2; mass_per_length kg/m; restraints (merged, dimensionless);
    rigid (R, 2) rigid-body modes; inverse (n, n) of S, n = restraints + R + 2.
    """

    length: float
    bending_stiffness: float
    mass_per_length: float
    restraints: tuple[Restraint, ...]
    rigid: Array
    inverse: Array

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` per unit force at `s`, m^(1-j)/N, for pairs that are broadcast against each
        other; summed in a fixed order, so that a value never depends on its neighbours."""
        left, right = stations(x, self.length, derivative), stations(s, self.length, 0)
        shape = np.broadcast_shapes(left.shape, right.shape)
        pairs = (
            one if one.size == 1 or one.shape == shape else np.broadcast_to(one, shape).copy() for one in (left, right)
        )
        left, right = (one.reshape(-1) for one in pairs)
        found = np.empty(math.prod(shape))
        influence(self._functionals, self.inverse, left, right, derivative, found)
        return found.reshape(shape) * (self.length ** (3 - derivative) / self.bending_stiffness)

    @cached_property
    def _functionals(self) -> Functionals:
        return _functionals(self.restraints, self.rigid)

    @property
    def _under_even_load(self) -> Array:
        """(n,) reactions, and the rigid motion, under a unit load per length, dimensionless."""
        load = [*(_even_load(one.at, one.order)[0] for one in self.restraints), -1.0, -0.5]
        return np.asarray(self.inverse @ np.array(load))

    def support_at(self, place: float) -> int:
        """Number of the restraint of the deflection at a place, m. Raises BadInput where there is none."""
        x = place / self.length
        for number, one in enumerate(self.restraints):
            if one.order == 0 and abs(one.at - x) <= SAME_PLACE:
                return number
        raise BadInput("no support here", where="at", expected="the place of a support", received=f"{place:.10g} m")

    def reaction_at(self, support: int, s: ArrayLike) -> Array:
        """(S,) what a support carries of a unit force at `s` (S,)."""
        rows = _at(self._functionals, stations(s, self.length, 0), 0)
        return np.asarray(np.sum(rows * self.inverse[support], axis=1))

    def reaction_of_own_weight(self, support: int) -> float:
        """What it carries of the beam's own weight per unit gravity, kg, where the supports hold that."""
        return float(self._under_even_load[support] * self.mass_per_length * self.length)

    def own_weight_deflection(self, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) under the beam's own weight per unit gravity, m^(1-j)/(m/s^2)."""
        refuse_loose(len(self.rigid))
        place = stations(x, self.length, derivative)
        unit = _even_load(place, derivative)
        for row, reaction in zip(_at(self._functionals, place, derivative).T, self._under_even_load, strict=True):
            unit = unit - row * reaction
        return unit * self.mass_per_length * self.length ** (4 - derivative) / self.bending_stiffness
