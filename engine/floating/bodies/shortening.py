"""Displacements of second order, -1/2 sum_ij G_ij q_i q_j: where a track bends, its places come nearer to its
beginning, and what pulls at them stiffens the body (or softens it, where it pushes)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from engine.floating.bodies.fields import Along, Y, Z
from results_schema.arrays import Array

PIECES = 32  # of a track, at least, each integrated by Gauss: exact for slopes of some 80 half waves
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


class Shortening(Protocol):
    """G of a body with N modes along A axes: 1, its track's, or all 3 of its frame."""

    @property
    def axes(self) -> int: ...

    def along(self, x: Array) -> Array:
        """(3, S, A, N, N): G and its first two derivatives at ascending places (S,) m of the track."""
        ...

    @property
    def integrals(self) -> tuple[Array, Array]:
        """(A, N, N) and (A, 3, N, N): of G dm and of G c^T dm, c the places of the undeformed body."""
        ...


@dataclass(frozen=True, eq=False)
class BeamShortening:
    """G(x) = int_0^x (v_i' v_j' + w_i' w_j') of a beam, places (G,) m and masses (G,) kg."""

    fields: Along
    places: Array
    masses: Array
    axes: int = 1

    def along(self, x: Array) -> Array:
        one, two = self.fields.fields(x, (1, 2))
        change = np.einsum("sai,saj->sij", two[:, Y : Z + 1], one[:, Y : Z + 1])
        found = np.stack([self._up_to(x), _products(one), change + np.swapaxes(change, 1, 2)])
        return found[:, :, None]

    @cached_property
    def integrals(self) -> tuple[Array, Array]:
        order = np.argsort(self.places)
        x, dm = self.places[order], self.masses[order]
        G = self._up_to(x)
        moments = np.zeros((1, 3, *G.shape[1:]))
        moments[0, 0] = np.einsum("x,x,xij->ij", dm, x, G)
        return np.einsum("x,xij->ij", dm, G)[None], moments

    def _up_to(self, x: Array) -> Array:
        """(S, N, N) G at ascending places."""
        ends = np.unique(np.concatenate([np.linspace(0.0, x[-1], PIECES + 1), x]))
        spans = np.diff(ends)
        inner = ends[:-1, None] + 0.5 * (NODES + 1.0) * spans[:, None]
        rates = _products(self.fields.fields(inner.reshape(-1), (1,))[0])
        parts = np.einsum("g,x,xgij->xij", WEIGHTS, 0.5 * spans, rates.reshape(*inner.shape, *rates.shape[1:]))
        whole = np.concatenate([np.zeros_like(rates, shape=(1, *rates.shape[1:])), np.cumsum(parts, axis=0)])
        return whole[np.searchsorted(ends, x)]


def _products(slopes: Array) -> Array:
    """(S, N, N): v_i' v_j' + w_i' w_j' of slopes (S, 6, N)."""
    return np.asarray(np.einsum("sai,saj->sij", slopes[:, Y : Z + 1], slopes[:, Y : Z + 1]))
