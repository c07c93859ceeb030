"""The track of an imported body between its nodes: mode shapes, statics, stress and strain.

Between two nodes the deflection is the cubic of both values and slopes (mechanics section 1). Slopes are the nodes'
rotations about the axis across track and load; or those of the C2 spline through the values (not-a-knot), where the
model has none. Either way value and slope are linear in the model's displacements u: z = B u. A load on the track acts
through the same B, so that w(x; s) = h(x)^T B G B^T h(s), G the whole model's flexibility, h the cubics: what a direct
solve with this interpolation gives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.frame.geometry import across, unit
from engine.bodies.frame.shapes import differentiated
from engine.bodies.frame.track import track_places
from engine.bodies.imported.model import HeldModel
from engine.bodies.modal.modal_body import Array, Direction, refuse_loose
from engine.kernels.shapes import rows_between
from results_schema.errors import BadInput
from results_schema.lazy_imports import interpolate, sparse

if TYPE_CHECKING:
    from engine.bodies.imported.imported import Imported

# Of value and slope at the left end, then at the right one: coefficients of x^0 to x^3 on [0, 1].
_CUBIC = ((1.0, 0.0, -3.0, 2.0), (0.0, 1.0, -2.0, 1.0), (0.0, 0.0, 3.0, -2.0), (0.0, 0.0, -1.0, 1.0))
_ENDS = 4
SPLINE_NODES = 4  # a spline with a third derivative
_SQUARE = 1e-6  # cosine of the angle between track and load above which stretching along the track counts


def cubics(places: Array, s: ArrayLike, derivative: int) -> tuple[Any, Array]:
    """Which of the (2 P) values and slopes, value and slope by node, act at the stations (S,): numbers (S, 4) and
    weights (S, 4) of d^j/ds^j; at a node from the right."""
    at = track_places(s, float(places[-1]), derivative)
    left = np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 2)
    length = np.diff(places)[left]
    x = np.clip((at - places[left]) / length, 0.0, 1.0)
    (table,), numbers = differentiated(_CUBIC, (derivative,))[0], np.arange(_ENDS)
    weights = np.zeros((_ENDS, len(at)))
    for coefficients in table.T[::-1]:
        weights = weights * x + coefficients[:, None]
    return 2 * left[:, None] + numbers, (weights * length ** (numbers[:, None] % 2 - derivative)).T


@dataclass(frozen=True, eq=False)
class LineShapes:
    """Shapes of N modes: values and slopes (2 P, N) at places (P,), m; unit modal mass."""

    places: Array
    ends: Array

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j phi_k/ds^j at the stations `s` (S,) for several j, as (orders, S, N); at a node from the right."""
        at = track_places(s, float(self.places[-1]), *orders)
        found = np.empty((len(orders), len(at), self.ends.shape[1]))
        rows_between(self.places, *differentiated(_CUBIC, tuple(orders)), self.ends, 2, at, found)
        return found


