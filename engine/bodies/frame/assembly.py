"""From a frame's description to sparse stiffness and mass on the degrees of freedom that are free to move.

Six degrees of freedom per node, in the axes of the nodes' coordinates; members are cut into elements, and a rigid arm
from a node to the end of a member's axis carries its rotations along: u_end = u + theta x arm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.bodies.frame.elements import Beams, consistent_mass, lumped_mass, stiffness
from engine.bodies.frame.geometry import DIRECTIONS, member_axes, member_ends
from engine.bodies.modal.modal_body import Array
from results_schema.lazy_imports import sparse

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame

Counts = NDArray[np.int64]

MASSES = {"consistent": consistent_mass, "lumped": lumped_mass}
ABOUT_MODES = frozenset({"modes", "leave_out", "rigid_body_modes", "interface", "fixed_interface_modes"})
_RANK = 1e-9  # of the largest: below it nothing resists a motion


@dataclass(frozen=True, eq=False)
class Mesh:
    """Elements between points.

    points (P, 3): m, the frame's nodes in their order, then those inside members; pairs (E, 2): points of an element;
    arms (E, 2, 3): from the points to the element's ends; axes (E, 3, 3): local axes as rows; beams: properties;
    chains: the elements of each member, from its first node to its second.
    """

    points: Array
    pairs: Counts
    arms: Array
    axes: Array
    beams: Beams
    chains: dict[str, Counts]

    @property
    def turns(self) -> Array:
        """(E, 12, 12): local displacements of the ends from those of the points."""
        found = np.zeros((len(self.pairs), 12, 12))
        for end in range(2):
            move, turn = slice(6 * end, 6 * end + 3), slice(6 * end + 3, 6 * end + 6)
            found[:, move, move] = found[:, turn, turn] = self.axes
            found[:, move, turn] = -self.axes @ cross_matrix(self.arms[:, end])
        return found

    @property
    def freedoms(self) -> Counts:
        """(E, 12) numbers of the degrees of freedom of every element."""
        return np.asarray((6 * self.pairs[:, :, None] + np.arange(6)).reshape(-1, 12))


@dataclass(frozen=True, eq=False)
class Assembly:
    """A frame as matrices on its free degrees of freedom.

    free (n,): their numbers among all 6 P; stiffness, mass (n, n) sparse; all_stiffness, all_mass (6 P, 6 P) sparse:
    with those that are held; drag (n, 3): inertia forces of a unit
    acceleration of everything along x, y, z, kg; springs (k, 6 P): their elongations; rigid (n, r): motions without
    strain, any basis; total_mass kg.
    """

    mesh: Mesh
    free: Counts
    stiffness: sparse.csc_array
    mass: sparse.csc_array
    all_stiffness: sparse.csr_array
    all_mass: sparse.csr_array
    drag: Array
    springs: Array
    rigid: Array
    total_mass: float

    def whole(self, values: Array) -> Array:
        """(6 P, ...) from (n, ...), zero where nothing moves."""
        found = np.zeros((6 * len(self.mesh.points), *values.shape[1:]))
        found[self.free] = values
        return found


@dataclass(frozen=True)
class Content:
    """A frame by what its matrices and modes depend on, so that the variants of a sweep share them."""

    text: str
    frame: Frame = field(compare=False)

    @classmethod
    def of(cls, frame: Frame, without: Iterable[str] = ()) -> Content:
        """All that matters to a frame without damping and own weight, besides the keys ``without``."""
        dampers = {name: {"damping", "rotational_damping"} for name in frame.spring}
        left_out = dict.fromkeys(("damping_ratio", "own_weight", *without), True)
        return cls(frame.model_dump_json(exclude={**left_out, "spring": dampers}), frame)


def assemble(frame: Frame) -> Assembly:
    """Mesh, stiffness, mass, supports and the motions that nothing resists; the last few are remembered."""
    return _assemble(Content.of(frame, without=ABOUT_MODES))


@lru_cache(maxsize=8)
def _assemble(content: Content) -> Assembly:
    frame = content.frame
    mesh = mesh_of(frame)
    beams = mesh.beams
    nodes = {name: index for index, name in enumerate(frame.node)}
    held = _held(frame, mesh, nodes)
    free = np.flatnonzero(~held)
    rates = np.array([rate for spring in frame.spring.values() for rate in (*spring.stiffness, *spring.rotational)])
    rows = np.concatenate([np.zeros((0, held.size)), *(spring_rows(frame, name, nodes, mesh) for name in frame.spring)])
    rows, rates = rows[rates > 0.0], rates[rates > 0.0]
    stiff = _assembled(mesh, stiffness(beams)) + _outer(rows, rates)
    mass = _assembled(mesh, MASSES[frame.mass_matrix](beams)) + _point_masses(frame, nodes, held.size)
    total = float(np.sum(beams.mass * beams.length)) + sum(body.mass for body in frame.point_mass.values())
    return Assembly(
        mesh=mesh,
        free=free,
        stiffness=stiff[free][:, free].tocsc(),
        mass=mass[free][:, free].tocsc(),
        all_stiffness=stiff.tocsr(),
        all_mass=mass.tocsr(),
        drag=mass[free] @ np.tile(np.eye(6)[:, :3], (len(mesh.points), 1)),
        springs=rows,
        rigid=rigid_motions(mesh, held, rows)[free],
        total_mass=total,
    )


def mesh_of(frame: Frame) -> Mesh:
    """Every member cut into its elements."""
    nodes = {name: index for index, name in enumerate(frame.node)}
    points = [np.array([frame.place(name) for name in nodes])]
    pairs, arms, axes, chains, count = [], [], [], {}, len(nodes)
    first = 0
    for name, member in frame.member.items():
        ends, n = member_ends(frame, name), member.elements
        inner = np.arange(count, count + n - 1)
        points.append(ends[0] + np.linspace(0.0, 1.0, n + 1)[1:-1, None] * (ends[1] - ends[0]))
        line = np.concatenate([[nodes[member.nodes[0]]], inner, [nodes[member.nodes[1]]]])
        pairs.append(np.stack([line[:-1], line[1:]], axis=1))
        reach = np.zeros((n, 2, 3))
        reach[0, 0], reach[-1, 1] = member.offsets
        arms.append(reach)
        axes.append(np.broadcast_to(member_axes(frame, name), (n, 3, 3)))
        chains[name] = np.arange(first, first + n)
        count, first = count + n - 1, first + n
    return Mesh(
        np.concatenate(points), np.concatenate(pairs), np.concatenate(arms), np.concatenate(axes), _beams(frame), chains
    )


def cross_matrix(vectors: ArrayLike) -> Array:
    """(..., 3, 3) matrices with [v] u = v x u."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    zero = np.zeros_like(x)
    rows = [np.stack(row, axis=-1) for row in ([zero, -z, y], [z, zero, -x], [-y, x, zero])]
    return np.stack(rows, axis=-2)


