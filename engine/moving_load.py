"""One load that moves, for V variants: the modes that count, its numbers, what its way excites, what is read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.bodies.modal import ModalBody
from engine.excitation import Excitation, excitation
from engine.lanes import LaneValues, moving_mass, weight
from engine.model import SceneModel
from engine.ties import CarriageTie

Array = NDArray[np.float64]

MODES = 12  # the lowest that bend, which are looked at
UNFELT = 1e-3  # of the largest static part: modes with less where it is read are left out
GRID = 257  # places along a track


@dataclass(frozen=True, eq=False)
class Load:
    """One load of V variants: a carriage, or the share of it on one contact (a rider), over K modes.

    places: J places of the body's track at which displacement is read, None for under the load. leaves: what follows
    its end counts too.
    """

    model: SceneModel
    values: LaneValues
    carriage: int
    rider: int
    share: float
    places: tuple[float | None, ...]
    leaves: bool

    @property
    def tie(self) -> CarriageTie:
        """The carriage as the march sees it."""
        return self.model.carriages[self.carriage]

    @property
    def body(self) -> ModalBody:
        """What it rides."""
        return self.model.bodies[self.tie.body].modal

    @cached_property
    def modes(self) -> NDArray[np.int64]:
        """Numbers of the modes that count."""
        bend = np.flatnonzero(self.body.omega > 0.0)[:MODES]
        shape = np.abs(self.body.shape(self.grid)[:, bend])
        read = [shape if place is None else np.abs(self.body.shape([place])[:, bend]) for place in self.places]
        part = np.max([np.max(shape * row, axis=0) for row in read], axis=0) / self.body.omega[bend] ** 2
        return np.asarray(bend[part >= UNFELT * part.max()])

    @cached_property
    def shaken(self) -> Excitation:
        """What it shakes."""
        rider = replace(self.model.riders[self.rider], pace=1.0, delay=0.0)
        return excitation(rider, self.body, self.modes, settled=self.settled, leaves=self.leaves)

    @cached_property
    def time(self) -> Array:
        """(V,) s per unit of its own tau."""
        return self.values.time_scale(self.tie.name)

    @cached_property
    def angle(self) -> Array:
        """(K, V) radians of every mode per unit of tau."""
        return self.omega * self.time

    @cached_property
    def zeta(self) -> Array:
        """(K, V) damping ratios, with what dampers add to every mode by itself."""
        rates = self.values.damping_rates(self.model.bodies[self.tie.body].name, self.body.omega)[self.modes]
        for damper in self.model.dampers:
            if damper.body == self.tie.body:
                row = damper.grips[0].fixed_row(self.body)[self.modes]
                rates = rates + self.values.of(damper.key) * row[:, None] ** 2
        return np.asarray(rates / (2.0 * self.omega))

    @cached_property
    def weight(self) -> Array:
        """(V,) N."""
        return np.abs(weight(self.model, self.values, self.carriage)) * self.share

    @cached_property
    def mass(self) -> Array:
        """(V,) kg."""
        inertial = self.model.study.carriage[self.tie.name].inertial
        return self.share * moving_mass(self.model, self.values, self.carriage) * float(inertial)

    @cached_property
    def line(self) -> Array:
        """(J, P) size of the influence line along its way at every place that is read, m/N."""
        way = np.clip(self.shaken.places, 0.0, self.body.length)
        rows = [
            self.body.influence_at(way, way) if place is None else self.body.influence([place], way)[0]
            for place in self.places
        ]
        return np.asarray(np.abs(np.array(rows)))

    @cached_property
    def scale(self) -> Array:
        """(J, V) largest static values, m."""
        return np.asarray(self.line.max(axis=1)[:, None] * self.weight)

    @cached_property
    def grid(self) -> Array:
        """(GRID,) places along its track, m."""
        return np.linspace(0.0, self.body.length, GRID)

    @property
    def omega(self) -> Array:
        """(K, 1) rad/s."""
        return self.body.omega[self.modes][:, None]

    @property
    def settled(self) -> bool:
        """Whether it begins in static equilibrium."""
        return self.model.study.start == "equilibrium"

    def at_places(self, amplitude: Array) -> Array:
        """(J, V) what amplitudes (K, V) per unit of drive mean where it is read."""
        way = np.clip(self.shaken.places, 0.0, self.body.length)
        rows = [
            np.abs(self.body.shape(way if place is None else [place])[:, self.modes]).max(axis=0)
            for place in self.places
        ]
        return np.asarray((np.array(rows) / self.omega[:, 0] ** 2) @ amplitude * self.weight)

    @cached_property
    def soft(self) -> Array:
        """(GRID,) deflection under a unit force at places of the track, m/N."""
        return self.body.influence_at(self.grid, self.grid)

    def material(self, along: Array) -> Array:
        """(P,) second derivative by tau of a function of place (GRID,), as the load feels it."""
        slope = np.gradient(along, self.grid)
        bend, s = np.gradient(slope, self.grid), self.shaken.places
        curved = np.interp(s, self.grid, bend) * self.shaken.speed**2
        return np.asarray(curved + np.interp(s, self.grid, slope) * self.shaken.change)
