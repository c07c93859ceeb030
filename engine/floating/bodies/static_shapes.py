"""Static deflections of bodies under what hangs on them, as shapes beside their modes (residual attachment modes, as of
MacNeal 1971 and Rubin 1975): of beams that bend and stretch by closed forms, of other bodies by their finite elements.

At the end of a free beam modes have no curvature: under a moment there, such as a payload's inertia gives, their sum
converges as 1/N; so does that of axial modes under a force. In the closed forms x = s/length, and length and stiffness
are 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import factorial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from engine.bodies.modal.flexibility import Flexibility
    from engine.floating.bodies.beam import Part

FORCE, MOMENT, PULL = 3, 2, 1  # the derivative of a deflection that jumps where one acts; PULL: towards the beginning
BENDING, STRETCHING = 4, 2  # orders of the equations of beams
KINDS: dict[int, tuple[int, ...]] = {BENDING: (FORCE, MOMENT), STRETCHING: (PULL,)}
#: Derivatives that vanish at an end.
VANISH: dict[int, dict[str, tuple[int, ...]]] = {
    BENDING: {"clamped": (0, 1), "pinned": (0, 2), "free": (2, 3)},
    STRETCHING: {"clamped": (0,), "free": (1,)},
}
DEGREE = 5  # of the polynomials: of the inertial forces of a beam that nothing holds
NOTHING = 1e-10  # of a motion by one length: a deflection that is rounding, such as under a load at a clamped end
ALIKE = 1e-10  # of the largest eigenvalue of a mass matrix of unit diagonal: shapes that depend on each other
#: Of the flexibility at a place that modes may leave out of finite elements and nothing is added: half of it is how far
#: the frequency of what hangs there may be off. Of reductions whose modes hold the place rounding leaves 1e-12.
HELD = 1e-8


class Law(NamedTuple):
    """What a beam does along one axis: the order of its equation, its ends, the force (N) of its deflection by one
    length, and its length (m)."""

    order: int
    ends: tuple[str, str]
    stiffness: float
    length: float


class Deflections(NamedTuple):
    """Deflections A under unit loads at places (A,) of a kind (A,): sum over k of polynomials (6, A) x^k/k!, and beyond
    their places (x - place)^kind/kind!."""

    polynomials: Array
    places: Array
    kinds: Counts

    def derivatives(self, x: Array, order: int) -> Array:
        """(S, A) at x (S,)."""
        powers = np.stack([_power(x, k - order) for k in range(DEGREE + 1)], axis=1)
        found = powers @ self.polynomials
        beyond = np.maximum(x[:, None] - self.places, 0.0)
        for kind in (FORCE, MOMENT, PULL):
            found += np.where((beyond > 0.0) & (self.kinds == kind), _power(beyond, kind - order), 0.0)
        return np.asarray(found)

    def work(self, rows: dict[int, Array]) -> Array:
        """(N, A) work of the loads on deflections whose values and slopes at the places are rows (A, N) by order."""
        moved = np.where(self.kinds == MOMENT, rows[1].T, rows[0].T)
        return np.asarray(np.where(self.kinds == FORCE, moved, -moved))


def _power(x: Array, exponent: int) -> Array:
    """x^n/n!, and 0 of negative n."""
    return x**exponent / factorial(exponent) if exponent >= 0 else np.zeros_like(x)


def rigid_motions(order: int, ends: tuple[str, str]) -> Array:
    """(R, 2) constants and slopes of the motions without strain of a beam with such ends."""
    near, far = (end != "free" for end in ends)
    if "clamped" in ends or (near and far):
        return np.zeros((0, 2))
    lines = [[0.0, 1.0]] if near else [[1.0, -1.0]] if far else [[1.0, 0.0], [0.0, 1.0]]
    return np.array(lines[: order // 2])


def deflections(order: int, ends: tuple[str, str], places: Sequence[float]) -> Deflections:
    """Of a beam with such ends under the unit loads of its equation's order at each of some places of x; what nothing
    holds is carried by the inertia of its motion as a rigid body."""
    motions = rigid_motions(order, ends)
    inertia = np.zeros((DEGREE + 1, len(motions)))
    inertia[order : order + 2] = -motions.T
    one, vanish, unit = np.ones(1), VANISH[order], np.eye(DEGREE + 1)
    terms = np.concatenate([unit[:, :order], inertia], axis=1)
    at_far = np.array([[_power(one, k - row)[0] for k in range(DEGREE + 1)] for row in vanish[ends[1]]])
    conditions = np.concatenate([unit[list(vanish[ends[0]])], at_far]) @ terms
    found, loads = [], list(product(places, KINDS[order]))
    for place, kind in loads:
        jumps = [-_power(np.array([1.0 - place]), kind - row)[0] for row in vanish[ends[1]]]
        wanted = np.array([*np.zeros(len(vanish[ends[0]])), *jumps])
        found.append(terms @ np.linalg.lstsq(conditions, wanted, rcond=None)[0])
    return Deflections(np.array(found).T, np.array([p for p, _ in loads]), np.array([kind for _, kind in loads]))


@dataclass(frozen=True, eq=False)
class WithStatics:
    """Modes of a part and, after them, what they leave of static deflections of a beam of a length (m): these less
    their parts ``on_modes`` (N, A) along the modes, mixed (A, B) so that they are orthogonal to each other. held: the
    derivatives that vanish where the beam begins."""

    part: Part
    length: float
    statics: Deflections
    held: tuple[int, ...]
    on_modes: Array
    mixed: Array
    omega: Array

    @property
    def axis(self) -> int:
        return self.part.axis

    @property
    def about(self) -> int | None:
        return self.part.about

    @property
    def sense(self) -> float:
        return self.part.sense

    def derivatives(self, x: Array, orders: Sequence[int]) -> dict[int, Array]:
        modes = self.part.derivatives(x, orders)
        found = {}
        for order in orders:
            left = self._left(modes[order], x, order)
            for k in self.held:
                if k >= order:
                    left -= _power(x, k - order)[:, None] * self._at_beginning[k]
            found[order] = np.concatenate([modes[order], left @ self.mixed], axis=1)
        return found

    def _left(self, modes: Array, x: Array, order: int) -> Array:
        """(S, A) what modes (S, N) leave of the deflections at places (m); many modes leave little more than
        rounding."""
        return self.statics.derivatives(x / self.length, order) / self.length**order - modes @ self.on_modes

    @cached_property
    def _at_beginning(self) -> dict[int, Array]:
        """(1, A) by derivative, of those that vanish there: rounding, which would be told as a motion of the joint."""
        modes, start = self.part.derivatives(np.zeros(1), self.held), np.zeros(1)
        return {order: self._left(modes[order], start, order) for order in self.held}


def with_statics(part: Part, law: Law, places: Sequence[float], s: Array, dm: Array) -> Part:
    """The modes of a beam with what they leave of the deflections under loads at places (m); s (G,) m, dm (G,) kg: its
    mass."""
    if not places:
        return part
    x = s / law.length
    statics = deflections(law.order, law.ends, [place / law.length for place in places])
    statics = _without_rigid(statics, rigid_motions(law.order, law.ends), x, dm)
    rows = part.derivatives(statics.places * law.length, (0, 1))
    work = statics.work({0: rows[0], 1: rows[1] * law.length})
    squares = part.omega[:, None] ** 2
    on_modes = law.stiffness * work / squares
    left = statics.derivatives(x, 0) - part.derivatives(s, (0,))[0] @ on_modes
    own = statics.work({order: statics.derivatives(statics.places, order) for order in (0, 1)})
    K = law.stiffness * own - on_modes.T @ (squares * on_modes)
    M = left.T @ (dm[:, None] * left)
    mixed, omega = _principal(K, M, np.diag(M) > NOTHING**2 * dm.sum())
    held = tuple(order for order in VANISH[law.order][law.ends[0]] if order < law.order // 2)
    return WithStatics(part, law.length, statics, held, on_modes, mixed, np.concatenate([part.omega, omega]))


def _without_rigid(statics: Deflections, motions: Array, x: Array, dm: Array) -> Deflections:
    """The same less their motion as a rigid body, which is the frame's own."""
    lines = motions[:, :1] + motions[:, 1:] * x
    along = np.linalg.solve((lines * dm) @ lines.T, (lines * dm) @ statics.derivatives(x, 0))
    polynomials = statics.polynomials.copy()
    polynomials[:2] -= motions.T @ along
    return statics._replace(polynomials=polynomials)


