"""Points of a frame off its track: where shoes, sensors and dampers stand.

A point is one number of the body's motion, v = r . u: a node's displacement in a direction, or the elongation of a
spring's direction. A unit force there is the load r, so that by Maxwell's theorem one static solution per point tells
what it does to the track and what a load on the track does to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.frame.assembly import Assembly, spring_rows
from engine.bodies.frame.geometry import DIRECTIONS, unit
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.track import TrackPoints
from engine.bodies.modal.flexibility import Flexibility
from engine.bodies.modal.modal_body import Array

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame


@dataclass(frozen=True, eq=False)
class FramePoints:
    """Points by name: shapes (P, N), kg^(-1/2); flexibility (P, P), m/N between points; response (6 (E + 1), P) of the
    track's points to a unit force at each point; weight (P,): motion under own weight per unit gravity."""

    numbers: Mapping[str, int]
    shapes: Array
    flexibility: Array
    response: Array
    weight: Array
    sections: TrackSections

    def row(self, name: str) -> Array:
        """(N,) what every mode moves a point by."""
        return np.asarray(self.shapes[self.numbers[name]])

    def influence(self, name: str, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) of the track per unit force at a point."""
        return self.sections.statics.under_response(self.response[:, self.numbers[name]], x, derivative)

    def section_influence(self, quantity: str, name: str, x: ArrayLike) -> Array:
        """A section force, stress or strain at `x` (X,) of the track per unit force at a point."""
        return self.sections.under_response(quantity, self.response[:, self.numbers[name]], x)

    def between(self, name: str, other: str) -> float:
        """Motion of a point per unit force at another one, m/N."""
        return float(self.flexibility[self.numbers[name], self.numbers[other]])

    def own_weight(self, name: str) -> float:
        """Motion of a point under own weight per unit gravity. Raises BadInput for a body that nothing holds."""
        self.sections.statics.refuse_loose()
        return float(self.weight[self.numbers[name]])


def point_loads(frame: Frame, assembly: Assembly) -> tuple[dict[str, int], Array]:
    """Names with their numbers, and loads (n, P): the points of the study, then all directions of all springs."""
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
    return numbers, np.array(list(rows.values())).reshape(len(rows), 6 * total).T[assembly.free]


def frame_points(
    loads: tuple[dict[str, int], Array],
    assembly: Assembly,
    flexibility: Flexibility,
    sections: TrackSections,
    points: TrackPoints,
    shapes: Array,
    pull: Array,
) -> FramePoints:
    """Points from their loads (n, P), the modes' shapes (n, N) and own weight per unit gravity (n,)."""
    numbers, rows = loads
    moved = flexibility.solve(rows)
    size = sections.statics.weight.size
    return FramePoints(
        numbers=numbers,
        shapes=rows.T @ shapes,
        flexibility=rows.T @ moved,
        response=points.of(assembly.whole(moved)).reshape(size, -1),
        weight=moved.T @ pull,
        sections=sections,
    )
