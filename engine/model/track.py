"""The track tabulated along the path: one row of every tie per station, shared by all variants of a scene.

Derivatives by time are counted per step: ds = S' h and dds = S'' h^2 in scene time (mechanics section 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.kernels.layout import CURVE, FORCE, RATE, Impulse, Ties
from engine.kernels.tie_rows import add_attachment, close_rows
from engine.model.attachment import holds, residual, residual_rows, shape_derivatives, tie_shapes
from engine.model.attachment import rows as shape_rows
from engine.model.station_path import StationPath
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.kernels.layout import Alpha, Newmark
    from engine.model.scene_model import SceneModel
    from engine.model.station_path import Along
    from engine.model.ties import Attachment, SpringTie
    from engine.model.timeline import Segment


IN_CACHE = 2**20  # bytes of rows


def ties_of(model: SceneModel, active: Sequence[bool]) -> Counts:
    """Numbers of the ties that count where riders are on their bodies or not (``active``): those of carriages that are
    off theirs push nothing. No table is without any, so the first one stays where all are."""
    on = [any(active[load.rider] for load in carriage.loads) for carriage in model.carriages]
    on[0] |= not any(on)
    springs = (active[spring.rider] or not _passes_unread(model, spring) for spring in model.springs)
    pushes = (active[push.carriage] for push in model.pushes)
    return np.flatnonzero([*on, *(True for _ in model.dampers), *springs, *pushes])


def _passes_unread(model: SceneModel, spring: SpringTie) -> bool:
    """Whether nothing tells of a sprung mass before it comes, when it is at rest, and after it has left for good."""
    name = model.carriages[spring.carriage].name
    read = any(sensor.carriage == name for sensor in model.study.sensor.values())
    return spring.mode is not None and not read and model.study.carriage[name].motion.passes


class TieRows(NamedTuple):
    """Some ties, by their numbers, at the stations of one or several segments: rows, drive, level and residual as of
    `engine.kernels.layout.Ties`, without what a scheme makes of them."""

    ties: Counts
    rows: Array
    drive: Array
    level: Array
    residual: Array

    def part(self, stations: slice, ties: Counts) -> TieRows:
        """Some of the stations, and some of the ties."""
        own = np.searchsorted(self.ties, ties)
        rows, drive, level, missed = (of[stations] for of in (self.rows, self.drive, self.level, self.residual))
        if own.size < self.ties.size:
            rows, drive, level = rows.take(own, 2), drive.take(own, 1), level.take(own, 1)
            missed = among(missed, own)
        return TieRows(ties, rows, drive, level, missed)

    def held(self, stations: int) -> TieRows:
        """Those of one station at so many."""
        own = (self.rows, self.drive, self.level, self.residual)
        return TieRows(self.ties, *(np.repeat(of, stations, axis=0) for of in own))


def among(missed: Array, ties: Counts) -> Array:
    """(stations, ..., ties, ties) residual flexibilities between some of the ties."""
    return missed.take(ties, 1).take(ties, 2) if missed.size else missed


def tie_rows(model: SceneModel, along: Along, ties: Counts, missed: Array | None = None) -> TieRows:
    """Rows of some ties at every station. missed: of `attachments.residual`, where it is known."""
    stations = along[0].s.size
    rows, drive = np.zeros((stations, model.omega.size, ties.size, 4)), np.zeros((stations, ties.size))
    level = np.zeros_like(drive)
    missed = residual(model, along, ties) if missed is None else missed
    _add_attachments(rows, model, along, ties)
    for place, r in enumerate(ties):
        if r >= model.first_push:
            push = model.pushes[r - model.first_push]
            way = along[push.carriage]
            if push.prescribed:
                rows[:, -1, place, CURVE] = np.where(way.on, way.dds, 0.0)
        elif r >= model.first_spring:
            spring = model.springs[r - model.first_spring]
            if spring.mode is not None:
                rows[:, spring.mode, place, FORCE] = -1.0
                rows[:, spring.mode, place, RATE] = -1.0 if spring.damped else 0.0
            if along[spring.rider].active:
                under = _sag_under(model, spring, model.attachments[r][0], along)
                drive[:, place], level[:, place] = np.where(along[spring.rider].on, under, 0.0)
        elif r in model.pulsating:
            rows[:, model.pulses.start + model.pulsating[r], place, CURVE] = along[r].on
        elif r < len(model.carriages) and along[r].active and model.carriages[r].inertia == "mass":
            drive[:, place] = _curved_sag(model, model.carriages[r].attachments[0], along)
    if np.isin(ties, model.corrected).any():
        rows[:, model.residuals, :, FORCE] = residual_rows(model, ties, missed)
    return TieRows(ties, rows, drive, level, missed)


def _add_attachments(rows: Array, model: SceneModel, along: Along, ties: Counts) -> None:
    """Add where some ties hold bodies to their rows, by stations whose rows stay in the cache meanwhile."""
    held = []
    for place, r in enumerate(ties):
        for attachment in (one for one in model.attachments[r] if holds(one, along)):
            motion = _motion(model, r, attachment, along)
            shapes = shape_derivatives(model, attachment, along, motion.highest)
            first = model.bodies[attachment.body].modes.start
            held.append((place, first, attachment.factor, shapes, motion.factors))
    together = max(1, IN_CACHE // rows[0].nbytes)
    for part in (slice(first, first + together) for first in range(0, len(rows), together)):
        for place, first, factor, shapes, factors in held:
            here = shapes[:, part] if shapes.shape[1] > 1 else shapes
            add_attachment(rows[part], place, first, factor, here, factors[:, part])


def closed(model: SceneModel, found: TieRows, scheme: Newmark | Alpha) -> Ties:
    """Ties along a segment with the implicit part of their rows, w, in place; that of station 0 holds P alone."""
    inertial, moves, springs = (kind[found.ties] for kind in _kinds(model))
    alone = np.equal.outer(model.corrected, found.ties).astype(np.float64)
    reaches = np.zeros(found.rows.shape[1:3], dtype=np.bool_)
    close_rows(found.rows, inertial, alone, model.residuals.start, scheme.beta, scheme.gamma, reaches)
    prescribed, reactive = np.flatnonzero(~(moves | springs)), np.flatnonzero(moves | springs)
    unity = np.ones(model.ties)
    unity[model.first_spring : model.first_push] = [0.0 if spring.rigid else 1.0 for spring in model.springs]
    own = found.rows, found.drive, found.level
    return Ties(*own, reactive, prescribed, moves, springs, found.residual, unity[found.ties], reaches)


def tabulate_ties(model: SceneModel, along: Along, scheme: Newmark | Alpha) -> Ties:
    """All ties along a segment."""
    return closed(model, tie_rows(model, along, np.arange(model.ties)), scheme)


def _kinds(model: SceneModel) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Per tie, whether its acceleration enters its force, whether any of its kinematics do, and whether its gap."""
    inertial = [carriage.inertia != "force" for carriage in model.carriages]
    inertial += [False for _ in model.dampers] + [spring.rigid for spring in model.springs]
    inertial += [True for _ in model.pushes]
    damped = [carriage.pulsates for carriage in model.carriages] + [True for _ in model.dampers]
    damped += [spring.damped for spring in model.springs] + [False for _ in model.pushes]
    springs = [False] * model.first_spring + [not spring.rigid for spring in model.springs]
    springs += [False for _ in model.pushes]
    return np.array(inertial, dtype=np.bool_), np.logical_or(inertial, damped), np.array(springs, dtype=np.bool_)


