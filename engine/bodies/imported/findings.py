"""What is found of an imported model, for people to check: matrices, rigid motions, mass, track and slopes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.bodies.frame.geometry import unit
from engine.bodies.imported.line import SPLINE_NODES, LineShapes, by_rotations, node_rows, spline_slopes
from engine.bodies.imported.model import HeldModel
from engine.bodies.modal.modal_body import Array
from results_schema.lazy_imports import sparse

if TYPE_CHECKING:
    from engine.bodies.imported.imported import Imported


SAME_MASS = 1e-6  # relative difference of the mass in three directions that is still one mass
SHEAR = 0.02  # relative difference of rotations and slopes beyond which the spline is worth a thought


def findings(body: Imported, held: HeldModel, along: LineShapes) -> tuple[tuple[str, str], ...]:
    """Pairs of what was looked at and what was found."""
    file = held.file
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
        ("rigid motions by the coordinates", _grounding(held)),
        ("mass by rigid motions", _mass(held)),
        ("centre of mass", _centre(body, held)),
        ("track", _track(body, held)),
        ("slope between nodes", _slopes(body, held, along)),
    )


def _grounding(held: HeldModel) -> str:
    """Forces that the unsupported model answers to unit motions, of the largest possible: 0 where all fits."""
    file = held.file
    if file.held.any() or not (file.owner >= 0).any():
        return "not judged: the file holds nodes"
    diagonal = np.sqrt(np.maximum(file.stiffness.diagonal(), 0.0))
    size = np.linalg.norm(diagonal[:, None] * held.motion, axis=0)
    inverse = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
    scaled = sparse.diags_array(inverse) @ file.stiffness @ held.motion
    share = np.linalg.norm(scaled, axis=0) / np.where(size > 0.0, size, 1.0)
    worst = float(share.max())
    return f"{worst:.2g} of the stiffness resists them" + (
        " (0 for a model that nothing holds)" if worst > 1e-6 else ""
    )


def _mass(held: HeldModel) -> str:
    masses = np.diag(held.inertia)[:3]
    if np.ptp(masses) <= SAME_MASS * masses.max():
        return f"{masses[0]:.6g} kg in all directions"
    return f"{masses[0]:.6g}, {masses[1]:.6g}, {masses[2]:.6g} kg along x, y, z: not the same"


def _centre(body: Imported, held: HeldModel) -> str:
    """From the static moments of the mass matrix; it lies among the nodes of a model that fits its coordinates."""
    inertia = held.inertia
    mass = np.diag(inertia)[:3].mean()
    if mass <= 0.0:
        return "no mass"
    centre: Array = np.array([inertia[1, 5], inertia[2, 3], inertia[0, 4]]) / mass
    places = held.file.places * body.length_unit
    low, high = places.min(axis=0), places.max(axis=0)
    room = 1e-6 * float(np.ptp(places, axis=0).max())
    inside = bool(((centre >= low - room) & (centre <= high + room)).all())
    words = ", ".join(f"{part + 0.0:.5g}" for part in np.where(np.abs(centre) < room, 0.0, centre))
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
