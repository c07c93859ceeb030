"""What equations of motion in a floating frame need of a body: mode shapes in space, their shape integrals, and tables
along its track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from engine.bodies.frame.geometry import unit
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import ModalBody
    from engine.scene.frames import Frame
    from results_schema.quantities import Quantity

#: Cells of the tables along a track: polynomials of degree 5 are off by (k h)^6/720 of a shape of wave number k, 1e-12
#: of the tenth mode of a beam.
CELLS = 256
AXES = 6  # displacements x, y, z and rotations about them
X, Y, Z, ABOUT_X, ABOUT_Y, ABOUT_Z = range(AXES)


class Along(Protocol):
    """Displacements and rotations along a track."""

    def fields(self, x: Array, orders: Sequence[int]) -> Array:
        """(orders, S, 6, N) derivatives by x of displacements and rotations of every mode at places (S,) m."""


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """A body with its track along x, N modes of unit modal mass, and G places of its mass.

    mass kg, length m; omega (N,) rad/s. places (G, 3) m and weights (G,) kg; shapes (G, 3, N) there, kg^(-1/2).
    own_inertia (3,): kg m2 that the places do not have. along: what moves along the track. slender: whether all of its
    mass lies there. rolls: whether its rotation about the track is known. bent (S,) -> (S, N, N): v_i' v_j' + w_i' w_j'
    along the track, and its derivative, where the track grows shorter as it bends. modal: the body at rest, which knows
    its section; None of what does not bend.
    """

    length: float
    mass: float
    omega: Array
    places: Array
    weights: Array
    shapes: Array
    own_inertia: Array
    along: Along
    stiffens: bool
    modal: ModalBody | None
    slender: bool = True
    rolls: bool = True

    def fields(self, x: Array, orders: Sequence[int]) -> Array:
        """(orders, S, 6, N) derivatives by x of displacements and rotations of every mode at places (S,) m."""
        return self.along.fields(x, orders)

    def reading(self, quantity: Quantity, x: float) -> Array:
        """(N,) what a sensor at a place of the track reads of every mode."""
        if self.modal is None:
            return np.zeros(0)
        if quantity.of_section and self.modal.sections is not None:
            return np.asarray(self.modal.sections.rows(quantity.name, [x])[0])
        fields = self.fields(np.array([x]), (quantity.derivative,))[0, 0, Z]
        return np.asarray(quantity.factor(self.modal) * fields)

    def track(self) -> Array:
        """(cells, 6, 6, N): fields as polynomials, see `engine.kernels.floating.layout`."""
        x = np.linspace(0.0, self.length, CELLS + 1)
        return hermite(self.fields(x, (0, 1, 2)), self.length / CELLS)

    def foreshortening(self) -> Array:
        """(cells, 6, N N): G(x) = int_0^x (v_i' v_j' + w_i' w_j') as polynomials; zero where it is not asked for."""
        n = self.omega.size
        if not self.stiffens:
            return np.zeros((CELLS, 6, n * n))
        x = np.linspace(0.0, self.length, CELLS + 1)
        nodes, weights = np.polynomial.legendre.leggauss(6)
        inner = (x[:-1, None] + 0.5 * (nodes + 1.0) * (self.length / CELLS)).reshape(-1)
        rates = self.bent(inner)[0].reshape(CELLS, nodes.size, n, n)
        within = np.einsum("g,cgij->cij", weights, rates) * (0.5 * self.length / CELLS)
        whole = np.concatenate([np.zeros((1, n, n)), np.cumsum(within, axis=0)])
        values = np.stack([whole, *self.bent(x)])
        return hermite(values, self.length / CELLS).reshape(CELLS, 6, n * n)

    def stiffening(self) -> tuple[Array, Array]:
        """(N, N) twice: integrals of G dm and x G dm; zero where they are not asked for."""
        n = self.omega.size
        if not self.stiffens:
            return np.zeros((n, n)), np.zeros((n, n))
        order = np.argsort(self.places[:, 0])
        x, dm = self.places[order, 0], self.weights[order]
        nodes, weights = np.polynomial.legendre.leggauss(8)
        ends = np.concatenate([[0.0], x])
        spans = np.diff(ends)
        inner = (ends[:-1, None] + 0.5 * (nodes + 1.0) * spans[:, None]).reshape(-1)
        rates = self.bent(inner)[0].reshape(x.size, nodes.size, n, n)
        whole = np.cumsum(np.einsum("g,x,xgij->xij", weights, 0.5 * spans, rates), axis=0)
        return np.einsum("x,xij->ij", dm, whole), np.einsum("x,x,xij->ij", dm, x, whole)

    def bent(self, x: Array) -> tuple[Array, Array]:
        """(S, N, N) twice: v_i' v_j' + w_i' w_j', and its derivative."""
        one, two = self.fields(x, (1, 2))
        across = slice(Y, Z + 1)
        rate = np.einsum("sai,saj->sij", one[:, across], one[:, across])
        change = np.einsum("sai,saj->sij", two[:, across], one[:, across])
        return rate, change + np.swapaxes(change, 1, 2)


def floating_axes(tangent: Array, direction: Array) -> Array:
    """(3, 3) rows: x along the track, z as far as can be where loads push it."""
    x = unit(tangent)
    z = unit(direction - (direction @ x) * x)
    return np.stack([x, np.cross(z, x), z])


def refuse_beam_words(frame: Frame, where: str) -> None:
    """Raise BadInput for what is said of beams alone, for a body at a dotted key."""
    for key in ("lateral_modes", "axial_modes", "stiffening"):
        if getattr(frame, key):
            raise BadInput(
                "this body bends in all directions by its own modes, and does not stiffen as it turns",
                where=f"frame.{where.split('.')[1]}.{key}",
                expected="left out",
            )


def refuse_unheld(loose: int, frame: Frame, where: str) -> None:
    """Raise BadInput for a body with so many motions without strain that no free joint gives its frame."""
    if loose and not any(joint.freedoms == AXES for joint in frame.joints):
        raise BadInput(
            "nothing holds this body in the frame that moves",
            where=f"{where}.supports",
            expected="supports that hold it, or a joint of the kind free",
        )


def hermite(values: Array, width: float) -> Array:
    """(cells, 6, ...): polynomials of degree 5 in the part of a cell gone, constant first, through values and first two
    derivatives (3, cells + 1, ...) at the ends of cells of a width."""
    f, d, c = values[0], width * values[1], 0.5 * width**2 * values[2]
    f0, f1, d0, d1, c0, c1 = f[:-1], f[1:], d[:-1], d[1:], c[:-1], c[1:]
    gap = f1 - f0 - d0 - c0
    slope, curve = d1 - d0 - 2.0 * c0, c1 - c0
    third = 10.0 * gap - 4.0 * slope + curve
    fourth = -15.0 * gap + 7.0 * slope - 2.0 * curve
    fifth = 6.0 * gap - 3.0 * slope + curve
    return np.stack([f0, d0, c0, third, fourth, fifth], axis=1)
