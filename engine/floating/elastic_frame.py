"""Frames of beams in floating frames: their modes by finite elements, their mass as particles, their track."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from engine.bodies.frame.assembly import MASSES, Assembly
from engine.bodies.frame.body import motion_of_points
from engine.bodies.frame.frame import Frame as FrameBody
from engine.bodies.frame.frame import PointMass
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.shapes import mode_forces
from engine.bodies.frame.track import TrackBeams, TrackPoints, line_of
from engine.bodies.modal.flexibility import factorised, without_rounding
from engine.floating.elastic import AXES, ElasticBody, Z, floating_axes, refuse_beam_words, refuse_unheld
from engine.floating.static_shapes import Motions
from engine.scene.frames import Frame
from results_schema.arrays import Array, Counts
from results_schema.errors import BadInput

GAUSS = 4  # places of an element: exact for products of its cubic shapes
HIGHEST = 3  # derivative of an element's shapes


@dataclass(frozen=True, eq=False)
class Line:
    """Members in a row whose ends move by ends (E + 1, 6, N); axes (3, 3): of the floating frame, as rows."""

    beams: TrackBeams
    ends: Array
    axes: Array

    def fields(self, x: Array, orders: Sequence[int]) -> Array:
        """(orders, S, 6, N) derivatives along the members of displacements and rotations at places (S,) m."""
        found = np.zeros((len(orders), x.size, AXES, self.ends.shape[2]))
        element, at = self.beams.at(x)
        along = self.beams.axes[element, 0]
        in_frame = along @ self.axes.T
        one, other = (np.einsum("sd,sdn->sn", along, self.ends[end, Z + 1 :]) for end in (element, element + 1))
        length = self.beams.beams.length[element]
        for number, order in enumerate(orders):
            found[number, :, : Z + 1] = self._displacements(x, element, order)
            # the section's rotation: about its own axis, and with the slope of that
            own = _linear((one, other), at / length, 1.0 / length, order)
            slope = self._displacements(x, element, order + 1)
            tilt = np.cross(in_frame[:, :, None], slope, axis=1)
            found[number, :, Z + 1 :] = own[:, None] * in_frame[:, :, None] + tilt
        return found

    def _displacements(self, x: Array, element: Counts, order: int) -> Array:
        """(S, 3, N) derivatives of displacements in the axes of the floating frame."""
        N = self.ends.shape[2]
        if order > HIGHEST:
            return np.zeros((x.size, 3, N))
        both = np.concatenate([self.ends[element], self.ends[element + 1]], axis=1)
        rows = [replace(self.beams, direction=axis, offset=np.zeros(3)).to_ends(x, order) for axis in self.axes]
        return np.stack([np.einsum("se,sen->sn", row, both) for row in rows], axis=1)


def _linear(values: tuple[Array, Array], part: Array, rate: Array, order: int) -> Array:
    """(S, N) derivatives of what runs straight from one value (S, N) to another."""
    if order > 1:
        return np.zeros_like(values[0])
    if order == 1:
        return np.asarray((values[1] - values[0]) * rate[:, None])
    return np.asarray(values[0] + part[:, None] * (values[1] - values[0]))


class Track(NamedTuple):
    """Members in a row, whose ends go with points; axes (3, 3): of the floating frame, as rows."""

    beams: TrackBeams
    points: TrackPoints
    axes: Array

    def moving(self, nodal: Array) -> Line:
        """It where all points move by (6 P, N)."""
        return Line(self.beams, self.points.of(nodal), self.axes)

    def loads(self, places: Sequence[float], size: int) -> Array:
        """(size, 6 A) on all points: unit forces along the axes at places (A,) m, and unit moments about them."""
        found = np.zeros((size, 0))
        for place in places:
            x = np.array([place])
            first = self.beams.at(x)[0]
            ends = np.zeros((self.points.points.size, AXES, 2 * AXES))
            ends[first, :, :AXES] = ends[first + 1, :, AXES:] = np.eye(AXES)
            work = np.split(Line(self.beams, ends, self.axes).fields(x, (0,))[0, 0], 2, axis=1)
            at = (self.points.loads(part, end, size) for part, end in zip(work, (first, first + 1), strict=True))
            found = np.concatenate([found, sum(at)], axis=1)
        return found


class Particles(NamedTuple):
    """Places (G, 3) m, masses (G,) kg and displacements (G, 3, N) by every mode, in the axes of the floating frame."""

    places: Array
    masses: Array
    shapes: Array


def elastic_frame(body: FrameBody, frame: Frame, modes: int | None, where: str, hung: Sequence[float]) -> ElasticBody:
    """A frame of beams whose floating frame begins with its track, z where loads push it; modes: where that is open;
    hung: places of its track (m) at which something hangs on it. Raises BadInput for what is not built."""
    _check(body, frame, where)
    asked = body if body.modes != "auto" or modes is None else body.with_modes(modes)
    own = asked.model_copy(update={"rigid_body_modes": "drop"})
    assembly, motion = motion_of_points(own)
    refuse_unheld(assembly.rigid.shape[1], frame, where)
    line, modal = own.line, own.build()
    axes = floating_axes(line.tangent, line.direction)
    beams, points = line_of(own, assembly.mesh, line.members, line.direction, np.array(own.track.offset))
    start = assembly.mesh.points[points.points[0]] + points.arms[0] + own.track.offset
    track = Track(beams, TrackPoints(points.points, points.arms + own.track.offset), axes)
    shapes = motion.reshape(-1, motion.shape[2])[assembly.free]
    found = Motions(np.asarray(modal.omega), shapes, modal.omega**2 * shapes)
    if hung:
        elements = factorised(assembly.stiffness, assembly.mass, assembly.rigid)
        found = found.with_statics(elements, track.loads(hung, motion.size // motion.shape[2])[assembly.free])
        moved = without_rounding(points.of(assembly.whole(found.shapes)), (0, 1))
        inertia = points.of(assembly.whole(found.inertia))
        forces = mode_forces(beams, moved, inertia, MASSES[own.mass_matrix](beams.beams))
        modal = replace(modal, sections=replace(cast(TrackSections, modal.sections), modes=forces))
    nodal = assembly.whole(found.shapes)
    particles = _together([*_of_members(own, assembly, nodal, axes), *_of_masses(own, assembly, nodal, axes)])
    return ElasticBody(
        length=own.length,
        mass=assembly.total_mass,
        omega=found.omega,
        places=particles.places - axes @ start,
        weights=particles.masses,
        shapes=particles.shapes,
        own_inertia=np.zeros(3),
        along=track.moving(nodal),
        stiffens=False,
        modal=modal,
        slender=False,
    )


def _check(body: FrameBody, frame: Frame, where: str) -> None:
    """Refuse what is not built of frames in frames that move."""
    refuse_beam_words(frame, where)
    if body.mass_matrix != "consistent":
        raise BadInput(
            "lumped masses in a frame that moves are not built yet",
            where=f"{where}.mass_matrix",
            expected="consistent",
            received=body.mass_matrix,
        )
    for name, member in body.member.items():
        if member.theory != "euler-bernoulli":
            raise BadInput(
                "beams with shear in a frame that moves are not built yet",
                where=f"{where}.member.{name}.theory",
                expected="euler-bernoulli",
                received=member.theory,
            )
    for name, mass in body.point_mass.items():
        if 2.0 * max(mass.inertia) > sum(mass.inertia) * (1.0 + 1e-12):
            raise BadInput(
                "no rigid body has such moments of inertia",
                where=f"{where}.point_mass.{name}.inertia",
                expected="each at most the sum of the two others",
                received=str(list(mass.inertia)),
            )


def _of_members(body: FrameBody, assembly: Assembly, nodal: Array, axes: Array) -> Iterator[Particles]:
    """Four particles around each place of Gauss of every element, so far out that they have its inertia of twist."""
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
    for name in body.member:
        beams, points = line_of(body, assembly.mesh, [(name, False)], np.array(body.direction), np.zeros(3))
        own = beams.beams
        length = np.repeat(own.length, GAUSS)
        x = np.repeat(beams.places[:-1], GAUSS) + length * np.tile(0.5 * (nodes + 1.0), own.length.size)
        dm = np.repeat(own.mass, GAUSS) * length * np.tile(0.5 * weights, own.length.size)
        line = Line(beams, points.of(nodal), axes)
        moved = line.fields(x, (0,))[0]
        element, _ = beams.at(x)
        local = beams.axes[element] @ axes.T  # rows: the section's axes in those of the floating frame
        start = assembly.mesh.points[points.points[0]] + points.arms[0]
        centre = axes @ start + x[:, None] * local[:, 0]
        twist = np.einsum("sd,sdn->sn", local[:, 0], moved[:, Z + 1 :])
        out = np.sqrt(own.twist_inertia / own.mass)[element]
        for across, sense in ((1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)):
            arm = sense * out[:, None] * local[:, across]
            turned = np.cross(local[:, 0], arm)
            yield Particles(centre + arm, 0.25 * dm, moved[:, : Z + 1] + turned[:, :, None] * twist[:, None])


def _of_masses(body: FrameBody, assembly: Assembly, nodal: Array, axes: Array) -> Iterator[Particles]:
    """Six particles for every point mass, as far from its centre as its inertia asks."""
    names, motion = list(body.node), nodal.reshape(-1, AXES, nodal.shape[1])
    for mass in body.point_mass.values():
        number = names.index(mass.node)
        node = assembly.mesh.points[number]
        arms = np.array(mass.offset) + _corners(mass)
        moved = motion[number, :3] + np.cross(motion[number, 3:].T[None], arms[:, None]).transpose(0, 2, 1)
        shapes = np.einsum("ab,gbn->gan", axes, moved)
        yield Particles((node + arms) @ axes.T, np.full(6, mass.mass / 6.0), shapes)


def _corners(mass: PointMass) -> Array:
    """(6, 3) places of sixths of a mass that have its inertia."""
    inertia = np.array(mass.inertia)
    out = np.sqrt(np.maximum(3.0 / mass.mass * (0.5 * inertia.sum() - inertia), 0.0))
    return np.concatenate([np.diag(out), -np.diag(out)])


def _together(parts: Sequence[Particles]) -> Particles:
    return Particles(*(np.concatenate([getattr(part, name) for part in parts]) for name in Particles._fields))