def _principal(K: Array, M: Array, counts: NDArray[np.bool_]) -> tuple[Array, Array]:
    """(A, B) mixtures of unit mass, of those that count (A,), which neither mass nor stiffness couples, and their
    frequencies (B,)."""
    size = np.where(counts, np.sqrt(np.diag(M)), np.inf)
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    kept = values > ALIKE * values.max(initial=0.0)
    unit = vectors[:, kept] / np.sqrt(values[kept]) / size[:, None]
    squares, turned = np.linalg.eigh(unit.T @ (0.5 * (K + K.T)) @ unit)
    return unit @ turned, np.sqrt(squares)


class Motions(NamedTuple):
    """Of finite elements, of modes and of what they leave of static deflections: omega (N,) rad/s, shapes (n, N) of
    unit modal mass, and inertia (n, N): the accelerations, times -1, under which they have their strain, of modes
    omega^2 times their shapes."""

    omega: Array
    shapes: Array
    inertia: Array

    def with_statics(self, elements: Flexibility, loads: Array) -> Motions:
        """The same with what these leave of the deflections under loads (n, A)."""
        moved, squares = elements.solve(loads), self.omega[:, None] ** 2
        on_modes = (self.shapes.T @ loads) / squares
        left = moved - self.shapes @ on_modes
        relief = -elements.rigid @ (elements.rigid.T @ loads) - self.inertia @ on_modes
        K, M = left.T @ (elements.stiffness @ left), left.T @ (elements.mass @ left)
        mixed, omega = _principal(K, M, np.diag(K) > HELD * np.sum(loads * moved, axis=0))
        parts = (self.omega, omega), (self.shapes, left @ mixed), (self.inertia, relief @ mixed)
        return Motions(*(np.concatenate(part, axis=-1) for part in parts))
