"""What equations of motion in a floating frame need of a body: mode shapes in space, their shape integrals, and tables
along its track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from engine.bodies.beam.beam import Beam
from engine.bodies.beam.modes import uniform_beam
from engine.bodies.rigid.rigid import Rigid
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.description import Body
    from engine.bodies.modal.modal_body import Shapes
    from engine.scene.frames import Frame

#: Cells of the tables along a track: polynomials of degree 5 are off by (k h)^6/720 of a shape of wave number k, 1e-12
#: of the tenth mode of a beam.
CELLS = 256
GAUSS = 160  # places of the integrals: exact for products of shapes of up to some 40 half waves
#: Derivative of a beam's shapes: a rotation's second one, of the carriages' inertia, is the last that counts.
HIGHEST = 3
AXES = 6  # displacements x, y, z and rotations about them
X, Y, Z, ABOUT_X, ABOUT_Y, ABOUT_Z = range(AXES)


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """A body with its track along x, N modes of unit modal mass, and G places of its mass.

    mass kg, length m; omega (N,) rad/s. places (G, 3) m and weights (G,) kg; shapes (G, 3, N) there, kg^(-1/2).
    own_inertia (3,): kg m2 that the places do not have. fields: (orders, S, 6, N) derivatives by x of displacements and
    rotations. bent (S,) -> (S, N, N): v_i' v_j' + w_i' w_j' along the track, and its derivative, where the track grows
    shorter as it bends.
    """

    length: float
    mass: float
    omega: Array
    places: Array
    weights: Array
    shapes: Array
    own_inertia: Array
    parts: tuple[Part, ...]
    stiffens: bool

    def fields(self, x: Array, orders: Sequence[int]) -> Array:
        """(orders, S, 6, N) derivatives by x of displacements and rotations of every mode at places (S,) m."""
        found = np.zeros((len(orders), x.size, AXES, self.omega.size))
        first = 0
        for part in self.parts:
            modes = slice(first, first + part.omega.size)
            rows = part.derivatives(x, sorted({*orders, *(order + 1 for order in orders)}))
            for number, order in enumerate(orders):
                found[number, :, part.axis, modes] = rows[order]
                if part.about is not None:
                    found[number, :, part.about, modes] = part.sense * rows[order + 1]
            first = modes.stop
        return found

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


class Part(Protocol):
    """Modes along one axis, and the axis about which they turn the track by ``sense`` times their slope."""

    @property
    def axis(self) -> int: ...

    @property
    def omega(self) -> Array: ...

    @property
    def about(self) -> int | None: ...

    @property
    def sense(self) -> float: ...

    def derivatives(self, x: Array, orders: Sequence[int]) -> dict[int, Array]:
        """(S, N) at places (S,), by order."""


@dataclass(frozen=True, eq=False)
class Bending:
    """Bending along z or y: w' turns about -y, v' about z. rigid: modes of the beam that are the frame's own."""

    beam: Beam
    axis: int
    omega: Array
    rigid: int

    @property
    def about(self) -> int:
        return ABOUT_Y if self.axis == Z else ABOUT_Z

    @property
    def sense(self) -> float:
        return -1.0 if self.axis == Z else 1.0

    @cached_property
    def shapes(self) -> Shapes:
        """The shapes of the beam."""
        return uniform_beam(self.beam, self.rigid + self.omega.size).shapes

    def derivatives(self, x: Array, orders: Sequence[int]) -> dict[int, Array]:
        rows = {order: self._rows(x, order) for order in orders if order <= HIGHEST}
        return {order: rows.get(order, np.zeros((x.size, self.omega.size))) for order in orders}

    def _rows(self, x: Array, order: int) -> Array:
        return np.asarray(self.shapes.derivatives(x, (order,))[0][:, self.rigid :])


