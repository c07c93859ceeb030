"""What equations of motion in a floating frame need of a body: mode shapes in space, their shape integrals, and tables
along its track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from engine.bodies.frame.geometry import unit
from engine.floating.bodies.fields import AXES, Along, Z
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import ModalBody
    from engine.floating.bodies.shortening import Shortening
    from engine.scene.frames import Frame
    from results_schema.quantities import Quantity

#: Cells of the tables along a track: polynomials of degree 5 are off by (k h)^6/720 of a shape of wave number k, 1e-12
#: of the tenth mode of a beam.
CELLS = 256


class Inertial(Protocol):
    """What modes miss at rest of a section force at a place by the inertia of the undeformed body."""

    def __call__(self, body: ElasticBody, quantity: Quantity, x: float) -> Array:
        """(3,) under forces dm times what places accelerate by, per unit a_z, alpha_y and w_x w_z of the frame."""
        ...


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """A body with its track along x, N modes of unit modal mass, and G places of its mass.

    mass kg, length m; omega (N,) rad/s. places (G, 3) m and weights (G,) kg; shapes (G, 3, N) there, kg^(-1/2).
    own_inertia (3,): kg m2 that the places do not have. along: what moves along the track. shortening:
    displacements of second order, None where they are not known; stiffens: whether marches have them. modal: the body
    at rest, which knows its section; None of what does not bend. slender: whether it is a beam, which its frame holds
    where its track begins. rolls: whether its rotation about the track is known. inertial: what its modes miss of a
    section force by its own inertia; None where that is not known, or loads at rest do not push across the track.
    """

    length: float
    mass: float
    omega: Array
    places: Array
    weights: Array
    shapes: Array
    own_inertia: Array
    along: Along
    modal: ModalBody | None
    shortening: Shortening | None = None
    stiffens: bool = False
    slender: bool = True
    rolls: bool = True
    inertial: Inertial | None = None

    @property
    def shortened(self) -> int:
        """Along how many axes marches have displacements of second order."""
        return self.shortening.axes if self.shortening is not None and self.stiffens else 0

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

    def missed_at(self, quantity: Quantity, x: float, s: Array) -> Array:
        """(S,) what the modes miss at rest of a section force at x (m) per unit force across the track at s (S,) m."""
        assert self.modal is not None
        if self.modal.sections is not None:
            whole = self.modal.sections.influence_at(quantity.name, np.full_like(s, x), s)
        else:
            line = self.modal.influence_at(np.full_like(s, x), s, quantity.derivative)
            whole = quantity.factor(self.modal) * line
        return np.asarray(whole - self.fields(s, (0,))[0, :, Z] @ (self.reading(quantity, x) / self.omega**2))

    def track(self) -> Array:
        """(cells, 6, 6, N): fields as polynomials, see `engine.kernels.floating.layout`."""
        x = np.linspace(0.0, self.length, CELLS + 1)
        return hermite(self.fields(x, (0, 1, 2)), self.length / CELLS)

    def foreshortening(self) -> Array:
        """(cells, 6, A, N, N): G along A axes as polynomials; along none where marches do not have it."""
        n = self.omega.size
        if self.shortening is None or not self.stiffens:
            return np.zeros((CELLS, 6, 0, n, n))
        values = self.shortening.along(np.linspace(0.0, self.length, CELLS + 1))
        return hermite(values, self.length / CELLS).reshape(CELLS, 6, self.shortening.axes, n, n)


#: What bodies are told that have no such key.
WORDS = {
    "lateral_modes": "this body bends in all directions by its own modes",
    "axial_modes": "this body bends and stretches by its own modes",
    "torsion_modes": "this body bends and twists by its own modes",
    "stiffening": "bodies out of finite-element files do not stiffen as they turn",
}


def floating_axes(tangent: Array, direction: Array) -> Array:
    """(3, 3) rows: x along the track, z as far as can be where loads push it."""
    x = unit(tangent)
    z = unit(direction - (direction @ x) * x)
    return np.stack([x, np.cross(z, x), z])


def refuse_beam_words(frame: Frame, where: str, *keys: str) -> None:
    """Raise BadInput for what is said of beams alone, and for other keys, for a body at a dotted key."""
    for key in ("lateral_modes", "axial_modes", "torsion_modes", *keys):
        if getattr(frame, key):
            raise BadInput(
                WORDS[key],
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
