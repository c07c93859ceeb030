"""Displacements of second order of frames of beams: what would be displaced if elements had by themselves the strains
that products of small rotations leave.

A section displaced by u and turned by a rotation vector theta has, e being the member's axis and eps its extension,
(geometrically exact beams: Simo, Comput. Methods Appl. Mech. Eng. 49 (1985) 55-70, up to squares)

    gamma = -1/2 theta x (theta x e) - eps theta x e,    kappa = -1/2 theta x theta'.

Under these the frame, which resists them, takes the displacements u_2 of least energy: -1/2 sum_ij G_ij q_i q_j. Forces
of first order do no work on strain and displacement of second order together, so that no term is left of third order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from engine.bodies.frame.assembly import Assembly
from engine.bodies.frame.elements import ALONG_Y, ALONG_Z, SIGN_Y, SIGN_Z, Beams, deflection_shapes, stiffness
from engine.bodies.frame.frame import Frame as FrameBody
from engine.bodies.frame.track import TrackPoints, elements_of
from engine.bodies.modal.flexibility import factorised
from engine.floating.bodies.fields import AXES, Z
from engine.floating.bodies.frame_line import Line, Track, corners, member_places
from results_schema.arrays import Array, Counts

GAUSS = 5  # places of an element: strains of second order are polynomials of degree 4
NODES = 0.5 * (np.polynomial.legendre.leggauss(GAUSS)[0] + 1.0)


class Pairs(NamedTuple):
    """Two modes each, once: numbers (P,) of one and of the other."""

    one: Counts
    other: Counts

    def symmetric(self, values: Array) -> Array:
        """(..., N, N) of values (..., P)."""
        count = int(self.one.max(initial=-1)) + 1
        found = np.zeros((*values.shape[:-1], count, count))
        found[..., self.one, self.other] = found[..., self.other, self.one] = values
        return found


class Moved(NamedTuple):
    """G of all pairs: nodal (6 F, P) of the points of a frame, within (E, K, 3, P): what elements with held ends add,
    as polynomials of the part of their length, and twist (E, K, P) about their axes."""

    nodal: Array
    within: Array
    twist: Array


@dataclass(frozen=True, eq=False)
class FrameShortening:
    """G of a frame whose points move by nodal (6 F, N), with its track; origin (3,) m: of the floating frame, in its
    axes."""

    body: FrameBody
    assembly: Assembly
    nodal: Array
    track: Track
    origin: Array
    axes: int = 3

    @cached_property
    def pairs(self) -> Pairs:
        """The pairs of modes."""
        return Pairs(*np.triu_indices(self.nodal.shape[1]))

    @cached_property
    def turned(self) -> Array:
        """(F, 3, N) rotations of the points."""
        return self.nodal.reshape(-1, AXES, self.nodal.shape[1])[:, 3:]

    def along(self, x: Array) -> Array:
        frame, mesh = self.track.axes, self.assembly.mesh
        order, reverse = elements_of(mesh, self.body.line.members)
        element, at = self.track.beams.at(x)
        sense = np.where(reverse[element], -1.0, 1.0)
        length = self.track.beams.beams.length[element]
        part = np.where(reverse[element], 1.0 - at / length, at / length)
        found = Line(self.track.beams, self._ends(self.track.points), frame).fields(x, (0, 1, 2))[:, :, : Z + 1]
        for derivative in range(3):
            inner = _polynomial(self.moved.within[order[element]], part, derivative)
            found[derivative] += np.einsum("ab,s,sbp->sap", frame, (sense / length) ** derivative, inner)
        return self.pairs.symmetric(found)

    @cached_property
    def integrals(self) -> tuple[Array, Array]:
        N = self.nodal.shape[1]
        whole, moments = np.zeros((3, N, N)), np.zeros((3, 3, N, N))
        for places, dm, G in self.weighed():
            whole += self.pairs.symmetric(np.einsum("g,gap->ap", dm, G))
            moments += self.pairs.symmetric(np.einsum("g,gb,gap->abp", dm, places - self.origin, G))
        return whole, moments

    @cached_property
    def moved(self) -> Moved:
        """G of the frame's points and elements."""
        mesh, assembly = self.assembly.mesh, self.assembly
        ends = mesh.turns @ self.nodal[mesh.freedoms]
        gamma, kappa = strains(mesh.beams, ends, self.pairs)
        forces, within, twist = held(mesh.beams, gamma, kappa)
        # the ends of rigid arms come nearer to their points by themselves
        arms = np.stack([_second(mesh.arms[:, end], self.turned[mesh.pairs[:, end]], self.pairs) for end in (0, 1)])
        by_arms = np.zeros_like(forces)
        for end in (0, 1):
            by_arms[:, 6 * end : 6 * end + 3] = mesh.axes @ arms[end]
        forces = forces + stiffness(mesh.beams) @ by_arms
        loads = np.zeros_like(self.nodal, shape=(len(self.nodal), forces.shape[2]))
        np.add.at(loads, mesh.freedoms, -np.swapaxes(mesh.turns, 1, 2) @ forces)
        solver = factorised(assembly.stiffness, assembly.mass, assembly.rigid)
        nodal = assembly.whole(solver.solve(loads[assembly.free]))
        return Moved(nodal, np.einsum("eba,ekbp->ekap", mesh.axes, within), twist)

    def _ends(self, points: TrackPoints) -> Array:
        """(E + 1, 6, P) of the ends of elements in a row."""
        found = points.of(self.moved.nodal)
        found[:, :3] += _second(points.arms, self.turned[points.points], self.pairs)
        return found

    def weighed(self) -> Iterator[Weighed]:
        """G of all particles of its mass."""
        yield from self._of_members()
        yield from self._of_masses()

    def _of_members(self) -> Iterator[Weighed]:
        """G of the particles of `engine.floating.bodies.frame_line.of_members`."""
        frame, pairs = self.track.axes, self.pairs
        for places in member_places(self.body, self.assembly, frame):
            first = places.twist(Line(places.beams, places.points.of(self.nodal), frame).fields(places.x, (0,))[0])
            moved = Line(places.beams, self._ends(places.points), frame).fields(places.x, (0,))[0]
            number, part = places.numbers[places.element], places.beams.at(places.x)[1]
            part = part / places.beams.beams.length[places.element]
            centre = moved[:, : Z + 1] + frame @ _polynomial(self.moved.within[number], part, 0)
            twist = places.twist(moved) + _polynomial(self.moved.twist[number], part, 0)
            twisted = first[:, pairs.one] * first[:, pairs.other]
            for arm in places.arms:
                turned = np.cross(places.axes[:, 0], arm)[:, :, None] * twist[:, None]
                G = centre + turned + arm[:, :, None] * twisted[:, None]
                yield Weighed(places.centre + arm, 0.25 * places.dm, G)

    def _of_masses(self) -> Iterator[Weighed]:
        """The same of point masses."""
        names, frame = list(self.body.node), self.track.axes
        for mass in self.body.point_mass.values():
            number = names.index(mass.node)
            arms = np.array(mass.offset) + corners(mass)
            moved = self.moved.nodal.reshape(-1, AXES, self.moved.nodal.shape[1])[number]
            turned = np.cross(moved[3:].T[None], arms[:, None]).transpose(0, 2, 1)
            G = moved[:3] + turned + _second(arms, self.turned[[number] * len(arms)], self.pairs)
            places = (self.assembly.mesh.points[number] + arms) @ frame.T
            yield Weighed(places, np.full(len(arms), mass.mass / len(arms)), frame @ G)


