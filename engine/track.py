"""The track tabulated along the path: one row of every tie per station, shared by all variants of a scene.

Derivatives by time are counted per step: ds = S' h and dds = S'' h^2 in scene time (mechanics section 3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.grips import holds, residual
from engine.grips import rows as shape_rows
from engine.kernels.layout import CLOSED, CURVE, FORCE, RATE, Alpha, Blow, Newmark, Ties
from engine.model import SceneModel
from engine.ties import Grip, SpringTie
from engine.timeline import Segment
from engine.ways import Way

Array = NDArray[np.float64]


def tabulate_ties(
    model: SceneModel, along: tuple[Way, ...], scheme: Newmark | Alpha, missed: Array | None = None
) -> Ties:
    """Rows of every tie at every station; row w of station 0 holds P alone, for the start of a segment. missed: of
    `grips.residual`, where it is known."""
    stations = along[0].s.size
    columns = np.zeros((4, model.ties, stations, model.omega.size))  # each is filled, and looked at, in one piece
    rows = columns.transpose(2, 3, 1, 0)
    drive, level = np.zeros((stations, model.ties)), np.zeros((stations, model.ties))
    for r in range(model.ties):
        _tabulate_force(model, r, along, rows[:, :, r, FORCE])
    for r, carriage in enumerate(model.carriages):
        if along[r].active and carriage.inertia == "mass":
            _tabulate_convection(model, carriage.grips[0], along, rows[:, :, r], drive[:, r])
    for r in range(len(model.carriages), model.first_spring):
        rows[:, :, r, RATE] = rows[:, :, r, FORCE]
    for r, spring in enumerate(model.springs, start=model.first_spring):
        _tabulate_spring(model, spring, along, rows[:, :, r], (drive[:, r], level[:, r]))
    inertial, springs = _kinds(model)
    rows[..., CLOSED] = np.where(inertial, rows[..., FORCE], 0.0)
    rows[1:, ..., CLOSED] += scheme.gamma * rows[1:, ..., RATE] + scheme.beta * rows[1:, ..., CURVE]
    damped = [False] * len(model.carriages) + [True for _ in model.dampers] + [s.damped for s in model.springs]
    moves = inertial | np.array(damped, dtype=np.bool_)
    given, reacting = np.flatnonzero(~(moves | springs)), np.flatnonzero(moves | springs)
    unity = np.ones(model.ties)
    unity[model.first_spring :] = [0.0 if spring.rigid else 1.0 for spring in model.springs]
    missed = residual(model, along) if missed is None else missed
    reaches = np.ascontiguousarray(((columns.min(axis=2) < 0.0) | (columns.max(axis=2) > 0.0)).any(axis=0).T)
    return Ties(np.ascontiguousarray(rows), drive, level, reacting, given, moves, springs, missed, unity, reaches)


def _kinds(model: SceneModel) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Per tie, whether its acceleration enters its force, and whether its gap does."""
    inertial = [carriage.inertia != "force" for carriage in model.carriages]
    inertial += [False for _ in model.dampers] + [spring.rigid for spring in model.springs]
    springs = [False] * model.first_spring + [not spring.rigid for spring in model.springs]
    return np.array(inertial, dtype=np.bool_), np.array(springs, dtype=np.bool_)


def _tabulate_force(model: SceneModel, r: int, along: tuple[Way, ...], force: Array) -> None:
    """p of a tie (stations, modes): the mode shapes wherever it takes hold of a body."""
    for grip in model.grips[r]:
        if holds(grip, along):
            force[:, model.bodies[grip.body].modes] += grip.factor * shape_rows(model, grip, along)


