"""Places of a frame that sensors read off its track, or on it in another direction; and its points off the track, where
shoes, sensors and dampers stand: a node's displacement in a direction, or the elongation of a spring's direction.

A node, or a place of a member between its nodes, is one number v = r . u of the frame's motion (r from the element's
static shapes), so that by Maxwell's theorem the load r tells what a load on the track moves it by. Where both stand on
one element, that bends between its ends besides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.bodies.frame.assembly import MASSES, Assembly, spring_rows
from engine.bodies.frame.geometry import DIRECTIONS, unit
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.shapes import mode_forces, track_shapes
from engine.bodies.frame.statics import TrackStatics
from engine.bodies.frame.supports import frame_support
from engine.bodies.frame.track import Line, TrackBeams, TrackPoints, elements_of, line_of
from engine.bodies.modal.description import Spot
from engine.bodies.modal.flexibility import Flexibility, without_rounding
from engine.bodies.modal.modal_body import Array, Direction, Gauge, Points

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame
    from engine.bodies.frame.pushes import PushStatics


class Read(NamedTuple):
    """What a frame is read with: its matrices, its track with the points under it, frequencies and whole shapes."""

    frame: Frame
    assembly: Assembly
    flexibility: Flexibility
    statics: TrackStatics
    pushes: Mapping[Direction, Callable[[], PushStatics]]
    ends: TrackPoints
    omega: Array
    shapes: Array

    @property
    def pull(self) -> Array:
        """(n,) own weight per unit gravity."""
        return np.asarray(self.assembly.drag @ unit(self.frame.gravity))

    def moved(self, response: Array) -> dict[Direction, Callable[[Array], Array]]:
        """Motions of the track in other directions than its loads' at places (S,) where its points move by `response`
        (6 (E + 1),)."""
        return {direction: partial(_moved, find, direction, response) for direction, find in self.pushes.items()}


@dataclass(frozen=True, eq=False)
class FrameSpot:
    """A spot of a frame in its matrices; track: that of the frame."""

    frame: Frame
    assembly: Assembly
    track: TrackBeams
    spot: Spot

    @property
    def direction(self) -> Array:
        """(3,) unit vector that is read."""
        return unit(self.frame.gravity if self.spot.direction is None else self.spot.direction)

    @cached_property
    def line(self) -> tuple[TrackBeams, TrackPoints]:
        """The member that it stands on."""
        members = [(str(self.spot.member), False)]
        return line_of(self.frame, self.assembly.mesh, members, self.direction, np.zeros(3))

    @property
    def row(self) -> Array:
        """(n,) r: its motion from the free degrees of freedom, and the load that a unit force there is."""
        size = 6 * len(self.assembly.mesh.points)
        if self.spot.member is None:
            row = np.zeros((size // 6, 6))
            row[list(self.frame.node).index(str(self.spot.node)), :3] = self.direction
            return np.asarray(row.reshape(-1)[self.assembly.free])
        beams, ends = self.line
        element, _ = beams.at(np.array([self.spot.at]))
        acts = beams.to_ends(np.array([self.spot.at])).reshape(2, 1, 6)
        first, second = (ends.loads(part, element + end, size)[:, 0] for end, part in enumerate(acts))
        return np.asarray((first + second)[self.assembly.free])

    def within(self, s: Array, loads: Line | None = None) -> Array:
        """(S,) m/N: what a unit force at s on the track adds where it bends the spot's own element; loads: the line
        whose force it is, that of the track across unless given."""
        if self.spot.member is None:
            return np.zeros(len(s))
        beams, _ = self.line
        order, turned = elements_of(self.assembly.mesh, self.frame.line.members)
        (element,), (x,) = beams.at(np.array([self.spot.at]))
        here = np.flatnonzero(order == self.assembly.mesh.chains[self.spot.member][element])
        if not len(here):
            return np.zeros(len(s))
        j = here[0]
        place = self.track.places[j] + (beams.beams.length[element] - x if turned[j] else x)
        found, on = np.zeros(len(s)), self.track.at(s)[0] == j
        held = (self.track if loads is None else loads).held_parts(np.full(np.count_nonzero(on), place), s[on], 0)
        found[on] = (self.track.axes[j] @ self.direction) @ held[:3]
        return found

    @property
    def under_weight(self) -> float:
        """What own weight on its element adds per unit gravity."""
        if self.spot.member is None or self.frame.mass_matrix != "consistent":
            return 0.0
        beams, _ = self.line
        spread = beams.spread_weight(unit(self.frame.gravity))
        return float(beams.under_spread_load(np.array([self.spot.at]), spread)[0])

    def mode_row(self, omega: Array, shapes: Array) -> Array:
        """(N,) what modes of shapes (n, N) move it by; inside a member as precisely as along a track."""
        if self.spot.member is None:
            return np.asarray(self.row @ shapes)
        beams, ends = self.line
        moved = without_rounding(ends.of(self.assembly.whole(shapes)), (0, 1))
        forces = mode_forces(beams, moved, omega**2 * moved, MASSES[self.frame.mass_matrix](beams.beams))
        return np.asarray(track_shapes(beams, moved, forces).derivatives([self.spot.at], (0,))[0, 0])


def frame_gauge(read: Read, spot: Spot, points: tuple[dict[str, int], Array]) -> Gauge:
    """A place or support that a sensor reads; points: names and loads (6 P, P) of the frame's points."""
    if spot.support:
        return frame_support(read, spot, points)
    statics, assembly = read.statics, read.assembly
    place = FrameSpot(read.frame, assembly, statics.track, spot)
    row = place.row
    moved = read.flexibility.solve(row[:, None])
    response = read.ends.of(assembly.whole(moved)).reshape(-1)
    sides = read.moved(response).items()
    weight = float(moved[:, 0] @ read.pull) + place.under_weight
    names, loads = points
    return Gauge(
        row=place.mode_row(read.omega, read.shapes),
        along=partial(_along, statics, response, place),
        points={name: float(loads[assembly.free, number] @ moved[:, 0]) for name, number in names.items()},
        rigid=statics.rigid,
        weight=weight,
        pushed={direction: partial(_pushed, read.pushes[direction], side, place) for direction, side in sides},
    )