class Weighed(NamedTuple):
    """Places (G, 3) m, masses (G,) kg and G (G, 3, P) there."""

    places: Array
    masses: Array
    shortening: Array


def strains(beams: Beams, ends: Array, pairs: Pairs) -> tuple[Array, Array]:
    """(E, GAUSS, 3, P) gamma and kappa, of squares twice, in the axes of elements whose ends move by (E, 12, N)."""
    length = beams.length
    turned, change = np.zeros((2, length.size, GAUSS, 3, ends.shape[2]))
    rate = (ends[:, 9] - ends[:, 3]) / length[:, None]
    for g, part in enumerate(NODES):
        turned[:, g, 0], change[:, g, 0] = (1.0 - part) * ends[:, 3] + part * ends[:, 9], rate
        for row, rows, signs, sense in ((1, ALONG_Z, SIGN_Z, -1.0), (2, ALONG_Y, SIGN_Y, 1.0)):
            moved = sense * signs[:, None] * ends[:, rows]
            slope, curve = (deflection_shapes(part * length, length, 0.0 * length, order) for order in (1, 2))
            turned[:, g, row], change[:, g, row] = np.einsum("pke,ekn->pen", np.stack([slope, curve]), moved)
    one, other = turned[..., pairs.one], turned[..., pairs.other]
    eps = ((ends[:, 6] - ends[:, 0]) / length[:, None])[:, None]
    gamma = -0.5 * (other * one[:, :, :1] + one * other[:, :, :1])
    gamma[:, :, 0] += np.sum(one * other, axis=2)
    stretched = eps[..., None, pairs.one] * other + eps[..., None, pairs.other] * one
    gamma[:, :, 1] -= stretched[:, :, 2]
    gamma[:, :, 2] += stretched[:, :, 1]
    kappa = -0.5 * (np.cross(one, change[..., pairs.other], axis=2) + np.cross(other, change[..., pairs.one], axis=2))
    return gamma, kappa


