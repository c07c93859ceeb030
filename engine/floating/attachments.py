"""Places of bodies at which loads act and springs hold, and tips that the rigid arm would have elsewhere, as the tables
that kernels take."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.kernels.floating import layout as columns
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.floating.bodies.elastic import ElasticBody
    from engine.floating.model import FloatingModel
    from engine.scene.loads import SpringEnd
    from engine.scene.study import Study

FORCES, TORQUES = 40, 12  # places by Gauss of what is evenly along a part of a track


@dataclass(frozen=True, eq=False)
class Grip:
    """Places x (S,) m of a body's track, on which what acts is shared out by weights (S,); the ground has one place,
    position (3,) m. body: its number, -1 for the ground."""

    body: int
    x: Array
    weights: Array
    position: Array


class GripTables(NamedTuple):
    """gripped (P): bodies; grips (P, GRIP), modes (P n, GRIP_MODE), shorter (P, A, n, n)."""

    gripped: Counts
    grips: Array
    modes: Array
    shorter: Array


class TipTables(NamedTuple):
    """tips (T, 2): sensors and bodies; places (T, 6 + 3 n); shorter (T, A, n, n); carrying (L): the bodies of these
    arms."""

    tips: Counts
    places: Array
    shorter: Array
    carrying: Counts


class LoadAt(NamedTuple):
    """What of a load acts at one grip. course: the dotted key of its factor in time, or ""; force, torque: dotted keys
    of three numbers each, or none where it has none."""

    grip: Grip
    in_body: bool
    course: str
    force: tuple[str, ...]
    torque: tuple[str, ...]


def at_place(body: int, x: float) -> Grip:
    """One place of a body."""
    return Grip(body, np.array([x]), np.ones(1), np.zeros(3))


def loads_of(study: Study, bodies: dict[str, ElasticBody]) -> Iterator[LoadAt]:
    """The loads of a study, in order: what is along a part as one grip for the force, and one for every place by Gauss
    for the torque, as rotations of places do not add up."""
    for name, load in study.load.items():
        body = list(bodies).index(load.on)
        course = f"load.{name}.course" if load.course is not None else ""
        force, torque = (
            tuple(f"load.{name}.{key}.{axis}" for axis in range(3)) if getattr(load, key) is not None else ()
            for key in load.keys
        )
        in_body = load.axes == "body"
        if load.between is None:
            at = bodies[load.on].length if load.at is None else load.at
            yield LoadAt(at_place(body, at), in_body, course, force, torque)
            continue
        if force:
            yield LoadAt(Grip(body, *_gauss(*load.between, FORCES), np.zeros(3)), in_body, course, force, ())
        if torque:
            for x, weight in zip(*_gauss(*load.between, TORQUES), strict=True):
                grip = Grip(body, np.array([x]), np.array([weight]), np.zeros(3))
                yield LoadAt(grip, in_body, course, (), torque)


def _gauss(start: float, end: float, count: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (end - start)
    return start + half * (nodes + 1.0), half * weights


def springs_of(study: Study, bodies: dict[str, ElasticBody]) -> Iterator[tuple[Grip, Grip]]:
    """The two grips of every spring."""

    def grip(end: SpringEnd) -> Grip:
        if end.position is not None:
            return Grip(-1, np.zeros(1), np.ones(1), np.array(end.position))
        return at_place(list(bodies).index(end.on), bodies[end.on].length if end.at is None else end.at)

    return ((grip(spring.ends[0]), grip(spring.ends[1])) for spring in study.spring.values())


def grip_tables(bodies: Sequence[ElasticBody], grips: Sequence[Grip], n: int, axes: int) -> GripTables:
    """The tables of `engine.kernels.floating.layout.System` of some grips; axes: along which places come nearer."""
    table, modes = np.zeros((len(grips), columns.GRIPS)), np.zeros((len(grips), n, columns.GRIP_MODE))
    pairs = np.zeros((len(grips), axes, n, n))
    for p, grip in enumerate(grips):
        table[p, columns.WEIGHT] = grip.weights.sum()
        table[p, columns.ARM : columns.ARM + 3] = grip.position
        if grip.body < 0:
            continue
        table[p, columns.ARM] = grip.weights @ grip.x
        body = bodies[grip.body]
        if N := body.omega.size:
            fields = np.einsum("s,sai->ia", grip.weights, body.fields(grip.x, (0,))[0])
            modes[p, :N, columns.PUSHED : columns.PUSHED + 3] = fields[:, :3]
            # rotations belong to one place, whatever its weight
            modes[p, :N, columns.TWISTED : columns.TWISTED + 3] = fields[:, 3:] / grip.weights.sum()
            pairs[p, : body.shortened, :N, :N] = np.einsum("s,saij->aij", grip.weights, shorter_at(body, grip.x))
    gripped = np.array([grip.body for grip in grips], dtype=np.int64)
    return GripTables(gripped, table, modes.reshape(-1, columns.GRIP_MODE), pairs)


def tip_tables(model: FloatingModel, n: int, axes: int) -> TipTables:
    """The tables of `engine.kernels.floating.layout.System` of places whose distance from the rigid arm is read; axes:
    along which places come nearer."""
    names, sensors = list(model.bodies), list(model.study.sensor)
    places = np.zeros((len(model.tips), columns.TIP_SHAPES + 3 * n))
    shorter = np.zeros((len(model.tips), axes, n, n))
    tips, carrying = [], set[str]()
    for row, own, (name, sensor) in zip(places, shorter, model.tips.items(), strict=True):
        on, x = str(sensor.body), float(sensor.at or 0.0)
        body = model.bodies[on]
        row[columns.TIP_PLACE] = x
        row[columns.TIP_WAY : columns.TIP_SHAPES] = sensor.way
        if N := body.omega.size:
            fields = body.fields(np.array([x]), (0,))[0, 0, :3]
            row[columns.TIP_SHAPES : columns.TIP_SHAPES + 3 * N] = fields.T.reshape(-1)
            own[: body.shortened, :N, :N] = shorter_at(body, np.array([x]))[0]
        tips.append((sensors.index(name), names.index(on)))
        carrying.update(model.carriers(on))
    rows = np.array(tips, dtype=np.int64).reshape(-1, 2)
    return TipTables(rows, places, shorter, np.array(sorted(map(names.index, carrying)), dtype=np.int64))


def shorter_at(body: ElasticBody, x: Array) -> Array:
    """(S, A, N, N): G at ascending places along as many axes as marches have it."""
    N = body.omega.size
    if body.shortening is None or not body.stiffens:
        return np.zeros((x.size, 0, N, N))
    return np.asarray(body.shortening.along(x)[0])
