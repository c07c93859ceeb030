"""Craig-Bampton reduction: static modes of interface degrees of freedom b and modes of the interior i with b held.

    x = [1; Psi] x_b + [0; Phi] eta,   Psi = -K_ii^-1 K_ib,   K_ii Phi = M_ii Phi Lambda

The reduced pair is made orthonormal: mass the identity, stiffness diagonal (seed 004, 11.2-11.5; Craig and Bampton
1968). Rigid-body modes lie in the static modes exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.bodies.modal.flexibility import factorised
from engine.bodies.modal.modal_body import Array
from results_schema.arrays import Counts
from results_schema.errors import BadInput
from results_schema.lazy_imports import sparse


@dataclass(frozen=True, eq=False)
class Reduction:
    """A model in the coordinates (x_b, eta): basis (n, m), stiffness and mass (m, m), interface (b,) among the n."""

    basis: Array
    stiffness: Array
    mass: Array
    interface: Counts

    def modes(self, rigid: Array) -> tuple[Array, Array]:
        """omega (m,) and shapes (n, m) of all modes of the reduced pair; rigid (n, r): motions without strain."""
        size = len(self.stiffness)
        motion = np.zeros((size, rigid.shape[1]))
        motion[: len(self.interface)] = rigid[self.interface]
        pair = factorised(sparse.csc_array(self.stiffness), sparse.csc_array(self.mass), motion)
        omega, shapes = pair.modes(size)
        return omega, self.basis @ shapes


def reduce_model(
    stiffness: sparse.csc_array, mass: sparse.csc_array, interface: Counts, interior_rigid: Array, fixed_modes: int
) -> Reduction:
    """Reduce (n, n) matrices to the interface and `fixed_modes` modes of the interior.

    interior_rigid (n - b, r): motions of the interior that nothing resists while the interface is held; there must be
    none. Raises BadInput.
    """
    size = stiffness.shape[0]
    interior = np.setdiff1d(np.arange(size), interface)
    if interior_rigid.shape[1]:
        what = "parts of the body move freely while the interface is held"
        raise BadInput(what, where="interface", expected="interface nodes on every part", remedy="add a node")
    inner = factorised(_part(stiffness, interior, interior), _part(mass, interior, interior), interior_rigid)
    coupled = _part(stiffness, interior, interface).toarray()
    statics = -inner.solve(coupled)
    omega, fixed = inner.modes(fixed_modes) if fixed_modes else (np.zeros(0), np.zeros((len(interior), 0)))
    omega, fixed = omega[:fixed_modes], fixed[:, :fixed_modes]
    borders, count = len(interface), len(interface) + len(omega)
    basis = np.zeros((size, count))
    basis[interface, np.arange(borders)] = 1.0
    basis[interior, :borders], basis[interior, borders:] = statics, fixed
    reduced = np.diag(np.concatenate([np.zeros(borders), omega**2]))
    held = _part(stiffness, interface, interface).toarray() + coupled.T @ statics
    reduced[:borders, :borders] = 0.5 * (held + held.T)
    masses = basis.T @ (mass @ basis)
    return Reduction(basis, reduced, 0.5 * (masses + masses.T), interface)


def _part(matrix: sparse.csc_array, rows: Counts, columns: Counts) -> Any:
    return matrix[rows][:, columns].tocsc()