def _beams(frame: Frame) -> Beams:
    """Properties of all elements, member by member."""
    columns = []
    for name, member in frame.member.items():
        section = frame.section[member.section]
        ends = member_ends(frame, name)
        lateral = section.second_moment_lateral or section.second_moment
        shear = section.shear_stiffness or section.youngs_modulus  # of a plane frame, where it does nothing
        thick = member.theory == "timoshenko"
        row = (
            float(np.linalg.norm(ends[1] - ends[0])) / member.elements,
            section.youngs_modulus * section.area,
            shear * (section.torsion_constant or section.second_moment + lateral),
            section.youngs_modulus * lateral,
            section.youngs_modulus * section.second_moment,
            shear * (section.shear_area_lateral or section.area) if thick else np.inf,
            shear * (section.shear_area or section.area) if thick else np.inf,
            section.density * section.area,
            section.density * (section.second_moment + lateral),
            section.density * lateral if thick else 0.0,
            section.density * section.second_moment if thick else 0.0,
        )
        columns.append(np.tile(np.array(row)[:, None], member.elements))
    return Beams(*np.concatenate(columns, axis=1))


def _held(frame: Frame, mesh: Mesh, nodes: dict[str, int]) -> NDArray[np.bool_]:
    held = np.zeros((len(mesh.points), 6), dtype=np.bool_)
    for word in frame.still:
        held[:, DIRECTIONS.index(word)] = True
    for name in frame.node:
        for word in frame.stands(name):
            held[nodes[name], DIRECTIONS.index(word)] = True
    return held.reshape(-1)


