"""The track of a frame: its elements in the order in which a load passes them, and what a load there does.

A load stands at s on the axis, beside it by the offset: a unit force along `direction` with the torque offset x
direction. What it does to the ends of its element, and what the deflection there takes from them, are the same numbers
(the element's static shapes), so influence lines come out symmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.bodies.beam.statics import stations
from engine.bodies.frame.assembly import Mesh, cross_matrix
from engine.bodies.frame.elements import SIGN_Y, SIGN_Z, Beams, deflection_shapes
from engine.bodies.modal.modal_body import Array
from results_schema.arrays import Counts

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame

Bent = Callable[[Array, Array, NDArray[np.bool_], Array, Array, Array, int], Array]
Members = Sequence[tuple[str, bool]]  # in a row, with whether each runs against it
_END = 1e-12  # lengths before the end of a track that are its end
_FELT = 1e-6  # part of a unit load along an axis that counts


class Line(Protocol):
    """A line of elements on which loads act in one way, and whose motion is read in that way; as `TrackBeams`."""

    @property
    def places(self) -> Array: ...

    @property
    def turns(self) -> bool: ...

    def at(self, s: Array) -> tuple[Counts, Array]: ...

    def to_ends(self, s: Array, derivative: int = 0) -> Array: ...

    def where_ends_move(self, ends: Array, s: Array, derivative: int = 0) -> Array: ...

    def within(self, x: Array, s: Array, derivative: int = 0, loads: Line | None = None) -> Array: ...

    def held_parts(self, x: Array, s: Array, derivative: int) -> Array: ...

    def under_spread_load(self, x: Array, load: Array, derivative: int = 0) -> Array: ...


@dataclass(frozen=True, eq=False)
class TrackBeams:
    """Elements of a track, all running along it.

    places (E + 1,): m, their ends; axes (E, 3, 3): x along the track, y, z as rows; beams: properties; area (E,): m2;
    fibres (E, 2): m, distances of the extreme fibres along y and z, NaN where not known; direction (3,): unit vector
    of load and deflection; offset (3,): m.
    """

    places: Array
    axes: Array
    beams: Beams
    area: Array
    fibres: Array
    direction: Array
    offset: Array

    @cached_property
    def parts(self) -> tuple[Array, Array, Array]:
        """(E,) the load's parts along each element's x, y, z."""
        along, across_y, across_z = (self.axes @ self.direction).T
        return along, across_y, across_z

    @cached_property
    def torque(self) -> Array:
        """(E,) twisting moment of the unit load, m."""
        return np.asarray(self.axes[:, 0] @ np.cross(self.offset, self.direction))

    @property
    def turns(self) -> bool:
        """Whether it stands off its axis so that its loads twist the elements."""
        return bool(np.abs(self.torque).max() > _END * np.ptp(self.places))

    def at(self, s: Array) -> tuple[Counts, Array]:
        """(S,) elements, from the right at a joint, and places in them."""
        element = np.clip(np.searchsorted(self.places, s, side="right") - 1, 0, len(self.places) - 2)
        return element, np.clip(s - self.places[element], 0.0, self.beams.length[element])

    def to_ends(self, s: Array, derivative: int = 0) -> Array:
        """(S, 12): d^j/ds^j of the deflection at s from displacements and rotations of its element's ends.

        Ends as points on the axis: three displacements and three rotations each, in the frame's own directions.
        """
        element, x = self.at(s)
        beams, axes = self.beams.part(element), self.axes[element]
        along, across_y, across_z = (part[element] for part in self.parts)
        bar = _bar_shapes(x, beams.length, derivative)
        found = np.zeros((len(s), 2, 6))
        for part, phi, sign, axis, about in (
            (across_y, beams.phi_y, SIGN_Y, axes[:, 1], axes[:, 2]),
            (across_z, beams.phi_z, SIGN_Z, axes[:, 2], axes[:, 1]),
        ):
            shapes = deflection_shapes(x, beams.length, phi, derivative) * part * sign[:, None]
            for end in range(2):
                found[:, end, :3] += shapes[2 * end, :, None] * axis
                found[:, end, 3:] += shapes[2 * end + 1, :, None] * about
        for end in range(2):
            found[:, end, :3] += (bar[end] * along)[:, None] * axes[:, 0]
            found[:, end, 3:] += (bar[end] * self.torque[element])[:, None] * axes[:, 0]
        return found.reshape(-1, 12)

    def where_ends_move(self, ends: Array, s: Array, derivative: int = 0) -> Array:
        """(S,) d^j/ds^j of the deflection where the ends of the elements move by (E + 1, 6)."""
        element, _ = self.at(s)
        moved = np.concatenate([ends[element], ends[element + 1]], axis=1)
        return np.asarray(np.sum(self.to_ends(s, derivative) * moved, axis=1))

    def within(self, x: Array, s: Array, derivative: int = 0, loads: Line | None = None) -> Array:
        """(S,) d^j/dx^j of the deflection at x of an element with held ends under a unit load at s, pair by pair.

        loads: the line whose load it is, its own unless given. Zero where both stand on different elements. At x = s
        jumps are taken from the right.
        """
        element, _ = self.at(x)
        along, across_y, across_z = (part[element] for part in self.parts)
        held = (self if loads is None else loads).held_parts(x, s, derivative)
        return np.asarray(along * held[0] + across_y * held[1] + across_z * held[2] + self.torque[element] * held[3])

    def held_parts(self, x: Array, s: Array, derivative: int, bent: Bent | None = None) -> Array:
        """(4, S) the same apart: extension, bending along y and along z (m/N), and twist (1/N). bent: by what, a force
        unless given."""
        bent = _held_bending if bent is None else bent
        element, at = self.at(x)
        other, load = self.at(s)
        beams = self.beams.part(element)
        along, across_y, across_z = (part[element] for part in self.parts)
        right = (at > load) | ((at == load) & (x < self.places[-1] * (1.0 - _END)))
        bar = _held_bar(at, load, right, beams.length, derivative)
        found = [
            along / beams.axial * bar,
            across_y * bent(at, load, right, beams.length, beams.bending_y, beams.phi_y, derivative),
            across_z * bent(at, load, right, beams.length, beams.bending_z, beams.phi_z, derivative),
            self.torque[element] / beams.torsion * bar,
        ]
        return np.where(element == other, np.array(found), 0.0)

    def under_spread_load(self, x: Array, load: Array, derivative: int = 0) -> Array:
        """(S,) the same under force per length `load` (E, 3) along the elements' axes."""
        element, at = self.at(x)
        beams = self.beams.part(element)
        parts = self.parts
        found = np.zeros(len(x))
        for axis, bending, shear in ((1, beams.bending_y, beams.shear_y), (2, beams.bending_z, beams.shear_z)):
            shape = _spread_bending(at, beams.length, derivative) / bending
            shape += _spread_bar(at, beams.length, derivative) / shear
            found += parts[axis][element] * load[element, axis] * shape
        found += parts[0][element] * load[element, 0] * _spread_bar(at, beams.length, derivative) / beams.axial
        return found

    def spread_weight(self, gravity: Array) -> Array:
        """(E, 3) own weight per length along the elements' axes per unit gravity (unit vector (3,)), kg/m."""
        return np.asarray((self.axes @ gravity) * self.beams.mass[:, None])

    @property
    def bending(self) -> Array:
        """(E,) E I of bending in the plane of load and track, N m2."""
        _, y, z = self.parts
        return np.asarray((y**2 * self.beams.bending_y + z**2 * self.beams.bending_z) / (y**2 + z**2))

    def wave_number(self, omega: Array) -> Array:
        """(N,) 1/m: the largest wave number that each frequency can have on the track, a bound for its modes.

        Free waves of a uniform beam: exp(+-k s) and exp(+-i k s) vary no faster than k. Bending of Timoshenko's beam
        k^2 = (a + sqrt(a^2 + 4 b))/2, a = omega^2 (m/(G A_s) + j/(E I)), b = omega^2 m/(E I) (1 - omega^2 j/(G A_s)).
        """
        beams, square = self.beams, omega[:, None] ** 2
        along, across_y, across_z = self.parts
        found = np.zeros_like(square * beams.length)
        for part, bending, shear, turn in (
            (across_y, beams.bending_y, beams.shear_y, beams.turn_inertia_y),
            (across_z, beams.bending_z, beams.shear_z, beams.turn_inertia_z),
        ):
            a = square * (beams.mass / shear + turn / bending)
            b = square * beams.mass / bending * (1.0 - square * turn / shear)
            wave = np.sqrt(0.5 * (a + np.sqrt(np.maximum(a**2 + 4.0 * b, 0.0))))
            found = np.maximum(found, np.where(np.abs(part) > _FELT, wave, 0.0))
        found = np.maximum(found, np.where(np.abs(along) > _FELT, np.sqrt(square * beams.mass / beams.axial), 0.0))
        twist = np.sqrt(square * beams.twist_inertia / beams.torsion)
        return np.asarray(np.maximum(found, np.where(np.abs(self.torque) > 0.0, twist, 0.0)).max(axis=1))