def _along(statics: TrackStatics, response: Array, place: FrameSpot, s: Array) -> Array:
    return statics.under_response(response, s) + place.within(s)


def _moved(find: Callable[[], PushStatics], direction: Direction, response: Array, s: Array) -> Array:
    return find().influence(direction).under_response(response, s)


def _pushed(find: Callable[[], PushStatics], moved: Callable[[Array], Array], place: FrameSpot, s: Array) -> Array:
    return moved(s) + place.within(s, find().deflection.loads)


def point_loads(frame: Frame, assembly: Assembly) -> tuple[dict[str, int], Array]:
    """Names with their numbers, and loads (n, P): the points of the study, then all directions of all springs."""
    numbers, loads = loads_everywhere(frame, assembly)
    return numbers, loads[assembly.free]


def loads_everywhere(frame: Frame, assembly: Assembly) -> tuple[dict[str, int], Array]:
    """The same on all degrees of freedom, (6 P, P)."""
    nodes = {name: index for index, name in enumerate(frame.node)}
    total = len(assembly.mesh.points)
    rows: dict[str, Array] = {}
    for name, point in frame.point.items():
        direction = unit(frame.gravity if point.direction is None else point.direction)
        row = np.zeros((total, 6))
        row[nodes[point.node]] = np.concatenate([direction, np.cross(point.offset, direction)])
        rows[f"point.{name}"] = row.reshape(-1)
    for name in frame.spring:
        for word, row in zip(DIRECTIONS, spring_rows(frame, name, nodes, assembly.mesh), strict=True):
            rows[f"spring.{name}.{word}"] = row
    numbers = {name: index for index, name in enumerate(rows)}
    return numbers, np.array(list(rows.values())).reshape(len(rows), 6 * total).T


def frame_points(read: Read, points: tuple[dict[str, int], Array], sections: TrackSections) -> Points:
    """The frame's points, from their names and loads (n, P)."""
    numbers, loads = points
    moved, statics = read.flexibility.solve(loads), read.statics
    response = read.ends.of(read.assembly.whole(moved)).reshape(statics.weight.size, -1)
    return Points(
        numbers=numbers,
        shapes=loads.T @ read.shapes,
        flexibility=loads.T @ moved,
        response=response,
        section_response=response,
        weight=moved.T @ read.pull,
        rigid=statics.rigid,
        statics=statics,
        sections=sections,
    )
