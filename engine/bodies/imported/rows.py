"""What of an imported model's displacements counts on its track: values and slopes at the track's nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from engine.bodies.frame.geometry import unit
from engine.bodies.imported.model import HeldModel
from engine.bodies.modal.modal_body import Array
from results_schema.errors import BadInput
from results_schema.late import interpolate, sparse

if TYPE_CHECKING:
    from engine.bodies.imported.imported import Imported

SPLINE_NODES = 4  # a spline with a third derivative
_SQUARE = 1e-6  # cosine of the angle between track and load above which stretching along the track counts


def track_rows(body: Imported, held: HeldModel) -> tuple[Any, Array]:
    """Sparse (n, m): what of the model's displacements counts on the track, and dense (2 P, m): what values and slopes
    these make. Raises BadInput where no node of the track can move."""
    line, direction = body.line, unit(body.direction)
    turning = np.cross(line.tangent, direction)
    values = node_rows(held, line.nodes, direction, 0)
    if not values.nnz:
        raise BadInput("no node of the track can move along the load", where="track", expected="free nodes")
    count = len(line.nodes)
    spread = np.zeros((2 * count, count))
    spread[::2] = np.eye(count)
    if not by_rotations(body, held):
        spread[1::2] = spline_slopes(line.places)
        return values, spread
    stretch = float(line.tangent @ direction)
    parts, columns = [values, node_rows(held, line.nodes, turning, 3)], [spread, np.zeros_like(spread)]
    columns[1][1::2] = np.eye(count)
    if abs(stretch) > _SQUARE:
        parts.append(node_rows(held, line.nodes, line.tangent, 0))
        columns.append(np.zeros_like(spread))
        columns[2][1::2] = stretch * spline_slopes(line.places)
    return sparse.hstack(parts).tocsc(), np.concatenate(columns, axis=1)


def by_rotations(body: Imported, held: HeldModel) -> bool:
    """Whether slopes are rotations. Raises BadInput where they cannot be found."""
    line, file = body.line, held.file
    rows = [file.rows_of(int(node)) for node in line.nodes]
    turning = np.abs(np.cross(line.tangent, unit(body.direction))) > _SQUARE
    told = all((row[3:][turning] >= 0).all() for row in rows if (row >= 0).any())
    asked = body.track.interpolation
    if asked == "rotations" and not any((row[3:] >= 0).any() for row in rows):
        where, remedy = "track.interpolation", 'interpolation = "spline"'
        raise BadInput("the nodes of the track have no rotations", where=where, remedy=remedy)
    if asked == "rotations" or (asked == "auto" and told):
        return True
    if len(rows) < SPLINE_NODES:
        what = "too few nodes for a smooth curve through their displacements"
        raise BadInput(what, where="track", expected=f"at least {SPLINE_NODES} nodes", received=str(len(rows)))
    return False


def node_rows(held: HeldModel, nodes: Any, direction: Array, first: int) -> Any:
    """Sparse (n, P): motion of nodes in a direction (3,), displacements (first 0) or rotations (first 3)."""
    place = np.full(held.file.size, -1, dtype=np.int64)
    place[held.free] = np.arange(len(held.free))
    entries = []
    for column, node in enumerate(nodes):
        rows = held.file.rows_of(int(node))[first : first + 3]
        for row, share in zip(rows, direction, strict=True):
            if row >= 0 and place[row] >= 0 and share != 0.0:
                entries.append((float(share), int(place[row]), column))
    shares, at, columns = np.array(entries).reshape(-1, 3).T
    return sparse.csc_array((shares, (at.astype(int), columns.astype(int))), shape=(len(held.free), len(nodes)))


def spline_slopes(places: Array) -> Array:
    """(P, P): slopes at the nodes of the C2 spline (not-a-knot) through values there."""
    return np.asarray(interpolate.CubicSpline(places, np.eye(len(places)))(places, 1))
