"""Statics of a frame along its track, exact for the finite-element model.

A load at s acts on the ends of its element through the static shapes, and the element with held ends bends besides:
w(x; s) = c(x)^T G c(s) + w_held(x; s), c the shapes, G the flexibility between the track's points. For Euler-Bernoulli
and Timoshenko members this is the exact beam solution between the nodes, not only at them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from engine.bodies.frame.assembly import Assembly
from engine.bodies.frame.track import Line, TrackBeams, TrackPoints, track_places
from engine.bodies.modal.flexibility import Flexibility, without_rounding
from engine.bodies.modal.modal_body import Array, refuse_loose
from results_schema.arrays import Counts

_ENDS = 32  # ends of elements whose loads are solved at a time
_SAMPLES = 5  # places per element that show every pattern of its cubic shapes


@dataclass(frozen=True, eq=False)
class TrackInfluence:
    """Influence functions along a track: its motion as the line ``track`` reads it, under unit loads on that of
    ``loads``.

    patterns (r, 6): orthonormal, all that loads on the track do to a point; flexibility (6 (E + 1), r (E + 1)):
    displacements and rotations of all points per unit of each pattern on each.
    """

    track: Line
    loads: Line
    patterns: Array
    flexibility: Array

    @property
    def length(self) -> float:
        """Of the track, m."""
        return float(self.track.places[-1])

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` per unit force at `s`, m^(1-j)/N, for pairs that are broadcast against each
        other; (X, 1) and (S,) are fast."""
        left, right = track_places(x, self.length, derivative), track_places(s, self.length, 0)
        if is_every_pair(left, right):
            place = left.reshape(-1)
            element, _ = self.track.at(place)
            whole = self.lines(element, self.track.to_ends(place, derivative), right)
            i, j = np.nonzero(element[:, None] == self.track.at(right)[0])
            whole[i, j] += self.track.within(place[i], right[j], derivative, self.loads)
            return whole.reshape(np.broadcast_shapes(left.shape, right.shape))
        place, load = np.broadcast_arrays(left, right)
        return self._deflection(place.reshape(-1), load.reshape(-1), derivative).reshape(place.shape)

    def under_response(self, response: Array, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) where the track's points move by `response` (6 (E + 1),)."""
        place = track_places(x, self.length, derivative)
        return self.track.where_ends_move(response.reshape(-1, 6), place, derivative)

    def moved(self, element: Counts, s: Array) -> Array:
        """(S, 12) displacements and rotations of an element's ends under a unit load at s, pair by pair."""
        count = len(self.patterns)
        other, _ = self.track.at(s)
        acts = self.loads.to_ends(s).reshape(-1, 2, 6) @ self.patterns.T
        found = np.zeros((len(s), 12))
        for row in range(12):
            for end in range(2):
                for pattern in range(count):
                    flexible = self.flexibility[6 * element + row, count * (other + end) + pattern]
                    found[:, row] += flexible * acts[:, end, pattern]
        return found

    def lines(self, element: Counts, takes: Array, s: Array) -> Array:
        """(X, S) sums of `takes` (X, 12) times the motions of the ends of elements (X,) under a unit load at each s.

        As `moved`, for all places with all loads, in a small part of the time.
        """
        count = len(self.patterns)
        rows = 6 * element[:, None] + np.arange(12)
        flexible = np.sum(takes[:, :, None] * self.flexibility[rows], axis=1)
        other, _ = self.track.at(s)
        ends = self.loads.to_ends(s).reshape(-1, 2, 6)
        found = np.zeros((len(element), len(s)))
        for end in range(2):
            for number, pattern in enumerate(self.patterns):
                found += flexible[:, count * (other + end) + number] * np.sum(ends[:, end] * pattern, axis=1)
        return found

    def _deflection(self, x: Array, s: Array, derivative: int) -> Array:
        """Pair by pair, summed in a fixed order so that a value never depends on its neighbours."""
        element, _ = self.track.at(x)
        takes, found = self.track.to_ends(x, derivative), self.track.within(x, s, derivative, self.loads)
        moved = self.moved(element, s)
        for row in range(12):
            found = found + takes[:, row] * moved[:, row]
        return found


@dataclass(frozen=True, eq=False)
class TrackStatics(TrackInfluence):
    """Influence functions of a track's deflection.

    weight (6 (E + 1),): motion of all points under own weight per unit gravity; spread (E, 3): own weight per length
    along the elements' axes, kg/m; rigid: number of rigid-body modes.
    """

    track: TrackBeams
    weight: Array
    spread: Array
    rigid: int

    def own_weight_deflection(self, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) under own weight per unit gravity, m^(1-j)/(m/s^2)."""
        refuse_loose(self.rigid)
        place = track_places(x, self.length, derivative)
        found = self.under_response(self.weight, place, derivative)
        return np.asarray(found + self.track.under_spread_load(place, self.spread, derivative))


def is_every_pair(x: Array, s: Array) -> bool:
    """Whether places (X, 1), or a single one, meet many loads (S,)."""
    return s.ndim == 1 and s.size > 1 and x.size == x.shape[0] and (x.ndim == 2 or x.size == 1)


def track_statics(
    track: TrackBeams, points: TrackPoints, assembly: Assembly, flexibility: Flexibility, gravity: Array, spread: Array
) -> TrackStatics:
    """Statics from a factorised model; gravity (3,): unit vector; spread (E, 3): see `TrackStatics`."""
    patterns, moved = responses(track, points, assembly, flexibility)
    rigid = assembly.rigid.shape[1]
    weight = np.zeros((len(moved), 1))
    if not rigid:
        pull = assembly.drag @ gravity
        weight = points.of(assembly.whole(flexibility.solve(pull[:, None]))).reshape(len(moved), 1)
    weight = without_rounding(weight, 0)
    return TrackStatics(track, track, patterns, moved, weight[:, 0], spread, rigid)


def responses(loads: Line, points: TrackPoints, assembly: Assembly, flexibility: Flexibility) -> tuple[Array, Array]:
    """Patterns of a line's loads, and the motions of all points under them, as of `TrackInfluence`."""
    patterns = _patterns(loads)
    size, total = 6 * len(loads.places), 6 * len(assembly.mesh.points)
    moved = np.zeros((size, len(loads.places) * len(patterns)))
    for ends in np.array_split(np.arange(len(loads.places)), -(-len(loads.places) // _ENDS)):
        acting = points.loads(patterns, ends, total)[assembly.free]
        columns = slice(len(patterns) * ends[0], len(patterns) * (ends[-1] + 1))
        moved[:, columns] = points.of(assembly.whole(flexibility.solve(acting))).reshape(size, -1)
    return patterns, without_rounding(moved, 0)


def _patterns(track: Line) -> Array:
    """(r, 6) orthonormal basis of all that a load anywhere on the track does to a point, forces and torques apart."""
    steps = np.linspace(0.0, 1.0, _SAMPLES + 2)[1:-1]
    places = (track.places[:-1, None] + np.diff(track.places)[:, None] * steps).reshape(-1)
    acts = track.to_ends(places).reshape(-1, 6)
    found = []
    for part in (slice(0, 3), slice(3, 6)):
        _, sizes, directions = np.linalg.svd(np.linalg.qr(acts[:, part], mode="r"))
        for direction in directions[: int(np.count_nonzero(sizes > 1e-12 * sizes.max(initial=0.0)))]:
            row = np.zeros(6)
            row[part] = direction
            found.append(row)
    return np.array(found)
