"""How far the modes of a body ring after a load, and what changes that ringing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.excitation import STATIONS, Event
from engine.moving_load import Load

Array = NDArray[np.float64]

LASTS = 3.0  # over zeta omega: ringing that is older has gone
LEAST_GAIN = 1.2  # of a harmonic that counts as near resonance
THINNED = 16  # stations of a way at which decaying parts are looked at


class Ringing(NamedTuple):
    """Ringing (K, V) per unit of drive: of a force, of the mass, of it after the load has left too, what the mass adds,
    and what it adds at instant turns by its slope alone."""

    force: Array
    mass: Array
    whole: Array
    added: Array
    struck: Array


class _Rung(NamedTuple):
    """Ringing (K, V) with a mass, with what instant turns strike through the slope of the track and without; and of a
    force alone."""

    struck: Array
    smooth: Array
    light: Array


def rings(load: Load, shift: Array) -> Ringing:
    """What rings while anything is recorded; shift (K, V): of the frequency, by the mass."""
    lower = load.angle * (1.0 - shift)
    bare, heavy = _repeated(load, load.angle, lower)
    here = [event for event in load.shaken.once if not event.gone]
    first, each = _left(load, _after(load, here)), _after(load, load.shaken.again)
    light, mass = first.light + each.light * bare, first.struck + each.struck * heavy
    alike, smooth = first.struck + each.struck * bare, first.smooth + each.smooth * bare
    gone = len(here) < len(load.shaken.once)
    whole = np.maximum(mass, _after(load, load.shaken.once).struck) if gone else mass
    with_mass = _driven(load, lower)
    return Ringing(
        np.maximum(light, _driven(load, load.angle)),
        np.maximum(mass, with_mass),
        np.maximum(whole, with_mass),
        np.maximum(alike - light, 0.0),
        alike - smooth,
    )


def _left(load: Load, first: _Rung) -> _Rung:
    """What is left of the start's ringing in what is recorded."""
    if load.route.window == "whole":
        return first
    part = np.exp(-load.fading * (load.shaken.duration * (load.shaken.cycles - 1)))
    return _Rung(*(part * size for size in first))


def lowered(square: Array, mass: Array) -> Array:
    """(K, V) part by which a mass lowers the frequency of every mode whose phi^2 is this on average."""
    return np.asarray(1.0 - 1.0 / np.sqrt(1.0 + mass * square))


def drift(load: Load, shift: Array) -> Array:
    """Largest e^(-zeta x) 2 sin(shift x/2) to the end: how far two ringings drift apart whose frequencies differ by
    a part of themselves."""
    turns = load.angle * (load.shaken.duration * load.shaken.cycles)
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.where(shift > 0.0, np.arctan(0.5 * shift / load.zeta) / (0.5 * shift), 0.0)
    x = np.minimum(turns, best)
    return np.asarray(np.exp(-load.zeta * x) * 2.0 * np.sin(0.5 * shift * x))


def square_near_by(load: Load) -> Array:
    """(K, V) mean phi^2 from the first event on while its ringing lasts; with events in every cycle, of a cycle."""
    square, length = load.shaken.square, load.shaken.duration
    if load.shaken.again or not load.shaken.once:
        return np.asarray(square.mean(axis=0)[:, None] + np.zeros_like(load.angle))
    tau, first = np.linspace(0.0, length, len(square) + 1), load.shaken.once[0].tau
    lasts = LASTS / np.maximum(load.fading, 1e-12)
    window = np.clip(lasts, 1e-12, max(length - first, 1e-12))
    step, modes = length / len(square), np.arange(len(load.modes))
    total = np.concatenate([np.zeros((1, modes.size)), np.cumsum(square, axis=0)]) * step
    starts = np.array([np.interp(first, tau, row) for row in total.T])
    place = np.minimum(first + window, length) / step
    before = np.minimum(place.astype(np.int64), len(square) - 1)  # as np.interp does, which is slower
    ends = total[before, modes[:, None]] + (place - before) * square[before, modes[:, None]] * step
    return np.asarray((ends - starts[:, None]) / window)


