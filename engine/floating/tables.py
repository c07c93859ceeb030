"""A model of bodies whose frames move as the tables that kernels take, see `engine.kernels.floating.layout`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.floating.attachments import grip_tables, shorter_at, tip_tables
from engine.floating.bodies.elastic import CELLS
from engine.floating.bodies.fields import Y, Z
from engine.floating.sections import missed_sections
from engine.floating.settling import bands_of
from engine.kernels.floating import layout as columns
from engine.kernels.floating.layout import System
from engine.kernels.floating.observe import OF_CARRIAGE
from engine.scene.frames import GROUND
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.floating.bodies.elastic import ElasticBody
    from engine.floating.model import FloatingModel

OF_DEPTH = 4  # signals of a body
SHEAR = 3  # the derivative of a deflection that jumps where a force acts
ROUNDING = 1e-13  # of a modal mass: modes that share less are orthogonal (beams of 24 modes leave 2e-14)


class Bodies(NamedTuple):
    """tree, bodies, modes, pairs, track and hanging_shorter of a system, see `engine.kernels.floating.layout`."""

    tree: Counts
    numbers: Array
    modes: Array
    pairs: Array
    track: Array
    hanging_shorter: Array


def _bodies(model: FloatingModel, n: int, most: int) -> Bodies:
    """Those of bodies of at most n modes, whose places come nearer along so many axes."""
    names = list(model.bodies)
    B = len(names)
    tree = np.zeros((B, columns.TREE), dtype=np.int64)
    numbers = np.zeros((B, columns.BODY))
    modes, pairs = np.zeros((B, n, columns.MODE)), np.zeros((B, n, n, columns.PAIR))
    track, hanging_shorter = np.zeros((B, CELLS, 6, 6, n)), np.zeros((B, most, n, n))
    joint = 0
    for b, (name, body) in enumerate(model.bodies.items()):
        own = sum(one.body == name for one in model.joints)
        N = body.omega.size
        parent = -1 if model.frame(name).on == GROUND else names.index(model.frame(name).on)
        tree[b] = parent, model.first[name], N, joint, joint + own, int(parent < 0 and own == 0), body.shortened
        joint += own
        _fill_integrals(body, numbers[b], modes[b, :N], pairs[b, :N, :N])
        _hang(model, name, numbers[b], modes[b], hanging_shorter[b])
        if N:
            track[b, ..., :N] = body.track()
    return Bodies(tree, numbers, modes.reshape(B * n, -1), pairs.reshape(B * n * n, -1), track, hanging_shorter)


def system_of(model: FloatingModel) -> System:
    """The tables of a model, see `engine.kernels.floating.layout`."""
    names, B = list(model.bodies), len(model.bodies)
    n = max(1, *(body.omega.size for body in model.bodies.values()))
    most = max(1, *(body.shortened for body in model.bodies.values()))
    tree, numbers, modes, pairs, track, hanging_shorter = _bodies(model, n, most)
    loads, tips = list(enumerate(model.loads)), tip_tables(model, n, most)
    (shortening, foreshortening), (points, point_shorter) = _foreshortening(model), _ends(model, n, most)
    grips = [*(load.grip for load in model.loads), *(grip for link in model.links for grip in link)]
    missed_of, missed, missed_lines, (missed_grips, missed_twists) = missed_sections(model, grips)
    return System(
        tree,
        numbers,
        modes,
        pairs,
        np.array([[j.kind, j.coordinate, j.motion] for j in model.joints], dtype=np.int64).reshape(-1, 3),
        np.array([j.axis for j in model.joints], dtype=np.float64).reshape(-1, 3),
        track,
        np.any(track != 0.0, axis=(1, 2)),
        shortening,
        foreshortening,
        hanging_shorter,
        _riders(model, names),
        *grip_tables(list(model.bodies.values()), grips, n, most),
        np.array(
            [(q, int(load.in_body), model.motions.index(load.course) if load.course else -1) for q, load in loads],
            dtype=np.int64,
        ).reshape(-1, 3),
        len(model.loads) + np.arange(2 * len(model.links)).reshape(-1, 2),
        np.arange(B, dtype=np.int64),
        points,
        point_shorter,
        *_readings(model),
        missed_of,
        missed,
        missed_lines,
        missed_grips,
        missed_twists,
        _smooth(model),
        tips.tips,
        tips.places,
        tips.shorter,
        tips.carrying,
        bands_of(model),
        _drives(model),
        np.array([np.any(body.shapes != 0.0, axis=(0, 2)) for body in model.bodies.values()]).reshape(B, 3),
        np.ascontiguousarray(np.argwhere(np.abs(pairs).reshape(B, n, n, -1).max(axis=3) > ROUNDING)),
        False,
        model.study.initial == "equilibrium",
    )


def _fill_integrals(body: ElasticBody, numbers: Array, modes: Array, pairs: Array) -> None:
    """Shape integrals, (9), by the places of a body's mass."""
    dm, c, phi = body.weights, body.places, body.shapes
    numbers[columns.MASS] = dm.sum()
    numbers[columns.MOMENT : columns.MOMENT + 3] = dm @ c
    second = np.einsum("g,ga,gb->ab", dm, c, c)
    # J = tr P - P is to be larger by the body's own inertia
    second += 0.5 * body.own_inertia.sum() * np.eye(3) - np.diag(body.own_inertia)
    numbers[columns.SECOND : columns.SECOND + 9] = second.reshape(9)
    numbers[columns.LENGTH] = body.length
    modes[:, columns.TRANSLATION : columns.TRANSLATION + 3] = np.einsum("g,gan->na", dm, phi)
    first = np.einsum("g,ga,gbn->nab", dm, c, phi)
    modes[:, columns.FIRST_ORDER : columns.FIRST_ORDER + 9] = first.reshape(-1, 9)
    both = np.einsum("g,gai,gbj->ijab", dm, phi, phi)
    pairs[:, :, columns.SECOND_ORDER : columns.SECOND_ORDER + 9] = both.reshape(*both.shape[:2], 9)
    pairs[:, :, columns.MODAL_MASS] = np.einsum("ijaa->ij", both)
    pairs[:, :, columns.STIFFNESS] = np.diag(body.omega**2)
    if body.shortening is not None and body.shortened:
        whole, moments = body.shortening.integrals
        A = body.shortened
        pairs[:, :, columns.NEARING : columns.NEARING + A] = np.moveaxis(whole, 0, -1)
        turned = moments.reshape(3 * A, *moments.shape[2:])
        pairs[:, :, columns.NEARING_MOMENT : columns.NEARING_MOMENT + 3 * A] = np.moveaxis(turned, 0, -1)


