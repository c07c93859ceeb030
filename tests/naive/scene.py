"""Loads riding on a body that is given as modes of unit modal mass, and the dense matrices of the coupled system.

With the material acceleration D2w = phi.q'' + 2 s' phi'.q' + (s'^2 phi'' + s'' phi').q of the contact point and the
contact force F = m (g - D2w) acting on the modes, moving all that is linear in q to the left gives

    M(t) q'' + C(t) q' + K(t) q = f(t)
    M = I + sum m phi phi^T
    C = diag(2 zeta omega) + sum m phi (2 s' phi')^T + sum c psi psi^T        (psi: the row of a damper)
    K = diag(omega^2)      + sum m phi (s'^2 phi'' + s'' phi')^T
    f = sum m g phi + own weight

A sprung mass m_s at the absolute place y is one more coordinate, a row phi of zeros with one entry e; with the row
r = phi - e its spring and damper push the body by  S = -k (r.q) - c (r.q' + s' phi'.q):

    m_s y'' = m_s g - S

Before it arrives and after it has left it stands on rigid ground: phi = 0. What the modes left out would add to the
deflection under it, R F of the contact forces F of all loads and dampers, its spring sees too:

    S = -k (r.q + R F) - c (r.q' + s' phi'.q)

A mass may feel it by a coordinate of its own, y, by which its place is phi.q + y, and which forces of such masses
drive, of a sprung one those of its wheel and of the sprung weight:

    y'' + 2 zeta omega y' + omega^2 y = omega^2 R F

Nothing here is clever on purpose.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Law = Callable[[float], float]
Shape = Callable[[float, int], Array]
Side = Literal["left", "right"]

RELATIVE_JUMP = 1e-9  # smaller differences of s' or s'' across a phase boundary are rounding, not events


@dataclass(frozen=True)
class Phase:
    """One smooth piece of a motion, start <= t <= end in s: position s(t) in m and its two exact derivatives."""

    start: float
    end: float
    s: Law
    ds: Law
    dds: Law


@dataclass(frozen=True)
class Sprung:
    """A mass on a spring: the number of its coordinate, kg, N/m, N s/m, N along gravity.

    convective: whether the damper sees s' phi'. level, climb: place (m) and rate (m/s) of the unloaded track.
    """

    number: int
    mass: float
    stiffness: float
    damping: float
    weight: float
    convective: bool = True
    level: float = 0.0
    climb: float = 0.0

    def rows(self, scene: Scene, phase: Phase | None, t: float) -> tuple[Array, Array]:
        """r and s' phi'."""
        row = np.zeros(len(scene.omega))
        row[self.number] = -1.0
        if phase is None:
            return row, np.zeros_like(row)
        return row + scene.phi(phase.s(t), 0), self.convective * phase.ds(t) * scene.phi(phase.s(t), 1)


@dataclass(frozen=True)
class Load:
    """A load and its motion; off the body before the first phase and after the last.

    mass: kg in M(t). convective_mass: kg in C(t) and K(t); equal to mass, or 0 where convective terms are left out.
    weight: N along gravity. arrival_speed: vertical speed in m/s before the load touches the body. sprung: a mass on a
    spring above it. residual: the number of its y, whose frequency and damping stand among those of the modes.
    """

    phases: tuple[Phase, ...]
    weight: float
    mass: float = 0.0
    convective_mass: float = 0.0
    arrival_speed: float = 0.0
    sprung: Sprung | None = None
    residual: int | None = None

    @property
    def enter(self) -> float:
        """Time in s at which the load touches the body."""
        return self.phases[0].start

    @property
    def leave(self) -> float:
        """Time in s at which the load leaves the body."""
        return self.phases[-1].end

    def phase(self, t: float, side: Side) -> Phase | None:
        """The phase valid just before ("left") or just after ("right") t; None while the load is off the body."""
        for phase in self.phases:
            if side == "left" and phase.start < t <= phase.end:
                return phase
            if side == "right" and phase.start <= t < phase.end:
                return phase
        return None

    def active(self, t: float, side: Side = "right") -> bool:
        """Whether the load is in contact just before or just after t."""
        return self.phase(t, side) is not None


def moving_force(weight: float, phases: Sequence[Phase]) -> Load:
    """A force of `weight` N that moves and has no inertia."""
    return Load(tuple(phases), weight)


def moving_mass(mass: float, gravity: float, phases: Sequence[Phase]) -> Load:
    """A mass in kg with every convective term; its weight acts."""
    return Load(tuple(phases), mass * gravity, mass, mass)


def mass_without_convective(mass: float, gravity: float, phases: Sequence[Phase]) -> Load:
    """A mass in kg that takes part with phi.q'' only; its weight acts."""
    return Load(tuple(phases), mass * gravity, mass, 0.0)


class Damper(NamedTuple):
    """A discrete damper to ground: row psi = phi(x_d), shape (N,), coefficient in N s/m, and x_d in m, which only
    `Scene.missed` asks for; force -c psi (psi.q')."""

    row: Array
    coefficient: float
    at: float = math.nan


@dataclass(frozen=True)
class Scene:
    """A body of N modes and what acts on it.

    phi(s, derivative) -> (N,), unit modal mass; omega (N,) rad/s; zeta (N,); own_weight (N,) modal force of gravity.
    Where masses are sprung, or have a y, N counts these too: phi is zero there, and omega of what is sprung.
    missed(x, s): m at x per N at s that modes left out would add; None where nothing is. modal_mass (N,): of modes
    that have another than unity.
    """

    phi: Shape
    omega: Array
    zeta: Array
    loads: tuple[Load, ...]
    dampers: tuple[Damper, ...] = ()
    own_weight: Array | None = None
    missed: Callable[[float, float], float] | None = None
    modal_mass: Array | None = None


class System(NamedTuple):
    """M, C, K of shape (N, N) and f of shape (N,) at one instant."""

    mass: Array
    damping: Array
    stiffness: Array
    force: Array


class State(NamedTuple):
    """Modal coordinates q and velocities v, each (N,)."""

    q: Array
    v: Array


def convective_rows(phi: Shape, phase: Phase, t: float) -> tuple[Array, Array, Array]:
    """phi, 2 s' phi' and s'^2 phi'' + s'' phi' at time t, each (N,)."""
    s, ds, dds = phase.s(t), phase.ds(t), phase.dds(t)
    return phi(s, 0), 2.0 * ds * phi(s, 1), ds**2 * phi(s, 2) + dds * phi(s, 1)


class Forces(NamedTuple):
    """Forces of all loads by q'', q' and q, each (loads, N), and what does not depend on these, (loads,)."""

    a: Array
    v: Array
    q: Array
    rest: Array


def wheels(scene: Scene, t: float, side: Side) -> Forces:
    """What all loads press with besides their springs, just before or just after t; 0 off the body."""
    found = _none(scene)
    for j, load in enumerate(scene.loads):
        phase = load.phase(t, side)
        if phase is not None:
            row, rate_row, position_row = convective_rows(scene.phi, phase, t)
            if load.residual is not None and scene.missed is not None:
                row = row + np.eye(len(row))[load.residual]
            found.a[j], found.rest[j] = -load.mass * row, load.weight
            found.v[j], found.q[j] = -load.convective_mass * rate_row, -load.convective_mass * position_row
    return found


def springs(scene: Scene, t: float, side: Side, pressing: Forces) -> Forces:
    """S of all loads beside what they press with besides."""
    found, count = _none(scene), len(scene.loads)
    phases = [load.phase(t, side) for load in scene.loads]
    soft = np.zeros((count, count))
    for i, (one, phase) in enumerate(zip((load.sprung for load in scene.loads), phases, strict=True)):
        if one is None:
            continue
        row, slope = one.rows(scene, phase, t)
        found.v[i], found.q[i] = -one.damping * row, -one.stiffness * row - one.damping * slope
        found.rest[i] = -one.stiffness * one.level - one.damping * one.climb
        if scene.missed is not None and phase is not None:
            here = phase.s(t)
            for j, other in enumerate(phases):
                soft[i, j] = 0.0 if other is None else one.stiffness * scene.missed(here, other.s(t))
            for damper in scene.dampers:
                pushed = one.stiffness * scene.missed(here, damper.at) * damper.coefficient
                found.v[i] += pushed * damper.row
    together = (np.linalg.solve(np.eye(count) + soft, s - soft @ w) for s, w in zip(found, pressing, strict=True))
    return Forces(*together)


def driven(scene: Scene, t: float, side: Side, j: int) -> Array:
    """What a force of a load moves: phi, and of the masses with a y, where it has one itself, omega^2 R."""
    phase, load = scene.loads[j].phase(t, side), scene.loads[j]
    if phase is None:
        return np.zeros(len(scene.omega))
    found = scene.phi(phase.s(t), 0).copy()
    for other in scene.loads:
        there = other.phase(t, side)
        if scene.missed is not None and load.residual is not None and other.residual is not None and there is not None:
            found[other.residual] = scene.omega[other.residual] ** 2 * scene.missed(there.s(t), phase.s(t))
    return found


def _none(scene: Scene) -> Forces:
    shape = len(scene.loads), len(scene.omega)
    return Forces(np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape[0]))


