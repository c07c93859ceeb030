"""How far the modes of a body ring after a load, and what changes that ringing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.excitation import STATIONS, Event
from engine.moving_load import Load

Array = NDArray[np.float64]

LASTS = 3.0  # over zeta omega: ringing that is older has gone
THINNED = 32  # stations of a way at which decaying parts are looked at


class Ringing(NamedTuple):
    """Ringing (K, V) per unit of drive: of a force, of the mass, of it after the load has left too, what the mass adds,
    and what it adds at instant turns by its slope alone."""

    force: Array
    mass: Array
    whole: Array
    added: Array
    struck: Array


def rings(load: Load, shift: Array) -> Ringing:
    """What rings while anything is recorded; shift (K, V): of the frequency, by the mass."""
    here = [event for event in load.shaken.once if not event.gone]
    bare, heavy = _repeated(load, load.angle), _repeated(load, load.angle * (1.0 - shift))
    again, none = load.shaken.again, np.zeros_like(load.mass)
    force = _after(load, here, none, 1.0) + _after(load, again, none, 1.0) * bare
    mass = _after(load, here, load.mass, 1.0) + _after(load, again, load.mass, 1.0) * heavy
    alike = _after(load, here, load.mass, 1.0) + _after(load, again, load.mass, 1.0) * bare
    smooth = _after(load, here, load.mass, 0.0) + _after(load, again, load.mass, 0.0) * bare
    driven = _driven(load, load.angle), _driven(load, load.angle * (1.0 - shift))
    whole = mass if len(here) == len(load.shaken.once) else _after(load, load.shaken.once, load.mass, 1.0)
    return Ringing(
        np.maximum(force, driven[0]),
        np.maximum(mass, driven[1]),
        np.maximum(np.maximum(mass, whole), driven[1]),
        np.maximum(alike - force, 0.0),
        np.maximum(alike - smooth, 0.0),
    )


def drift(load: Load, shift: Array) -> Array:
    """Largest e^(-zeta x) 2 sin(shift x/2) to the end: how far two ringings drift apart whose frequencies differ by
    a part of themselves."""
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.where(shift > 0.0, 2.0 * np.arctan2(shift, 2.0 * load.zeta) / shift, 0.0)
    x = np.minimum(load.angle * load.shaken.duration * load.shaken.cycles, best)
    return np.asarray(np.exp(-load.zeta * x) * 2.0 * np.sin(np.minimum(0.5 * shift * x, 0.5 * np.pi)))


def square_near_by(load: Load) -> Array:
    """(K, V) mean phi^2 from the first event on while its ringing lasts; with events in every cycle, of a cycle."""
    square, length = load.shaken.square, load.shaken.duration
    if load.shaken.again or not load.shaken.once:
        return np.asarray(square.mean(axis=0)[:, None] + np.zeros_like(load.angle))
    tau, first = np.linspace(0.0, length, len(square) + 1), load.shaken.once[0].tau
    lasts = LASTS / np.maximum(load.zeta * load.angle, 1e-12)
    window = np.maximum(np.minimum(lasts, length - first), 1e-12)
    total = np.concatenate([np.zeros((1, len(load.modes))), np.cumsum(square, axis=0)]) * tau[1]
    ends = [np.interp(first + part, tau, row) for part, row in zip(window, total.T, strict=True)]
    starts = np.array([np.interp(first, tau, row) for row in total.T])
    return np.asarray((np.array(ends) - starts[:, None]) / window)


def lifted(load: Load) -> Array:
    """(V,) largest part by which ringing changes with the square root of 1 + m phi^2 from its event on, while it
    lasts; of the mode that moves most."""
    leading = int(np.argmax(load.shaken.peaks[0] / load.omega[:, 0]))
    square, found = load.shaken.square[:: STATIONS // THINNED, leading], np.zeros_like(load.mass)
    rate = 0.0 if load.shaken.again else load.zeta[leading] * load.angle[leading]
    for event in (*load.shaken.once, *load.shaken.again):
        before = 1.0 + load.mass * event.square[leading]
        for place, now in enumerate(square if not event.gone else ()):
            since = max((place + 0.5) / len(square) * load.shaken.duration - event.tau, 0.0)
            changed = np.abs(np.sqrt((1.0 + load.mass * now) / before) - 1.0)
            found = np.maximum(found, np.exp(-rate * since) * changed)
    return found


def _after(load: Load, events: Iterable[Event], mass: Array, impulse: float) -> Array:
    """(K, V) largest ringing after some events, with a mass that rides; impulse: 1 if a turn at an instant strikes
    through the slope of the track, m v w', else 0."""
    found = largest = np.zeros_like(load.angle)
    before = 0.0
    for event in events:
        found = found * np.exp(-load.zeta * load.angle * (event.tau - before))
        moves = mass * event.square[:, None]
        swings = np.sqrt(1.0 + moves)
        jump, slope, bend, change = event.jumps[:, :, None]
        struck = 1.0 + impulse * float(event.tau > 0.0) * moves / (1.0 + moves)  # not where the motion begins
        turned = np.minimum(change / load.angle * swings, event.turn[:, None])
        slower = struck * (slope + turned) + bend / load.angle * swings
        found = found + np.hypot(swings * jump, swings * slower / load.angle)
        largest, before = np.maximum(largest, found), event.tau
    return largest


def _repeated(load: Load, angle: Array) -> Array:
    """(K, V) ringing after all cycles over that after one: |1 - z^n|/|1 - z| of what a cycle leaves of it, z."""
    cycles = load.shaken.cycles
    if cycles == 1:
        return np.ones_like(angle)
    fade = np.exp(-load.zeta * load.angle)
    top = (1.0 - fade**cycles) ** 2 + 4.0 * fade**cycles * np.sin(0.5 * cycles * angle) ** 2
    low = (1.0 - fade) ** 2 + 4.0 * fade * np.sin(0.5 * angle) ** 2
    return np.asarray(np.clip(np.sqrt(top / np.maximum(low, 1e-30)), 1.0, cycles))


def _driven(load: Load, angle: Array) -> Array:
    """(K, V) what the harmonics of a path that repeats itself add near resonance."""
    return resonant(load, load.shaken.harmonics, angle, 2.0 * load.zeta) / angle**2


def resonant(load: Load, harmonics: Array, angle: Array, lag: Array) -> Array:
    """What oscillators that turn by an angle per cycle, with a lag of twice their damping ratios, add over all
    cycles to the second derivatives by tau of harmonics (H, K) or (H,)."""
    found = np.zeros_like(angle)
    for number, amplitude in enumerate(harmonics, start=1):
        part = 2.0 * np.pi * number / angle
        grown = (2.0 / (angle * load.shaken.cycles)) ** 2
        gain = 1.0 / np.sqrt((1.0 - part**2) ** 2 + (lag * part) ** 2 + grown)
        found = found + amplitude[..., None] * (2.0 * np.pi * number) ** 2 * np.maximum(gain - 1.0, 0.0)
    return found
