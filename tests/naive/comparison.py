"""The comparison schemes with dense matrices: one load, one variant, one solve per step."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from tests.naive.newmark import snapped
from tests.naive.scene import Array, Phase, Scene, State, acceleration, contact_forces, convective_rows, impulse


class Now(NamedTuple):
    """q, q', q'' (N,) at time t, and the contact force that acts there."""

    t: float
    q: Array
    v: Array
    a: Array
    force: float


class Contact(NamedTuple):
    """Rows of the contact at one instant: phi, 2 s' phi', s'^2 phi'' + s'' phi'."""

    phi: Array
    rate: Array
    curve: Array

    def motion(self, q: Array, v: Array, a: Array) -> float:
        """D2w."""
        return float(self.phi @ a + self.convective(q, v))

    def convective(self, q: Array, v: Array) -> float:
        """D2w without phi.q''."""
        return float(self.rate @ v + self.curve @ q)


class Single(NamedTuple):
    """The one load's phase during a step; its law is followed beyond its end."""

    scene: Scene
    phase: Phase

    @property
    def mass(self) -> float:
        """kg."""
        return self.scene.loads[0].mass

    @property
    def weight(self) -> float:
        """N."""
        return self.scene.loads[0].weight

    @property
    def damping(self) -> Array:
        """(N, N) of the body alone."""
        return np.diag(2.0 * self.scene.zeta * self.scene.omega)

    @property
    def stiffness(self) -> Array:
        """(N, N) of the body alone."""
        return np.diag(self.scene.omega**2)

    def at(self, t: float) -> Contact:
        """The contact's rows."""
        return Contact(*convective_rows(self.scene.phi, self.phase, t))

    def coupled(self, contact: Contact) -> tuple[Array, Array, Array]:
        """M, C, K with the load."""
        m, phi = self.mass, contact.phi
        return (
            np.eye(phi.size) + m * np.outer(phi, phi),
            self.damping + m * np.outer(phi, contact.rate),
            self.stiffness + m * np.outer(phi, contact.curve),
        )

    def slope(self, t: float, q: Array, v: Array) -> Array:
        """q''."""
        contact = self.at(t)
        m, c, k = self.coupled(contact)
        found: Array = np.linalg.solve(m, contact.phi * self.weight - c @ v - k @ q)
        return found

    def settled(self, t: float, q: Array, v: Array, a: Array) -> Now:
        """With the force m (g - D2w)."""
        return Now(t, q, v, a, self.weight - self.mass * self.at(t).motion(q, v, a))


Step = Callable[[Single, Now, float], Now]


def march(scene: Scene, times: Sequence[float] | Array, start: State, step: Step) -> list[Now]:
    """All instants; at an inner event the values just after it."""
    t, inner = snapped(scene, times)

    def fresh(n: int, state: State) -> Now:
        a = acceleration(scene, t[n], state, "right")
        return Now(t[n], *state, a, float(contact_forces(scene, t[n], state, a, "right")[0]))

    found = [fresh(0, start)]
    for n in range(1, len(t)):
        phase = scene.loads[0].phase(0.5 * (t[n - 1] + t[n]), "left")
        assert phase is not None
        now = step(Single(scene, phase), found[-1], t[n] - t[n - 1])._replace(t=t[n])
        if n in inner:
            state = State(now.q, now.v)
            now = fresh(n, State(now.q, now.v + impulse(scene, t[n], state)))
        found.append(now)
    return found


def wilson(theta: float) -> Step:
    """Linear acceleration over theta h, equilibrium at its end."""

    def step(single: Single, now: Now, h: float) -> Now:
        tau = theta * h
        contact = single.at(now.t + tau)
        m, c, k = single.coupled(contact)
        known = contact.phi * single.weight - c @ (now.v + 0.5 * tau * now.a)
        known = known - k @ (now.q + tau * now.v + tau**2 / 3.0 * now.a)
        reached = np.linalg.solve(m + 0.5 * tau * c + tau**2 / 6.0 * k, known)
        a = now.a + (reached - now.a) / theta
        q = now.q + h * now.v + h**2 * (now.a / 3.0 + a / 6.0)
        return single.settled(now.t + h, q, now.v + 0.5 * h * (now.a + a), a)

    return step


def rk4(single: Single, now: Now, h: float) -> Now:
    """Kutta's classic method."""
    y, n = np.concatenate([now.q, now.v]), now.q.size

    def slope(t: float, y: Array) -> Array:
        return np.concatenate([y[n:], single.slope(t, y[:n], y[n:])])

    k1 = slope(now.t, y)
    k2 = slope(now.t + 0.5 * h, y + 0.5 * h * k1)
    k3 = slope(now.t + 0.5 * h, y + 0.5 * h * k2)
    k4 = slope(now.t + h, y + h * k3)
    y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return single.settled(now.t + h, y[:n], y[n:], single.slope(now.t + h, y[:n], y[n:]))


