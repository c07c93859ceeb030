"""The track tabulated along the path: one row of every tie per station, shared by all variants of a scene.

Derivatives by time are counted per step: ds = S' h and dds = S'' h^2 in scene time (mechanics section 3).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from engine.bodies.modal import ModalBody
from engine.kernels.layout import CLOSED, CURVE, FORCE, RATE, Alpha, Blow, Newmark, Ties
from engine.model import CarriageTie, SceneModel, SpringTie
from engine.timeline import Segment

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Way:
    """One carriage along one segment, station by station: place (m), its first and second change per step, and
    whether it touches the body; where it does not, its rows are zero."""

    s: Array
    ds: Array
    dds: Array
    active: bool
    _shapes: dict[tuple[int, int], Array] = field(default_factory=dict)

    def shape(self, body: ModalBody, derivative: int = 0) -> Array:
        """(S, N) mode shapes of its body along the way, evaluated once."""
        key = (id(body), derivative)
        if key not in self._shapes:
            self._shapes[key] = body.shape(self.s, derivative)
        return self._shapes[key]


def ways(model: SceneModel, segment: Segment) -> tuple[Way, ...]:
    """The ways of all carriages at the stations 0..steps of a segment."""
    tau = segment.start + np.arange(segment.steps + 1, dtype=np.float64) * segment.step
    tau[-1] = segment.end
    return tuple(
        _way(carriage, segment, tau, active) for carriage, active in zip(model.carriages, segment.active, strict=True)
    )


def _way(carriage: CarriageTie, segment: Segment, tau: Array, active: bool) -> Way:
    if not active:
        nowhere = np.zeros_like(tau)
        return Way(nowhere, nowhere, nowhere, active)
    path = carriage.rider.path(tau, segment.start, segment.end)
    place = np.clip(path.S, 0.0, carriage.rider.length)  # rounding must not leave the body
    return Way(place, path.dS * segment.step, path.ddS * segment.step**2, active)


def tabulate_ties(model: SceneModel, along: tuple[Way, ...], scheme: Newmark | Alpha) -> Ties:
    """Rows of every tie at every station; row w of station 0 holds P alone, for the start of a segment."""
    stations = along[0].s.size
    rows = np.zeros((stations, model.omega.size, model.ties, 4))
    drive, level = np.zeros((stations, model.ties)), np.zeros((stations, model.ties))
    for r, (carriage, way) in enumerate(zip(model.carriages, along, strict=True)):
        if way.active:
            _tabulate_carriage(model, carriage, way, rows[:, :, r], drive[:, r])
    for r, damper in enumerate(model.dampers, start=len(model.carriages)):
        part = model.bodies[damper.body]
        shape = damper.row(part.modal)
        rows[:, part.modes, r, FORCE] = shape
        rows[:, part.modes, r, RATE] = shape
    first = len(model.carriages) + len(model.dampers)
    for r, spring in enumerate(model.springs, start=first):
        if along[spring.carriage].active:
            _tabulate_spring(model, spring, along[spring.carriage], rows[:, :, r], (drive[:, r], level[:, r]))
    inertial, springs = np.zeros(model.ties, dtype=np.bool_), np.arange(model.ties) >= first
    inertial[: len(model.carriages)] = [carriage.inertia != "force" for carriage in model.carriages]
    rows[..., CLOSED] = np.where(inertial, rows[..., FORCE], 0.0)
    rows[1:, ..., CLOSED] += scheme.gamma * rows[1:, ..., RATE] + scheme.beta * rows[1:, ..., CURVE]
    moves = inertial.copy()
    moves[len(model.carriages) :] = [*(True for _ in model.dampers), *(spring.damped for spring in model.springs)]
    given = np.flatnonzero(~(moves | springs))
    reacting = np.flatnonzero(moves | springs)
    return Ties(np.ascontiguousarray(rows), drive, level, reacting, given, moves, springs)


def _tabulate_carriage(model: SceneModel, carriage: CarriageTie, way: Way, rows: Array, drive: Array) -> None:
    """p = phi;  A = 2 s' phi';  B = s'^2 phi'' + s'' phi' (DLR 16, 17, 26-28), the sag's own curve as the drive."""
    part = model.bodies[carriage.body]
    rows[:, part.modes, FORCE] = way.shape(part.modal)
    if carriage.inertia != "mass":
        return
    slope, bend = way.shape(part.modal, 1), way.shape(part.modal, 2)
    ds, dds = way.ds[:, None], way.dds[:, None]
    rows[:, part.modes, RATE] = 2.0 * ds * slope
    rows[:, part.modes, CURVE] = ds**2 * bend + dds * slope
    drive[:] = way.ds**2 * model.sag(carriage.body, way.s, 2) + way.dds * model.sag(carriage.body, way.s, 1)


def _tabulate_spring(model: SceneModel, spring: SpringTie, way: Way, rows: Array, own: tuple[Array, Array]) -> None:
    """p = (phi, -1);  A = p;  B = s' phi' (mechanics section 4): the body's deflection and its material rate less those
    of the mass. own: rate and gap of the body's own sag, which this fills."""
    carriage = model.carriages[spring.carriage]
    part, (drive, level) = model.bodies[carriage.body], own
    rows[:, part.modes, FORCE] = way.shape(part.modal)
    rows[:, spring.mode, FORCE] = -1.0
    level[:] = model.sag(carriage.body, way.s, 0)
    if spring.damped:
        rows[..., RATE] = rows[..., FORCE]
        rows[:, part.modes, CURVE] = way.ds[:, None] * way.shape(part.modal, 1)
        drive[:] = way.ds * model.sag(carriage.body, way.s, 1)


def tabulate_blow(model: SceneModel, segment: Segment, mass: Array, time_scale: Array) -> Blow:
    """The impulse at the beginning of a segment.

    mass (blocks, ties, LANES): kg, zero for ties without inertia;  time_scale (blocks, LANES): s per scene time.
    """
    ties, modes = model.ties, model.omega.size
    shape, slope, sag_slope, arrives = np.zeros((ties, modes)), np.zeros((ties, modes)), np.zeros(ties), np.zeros(ties)
    speed = np.zeros_like(mass)
    at = np.array([segment.start])
    for r, (carriage, active) in enumerate(zip(model.carriages, segment.active, strict=True)):
        if active:
            place = np.clip(carriage.rider.path(at, segment.start, segment.end).S, 0.0, carriage.rider.length)
            part = model.bodies[carriage.body]
            shape[r, part.modes] = part.modal.shape(place)[0]
            slope[r, part.modes] = part.modal.shape(place, 1)[0]
            sag_slope[r] = model.sag(carriage.body, place, 1)[0]
    for strike in segment.strikes:
        inertia = model.carriages[strike.rider].inertia
        arrives[strike.rider] = float(strike.kind == "arrival" and inertia != "force")
        if inertia == "mass":
            speed[:, strike.rider] = strike.speed / time_scale
    return Blow(shape, slope, sag_slope, arrives, mass, speed)