@dataclass(frozen=True, eq=False)
class TrackPoints:
    """Ends of a track's elements: points (E + 1,) of the mesh, and arms (E + 1, 3) from these to the track's axis."""

    points: Counts
    arms: Array

    def of(self, values: Array) -> Array:
        """(E + 1, 6, c) displacements and rotations on the axis from those of all points (6 P, c)."""
        nodal = values.reshape(-1, 6, values.shape[1])[self.points]
        nodal[:, :3] -= cross_matrix(self.arms) @ nodal[:, 3:]
        return nodal

    def loads(self, patterns: Array, which: Counts, size: int) -> Array:
        """(6 P, k r) loads on all points from each pattern (r, 6) of force and torque on some (k,) of the ends."""
        found = np.zeros((size // 6, 6, len(which), len(patterns)))
        for place, end in enumerate(which):
            turn = patterns[:, 3:] + np.cross(self.arms[end], patterns[:, :3])
            found[self.points[end], :, place] = np.concatenate([patterns[:, :3], turn], axis=1).T
        return found.reshape(size, -1)


def track_of(frame: Frame, mesh: Mesh) -> tuple[TrackBeams, TrackPoints]:
    """The elements under a frame's track, turned so that all run along it."""
    return line_of(frame, mesh, frame.line.members, frame.line.direction, np.array(frame.track.offset))


def elements_of(mesh: Mesh, members: Members) -> tuple[Counts, NDArray[np.bool_]]:
    """The elements of members in a row, and which of them run against it."""
    chains = [mesh.chains[name][::-1] if backward else mesh.chains[name] for name, backward in members]
    turned = [np.full(len(chain), backward) for chain, (_, backward) in zip(chains, members, strict=True)]
    return np.concatenate(chains), np.concatenate(turned)


def line_of(
    frame: Frame, mesh: Mesh, members: Members, direction: Array, offset: Array
) -> tuple[TrackBeams, TrackPoints]:
    """The elements of members in one straight row; loads in a direction (3,), off their axis by an offset (3,), m."""
    order, reverse = elements_of(mesh, members)
    flip = np.where(reverse, -1.0, 1.0)[:, None]
    axes = mesh.axes[order] * np.stack([flip, flip, np.ones_like(flip)], axis=1)
    pairs = np.where(reverse[:, None], mesh.pairs[order, ::-1], mesh.pairs[order])
    arms = np.where(reverse[:, None, None], mesh.arms[order, ::-1], mesh.arms[order])
    beams = mesh.beams.part(order)
    sections = [frame.section[frame.member[name].section] for name, _ in members]
    counts = [len(mesh.chains[name]) for name, _ in members]
    fibres = [[_or_nan(section.fibre_distance_lateral), _or_nan(section.fibre_distance)] for section in sections]
    return TrackBeams(
        places=np.concatenate([[0.0], np.cumsum(beams.length)]),
        axes=axes,
        beams=beams,
        area=np.repeat([section.area for section in sections], counts),
        fibres=np.repeat(np.array(fibres), counts, axis=0),
        direction=direction,
        offset=offset,
    ), TrackPoints(np.append(pairs[:, 0], pairs[-1, 1]), np.concatenate([arms[:, 0], arms[-1:, 1]]))


def track_places(places: ArrayLike, length: float, *derivatives: int) -> Array:
    """Stations (S,) of a track of this length, m. Raises BadInput off the body, and for a derivative not in 0..3."""
    found = np.atleast_1d(np.asarray(places, dtype=np.float64))
    inside = found.size and found.min() >= 0.0 and found.max() <= length
    stations(found[:0] if inside else found, length, *derivatives)
    return found if inside else np.clip(found, 0.0, length)


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _bar_shapes(x: Array, length: Array, derivative: int) -> Array:
    """(2, S) linear shapes."""
    if derivative == 0:
        return np.stack([1.0 - x / length, x / length])
    if derivative == 1:
        return np.stack([-1.0 / length, 1.0 / length])
    return np.zeros((2, len(x)))


def _held_bending(
    x: Array, s: Array, right: NDArray[np.bool_], length: Array, bending: Array, phi: Array, derivative: int
) -> Array:
    """Deflection of a clamped element: a force on a free one, minus what brings its far end back.

    Free: v = (x - s)^3/(6 E I) - (x - s)/(G A_s) and rotation (x - s)^2/(2 E I) beyond s, nothing before.
    """
    lever, soft = length - s, phi * length**2 / (12.0 * bending)
    back = deflection_shapes(x, length, phi, derivative)
    found: Array = -back[2] * (lever**3 / (6.0 * bending) - lever * soft) - back[3] * lever**2 / (2.0 * bending)
    u = np.where(right, x - s, 0.0)
    if derivative == 0:
        found += u**3 / (6.0 * bending) - u * soft
    elif derivative == 1:
        found += u**2 / (2.0 * bending) - np.where(right, soft, 0.0)
    else:
        found += u / bending if derivative == 2 else np.where(right, 1.0 / bending, 0.0)
    return found


def held_turning(
    x: Array, s: Array, right: NDArray[np.bool_], length: Array, bending: Array, phi: Array, derivative: int
) -> Array:
    """Its derivative by s: the deflection of a clamped element under a torque, 1/N."""
    lever, soft = length - s, phi * length**2 / (12.0 * bending)
    back = deflection_shapes(x, length, phi, derivative)
    found: Array = back[2] * (lever**2 / (2.0 * bending) - soft) + back[3] * lever / bending
    if derivative == 0:
        u = np.where(right, x - s, 0.0)
        return found - u**2 / (2.0 * bending) + np.where(right, soft, 0.0)
    if derivative == 1:
        return found - np.where(right, x - s, 0.0) / bending
    return found - np.where(right, 1.0 / bending, 0.0) if derivative == 2 else found


def _held_bar(x: Array, s: Array, right: NDArray[np.bool_], length: Array, derivative: int) -> Array:
    """The same along or about the axis, for a stiffness of one."""
    share = (length - s) / length
    if derivative == 0:
        return x * share - np.where(right, x - s, 0.0)
    return share - np.where(right, 1.0, 0.0) if derivative == 1 else np.zeros_like(x)


def _spread_bending(x: Array, length: Array, derivative: int) -> Array:
    """d^j/dx^j of x^2 (L - x)^2/24: a clamped beam under a unit load per length, E I = 1."""
    if derivative == 0:
        return x**2 * (length - x) ** 2 / 24.0
    if derivative == 1:
        return x * (length - x) * (length - 2.0 * x) / 12.0
    return (length**2 - 6.0 * x * (length - x)) / 12.0 if derivative == 2 else x - 0.5 * length


def _spread_bar(x: Array, length: Array, derivative: int) -> Array:
    """d^j/dx^j of x (L - x)/2: a held bar under a unit load per length, stiffness one."""
    if derivative == 0:
        return 0.5 * x * (length - x)
    return 0.5 * length - x if derivative == 1 else np.full_like(x, -1.0 if derivative == 2 else 0.0)
