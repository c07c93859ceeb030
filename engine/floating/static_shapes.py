"""Static deflections of beams under what hangs on them, as shapes beside their modes (residual attachment modes, as of
MacNeal 1971 and Rubin 1975).

At the end of a free beam modes have no curvature: under a moment there, such as a payload's inertia gives, their sum
converges as 1/N. Here x = s/length, and length and bending stiffness are 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import factorial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from engine.floating.elastic_beam import Bending

FORCE, MOMENT = 3, 2  # the derivative of a deflection that jumps where one acts
VANISH = {"clamped": (0, 1), "pinned": (0, 2), "free": (2, 3)}  # derivatives at an end
DEGREE = 5  # of the polynomials: of the inertial forces of a beam that nothing holds
NOTHING = 1e-10  # of a motion by one length: a deflection that is rounding, such as under a load at a clamped end
ALIKE = 1e-10  # of the largest eigenvalue of a mass matrix of unit diagonal: shapes that depend on each other


class Deflections(NamedTuple):
    """Deflections A under unit loads at places (A,) of a kind (A,): sum over k of polynomials (6, A) x^k/k!, and beyond
    their places (x - place)^kind/kind!."""

    polynomials: Array
    places: Array
    kinds: Counts

    def derivatives(self, x: Array, order: int) -> Array:
        """(S, A) at x (S,)."""
        powers = np.stack([_power(x, k - order) for k in range(DEGREE + 1)], axis=1)
        beyond = np.maximum(x[:, None] - self.places, 0.0)
        jumps = [np.where(beyond > 0.0, _power(beyond, kind - order), 0.0) for kind in (FORCE, MOMENT)]
        return np.asarray(powers @ self.polynomials + np.where(self.kinds == FORCE, *jumps))

    def work(self, rows: dict[int, Array]) -> Array:
        """(N, A) work of the loads on deflections whose values and slopes at the places are rows (A, N) by order."""
        return np.asarray(np.where(self.kinds == FORCE, rows[0].T, -rows[1].T))


def _power(x: Array, exponent: int) -> Array:
    """x^n/n!, and 0 of negative n."""
    return x**exponent / factorial(exponent) if exponent >= 0 else np.zeros_like(x)


def rigid_motions(ends: tuple[str, str]) -> Array:
    """(R, 2) constants and slopes of the motions without strain of a beam with such ends."""
    near, far = (end != "free" for end in ends)
    if "clamped" in ends or (near and far):
        return np.zeros((0, 2))
    return np.array([[0.0, 1.0]] if near else [[1.0, -1.0]] if far else [[1.0, 0.0], [0.0, 1.0]])


def deflections(ends: tuple[str, str], places: Sequence[float]) -> Deflections:
    """Of a beam with such ends under a force and a moment at each of some places of x; what nothing holds is carried by
    the inertia of its motion as a rigid body."""
    inertia = np.zeros((DEGREE + 1, len(rigid_motions(ends))))
    inertia[4:] = -rigid_motions(ends).T
    terms, one = np.concatenate([np.eye(DEGREE + 1)[:, :4], inertia], axis=1), np.ones(1)
    at_far = np.array([[_power(one, k - order)[0] for k in range(DEGREE + 1)] for order in VANISH[ends[1]]])
    conditions = np.concatenate([np.eye(DEGREE + 1)[list(VANISH[ends[0]])], at_far]) @ terms
    found, loads = [], list(product(places, (FORCE, MOMENT)))
    for place, kind in loads:
        jumps = [-_power(np.array([1.0 - place]), kind - order)[0] for order in VANISH[ends[1]]]
        found.append(terms @ np.linalg.lstsq(conditions, np.array([0.0, 0.0, *jumps]), rcond=None)[0])
    return Deflections(np.array(found).T, np.array([p for p, _ in loads]), np.array([kind for _, kind in loads]))


@dataclass(frozen=True, eq=False)
class WithStatics:
    """Modes of bending and, after them, what they leave of static deflections: these less their parts ``on_modes`` (N,
    A) along the modes, mixed (A, B) so that they are orthogonal to each other."""

    bending: Bending
    statics: Deflections
    on_modes: Array
    mixed: Array
    omega: Array

    @property
    def axis(self) -> int:
        return self.bending.axis

    @property
    def about(self) -> int:
        return self.bending.about

    @property
    def sense(self) -> float:
        return self.bending.sense

    def derivatives(self, x: Array, orders: Sequence[int]) -> dict[int, Array]:
        modes, length = self.bending.derivatives(x, orders), self.bending.beam.length
        return {order: self._both(modes[order], x / length, order, length**order) for order in orders}

    def _both(self, modes: Array, x: Array, order: int, scale: float) -> Array:
        left = self.statics.derivatives(x, order) / scale - modes @ self.on_modes
        return np.concatenate([modes, left @ self.mixed], axis=1)


def with_statics(bending: Bending, places: Sequence[float], s: Array, dm: Array) -> Bending | WithStatics:
    """The modes with what they leave of the deflections under loads at places (m); s (G,) m, dm (G,) kg: its mass."""
    beam = bending.beam
    if not places:
        return bending
    x = s / beam.length
    statics = deflections(beam.ends, [place / beam.length for place in places])
    statics = _without_rigid(statics, rigid_motions(beam.ends), x, dm)
    stiffness = beam.bending_stiffness / beam.length**3
    at = statics.places * beam.length
    rows = bending.derivatives(at, (0, 1))
    work = statics.work({0: rows[0], 1: rows[1] * beam.length})
    on_modes = stiffness * work / bending.omega[:, None] ** 2
    left = statics.derivatives(x, 0) - bending.derivatives(s, (0,))[0] @ on_modes
    own = statics.work({order: statics.derivatives(statics.places, order) for order in (0, 1)})
    K = stiffness * own - on_modes.T @ (bending.omega[:, None] ** 2 * on_modes)
    M = left.T @ (dm[:, None] * left)
    mixed, squares = _principal(0.5 * (K + K.T), M, dm.sum())
    return WithStatics(bending, statics, on_modes, mixed, np.concatenate([bending.omega, np.sqrt(squares)]))


def _without_rigid(statics: Deflections, motions: Array, x: Array, dm: Array) -> Deflections:
    """The same less their motion as a rigid body, which is the frame's own."""
    lines = motions[:, :1] + motions[:, 1:] * x
    along = np.linalg.solve((lines * dm) @ lines.T, (lines * dm) @ statics.derivatives(x, 0))
    polynomials = statics.polynomials.copy()
    polynomials[:2] -= motions.T @ along
    return statics._replace(polynomials=polynomials)


def _principal(K: Array, M: Array, mass: float) -> tuple[Array, Array]:
    """(A, B) mixtures of unit mass that neither mass nor stiffness couples, and their squared frequencies (B,)."""
    size = np.sqrt(np.diag(M))
    size = np.where(size > NOTHING * np.sqrt(mass), size, np.inf)
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    kept = values > ALIKE * values[-1]
    unit = vectors[:, kept] / np.sqrt(values[kept]) / size[:, None]
    squares, turned = np.linalg.eigh(unit.T @ K @ unit)
    return unit @ turned, squares