def _foreshortening(model: FloatingModel) -> tuple[Counts, Array]:
    """(K, 4) and (K, cells, 6) of the bodies on which carriages are."""
    ridden = {carriage.on for carriage in model.study.carriage.values()}
    rows, tables = [np.zeros((0, 4), dtype=np.int64)], [np.zeros((0, CELLS, 6))]
    for b, (name, body) in enumerate(model.bodies.items()):
        if name in ridden and body.shortened:
            values = np.moveaxis(body.foreshortening(), (0, 1), (3, 4))
            most = np.abs(values).max(axis=(3, 4))
            felt = np.argwhere(np.triu(most > ROUNDING * most.max()))
            rows.append(np.insert(felt, 0, b, axis=1))
            tables.append(values[tuple(felt.T)])
    return np.concatenate(rows), np.concatenate(tables)


def _hang(model: FloatingModel, name: str, numbers: Array, modes: Array, shorter: Array) -> None:
    """Where a body hangs."""
    from scipy.spatial.transform import Rotation

    frame = model.frame(name)
    numbers[columns.TURNED : columns.TURNED + 9] = Rotation.from_rotvec(frame.turned).as_matrix().reshape(9)
    if frame.on == GROUND:
        numbers[columns.PLACE : columns.PLACE + 3] = frame.position
        return
    parent = model.bodies[frame.on]
    at = parent.length if frame.at is None else frame.at
    numbers[columns.PLACE] = at
    if parent.omega.size:
        fields = parent.fields(np.array([at]), (0,))[0, 0]
        N = parent.omega.size
        modes[:N, columns.HANGING_SHAPE : columns.HANGING_SHAPE + 3] = fields[:3].T
        modes[:N, columns.HANGING_TURN : columns.HANGING_TURN + 3] = fields[3:].T
        shorter[: parent.shortened, :N, :N] = shorter_at(parent, np.array([at]))[0]


def _riders(model: FloatingModel, names: list[str]) -> Counts:
    """One row per carriage."""
    rows = [
        (
            names.index(carriage.on),
            model.places.get(name, -1),
            model.motions.index(f"carriage.{name}.motion") if name not in model.places else -1,
            model.springs.get(name, -1),
        )
        for name, carriage in model.study.carriage.items()
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 4)


