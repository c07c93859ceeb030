"""Points of a frame off its track: where shoes, sensors and dampers stand.

A point is a node's displacement in a direction, or the elongation of a spring's direction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.frame.assembly import Assembly, spring_rows
from engine.bodies.frame.geometry import DIRECTIONS, unit
from engine.bodies.frame.sections import TrackSections
from engine.bodies.frame.track import TrackPoints
from engine.bodies.modal.flexibility import Flexibility
from engine.bodies.modal.modal_body import Array, Points

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame


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
) -> Points:
    """Points from their loads (n, P), the modes' shapes (n, N) and own weight per unit gravity (n,)."""
    numbers, rows = loads
    moved = flexibility.solve(rows)
    statics = sections.statics
    response = points.of(assembly.whole(moved)).reshape(statics.weight.size, -1)
    return Points(
        numbers=numbers,
        shapes=rows.T @ shapes,
        flexibility=rows.T @ moved,
        response=response,
        section_response=response,
        weight=moved.T @ pull,
        rigid=statics.rigid,
        statics=statics,
        sections=sections,
    )
