"""Members of frames in floating frames: the motion of a row of them, and their mass as particles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from engine.bodies.frame.assembly import Assembly
from engine.bodies.frame.frame import Frame as FrameBody
from engine.bodies.frame.frame import PointMass
from engine.bodies.frame.track import TrackBeams, TrackPoints, line_of
from engine.floating.bodies.fields import AXES, Z
from results_schema.arrays import Array, Counts

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


class MemberPlaces(NamedTuple):
    """The places of Gauss of a member: numbers of its elements in the mesh, and their row; x (G,) m along it, element
    (G,) of the row, axes (G, 3, 3) of the section as rows, centre (G, 3) m, dm (G,) kg, out (2, G) m: how far out along
    y and z its mass has the section's second moments. In the axes of the floating frame."""

    numbers: Counts
    beams: TrackBeams
    points: TrackPoints
    x: Array
    element: Counts
    axes: Array
    centre: Array
    dm: Array
    out: Array

    @property
    def arms(self) -> Iterator[Array]:
        """(G, 3) m, from the centre to each of four particles."""
        for across in (1, 2):
            for sense in (1.0, -1.0):
                yield sense * self.out[across - 1, :, None] * self.axes[:, across]

    def twist(self, moved: Array) -> Array:
        """(G, N) rotation about the member of displacements and rotations (G, 6, N)."""
        return np.asarray(np.einsum("sd,sdn->sn", self.axes[:, 0], moved[:, Z + 1 :]))


def member_places(body: FrameBody, assembly: Assembly, axes: Array) -> Iterator[MemberPlaces]:
    """Of all members, in order; axes (3, 3): of the floating frame, as rows."""
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
    for name in body.member:
        beams, points = line_of(body, assembly.mesh, [(name, False)], np.array(body.direction), np.zeros(3))
        own = beams.beams
        length = np.repeat(own.length, GAUSS)
        x = np.repeat(beams.places[:-1], GAUSS) + length * np.tile(0.5 * (nodes + 1.0), own.length.size)
        dm = np.repeat(own.mass, GAUSS) * length * np.tile(0.5 * weights, own.length.size)
        element, _ = beams.at(x)
        local = beams.axes[element] @ axes.T
        start = assembly.mesh.points[points.points[0]] + points.arms[0]
        centre = axes @ start + x[:, None] * local[:, 0]
        parts = np.stack([own.bending_y, own.bending_z]) / (own.bending_y + own.bending_z)
        out = np.sqrt(2.0 * parts * own.twist_inertia / own.mass)[:, element]
        yield MemberPlaces(assembly.mesh.chains[name], beams, points, x, element, local, centre, dm, out)


class Particles(NamedTuple):
    """Places (G, 3) m, masses (G,) kg and displacements (G, 3, N) by every mode, in the axes of the floating frame."""

    places: Array
    masses: Array
    shapes: Array


def of_members(body: FrameBody, assembly: Assembly, nodal: Array, axes: Array) -> Iterator[Particles]:
    """Four particles around each place of Gauss of every element, which have the second moments of its section."""
    for places in member_places(body, assembly, axes):
        moved = Line(places.beams, places.points.of(nodal), axes).fields(places.x, (0,))[0]
        twist = places.twist(moved)
        for arm in places.arms:
            turned = np.cross(places.axes[:, 0], arm)
            shapes = moved[:, : Z + 1] + turned[:, :, None] * twist[:, None]
            yield Particles(places.centre + arm, 0.25 * places.dm, shapes)


def of_masses(body: FrameBody, assembly: Assembly, nodal: Array, axes: Array) -> Iterator[Particles]:
    """Six particles for every point mass, as far from its centre as its inertia asks."""
    names, motion = list(body.node), nodal.reshape(-1, AXES, nodal.shape[1])
    for mass in body.point_mass.values():
        number = names.index(mass.node)
        node = assembly.mesh.points[number]
        arms = np.array(mass.offset) + corners(mass)
        moved = motion[number, :3] + np.cross(motion[number, 3:].T[None], arms[:, None]).transpose(0, 2, 1)
        shapes = np.einsum("ab,gbn->gan", axes, moved)
        yield Particles((node + arms) @ axes.T, np.full(6, mass.mass / 6.0), shapes)


def corners(mass: PointMass) -> Array:
    """(6, 3) places of sixths of a mass that have its inertia."""
    inertia = np.array(mass.inertia)
    out = np.sqrt(np.maximum(3.0 / mass.mass * (0.5 * inertia.sum() - inertia), 0.0))
    return np.concatenate([np.diag(out), -np.diag(out)])


def together(parts: Sequence[Particles]) -> Particles:
    return Particles(*(np.concatenate([getattr(part, name) for part in parts]) for name in Particles._fields))