def _ends(model: FloatingModel, n: int, axes: int) -> tuple[Array, Array]:
    """The far ends of all tracks, and G there."""
    found, shorter = np.zeros((len(model.bodies), 3 + 3 * n)), np.zeros((len(model.bodies), axes, n, n))
    for b, body in enumerate(model.bodies.values()):
        found[b, 0] = body.length
        if body.omega.size:
            fields = body.fields(np.array([body.length]), (0,))[0, 0, :3]
            N = body.omega.size
            found[b, 3 : 3 + 3 * N] = fields.T.reshape(-1)
            shorter[b, : body.shortened, :N, :N] = shorter_at(body, np.array([body.length]))[0]
    return found, shorter


def _drives(model: FloatingModel) -> Counts:
    """(D, 2) sensors of drives, and their joints."""
    places = [(joint.body, joint.number) for joint in model.joints]
    found = []
    for number, sensor in enumerate(model.study.sensor.values()):
        if sensor.reads.of_drive:
            on = str(sensor.body)
            found.append((number, places.index((on, model.frame(on).driven(sensor.joint)[0]))))
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def _readings(model: FloatingModel) -> tuple[Array, Counts]:
    """Rows of the sensors and of what tells how far bodies bend, and under which carriage they read, in which
    direction, by which rate."""
    carriages = list(model.study.carriage)
    rows, under = np.zeros((len(model.study.sensor), model.size)), []
    for row, sensor in zip(rows, model.study.sensor.values(), strict=True):
        if sensor.under is not None:
            under.append((carriages.index(sensor.under), Z, 0))
            continue
        assert sensor.at is not None
        name = str(sensor.body)
        body, quantity = model.bodies[name], sensor.reads
        under.append((-1, Z, quantity.rate))
        if quantity.of_joint:
            number = model.frame(name).left_to_move(sensor.joint)[0]
            row[next(j.coordinate for j in model.joints if (j.body, j.number) == (name, number))] = 1.0
        elif body.omega.size and not quantity.of_tree:
            first = model.first[name]
            row[first : first + body.omega.size] = body.reading(quantity, sensor.at)
    depths = _depths(model)
    under += [(-1, Z, 0)] * len(depths)
    return np.concatenate([rows, depths]), np.array(under, dtype=np.int64).reshape(-1, 3)


def _smooth(model: FloatingModel) -> Counts:
    """(K, 2) signals that go on as smoothly as coordinates do: what sensors read of these, also after stops, but for
    shear forces, which jump as a carriage passes; and places along tracks of what slides by itself: given motions may
    stop at an instant, over which a parabola would pass; and the tips whose lengths they are, else -1."""
    read, ridden = model.study.sensor.values(), {carriage.on for carriage in model.study.carriage.values()}
    jumps = [sensor.reads.derivative == SHEAR and sensor.body in ridden for sensor in read]
    rough = [sensor.reads.rate or sensor.reads.of_drive or jump for sensor, jump in zip(read, jumps, strict=True)]
    sensors = [n for n, one in enumerate(rough) if not one]
    first = model.signal_of("carriages")
    places = [first + OF_CARRIAGE * c for c, name in enumerate(model.study.carriage) if name in model.places]
    stops = [model.signal_of("stops") + t for t in range(len(model.tips))]
    tips = {name: t for t, (name, sensor) in enumerate(model.tips.items()) if sensor.direction is None}
    names, none = list(model.study.sensor), [-1] * len(places)
    lengths = [*(tips.get(names[n], -1) for n in sensors), *none, *(tips.get(name, -1) for name in model.tips)]
    return np.array([[*sensors, *places, *stops], lengths], dtype=np.int64).T.copy()


def _depths(model: FloatingModel) -> Array:
    """(B OF_DEPTH, N): see `FloatingModel.depths`."""
    rows = np.zeros((len(model.bodies), OF_DEPTH, model.size))
    for (name, body), own in zip(model.bodies.items(), rows, strict=True):
        if body.omega.size:
            fields = body.fields(np.array([0.5, 1.0]) * body.length, (0,))[0, :, Y : Z + 1]
            first = model.first[name]
            own[:, first : first + body.omega.size] = fields.reshape(OF_DEPTH, -1)
    return rows.reshape(-1, model.size)
