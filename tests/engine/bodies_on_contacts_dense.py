"""Bodies on contacts once more, as dense saddle systems in SI units: nothing of the engine's ties, rows or kernels.

Any number of bodies, carried by any others. Modes come from the modal bodies and stations from the timeline, which have
tests of their own. With the places p of what each tie presses and holds, the unknowns of every step are the
accelerations and the ties' forces together:

    M x'' + C x' + K x = f + P F
    contact:  F + k (P^T x + level + R (F, P0)) + c d/dt (P^T x + level) = 0, beyond P0, its load on level ground
    mass:     F + m (D^2(p^T x + level) + y'') = m g;  rigid contact:  D^2(P^T x + level) = 0

y of every mass, a coordinate of its own, is what the kept modes miss of the deflection under it by all masses:
    y'' + 2 zeta omega y' + omega^2 y = omega^2 R F, omega the highest frequency kept
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from engine.bodies.build import build_body
from engine.bodies.modal.modal_body import ModalBody
from engine.model.lane_table import RESIDUAL_DAMPING
from engine.scene.study import Study
from results_schema.arrays import Array

Place = float | str

EDGE = 1e-13  # m, by which a station at an event belongs to its own side


class Hold(NamedTuple):
    """A place of a body where a force acts with a factor."""

    body: str
    place: Place
    factor: float


@dataclass
class Tie:
    """A contact, or a mass or force on the track: what it presses, `ahead` m of its carriage, and what it carries at
    rest on level ground (N), of a mass or force all that it weighs."""

    carriage: str
    below: str
    ahead: float
    rides: str = ""
    place: Place = 0.0
    stiffness: float | str = 0.0
    damping: float = 0.0
    mass: float = 0.0
    at_rest: float = 0.0


@dataclass
class Way:
    """Places of a carriage and their derivatives by time at some instants, and whether it is there."""

    s: Array
    ds: Array
    dds: Array
    present: bool


Where = dict[str, tuple[float, float, float, bool]]  # by carriage: s, s', s'' and whether it is there


class Law(NamedTuple):
    """A x'' + B x' + K x + E F = b of the ties, their loads P (N, T), and constant loads f (N,)."""

    a: Array
    v: Array
    x: Array
    own: Array
    right: Array
    loads: Array
    dead: Array


