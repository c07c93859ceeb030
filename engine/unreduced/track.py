"""Places on the track of a whole finite-element model, as rows on its degrees of freedom.

The deflection at s follows the ends of its element by the static shapes; a force at s acts on them by the same
numbers, and bends the element between its ends besides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from engine.bodies.frame.assembly import Assembly, cross_matrix
from engine.bodies.frame.pushes import PushedLine
from engine.bodies.frame.sections import forces_from_ends, held_forces, section_weights, spread_forces
from engine.bodies.frame.shapes import FORCES
from engine.bodies.frame.track import TrackBeams, TrackPoints
from engine.bodies.modal.modal_body import Direction
from results_schema.arrays import Array, Counts

WIDTH = 12  # degrees of freedom of an element
STEP = 1e-3  # of an element's length, between places of a derivative


class Rows(NamedTuple):
    """Rows with a few entries each: values (S, WIDTH) at the degrees of freedom `freedoms` (S, WIDTH)."""

    freedoms: Counts
    values: Array

    def moved(self, first: int) -> Rows:
        """The same where the body's degrees of freedom begin at `first`."""
        return Rows(self.freedoms + first, self.values)

    def repeated(self, count: int) -> Rows:
        """One row, at so many stations."""
        return Rows(np.repeat(self.freedoms, count, axis=0), np.repeat(self.values, count, axis=0))

    def columns(self, size: int) -> Array:
        """(size, S) the same as dense columns."""
        found = np.zeros((size, len(self.freedoms)))
        np.add.at(found, (self.freedoms, np.arange(len(self.freedoms))[:, None]), self.values)
        return found


def no_rows(count: int) -> Rows:
    """Rows of zeros."""
    return Rows(np.zeros((count, WIDTH), dtype=np.int64), np.zeros((count, WIDTH)))


def rows_of(row: Array) -> Rows:
    """One row (n,) with at most 12 entries."""
    found = no_rows(1)
    entries = np.flatnonzero(row)
    found.freedoms[0, : len(entries)], found.values[0, : len(entries)] = entries, row[entries]
    return found