def lifted(load: Load) -> Array:
    """(V,) largest part by which ringing changes with the square root of 1 + m phi^2 from its event on, while it
    lasts; of the mode that moves most."""
    leading = int(np.argmax(load.shaken.peaks[0] / load.route.omega[:, 0]))
    square, found = load.shaken.square[:: STATIONS // THINNED, leading], np.zeros_like(load.mass)
    rate = 0.0 if load.shaken.again else load.fading[leading]
    for event in (*load.shaken.once, *load.shaken.again):
        before = 1.0 + load.mass * event.square[leading]
        for place, now in enumerate(square if not event.gone else ()):
            since = max((place + 0.5) / len(square) * load.shaken.duration - event.tau, 0.0)
            changed = np.abs(np.sqrt((1.0 + load.mass * now) / before) - 1.0)
            found = np.maximum(found, np.exp(-rate * since) * changed)
    return found


def _after(load: Load, events: Sequence[Event]) -> _Rung:
    """Largest ringing after some events. A turn at an instant strikes through the slope of the track too, m v w'."""
    none = np.zeros_like(load.angle)
    found, largest, before = _Rung(none, none, none), _Rung(none, none, none), 0.0
    for event in events:
        if event.tau > before:
            faded = np.exp(-load.fading * (event.tau - before))
            found = _Rung(*(part * faded for part in found))
        found = _Rung(*(part + more for part, more in zip(found, _struck(load, event), strict=True)))
        largest = _Rung(*(np.maximum(part, now) for part, now in zip(largest, found, strict=True)))
        before = event.tau
    return largest


def _struck(load: Load, event: Event) -> _Rung:
    """What one event sets ringing."""
    moves = load.mass * event.square[:, None]
    jump, slope, bend, change = event.jumps[:, :, None]
    bent, slower, swings = bend / load.angle, slope, np.sqrt(1.0 + moves)
    light = _length(jump, (slope + bent) / load.angle)
    if change.any():
        turned = change / load.angle
        light = _length(jump, (slope + np.minimum(turned, event.turn[:, None]) + bent) / load.angle)
        slower = slope + np.minimum(turned * swings, event.turn[:, None])
    struck = smooth = swings * _length(jump, (slower + bent * swings) / load.angle)
    if event.tau > 0.0:  # not where the motion begins
        struck = swings * _length(jump, ((1.0 + moves / (1.0 + moves)) * slower + bent * swings) / load.angle)
    return _Rung(struck, smooth, light)


def _length(one: Array, other: Array) -> Array:
    """Square root of the sum of squares; `numpy.hypot` takes ten times as long."""
    return np.sqrt(one**2 + other**2) if one.any() else other


def _repeated(load: Load, *angles: Array) -> list[Array]:
    """(K, V) ringing after all cycles over that after one: |1 - z^n|/|1 - z| of what a cycle leaves of it, z."""
    cycles = load.shaken.cycles
    if cycles == 1:
        return [np.ones_like(angle) for angle in angles]
    fade, faded = np.exp(-load.fading), np.exp(-cycles * load.fading)
    tops = ((1.0 - faded) ** 2 + 4.0 * faded * np.sin(0.5 * cycles * angle) ** 2 for angle in angles)
    lows = ((1.0 - fade) ** 2 + 4.0 * fade * np.sin(0.5 * angle) ** 2 for angle in angles)
    parts = zip(tops, lows, strict=True)
    return [np.clip(np.sqrt(top / np.maximum(low, 1e-30)), 1.0, cycles) for top, low in parts]


def _driven(load: Load, angle: Array) -> Array:
    """(K, V) what the harmonics of a path that repeats itself add near resonance."""
    return resonant(load, load.shaken.harmonics, angle, 2.0 * load.zeta) / angle**2


def resonant(load: Load, harmonics: Array, angle: Array, lag: Array) -> Array:
    """What oscillators that turn by an angle per cycle, with a lag of twice their damping ratios, add over all
    cycles to the second derivatives by tau of harmonics (H, K) or (H,): of each the gain beyond LEAST_GAIN, as less is
    part of what follows the drive."""
    low, high = (1.0 / np.sqrt(1.0 - side / LEAST_GAIN) for side in (-1.0, 1.0))
    order = np.flatnonzero(angle < high * 2.0 * np.pi * len(harmonics))
    order = order[np.argsort(angle.ravel()[order])]  # so that what is near a harmonic is next to each other
    turned, mode = angle.ravel()[order], order // angle.shape[-1]
    lagging, grown = (lag.ravel()[order] / turned) ** 2, (2.0 / load.shaken.cycles / turned) ** 2
    found = np.zeros_like(turned)
    for number, amplitude in enumerate(harmonics, start=1):
        drive = 2.0 * np.pi * number
        near = slice(*np.searchsorted(turned, (low * drive, high * drive)))
        part = (drive / turned[near]) ** 2
        gain = 1.0 / np.sqrt((1.0 - part) ** 2 + drive**2 * lagging[near] + grown[near])
        size = np.atleast_1d(amplitude)[mode[near]] * drive**2
        found[near] += size * np.maximum(gain - LEAST_GAIN, 0.0)
    everywhere = np.zeros(angle.size)
    everywhere[order] = found
    return everywhere.reshape(angle.shape)