def _tabulate_convection(model: SceneModel, grip: Grip, along: tuple[Way, ...], rows: Array, drive: Array) -> None:
    """A = 2 s' phi';  B = s'^2 phi'' + s'' phi' (DLR 16, 17, 26-28), the sag's own curve as the drive."""
    assert grip.rider is not None
    way, modes = along[grip.rider], model.bodies[grip.body].modes
    slope, bend = shape_rows(model, grip, along, 1), shape_rows(model, grip, along, 2)
    ds, dds = way.ds[:, None], way.dds[:, None]
    rows[:, modes, RATE] = 2.0 * ds * slope
    rows[:, modes, CURVE] = ds**2 * bend + dds * slope
    drive[:] = way.ds**2 * model.sag(grip.body, way.s, 2) + way.dds * model.sag(grip.body, way.s, 1)


def _tabulate_spring(
    model: SceneModel, spring: SpringTie, along: tuple[Way, ...], rows: Array, own: tuple[Array, Array]
) -> None:
    """p = (phi, -v);  A = p;  B = s' phi' (mechanics section 4): the deflection of the body and its material rate less
    those of what rides; without phi where that stands on level ground. A rigid joint has the accelerations instead.
    own: rate and gap of the body's own sag, which this fills."""
    way, (drive, level) = along[spring.rider], own
    below = model.grips[model.first_spring + model.springs.index(spring)][0]
    if spring.mode is not None:
        rows[:, spring.mode, FORCE] = -1.0
    if spring.damped:
        rows[..., RATE] = rows[..., FORCE]
    if not way.active:
        return
    if spring.rigid:
        _tabulate_convection(model, below, along, rows, drive)
        return
    level[:] = model.sag(below.body, way.s, 0)
    if spring.damped:
        rows[:, model.bodies[below.body].modes, CURVE] = way.ds[:, None] * shape_rows(model, below, along, 1)
        drive[:] = way.ds * model.sag(below.body, way.s, 1)


def rate_rows(model: SceneModel, ties: list[int], along: tuple[Way, ...]) -> tuple[Array, Array, Array]:
    """p and s' phi' (N, R) of springs or joints at the first station, and s' times the slope of the body's own sag (R,)
    per unit gravity; s' as the ways have it."""
    force, slope, sag = (
        np.zeros((model.omega.size, len(ties))),
        np.zeros((model.omega.size, len(ties))),
        np.zeros(len(ties)),
    )
    for place, r in enumerate(ties):
        _tabulate_force(model, r, along, force[None, :, place])
        below = model.grips[r][0]
        if below.rider is not None and along[below.rider].active:
            way = along[below.rider]
            slope[model.bodies[below.body].modes, place] = way.ds[0] * shape_rows(model, below, along, 1)[0]
            sag[place] = way.ds[0] * model.sag(below.body, way.s, 1)[0]
    return force, slope, sag


def tabulate_blow(model: SceneModel, segment: Segment, mass: Array, time_scale: Array) -> Blow:
    """The impulse at the beginning of a segment.

    mass (blocks, ties, LANES): kg, zero for ties without inertia;  time_scale (blocks, LANES): s per scene time.
    """
    ties, modes = model.ties, model.omega.size
    shape, slope, sag_slope, arrives = np.zeros((ties, modes)), np.zeros((ties, modes)), np.zeros(ties), np.zeros(ties)
    speed = np.zeros_like(mass)
    at = np.array([segment.start])
    for r, carriage in enumerate(model.carriages):
        if segment.active[r] and carriage.inertia != "force":
            place = np.clip(carriage.rider.path(at, segment.start, segment.end).S, 0.0, carriage.rider.length)
            part = model.bodies[carriage.body]
            shape[r, part.modes] = part.modal.shape(place)[0]
            slope[r, part.modes] = part.modal.shape(place, 1)[0]
            sag_slope[r] = model.sag(carriage.body, place, 1)[0]
    for strike in segment.strikes:
        if strike.rider >= len(model.carriages):  # a contact on a spring meets no shock
            continue
        inertia = model.carriages[strike.rider].inertia
        arrives[strike.rider] = float(strike.kind == "arrival" and inertia != "force")
        if inertia == "mass":
            speed[:, strike.rider] = strike.speed / time_scale
    return Blow(shape, slope, sag_slope, arrives, mass, speed)
