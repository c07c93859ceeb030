"""What a march with few modes and long steps leaves out of the answer to moving loads, told before it runs.

Relative to the largest static value of every sensor, with the ringing A_k of mode k per unit of drive (`ringing`), the
sensor's reading r_k of that mode, and the static correction that stands for all modes left out:

- Modes beyond the kept ones leave out their ringing, and what follows the drive: sum of r_k (A_k + forced_k).
- Under a mass m they also leave out that it rides on a softer body than the kept modes tell, by the residual
  flexibility c(s): its weight presses with m c''(t) less, and ringing drifts by the phase m omega_1^2 c/2 per radian.
- The scheme turns mode k too slowly or too fast, by omega_k times its period error per second while damping remembers
  (average acceleration: (omega_k h)^2/12, Fox-Goodwin: (omega_k h)^4/480; mechanics section 6), and an extreme between
  two stations is missed by (omega_k h)^2/8 of the ringing. What follows the drive is in error by twice the period
  error, but under a moving mass m by no less than (omega_k h)^2/12 m phi^2/(1 + m phi^2): velocities are of second
  order in every scheme.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.bouncing import springs
from engine.kernels.schemes import Scheme
from engine.moving_load import Load
from engine.ringing import lowered, rings

Array = NDArray[np.float64]

MODES_LOOKED_AT = 30
COUPLED = 0.5  # of the largest inertia of a load on what omitted modes leave soft: it acts for a short time only
SOFTENED = 0.7  # times the phase by which ringing drifts on a body that is softer than its kept modes tell
TURNED = 2.0  # times its size: the most that ringing with a wrong phase can miss


class Spoiled(NamedTuple):
    """What a step may spoil: parts of static values (R, V), and by which part of itself each is off: per square of the
    step, 1/s^2, and per fourth power, 1/s^4."""

    sizes: Array
    square: Array
    fourth: Array

    def missed(self, step: Array) -> Array:
        """(V,) what a step (V,) in s misses of all of them."""
        off = (self.square + self.fourth * step**2) * step**2
        return np.asarray(np.sum(self.sizes * off / (1.0 + off / TURNED), axis=0))


@dataclass(frozen=True, eq=False)
class Omitted:
    """What V variants of one load leave out. scale: (J, V) largest static values of the sensors."""

    load: Load
    scale: Array

    @cached_property
    def ringing(self) -> Array:
        """(K, V) ringing per unit of drive, with the load and after it."""
        shift = lowered(self.load.shaken.square.mean(axis=0)[:, None], self.load.mass)
        return np.asarray(rings(self.load, shift).whole)

    @cached_property
    def _moving(self) -> Array:
        """(K, V) what follows the drive between events, besides statics."""
        peaks, angle = self.load.shaken.peaks[:, :, None], self.load.angle
        return np.asarray(2.0 * self.load.zeta * peaks[1] / angle + peaks[2] / angle**2)

    @cached_property
    def _kept_only(self) -> Array:
        """(K, 1) what statics carry, where nothing corrects for modes left out."""
        corrected = self.load.route.model.study.solver.static_correction
        return np.asarray(self.load.shaken.peaks[0][:, None] * float(not corrected))

    def modes(self, kept: int) -> Array:
        """(V,) error of keeping the body's lowest modes alone."""
        beyond = (self.load.modes >= kept)[:, None]
        dynamic = self.load.at_places(np.where(beyond, self.ringing + self._moving + self._kept_only, 0.0))
        return np.asarray(self._relative(dynamic).max(axis=0) + self._soft(kept))

    def _soft(self, kept: int) -> Array:
        """(V,) what the residual flexibility under a mass leaves out."""
        load, route = self.load, self.load.route
        mass = springs(load).mass[0]
        if not np.any(mass > 0.0):
            return np.zeros_like(load.time)
        residual = route.soft - route.square[:, :kept] @ route.body.modal_flexibility[:kept]
        pressed = COUPLED * mass * float(np.abs(route.material(residual)).max()) / load.time**2
        soft = SOFTENED * mass * float(np.abs(residual).max()) * route.omega[0] ** 2
        turned = soft * self._remembered[0] * load.angle[0]
        return np.asarray(pressed + np.minimum(turned, TURNED) * self._read[0] * (self.ringing + self._moving)[0])

    @cached_property
    def _remembered(self) -> Array:
        """(K, V) units of tau over which a mode's phase gathers an error."""
        longest = self.load.shaken.duration * self.load.shaken.cycles
        return np.minimum(longest, 1.0 / np.maximum(self.load.zeta * self.load.angle, 1e-12))

    @cached_property
    def _read(self) -> Array:
        """(K, V) largest part of any sensor's static value that a unit of drive of every mode makes."""
        rows = np.eye(self.load.modes.size)[:, :, None] * np.ones(self.load.time.size)
        return np.stack([self._relative(self.load.at_places(row)).max(axis=0) for row in rows])

    @cached_property
    def tails(self) -> Array:
        """(K, V) at most what every mode and all above it ring, as a part of static values."""
        rings = self._read * self.ringing
        return np.asarray(np.cumsum(rings[::-1], axis=0)[::-1])

    def stepped(self, kept: int, scheme: Scheme) -> Spoiled:
        """What the step of a scheme may spoil: the ringing of the kept modes, and what follows the drive."""
        here, omega = self.load.modes < kept, self.load.route.omega
        square, fourth = scheme.period_error
        turned = omega * self._remembered * self.load.time
        coupled = omega**2 / 12.0 * self._carried
        parts = (
            (self.ringing, turned * omega**2 * square + omega**2 / 8.0, turned * omega**4 * fourth),
            (self._moving, np.maximum(2.0 * square * omega**2, coupled), 2.0 * fourth * omega**4 + 0.0 * turned),
        )
        columns = ((self._read * size, by_square, by_fourth) for size, by_square, by_fourth in parts)
        return Spoiled(*(np.concatenate([part[here] for part in column]) for column in zip(*columns, strict=True)))

    @cached_property
    def _carried(self) -> Array:
        """(K, V) part of a mode's inertia that is the load's, at most."""
        borne = self.load.shaken.square.max(axis=0)[:, None] * self.load.mass
        return np.asarray(borne / (1.0 + borne))

    def _relative(self, absolute: Array) -> Array:
        return np.divide(absolute, self.scale, out=np.zeros_like(absolute), where=self.scale > 0.0)