@dataclass(frozen=True, eq=False)
class LineStatics:
    """Influence functions along a track: flexibility (2 P, 2 P) between values and slopes at places (P,); weight
    (2 P,): the same under own weight per unit gravity; rigid: number of rigid-body modes."""

    places: Array
    flexibility: Array
    weight: Array
    rigid: int

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` per unit force at `s`, m^(1-j)/N, for pairs that are broadcast against each
        other; summed in a fixed order."""
        place, load = np.broadcast_arrays(np.atleast_1d(x), np.atleast_1d(s))
        taken, takes = cubics(self.places, place.reshape(-1), derivative)
        acting, acts = cubics(self.places, load.reshape(-1), 0)
        found: Array = np.zeros(place.size)
        for one in range(_ENDS):
            for other in range(_ENDS):
                found += takes[:, one] * acts[:, other] * self.flexibility[taken[:, one], acting[:, other]]
        return found.reshape(place.shape)

    def own_weight_deflection(self, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) under own weight per unit gravity, m^(1-j)/(m/s^2)."""
        refuse_loose(self.rigid)
        return self.under_response(self.weight, x, derivative)

    def under_response(self, response: Array, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) where values and slopes are `response` (2 P,)."""
        numbers, weights = cubics(self.places, x, derivative)
        return np.asarray(np.sum(weights * response[numbers], axis=1))


def _refuse(quantity: str) -> NoReturn:
    what, expected = f"{quantity} is not available on an imported body", "displacement, velocity or acceleration"
    raise BadInput(what, where="sensor", expected=expected)


class NoSections:
    """An imported body has no section forces, and without a recovery matrix no stress or strain: BadInput."""

    def rows(self, quantity: str, *_: Any, **__: Any) -> NoReturn:
        """Raises BadInput."""
        _refuse(quantity)

    influence_at = own_weight = under_response = rows

    def under_loads(self) -> NoSections:
        """There are none under other loads."""
        return self


@dataclass(frozen=True, eq=False)
class LineRecovered:
    """What a recovery matrix tells at the nodes of a track, linear in between, of K quantities one after the other: of
    N modes, values (K P, N); per unit value and slope loads, response (K P, 2 P); under own weight per unit gravity,
    weight (K P,)."""

    statics: LineStatics
    quantities: tuple[str, ...]
    values: Array
    response: Array
    weight: Array

    def under_loads(self, response: Array) -> LineRecovered:
        """The same of other unit loads, of values and slopes along the track."""
        return replace(self, response=response)

    def rows(self, quantity: str, s: ArrayLike) -> Array:
        """A quantity of every mode at the stations `s` (S,), as (S, N). Raises BadInput for one that is not told."""
        return self._along(quantity, s, self.values)

    def influence_at(self, quantity: str, x: ArrayLike, s: ArrayLike) -> Array:
        """A quantity at `x` per unit force at `s`, for pairs that are broadcast against each other."""
        place, load = np.broadcast_arrays(np.atleast_1d(x), np.atleast_1d(s))
        left, share = self._between(quantity, place.reshape(-1))
        acting, acts = cubics(self.statics.places, load.reshape(-1), 0)
        found: Array = np.zeros(place.size)
        for end in range(_ENDS):
            column = acting[:, end]
            told = (1.0 - share) * self.response[left, column] + share * self.response[left + 1, column]
            found += acts[:, end] * told
        return found.reshape(place.shape)

    def own_weight(self, quantity: str, x: ArrayLike) -> Array:
        """A quantity at `x` (X,) under the body's own weight, per unit gravity."""
        refuse_loose(self.statics.rigid)
        return self.under_response(quantity, self.weight, x)

    def under_response(self, quantity: str, response: Array, x: ArrayLike) -> Array:
        """A quantity at `x` (X,) where all are `response` (K P,) at the nodes."""
        return self._along(quantity, x, response[:, None])[:, 0]

    def _along(self, quantity: str, x: ArrayLike, values: Array) -> Array:
        left, share = self._between(quantity, x)
        return np.asarray((1.0 - share[:, None]) * values[left] + share[:, None] * values[left + 1])

    def _between(self, quantity: str, x: ArrayLike) -> tuple[Any, Array]:
        """Among the values of a quantity that of the node left of every place (X,), and how far towards the next one
        it lies."""
        if quantity not in self.quantities:
            _refuse(quantity)
        places = self.statics.places
        at = track_places(x, float(places[-1]))
        left = np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 2)
        return self.quantities.index(quantity) * len(places) + left, (at - places[left]) / np.diff(places)[left]


LineSections = LineRecovered | NoSections


class LinePushes(NamedTuple):
    """What unit forces on a track in another direction than its loads' do: to its motions by direction, to stress and
    strain; and (2 P,) motions of its nodes in that direction under own weight per unit gravity, and per unit force at
    points and gauges, by name."""

    motions: Mapping[Direction, LineStatics]
    sections: LineSections
    weight: Array
    points: Mapping[str, Array]
    gauges: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class LineSide:
    """Motion of a track in a direction beside that of its loads; find: what unit forces in that do, when it is first
    asked for."""

    direction: Direction
    wave_number: Array
    shapes: LineShapes
    find: Callable[[], LinePushes]

    def derivatives(self, s: ArrayLike, orders: Sequence[int]) -> Array:
        """d^j psi_k/ds^j at the stations `s` (S,) for several j up to 2, as (orders, S, N)."""
        return self.shapes.derivatives(s, orders)

    def influence_at(self, direction: Direction, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the motion in a direction at `x` per unit force at `s`, m^(1-j)/N, for pairs that are broadcast
        against each other."""
        return self.find().motions[direction].influence_at(x, s, derivative)

    def own_weight_motion(self, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the motion at `x` (X,) under own weight per unit gravity. Raises BadInput for a body that nothing
        holds."""
        pushes = self.find()
        motion = pushes.motions[self.direction]
        refuse_loose(motion.rigid)
        return motion.under_response(pushes.weight, x, derivative)

    def section_at(self, quantity: str, x: ArrayLike, s: ArrayLike) -> Array:
        """Stress or strain at `x` per unit force at `s`, likewise."""
        return self.find().sections.influence_at(quantity, x, s)

    def of_point(self, name: str, s: ArrayLike) -> Array:
        """(S,) motion of a point per unit force at `s`, m/N."""
        pushes = self.find()
        return pushes.motions[self.direction].under_response(pushes.points[name], s)

    def of_gauge(self, name: str, s: ArrayLike) -> Array:
        """(S,) motion of what a sensor reads, likewise."""
        pushes = self.find()
        return pushes.motions[self.direction].under_response(pushes.gauges[name], s)


def track_rows(body: Imported, held: HeldModel) -> tuple[Any, Array]:
    """Sparse (n, m): what of the model's displacements counts on the track, and dense (2 P, m): what values and slopes
    these make. Raises BadInput where no node of the track can move."""
    direction = unit(body.direction)
    values, slopes = spline_rows(body, held, direction)
    if not values.nnz:
        raise BadInput("no node of the track can move along the load", where="track", expected="free nodes")
    return rotation_rows(body, held, direction) if by_rotations(body, held) else (values, slopes)


def side_rows(body: Imported, held: HeldModel) -> dict[Direction, tuple[Any, Array]]:
    """The same of the track's motions in other directions than its loads', as far as its nodes move so: along it by
    the spline, across as it deflects where rotations are told for that too."""
    tangent, load = body.line.tangent, unit(body.direction)
    beside = across(tangent, load)
    turned = by_rotations(body, held) and told_rotations(body, held, beside)
    rows_across = rotation_rows if turned else spline_rows
    found: dict[Direction, tuple[Any, Array]]
    found = {"along": spline_rows(body, held, tangent), "across": rows_across(body, held, beside)}
    return {direction: rows for direction, rows in found.items() if rows[0].nnz}


def spline_rows(body: Imported, held: HeldModel, direction: Array) -> tuple[Any, Array]:
    """The same in a direction (3,), with slopes by a smooth curve."""
    line, count = body.line, len(body.line.nodes)
    spread = np.zeros((2 * count, count))
    spread[::2], spread[1::2] = np.eye(count), spline_slopes(line.places)
    return node_rows(held, line.nodes, direction, 0), spread


def rotation_rows(body: Imported, held: HeldModel, direction: Array) -> tuple[Any, Array]:
    """The same with slopes by the nodes' rotations."""
    line, count = body.line, len(body.line.nodes)
    spread = np.zeros((2 * count, count))
    spread[::2] = np.eye(count)
    stretch, turning = float(line.tangent @ direction), np.cross(line.tangent, direction)
    parts = [node_rows(held, line.nodes, way, first) for way, first in ((direction, 0), (turning, 3))]
    columns = [spread, np.zeros_like(spread)]
    columns[1][1::2] = np.eye(count)
    if abs(stretch) > _SQUARE:
        parts.append(node_rows(held, line.nodes, line.tangent, 0))
        columns.append(np.zeros_like(spread))
        columns[2][1::2] = stretch * spline_slopes(line.places)
    return sparse.hstack(parts).tocsc(), np.concatenate(columns, axis=1)


def by_rotations(body: Imported, held: HeldModel) -> bool:
    """Whether slopes are rotations. Raises BadInput where they cannot be found."""
    rows = [held.file.rows_of(int(node)) for node in body.line.nodes]
    asked, told = body.track.interpolation, told_rotations(body, held, unit(body.direction))
    if asked == "rotations" and not any((row[3:] >= 0).any() for row in rows):
        where, remedy = "track.interpolation", 'interpolation = "spline"'
        raise BadInput("the nodes of the track have no rotations", where=where, remedy=remedy)
    if asked == "rotations" or (asked == "auto" and told):
        return True
    if len(rows) < SPLINE_NODES:
        what = "too few nodes for a smooth curve through their displacements"
        raise BadInput(what, where="track", expected=f"at least {SPLINE_NODES} nodes", received=str(len(rows)))
    return False


def told_rotations(body: Imported, held: HeldModel, direction: Array) -> bool:
    """Whether all nodes of the track tell the rotations that are its slopes in a direction (3,)."""
    rows = [held.file.rows_of(int(node)) for node in body.line.nodes]
    turning = np.abs(np.cross(body.line.tangent, direction)) > _SQUARE
    return all((row[3:][turning] >= 0).all() for row in rows if (row >= 0).any())


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
