"""Carriages in company once more: the differential equations of a whole scene as dense matrices, integrated by scipy.

Coordinates are the modes of all bodies. What a table's contact carries at rest on level ground comes from its own rigid
statics; forces, masses and tables may ride on any body, tables too. Only rigid tables, no static correction.
"""

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from engine.bodies.build import build_body
from engine.scene.motions.along_bodies import Cruise
from engine.scene.study import Study
from results_schema.arrays import Array

Touching = dict[tuple[str, int], bool]

ITSELF = -1  # in place of a contact's number: the carriage


class Company:
    """All carriages of a study. touching: which contacts touch their bodies between two events."""

    def __init__(self, study: Study) -> None:
        self.study, self.carriages = study, dict[str, Any](study.carriage)
        self.modal = {name: build_body(body) for name, body in study.body.items()}
        sizes = [modal.omega.size for modal in self.modal.values()]
        ends = np.cumsum([0, *sizes])
        self.slices = {name: slice(ends[i], ends[i + 1]) for i, name in enumerate(self.modal)}
        self.size = int(ends[-1])
        self.omega = np.concatenate([modal.omega for modal in self.modal.values()])
        ratios = [float(body.damping_ratio) for body in study.body.values()]  # type: ignore[arg-type]
        self.rate = 2.0 * np.repeat(ratios, sizes) * self.omega
        self.rest = {name: self._rest(c) for name, c in self.carriages.items() if c.kind == "body"}

    def _rest(self, carriage: Any) -> Array:
        """(K,) N at rest: heave and pitch of the table on its springs."""
        table: Any = self.study.body[carriage.body]
        arms = np.array([contact.at - table.centre_of_mass for contact in carriage.contacts.values()])
        stiffness = np.array([contact.stiffness for contact in carriage.contacts.values()])
        moves = np.stack([np.ones_like(arms), arms])
        sunk = np.linalg.lstsq((moves * stiffness) @ moves.T, [table.mass * self.study.gravity, 0.0], rcond=None)[0]
        return np.asarray(stiffness * (moves.T @ sunk))

    def way(self, carriage: Any, time: float) -> tuple[float, float, float, bool]:
        """Place, speed, acceleration, and whether it has set off and not yet gone."""
        motion, scale = carriage.motion, carriage.motion.time_scale
        tau = (time - carriage.start_time) / scale
        if 0.0 <= tau <= motion.duration:
            path = motion.path(tau)
            return float(path.S), float(path.dS) / scale, float(path.ddS) / scale**2, True
        place = float(motion.path(0.0 if tau < 0.0 else motion.duration).S)
        return place, 0.0, 0.0, not isinstance(motion, Cruise)

    def places(self, name: str) -> list[tuple[int, float]]:
        """Itself and its contacts, with how far ahead they are."""
        carriage = self.carriages[name]
        if carriage.kind != "body":
            return [(ITSELF, 0.0)]
        table: Any = self.study.body[carriage.body]
        reference = 0.5 * table.length if carriage.reference is None else carriage.reference
        contacts = carriage.contacts.values()
        return [(ITSELF, 0.0), *((i, contact.at - reference) for i, contact in enumerate(contacts))]

    def touching(self, time: float) -> Touching:
        found = {}
        for name, carriage in self.carriages.items():
            place, _, _, here = self.way(carriage, time)
            length = self.modal[carriage.on].length
            for contact, ahead in self.places(name):
                found[name, contact] = here and -1e-12 <= place + ahead <= length + 1e-12
        return found

    def row(self, body: str, place: float, derivative: int = 0) -> Array:
        """(N,) mode shapes of a body among all modes."""
        found, modal = np.zeros(self.size), self.modal[body]
        found[self.slices[body]] = modal.shape([min(max(place, 0.0), modal.length)], derivative)[0]
        return found

    def sag(self, body: str, place: float, derivative: int = 0) -> float:
        """A body's deflection under its own weight."""
        if not self.study.body[body].own_weight:
            return 0.0
        at = np.clip(np.array([place]), 0.0, self.modal[body].length)
        return float(self.study.gravity * self.modal[body].own_weight_deflection(at, derivative)[0])

    def contact(
        self, name: str, number: int, way: tuple[float, float], touching: Touching
    ) -> tuple[Array, Array, Array, float]:
        """A contact's rows: what its force pushes down, and its force as  on_x x + on_v v + own;  way: place, speed."""
        carriage, (place, speed) = self.carriages[name], way
        spring = list(carriage.contacts.values())[number]
        at, down, slope, level, tilt = place + dict(self.places(name))[number], np.zeros(self.size), 0.0, 0.0, 0.0
        if touching[name, number]:
            down, slope = self.row(carriage.on, at), self.row(carriage.on, at, 1)
            level, tilt = self.sag(carriage.on, at), speed * self.sag(carriage.on, at, 1)
        closing = self.row(carriage.body, spring.at) - down
        on_x = spring.stiffness * closing - spring.damping * speed * slope
        own = self.rest[name][number] - spring.stiffness * level - spring.damping * tilt
        return down, on_x, spring.damping * closing, own

    def matrices(self, time: float, touching: Touching, still: bool = False) -> tuple[Array, Array, Array, Array]:
        """M, C, K, f;  still: without speeds."""
        mass, damping, stiffness = np.eye(self.size), np.diag(self.rate), np.diag(self.omega**2)
        load = np.zeros(self.size)
        for name, carriage in self.carriages.items():
            place, speed, across, _ = self.way(carriage, time)
            speed, across = (0.0, 0.0) if still else (speed, across)
            if carriage.kind == "body":
                for number in range(len(carriage.contacts)):
                    down, on_x, on_v, own = self.contact(name, number, (place, speed), touching)
                    push = down - self.row(carriage.body, list(carriage.contacts.values())[number].at)
                    stiffness -= np.outer(push, on_x)
                    damping -= np.outer(push, on_v)
                    load += push * (own - self.rest[name][number]) + down * self.rest[name][number]
            elif touching[name, ITSELF]:
                shape, slope, bend = (self.row(carriage.on, place, order) for order in range(3))
                if carriage.kind == "force":
                    load += carriage.force * shape
                    continue
                sag = speed**2 * self.sag(carriage.on, place, 2) + across * self.sag(carriage.on, place, 1)
                mass += carriage.mass * np.outer(shape, shape)
                damping += carriage.mass * 2.0 * speed * np.outer(shape, slope)
                stiffness += carriage.mass * np.outer(shape, speed**2 * bend + across * slope)
                load += carriage.mass * (self.study.gravity - sag) * shape
        return mass, damping, stiffness, load

    def start(self) -> Array:
        """Displacements and velocities at time 0."""
        x = np.zeros(self.size)
        if self.study.start == "equilibrium":
            _, _, stiffness, load = self.matrices(0.0, self.touching(1e-12), still=True)
            x = np.linalg.lstsq(stiffness, load, rcond=1e-13)[0]
        else:
            for name, body in self.study.body.items():
                if body.own_weight:
                    modal = self.modal[name]
                    x[self.slices[name]] = -self.study.gravity * modal.participation / modal.omega**2
        return np.concatenate([x, np.zeros(self.size)])

    def arrive(self, state: Array, time: float, before: Touching, touching: Touching) -> None:
        """The impulse of a mass that comes to touch its body."""
        for name, carriage in self.carriages.items():
            if carriage.kind == "mass" and touching[name, ITSELF] and not before[name, ITSELF]:
                place, speed, _, _ = self.way(carriage, time + 1e-12)
                shape, slope = self.row(carriage.on, place), self.row(carriage.on, place, 1)
                x, v = state[: self.size], state[self.size :]
                jump = shape @ v + speed * (slope @ x + self.sag(carriage.on, place, 1))
                mass = self.matrices(time + 1e-12, touching)[0]
                v -= np.linalg.solve(mass, shape) * carriage.mass * jump

    def march(self, times: Array, events: list[float]) -> tuple[Array, list[Touching]]:
        """States (T, 2N) at ascending times, none of them an event but the first and the last, and what touches."""
        states, touching = np.empty((times.size, 2 * self.size)), []
        state, before = self.start(), {}
        for first, last in pairwise(events):
            now = self.touching(0.5 * (first + last))
            if before:
                self.arrive(state, first, before, now)
            before = now

            def rates(time: float, state: Array, ends: Any = (first, last), now: Touching = now) -> Array:
                inside = min(max(time, ends[0] + 1e-13), ends[1] - 1e-13)
                mass, damping, stiffness, load = self.matrices(inside, now)
                x, v = state[: self.size], state[self.size :]
                return np.concatenate([v, np.linalg.solve(mass, load - damping @ v - stiffness @ x)])

            here = np.flatnonzero((times >= first) & (times < last) | (times == last) & (last == events[-1]))
            wanted = np.unique([*times[here], last])
            found = solve_ivp(rates, (first, last), state, "DOP853", wanted, rtol=1e-7, atol=1e-10)
            states[here] = found.y[:, : here.size].T
            state = found.y[:, -1].copy()
            touching += [now] * here.size
        return states, touching

    def reads(self, sensor: Any, touching: Touching) -> bool:
        """Whether a sensor tells anything: a contact that is off its body does not."""
        if sensor.quantity == "displacement":
            return True
        contacts = list(getattr(self.carriages[sensor.carriage], "contacts", ()))
        return touching[sensor.carriage, contacts.index(sensor.contact) if contacts else ITSELF]

    def reading(self, sensor: Any, time: float, state: Array, touching: Touching) -> float:
        """What a sensor tells: a displacement at a place, or the contact force of a contact or of a mass."""
        x, v = state[: self.size], state[self.size :]
        if sensor.quantity == "displacement":
            return float(self.row(sensor.body, sensor.at) @ x + self.sag(sensor.body, sensor.at))
        carriage = self.carriages[sensor.carriage]
        if carriage.kind == "body":
            number = list(carriage.contacts).index(sensor.contact)
            _, on_x, on_v, own = self.contact(sensor.carriage, number, self.way(carriage, time)[:2], touching)
            return float(on_x @ x + on_v @ v + own)
        mass, damping, stiffness, load = self.matrices(time, touching)
        a = np.linalg.solve(mass, load - damping @ v - stiffness @ x)
        place, speed, across, _ = self.way(carriage, time)
        shape, slope, bend = (self.row(carriage.on, place, order) for order in range(3))
        rise = shape @ a + 2.0 * speed * slope @ v + (speed**2 * bend + across * slope) @ x
        sag = speed**2 * self.sag(carriage.on, place, 2) + across * self.sag(carriage.on, place, 1)
        return float(carriage.mass * (self.study.gravity - rise - sag))