class Twin:
    """A scene of bodies, bodies that ride on contacts, masses and forces."""

    def __init__(self, study: Study) -> None:
        self.study, self.residual = study, study.solver.static_correction
        used = {name for carriage in study.carriage.values() for name in carriage.bodies}
        self.body: dict[str, ModalBody] = {n: build_body(b) for n, b in study.body.items() if n in used}
        self.part: dict[str, slice] = {}
        first = 0
        for name, body in self.body.items():
            self.part[name] = slice(first, first + body.omega.size)
            first += body.omega.size
        self.omega = np.concatenate([body.omega for body in self.body.values()])
        ratios = [np.full(body.omega.size, study.body[n].damping_ratio) for n, body in self.body.items()]
        self.rates = 2.0 * np.concatenate(ratios) * self.omega
        self._between: dict[tuple[str, Place, Place], float] = {}
        self.ties = [tie for name, spec in study.carriage.items() for tie in self._ties(name, spec)]
        self.dead = np.array([tie.at_rest if tie.rides else 0.0 for tie in self.ties])
        self.heavy = [t for t, tie in enumerate(self.ties) if tie.mass > 0.0 and self.residual]
        for last in (self.part[self.ties[t].below].stop - 1 for t in self.heavy):
            highest = self.omega[last]
            self.rates = np.append(self.rates, self.rates[last] + 2.0 * RESIDUAL_DAMPING * highest)
            self.omega = np.append(self.omega, highest)

    def _ties(self, name: str, spec: Any) -> list[Tie]:
        if spec.kind != "body":
            mass = getattr(spec, "mass", 0.0)
            return [Tie(name, spec.on, 0.0, mass=mass, at_rest=getattr(spec, "force", mass * self.study.gravity))]
        rides = self.body[spec.body]
        reference = 0.5 * rides.length if spec.reference is None else spec.reference
        found = []
        for contact in spec.contacts.values():
            ahead = contact.at - reference if contact.offset is None else contact.offset
            place = f"point.{contact.point}" if contact.at is None else contact.at
            below = spec.on if contact.on is None else contact.on
            found.append(Tie(name, below, ahead, spec.body, place, contact.stiffness, contact.damping))
        rigid = rides.omega == 0.0
        free = np.array([self._fixed(spec.body, tie.place)[rigid] for tie in found])
        holds = [Hold(spec.body, tie.place, 1.0) for tie in found]
        own = [0.0 if tie.stiffness == "rigid" else 1.0 / float(tie.stiffness) for tie in found]
        soft = self._flexibility(holds, rest=False) + np.diag(own)
        whole = np.block([[soft, -free], [free.T, np.zeros((free.shape[1],) * 2)]])
        right = np.concatenate([np.zeros(len(found)), rides.participation[rigid] * self.study.gravity])
        for tie, force in zip(found, np.linalg.lstsq(whole, right, rcond=1e-13)[0], strict=False):
            tie.at_rest = float(force)
        return found

    def _fixed(self, body: str, place: Place) -> Array:
        modal = self.body[body]
        return np.asarray(modal.points.row(place) if isinstance(place, str) else modal.shape([place])[0])  # type: ignore[union-attr]

    def _flexibility(self, holds: list[Hold], rest: bool) -> Array:
        """(H, H) m/N between places, or what the kept modes miss of it."""
        found, rows = np.zeros((len(holds), len(holds))), [self._fixed(hold.body, hold.place) for hold in holds]
        for i, one in enumerate(holds):
            for j, other in enumerate(holds[: i + 1]):
                if one.body != other.body or (rest and not self.residual):
                    continue
                omega = self.body[one.body].omega
                soft = np.divide(1.0, omega**2, out=np.zeros(omega.size), where=omega > 0.0)
                kept = np.sum(rows[i] * soft * rows[j])
                whole = self._whole(one.body, one.place, other.place) if self.residual else kept
                found[i, j] = found[j, i] = one.factor * other.factor * (whole - kept if rest else whole)
        return found

    def _whole(self, body: str, one: Place, other: Place) -> float:
        key = (body, *sorted((one, other), key=str))
        if key not in self._between:
            self._between[key] = _between(self.body[body], key[1], key[2])
        return self._between[key]

    def level(self, body: str, place: float, derivative: int) -> float:
        """The own sag of a body."""
        if not self.study.body[body].own_weight:
            return 0.0
        return float(self.study.gravity * self.body[body].own_weight_deflection([place], derivative)[0])

    def law(self, where: Where, still: bool = False) -> Law:
        """What the ties say with every carriage at s, s', s''; still: of rigid contacts the gap, not how it closes."""
        n, count = self.omega.size, len(self.ties)
        a, v, x, own, right = np.zeros((count, n)), np.zeros((count, n)), np.zeros((count, n)), np.eye(count), []
        loads, dead = np.zeros((n, count)), np.zeros(n)
        pressed, ridden = self.holds(where)
        missed = self._flexibility([*pressed, *ridden], rest=True)
        on_force = missed[:count, :count] + missed[count:, count:] + missed[:count, count:] + missed[count:, :count]
        on_rest = (missed[:count, :count] + missed[count:, :count]) @ self.dead
        for t, tie in enumerate(self.ties):
            s, ds, dds, _ = where[tie.carriage]
            on, place = pressed[t].factor, min(max(s + tie.ahead, 0.0), self.body[tie.below].length)
            p0, p1, p2 = np.zeros((3, n))
            for order, row in enumerate((p0, p1, p2)):
                row[self.part[tie.below]] = on * self.body[tie.below].shape([place], order)[0]
            sag, tilt, curve = (on * self.level(tie.below, place, order) for order in range(3))
            if tie.rides:
                dead += p0 * tie.at_rest
                wide = p0.copy()
                wide[self.part[tie.rides]] -= self._fixed(tie.rides, tie.place)
                loads[:, t] = wide
                if tie.stiffness == "rigid":
                    own[t, t] = 0.0
                    a[t], v[t], x[t] = wide, 2.0 * ds * p1, wide if still else ds**2 * p2 + dds * p1
                    right.append(-sag if still else -(ds**2) * curve - dds * tilt)
                    continue
                k, c = float(tie.stiffness), tie.damping
                v[t], x[t] = c * wide, k * wide + c * ds * p1
                own[t] += k * on_force[t]
                right.append(-k * (sag + on_rest[t]) - c * ds * tilt)
            else:
                m = tie.mass
                a[t], v[t], x[t], loads[:, t] = m * p0, 2.0 * m * ds * p1, m * (ds**2 * p2 + dds * p1), p0
                right.append(on * tie.at_rest - m * (ds**2 * curve + dds * tilt))
        for y, t in enumerate(self.heavy, start=n - len(self.heavy)):
            a[t, y] = self.ties[t].mass
            loads[y, self.heavy] = self.omega[y] ** 2 * missed[t, self.heavy]
        return Law(a, v, x, own, np.array(right), loads, dead)

    def holds(self, where: Where) -> tuple[list[Hold], list[Hold]]:
        """Where every tie presses the body below, with factor 0 off it, and where it lifts the body that rides."""
        pressed, ridden = [], []
        for tie in self.ties:
            s, _, _, present = where[tie.carriage]
            place, length = s + tie.ahead, self.body[tie.below].length
            on = float(present and 0.0 <= place <= length)
            pressed.append(Hold(tie.below, min(max(place, 0.0), length), on))
            ridden.append(Hold(tie.rides or tie.below, tie.place if tie.rides else 0.0, -1.0 if tie.rides else 0.0))
        return pressed, ridden

    def static(self, places: dict[str, float] | float) -> tuple[Array, Array]:
        """Coordinates, and the forces of all ties at rest."""
        first = next(iter(self.study.carriage))
        given = places if isinstance(places, dict) else {first: places}
        law = self.law({name: (s, 0.0, 0.0, True) for name, s in given.items()}, still=True)
        size = np.maximum(np.abs(law.x).max(axis=1), 1.0)[:, None]
        whole = np.block([[np.diag(self.omega**2), -law.loads], [law.x / size, law.own / size]])
        right = np.concatenate([law.dead, law.right / size[:, 0]])
        found = np.linalg.lstsq(whole, right, rcond=1e-14)[0]
        return found[: self.omega.size], self._total(found[self.omega.size :])

    def _total(self, force: Array) -> Array:
        return force + self.dead

    def march(self, segments: Any, time_scale: float) -> tuple[Array, Array, list[Where]]:
        """Coordinates (H, N), forces of all ties (H, T) and places at all stations of some segments, from the start."""
        n, count = self.omega.size, len(self.ties)
        starts = {name: float(spec.motion.path(0.0).S) for name, spec in self.study.carriage.items()}
        x = self.static(starts)[0] if self.study.start == "equilibrium" else np.zeros(n)
        v, found, forces, wheres = np.zeros(n), [], [], []
        for segment in segments:
            ways = {name: self._way(name, segment, time_scale) for name in self.study.carriage}
            h, a = time_scale * (segment.end - segment.start) / segment.steps, np.zeros(n)
            for j in range(segment.steps + 1):
                where = {name: _at(way, j, segment.steps) for name, way in ways.items()}
                law, step = self.law(where), h if j else 0.0
                u, w = x + step * v + 0.25 * step**2 * a, v + 0.5 * step * a
                matrix = np.zeros((n + count, n + count))
                matrix[:n, :n] = np.diag(1.0 + 0.5 * step * self.rates + 0.25 * step**2 * self.omega**2)
                matrix[:n, n:] = -law.loads
                matrix[n:, :n] = law.a + 0.5 * step * law.v + 0.25 * step**2 * law.x
                matrix[n:, n:] = law.own
                right = np.concatenate(
                    [law.dead - self.rates * w - self.omega**2 * u, law.right - law.v @ w - law.x @ u]
                )
                solved = np.linalg.solve(matrix, right)
                a = solved[:n]
                x, v = u + 0.25 * step**2 * a, w + 0.5 * step * a
                found.append(x)
                forces.append(self._total(solved[n:]))
                wheres.append(where)
        return np.array(found), np.array(forces), wheres

    def _way(self, name: str, segment: Any, time_scale: float) -> Way:
        """A carriage at the stations of a segment."""
        spec: Any = self.study.carriage[name]
        motion, scale = spec.motion, spec.motion.time_scale
        first, last = (
            _event(motion, (time_scale * tau - spec.start_time) / scale) for tau in (segment.start, segment.end)
        )
        if not 0.0 < 0.5 * (first + last) < motion.duration:
            s = float(motion.path(np.clip(first, 0.0, motion.duration)).S)
            still = np.zeros(segment.steps + 1)
            return Way(still + s, still, still, motion.kind != "cruise")
        path = motion.path_on(np.linspace(first, last, segment.steps + 1), first, last)
        return Way(path.S, path.dS / scale, path.ddS / scale**2, True)

    def displacement(self, body: str, at: float, x: Array, forces: Array, where: Where) -> float:
        """m at a place of a body at one station, with what the kept modes miss, from the body's own sag or rest."""
        pressed, ridden = self.holds(where)
        missed = self._flexibility([Hold(body, at, 1.0), *pressed, *ridden], rest=True)[0, 1:]
        kept = self._fixed(body, at) @ x[self.part[body]]
        return float(kept + missed @ np.concatenate([forces, forces - self.dead]) + self.level(body, at, 0))


def _at(way: Way, j: int, steps: int) -> tuple[float, float, float, bool]:
    edge = EDGE if j == 0 else -EDGE if j == steps else 0.0
    return float(way.s[j] + edge * np.sign(way.ds[j])), float(way.ds[j]), float(way.dds[j]), way.present


def _event(motion: Any, tau: float) -> float:
    """A motion's own time; exactly that of an event where it is one but for rounding."""
    events = [0.0, *motion.breaks(), motion.duration]
    return next((float(event) for event in events if abs(event - tau) < 1e-9), tau)


def _between(body: ModalBody, one: Place, other: Place) -> float:
    """m/N between two places of a body."""
    if isinstance(one, str) and isinstance(other, str):
        return body.points.between(one, other)  # type: ignore[union-attr]
    if isinstance(one, str):
        return float(body.points.influence(one, [other])[0])  # type: ignore[union-attr]
    if isinstance(other, str):
        return float(body.points.influence(other, [one])[0])  # type: ignore[union-attr]
    return float(body.influence([one], [other])[0, 0])
