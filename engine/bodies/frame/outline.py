"""What a frame looks like: its members as curves of their elements, its nodes, supports, springs and masses."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.frame.assembly import Mesh
from engine.bodies.frame.body import motion_of_points
from engine.bodies.frame.geometry import member_ends, unit
from engine.bodies.modal.outline import Elastic, Held, Line, Lump, Outline
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.bodies.frame.frame import Frame

POINTS, MOST_POINTS = 16, 1600  # of a member and of all, about


def frame_outline(frame: Frame) -> Outline:
    """The frame in its own coordinates."""
    assembly, motion = motion_of_points(frame)
    mesh = assembly.mesh
    nodes = {name: np.array(frame.place(name)) for name in frame.node}
    first, backward = frame.line.members[0]
    start = member_ends(frame, first)[-1 if backward else 0] + np.array(frame.track.offset)
    free = len(assembly.free)
    return Outline(
        track=np.array([start, start + frame.line.length * frame.line.tangent]),
        lines=tuple(_curve(mesh, motion, chain) for chain in mesh.chains.values()),
        down=unit(frame.gravity),
        nodes=nodes,
        held=tuple(Held(name, nodes[name], tuple(frame.holds(name)), _outward(frame, name)) for name in frame.supports),
        springs=tuple(_springs(frame, nodes)),
        masses=tuple(
            Lump(name, nodes[body.node] + np.array(body.offset), body.mass) for name, body in frame.point_mass.items()
        ),
        counts={
            "nodes": len(nodes),
            "members": len(frame.member),
            "elements": len(mesh.pairs),
            "degrees of freedom": free,
        },
    )


def _springs(frame: Frame, nodes: dict[str, Array]) -> Iterator[Elastic]:
    for name, spring in frame.spring.items():
        damped = any((*spring.damping, *spring.rotational_damping))
        to = None if spring.to is None else nodes[spring.to]
        yield Elastic(name, nodes[spring.node], spring.stiffness, spring.rotational, damped, to)


def _outward(frame: Frame, node: str) -> Array:
    """(3,) away from the members that end at a node, or down where they pass it."""
    found = np.zeros(3)
    for name, member in frame.member.items():
        if node in member.nodes:
            along = unit(np.diff(member_ends(frame, name), axis=0)[0])
            found += along if member.nodes[1] == node else -along
    return unit(found) if np.linalg.norm(found) > 0.5 else unit(frame.gravity)


def _curve(mesh: Mesh, motion: Array, chain: Counts) -> Line:
    """A member by the cubics of its elements between displacements and rotations of their ends; motion (P, 6, N)."""
    wanted = max(1, min(POINTS, MOST_POINTS // len(mesh.chains)))
    pairs, arms, axis = mesh.pairs[chain], mesh.arms[chain], mesh.axes[chain, 0]
    length = mesh.beams.length[chain][:, None, None]
    ends, turns = mesh.points[pairs] + arms, motion[pairs, 3:]
    moved = motion[pairs, :3] + np.cross(turns, arms[..., None], axis=2)
    stretch = np.einsum("en,ei->ein", np.einsum("eik,ei->ek", moved[:, 1] - moved[:, 0], axis), axis)
    slopes = length[..., None] * np.cross(turns, axis[:, None, :, None], axis=2) + stretch[:, None]
    count = max(1, wanted // len(chain))
    t = np.linspace(0.0, 1.0, count, endpoint=False)[:, None, None]
    points = ends[:, None, 0] * (1.0 - t[:, :, 0]) + ends[:, None, 1] * t[:, :, 0]
    shapes = (
        (1.0 - 3.0 * t**2 + 2.0 * t**3) * moved[:, None, 0]
        + (3.0 * t**2 - 2.0 * t**3) * moved[:, None, 1]
        + (t - 2.0 * t**2 + t**3) * slopes[:, None, 0]
        + (t**3 - t**2) * slopes[:, None, 1]
    )
    every = slice(None, None, max(1, len(chain) // wanted))
    return Line(
        np.concatenate([points.reshape(-1, 3)[every], ends[-1:, 1]]),
        np.concatenate([shapes.reshape(-1, 3, motion.shape[2])[every], moved[-1:, 1]]),
    )
