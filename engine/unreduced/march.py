"""The unreduced scene marched by Newmark's average acceleration: one sparse factor per step, ties by a small system.

Unknown at every step are the forces F of the ties: with the Newmark predictors u*, v* and A = M + gamma h C +
beta h^2 K,  a = A^-1 (f + B^T F - C v* - K u*),  and each tie says  e F + P a + Q v + R u = b:  a mass
m D2w + F = m g,  a spring  F + k gap + c rate = 0,  a rigid contact  gap'' + 2 r gap' + r^2 gap = 0, whose rate r
takes back what steps let slip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.bodies.modal.flexibility import symmetric_lu
from engine.kernels.layout import SOUND
from engine.march.stepper import Codes, go
from engine.model.station_path import station_times
from engine.model.timeline import Impact, Segment, Timeline
from engine.observation.histories import rows_sampled
from engine.unreduced.rows import Along, Readings, readings, rider_of, softness, softness_slopes, tie_rows
from engine.unreduced.scene import Unreduced
from engine.unreduced.statics import level_readings, level_state, statics_at
from results_schema.arrays import Array, Counts
from results_schema.lazy_imports import sparse

BETA, GAMMA = 0.25, 0.5
REGAIN = 0.05  # per step: the rate at which a rigid contact takes back its gap


@dataclass(frozen=True)
class Course:
    """How to march: the timeline, seconds per unit of its scene time, and the first period (s) of free vibration."""

    timeline: Timeline
    time_scale: float
    first_period: float = 0.0

    def step(self, segment: Segment) -> float:
        """Step of a segment, s."""
        if not segment.free:
            return self.time_scale * segment.step
        steps = sum(part.steps for part in self.timeline.segments if part.free)
        return self.timeline.free_periods * self.first_period / steps

    def elapsed(self, counts: Counts) -> Array:
        """(H,) seconds since time 0 of stations by their count."""
        index, tau = self.timeline.moments(counts)
        segments = self.timeline.segments
        found = tau * self.time_scale
        for place, number in enumerate(index):
            if segments[number].free:
                first = next(segment.first for segment in segments if segment.free)
                found[place] += (counts[place] - first) * self.step(segments[number])
        return found


class Unfolded(NamedTuple):
    """Histories at H stations: sensors (H, J), forces (H, T) of the model's ties; NaN where a carriage is off its
    body."""

    sensors: Array
    forces: Array


def march_unreduced(
    model: Unreduced, course: Course, counts: Counts, check: Callable[[], None] = lambda: None
) -> Unfolded:
    """March from rest or from static equilibrium, as the study says; histories at stations by their count, ascending.

    check: called after every segment, to stop by what it raises. Raises BadInput as `statics_at` and `check_march`.
    """
    check_march(model)
    march = _March(model, course, counts, level_state(model), *_start(model, course))

    def halted() -> bool:
        check()
        return False

    with np.errstate(all="ignore"):
        go(march, course.timeline.segments, halted)
    return Unfolded(march.sensors, march.forces)


def check_march(model: Unreduced) -> None:
    """Refuse masses that hold on beside the axis of their track: a march follows them by derivatives along it, and
    elements that turn linearly between their ends lack the curvature of that. Raises BadInput."""
    for tie in model.ties:
        line = model.bodies[tie.body].lines.get(tie.direction)
        if line is not None and line.turns and tie.link not in ("force", "spring"):
            raise model.study.source.fault(
                f"body.{tie.body}.track.offset",
                "the unreduced model does not march masses beside the axis of their track",
                expected="no offset, or unreduced = 0",
                remedy=f"{tie.carriage} as an oscillator on a stiff spring is marched, no inertia along or across",
            )


def along_segment(model: Unreduced, course: Course, segment: Segment) -> Along:
    """All riders at the stations of a segment."""
    tau = station_times(segment)
    shape = (tau.size, len(model.riders))
    s, ds, dds, on = np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape, dtype=np.bool_)
    for r, (rider, active) in enumerate(zip(course.timeline.riders, segment.active, strict=True)):
        if active:
            path = rider.path(tau, segment.start, segment.end)
            s[:, r] = np.clip(path.S, 0.0, rider.length)
            ds[:, r], dds[:, r] = path.dS / course.time_scale, path.ddS / course.time_scale**2
            on[:, r] = True
    return Along(s, ds, dds, on)


def _start(model: Unreduced, course: Course) -> tuple[Array, Array]:
    """Displacements and velocities (n,) at time 0."""
    if model.study.start == "rest":
        return level_state(model)[0], np.zeros(model.size)
    riders = course.timeline.riders
    places = np.array([[float(rider.motion.path(0.0).S) + rider.offset for rider in riders]])
    on = np.array([[rider.touches(0.0, 1e-9) for rider in riders]])
    return statics_at(model, Along.at_rest(places, on, riders)).states[0], np.zeros(model.size)


@dataclass(frozen=True, eq=False)
class _Relations:
    """What the ties say at S stations, on the bodies' side (S, T, 12) and on the riders' side (T,): e F + P a + Q v +
    R u = b."""

    index: NDArray[np.int64]
    act: Array
    on_a: Array
    on_v: Array
    on_u: Array
    other_a: Array
    other_v: Array
    other_u: Array
    own: Array
    wanted: Array


def _relations(model: Unreduced, along: Along, step: float) -> _Relations:
    """Rows of all ties; a given force is one that feels nothing."""
    rows = [tie_rows(model, along, order) for order in range(3)]
    shape, slope, bend = (part.values for part in rows)
    rider = np.array([tie.rider for tie in model.ties], dtype=np.int64)
    ds, dds = along.ds[:, rider, None], along.dds[:, rider, None]
    curve = ds**2 * bend + dds * slope
    link = np.array([tie.link for tie in model.ties])
    direction = np.array([tie.direction for tie in model.ties])
    mass, rigid = link == "mass", link == "rigid"
    m = np.array([tie.mass for tie in model.ties]) + rigid
    k = np.array([tie.stiffness if tie.link == "spring" else 0.0 for tie in model.ties])
    c, r = np.array([tie.damping for tie in model.ties]), rigid * (REGAIN / step)
    c = c + 2.0 * r
    k = k + r**2
    inert, rate = m[:, None], c[:, None]
    first, second = softness_slopes(model, along)
    own = np.tile(np.diag(np.where(rigid, 0.0, 1.0)), (len(shape), 1, 1))
    own += k[:, None] * softness(model, along) + (rate * ds) * first + inert * (ds**2 * second + dds * first)
    on = along.on[:, rider]
    return _Relations(
        index=rows[0].freedoms,
        act=shape,
        on_a=inert * shape,
        on_v=2.0 * inert * ds * slope + rate * shape,
        on_u=inert * curve + k[:, None] * shape + rate * ds * slope,
        other_a=np.where(rigid, 1.0, 0.0),
        other_v=c,
        other_u=k,
        own=own,
        wanted=np.where(mass & on, m * model.study.gravity, 0.0)
        - np.where((direction == "along") & on, m * along.dds[:, rider], 0.0)
        + np.where(link == "force", np.array([tie.force for tie in model.ties]), 0.0) * on,
    )


class _Factor:
    """Answers A x = p for A = M + gamma h C + beta h^2 K, or M alone for h = 0; modal damping is of low rank."""

    def __init__(self, model: Unreduced, h: float, others: Array) -> None:
        matrix = model.mass + GAMMA * h * model.viscous + BETA * h**2 * model.stiffness
        self._lu = symmetric_lu(sparse.csc_array(matrix))
        self._loads = model.modal_loads if h > 0.0 else model.modal_loads[:, :0]
        self._soft = self._lu.solve(self._loads) if self._loads.shape[1] else self._loads
        small = self._loads.T @ self._soft
        if len(small):
            self._small = np.linalg.inv(np.eye(len(small)) / (GAMMA * h) + small)
        self.h = h
        self.others = self.solve(others)

    def solve(self, loads: Array) -> Array:
        """(n, c) for loads (n, c)."""
        found = self._lu.solve(loads)
        if self._loads.shape[1]:
            found -= self._soft @ (self._small @ (self._loads.T @ found))
        return np.asarray(found)


class _Table(NamedTuple):
    """Places of the riders at the stations of a segment, and what the ties say there."""

    along: Along
    says: _Relations


class _Observed(NamedTuple):
    """The row of the histories of every station or -1, and what is read, and where the riders are, at the sampled
    stations in their order."""

    rows: Counts
    reads: Readings
    along: Along


@dataclass(eq=False)
class _March:
    """The stepper of an unreduced scene: displacements u, velocities v, accelerations a (n,) and the ties' forces
    (T,)."""

    model: Unreduced
    course: Course
    counts: Counts
    level: tuple[Array, Array]
    u: Array
    v: Array
    a: Array = field(init=False)
    force: Array = field(init=False)

    def __post_init__(self) -> None:
        model = self.model
        self.a, self.force = np.zeros(model.size), np.zeros(len(model.ties))
        self.sensors = np.full((self.counts.size, len(model.study.sensor)), np.nan)
        self.forces = np.full((self.counts.size, len(model.ties)), np.nan)
        self.others = np.array([tie.other for tie in model.ties]).reshape(len(model.ties), model.size).T.copy()
        self._factors: dict[float, _Factor] = {}

    def tabulate(self, segment: Segment) -> _Table:
        """Places of the riders and what the ties say along a segment."""
        along = along_segment(self.model, self.course, segment)
        return _Table(along, _relations(self.model, along, self.course.step(segment)))

    def observe(self, segment: Segment, table: _Table) -> _Observed:
        """What is read at the sampled stations of a segment."""
        rows = rows_sampled(segment, self.counts)
        part = table.along.some(rows >= 0)
        level = level_readings(self.model, self.level, part)
        return _Observed(rows, readings(self.model, part).less(level), part)

    def start(self, segment: Segment, table: _Table, observed: _Observed, before: Segment | None) -> None:
        """The impulses and the new accelerations of a segment's event, and its first station."""
        if segment.strikes:
            self._strike(segment.strikes, *table)
        if segment.fresh:
            self.a, self.force = self._solve(table.says, 0, self._factor(0.0), self.u, self.v)
        self._keep(0, observed)

    def step(self, segment: Segment, table: _Table, observed: _Observed) -> Codes:
        """The steps of a segment; (1,) code, sound whatever happens: what is not finite shows in the histories."""
        factor = self._factor(float(f"{self.course.step(segment):.12g}"))
        h = factor.h
        for n in range(1, segment.steps + 1):
            u = self.u + h * self.v + (0.5 - BETA) * h**2 * self.a
            v = self.v + (1.0 - GAMMA) * h * self.a
            self.a, self.force = self._solve(table.says, n, factor, u, v)
            self.u, self.v = u + BETA * h**2 * self.a, v + GAMMA * h * self.a
            self._keep(n, observed)
        return np.array([SOUND], dtype=np.int8)

    def _factor(self, h: float) -> _Factor:
        if h not in self._factors:
            self._factors[h] = _Factor(self.model, h, self.others)
        return self._factors[h]

    def _solve(self, says: _Relations, n: int, factor: _Factor, u: Array, v: Array) -> tuple[Array, Array]:
        """Accelerations and forces at a station from predictors; h = 0: from the state itself."""
        model, h, ties = self.model, factor.h, len(self.force)
        index, others = says.index[n], self.others
        loads = np.zeros((model.size, 1 + ties), order="F")
        loads[:, 0] = model.weight - model.viscous @ v - model.stiffness @ u
        loads[:, 0] -= model.modal_loads @ (model.modal_loads.T @ v)
        np.add.at(loads, (index, np.arange(1, ties + 1)[:, None]), says.act[n])
        found = factor.solve(loads)
        free, reach = found[:, 0], found[:, 1:] + factor.others
        on_a = says.on_a[n] + GAMMA * h * says.on_v[n] + BETA * h**2 * says.on_u[n]
        other_a = says.other_a + GAMMA * h * says.other_v + BETA * h**2 * says.other_u
        matrix = says.own[n] + np.einsum("tk,tkj->tj", on_a, reach[index]) + other_a[:, None] * (others.T @ reach)
        right = says.wanted[n] - np.sum(on_a * free[index], axis=1) - other_a * (others.T @ free)
        right -= np.sum(says.on_v[n] * v[index] + says.on_u[n] * u[index], axis=1)
        right -= says.other_v * (others.T @ v) + says.other_u * (others.T @ u)
        force = np.linalg.solve(matrix, right)
        return free + reach @ force, force

    def _strike(self, strikes: tuple[Impact, ...], along: Along, says: _Relations) -> None:
        """Impulses of masses and rigid contacts that arrive or turn, and sprung masses that come from level ground."""
        model = self.model
        slope = tie_rows(model, along.some(slice(1)), 1).values[0]
        index, shape = says.index[0], says.act[0]
        jump = np.zeros(len(model.ties))
        for strike in strikes:
            for j, tie in enumerate(model.ties):
                if tie.rider != strike.rider:
                    continue
                speed = strike.speed / self.course.time_scale
                jump[j] = speed * float(slope[j] @ self.u[index[j]])
                if strike.arrives:
                    jump[j] += float(shape[j] @ self.v[index[j]]) + float(tie.other @ self.v)
                    if tie.carriage in model.sprung:
                        place = model.sprung[tie.carriage]
                        self.u[place], self.v[place] = self.level[0][place], 0.0
        heavy = np.array([1.0 if tie.link == "rigid" else tie.mass for tie in model.ties])
        felt = np.flatnonzero(heavy)
        if not felt.size:
            return
        loads = np.zeros((model.size, felt.size))
        np.add.at(loads, (index[felt], np.arange(felt.size)[:, None]), shape[felt])
        loads += self.others[:, felt]
        reach = self._factor(0.0).solve(loads)
        matrix = heavy[felt, None] * (loads.T @ reach)
        matrix += np.diag([0.0 if model.ties[j].link == "rigid" else 1.0 for j in felt])
        self.v = self.v + reach @ np.linalg.solve(matrix, -heavy[felt] * jump[felt])

    def _keep(self, n: int, observed: _Observed) -> None:
        """Histories at station n of a segment, where it is sampled."""
        rows, reads, along = observed
        row = int(rows[n])
        if row < 0:
            return
        h = row - int(rows[rows >= 0][0])
        model = self.model
        rides = [rider_of(model, sensor) for sensor in model.study.sensor.values()]
        on = np.array([r is None or bool(along.on[h, r]) for r in rides], dtype=np.bool_)
        self.sensors[row] = np.where(on, reads.at(h, self.u, self.v, self.a, self.force), np.nan)
        touching = along.on[h, [tie.rider for tie in model.ties]]
        self.forces[row] = np.where(touching, self.force, np.nan)
