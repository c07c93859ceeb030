"""What simpler models leave out of one load that moves: how far the modes ring, drift apart and lag because of it.

Every mode k that bends obeys (1 + m phi^2) q'' + ... = P phi with m the moving mass and phi = phi_k at its place.

- Statics miss the ringing after events, what follows the drive in between (`excitation`), and the load's inertia on
  its own curved way, m w_c'' with w_c the static deflection under it.
- The mass hands the ringing of every mode to the others, by its inertia where it rides (`Route.coupled`); statics and
  forces miss that.
- A force misses its inertia on its way too, and that ringing with the mass has a frequency lower by
  1 - (1 + m phi^2)^(-1/2), so that both drift apart by 2 sin(phase/2) of the ringing.
- Without convective terms the ringing grows with (1 + m phi^2)^(1/4) where in truth it shrinks likewise.
- A mass on a spring of frequency omega_s feels like m/(1 - (omega/omega_s)^2) to a mode; what that differs from m by is
  what a rigid mass misses, and the bouncing that kinks of w_c set off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.bouncing import bounce, springs
from engine.moving_load import Load
from engine.ringing import drift, lifted, lowered, rings, square_near_by
from results_schema.status import Fidelity

Array = NDArray[np.float64]

# Times what is derived, so that of the variants that a tolerance of 1e-2, 1e-3 or 1e-4 accepts at most one in a hundred
# misses it (tests/calibration/ladder.py).
MARGIN = {Fidelity.STATIC: 1.2, Fidelity.FORCE: 1.2, Fidelity.MASS_WITHOUT_CONVECTIVE: 1.6, Fidelity.MASS: 1.4}
STEEPEST = 0.8  # phi' over omega phi: beyond, a critical speed is near and one mode tells little
MOST_AHEAD = 2.0  # times its inertia: what a load does whose way changes as fast as it bounces


def left_out(load: Load) -> dict[Fidelity, Array]:
    """(J, V) what every model leaves out of every sensor, in its unit; of mass alone only what springs add."""
    peaks, square = load.shaken.peaks[:, :, None], load.shaken.square
    shift = lowered(square.mean(axis=0)[:, None], load.mass)
    near = np.divide(peaks[1], peaks[0], out=np.zeros_like(peaks[0]), where=peaks[0] > 0.0) / load.angle
    light, boost = (1.0 / (1.0 - np.minimum(n, STEEPEST) ** 2) for n in (near, near / (1.0 - shift)))
    forced = (2.0 * load.zeta * peaks[1] / load.angle + peaks[2] / load.angle**2) * boost
    ringing, felt, own = rings(load, shift), springs(load), square_near_by(load)
    either = np.maximum(ringing.force * light, ringing.mass * boost)
    pressed, bounced = _pressed(load) * boost[0] ** 2, bounce(load, felt) * felt.swing
    ahead = np.minimum((2.0 * near[0] * load.route.omega[0]) ** 2 * felt.soft, MOST_AHEAD)
    other = ringing.mass * boost * (1.0 - shift) ** 2
    shared, sprung = load.through_mass(other, felt.mass), bounced + ahead * pressed
    if felt.soft.any():
        sprung = sprung + load.at_places(either * drift(load, lowered(own, felt.beyond)))
        sprung = sprung + load.through_mass(other, felt.beyond)
    lag = load.at_places(forced * np.minimum(2.0 * shift * boost, 1.0))
    drifted = load.at_places(either * drift(load, lowered(own, felt.mass)) + ringing.added)
    changed = load.at_places(ringing.mass * boost * lifted(load) + ringing.struck)
    told = {
        Fidelity.STATIC: load.at_places(ringing.whole * boost + forced) + shared + pressed + bounced + _unheld(load),
        Fidelity.FORCE: drifted + shared + lag + pressed + bounced + _loose(load),
        Fidelity.MASS_WITHOUT_CONVECTIVE: changed + pressed + sprung,
        Fidelity.MASS: sprung,
    }
    return {model: MARGIN[model] * error for model, error in told.items()}


def _pressed(load: Load) -> Array:
    """(J, V) static readings by the load's inertia on its own curved way."""
    by_unit, by_sag = load.route.pressing[:, :, None]
    lines = by_unit * load.weight + by_sag * (load.route.share * load.values.of("gravity"))
    return np.asarray(load.mass * lines / load.time**2)


def _unheld(load: Load) -> float:
    """A body that nothing holds has no static state."""
    return np.inf if load.route.body.rigid_modes else 0.0


def _loose(load: Load) -> Array:
    """(J, V) the load's inertia on the rigid motion of a body that nothing holds."""
    mobility = load.route.body.shape(load.route.grid)[:, load.route.body.omega == 0.0] ** 2
    return np.asarray(load.scale * load.mass * float(mobility.sum(axis=1).max()))
