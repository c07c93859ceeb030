"""What shakes the modes of a body while a load moves along it, in the load's own normalised time.

The static answer of mode k to a unit load at S(tau) goes like phi_k(S(tau)). What differs from it, d, obeys

    d'' + 2 zeta omega d' + omega^2 d = -phi'' - 2 zeta omega phi'    (derivatives by time),

so it rings after every event at which phi, phi' or phi'' jumps (a load that arrives, leaves, sets off or turns), by
the jump over omega^0, omega^1 or omega^2, and follows the right side in between. A load that swings for many cycles
also drives the modes by the harmonics of its path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.bodies.modal import ModalBody
from engine.timeline import Rider, Segment, build_timeline

Array = NDArray[np.float64]

STATIONS = 256  # per unit of tau
HARMONICS = 24
SMALL = 1e-9  # of the largest: jumps that are rounding


class Event(NamedTuple):
    """A moment tau at which what drives the modes jumps: of phi, of phi' by tau, and of the two parts of phi'', by the
    shape's curvature and by the change of speed (4, K); phi^2 (K,) there; what a turn at an instant with half the top
    speed would do there (K,), which a change of speed cannot exceed; and whether the load is gone."""

    tau: float
    jumps: Array
    square: Array
    turn: Array
    gone: bool


@dataclass(frozen=True, eq=False)
class Excitation:
    """A load on its way, for K modes of its body.

    once: events of the whole motion, or of the first cycle alone. again: events of every cycle. cycles: how many.
    duration: tau of one, or of the whole motion. peaks: largest |phi|, |phi'|, |phi''| by tau (3, K). square: phi^2 at
    equally spaced tau (S, K), 0 off the body. harmonics: amplitudes (H, K) of phi by the cycle's harmonics 1 to H, none
    without cycles. square_harmonics: (H,) those of the first mode's phi^2, over its largest. places, speed, change: S,
    dS/dtau and its derivative where it is on the body, (P,).
    """

    once: tuple[Event, ...]
    again: tuple[Event, ...]
    cycles: int
    duration: float
    peaks: Array
    square: Array
    harmonics: Array
    square_harmonics: Array
    places: Array
    speed: Array
    change: Array


class _Piece(NamedTuple):
    """A part of the way between two events: place, speed and change of speed; phi, phi' and both parts of phi'' by tau
    (4, S, K); and what a turn at an instant with half the top speed would do there (S, K)."""

    path: tuple[Array, Array, Array]
    driven: Array
    turn: Array


def excitation(rider: Rider, body: ModalBody, modes: NDArray[np.int64], *, settled: bool, leaves: bool) -> Excitation:
    """What a load shakes.

    modes: numbers of the modes. settled: it begins in static equilibrium. leaves: what follows its end counts too.
    """
    motion, cycles = rider.motion, 1
    if motion.period is not None:
        cycles = int(motion.duration)
        motion = motion.model_copy(update={"cycles": 1})
    own = Rider(motion, rider.length, offset=rider.offset)
    segments = [s for s in build_timeline((own,), STATIONS, "whole").segments if not s.free]
    pieces = [_piece(own, body, modes, segment) if segment.active[0] else None for segment in segments]
    on = [piece for piece in pieces if piece is not None] or [_idle(_piece(own, body, modes, segments[0]))]
    peaks = np.max([_peaks(piece.driven) for piece in on], axis=0)
    first, inner = _start(pieces[0], settled), list(_between(pieces, segments))
    if rider.motion.period is None:
        last = [_event(segments[-1].end, pieces[-1], None)] if leaves else []
        once, again = [*first, *inner, *last], []
    else:
        once, again = first, [*inner, _event(segments[-1].end, pieces[-1], pieces[0])]
    places, speed, change = (np.concatenate([piece.path[k] for piece in on]) for k in range(3))
    sampled = _sampled(own, body, modes, segments)
    most = HARMONICS if rider.motion.period is not None else 0
    return Excitation(
        tuple(_felt(once, peaks)),
        tuple(_felt(again, peaks)),
        cycles,
        own.end,
        peaks,
        sampled**2,
        _harmonics(sampled)[:most],
        _harmonics(sampled[:, :1] ** 2)[:most, 0] / max(float(np.max(sampled[:, 0] ** 2)), 1e-300),
        places,
        speed,
        change,
    )


def _harmonics(sampled: Array) -> Array:
    """(H, K) amplitudes of the harmonics 1 to H of a cycle of samples (S, K)."""
    return np.asarray(2.0 * np.abs(np.fft.rfft(sampled, axis=0))[1 : HARMONICS + 1] / len(sampled))


def _piece(own: Rider, body: ModalBody, modes: NDArray[np.int64], segment: Segment) -> _Piece:
    tau = np.linspace(segment.start, segment.end, max(9, segment.steps + 1))
    path = own.path(tau, segment.start, segment.end)
    place = np.clip(path.S, 0.0, own.length)
    shape, slope, bend = (body.shape(place, derivative)[:, modes] for derivative in range(3))
    speed, change = path.dS[:, None], path.ddS[:, None]
    driven = np.stack([shape, slope * speed, bend * speed**2, slope * change])
    return _Piece((place, path.dS, path.ddS), driven, np.abs(slope) * own.motion.max_speed)


def _idle(piece: _Piece) -> _Piece:
    """A piece on which nothing happens, for a contact that never comes onto its body."""
    place, *rates = piece.path
    return _Piece((place, 0.0 * rates[0], 0.0 * rates[1]), 0.0 * piece.driven, 0.0 * piece.turn)


def _peaks(driven: Array) -> Array:
    """(3, K) largest |phi|, |phi'|, |phi''|."""
    return np.asarray(np.abs(np.stack([driven[0], driven[1], driven[2] + driven[3]])).max(axis=1))


