"""What a march with few modes and long steps leaves out of the answer to moving loads, told before it runs.

Relative to the largest static value of every sensor, with the ringing A_k of mode k per unit of drive (`ringing`), the
sensor's reading r_k of that mode, and the static correction that stands for all modes left out:

- Modes beyond the kept ones leave out their ringing, and what follows the drive: sum of r_k (A_k + forced_k).
- Under a mass m they also leave out that it rides on a softer body than the kept modes tell, by the residual
  flexibility c(s): its weight presses with m c''(t) less, and ringing drifts by the phase m omega_1^2 c/2 per radian.
- Average acceleration turns mode k too slowly, by omega_k^3 h^2/12 per second while its damping remembers, and an
  extreme between two stations is missed by (omega_k h)^2/8 of the ringing (mechanics section 6). What follows the
  drive is in error by (omega_k h)^2/6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.bouncing import springs
from engine.moving_load import Load
from engine.ringing import lowered, rings

Array = NDArray[np.float64]

MODES_LOOKED_AT = 30
COUPLED = 0.5  # of the largest inertia of a load on what omitted modes leave soft: it acts for a short time only
SOFTENED = 0.7  # times the phase by which ringing drifts on a body that is softer than its kept modes tell
TURNED = 2.0  # times its size: the most that ringing with a wrong phase can miss
ROUNDS = 6  # of Newton's method for the step


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

    def stepped(self, kept: int) -> tuple[Array, Array]:
        """What the step may spoil, as parts of static values (R, V), and by which part per square of the step, 1/s^2:
        the ringing of the kept modes, and what follows the drive."""
        here, omega = self.load.modes < kept, self.load.route.omega
        slips = omega**3 * self._remembered * self.load.time / 12.0 + omega**2 / 8.0
        follows = np.broadcast_to(omega**2 / 6.0, slips.shape)
        sizes = np.concatenate([(self._read * part)[here] for part in (self.ringing, self._moving)])
        return sizes, np.concatenate([slips[here], follows[here]])

    def _relative(self, absolute: Array) -> Array:
        return np.divide(absolute, self.scale, out=np.zeros_like(absolute), where=self.scale > 0.0)


def longest_step(sizes: Array, slips: Array, allowed: Array, most: Array) -> Array:
    """(V,) s, at most ``most``: the step at which ringing misses what is ``allowed`` (V,).

    sizes (K, V): of the modes' ringing, in error by ``slips`` (K, V) times the square of the step, at most `TURNED`.
    The sum is concave in the square of the step, so that Newton's method stays below the root from its first value on.
    """
    slope = np.sum(sizes * slips, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        square = np.minimum(np.where(slope > 0.0, allowed / slope, np.inf), most**2)
        for _ in range(ROUNDS):
            half = 1.0 + slips * square / TURNED
            missed = np.sum(sizes * slips * square / half, axis=0)
            rate = np.sum(sizes * slips / half**2, axis=0)
            square = np.minimum(np.where(rate > 0.0, square + (allowed - missed) / rate, square), most**2)
    return np.sqrt(square)


def missed_by(sizes: Array, slips: Array, step: Array) -> Array:
    """(V,) what a step (V,) in s misses of ringing."""
    grown = slips * step**2
    return np.asarray(np.sum(sizes * grown / (1.0 + grown / TURNED), axis=0))