def spring_rows(frame: Frame, name: str, nodes: dict[str, int], mesh: Mesh) -> Array:
    """(6, 6 P) elongations of a spring in all directions.

    The other node reaches the spring by a rigid arm, so that a spring between two nodes never holds both of them.
    """
    spring = frame.spring[name]
    rows = np.zeros((6, len(mesh.points), 6))
    here = nodes[spring.node]
    rows[:, here] = np.eye(6)
    if spring.to is not None:
        there = nodes[spring.to]
        rows[:, there] = -np.eye(6)
        rows[:3, there, 3:] = cross_matrix(mesh.points[here] - mesh.points[there])
    return rows.reshape(6, -1)


def _point_masses(frame: Frame, nodes: dict[str, int], size: int) -> Any:
    """Masses with their inertia, moved from their centres to their nodes."""
    found = sparse.coo_array((size, size))
    for body in frame.point_mass.values():
        reach = np.eye(6)
        reach[:3, 3:] = -cross_matrix(body.offset)
        block = reach.T @ np.diag([body.mass] * 3 + list(body.inertia)) @ reach
        at = 6 * nodes[body.node] + np.arange(6)
        row, column = np.meshgrid(at, at, indexing="ij")
        found = found + sparse.coo_array((block.reshape(-1), (row.reshape(-1), column.reshape(-1))), shape=(size, size))
    return found


def _assembled(mesh: Mesh, local: Array) -> Any:
    """(6 P, 6 P) sparse sum of element matrices given in local axes."""
    turns, freedoms = mesh.turns, mesh.freedoms
    blocks = np.swapaxes(turns, 1, 2) @ local @ turns
    blocks = 0.5 * (blocks + np.swapaxes(blocks, 1, 2))
    rows = np.broadcast_to(freedoms[:, :, None], blocks.shape).reshape(-1)
    columns = np.broadcast_to(freedoms[:, None, :], blocks.shape).reshape(-1)
    size = 6 * len(mesh.points)
    return sparse.coo_array((blocks.reshape(-1), (rows, columns)), shape=(size, size)).tocsr()


def _outer(rows: Array, rates: Array) -> Any:
    """Sparse sum of rates times the outer products of rows."""
    wide = sparse.csr_array(rows)
    return (wide.T * rates[None, :]) @ wide if len(rates) else sparse.csr_array((rows.shape[1], rows.shape[1]))


def rigid_motions(mesh: Mesh, held: NDArray[np.bool_], springs: Array) -> Array:
    """(6 P, r) motions without strain: each piece of members moves as a rigid one, held points and springs stay.

    Decided by geometry alone: a spring counts however soft it is.
    """
    pieces = _pieces(mesh)
    count = int(pieces.max()) + 1
    size = float(np.ptp(mesh.points, axis=0).max())
    away = (mesh.points - mesh.points.mean(axis=0)) / size
    each = np.zeros((len(mesh.points), 6, count, 6))
    every = np.arange(len(mesh.points))
    each[every, :3, pieces, :3] = np.eye(3)
    each[every, :3, pieces, 3:] = -cross_matrix(away)
    each[every, 3:, pieces, 3:] = np.eye(3) / size
    motion = each.reshape(held.size, 6 * count)
    scale = np.tile([1.0, 1.0, 1.0, size, size, size], len(mesh.points))
    strained = _normalised(springs / scale) @ (motion * scale[:, None])
    resisted = np.linalg.qr(np.concatenate([motion[held] * scale[held, None], strained]), mode="r")
    _, values, directions = np.linalg.svd(resisted)
    rank = int(np.count_nonzero(values > _RANK * max(1.0, values.max(initial=0.0))))
    return np.asarray(motion @ directions[rank:].T)


def _normalised(rows: Array) -> Array:
    norms = np.linalg.norm(rows, axis=1, keepdims=True)
    return rows / np.where(norms > 0.0, norms, 1.0)


def _pieces(mesh: Mesh) -> Counts:
    """(P,) number of the piece that a point belongs to; members make pieces, springs do not."""
    from scipy.sparse.csgraph import connected_components

    size = len(mesh.points)
    one, other = mesh.pairs.T
    graph = sparse.coo_array((np.ones(len(one)), (one, other)), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
