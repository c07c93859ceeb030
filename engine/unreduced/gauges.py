"""What sensors read off the tracks of whole finite-element models: motions of places, and what supports carry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from engine.bodies.frame.assembly import Assembly
from engine.bodies.frame.frame import Frame
from engine.bodies.frame.gauges import FrameSpot, point_loads
from engine.bodies.frame.geometry import unit
from engine.bodies.frame.supports import FrameSupport
from engine.bodies.frame.track import TrackBeams, TrackPoints
from engine.bodies.modal.description import Spot
from engine.unreduced.track import WIDTH, Rows, no_rows, rows_of
from results_schema.arrays import Array
from results_schema.errors import BadInput


class FullGauge(NamedTuple):
    """A place that a sensor reads off the track: rows (1,) on the degrees of freedom of the body; what a unit force at
    places (S,) of the track, and own weight per unit gravity, add between the ends of its element, or press on a
    support at once. rates (2, 12): of a support, on the velocities and accelerations of the same degrees of freedom."""

    rows: Rows
    within: Callable[[Array], Array]
    under_weight: float
    rates: Array | None = None


class FullRead(NamedTuple):
    """A frame that is read, with its track and the points under it."""

    frame: Frame
    assembly: Assembly
    track: TrackBeams
    ends: TrackPoints


def full_gauge(read: FullRead, spot: Spot) -> FullGauge:
    """What a sensor reads."""
    if spot.support:
        return _reaction(read, spot)
    if spot.point is not None:
        numbers, loads = point_loads(read.frame, read.assembly)
        return FullGauge(rows_of(loads[:, numbers[f"point.{spot.point}"]]), np.zeros_like, 0.0)
    place = FrameSpot(read.frame, read.assembly, read.track, spot)
    return FullGauge(rows_of(place.row), place.within, place.under_weight)


def _reaction(read: FullRead, spot: Spot) -> FullGauge:
    """What a support carries: forces of its springs and dampers; of directions that are held, what the elements, the
    inertia and the loads on the node do there. Raises BadInput where too many members meet."""
    frame, assembly = read.frame, read.assembly
    node = spot.node or min(frame.node, key=lambda name: abs(frame.place(name)[0] - spot.at))  # of a uniform beam
    support = FrameSupport(frame, assembly, replace(spot, node=node))
    held = support.held
    on_u, on_v = support.at_springs("stiffness"), support.at_springs("damping")
    parts = np.array([on_u - assembly.all_stiffness @ held, on_v, -(assembly.all_mass @ held)])[:, assembly.free]
    entries = np.flatnonzero(parts.any(axis=0))
    if len(entries) > WIDTH:
        what = f"too many members meet at node {node} for the unreduced model of its support"
        raise BadInput(what, where="node", expected=f"at most {WIDTH} degrees of freedom beside it")
    found = no_rows(3)
    found.freedoms[:, : len(entries)], found.values[:, : len(entries)] = entries, parts[:, entries]
    pull = assembly.all_mass @ np.tile(np.append(unit(frame.gravity), np.zeros(3)), len(assembly.mesh.points))
    return FullGauge(
        rows=Rows(found.freedoms[:1], found.values[:1]),
        within=partial(read.track.where_ends_move, read.ends.of(held[:, None])[:, :, 0]),
        under_weight=float(held @ pull),
        rates=found.values[1:],
    )
