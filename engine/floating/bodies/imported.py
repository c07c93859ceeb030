"""Bodies out of finite-element files in floating frames: solid models, whose mass is the same along x, y and z."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from engine.bodies.imported.body import motion_of_nodes, told_along
from engine.bodies.imported.imported import Imported
from engine.bodies.imported.line import LineRecovered, LineShapes, spline_slopes
from engine.bodies.imported.model import HeldModel
from engine.floating.bodies.elastic import ElasticBody, floating_axes, refuse_beam_words, refuse_unheld
from engine.floating.bodies.fields import ABOUT_Y, ABOUT_Z, AXES, Y, Z
from engine.floating.bodies.static_shapes import Motions
from engine.scene.frames import Frame
from results_schema.arrays import Array
from results_schema.errors import BadInput

HIGHEST = 3  # derivative of a cubic between two nodes
ALIKE = 1e-9  # of the largest mass: a difference that is rounding
FLAT = 1e-12  # of the largest eigenvalue: fields that depend on each other


@dataclass(frozen=True, eq=False)
class NodeLine:
    """Displacements along x, y, z between the nodes of a track; its rotations are its slopes, without any about x."""

    components: tuple[LineShapes, ...]

    def fields(self, x: Array, orders: Sequence[int]) -> Array:
        """As of `engine.floating.bodies.elastic.Along`."""
        found = np.zeros((len(orders), x.size, AXES, self.components[0].ends.shape[1]))
        rows = [component.derivatives(x, range(HIGHEST + 1)) for component in self.components]
        for number, order in enumerate(orders):
            for axis, of_axis in enumerate(rows):
                found[number, :, axis] = of_axis[order]
            if order < HIGHEST:
                found[number, :, ABOUT_Y], found[number, :, ABOUT_Z] = -rows[Z][order + 1], rows[Y][order + 1]
        return found


def elastic_imported(body: Imported, frame: Frame, modes: int | None, where: str, hung: Sequence[float]) -> ElasticBody:
    """A solid model in its floating frame, which begins with its track; modes: where that is open; hung: places of its
    track (m) at which torques act. Raises BadInput."""
    refuse_beam_words(frame, where, "stiffening")
    asked = body if body.modes != "auto" or modes is None else body.with_modes(modes)
    own = asked.model_copy(update={"rigid_body_modes": "drop"})
    held, motion = motion_of_nodes(own)
    refuse_unheld(held.flexibility.rigid.shape[1], frame, where)
    mass, line, modal = nodal_mass(held, where), own.line, own.build()
    axes = floating_axes(np.asarray(line.tangent), np.asarray(own.direction))
    track = np.asarray(line.nodes)
    start = held.file.places[track[0]] * own.length_unit
    places = (held.file.places * own.length_unit - start) @ axes.T
    rows = held.file.owner[held.free], held.file.direction[held.free]
    omega = np.asarray(modal.omega)
    found = Motions(omega, motion[rows], omega**2 * motion[rows])
    if hung:
        loads = np.zeros((len(motion), 3, AXES * len(hung)))
        each = np.einsum("ab,tbn->tan", axes, np.eye(3 * len(track)).reshape(len(track), 3, -1))
        acting = _line(line.places, each).fields(np.array(hung), (0,))[0]
        loads[track] = np.moveaxis(acting.reshape(-1, len(track), 3), 0, 2)
        found = found.with_statics(held.flexibility, loads[rows])
        motion = np.zeros((len(motion), 3, found.omega.size))
        motion[rows] = found.shapes
        if own.recovered:
            told = told_along(own, held) @ found.shapes
            modal = replace(modal, sections=replace(cast(LineRecovered, modal.sections), values=told))
    shapes = np.einsum("ab,pbn->pan", axes, motion)
    weights, points, moved = particles(mass, places, shapes)
    return ElasticBody(
        length=own.length,
        mass=float(weights.sum()),
        omega=found.omega,
        places=points,
        weights=weights,
        shapes=moved,
        own_inertia=np.zeros(3),
        along=_line(line.places, shapes[track]),
        modal=modal,
        slender=False,
        rolls=False,
    )


def nodal_mass(held: HeldModel, where: str) -> Any:
    """(P, P) mass between nodes, the same along x, y and z. Raises BadInput for a model of other elements."""
    file, P = held.file, len(held.file.nodes)
    what = "only solid models, with x, y and z at each node and the same mass along them, move in frames here"
    rows = np.full((P, 3), -1)
    moves = (file.owner >= 0) & (file.direction < 3)
    rows[file.owner[moves], file.direction[moves]] = np.flatnonzero(moves)
    if not moves.all() or (rows < 0).any():
        raise BadInput(what, where=f"{where}.kind", expected="a model without rotations and modal coordinates")
    blocks = [[held.all_mass[rows[:, one]][:, rows[:, other]] for other in range(3)] for one in range(3)]
    most = abs(blocks[0][0]).max()
    for one in range(3):
        for other in range(3):
            gap = blocks[one][other] - blocks[0][0] if one == other else blocks[one][other]
            if gap.nnz and abs(gap).max() > ALIKE * most:
                raise BadInput(what, where=f"{where}.mass", expected="a mass matrix of solid elements")
    return blocks[0][0]


def particles(mass: Any, places: Array, shapes: Array) -> tuple[Array, Array, Array]:
    """Few particles with the integrals of all products of 1, places (P, 3) and shapes (P, 3, N) under a mass (P, P):
    weights (G,), places (G, 3) and shapes (G, 3, N).

    The products are a matrix F^T M F = L^T L. Any rotation of the rows of L leaves them; one that makes its column of
    the ones constant makes rows of it particles of equal weight.
    """
    N = shapes.shape[2]
    fields = np.concatenate([np.ones((len(places), 1)), places, shapes.reshape(len(places), 3 * N)], axis=1)
    size = np.sqrt(np.maximum(np.einsum("pf,pf->f", fields, mass @ fields), np.finfo(np.float64).tiny))
    values, vectors = np.linalg.eigh((fields / size).T @ (mass @ (fields / size)))
    kept = values > FLAT * values[-1]
    rows = np.sqrt(values[kept])[:, None] * vectors[:, kept].T * size
    ones = np.linalg.norm(rows[:, 0])
    even = np.full(len(rows), ones / np.sqrt(len(rows)))
    across = rows[:, 0] - even
    if np.linalg.norm(across) > 0.0:
        across /= np.linalg.norm(across)
        rows = rows - 2.0 * np.outer(across, across @ rows)
    weights = even**2
    found = rows / even[:, None]
    return weights, found[:, 1:4], found[:, 4:].reshape(len(rows), 3, N)


def _line(places: Array, moved: Array) -> NodeLine:
    """A track whose nodes (T,) at places m move by (T, 3, N)."""
    components = []
    for values in np.moveaxis(moved, 1, 0):
        ends = np.zeros((2 * len(places), values.shape[1]))
        ends[::2], ends[1::2] = values, spline_slopes(places) @ values
        components.append(LineShapes(places, ends))
    return NodeLine(tuple(components))
