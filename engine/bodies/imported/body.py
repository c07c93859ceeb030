"""An imported model as a modal body: its modes, its track between nodes, its points, and its checks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from engine.bodies.frame.body import settled
from engine.bodies.frame.geometry import unit
from engine.bodies.imported.findings import doubts, findings, unknown_weight
from engine.bodies.imported.line import (
    LinePushes,
    LineRecovered,
    LineSections,
    LineShapes,
    LineSide,
    LineStatics,
    NoSections,
    node_rows,
    side_rows,
    track_rows,
)
from engine.bodies.imported.model import HeldModel, held_model
from engine.bodies.modal.description import AUTO_MODES, Spots
from engine.bodies.modal.flexibility import Flexibility, solving
from engine.bodies.modal.modal_body import Array, Direction, Gauge, ModalBody, Points, Sections
from results_schema.errors import BadInput
from results_schema.lazy_imports import sparse

if TYPE_CHECKING:
    from engine.bodies.imported.imported import Imported


ABOUT_MODES = ("modes",)  # what the statics do not depend on
MOST_SAMPLES = 4001  # places where the wave numbers of shapes are read
_COLUMNS = 64
_UNFELT = 1e-9  # of the largest displacement: below it a mode does not move the track


_Pushed = dict[Direction, Callable[[Array], Array]]
_Parts = tuple[Array, Any, Array, Array, Array]  # mode shapes, track's rows and slopes, own weight, points' loads


@dataclass(frozen=True)
class _Content:
    """A body by what its modes and statics depend on, so that the variants of a sweep share them."""

    text: str
    body: Imported = field(compare=False)

    @classmethod
    def of(cls, body: Imported, without: Iterable[str] = ()) -> _Content:
        """All that matters to a body without damping and own weight, besides the keys ``without``."""
        left_out = dict.fromkeys(("damping_ratio", "own_weight", *without), True)
        return cls(body.model_dump_json(exclude=left_out) + body.content, body)


def imported_body(body: Imported, spots: Spots = ()) -> ModalBody:
    """The body in modal coordinates with its exact statics, read at some spots; the last few are remembered.

    Raises BadInput, with the key within the body as its place, for a model that cannot be a body as it stands.
    """
    return _imported_body(_Content.of(body), spots)


@lru_cache(maxsize=8)
def _imported_body(content: _Content, spots: Spots) -> ModalBody:
    what = "the stiffnesses and masses of this model cannot be solved"
    with solving(what, "supports", "a model that is held, of one scale") as demand_finite:
        found, statics = _modal_body(content.body, spots)
        demand_finite(found.omega, found.participation, found.wave_number, statics.flexibility, statics.weight)
    return found


def _modal_body(body: Imported, spots: Spots) -> tuple[ModalBody, LineStatics]:
    held, rows, slopes, pull, statics = _whole(_Content.of(body, ABOUT_MODES))
    omega, ends, shapes = _settled_modes(body, held, rows, slopes)
    gravity = unit(body.gravity_direction)
    line = LineShapes(body.line.places, np.ascontiguousarray(ends))
    names, loads = _point_loads(body, held)
    parts = shapes, rows, slopes, pull, loads
    sections, stresses = _sections(body, held, statics, parts)
    read = [(name, _node_load(body, held, spot.node, spot.direction)) for name, spot in spots]
    pushes = _Pushes(body, spots, statics, sections)
    sides = {
        direction: _side(direction, line, own @ (moves.T @ shapes), pushes)
        for direction, (moves, own) in side_rows(body, held).items()
    }
    found = ModalBody(
        length=body.length,
        mass=float(unit(body.direction) @ held.inertia[:3, :3] @ unit(body.direction)),
        omega=omega,
        participation=shapes.T @ pull,
        wave_number=_wave_number(line, np.abs(shapes).max(axis=0)),
        bending_stiffness=np.nan,
        dampers=(),
        shapes=line,
        statics=statics,
        gravity_share=float(unit(body.direction) @ gravity),
        sections=sections,
        points=_points(names, held, (statics, sections, stresses), parts) if names else None,
        gauges={name: _gauge(held, statics, load, parts, names, _pushed(sides, name)) for name, load in read},
        sides=sides,
        checks=findings(body, held, line),
        doubts=doubts(body, held),
        unknown_weight=unknown_weight(held),
    )
    return found, statics


class _Whole(NamedTuple):
    """A body with all that its finite elements can do: the held model, track_rows, pull of gravity, and statics."""

    held: HeldModel
    rows: Any
    slopes: Array
    pull: Array
    statics: LineStatics


@lru_cache(maxsize=8)
def _whole(content: _Content) -> _Whole:
    body = content.body
    held = held_model(body)
    rows, slopes = track_rows(body, held)
    flexibility, pull = held.flexibility, held.drag @ unit(body.gravity_direction)
    statics = LineStatics(
        places=body.line.places,
        flexibility=slopes @ _symmetric(_between(flexibility, rows, rows)) @ slopes.T,
        weight=slopes @ (rows.T @ flexibility.solve(pull[:, None]))[:, 0],
        rigid=flexibility.rigid.shape[1],
    )
    return _Whole(held, rows, slopes, pull, statics)


@dataclass(frozen=True, eq=False)
class _Pushes:
    """What forces on a track in other directions than its loads' do. Few studies ask for that, so the model is
    factorised for them once more, rather than kept for all."""

    body: Imported
    spots: Spots
    statics: LineStatics
    sections: LineSections

    @cached_property
    def found(self) -> dict[Direction, LinePushes]:
        """By direction."""
        body, held = self.body, _whole(_Content.of(self.body, ABOUT_MODES)).held
        sides, (names, loads) = side_rows(body, held), _point_loads(body, held)
        tracks = {"load": track_rows(body, held), **sides}
        gauges = [_node_load(body, held, spot.node, spot.direction)[:, None] for _, spot in self.spots]
        told = [told_along(body, held).T] if body.recovered else []
        pull = held.drag @ unit(body.gravity_direction)
        parts = [*(rows for rows, _ in tracks.values()), *map(sparse.csc_array, (pull[:, None], loads, *gauges, *told))]
        ends, found = np.cumsum([part.shape[1] for part in parts])[:-1], {}
        for direction, (rows, slopes) in sides.items():
            moved = np.split(_between(held.flexibility, sparse.hstack(parts).tocsc(), rows) @ slopes.T, ends)
            lines = zip(tracks.items(), moved, strict=False)
            weight, points, *others = moved[len(tracks) :]
            found[direction] = LinePushes(
                {way: replace(self.statics, flexibility=own @ part) for (way, (_, own)), part in lines},
                self.sections.under_loads(*others[len(gauges) :]),
                weight[0],
                dict(zip(names, points, strict=True)),
                {name: part[0] for (name, _), part in zip(self.spots, others, strict=False)},
            )
        return found

    def along(self, direction: Direction) -> LinePushes:
        """Of forces in one direction."""
        return self.found[direction]


def _side(direction: Direction, line: LineShapes, ends: Array, pushes: _Pushes) -> LineSide:
    """Motion of the track in another direction than its loads', from values and slopes (2 P, N) of all modes."""
    shapes = replace(line, ends=np.ascontiguousarray(ends))
    wave_number = _wave_number(shapes, np.abs(ends[::2]).max(axis=0))
    return LineSide(direction, wave_number, shapes, partial(pushes.along, direction))


