"""Static flexibility and modes of a finite-element model: one factorisation serves both.

With rigid-body modes R (R^T M R = 1) loads are balanced by the inertia of the rigid motion: the flexibility is
A K_c^-1 A^T with A = 1 - R R^T M and K_c the stiffness held in as many places as there are rigid motions. Its
nonzero eigenvalues (with M) are 1/omega^2 of the elastic modes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.bodies.modal.modal_body import Array
from engine.linear_algebra import one_thread
from results_schema.errors import BadInput, shortened
from results_schema.lazy_imports import linalg, sparse

DENSE = 200  # degrees of freedom up to which all eigenvalues are computed
_COLUMNS = 64  # right-hand sides solved at a time
_ATTEMPTS = 4
ROUNDING = 1e-12  # of the largest motion: below it a solution has no digits
SAME_FREQUENCY = 1e-6  # relative difference of frequencies that count as equal


@dataclass(frozen=True, eq=False)
class Flexibility:
    """Answers K u = p for one stiffness; build it with `factorised`.

    rigid (n, r): rigid-body modes of unit mass; kept (m,): the degrees of freedom that are not held for the solve.
    """

    stiffness: sparse.csc_array
    mass: sparse.csc_array
    rigid: Array
    kept: Any
    factor: Any

    @property
    def size(self) -> int:
        """Degrees of freedom."""
        return int(self.stiffness.shape[0])

    def solve(self, loads: Array) -> Array:
        """(n, c) elastic displacements under loads (n, c)."""
        found = np.zeros_like(loads)
        for first in range(0, loads.shape[1], _COLUMNS):
            part = slice(first, first + _COLUMNS)
            found[:, part] = self._solve(loads[:, part])
        return found

    def _solve(self, loads: Array) -> Array:
        balanced = loads - self.mass @ (self.rigid @ (self.rigid.T @ loads))
        found = np.zeros_like(balanced)
        found[self.kept] = self.factor.solve(np.ascontiguousarray(balanced[self.kept]))
        return np.asarray(found - self.rigid @ (self.rigid.T @ (self.mass @ found)))

    def modes(self, count: int) -> tuple[Array, Array]:
        """omega (k,) and shapes (n, k) of the lowest `count` modes, rigid-body modes first, of unit modal mass.

        k is larger where the last group of equal frequencies asks for it, and smaller where there are no more.
        """
        rigid = self.rigid.shape[1]
        wanted = max(0, count - rigid)
        values, shapes = self._elastic(wanted + 6) if wanted else (np.zeros(0), self.rigid[:, :0])
        while 0 < wanted < len(values) and values[wanted] - values[wanted - 1] <= 2.0 * SAME_FREQUENCY * values[wanted]:
            wanted += 1
        omega = np.concatenate([np.zeros(rigid), np.sqrt(values[:wanted])])
        return omega, np.hstack([self.rigid, shapes[:, :wanted]])

    def _elastic(self, count: int) -> tuple[Array, Array]:
        """Eigenvalues omega^2, ascending, and shapes of at most `count` elastic modes."""
        if self.size <= DENSE or 3 * count > self.size:
            return self._all_elastic(count)
        for attempt in range(_ATTEMPTS):
            values, shapes = self._lowest(count + 4 * attempt, seed=attempt)
            if self._is_complete(values):
                return values[:count], shapes[:, :count]
        raise ArithmeticError(f"modes of a frame: some of {count} were not found")

    def _lowest(self, count: int, seed: int) -> tuple[Array, Array]:
        """The lowest elastic modes by Lanczos on the flexibility (shift-invert at zero)."""
        from scipy.sparse.linalg import LinearOperator, eigsh

        start = np.random.default_rng(seed).standard_normal(self.size)
        inverse = LinearOperator(
            (self.size, self.size), matvec=lambda load: self._solve(load.reshape(-1, 1))[:, 0], dtype=np.float64
        )
        lanczos = max(2 * count + 1, 40)
        values, shapes = eigsh(
            self.stiffness, count, self.mass, 0.0, OPinv=inverse, v0=self._solve(start[:, None])[:, 0], ncv=lanczos
        )
        return self._refined(values, shapes)

    def _refined(self, values: Array, shapes: Array) -> tuple[Array, Array]:
        """Sorted, of exactly unit mass and orthogonal: Rayleigh-Ritz in the space that was found."""
        shapes = shapes[:, np.argsort(values)]
        flexible = self._solve(self.mass @ shapes)
        strain, mass = flexible.T @ (self.mass @ shapes), shapes.T @ (self.mass @ shapes)
        inverse, turn = linalg.eigh(0.5 * (strain + strain.T), 0.5 * (mass + mass.T))
        order = np.argsort(-inverse)
        found = shapes @ turn[:, order]
        return 1.0 / inverse[order], found / np.sqrt(np.sum(found * (self.mass @ found), axis=0))

    def _is_complete(self, values: Array) -> bool:
        """Whether no eigenvalue is missing: the inertia of K - sigma M counts those below the last gap between them."""
        gaps = np.flatnonzero(np.diff(values) > 20.0 * SAME_FREQUENCY * values[1:])
        if not len(gaps):
            return True
        found = int(gaps[-1]) + 1
        below = self._number_below(0.5 * float(values[found - 1] + values[found]))
        return below is None or below == found

    def _number_below(self, shift: float) -> int | None:
        """Elastic eigenvalues below a number; None where the factorisation does not tell."""
        factor = symmetric_lu(sparse.csc_array(self.stiffness - shift * self.mass))
        if not np.array_equal(factor.perm_r, factor.perm_c):
            return None
        negative: Array = factor.U.diagonal() < 0.0
        return int(np.count_nonzero(negative)) - int(self.rigid.shape[1])

    def _all_elastic(self, count: int) -> tuple[Array, Array]:
        """The same with dense matrices, among motions without rigid part: M v = K v/omega^2 minds no singular mass."""
        stiffness, mass, rigid = self.stiffness.toarray(), self.mass.toarray(), self.rigid.shape[1]
        count = min(count, int(np.count_nonzero(np.diag(mass))) - rigid)
        last = self.size - rigid - 1
        lowest = [last - count + 1, last]
        if not rigid:
            inverse, shapes = linalg.eigh(mass, stiffness, subset_by_index=lowest)
            return self._refined(-inverse, shapes)
        apart = linalg.qr(mass @ self.rigid)[0][:, rigid:]
        inverse, shapes = linalg.eigh(apart.T @ mass @ apart, apart.T @ stiffness @ apart, subset_by_index=lowest)
        return self._refined(-inverse, apart @ shapes)


def without_rounding(motions: Array, axis: int | tuple[int, ...]) -> Array:
    """Motions with 0 in place of what is below 1e-12 of the largest along some axes: what the solver left of nothing.

    Section forces multiply it by large stiffnesses, and a body without axial load would read one.
    """
    largest = np.abs(motions).max(axis=axis, keepdims=True)
    return np.where(np.abs(motions) < ROUNDING * largest, 0.0, motions)


def factorised(stiffness: sparse.csc_array, mass: sparse.csc_array, rigid: Array) -> Flexibility:
    """Flexibility of a model: matrices (n, n) and any basis (n, r) of its motions without strain."""
    count = rigid.shape[1]
    modes = of_unit_mass(rigid, mass)
    held = linalg.qr(rigid.T, mode="r", pivoting=True)[1][:count] if count else np.zeros(0, dtype=np.int64)
    kept = np.setdiff1d(np.arange(stiffness.shape[0]), held)
    return Flexibility(stiffness, mass, modes, kept, symmetric_lu(stiffness[kept][:, kept].tocsc()))


def of_unit_mass(rigid: Array, mass: Any) -> Array:
    """The same motions with R^T M R = 1."""
    if not rigid.shape[1]:
        return rigid
    gram = rigid.T @ (mass @ rigid)
    return np.asarray(np.linalg.solve(np.linalg.cholesky(0.5 * (gram + gram.T)), rigid.T).T)


@contextmanager
def solving(what: str, where: str, expected: str) -> Iterator[Callable[..., None]]:
    """One thread of linear algebra, and a refusal of what fails, or of arrays in which the function that it gives finds
    what is not finite. Raises BadInput."""
    import scipy.linalg  # noqa: F401, its library is to be held too

    def demand_finite(*parts: Array) -> None:
        if not all(np.isfinite(part).all() for part in parts):
            raise ArithmeticError("a result that is not finite")

    try:
        with one_thread(), np.errstate(all="ignore"):
            yield demand_finite
    except (ArithmeticError, RuntimeError, ValueError, np.linalg.LinAlgError) as error:
        raise BadInput(what, where=where, expected=expected, received=shortened(str(error))) from error


def symmetric_lu(matrix: Any) -> Any:
    """The factors of a sparse symmetric matrix, whose pivots stay on the diagonal: their signs count eigenvalues."""
    from scipy.sparse.linalg import splu

    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