def system(scene: Scene, t: float, side: Side) -> System:
    """The coupled matrices just before or just after t, assembled as in the module's docstring."""
    mass = np.eye(len(scene.omega)) if scene.modal_mass is None else np.diag(scene.modal_mass)
    damping = np.diag(2.0 * scene.zeta * scene.omega)
    stiffness = np.diag(scene.omega**2)
    force = np.zeros(len(scene.omega)) if scene.own_weight is None else scene.own_weight.copy()
    for damper in scene.dampers:
        damping = damping + damper.coefficient * np.outer(damper.row, damper.row)
    w = wheels(scene, t, side)
    s = springs(scene, t, side, w)
    for j, load in enumerate(scene.loads):
        phase, row = load.phase(t, side), np.zeros(len(scene.omega))
        if load.sprung is not None:
            row, _ = load.sprung.rows(scene, phase, t)
            mass[load.sprung.number, load.sprung.number] = load.sprung.mass
            force[load.sprung.number] += load.sprung.weight
        below = row if phase is None else driven(scene, t, side, j)
        mass = mass - np.outer(below, w.a[j]) - np.outer(row, s.a[j])
        damping = damping - np.outer(below, w.v[j]) - np.outer(row, s.v[j])
        stiffness = stiffness - np.outer(below, w.q[j]) - np.outer(row, s.q[j])
        force = force + below * w.rest[j] + row * s.rest[j]
        if load.sprung is not None and phase is not None:
            force = force + (below - scene.phi(phase.s(t), 0)) * load.sprung.weight
    return System(mass, damping, stiffness, force)