def _settled_modes(body: Imported, held: HeldModel, rows: Any, slopes: Array) -> tuple[Array, Array, Array]:
    """omega (N,), values and slopes at the track's nodes (2 P, N), and shapes (n, N)."""
    omega, shapes = _modes(body, held)
    ends = slopes @ (rows.T @ shapes)
    turn = settled(omega, LineShapes(body.line.places, ends), body.length, shapes)
    return omega, ends @ turn, shapes @ turn


def motion_of_nodes(body: Imported) -> tuple[HeldModel, Array]:
    """The held model, and (M, 3, N) displacements of its nodes in every mode; nodes without rows stay."""
    held, rows, slopes, _, _ = _whole(_Content.of(body, ABOUT_MODES))
    _, _, shapes = _settled_modes(body, held, rows, slopes)
    owner, way = held.file.owner[held.free], held.file.direction[held.free]
    moves = (owner >= 0) & (way < 3)
    found = np.zeros((len(held.file.nodes), 3, shapes.shape[1]))
    found[owner[moves], way[moves]] = shapes[moves]
    return held, found


def _modes(body: Imported, held: HeldModel) -> tuple[Array, Array]:
    """omega (k,) and shapes (n, k) of the lowest modes that move a mass; groups of equal frequencies whole."""
    count = AUTO_MODES if body.modes == "auto" else int(body.modes)
    rigid, moving = held.flexibility.rigid.shape[1], _rank(held.mass)
    omega, shapes = held.flexibility.modes(min(count, moving))
    if not len(omega) or not np.isfinite(omega).all():
        raise ArithmeticError("modes that are not finite")
    if body.rigid_body_modes == "drop":
        omega, shapes = omega[rigid:], shapes[:, rigid:]
    if not len(omega):
        raise BadInput("no mode is left", where="modes", expected=f"more than {rigid}, the rigid-body modes")
    return omega, shapes


def _rank(mass: Any) -> int:
    """How many modes there are: the rank of a small mass matrix; of a large one, rows with a mass."""
    diagonal = mass.diagonal()
    rows = np.flatnonzero(diagonal > 0.0)
    if len(rows) > 10 * _COLUMNS:
        return len(rows)
    scale = 1.0 / np.sqrt(diagonal[rows])
    values = np.linalg.eigvalsh(mass[rows][:, rows].toarray() * np.outer(scale, scale))
    return int(np.count_nonzero(values > 1e-10 * values.max(initial=0.0)))