class _Motion(NamedTuple):
    """How an attachment moves along its body: the highest derivative of shapes that its ties read, and the motion."""

    highest: int
    factors: Array


def _motion(model: SceneModel, r: int, attachment: Attachment, along: Along) -> _Motion:
    """Of an attachment of tie r. Of a mass or rigid joint A = 2 s' phi', B = s'^2 phi'' + s'' phi' (DLR 16, 17, 26-28);
    of a damper A = phi, B = s' phi' (mechanics section 4)."""
    stations, number = along[0].s.size, r - model.first_spring
    way = None if attachment.rider is None else along[attachment.rider]
    if r >= model.first_push:
        convected, damped = model.pushes[r - model.first_push].convected, False
    elif number < 0:
        convected = r < len(model.carriages) and model.carriages[r].inertia == "mass"
        damped = r >= len(model.carriages)
    else:
        convected, damped = model.springs[number].rigid, model.springs[number].damped
    if way is not None and convected:
        return _Motion(2, np.stack([np.zeros(stations), 2.0 * way.ds, way.dds, way.ds**2]))
    if not damped or convected:
        return _Motion(0, np.zeros((4, 0)))
    factors = np.zeros((4, stations))
    factors[0] = 1.0
    if way is None:
        return _Motion(0, factors)
    factors[2] = way.ds
    return _Motion(1, factors)


def _curved_sag(model: SceneModel, attachment: Attachment, along: Along) -> Array:
    """(stations,) what the curve of the body's own sag accelerates a mass by on its way, per unit gravity."""
    assert attachment.rider is not None
    way = along[attachment.rider]
    return np.asarray(way.ds**2 * model.sag(attachment.body, way.s, 2) + way.dds * model.sag(attachment.body, way.s, 1))


