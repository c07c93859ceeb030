"""The way of one load over a body with sensors: what all variants share of what it shakes and of what is read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.bodies.modal import ModalBody
from engine.excitation import Excitation, excitation
from engine.model import BodyPart, SceneModel
from engine.readings import DERIVATIVE, OF_SECTIONS, Sensor, SprungSensor
from engine.signals import build_signals
from engine.ties import CarriageTie, Grip
from engine.timeline import Window
from engine.ways import Way

Array = NDArray[np.float64]

MODES = 12  # the lowest that bend, which are looked at
UNFELT = 1e-4  # of the largest static part: modes with less, in sensors and under the load, are left out
GRID = 257  # places along a track
LEAST_APART = 0.1  # of a square frequency: as if modes were no closer, which damping and time keep apart
SAME = 1e-9  # of the length: stations no further apart are one place
READ_AT = (0.0, 0.25, 0.5, 0.75, 1.0)  # parts of a track, to know what is usual
FORCES = ("shear_force", "axial_force")  # a unit force makes some of about 1


@dataclass(frozen=True, eq=False)
class Route:
    """A carriage's way, or that of one of its contacts (a rider), which has a share of it, over K modes.

    sensors: the J that read its body; those that move along read under this load. leaves: what follows its end counts
    too. most: how many of the lowest modes that bend are looked at.
    """

    model: SceneModel
    carriage: int
    rider: int
    share: float
    sensors: tuple[Sensor, ...]
    leaves: bool
    most: int = MODES
    window: Window = "whole"

    @property
    def tie(self) -> CarriageTie:
        """The carriage as the march sees it."""
        return self.model.carriages[self.carriage]

    @property
    def part(self) -> BodyPart:
        """What it rides, with its place in the scene."""
        return self.model.bodies[self.tie.body]

    @property
    def body(self) -> ModalBody:
        """What it rides."""
        return self.part.modal

    @cached_property
    def modes(self) -> NDArray[np.int64]:
        """Numbers of the modes that count for any sensor."""
        bend, along = np.flatnonzero(self.body.omega > 0.0)[: self.most], _still(self.grid)
        bare = np.abs(along[0].shape(self.body)[:, bend])
        read = [bare, *(self._modal(sensor, along)[:, bend] for sensor in self.sensors)]  # masses feel all modes
        part = np.array([(bare / self.body.omega[bend] ** 2 * row).max(axis=0) for row in read])
        return np.asarray(bend[np.any(part >= UNFELT * part.max(axis=1, keepdims=True), axis=0)])

    @cached_property
    def omega(self) -> Array:
        """(K, 1) rad/s."""
        return self.body.omega[self.modes][:, None]

    @property
    def settled(self) -> bool:
        """Whether it begins in static equilibrium."""
        return self.model.study.start == "equilibrium"

    @cached_property
    def shaken(self) -> Excitation:
        """What it shakes."""
        rider = replace(self.model.riders[self.rider], pace=1.0, delay=0.0)
        return excitation(rider, self.body, self.modes, settled=self.settled, leaves=self.leaves)

    @cached_property
    def along(self) -> tuple[Way]:
        """Its way where it is on the body."""
        return _still(np.clip(self.shaken.places, 0.0, self.body.length))

    @cached_property
    def line(self) -> Array:
        """(J, P) size of every sensor's influence line along its way, per N."""
        return np.array([self._influence(sensor, self.along) for sensor in self.sensors])

    @cached_property
    def largest(self) -> Array:
        """(J,) largest value of every influence line on its way; a moment's is where the load passes the sensor."""
        way, found = self.along[0].s, self.line.max(axis=1)
        for number, sensor in enumerate(self.sensors):
            if sensor.under is None and way.min() < sensor.at < way.max():
                passing = self._influence(sensor, _still(np.array([sensor.at])))
                found[number] = max(found[number], float(passing[0]))
        return np.asarray(found)

    @cached_property
    def steepest(self) -> float:
        """Largest part of a kinked influence line's largest value that half a unit of tau changes it by."""
        here = [n for n, sensor in enumerate(self.sensors) if sensor.under is None and sensor.quantity in OF_SECTIONS]
        still = _still(self.grid)
        found = [0.0]
        for number in here:
            line = self._influence(self.sensors[number], still)
            slope = float(np.abs(np.gradient(line, self.grid)).max())
            found.append(
                0.5 * slope * self.model.riders[self.rider].motion.max_speed / max(self.largest[number], 1e-300)
            )
        return max(found)

    @cached_property
    def usual(self) -> Array:
        """(J,) largest value per N of what every sensor reads, by loads anywhere on the body read at some places."""
        return np.array([self._usual[sensor.quantity] for sensor in self.sensors])

    @cached_property
    def _usual(self) -> dict[str, float]:
        """The same by quantity."""
        loaded, found = _still(self.grid[:: GRID // 16]), dict[str, float]()
        for quantity in {sensor.quantity for sensor in self.sensors}:
            read = [Sensor("", quantity, self.tie.body, part * self.body.length, None) for part in READ_AT]
            largest = max(float(self._influence(sensor, loaded).max()) for sensor in read)
            found[quantity] = 1.0 if quantity in FORCES else largest
        return found

    @cached_property
    def rows(self) -> Array:
        """(J, K) largest size of every sensor's reading of every mode over omega^2."""
        read = [self._modal(sensor, self.along)[:, self.modes].max(axis=0) for sensor in self.sensors]
        return np.asarray(np.array(read) / self.omega[:, 0] ** 2)

    @cached_property
    def coupled(self) -> Array:
        """(J, K) what sensors read of all other modes, over omega^2, when the ringing of mode l shakes 1 kg on the way:
        that presses with phi_l omega_l^2, which mode k answers with phi_k/|omega_k^2 - omega_l^2|, out of step."""
        shape = self.along[0].shape(self.body)[:: 1 + len(self.along[0].s) // GRID, self.modes]
        both = np.array([np.abs(shape * column[:, None]).max(axis=0) for column in shape.T])
        square = self.omega**2
        apart = np.maximum(np.abs(square - square.T), LEAST_APART * square)
        answer = both * square / apart
        np.fill_diagonal(answer, 0.0)
        return np.asarray(np.sqrt(self.rows**2 @ answer**2))

    @cached_property
    def jolts(self) -> float:
        """m/N per tau: sum over a cycle, or the whole motion, of the jumps of the velocity at which the place under a
        unit force sinks: where it sets off, arrives, or turns at an instant."""
        way, speed = self.along[0].s, self.shaken.speed
        slope = np.interp(way, self.grid, np.gradient(self.soft, self.grid))
        again = np.abs(slope[0] * speed[0] - slope[-1] * speed[-1]) if self.shaken.again else 0.0
        turns = np.abs(slope[1:] * np.diff(speed))[np.abs(np.diff(way)) < SAME * self.body.length]
        return float(np.abs(slope[0] * speed[0]) + again + turns.sum())

    @cached_property
    def grid(self) -> Array:
        """(GRID,) places along the track, m."""
        return np.linspace(0.0, self.body.length, GRID)

    @cached_property
    def soft(self) -> Array:
        """(GRID,) deflection under a unit force at places of the track, m/N."""
        return self.body.influence_at(self.grid, self.grid)

    @cached_property
    def square(self) -> Array:
        """(GRID, N) of all modes of the body, squared, at places of the track."""
        return np.asarray(self.body.shape(self.grid) ** 2)

    @cached_property
    def pressing(self) -> Array:
        """(2, J) static readings by the inertia of 1 kg on its way over the body that a unit force, or its own weight
        per unit gravity, curves; times seconds squared per unit of tau."""
        sag = self.model.sag(self.tie.body, self.grid, 0)
        return np.array([np.abs(self.line * self.material(along)).max(axis=1) for along in (self.soft, sag)])

    @cached_property
    def damped(self) -> dict[str, Array]:
        """(K,) squares of the modes where discrete dampers hold the body, by their keys."""
        own = [damper for damper in self.model.dampers if damper.body == self.tie.body]
        return {damper.key: damper.grips[0].fixed_row(self.body)[self.modes] ** 2 for damper in own}

    def material(self, along: Array) -> Array:
        """(P,) second derivative by tau of a function of place (GRID,), as the load feels it."""
        slope = np.gradient(along, self.grid)
        bend, s = np.gradient(slope, self.grid), self.shaken.places
        curved = np.interp(s, self.grid, bend) * self.shaken.speed**2
        return np.asarray(curved + np.interp(s, self.grid, slope) * self.shaken.change)

    def _modal(self, sensor: Sensor, along: tuple[Way]) -> Array:
        """(1 or stations, modes of the body) size of what a sensor reads of every mode."""
        (channel,) = _with(sensor).channels(self.model, along)
        return np.asarray(np.abs(channel.rows[:, self.part.modes]))

    def _influence(self, sensor: Sensor, along: tuple[Way]) -> Array:
        """(stations,) size of its static reading per unit force."""
        return np.asarray(np.abs(_with(sensor).unit_reading(self.model, along, Grip(1.0, self.tie.body, 0))))


def routes(model: SceneModel, most: int = MODES, window: Window = "whole") -> tuple[Route, ...] | None:
    """The routes of all loads of a scene with the sensors on what they ride; on a body without any, displacement under
    the load. window: what is recorded. None where nobody can tell what models leave out of what is read."""
    sensors = _told(model)
    if sensors is None:
        return None
    loads = [(n, rider, share) for n, carriage in enumerate(model.carriages) for rider, share in carriage.loads]
    follows = len(loads) > 1 or any(getattr(c.rider.motion, "after", 0.0) > 0.0 for c in model.carriages)
    return tuple(
        Route(model, n, rider, share, _on(model.carriages[n].body, sensors), follows, most, window)
        for n, rider, share in loads
    )


def _told(model: SceneModel) -> list[Sensor] | None:
    """The sensors, if what models leave out can be told of all of them."""
    riding = {carriage.rides for carriage in model.carriages}
    if any(carriage.body in riding for carriage in model.carriages):  # what it rides is not held by itself
        return None
    sensors = [signal for signal in build_signals(model) if isinstance(signal, Sensor)]
    static = [s.quantity in DERIVATIVE and s.body not in riding and not isinstance(s, SprungSensor) for s in sensors]
    return sensors if all(static) else None


def _on(body: int, sensors: list[Sensor]) -> tuple[Sensor, ...]:
    """Those on a body, once each as one load sees them; else displacement under the load."""
    found = {(s.quantity, s.at, s.under is None): s for s in sensors if s.body == body}
    return tuple(found.values()) or (Sensor("", "displacement", body, 0.0, 0),)


def _with(sensor: Sensor) -> Sensor:
    """A sensor that moves along does so with the only load."""
    return sensor if sensor.under is None else replace(sensor, under=0)


def _still(places: Array) -> tuple[Way]:
    """Stations at places (m) of the track."""
    return (Way(places, np.zeros_like(places), np.zeros_like(places), True),)