@dataclass(frozen=True, eq=False)
class FrameTrack:
    """The track of a frame.

    numbers (E + 1, 6): of the degrees of freedom of its elements' ends, -1 where they do not move; arms (E + 1, 3): m;
    spread (E, 3): own weight per length along the elements' axes, kg/m.
    """

    track: TrackBeams
    numbers: Counts
    arms: Array
    spread: Array

    @classmethod
    def of(cls, track: TrackBeams, ends: TrackPoints, assembly: Assembly, spread: Array) -> FrameTrack:
        """The track in an assembly's numbers of degrees of freedom."""
        numbers = np.full(6 * len(assembly.mesh.points), -1, dtype=np.int64)
        numbers[assembly.free] = np.arange(len(assembly.free))
        return cls(track, numbers.reshape(-1, 6)[ends.points], ends.arms, spread)

    def rows(self, s: Array, derivative: int = 0) -> Rows:
        """d^j/ds^j of the deflection."""
        element, _ = self.track.at(s)
        return self._on_nodes(element, self.track.to_ends(s, derivative))

    def within(self, x: Array, s: Array, quantity: str = "displacement") -> Array:
        """What the element's own bending between its ends adds to a quantity at x per unit force at s."""
        place, load = (part.reshape(-1) for part in np.broadcast_arrays(x, s))
        if quantity == "displacement":
            found = self.track.within(place, load)
        else:
            found = self._sum(quantity, self.track.at(place)[0], held_forces(self.track, place, load, self.track))
        return found.reshape(np.broadcast_shapes(x.shape, s.shape))

    def inside(self, s: Array) -> tuple[Array, Array]:
        """(S,) places on the same elements, off their ends by the steps (S,) that come with them, m."""
        element, _ = self.track.at(s)
        step = STEP * self.track.beams.length[element]
        return np.clip(s, self.track.places[element] + 2.0 * step, self.track.places[element + 1] - 2.0 * step), step

    def under_weight(self, x: Array, quantity: str = "displacement") -> Array:
        """The same per unit gravity under own weight on the element."""
        if quantity == "displacement":
            return self.track.under_spread_load(x, self.spread)
        element, at = self.track.at(x)
        return self._sum(quantity, element, spread_forces(self.track, element, at, self.spread[element]))

    def _sum(self, quantity: str, element: Counts, forces: Array) -> Array:
        """(S,) a section force, stress or strain from the section forces (S, 6) of elements (S,)."""
        return np.asarray(np.sum(section_weights(self.track, quantity)[element] * forces, axis=1))

    def sections(self, quantity: str, x: Array) -> tuple[Rows, Rows]:
        """A section force, stress or strain, from displacements and from accelerations."""
        element, at = self.track.at(x)
        weights = section_weights(self.track, quantity)[element]
        elements, places = np.repeat(element, WIDTH), np.repeat(at, WIDTH)
        unit = np.tile(np.eye(WIDTH), (len(x), 1))
        strain = forces_from_ends(self.track, elements, places, unit)
        inertia = spread_forces(self.track, elements, places, self._inertia(elements, unit))
        found = [
            np.einsum("scf,sf->sc", forces.reshape(len(x), WIDTH, FORCES), weights) for forces in (strain, inertia)
        ]
        return self._on_nodes(element, found[0]), self._on_nodes(element, found[1])

    def _inertia(self, element: Counts, moved: Array) -> Array:
        """(S, 3) inertia force per length along the element's axes where its ends accelerate by `moved` (S, 12)."""
        ends = moved.reshape(-1, 2, 6)[:, :, :3].mean(axis=1)
        local = np.einsum("sij,sj->si", self.track.axes[element], ends)
        return np.asarray(-self.track.beams.mass[element, None] * local)

    def _on_nodes(self, element: Counts, ends: Array) -> Rows:
        """Rows on degrees of freedom from rows (S, 12) on the ends of the elements' axes: u_end = u + theta x arm."""
        values = ends.reshape(-1, 2, 6).copy()
        which = element[:, None] + np.arange(2)
        values[:, :, 3:] -= np.einsum("sei,seij->sej", values[:, :, :3], cross_matrix(self.arms[which]))
        numbers = self.numbers[which].reshape(-1, WIDTH)
        return Rows(np.maximum(numbers, 0), np.where(numbers >= 0, values.reshape(-1, WIDTH), 0.0))


@dataclass(frozen=True, eq=False)
class AlongTrack:
    """The motion of a frame's track along itself: that of its axis, less what the axis' slope takes from a line beside
    it."""

    line: PushedLine
    axis: FrameTrack
    beside: FrameTrack

    def rows(self, s: Array, derivative: int = 0) -> Rows:
        """d^j/ds^j of it, j up to 2."""
        axis, beside = self.axis.rows(s, derivative), self.beside.rows(s, derivative + 1)
        return Rows(axis.freedoms, axis.values - self.line.lever * beside.values)

    def within(self, x: Array, s: Array) -> Array:
        """(S,) what the element between its ends adds to it at x per unit force along at s, pair by pair."""
        return self.line.within(x, s)

    def inside(self, s: Array) -> tuple[Array, Array]:
        """As of `FrameTrack`."""
        return self.axis.inside(s)

    def under_weight(self, x: Array) -> Array:
        """(S,) what own weight on the element adds, per unit gravity."""
        return self.line.under_spread_load(x, self.axis.spread)


def along_track(line: PushedLine, ends: TrackPoints, assembly: Assembly, spread: Array) -> AlongTrack:
    """The motion of a track along itself in an assembly's numbers of degrees of freedom."""
    return AlongTrack(line, *(FrameTrack.of(part, ends, assembly, spread) for part in (line.axis, line.beside)))


SIDE_TRACKS: Mapping[Direction, Callable[[Any, TrackPoints, Assembly, Array], FrameTrack | AlongTrack]] = {
    "along": along_track,
    "across": FrameTrack.of,
}