def _sag_under(model: SceneModel, spring: SpringTie, below: Attachment, along: Along) -> tuple[Array, Array]:
    """(stations,) rate, of a rigid joint acceleration, and gap of a spring by the sag of the body that it stands on."""
    way = along[spring.rider]
    if spring.rigid:
        return _curved_sag(model, below, along), np.zeros_like(way.s)
    level = model.sag(below.body, way.s, 0)
    return (way.ds * model.sag(below.body, way.s, 1) if spring.damped else np.zeros_like(level)), level


def rate_rows(model: SceneModel, ties: list[int], along: Along) -> tuple[Array, Array, Array]:
    """p and s' phi' (N, R) of springs or joints at the first station, and s' times the slope of the body's own sag (R,)
    per unit gravity; s' as the ways have it."""
    (force, slope), sag = np.zeros((2, model.omega.size, len(ties))), np.zeros(len(ties))
    for place, r in enumerate(ties):
        for attachment in model.attachments[r]:
            if holds(attachment, along):
                shapes = attachment.factor * shape_rows(model, attachment, along)[0]
                force[model.bodies[attachment.body].modes, place] += shapes
        below = model.attachments[r][0]
        if below.rider is not None and along[below.rider].active:
            way = along[below.rider]
            slope[model.bodies[below.body].modes, place] = way.ds[0] * shape_rows(model, below, along, 1)[0]
            sag[place] = way.ds[0] * model.sag(below.body, way.s, 1)[0]
    return force, slope, sag


def ties_with_inertia(model: SceneModel, active: Sequence[bool]) -> Counts:
    """Numbers of the ties that an impulse meets where riders are on their bodies or not (``active``)."""
    carriages = [active[r] and carriage.inertia != "force" for r, carriage in enumerate(model.carriages)]
    others = [False] * (model.first_push - len(carriages))
    return np.flatnonzero([*carriages, *others, *(active[push.carriage] for push in model.pushes)])


def tabulate_blow(model: SceneModel, segment: Segment, ties: Counts, mass: Array, time_scale: Array) -> Impulse:
    """The impulse at the beginning of a segment.

    ties: of `ties_with_inertia`;  mass (blocks, ties, LANES): kg;  time_scale (blocks, LANES): s per scene time.
    """
    slope = np.zeros((ties.size, model.omega.size))
    sag_slope, arrives, speed = np.zeros(ties.size), np.zeros(ties.size), np.zeros_like(mass)
    along = _here(model, segment, segment.start)
    shape = np.ascontiguousarray(tie_shapes(model, ties.tolist(), along)[0].T)
    for number, r in enumerate(ties):
        push = model.pushes[r - model.first_push] if r >= model.first_push else None
        owner = int(r) if push is None else push.carriage
        [attachment], carriage = model.attachments[r], model.carriages[owner]
        slope[number, model.bodies[carriage.body].modes] = shape_rows(model, attachment, along, 1)[0]
        strike = next((strike for strike in segment.strikes if strike.rider == owner), None)
        convected = carriage.inertia == "mass" if push is None else push.convected
        if push is None:
            sag_slope[number] = model.sag(carriage.body, along[owner].s, 1)[0]
        if strike is not None:
            arrives[number] = float(strike.arrives)
            speed[:, number] = convected * strike.speed / time_scale
    return Impulse(shape, slope, sag_slope, arrives, mass, speed)


def force_rates(model: SceneModel, along: Along, stations: Sequence[int]) -> Array:
    """(stations, C, N) how fast modal forces of unit weights of the carriages grow at some stations, per step."""
    there = tuple(way.at(*stations) for way in along)
    found = np.zeros((len(stations), len(model.carriages), model.omega.size))
    for number, carriage in enumerate(model.carriages):
        for load in carriage.attachments:
            if load.rider is not None and there[load.rider].active:
                slope = load.factor * there[load.rider].ds[:, None] * shape_rows(model, load, there, 1)
                found[:, number, model.bodies[load.body].modes] += slope
    return found


def _here(model: SceneModel, segment: Segment, time: float) -> Along:
    """All riders as they are at an instant of a segment."""
    found, at, still = [], np.array([time]), np.zeros(1)
    for rider, active in zip(model.riders, segment.active, strict=True):
        place = rider.path_on_body(at, segment.start, segment.end).S if active else still
        found.append(StationPath(place, still, still, active))
    return tuple(found)
