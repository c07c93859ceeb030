"""What is found of an imported model, for people to check: matrices, rigid motions, mass, track and slopes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.frame.geometry import unit
from engine.bodies.imported.line import SPLINE_NODES, LineShapes, by_rotations, node_rows, spline_slopes
from engine.bodies.imported.model import HeldModel
from results_schema.lazy_imports import sparse

if TYPE_CHECKING:
    from engine.bodies.imported.imported import Imported
    from results_schema.arrays import Array


FITS = 1e-6  # of the stiffness: less resists rigid motions by rounding
DOUBTFUL = 1e-3  # of the stiffness: matrices of six, four and three digits leave 1e-7, 1e-4 and 4e-3
SAME_MASS = 1e-6  # relative difference of the mass in three directions that is still one mass
UNLIKE = 1.5  # times the mass in another direction: what moves at held nodes is not counted, and is less
#: kg for every metre of track: a fishing rod has 0.05, the heaviest bridges have 1e5.
LEAST_PER_METRE, MOST_PER_METRE = 1e-2, 3e5
#: Of the forces that meet at a node, which a rigid motion leaves there, and of nodes: springs to the ground stand at a
#: few of these. Of a gantry's 25 nodes all answered in reverse order, 14 with y and z exchanged.
ANSWERS, MOST_ANSWER = 0.05, 0.5
#: Relative difference of the mass in three directions beyond which a reduced model hides springs: matrices of three
#: digits leave 4e-3, springs inside a gantry 0.1.
ONE_WEIGHT = 1e-2
#: rad/s that some row has by itself, as elements are small: 2.4e3 to 2.6e5 in eight models of 4 elements to 6,000
#: rows, 1.4e-3 in a girder of 20 whose stiffness and mass stand in each other's place.
SLOWEST_MESH = 1.0
SHEAR = 0.02  # relative difference of rotations and slopes beyond which the spline is worth a thought


def findings(body: Imported, held: HeldModel, along: LineShapes) -> tuple[tuple[str, str], ...]:
    """Pairs of what was looked at and what was found."""
    file, resisted = held.file, _resisted(held)
    modal = int(np.count_nonzero(file.owner < 0))
    rows = f"{len(held.free)} free of {file.size}" + (f", {modal} of them modal coordinates" if modal else "")
    massless, rigid = int(np.count_nonzero(held.mass.diagonal() == 0.0)), held.flexibility.rigid.shape[1]
    return (
        ("nodes, degrees of freedom", f"{len(file.nodes)}, {rows}"),
        ("matrices", "symmetric; stiffness positive where held, mass not negative"),
        (
            "massless degrees of freedom",
            f"{massless} of {len(held.free)}: they follow statically" if massless else "none",
        ),
        ("rigid-body modes", f"{rigid}" if rigid else "none: the supports hold the body"),
        ("rigid motions by the coordinates", _grounding(resisted)),
        ("mass by rigid motions", _mass(held, resisted)),
        ("centre of mass", _centre(body, held)),
        ("track", _track(body, held)),
        ("slope between nodes", _slopes(body, held, along)),
    )


def doubts(body: Imported, held: HeldModel) -> tuple[str, ...]:
    """What is likely a mistake: a stiffness that moves otherwise than its nodes; a mass that is another in other
    directions, or that no structure of this length has."""
    if (fastest := _fastest_row(held)) < SLOWEST_MESH:
        return (
            f"no row of its matrices swings faster than {fastest / (2.0 * np.pi):.2g} Hz by itself: are stiffness and "
            "mass exchanged, or in other units?",
        )
    found, resisted = list[str](), _resisted(held)
    if resisted is not None and resisted >= DOUBTFUL and body.supports:
        found.append(
            f"{resisted:.2g} of its stiffness resists rigid motions by the coordinates of its nodes: unless its "
            "matrices hold it besides its supports, nodes are in another unit (length_unit), or freedoms are exchanged"
        )
    elif resisted is not None and not body.supports and (answering := _answering(held)) > MOST_ANSWER:
        found.append(
            f"{100.0 * answering:.0f} % of its nodes resist rigid motions by their coordinates: unless springs "
            "hold so many to the ground, nodes stand in another order, are in another unit (length_unit), or have "
            "their axes or freedoms exchanged"
        )
    moved, ways = _masses(held)
    if moved.size and moved.max() > UNLIKE * moved.min():
        found.append(
            f"its mass is {', '.join(f'{mass:.4g}' for mass in moved)} kg along {ways}: are rows of its matrices in "
            "another order, or freedoms exchanged?"
        )
    elif moved.size and not LEAST_PER_METRE <= moved.max() / body.length <= MOST_PER_METRE:
        found.append(
            f"it has {moved.max():.4g} kg on {body.length:.4g} m of track: are its files in other units (length_unit "
            "and the like)?"
        )
    return tuple(found)


def _fastest_row(held: HeldModel) -> float:
    """The largest natural frequency of a free row that all others hold still, rad/s."""
    mass = held.mass.diagonal()
    own = mass > 0.0
    return float(np.sqrt(np.max(held.stiffness.diagonal()[own] / mass[own], initial=0.0)))


def unknown_weight(held: HeldModel) -> str:
    """Why nobody knows what a reduced model weighs, "" where its rigid motions tell: what stands on springs inside
    moves otherwise than its nodes."""
    file, (moved, ways) = held.file, _masses(held)
    nodes = [np.unique(file.owner[(file.owner >= 0) & (file.direction == way)]) for way in range(3)]
    alike = moved.size and len({part.tobytes() for part in nodes if part.size}) == 1  # else some motions miss nodes
    if file.owner.min() >= 0 or not alike or np.ptp(moved) <= ONE_WEIGHT * moved.max():
        return ""
    masses = ", ".join(f"{mass:.6g}" for mass in moved)
    return f"by the rigid motions of its nodes its mass is {masses} kg along {ways}: inside, it stands on springs"


def _masses(held: HeldModel) -> tuple[Array, str]:
    """The mass in each direction in which nodes move, kg, and these directions."""
    masses = np.diag(held.inertia)[:3]
    return masses[masses > 0.0], ", ".join(np.array(["x", "y", "z"])[masses > 0.0])


def _answering(held: HeldModel) -> float:
    """The part of the nodes at which the unsupported model answers a rigid motion."""
    file, nodes = held.file, np.flatnonzero(held.file.owner >= 0)
    meeting = abs(held.all_stiffness) @ abs(held.motion)
    left = np.divide(abs(held.all_stiffness @ held.motion), meeting, out=np.zeros_like(meeting), where=meeting > 0.0)
    return float(np.unique(file.owner[nodes[left[nodes].max(axis=1) > ANSWERS]]).size / len(file.nodes))


def _grounding(resisted: float | None) -> str:
    """Whether the coordinates fit the matrices, in words."""
    if resisted is None:
        return "not judged: the file holds nodes"
    more = " (0 for a model that nothing holds)" if resisted > FITS else ""
    return f"{resisted:.2g} of the stiffness resists them{more}"


def _resisted(held: HeldModel) -> float | None:
    """Forces that the unsupported model answers to unit motions, of the largest possible: 0 where all fits; None where
    the file holds nodes."""
    file = held.file
    if file.held.any() or not (file.owner >= 0).any():
        return None
    diagonal = np.sqrt(np.maximum(held.all_stiffness.diagonal(), 0.0))
    size = np.linalg.norm(diagonal[:, None] * held.motion, axis=0)
    inverse = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
    scaled = sparse.diags_array(inverse) @ held.all_stiffness @ held.motion
    share = np.linalg.norm(scaled, axis=0) / np.where(size > 0.0, size, 1.0)
    return float(share.max())


def _mass(held: HeldModel, resisted: float | None) -> str:
    """What unit motions of all nodes move: the same in every direction in which nodes move, of a model that fits."""
    moved, ways = _masses(held)
    if not moved.size:
        return "none"
    if np.ptp(moved) > SAME_MASS * moved.max():
        words = f"{', '.join(f'{mass:.6g}' for mass in moved)} kg along {ways}: not the same"
    else:
        words = f"{moved[0]:.6g} kg {'in all directions' if moved.size == 3 else f'along {ways}'}"
    partly = resisted is not None and resisted > FITS
    return f"{words}; what moves at held or left out nodes is not counted" if partly else words


def _centre(body: Imported, held: HeldModel) -> str:
    """From the static moments of the mass matrix, in the directions in which nodes move; it lies among the nodes of a
    model that fits its coordinates."""
    mass = np.diag(held.inertia)[:3]
    if mass.max() <= 0.0:
        return "no mass"
    places = held.file.places * body.length_unit
    low, high = places.min(axis=0), places.max(axis=0)
    room, centre = 1e-6 * float(np.ptp(places, axis=0).max()), np.full(3, np.nan)
    for axis, turns in enumerate(((1, 5, 2, 4), (2, 3, 0, 5), (0, 4, 1, 3))):
        one, its, other, others = turns  # a unit turn moves a point at r by its axis x r
        size = mass[one] ** 2 + mass[other] ** 2
        if size > 0.0:
            moment = mass[one] * held.inertia[one, its] - mass[other] * held.inertia[other, others]
            centre[axis] = moment / size
    known = np.isfinite(centre)
    inside = bool(((centre >= low - room) & (centre <= high + room))[known].all())
    rounded = np.where(np.abs(centre) < room, 0.0, centre)
    words = ", ".join(f"{part:.5g}" if np.isfinite(part) else "unknown" for part in rounded)
    return f"({words}) m, {'among' if inside else 'outside'} the nodes"


def _track(body: Imported, held: HeldModel) -> str:
    nodes, numbers = body.line.nodes, held.file.nodes
    moving = node_rows(held, nodes, unit(body.direction), 0)
    still = int(np.count_nonzero(abs(moving).sum(axis=0) == 0.0))
    more = f", {still} of them held along the load" if still else ""
    return f"{len(nodes)} nodes from {numbers[nodes[0]]} to {numbers[nodes[-1]]}{more}"


def _slopes(body: Imported, held: HeldModel, along: LineShapes) -> str:
    """How slopes are found; by rotations, how far these differ from the slopes of the displacements (shear)."""
    if not by_rotations(body, held):
        return "by a smooth curve through the displacements"
    words = "by the nodes' rotations"
    if len(along.places) < SPLINE_NODES:
        return words
    values, slopes = along.ends[::2], along.ends[1::2]
    size = np.sqrt(np.mean(slopes**2, axis=0))
    gap = np.sqrt(np.mean((slopes - spline_slopes(along.places) @ values) ** 2, axis=0))
    felt = np.flatnonzero(size > 1e-6 * size.max(initial=0.0))
    bending = felt[felt >= held.flexibility.rigid.shape[1]][:1]
    if not len(bending):
        return words
    share = float(gap[bending[0]] / size[bending[0]])
    more = '; interpolation = "spline" may suit better' if share > SHEAR else ""
    return f"{words}, which differ by {100.0 * share:.2g} % from the slope of the displacements in the first mode{more}"
