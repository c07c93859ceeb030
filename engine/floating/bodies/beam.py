"""Beams that bend in two planes, stretch and twist, and rigid bodies, in floating frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np

from engine.bodies.beam.beam import Beam
from engine.bodies.beam.modes import uniform_beam
from engine.bodies.rigid.rigid import Rigid
from engine.floating.bodies.elastic import ElasticBody
from engine.floating.bodies.fields import ABOUT_X, ABOUT_Y, ABOUT_Z, AXES, X, Y, Z
from engine.floating.bodies.shortening import BeamShortening
from engine.floating.bodies.static_shapes import BENDING, STRETCHING, Law, with_statics
from results_schema.arrays import Array
from results_schema.errors import BadInput

if TYPE_CHECKING:
    from engine.bodies.modal.modal_body import Shapes
    from engine.scene.frames import Frame
    from results_schema.quantities import Quantity

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
        """As of `engine.floating.bodies.elastic.Along`."""
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
class Bar:
    """Stretching along x or twisting about it: sin k x, the far end free; or cos k x, where the near one is free too
    (phase 1)."""

    omega: Array
    wave_number: Array
    amplitude: float
    phase: int
    axis: int
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
    dm, lateral_moment = body.mass_per_length * dx, frame.lateral_second_moment or body.second_moment
    polar = (body.second_moment + lateral_moment) / body.area
    modal: list[tuple[Part, Law]] = [_bending(body, count, Z)]
    across = count if frame.lateral_modes is None else frame.lateral_modes
    if across and frame.lateral_second_moment is not None:
        lateral = body.model_copy(update={"second_moment": frame.lateral_second_moment})
        modal.append(_bending(lateral, across, Y))
    if frame.axial_modes:
        modal.append(_bar(body, frame.axial_modes, X, body.mass, body.youngs_modulus * body.area))
    if frame.torsion_modes:
        stiffness = float(frame.shear_modulus or 0.0) * float(frame.torsion_constant or 0.0)
        modal.append(_bar(body, frame.torsion_modes, ABOUT_X, polar * body.mass, stiffness))
    inertia = {ABOUT_X: polar * dm}
    along = Parts(tuple(with_statics(part, law, hung, x, inertia.get(part.axis, dm)) for part, law in modal))
    whirls = any(joint.freedoms > 1 for joint in frame.joints)
    out = np.sqrt(2.0 * np.array([lateral_moment, body.second_moment]) / body.area)
    particles = _around(along, x, dm, out) if frame.torsion_modes else _on_line(along, x, dm)
    return ElasticBody(
        body.length,
        body.mass,
        np.concatenate([part.omega for part in along.parts]),
        *particles,
        np.array([polar * body.mass if whirls and not frame.torsion_modes else 0.0, 0.0, 0.0]),
        along,
        body.build(),
        BeamShortening(along, x, dm),
        bool(frame.stiffening),
        inertial=_by_inertia,
    )


def _by_inertia(body: ElasticBody, quantity: Quantity, x: float) -> Array:
    """As of `engine.floating.bodies.elastic.Inertial`; section forces jump and bend where they are read."""
    s, ds = _gauss([0.0, x, body.length])
    missed = body.missed_at(quantity, x, s) * (body.mass / body.length * ds)
    return np.array([missed.sum(), -missed @ s, missed @ s])


def _gauss(bounds: Sequence[float]) -> tuple[Array, Array]:
    """Places and lengths of the integrals between bounds, where shapes have kinks."""
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
    pieces = [(low, 0.5 * (high - low)) for low, high in pairwise(bounds) if high > low]
    return (
        np.concatenate([low + half * (nodes + 1.0) for low, half in pieces]),
        np.concatenate([half * weights for _, half in pieces]),
    )


def _bending(beam: Beam, count: int, axis: int) -> tuple[Bending, Law]:
    """The lowest modes that bend; those as a rigid body are the frame's own."""
    rigid = uniform_beam(beam, 2).rigid_modes
    omega = np.asarray(uniform_beam(beam, count + rigid).omega[rigid:])
    law = Law(BENDING, beam.ends, beam.bending_stiffness / beam.length**3, beam.length)
    return Bending(beam, axis, omega, rigid), law


def _bar(beam: Beam, count: int, axis: int, inertia: float, stiffness: float) -> tuple[Bar, Law]:
    """Modes along or about x, the far end free, the near one held unless both ends of the beam are free; inertia: kg or
    kg m2 of the whole beam, stiffness: E A or G J."""
    number = np.arange(1, count + 1)
    free = beam.ends == ("free", "free")
    k = np.asarray((number if free else number - 0.5) * np.pi / beam.length)
    speed = np.sqrt(stiffness * beam.length / inertia)
    law = Law(STRETCHING, ("free" if free else "clamped", "free"), stiffness / beam.length, beam.length)
    return Bar(k * speed, k, float(np.sqrt(2.0 / inertia)), int(free), axis), law


def _on_line(along: Parts, x: Array, dm: Array) -> tuple[Array, Array, Array]:
    """Places, masses and shapes of particles on the track."""
    places = np.zeros((x.size, 3))
    places[:, 0] = x
    return places, dm, along.fields(x, (0,))[0, :, : Z + 1]


def _around(along: Parts, x: Array, dm: Array, out: Array) -> tuple[Array, Array, Array]:
    """The same of four around each place, out (2,) m along y and z, which turn as it twists."""
    centre, _, _ = _on_line(along, x, dm)
    moved, parts = along.fields(x, (0,))[0], []
    for arm in np.concatenate([np.diag([0.0, *out])[1:], -np.diag([0.0, *out])[1:]]):
        turned = np.cross([1.0, 0.0, 0.0], arm)[:, None] * moved[:, ABOUT_X, None]
        parts.append((centre + arm, 0.25 * dm, moved[:, : Z + 1] + turned))
    places, masses, shapes = zip(*parts, strict=True)
    return np.concatenate(places), np.concatenate(masses), np.concatenate(shapes)


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
        None,
    )