def acceleration(scene: Scene, t: float, state: State, side: Side) -> Array:
    """q'' consistent with the equations of motion at t, shape (N,)."""
    now = system(scene, t, side)
    solved: Array = np.linalg.solve(now.mass, now.force - now.damping @ state.v - now.stiffness @ state.q)
    return solved


def contact_forces(scene: Scene, t: float, state: State, a: Array, side: Side) -> Array:
    """Contact force of every load in N, 0 while it is off the body; shape (loads,)."""
    w = wheels(scene, t, side)
    s = springs(scene, t, side, w)
    on = np.array([load.active(t, side) for load in scene.loads], dtype=np.float64)
    forces = [one.a @ a + one.v @ state.v + one.q @ state.q + one.rest for one in (w, s)]
    return on * (forces[0] + forces[1])


def impulse(scene: Scene, t: float, state: State) -> Array:
    """Jump dq' at t by masses that arrive or reverse at once, shape (N,).

    A mass must end with the vertical speed phi.(q' + dq') + s'_after phi'.q. The mismatch to the speed it had is
    phi.q' + s' phi'.q - w'_before on arrival and (s'_after - s'_before) phi'.q on a reversal; momentum gives
    dq' = -(I + sum over all masses in contact of m phi phi^T)^-1 sum m phi mismatch.
    """
    momentum = np.zeros(len(scene.omega))
    for load in scene.loads:
        before, after = load.phase(t, "left"), load.phase(t, "right")
        if after is None:
            continue
        row, slope = scene.phi(after.s(t), 0), scene.phi(after.s(t), 1) @ state.q
        if before is None:
            convective = after.ds(t) * slope * (load.convective_mass > 0.0)
            momentum += load.mass * row * (row @ state.v + convective - load.arrival_speed)
        else:
            momentum += load.convective_mass * row * (after.ds(t) - before.ds(t)) * slope
    jump: Array = -np.linalg.solve(struck(scene, t), momentum)
    return jump


def struck(scene: Scene, t: float) -> Array:
    """M just after t of what an impulse moves, which no spring passes on."""
    return system(replace(scene, missed=None), t, "right").mass


def _jumps(before: Phase, after: Phase) -> bool:
    """Whether s' or s'' is discontinuous where two phases meet."""
    t = after.start
    speed = max(abs(before.ds(t)), abs(after.ds(t)), 1e-300)
    rate = max(abs(before.dds(t)), abs(after.dds(t)), speed / (after.end - after.start))
    return (
        abs(after.ds(t) - before.ds(t)) > RELATIVE_JUMP * speed
        or abs(after.dds(t) - before.dds(t)) > RELATIVE_JUMP * rate
    )


def events(scene: Scene) -> tuple[float, ...]:
    """Times of entry, exit and of every jump of s' or s'', ascending and without repetition."""
    times: set[float] = set()
    for load in scene.loads:
        times |= {load.enter, load.leave}
        times |= {b.start for a, b in pairwise(load.phases) if _jumps(a, b)}
    return tuple(sorted(times))


def rest(scene: Scene) -> State:
    """Undeformed and at rest, sprung masses as on rigid ground."""
    zero = np.zeros(len(scene.omega))
    q = zero.copy()
    for load in scene.loads:
        if load.sprung is not None:
            q[load.sprung.number] = load.sprung.weight / load.sprung.stiffness
    return State(q, zero)


def equilibrium(scene: Scene, t: float) -> State:
    """Static equilibrium with every load resting where it is just after t: K q = f without convective terms; q' = 0."""
    resting = [replace(load, phases=_still(load, t)) for load in scene.loads]
    now = system(replace(scene, loads=tuple(resting)), t, "right")
    return State(np.linalg.solve(now.stiffness, now.force), np.zeros(len(scene.omega)))


def _still(load: Load, t: float) -> tuple[Phase, ...]:
    """The load at rest where it is just after t, off the body where it is off."""
    phase = load.phase(t, "right")
    if phase is None:
        return (Phase(t - 2.0, t - 1.0, lambda u: 0.0, lambda u: 0.0, lambda u: 0.0),)
    place = phase.s(t)
    return (Phase(t, t + 1.0, lambda u: place, lambda u: 0.0, lambda u: 0.0),)
