"""The nodes of a model along which loads ride."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.bodies.files.model import Array, Counts
from results_schema.errors import BadInput, shortened

OFF_LINE = 1e-3  # of the track's length: how far its nodes may stand beside a straight line
MAX_NODES = 1000
_SAME = 1e-9  # of the length


@dataclass(frozen=True, eq=False)
class NodeLine:
    """nodes (P,): places in the model's list; places (P,): m along the track, from 0; tangent (3,): unit vector."""

    nodes: Counts
    places: Array
    tangent: Array

    @property
    def length(self) -> float:
        """Of the track, m."""
        return float(self.places[-1])


def line_as_told(numbers: Counts, places: Array, track: Mapping[str, Any]) -> NodeLine:
    """The track by the words of a study: nodes in their order, or all of them near a line. Raises BadInput with the key
    within the track as its place."""
    places, tolerance = places * track["length_unit"], track["tolerance"]
    if track["nodes"] is not None:
        return line_of_nodes(numbers, places, tuple(track["nodes"]), tolerance)
    return line_between(numbers, places, (np.array(track["start"]), np.array(track["end"])), tolerance)


def line_of_nodes(numbers: Counts, places: Array, wanted: tuple[int, ...], tolerance: float | None) -> NodeLine:
    """The track through given nodes in their order; numbers (M,), places (M, 3) m: of all nodes of the model.

    Raises BadInput with the key within the track as its place.
    """
    known = {int(number): index for index, number in enumerate(numbers)}
    for index, number in enumerate(wanted):
        if number not in known:
            near = sorted(known, key=lambda other: abs(other - number))[:5]
            expected = f"a node of the model, such as {', '.join(str(node) for node in near)}"
            raise BadInput("there is no such node", where=f"nodes.{index}", expected=expected, received=str(number))
    chosen = np.array([known[number] for number in wanted], dtype=np.int64)
    first, last = places[chosen[0]], places[chosen[-1]]
    return _line(numbers, places, chosen, (first, last), tolerance, "nodes")


def line_between(numbers: Counts, places: Array, ends: tuple[Array, Array], tolerance: float | None) -> NodeLine:
    """The track through all nodes near the straight line between two places (3,), m. Raises BadInput."""
    length = float(np.linalg.norm(ends[1] - ends[0]))
    if length == 0.0:
        raise BadInput("the track has no length", where="to", expected="another place than `from`")
    limit = OFF_LINE * length if tolerance is None else tolerance
    tangent = (ends[1] - ends[0]) / length
    along = (places - ends[0]) @ tangent
    beside = np.linalg.norm(places - ends[0] - along[:, None] * tangent, axis=1)
    near = np.flatnonzero((beside <= limit) & (along >= -limit) & (along <= length + limit))
    if len(near) < 2:
        corners = (f"({', '.join(f'{x:.4g}' for x in corner)})" for corner in (places.min(axis=0), places.max(axis=0)))
        raise BadInput(
            f"too few nodes within {limit:g} m of this line, between its ends",
            where="from",
            expected="at least 2",
            received=f"{len(near)}; nodes stand from {' to '.join(corners)} m, at least {beside.min():.4g} m beside it",
            remedy="another line, tolerance = ... for nodes beside it, or length_unit where files are not in metres",
        )
    order = near[np.argsort(along[near], kind="stable")]
    spacing = float(np.diff(along[order]).max())
    for key, gap in (("from", along[order[0]]), ("to", length - along[order[-1]])):
        if gap > spacing + limit:
            raise BadInput(
                f"no node of this line is near its end: it would be {gap:.4g} m shorter",
                where=key,
                expected=f"a node within {spacing:.4g} m, the largest distance between its nodes",
                received=f"{len(order)} nodes from {along[order[0]]:.4g} to {along[order[-1]]:.4g} m of {length:.4g} m",
                remedy="another place, or tolerance = ... for nodes beside the line",
            )
    return _line(numbers, places, order, (ends[0], ends[1]), max(limit, OFF_LINE * length), "tolerance")


def _line(
    numbers: Counts, places: Array, chosen: Counts, ends: tuple[Array, Array], tolerance: float | None, key: str
) -> NodeLine:
    length = float(np.linalg.norm(ends[1] - ends[0]))
    if len(chosen) > MAX_NODES:
        raise BadInput("too many nodes", where=key, expected=f"at most {MAX_NODES}", received=str(len(chosen)))
    if length == 0.0:
        raise BadInput("the track has no length", where=key, received=shortened(numbers[chosen].tolist()))
    tangent = (ends[1] - ends[0]) / length
    along = (places[chosen] - places[chosen[0]]) @ tangent
    step = np.diff(along)
    if step.min() <= _SAME * length:
        pair = f"{numbers[chosen[step.argmin()]]} and {numbers[chosen[step.argmin() + 1]]}"
        what = f"the nodes {pair} do not follow each other along the track"
        raise BadInput(what, where=key, expected="nodes in their order, at different places")
    beside = np.linalg.norm(
        places[chosen] - ends[0] - ((places[chosen] - ends[0]) @ tangent)[:, None] * tangent, axis=1
    )
    limit = OFF_LINE * length if tolerance is None else tolerance
    if beside.max() > limit:
        what = f"node {numbers[chosen[beside.argmax()]]} stands {beside.max():.4g} m beside the track's straight line"
        raise BadInput(what, where=key, expected=f"at most {limit:.4g} m", remedy="tolerance = ... allows more")
    return NodeLine(chosen, along, tangent)