def _start(first: _Piece | None, settled: bool) -> list[Event]:
    """The beginning, if the load is on the body: it sets off from where it stands, or is put there."""
    if first is None:
        return []
    event = _event(0.0, None, first)
    if settled:
        event.jumps[0] = 0.0
    return [event]


def _between(pieces: list[_Piece | None], segments: list[Segment]) -> Iterator[Event]:
    for place in range(1, len(pieces)):
        yield _event(segments[place].start, pieces[place - 1], pieces[place])


def _event(tau: float, before: _Piece | None, after: _Piece | None) -> Event:
    """What jumps between two pieces; off the body (None) nothing is driven."""
    known = after if after is not None else before
    if known is None:
        return Event(tau, np.zeros((4, 0)), np.zeros(0), np.zeros(0), True)
    old = np.zeros_like(known.driven[:, 0]) if before is None else before.driven[:, -1]
    new = np.zeros_like(old) if after is None else after.driven[:, 0]
    edge = 0 if after is not None else -1
    return Event(tau, np.abs(new - old), known.driven[0, edge] ** 2, known.turn[edge], after is None)


def _felt(events: list[Event], peaks: Array) -> Iterator[Event]:
    """Events at which anything jumps by more than rounding."""
    least = SMALL * np.maximum(peaks[[0, 1, 2, 2]].max(axis=1, keepdims=True), 1e-300)
    for event in events:
        if event.jumps.size and np.any(event.jumps > least):
            yield event._replace(jumps=np.where(event.jumps > least, event.jumps, 0.0))


def _sampled(own: Rider, body: ModalBody, modes: NDArray[np.int64], segments: list[Segment]) -> Array:
    """(S, K) phi at equally spaced tau."""
    length = segments[-1].end
    tau = (np.arange(STATIONS) + 0.5) / STATIONS * length
    found = np.zeros((STATIONS, modes.size))
    for segment in segments:
        here = (tau >= segment.start) & (tau < segment.end)
        if segment.active[0] and here.any():
            place = np.clip(own.path(tau[here], segment.start, segment.end).S, 0.0, own.length)
            found[here] = body.shape(place)[:, modes]
    return found
