"""Bodies on contacts once more, as dense saddle systems in SI units: nothing of the engine's ties, rows or kernels.

Modes come from the modal bodies and stations from the timeline, which have tests of their own. Every step solves

    M x'' + C x' + K x = f + P F,    F = P0 - k (P^T x + level + R (F - P0)) - c (P^T x' + s' P_s^T x + level')

for the accelerations and the contact forces together, with P0 what the contact carries at rest on level ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.bodies.build import build_body
from engine.bodies.modal.modal_body import ModalBody
from engine.scene.study import Study

Array = NDArray[np.float64]

EDGE = 1e-13  # m, by which a station at an event belongs to its own side


@dataclass
class Contact:
    """A contact: its place ahead of the reference, its row on the body that rides, and spring and damper."""

    ahead: float
    row: Array
    place: Array | str
    stiffness: float
    damping: float


class Twin:
    """One body that rides on one bed."""

    def __init__(self, study: Study) -> None:
        (self.name, carriage), *_ = study.carriage.items()
        spec: Any = carriage
        self.study, self.motion = study, spec.motion
        self.bed, self.table = (build_body(study.body[name]) for name in (spec.on, spec.body))
        self.own_weight = study.body[spec.on].own_weight
        reference = 0.5 * self.table.length if spec.reference is None else spec.reference
        self.contacts = []
        for contact in spec.contacts.values():
            if contact.at is None:
                place: Array | str = f"point.{contact.point}"
                row, ahead = self.table.points.row(place), contact.offset  # type: ignore[union-attr]
            else:
                place = np.array([contact.at])
                row, ahead = self.table.shape(place)[0], contact.at - reference
            self.contacts.append(Contact(ahead, row, place, contact.stiffness, contact.damping))
        self.residual = study.solver.static_correction
        self.nb, self.nt = self.bed.omega.size, self.table.omega.size
        self.at_rest = self._at_rest()

    @property
    def weight(self) -> float:
        return float(self.table.mass * self.study.gravity)

    def _table_flexibility(self) -> Array:
        soft = np.divide(1.0, self.table.omega**2, out=np.zeros(self.nt), where=self.table.omega > 0.0)
        if not self.residual:
            return np.array([[np.sum(a.row * soft * b.row) for b in self.contacts] for a in self.contacts])
        return np.array([[_between(self.table, a.place, b.place) for b in self.contacts] for a in self.contacts])

    def _at_rest(self) -> Array:
        """Forces at rest on level ground: springs against all motions of the table, the free ones kept by a whisper."""
        count = len(self.contacts)
        rigid = self.table.omega == 0.0
        free = np.array([c.row[rigid] for c in self.contacts])
        soft = self._table_flexibility() + np.diag([1.0 / c.stiffness for c in self.contacts])
        whole = np.block([[soft, -free], [free.T, np.zeros((free.shape[1],) * 2)]])
        right = np.concatenate([np.zeros(count), self.table.participation[rigid] * self.study.gravity])
        return np.linalg.lstsq(whole, right, rcond=None)[0][:count]

    def rows(self, s: float) -> tuple[Array, Array, Array, Array, Array]:
        """P (N, R), P by s, level, level by s, and residual flexibility (R, R), the reference at s."""
        n, count = self.nb + self.nt, len(self.contacts)
        shape, slope = np.zeros((n, count)), np.zeros((n, count))
        level, tilt, missed = np.zeros(count), np.zeros(count), np.zeros((count, count))
        places = np.array([s + c.ahead for c in self.contacts])
        on = (places >= 0.0) & (places <= self.bed.length)
        for r, contact in enumerate(self.contacts):
            shape[self.nb :, r] = -contact.row
            if on[r]:
                at = np.clip(places[r : r + 1], 0.0, self.bed.length)
                shape[: self.nb, r] = self.bed.shape(at)[0]
                slope[: self.nb, r] = self.bed.shape(at, 1)[0]
                if self.own_weight:
                    level[r] = self.study.gravity * self.bed.own_weight_deflection(at)[0]
                    tilt[r] = self.study.gravity * self.bed.own_weight_deflection(at, 1)[0]
        if self.residual:
            kept = (shape[: self.nb].T / self.bed.omega**2) @ shape[: self.nb]
            held = np.clip(places, 0.0, self.bed.length)
            whole = np.where(np.outer(on, on), self.bed.influence(held, held), 0.0)
            soft = np.divide(1.0, self.table.omega**2, out=np.zeros(self.nt), where=self.table.omega > 0.0)
            rest = np.array([[np.sum(a.row * soft * b.row) for b in self.contacts] for a in self.contacts])
            missed = whole - kept + self._table_flexibility() - rest
        return shape, slope, level, tilt, missed

    def _system(self, s: float, speed: float) -> tuple[Array, ...]:
        """P, and the law F = a - B x - D x' of the contact forces at rest and beyond."""
        shape, slope, level, tilt, missed = self.rows(s)
        k = np.array([c.stiffness for c in self.contacts])
        c = np.array([c.damping for c in self.contacts])
        # dead loads bend the bed too, but the table's own rest already has what they do to it
        bed_missed = missed - self._missed_of_table()
        series = np.eye(k.size) + k[:, None] * missed
        right = -k * level - c * speed * tilt - k * (bed_missed @ self.at_rest)
        beyond = np.linalg.solve(series, right)
        on_x = np.linalg.solve(series, (k[:, None] * shape.T) + c[:, None] * speed * slope.T)
        on_v = np.linalg.solve(series, c[:, None] * shape.T)
        return shape, beyond, on_x, on_v

    def _missed_of_table(self) -> Array:
        if not self.residual:
            return np.zeros((len(self.contacts),) * 2)
        soft = np.divide(1.0, self.table.omega**2, out=np.zeros(self.nt), where=self.table.omega > 0.0)
        rest = np.array([[np.sum(a.row * soft * b.row) for b in self.contacts] for a in self.contacts])
        return self._table_flexibility() - rest

    def march(self, segments: Any, time_scale: float) -> tuple[Array, Array, Array]:
        """Coordinates (T, N), contact forces (T, R) and places at all stations of some segments, from the start."""
        omega = np.concatenate([self.bed.omega, self.table.omega])
        zeta = np.concatenate([np.full(self.nb, self._ratio(0)), np.full(self.nt, self._ratio(1))])
        n = omega.size
        x, v = self._start(float(self.motion.path(0.0).S)), np.zeros(n)
        found, forces, places = [], [], []
        for segment in segments:
            taus = np.linspace(segment.start, segment.end, segment.steps + 1)
            h = (taus[1] - taus[0]) * time_scale
            # the events lie between segments: the law at an end is that of its own side
            path = self.motion.path_on(np.clip(taus, 0, None), segment.start, segment.end)
            a = np.zeros(n)
            for j, (s, rate) in enumerate(zip(path.S, path.dS / time_scale, strict=True)):
                inner = s if 0 < j < segment.steps else s + (EDGE if j == 0 else -EDGE) * np.sign(path.dS[j])
                shape, beyond, on_x, on_v = self._system(inner, rate)
                dead = shape.copy()
                dead[self.nb :] = 0.0
                step = 0.0 if j == 0 else h
                u = x + step * v + 0.25 * step**2 * a
                w = v + 0.5 * step * a
                stiff = np.diag(omega**2) + shape @ on_x
                damp = np.diag(2.0 * zeta * omega) + shape @ on_v
                matrix = np.eye(n) + 0.25 * step**2 * stiff + 0.5 * step * damp
                a = np.linalg.solve(matrix, dead @ self.at_rest + shape @ beyond - stiff @ u - damp @ w)
                x, v = u + 0.25 * step**2 * a, w + 0.5 * step * a
                found.append(x)
                forces.append(self.at_rest + beyond - on_x @ x - on_v @ v)
                places.append(s)
        return np.array(found), np.array(forces), np.array(places)

    def _ratio(self, which: int) -> float:
        carriage: Any = next(iter(self.study.carriage.values()))
        return float(self.study.body[(carriage.on, carriage.body)[which]].damping_ratio)  # type: ignore[arg-type]

    def static(self, s: float) -> tuple[Array, Array]:
        """Coordinates and contact forces at rest, the reference at s."""
        shape, beyond, on_x, _ = self._system(s, 0.0)
        omega = np.concatenate([self.bed.omega, self.table.omega])
        dead = shape.copy()
        dead[self.nb :] = 0.0
        stiff = np.diag(omega**2) + shape @ on_x
        x = np.linalg.lstsq(stiff, dead @ self.at_rest + shape @ beyond, rcond=1e-14)[0]
        return x, self.at_rest + beyond - on_x @ x

    def _start(self, s: float) -> Array:
        if self.study.start == "rest":
            return np.zeros(self.nb + self.nt)
        return self.static(s)[0]


def _between(body: ModalBody, one: Array | str, other: Array | str) -> float:
    """m/N between two places of a body."""
    if isinstance(one, str) and isinstance(other, str):
        return body.points.between(one, other)  # type: ignore[union-attr]
    if isinstance(one, str):
        return float(body.points.influence(one, other)[0])  # type: ignore[union-attr]
    if isinstance(other, str):
        return float(body.points.influence(other, one)[0])  # type: ignore[union-attr]
    return float(body.influence(one, other)[0, 0])