def _between(flexibility: Flexibility, rows: Any, loads: Any) -> Array:
    """(m, k) rows^T G loads."""
    found = np.zeros((rows.shape[1], loads.shape[1]))
    for first in range(0, loads.shape[1], _COLUMNS):
        part = slice(first, first + _COLUMNS)
        found[:, part] = rows.T @ flexibility.solve(loads[:, part].toarray())
    return found


def _symmetric(values: Array) -> Array:
    """Without what rounding left of a difference."""
    return 0.5 * (values + values.T)


def _wave_number(along: LineShapes, size: Array) -> Array:
    """(N,) 1/m: root of curvature over deflection, each by its mean square; 0 where a mode does not move the track.

    size (N,): each mode's largest displacement anywhere.
    """
    stations = np.linspace(0.0, along.places[-1], min(MOST_SAMPLES, 16 * len(along.places) + 1))
    deflection, bent = (np.sqrt(np.mean(along.derivatives(stations, (order,))[0] ** 2, axis=0)) for order in (0, 2))
    felt = deflection > _UNFELT * size
    most = np.pi / np.diff(along.places).min()
    return np.asarray(np.minimum(np.sqrt(np.divide(bent, deflection, out=np.zeros_like(bent), where=felt)), most))


def _point_loads(body: Imported, held: HeldModel) -> tuple[dict[str, int], Array]:
    """Names of points with their numbers, and unit forces (n, Q) there. Raises BadInput for one that cannot move."""
    columns = np.zeros((len(held.free), len(body.point)))
    for number, (name, point) in enumerate(body.point.items()):
        columns[:, number] = _node_load(body, held, point.node, point.direction)
        if not columns[:, number].any():
            what = f"node {point.node} cannot move in this direction"
            raise BadInput(what, where=f"point.{name}", expected="a free node")
    return {name: number for number, name in enumerate(_point_names(body))}, columns


def _point_names(body: Imported) -> list[str]:
    """Of its points, as models know them."""
    return [f"point.{name}" for name in body.point]


def _node_load(body: Imported, held: HeldModel, node: Any, direction: Any) -> Array:
    """(n,) a unit force at a node, along gravity unless given."""
    way = unit(body.gravity_direction if direction is None else direction)
    return np.asarray(node_rows(held, np.flatnonzero(held.file.nodes == node), way, 0).toarray()[:, 0])


def _gauge(
    held: HeldModel, statics: LineStatics, load: Array, parts: _Parts, names: dict[str, int], pushed: _Pushed
) -> Gauge:
    """A node that a sensor reads, from its unit force (n,); pushed: as of gauges."""
    shapes, rows, slopes, pull, loads = parts
    moved = held.flexibility.solve(load[:, None])[:, 0]
    response = slopes @ (rows.T @ moved)
    return Gauge(
        row=load @ shapes,
        along=partial(statics.under_response, response, derivative=0),
        points={name: float(loads[:, number] @ moved) for name, number in names.items()},
        rigid=statics.rigid,
        weight=float(moved @ pull),
        pushed=pushed,
    )


def _pushed(sides: dict[Direction, LineSide], name: str) -> _Pushed:
    return {direction: partial(side.of_gauge, name) for direction, side in sides.items()}


def _points(
    names: dict[str, int], held: HeldModel, track: tuple[LineStatics, Sections, Array], parts: _Parts
) -> Points:
    shapes, rows, slopes, pull, loads = parts
    statics, sections, stresses = track
    moved = held.flexibility.solve(loads)
    return Points(
        numbers=names,
        shapes=loads.T @ shapes,
        flexibility=loads.T @ moved,
        response=slopes @ (rows.T @ moved),
        section_response=stresses,
        weight=moved.T @ pull,
        rigid=statics.rigid,
        statics=statics,
        sections=sections,
    )


def _sections(body: Imported, held: HeldModel, statics: LineStatics, parts: _Parts) -> tuple[LineSections, Array]:
    """Stress and strain along the track where the body has a recovery matrix: means of rows at the track's nodes, those
    of one quantity after the other's (K P,); and (K P, Q) there per unit force at points."""
    shapes, rows, slopes, pull, loads = parts
    if not body.recovered:
        return NoSections(), np.zeros((0, loads.shape[1]))
    told = told_along(body, held)
    moved = held.flexibility.solve(np.ascontiguousarray(told.T))
    sections = LineRecovered(
        statics=statics,
        quantities=tuple(body.recovered),
        values=told @ shapes,
        response=(rows.T @ moved).T @ slopes.T,
        weight=moved.T @ pull,
    )
    return sections, moved.T @ loads


def told_along(body: Imported, held: HeldModel) -> Array:
    """(K P, n) what its recovery matrix tells at the track's nodes, one quantity after the other."""
    units = {"stress": 1.0, "strain": held.pressure}
    means = [
        held.recovery[np.array(one) - 1].mean(axis=0) / units[quantity]
        for quantity, nodes in body.recovered.items()
        for one in nodes
    ]
    return np.array(means)