def held(beams: Beams, gamma: Array, kappa: Array) -> tuple[Array, Array, Array]:
    """What elements with held ends do that have such strains by themselves: the forces and moments (E, 12, P) that hold
    them, and, as polynomials of the part of their length, displacements (E, K, 3, P) and twist (E, K, P)."""
    inverse = np.linalg.inv(np.vander(NODES, GAUSS, increasing=True))
    gamma, kappa = (np.einsum("kg,egap->ekap", inverse, one) for one in (gamma, kappa))
    L = beams.length[:, None]
    forces = np.zeros((L.size, 2 * AXES, gamma.shape[3]))
    within = np.zeros((L.size, GAUSS + 2, 3, gamma.shape[3]))
    within[:, : GAUSS + 1, 0], pull = _held_bar(gamma[:, :, 0], L)
    twist, torque = _held_bar(kappa[:, :, 0], L)
    forces[:, 0], forces[:, 6] = -beams.axial[:, None] * pull, beams.axial[:, None] * pull
    forces[:, 3], forces[:, 9] = -beams.torsion[:, None] * torque, beams.torsion[:, None] * torque
    for axis, about, sense, bending in ((1, 2, 1.0, beams.bending_y), (2, 1, -1.0, beams.bending_z)):
        within[:, :, axis], near, change = _held_bending(gamma[:, :, axis], sense * kappa[:, :, about], L)
        EI = bending[:, None]
        forces[:, axis], forces[:, 6 + axis] = EI * change / L, -EI * change / L
        forces[:, 3 + about], forces[:, 9 + about] = -sense * EI * near, sense * EI * (near + change)
    return forces, within, twist


def _held_bar(strain: Array, L: Array) -> tuple[Array, Array]:
    """Displacement (E, K + 1, P) of a bar between walls that has a strain (E, K, P) by itself, and the strain (E, P)
    that its force gives it."""
    found = _integral(strain)
    by_force = -found.sum(axis=1)
    found[:, 1] += by_force
    return L[:, None] * found, by_force


def _held_bending(gamma: Array, kappa: Array, L: Array) -> tuple[Array, Array, Array]:
    """The same of bending, v' = theta + gamma, theta' = kappa + a + b x/L: (E, K + 2, P), and a and b (E, P), 1/m."""
    turned = L[:, None] * _integral(kappa)
    slope = np.zeros((gamma.shape[0], gamma.shape[1] + 1, gamma.shape[2]))
    slope[:, : gamma.shape[1]] = gamma
    slope += turned
    at_end, moved = turned.sum(axis=1) / L, _integral(slope).sum(axis=1) / L
    b = 12.0 * (moved - 0.5 * at_end)
    a = -at_end - 0.5 * b
    slope[:, 1] += L * a
    slope[:, 2] += 0.5 * L * b
    return L[:, None] * _integral(slope), a, b


def _integral(values: Array) -> Array:
    """(E, K + 1, ...) from 0 of polynomials (E, K, ...), constant first."""
    found = np.zeros((values.shape[0], values.shape[1] + 1, *values.shape[2:]))
    powers = np.arange(1, values.shape[1] + 1).reshape(-1, *(1,) * (values.ndim - 2))
    found[:, 1:] = values / powers
    return found


def _polynomial(values: Array, x: Array, derivative: int) -> Array:
    """(S, ...) derivatives of polynomials (S, K, ...) at x (S,)."""
    found = np.zeros((values.shape[0], *values.shape[2:]))
    for k in range(derivative, values.shape[1]):
        factor = np.prod(np.arange(k - derivative + 1, k + 1))
        found += (factor * x ** (k - derivative)).reshape(-1, *(1,) * (values.ndim - 2)) * values[:, k]
    return found


def _second(arms: Array, turned: Array, pairs: Pairs) -> Array:
    """(S, 3, P): G of the ends of rigid arms (S, 3) that rotations (S, 3, N) turn, -theta x (theta x arm)."""
    one, other, arm = turned[..., pairs.one], turned[..., pairs.other], arms[:, :, None]
    along = [np.sum(arm * part, axis=1)[:, None] for part in (one, other)]
    return np.asarray(arm * np.sum(one * other, axis=1)[:, None] - 0.5 * (other * along[0] + one * along[1]))
