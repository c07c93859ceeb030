"""What the springs under a load do to what a body feels of its mass."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.carriages import BodyCarriage, OscillatorCarriage
from engine.lanes import moving_mass
from engine.moving_load import Load
from engine.ringing import resonant

Array = NDArray[np.float64]

MOST_SWING = 3.0  # times its force: what a bouncing load can do to a mode of nearly its own frequency in one passage
SMALL = 1e-300


class Felt(NamedTuple):
    """A load's springs: mass (K, V) that the ringing of every mode feels, by how much that differs from the whole,
    (V,) how much of its bouncing the first mode feels, 1/omega_s^2, and twice the damping ratio of its bouncing."""

    mass: Array
    beyond: Array
    swing: Array
    soft: Array
    lag: Array


def springs(load: Load) -> Felt:
    """What a load's springs do; without any the whole mass is felt."""
    carriage, key = load.route.model.study.carriage[load.route.tie.name], f"carriage.{load.route.tie.name}"
    none, wheel = np.zeros_like(load.angle), np.zeros_like(load.mass)
    if isinstance(carriage, OscillatorCarriage):
        wheel, sprung = load.values.of(f"{key}.wheel_mass"), load.values.of(f"{key}.mass")
        damping, soft = load.values.of(f"{key}.damping"), sprung / load.values.of(f"{key}.stiffness")
    elif isinstance(carriage, BodyCarriage):
        sprung, (damping, soft) = load.mass, _contacts(load, carriage, key)
    else:
        return Felt(load.mass + none, none, wheel, wheel, wheel)
    lag = damping * soft / np.maximum(sprung, SMALL)
    turning = 1j * lag * load.route.omega
    seen = (1.0 + turning) / (1.0 - soft * load.route.omega**2 + turning)
    own = lag / np.sqrt(np.maximum(soft, SMALL))
    swing = np.minimum(np.abs(seen[0] - 1.0), MOST_SWING)
    return Felt(np.abs(sprung * seen + wheel), np.abs(sprung * (seen - 1.0)), swing, soft, own)


def bounce(load: Load, felt: Felt) -> Array:
    """(J, V) static deflection by the inertia of a load that bounces on its springs: what the beginning, turns and
    harmonics of its way set off."""
    soft = felt.soft
    if not soft.any():
        return np.zeros_like(load.scale)
    angle = np.where(soft > 0.0, load.time / np.sqrt(np.maximum(soft, SMALL)), 1e9)
    sloped = np.interp(load.shaken.places, load.route.grid, np.gradient(load.route.soft, load.route.grid))
    stands = load.route.settled and not (load.shaken.once and load.shaken.once[0].tau > 0.0)
    drop = 0.0 if stands else float(np.interp(load.shaken.places[0], load.route.grid, load.route.soft))
    kick = max(float(np.abs(load.route.material(load.route.soft)[0])), float(np.abs(sloped * load.shaken.change).max()))
    swung = float(load.route.soft.max()) * resonant(load, load.shaken.square_harmonics, angle, felt.lag)
    found = np.where(soft > 0.0, kick + load.route.jolts * angle + drop * angle**2 + swung, 0.0)
    return np.asarray(load.route.line.max(axis=1)[:, None] * load.mass * load.weight * found / load.time**2)


def _contacts(load: Load, carriage: BodyCarriage, key: str) -> tuple[Array, Array]:
    """Damping (V,), N s/m, that this share of a body on contacts has, and 1/omega^2 of its bounce, with its own
    first bending."""
    damping, stiffness = np.zeros_like(load.mass), 0.0
    for name, contact in carriage.contacts.items():
        damping = damping + load.route.share * load.values.of(f"{key}.contacts.{name}.damping")
        stiffness += np.inf if contact.stiffness == "rigid" else contact.stiffness
    assert load.route.tie.rides is not None
    omega = load.route.model.bodies[load.route.tie.rides].modal.omega
    bends = 1.0 / omega[omega > 0.0][0] ** 2 if omega.any() else 0.0
    return damping, moving_mass(load.route.model, load.values, load.route.carriage) / stiffness + bends
