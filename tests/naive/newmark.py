"""Newmark's method with dense matrices, one solve per step."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from tests.naive.scene import (
    Array,
    Scene,
    Side,
    State,
    acceleration,
    contact_forces,
    events,
    impulse,
    system,
)

At = Callable[[float, Side], Scene]
Strike = Callable[[float, State], Array]


class Newmark(NamedTuple):
    """Parameters of the scheme; the default is average acceleration. scaled_from: as of `slowed`."""

    beta: float = 0.25
    gamma: float = 0.5
    scaled_from: float = math.inf


class GeneralizedAlpha(NamedTuple):
    """Parameters alpha_m, alpha_f of Chung and Hulbert (1993); (0, -alpha) is Hilber, Hughes and Taylor's scheme."""

    m: float
    f: float


class Event(NamedTuple):
    """What the histories do not show: the values just before an event at instant number `step`."""

    step: int
    t: float
    v: Array
    a: Array
    contact_force: Array


@dataclass(frozen=True)
class History:
    """Everything at every instant t (S,).

    q, v, a: (S, N). contact_force: (S, loads), N, 0 off the body. position, w_under: (S, loads), m, NaN off the body.
    At an event all of it is the limit from the right (after the impulse); `before` keeps the limits from the left. An
    event at the last instant is not carried out: there the values are limits from the left.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    contact_force: Array
    position: Array
    w_under: Array
    before: tuple[Event, ...]

    def displacement(self, row: Array) -> Array:
        """Displacement (S,) where the modes have the row (N,)."""
        return self.q @ row


def grid(scene: Scene, start: float, end: float, steps: int) -> Array:
    """About `steps` equal steps between start and end, with every event of the scene exactly on an instant."""
    marks = [start, *(t for t in events(scene) if start < t < end), end]
    pieces = [np.linspace(a, b, max(1, round(steps * (b - a) / (end - start))) + 1)[:-1] for a, b in pairwise(marks)]
    return np.concatenate([*pieces, [end]])


def snapped(scene: Scene, times: Sequence[float] | Array) -> tuple[Array, set[int]]:
    """The instants with events put exactly on them, and the indices of inner events.

    Raises ValueError where an event lies between two instants.
    """
    t = np.array(times, dtype=np.float64)
    inner: set[int] = set()
    for event in events(scene):
        if not t[0] - 1e-12 <= event <= t[-1] + 1e-12:
            continue
        index = int(np.argmin(np.abs(t - event)))
        if abs(t[index] - event) > 1e-9 * (t[-1] - t[0]):
            raise ValueError(f"event at t = {event} s is not an instant of the grid")
        t[index] = event
        if 0 < index < len(t) - 1:
            inner.add(index)
    return t, inner


def collect(
    scene: Scene, t: Array, states: Sequence[State], a: Sequence[Array], before: Sequence[Event], at: At | None = None
) -> History:
    """Histories with contact forces, positions and displacements under the loads."""
    last = len(t) - 1
    sides: list[Side] = ["right" if n < last else "left" for n in range(len(t))]
    now = [scene if at is None else at(*one) for one in zip(t, sides, strict=True)]
    force = np.array([contact_forces(*one) for one in zip(now, t, states, a, sides, strict=True)])
    force = force.reshape(len(t), len(scene.loads))
    position = np.full_like(force, np.nan)
    under = np.full_like(force, np.nan)
    for n, side in enumerate(sides):
        for j, load in enumerate(scene.loads):
            phase = load.phase(t[n], side)
            if phase is not None:
                position[n, j] = phase.s(t[n])
                under[n, j] = scene.phi(position[n, j], 0) @ states[n].q
    q, v = np.array([s.q for s in states]), np.array([s.v for s in states])
    return History(t, q, v, np.array(a), force, position, under, tuple(before))


def slowed(scene: Scene, scheme: Newmark | GeneralizedAlpha, h: float) -> Scene:
    """The scene whose modes with omega h beyond ``scaled_from`` have so much more mass that it is this, their stiffness
    and damping the same."""
    if not isinstance(scheme, Newmark) or math.isinf(scheme.scaled_from):
        return scene
    times = np.maximum(1.0, scene.omega * h / scheme.scaled_from)
    return replace(scene, modal_mass=times**2)


def velocity_after(
    scene: Scene, scheme: Newmark | GeneralizedAlpha, t: float, v: Array, h: tuple[float | None, float]
) -> Array:
    """q' just after t of a scheme with masses of `slowed`, whose step before and after is h: modes swing on as far as
    they did, and by r/omega^3 about what grows at the rate r."""
    if not isinstance(scheme, Newmark) or math.isinf(scheme.scaled_from):
        return v
    found = v.copy()
    for step, side, sign in ((h[0], "left", -1), (h[1], "right", 1)):
        if step is None:
            continue
        rate = np.zeros_like(scene.omega)
        for phase, load in ((load.phase(t, side), load) for load in scene.loads):
            if phase is not None:
                weight = load.weight + (0.0 if load.sprung is None else load.sprung.weight)
                rate += weight * phase.ds(t) * scene.phi(phase.s(t), 1)
        omega = np.where(scene.omega > 0.0, scene.omega, 1e-9)  # sprung masses feel no rate
        seen = np.minimum(omega * step, scheme.scaled_from)
        part = seen / (omega * step) * np.sqrt(1.0 - seen**2 / 6.0)
        beyond = rate / omega**2 * (1.0 - part)
        if sign < 0:
            found, before = found - beyond, part
        else:
            kept = np.ones_like(part) if h[0] is None else part / before
            kept[[load.residual for load in scene.loads if load.residual is not None]] = 1.0
            found = found * kept + beyond
    return found


def _weights(scheme: Newmark | GeneralizedAlpha) -> tuple[float, float, float, float]:
    """beta, gamma, alpha_m, alpha_f."""
    if isinstance(scheme, Newmark):
        return scheme.beta, scheme.gamma, 0.0, 0.0
    m, f = scheme
    return 0.25 * (1.0 - m + f) ** 2, 0.5 - m + f, m, f


def march(
    scene: Scene,
    times: Sequence[float] | Array,
    start: State,
    scheme: Newmark | GeneralizedAlpha | None = None,
    at: At | None = None,
    strike: Strike | None = None,
) -> History:
    """The march over the instants `times` (S,) from `start`, which holds just after times[0] (no impulse there).

    Generalized-alpha by Arnold and Bruels (2007), of which Newmark's methods are those with m = f = 0: true
    accelerations q'' that satisfy the equations of motion at every instant, with matrices just before it, and auxiliary
    ones a from (1 - m) a_new + m a = (1 - f) q''_new + f q'', in q = u* + beta h^2 a_new, q' = v* + gamma h a_new. Both
    unknown accelerations are solved for at once. At an event the impulse is added and q'' computed anew with the
    matrices just after it. at, strike: the scene of an instant and the impulse where they are not the scene's own.
    """
    at, scheme = at or (lambda t, side: scene), scheme or Newmark()
    beta, gamma, m_, f_ = _weights(scheme)
    t, inner = snapped(scene, times)
    steps = np.append(np.diff(t), t[-1] - t[-2])
    n_modes, one = len(scene.omega), np.eye(len(scene.omega))
    v = velocity_after(scene, scheme, t[0], start.v, (None, steps[0]))
    states, true, before = [start], [acceleration(at(t[0], "right"), t[0], start, "right")], []
    a = acceleration(slowed(at(t[0], "right"), scheme, steps[0]), t[0], State(start.q, v), "right")
    for n in range(1, len(t)):
        h, q = steps[n - 1], states[-1].q
        here, there = slowed(at(t[n], "left"), scheme, h), slowed(at(t[n], "right"), scheme, steps[n])
        u_star = q + h * v + (0.5 - beta) * h**2 * a
        v_star = v + (1.0 - gamma) * h * a
        m, c, k, f = system(here, t[n], "left")
        both = np.block([[m, gamma * h * c + beta * h**2 * k], [-(1.0 - f_) * one, (1.0 - m_) * one]])
        x = np.linalg.solve(both, np.concatenate([f - c @ v_star - k @ u_star, f_ * true[-1] - m_ * a]))
        now, a = x[:n_modes], x[n_modes:]
        v = v_star + gamma * h * a
        state = State(u_star + beta * h**2 * a, v)
        if n in inner:
            before.append(Event(n, t[n], state.v, now, contact_forces(here, t[n], state, now, "left")))
            blow = impulse(slowed(scene, scheme, steps[n]), t[n], state) if strike is None else strike(t[n], state)
            state = State(state.q, state.v + blow)
            now = a = acceleration(at(t[n], "right"), t[n], state, "right")
            v = velocity_after(scene, scheme, t[n], v, (h, steps[n])) + blow
        elif not math.isclose(h, steps[n]):
            v = velocity_after(scene, scheme, t[n], v, (h, steps[n]))
        if there.modal_mass is not None and (n in inner or not math.isclose(h, steps[n])):
            a = acceleration(there, t[n], State(state.q, v), "right")
        states.append(state)
        true.append(now)
    return collect(scene, t, states, true, before, at)
