"""Beams that bend in two planes and stretch, and rigid bodies, in floating frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np

from engine.bodies.beam.beam import Beam
from engine.bodies.beam.modes import uniform_beam
from engine.bodies.rigid.rigid import Rigid
from engine.floating.elastic import ABOUT_Y, ABOUT_Z, AXES, ElasticBody, X, Y, Z
from engine.floating.static_shapes import BENDING, STRETCHING, Law, with_statics
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Shapes
    from engine.scene.frames import Frame

GAUSS = 160  # places of the integrals: exact for products of shapes of up to some 40 half waves
#: Derivative of a beam's shapes: a rotation's second one, of the carriages' inertia, is the last that counts.
HIGHEST = 3


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
class Parts:
    """Modes of several parts, side by side."""

    parts: tuple[Part, ...]

    def fields(self, x: Array, orders: Sequence[int]) -> Array:
        """As of `engine.floating.elastic.Along`."""
        found = np.zeros((len(orders), x.size, AXES, sum(part.omega.size for part in self.parts)))
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


def elastic_beam(body: Beam, frame: Frame, modes: int | None, where: str, hung: Sequence[float]) -> ElasticBody:
    """A beam in its floating frame; modes: of bending, where the study leaves that open; hung: places (m) at which
    something hangs on it, whose static deflections are shapes too. Raises BadInput."""
    if body.springs:
        raise BadInput(
            "a beam on springs in a frame that moves is not built yet",
            where=f"{where}.supports",
            expected="two ends, such as pinned-pinned or clamped-free",
        )
    count = int(body.modes) if body.modes != "auto" else int(modes or 0)
    x, dx = _gauss([0.0, *hung, body.length])
    places, dm = np.zeros((x.size, 3)), body.mass_per_length * dx
    places[:, 0] = x
    modal: list[tuple[Part, Law]] = [_bending(body, count, Z)]
    if frame.lateral_modes:
        lateral = body.model_copy(update={"second_moment": frame.lateral_second_moment})
        modal.append(_bending(lateral, frame.lateral_modes, Y))
    if frame.axial_modes:
        modal.append(_stretching(body, frame.axial_modes))
    parts = [with_statics(part, law, hung, x, dm) for part, law in modal]
    lateral_moment = frame.lateral_second_moment or body.second_moment
    turning = body.density * body.length * (body.second_moment + lateral_moment)
    whirls = any(joint.freedoms > 1 for joint in frame.joints)
    found = ElasticBody(
        body.length,
        body.mass,
        np.concatenate([part.omega for part in parts]),
        places,
        dm,
        np.zeros((x.size, 3, 0)),
        np.array([turning if whirls else 0.0, 0.0, 0.0]),
        Parts(tuple(parts)),
        frame.stiffening,
        body.build(),
    )
    return _with_shapes(found)


def _gauss(bounds: Sequence[float]) -> tuple[Array, Array]:
    """Places and lengths of the integrals between bounds, where shapes have kinks."""
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
    pieces = [(low, 0.5 * (high - low)) for low, high in pairwise(bounds) if high > low]
    return (
        np.concatenate([low + half * (nodes + 1.0) for low, half in pieces]),
        np.concatenate([half * weights for _, half in pieces]),
    )


def _with_shapes(body: ElasticBody) -> ElasticBody:
    """The same with its shapes at the places of its mass."""
    return replace(body, shapes=body.fields(body.places[:, 0], (0,))[0, :, : Z + 1])


def _bending(beam: Beam, count: int, axis: int) -> tuple[Bending, Law]:
    """The lowest modes that bend; those as a rigid body are the frame's own."""
    rigid = uniform_beam(beam, 2).rigid_modes
    omega = np.asarray(uniform_beam(beam, count + rigid).omega[rigid:])
    law = Law(BENDING, beam.ends, beam.bending_stiffness / beam.length**3, beam.length)
    return Bending(beam, axis, omega, rigid), law


def _stretching(beam: Beam, count: int) -> tuple[Stretching, Law]:
    """Axial modes, the far end free, the near one held unless both ends of the beam are free."""
    number = np.arange(1, count + 1)
    free = beam.ends == ("free", "free")
    k = np.asarray((number if free else number - 0.5) * np.pi / beam.length)
    speed = np.sqrt(beam.youngs_modulus / beam.density)
    stiffness = beam.youngs_modulus * beam.area / beam.length
    law = Law(STRETCHING, ("free" if free else "clamped", "free"), stiffness, beam.length)
    return Stretching(k * speed, k, float(np.sqrt(2.0 / beam.mass)), int(free)), law


def rigid_body(body: Rigid, frame: Frame, modes: int | None, where: str, hung: Sequence[float]) -> ElasticBody:
    """A rigid body as a mass at its centre with an inertia of its own."""
    inertia = frame.inertia or (body.inertia,) * 3
    centre = np.array([[body.centre_of_mass, 0.0, 0.0]])
    none = np.zeros((1, 3, 0))
    return ElasticBody(
        body.length,
        body.mass,
        np.zeros(0),
        centre,
        np.array([body.mass]),
        none,
        np.array(inertia),
        Parts(()),
        False,
        None,
    )