@dataclass(frozen=True, eq=False)
class Stretching:
    """sin k x, the far end free; or cos k x, where the near one is free too (phase 1)."""

    omega: Array
    wave_number: Array
    amplitude: float
    phase: int
    axis: int = X
    about: int | None = None
    sense: float = 0.0

    def derivatives(self, x: Array, orders: Sequence[int]) -> dict[int, Array]:
        k = self.wave_number
        angle = {order: k * x[:, None] + 0.5 * np.pi * (order + self.phase) for order in orders}
        return {order: np.asarray(self.amplitude * k**order * np.sin(angle[order])) for order in orders}


def elastic_body(body: Body, frame: Frame, modes: int | None, where: str) -> ElasticBody:
    """A body in its floating frame; modes: of bending, where the study leaves that open. Raises BadInput."""
    if isinstance(body, Rigid):
        return _rigid(body, frame)
    if not isinstance(body, Beam):
        raise BadInput(
            "bodies of this kind in a frame that moves are not built yet",
            where=f"{where}.kind",
            expected="beam or rigid",
            received=body.kind,
        )
    if body.springs:
        raise BadInput(
            "a beam on springs in a frame that moves is not built yet",
            where=f"{where}.supports",
            expected="two ends, such as pinned-pinned or clamped-free",
        )
    count = int(body.modes) if body.modes != "auto" else int(modes or 0)
    parts: list[Part] = [_bending(body, count, Z)]
    if frame.lateral_modes:
        lateral = body.model_copy(update={"second_moment": frame.lateral_second_moment})
        parts.append(_bending(lateral, frame.lateral_modes, Y))
    if frame.axial_modes:
        parts.append(_stretching(body, frame.axial_modes))
    x, dm = np.polynomial.legendre.leggauss(GAUSS)
    places = np.zeros((GAUSS, 3))
    places[:, 0] = 0.5 * (x + 1.0) * body.length
    lateral_moment = frame.lateral_second_moment or body.second_moment
    turning = body.density * body.length * (body.second_moment + lateral_moment)
    whirls = any(joint.freedoms > 1 for joint in frame.joints)
    found = ElasticBody(
        body.length,
        body.mass,
        np.concatenate([part.omega for part in parts]),
        places,
        0.5 * dm * body.mass,
        np.zeros((GAUSS, 3, 0)),
        np.array([turning if whirls else 0.0, 0.0, 0.0]),
        tuple(parts),
        frame.stiffening,
    )
    return _with_shapes(found)


def _with_shapes(body: ElasticBody) -> ElasticBody:
    """The same with its shapes at the places of its mass."""
    return replace(body, shapes=body.fields(body.places[:, 0], (0,))[0, :, : Z + 1])


def _bending(beam: Beam, count: int, axis: int) -> Bending:
    """The lowest modes that bend; those as a rigid body are the frame's own."""
    rigid = uniform_beam(beam, 2).rigid_modes
    return Bending(beam, axis, np.asarray(uniform_beam(beam, count + rigid).omega[rigid:]), rigid)


def _stretching(beam: Beam, count: int) -> Stretching:
    """Axial modes, the far end free, the near one held unless both ends of the beam are free."""
    number = np.arange(1, count + 1)
    free = beam.ends == ("free", "free")
    k = np.asarray((number if free else number - 0.5) * np.pi / beam.length)
    speed = np.sqrt(beam.youngs_modulus / beam.density)
    return Stretching(k * speed, k, float(np.sqrt(2.0 / beam.mass)), int(free))


def _rigid(body: Rigid, frame: Frame) -> ElasticBody:
    """A rigid body as a mass at its centre with an inertia of its own."""
    inertia = frame.inertia or (body.inertia,) * 3
    centre = np.array([[body.centre_of_mass, 0.0, 0.0]])
    none = np.zeros((1, 3, 0))
    return ElasticBody(
        body.length, body.mass, np.zeros(0), centre, np.array([body.mass]), none, np.array(inertia), (), False
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
