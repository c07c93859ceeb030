"""What a body out of finite-element files looks like: its nodes, joined where its stiffness joins neighbours."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.files.model import FileModel
from engine.bodies.frame.geometry import unit
from engine.bodies.imported.body import motion_of_nodes
from engine.bodies.modal.description import Spot
from engine.bodies.modal.outline import Elastic, Held, Line, Outline
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.bodies.imported.imported import Imported

MOST_NODES, MOST_JOINED = 1200, 600  # that are drawn, and joined by lines
MOST_PAIRS = 40  # of a node: beyond it a matrix is a reduced one, which joins everything
NEARER = 1e-6  # part of a distance by which a third node is nearer
MOST_HELD = 24  # of one group that are drawn


def imported_outline(body: Imported) -> Outline:
    """The body in the coordinates of its files, in m."""
    held, motion = motion_of_nodes(body)
    file, line = held.file, body.line
    places = file.places * body.length_unit
    shown = np.arange(0, len(places), -(-len(places) // MOST_NODES))
    pairs = _neighbours(file, places) if len(places) <= MOST_JOINED else []
    named = {f"{file.nodes[node]}": places[node] for node in line.nodes[[0, -1]]}
    named |= {name: body.spot_place(Spot(point=name)) for name in body.point}
    start, moving = places[line.nodes[0]], set(file.owner[held.free].tolist()) - {-1}
    return Outline(
        track=np.array([start, start + body.length * line.tangent]),
        lines=tuple(Line(places[joined], motion[joined]) for joined in (line.nodes.tolist(), *pairs)),
        down=unit(body.gravity_direction),
        cloud=Line(places[shown], motion[shown]),
        nodes=named,
        held=tuple(_held(body, file, places)),
        springs=tuple(
            Elastic(f"point {name}", named[name], (0.0, 0.0, 0.0), damped=True)
            for name, point in body.point.items()
            if point.damping > 0.0
        ),
        counts={
            "nodes": len(places),
            "on the track": len(line.nodes),
            "that cannot move": len(places) - len(moving),
            "degrees of freedom": len(held.free),
        },
    )


def _held(body: Imported, file: FileModel, places: Array) -> Iterator[Held]:
    """Nodes of supports; not what holds all nodes, as in a plane model."""
    for group in body.supports:
        nodes = body.group(group)
        if len(nodes) < len(places):
            for node in nodes[:: -(-len(nodes) // MOST_HELD)]:
                yield Held(
                    f"node {file.nodes[node]}", places[node], tuple(body.holds(group)), unit(body.gravity_direction)
                )


def _neighbours(file: FileModel, places: Array) -> list[list[int]]:
    """Pairs of nodes that the stiffness joins, but for those with a third one nearer to both: diagonals of elements.
    None of a matrix that joins everything."""
    entries = file.stiffness.tocoo()
    ends = np.sort(file.owner[np.array([entries.row, entries.col])], axis=0)
    pairs = np.unique(ends[:, (ends[0] >= 0) & (ends[0] < ends[1])], axis=1)
    if pairs.shape[1] > MOST_PAIRS * len(places):
        return []
    gaps = np.linalg.norm(places[pairs[0]] - places[pairs[1]], axis=1)
    near: list[dict[int, float]] = [{} for _ in places]
    for one, other, gap in zip(*pairs.tolist(), gaps.tolist(), strict=True):
        near[one][other] = near[other][one] = gap

    def is_edge(one: int, other: int) -> bool:
        longest = (1.0 - NEARER) * near[one][other]
        both = near[one].keys() & near[other].keys()
        return not any(max(near[one][third], near[other][third]) < longest for third in both)

    return [[one, other] for one, other in pairs.T.tolist() if is_edge(one, other)]
