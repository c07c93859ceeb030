"""Forces along the track of a frame and across it, as the inertia of masses pushes it, and the motion that they feel.

Along, on the axis, they stretch its elements; beside it, by a lever, they turn them too. Across they bend and twist
them as loads do. What a force does to the ends of its element and what the motion takes from them are the same numbers,
so that influence lines are symmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.frame.geometry import across
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.shapes import AlongShapes, ModeForces, track_shapes
from engine.bodies.frame.statics import TrackInfluence, TrackStatics
from engine.bodies.frame.track import Line, TrackBeams, held_turning, track_places
from engine.bodies.modal.modal_body import Array, Direction, Points, Shapes, refuse_loose
from results_schema.arrays import Counts

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame


@dataclass(frozen=True, eq=False)
class PushedLine:
    """The motion of a track along itself, as `AlongShapes` has it: that of its axis, less what the slope of the axis
    takes from a line beside it by a lever (m); and unit forces along it."""

    axis: TrackBeams
    beside: TrackBeams
    lever: float

    @classmethod
    def of(cls, track: TrackBeams) -> PushedLine:
        """That of a track."""
        lever, on_axis = float(np.linalg.norm(track.offset)), np.zeros(3)
        sideways = track.offset / lever if lever else track.direction
        axis, beside = (replace(track, direction=way, offset=on_axis) for way in (track.axes[0, 0], sideways))
        return cls(axis, beside, lever)

    @property
    def places(self) -> Array:
        """(E + 1,) ends of its elements, m."""
        return self.axis.places

    @property
    def turns(self) -> bool:
        """Whether it stands off its axis so that its loads turn the elements."""
        return self.lever > 0.0

    def at(self, s: Array) -> tuple[Counts, Array]:
        """(S,) elements, from the right at a joint, and places in them."""
        return self.axis.at(s)

    def to_ends(self, s: Array, derivative: int = 0) -> Array:
        """(S, 12): d^j/ds^j of the motion along from displacements and rotations of its element's ends."""
        return np.asarray(self.axis.to_ends(s, derivative) - self.lever * self.beside.to_ends(s, derivative + 1))

    def where_ends_move(self, ends: Array, s: Array, derivative: int = 0) -> Array:
        """(S,) d^j/ds^j of the motion along where the ends of the elements move by (E + 1, 6)."""
        turned = self.beside.where_ends_move(ends, s, derivative + 1)
        return np.asarray(self.axis.where_ends_move(ends, s, derivative) - self.lever * turned)

    def wave_number(self, omega: Array) -> Array:
        """(N,) 1/m, as of `TrackBeams`."""
        found = self.axis.wave_number(omega)
        return np.maximum(found, self.beside.wave_number(omega)) if self.lever else found

    def within(self, x: Array, s: Array, derivative: int = 0, loads: Line | None = None) -> Array:
        """(S,) d^j/dx^j of the motion along at x of an element with held ends under a unit load of a line at s."""
        loads = self if loads is None else loads
        stretched, turned = self.axis.within(x, s, derivative, loads), self.beside.within(x, s, derivative + 1, loads)
        return np.asarray(stretched - self.lever * turned)

    def held_parts(self, x: Array, s: Array, derivative: int) -> Array:
        """(4, S) extension, bending and twist of such an element at x under a unit force along at s."""
        turned = self.beside.held_parts(x, s, derivative, held_turning)
        return np.asarray(self.axis.held_parts(x, s, derivative) - self.lever * turned)

    def under_spread_load(self, x: Array, load: Array, derivative: int = 0) -> Array:
        """(S,) d^j/dx^j of the motion along at x of elements with held ends, as of `TrackBeams`."""
        turned = self.beside.under_spread_load(x, load, derivative + 1)
        return np.asarray(self.axis.under_spread_load(x, load, derivative) - self.lever * turned)


SideLine = PushedLine | TrackBeams


def side_lines(frame: Frame, track: TrackBeams) -> dict[Direction, SideLine]:
    """The motions of a frame's track in other directions than its loads': along it, and of one in space across both."""
    along = PushedLine.of(track)
    if frame.plane is not None:
        return {"along": along}
    return {"along": along, "across": replace(track, direction=across(track.axes[0, 0], track.direction))}


def along_shapes(line: PushedLine, moved: Array, forces: ModeForces) -> AlongShapes:
    """Shapes by a line from displacements and rotations (E + 1, 6, N) of the track's points and the modes' section
    forces."""
    beside = track_shapes(line.beside, moved, forces) if line.lever else None
    return AlongShapes(track_shapes(line.axis, moved, forces), line.lever, beside)


SIDE_SHAPES: Mapping[Direction, Callable[[Any, Array, ModeForces], Shapes]] = {
    "along": along_shapes,
    "across": track_shapes,
}


@dataclass(frozen=True, eq=False)
class PushStatics:
    """Under unit forces on one line of a track: its deflection, and its motions by the lines of other directions."""

    deflection: TrackStatics
    lines: Mapping[Direction, Line]

    def influence(self, direction: Direction) -> TrackInfluence:
        """Of the motion in a direction."""
        return self.deflection if direction == "load" else self._by_line[direction]

    def own_weight(self, direction: Direction, x: ArrayLike, derivative: int) -> Array:
        """d^j/dx^j of the motion in a direction at `x` (X,) under own weight per unit gravity."""
        motion, statics = self.influence(direction), self.deflection
        refuse_loose(statics.rigid)
        x = track_places(x, statics.length)
        between = motion.track.under_spread_load(x, statics.spread, derivative)
        return np.asarray(motion.under_response(statics.weight, x, derivative) + between)

    @cached_property
    def _by_line(self) -> dict[Direction, TrackInfluence]:
        """By the lines of other directions; each keeps its cubics."""
        own = self.deflection
        return {
            direction: TrackInfluence(line, own.loads, own.patterns, own.flexibility)
            for direction, line in self.lines.items()
        }


@dataclass(frozen=True, eq=False)
class FrameSide:
    """Motion of a frame's track in a direction beside that of its loads, and what unit forces in that do. find: its
    statics, which are made when they are first asked for; forces: section forces of its modes; points: places off the
    track, if there are any."""

    direction: Direction
    wave_number: Array
    shapes: Shapes
    forces: ModeForces
    points: Points | None
    find: Callable[[], PushStatics]

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j psi_k/ds^j at the stations `s` (S,) for several j up to 2, as (orders, S, N)."""
        return self.shapes.derivatives(s, orders)

    @cached_property
    def statics(self) -> PushStatics:
        """Influence functions."""
        return self.find()

    def influence_at(self, direction: Direction, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the motion in a direction at `x` per unit force at `s`, m^(1-j)/N, for pairs that are broadcast
        against each other."""
        return self.statics.influence(direction).influence_at(x, s, derivative)

    def own_weight_motion(self, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the motion at `x` (X,) under own weight per unit gravity. Raises BadInput for a frame without
        supports."""
        return self.statics.own_weight(self.direction, x, derivative)

    def section_at(self, quantity: str, x: ArrayLike, s: ArrayLike) -> Array:
        """A section force, stress or strain at `x` per unit force at `s`, likewise."""
        return TrackSections(self.statics.deflection, self.forces).influence_at(quantity, x, s)

    def of_point(self, name: str, s: ArrayLike) -> Array:
        """(S,) motion of a point per unit force at `s`, m/N."""
        assert self.points is not None
        response = self.points.response[:, self.points.numbers[name]]
        return self.statics.influence(self.direction).under_response(response, s)
