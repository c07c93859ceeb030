"""Statics of a frame along its track, exact for the finite-element model.

A load at s acts on the ends of its element through the static shapes, and the element with held ends bends besides:
w(x; s) = c(x)^T G c(s) + w_held(x; s), c the shapes, G the flexibility between the track's points. For Euler-Bernoulli
and Timoshenko members this is the exact beam solution between the nodes, not only at them. It is a cubic of x and of s
for every pair of elements, which is found once and serves all loads wherever they go.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from engine.bodies.frame.assembly import Assembly
from engine.bodies.frame.track import Line, TrackBeams, TrackPoints, track_places
from engine.bodies.modal.flexibility import Flexibility, without_rounding
from engine.bodies.modal.modal_body import Array, refuse_loose
from engine.kernels.cubics import cubics_at, cubics_of_pairs

_ENDS = 32  # ends of elements whose loads are solved at a time
_SAMPLES = 5  # places per element that show every pattern of its cubic shapes


@dataclass(frozen=True, eq=False)
class PairsOfPlaces:
    """What loads along a line do along it, at pairs of places: see `cubics_of_pairs`."""

    places: Array
    apart: Array
    beyond: Array

    def at(self, x: Array, s: Array) -> Array:
        """At places x by loads at s, broadcast against each other; no value depends on its neighbours."""
        shape = np.broadcast_shapes(x.shape, s.shape)
        place, load = (np.broadcast_to(one, shape).flatten() for one in (x, s))
        found = np.empty(place.size)
        cubics_of_pairs(self.places, self.apart, self.beyond, place, load, found)
        return found.reshape(shape)


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
    _found: dict[str, PairsOfPlaces] = field(default_factory=dict, init=False, repr=False)
    _takes: dict[int, Array] = field(default_factory=dict, init=False, repr=False)

    @property
    def length(self) -> float:
        """Of the track, m."""
        return float(self.track.places[-1])

    def influence_at(self, x: ArrayLike, s: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` per unit force at `s`, m^(1-j)/N, for pairs that are broadcast against each
        other."""
        place, load = places_on(x, self.length, derivative), places_on(s, self.length, 0)
        read, held = (partial(one, derivative=derivative) for one in (self.track.to_ends, self._within))
        return self.pairs(str(derivative), read, held).at(place, load)

    def under_response(self, response: Array, x: ArrayLike, derivative: int = 0) -> Array:
        """d^j/dx^j of the deflection at `x` (X,) where the track's points move by `response` (6 (E + 1),)."""
        place, ends = track_places(x, self.length, derivative), response.reshape(-1, 6)
        if derivative not in self._takes:
            self._takes[derivative] = cubics_of(self.track.places, partial(self.track.to_ends, derivative=derivative))
        moved, found = np.concatenate([ends[:-1], ends[1:]], axis=1), np.empty(len(place))
        cubics_at(self.track.places, np.sum(self._takes[derivative] * moved[:, :, None], axis=1), place, found)
        return found

    def pairs(self, name: str, read: Callable[[Array], Array], held: Callable[[Array, Array], Array]) -> PairsOfPlaces:
        """What is read of the elements' ends, ``read`` (S,) -> (S, 12), and of elements with ``held`` ends at pairs of
        places on one of them; kept by its name."""
        if name not in self._found:
            places, patterns = self.track.places, len(self.patterns)
            rows = sliding_window_view(self.flexibility, 12, axis=0)[::6]
            read_of = np.einsum("eik,eji->ekj", cubics_of(places, read), rows)
            columns = sliding_window_view(read_of, 2 * patterns, axis=2)[:, :, ::patterns]
            apart = np.einsum("ekfj,fjm->efkm", columns, cubics_of(places, self._acts))
            before, beyond = (_held_cubics(places, held, *halves) for halves in (_HALVES, _HALVES[::-1]))
            own = np.arange(len(apart))
            beyond += apart[own, own]
            apart[own, own] += before
            self._found[name] = PairsOfPlaces(places, apart, beyond)
        return self._found[name]

    def _acts(self, s: Array) -> Array:
        """(S, 2 r) patterns of the unit load at s on both ends of its element."""
        return np.asarray(self.loads.to_ends(s).reshape(-1, 2, 6) @ self.patterns.T).reshape(len(s), -1)

    def _within(self, x: Array, s: Array, derivative: int) -> Array:
        return self.track.within(x, s, derivative, self.loads)


def cubics_of(places: Array, function: Callable[[Array], Array]) -> Array:
    """(E, c, 4) the cubics that functions of places (S,), as (S, c), are between joints (E + 1,)."""
    values = function(_inside(places, _NODES).reshape(-1)).reshape(len(places) - 1, len(_NODES), -1)
    return np.asarray(np.einsum("kn,enc->eck", _powers_from(_NODES), values))


def _held_cubics(places: Array, held: Callable[[Array, Array], Array], x: Array, s: Array) -> Array:
    """(E, 4, 4) what elements with held ends add, from places ``x`` and ``s`` in their halves."""
    at, load = _inside(places, x)[:, :, None], _inside(places, s)[:, None]
    values = held(*(part.reshape(-1) for part in np.broadcast_arrays(at, load))).reshape(-1, len(x), len(s))
    return np.asarray(np.einsum("kn,enl,ml->ekm", _powers_from(x), values, _powers_from(s)))


def _inside(places: Array, nodes: Array) -> Array:
    """(E, n) places of nodes from -1 to 1 in every element."""
    return np.asarray(places[:-1, None] + np.diff(places)[:, None] * 0.5 * (nodes + 1.0))


def _powers_from(nodes: Array) -> Array:
    """(4, 4) coefficients of powers from values at four nodes."""
    return np.asarray(np.linalg.inv(np.vander(nodes, increasing=True)), dtype=np.float64)


_NODES = np.cos(np.pi * (np.arange(4) + 0.5) / 4.0)  # by which a cubic is known best
_HALVES = 0.5 * (_NODES - 1.0), 0.5 * (_NODES + 1.0)


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


def places_on(places: ArrayLike, length: float, derivative: int) -> Array:
    """`track_places` of places of any shape."""
    return track_places(np.ravel(places), length, derivative).reshape(np.shape(np.atleast_1d(places)))


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
