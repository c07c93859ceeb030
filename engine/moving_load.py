"""One load that moves along its route, for V variants: its numbers, and what they mean in sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.excitation import Excitation
from engine.lanes import LaneValues, moving_mass, weight
from engine.route import Route

Array = NDArray[np.float64]

STILL = 1e-6  # of what is usual on a body: less, such as on supports, is rounding


@dataclass(frozen=True, eq=False)
class Load:
    """One load of V variants on its route, over K modes."""

    route: Route
    values: LaneValues

    @property
    def shaken(self) -> Excitation:
        """What it shakes."""
        return self.route.shaken

    @property
    def modes(self) -> NDArray[np.int64]:
        """Numbers of the modes that count for any sensor."""
        return self.route.modes

    @cached_property
    def time(self) -> Array:
        """(V,) s per unit of its own tau."""
        return self.values.time_scale(self.route.tie.name)

    @cached_property
    def angle(self) -> Array:
        """(K, V) radians of every mode per unit of tau."""
        return self.route.omega * self.time

    @cached_property
    def zeta(self) -> Array:
        """(K, V) damping ratios, with what dampers add to every mode by itself."""
        route = self.route
        rates = self.values.damping_rates(route.part.name, route.body.omega)[self.modes]
        for key, square in route.damped.items():
            rates = rates + self.values.of(key) * square[:, None]
        return np.asarray(rates / (2.0 * route.omega))

    @cached_property
    def fading(self) -> Array:
        """(K, V) how fast ringing decays per unit of tau."""
        return self.zeta * self.angle

    @cached_property
    def weight(self) -> Array:
        """(V,) N."""
        return np.abs(weight(self.route.model, self.values, self.route.carriage)) * self.route.share

    @cached_property
    def mass(self) -> Array:
        """(V,) kg."""
        route = self.route
        inertial = route.model.study.carriage[route.tie.name].inertial
        return route.share * moving_mass(route.model, self.values, route.carriage) * float(inertial)

    @cached_property
    def scale(self) -> Array:
        """(J, V) largest static value of every sensor by this load alone along its way, in the sensor's unit."""
        return np.asarray(self.route.largest[:, None] * self.weight)

    @cached_property
    def usual(self) -> Array:
        """(J, V) largest static value of what every sensor reads, anywhere on the body."""
        return np.asarray(self.route.usual[:, None] * self.weight)

    def at_places(self, amplitude: Array) -> Array:
        """(J, V) what modal amplitudes (K, V) per unit of drive mean at most in every sensor, in its unit."""
        return np.asarray(_product(self.route.rows, amplitude) * self.weight)

    def through_mass(self, amplitude: Array, mass: Array) -> Array:
        """(J, V) what sensors read of other modes when modes ring with amplitudes (K, V) under a mass (K, V), kg."""
        return np.asarray(_product(self.route.coupled, amplitude * mass) * self.weight)


def _product(rows: Array, columns: Array) -> Array:
    """rows (J, K) times columns (K, V), each column by itself: a library's product may round one by its neighbours."""
    found = np.zeros((rows.shape[0], columns.shape[1]))
    for row, column in zip(rows.T, columns, strict=True):
        found += row[:, None] * column
    return found


def noticed(loads: Sequence[Load]) -> Array:
    """(J, V) what errors of sensors are parts of: the largest static value by any of a body's loads, but no less than
    STILL of what is usual on the body."""
    scale, usual = (np.max([getattr(load, of) for load in loads], axis=0) for of in ("scale", "usual"))
    return np.asarray(np.maximum(scale, STILL * usual))