def _average(single: Single, now: Now, h: float, inertia: Array, push: Array) -> tuple[Array, Array, Array]:
    """Average acceleration of the body with a mass matrix under a given modal force."""
    q, v = now.q + h * now.v + 0.25 * h**2 * now.a, now.v + 0.5 * h * now.a
    left = inertia + 0.5 * h * single.damping + 0.25 * h**2 * single.stiffness
    a = np.linalg.solve(left, push - single.damping @ v - single.stiffness @ q)
    return q + 0.25 * h**2 * a, v + 0.5 * h * a, a


def lagged_inertia(single: Single, now: Now, h: float) -> Now:
    """The force of the last state on the modes of the new place."""
    force = single.weight - single.mass * single.at(now.t).motion(now.q, now.v, now.a)
    phi = single.at(now.t + h).phi
    return Now(now.t + h, *_average(single, now, h, np.eye(phi.size), phi * force), force)


def lagged_convective(single: Single, now: Now, h: float) -> Now:
    """The convective terms of the last state."""
    phi = single.at(now.t + h).phi
    force = single.weight - single.mass * single.at(now.t).convective(now.q, now.v)
    q, v, a = _average(single, now, h, np.eye(phi.size) + single.mass * np.outer(phi, phi), phi * force)
    return Now(now.t + h, q, v, a, force - single.mass * float(phi @ a))


def picard(counts: list[int], relaxed: bool, tolerance: float = 1e-12, most: int = 50) -> Step:
    """Average acceleration of the body under a force that is put in anew until it stands; counts get the numbers."""

    def step(single: Single, now: Now, h: float) -> Now:
        contact = single.at(now.t + h)
        one = np.eye(now.q.size)
        diagonal = 1.0 + 0.5 * h * np.diag(single.damping) + 0.25 * h**2 * np.diag(single.stiffness)
        share = 1.0 / (1.0 + single.mass * np.sum(contact.phi**2 / diagonal)) if relaxed else 1.0
        force = single.weight - single.mass * single.at(now.t).motion(now.q, now.v, now.a)
        for count in range(1, most + 1):
            motion = contact.motion(*_average(single, now, h, one, contact.phi * force))
            change = share * (single.weight - single.mass * motion - force)
            force += change
            if abs(change) <= tolerance * max(single.weight, abs(force)):
                counts.append(count)
                return Now(now.t + h, *_average(single, now, h, one, contact.phi * force), force)
        raise RuntimeError("no convergence")

    return step


class Rigid:
    """The mass as a body of its own, held to the contact point at every instant; generalized-alpha in its textbook
    form (Arnold and Bruels 2007), average acceleration with m = f = 0."""

    def __init__(self, scene: Scene, alpha_m: float = 0.0, alpha_f: float = 0.0) -> None:
        self.scene, self.alpha_m, self.alpha_f = scene, alpha_m, alpha_f
        self.own: tuple[Array, Array, Array, Array] | None = None

    def step(self, single: Single, now: Now, h: float) -> Now:
        """One step: modes and the mass in one vector, one multiplier."""
        m, f = self.alpha_m, self.alpha_f
        gamma, beta = 0.5 - m + f, 0.25 * (1.0 - m + f) ** 2
        if self.own is None or not np.array_equal(self.own[1][:-1], now.v):  # at the start and after an impulse
            at = single.at(now.t)
            q = np.append(now.q, at.phi @ now.q)
            v = np.append(now.v, at.phi @ now.v + 0.5 * at.rate @ now.q)
            x = np.append(now.a, at.motion(now.q, now.v, now.a))
            self.own = (q, v, x, x)
        q, v, x, a = self.own
        n = now.q.size
        phi = single.at(now.t + h).phi
        inertia = np.diag(np.append(np.ones(n), single.mass))
        c, k = np.diag(np.append(np.diag(single.damping), 0.0)), np.diag(np.append(np.diag(single.stiffness), 0.0))
        gap = np.append(phi, -1.0)
        # a_new = kappa x_new + known
        kappa, known = (1.0 - f) / (1.0 - m), (f * x - m * a) / (1.0 - m)
        q_known = q + h * v + h**2 * ((0.5 - beta) * a + beta * known)
        v_known = v + h * ((1.0 - gamma) * a + gamma * known)
        whole = np.zeros((n + 2, n + 2))
        whole[: n + 1, : n + 1] = inertia + kappa * gamma * h * c + kappa * beta * h**2 * k
        whole[: n + 1, n + 1], whole[n + 1, : n + 1] = -gap, gap
        weight = np.append(np.zeros(n), single.weight)
        right = np.append(weight - c @ v_known - k @ q_known, -gap @ q_known / (kappa * beta * h**2))
        solved = np.linalg.solve(whole, right)
        x, force = solved[: n + 1], float(solved[n + 1])
        a = kappa * x + known
        q, v = q_known + beta * h**2 * kappa * x, v_known + gamma * h * kappa * x
        self.own = (q, v, x, a)
        return Now(now.t + h, q[:n], v[:n], x[:n], force)
