"""What a study's sensors read on a twin."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from engine.scene.study import Study
from tests.engine.twin import Twin
from tests.naive.scene import Array

DERIVATIVE = {"displacement": 0, "bending_moment": 2, "stress": 2, "shear_force": 3}


@dataclass(frozen=True, eq=False)
class Reading:
    """A sensor of a study on a twin."""

    study: Study
    twin: Twin
    sensor: Any

    @cached_property
    def place(self) -> Array:
        """Where it reads at every instant, m; NaN where it does not."""
        if self.sensor.rides is None:
            return np.full(self.twin.history.t.shape, self.sensor.at)
        return self.twin.history.position[:, self.twin.riders.index(self.sensor.rides)]

    @property
    def values(self) -> Array:
        """(S,) what it reads."""
        if self.sensor.carriage is not None:
            return np.where(np.isnan(self.place), math.nan, self._aboard)
        if self.sensor.quantity in DERIVATIVE:
            history = self.twin.history
            read = zip(self.place, history.position, history.q, history.v, history.contact_force, strict=True)
            return np.array([math.nan if math.isnan(x) else self._state(float(x), *rest) for x, *rest in read])
        return np.array([math.nan if math.isnan(x) else self._rate(n) for n, x in enumerate(self.place)])

    @property
    def _aboard(self) -> Array:
        """The motion of a sprung mass, its displacement from where it stands on rigid ground."""
        history, load = self.twin.history, self.twin.scene.loads[self.twin.riders.index(self.sensor.carriage)]
        assert load.sprung is not None
        number = load.sprung.number
        if self.sensor.quantity == "displacement":
            return history.q[:, number] - load.sprung.weight / load.sprung.stiffness
        return (history.v if self.sensor.quantity == "velocity" else history.a)[:, number]

    @property
    def values_before(self) -> Array:
        """What it reads just before each event, where the history has the values just after it; NaN where nothing."""
        found, events = [], self.twin.history.before
        if self.sensor.carriage is not None:  # its displacement does not jump
            load = self.twin.scene.loads[self.twin.riders.index(self.sensor.carriage)]
            left = np.array([load.active(event.t, "left") for event in events], dtype=np.bool_)
            return np.where(left, self._aboard[[event.step for event in events]], math.nan)
        for event in events:
            phases = [load.phase(event.t, "left") for load in self.twin.scene.loads]
            position = np.array([math.nan if phase is None else phase.s(event.t) for phase in phases])
            under = self.sensor.under
            x = self.sensor.at if under is None else float(position[self.twin.riders.index(under)])
            here = self.twin.history.q[event.step], event.v, event.contact_force
            found.append(math.nan if math.isnan(x) else self._state(x, position, *here))
        return np.array(found)

    @property
    def mean_square(self) -> float:
        """Time average of its square over the time in which it reads anything, by the trapezoidal rule."""
        ends = self.values
        for event, value in zip(self.twin.history.before, self.values_before, strict=True):
            ends[event.step] = value
        squares, steps = 0.5 * (self.values[:-1] ** 2 + ends[1:] ** 2), np.diff(self.twin.history.t)
        reads = np.isfinite(squares)
        return float(np.sum((squares * steps)[reads]) / np.sum(steps[reads]))

    def _state(self, x: float, position: Array, q: Array, v: Array, contact_force: Array) -> float:
        bed, order = self.twin.bed, DERIVATIVE[self.sensor.quantity]
        value = float(self.twin.scene.phi(x, order) @ q) + self.twin.gravity * bed.sag(x, order)
        if self.study.solver.static_correction:
            for s, force in zip(position, contact_force, strict=True):
                if not math.isnan(s):
                    value += bed.missed(x, float(s), order) * float(force)
            for damper, (at, c) in zip(self.twin.scene.dampers, bed.dampers, strict=True):
                value -= bed.missed(x, at, order) * c * float(damper.row @ v)
        if order == 0:
            return value
        table: Any = self.study.body[self.study.body_of(self._name)]
        lever = table.fibre_distance / table.second_moment if self.sensor.quantity == "stress" else 1.0
        return -bed.stiffness * lever * value

    @property
    def _name(self) -> str:
        return next(name for name, sensor in self.study.sensor.items() if sensor is self.sensor)

    def _rate(self, n: int) -> float:
        bed, history, x = self.twin.bed, self.twin.history, float(self.place[n])
        phi = self.twin.scene.phi
        row = phi(x, 0)
        if self.sensor.under is None:
            return float(row @ (history.v if self.sensor.quantity == "velocity" else history.a)[n])
        load = self.twin.scene.loads[self.twin.riders.index(self.sensor.under)]
        t = float(history.t[n])
        phase = load.phase(t, "right" if n < len(history.t) - 1 else "left")
        assert phase is not None
        ds, dds = phase.ds(t), phase.dds(t)
        slope, bend = phi(x, 1), phi(x, 2)
        own = [self.twin.gravity * bed.sag(x, j) for j in (1, 2)]
        if self.sensor.quantity == "velocity":
            return float(row @ history.v[n] + ds * (slope @ history.q[n])) + ds * own[0]
        curve = float((ds**2 * bend + dds * slope) @ history.q[n]) + ds**2 * own[1] + dds * own[0]
        return float(row @ history.a[n] + 2.0 * ds * (slope @ history.v[n])) + curve
