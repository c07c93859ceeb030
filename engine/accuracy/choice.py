"""What every variant of a sweep is computed with, by the measured errors of its neighbours among some pilots.

A variant takes the cheapest rung of the ladder that holds by what its nearest pilots tell, and is told the errors that
these tell of it. Distances count every axis by how fast the errors of pilots change along it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.climb import Climb, Measured
from engine.accuracy.grids import SceneGrid
from engine.accuracy.jobs import Crashed, Halted, Job, Share, Told, over_scenes, untold
from engine.accuracy.ladder import Ladder, ladder_of
from engine.accuracy.neighbour_errors import (
    TELLING,
    NeighbourErrors,
    Numbers,
    Places,
    nearest_others,
    neighbour_errors_of,
)
from engine.accuracy.pilots import coordinates, varied
from engine.accuracy.results import Result, deciding, results_of, worst_held
from engine.kernels.nearest_pilots import cheapest, nearest
from engine.march.outcome import Asked
from engine.scene.sweep import Cases
from engine.scene.variants import VariantValues, cases_tolerance
from results_schema.arrays import Array, Counts, Mask

#: Of which the worst is not believed. Of 96 to 192 variants of each of 34 random sweeps 0.99, 0.80 and 0.99 % of
#: displacements missed by 8, 10 and 12, at 5.0, 5.1 and 5.3 times the least work on average; 0.94 % by 8 of which the
#: worst is believed, at 6.6 times.
NEIGHBOURS = 10
DOUBTED = 0.4  # of the tolerance by which a reference is off: what such pilots tell is apart (see `_sorts`)
# What is said of the next three was measured on `asymmetry`, `double-peak` and 10,000 passages, with 128 to 256 pilots,
# by the largest error of 6 neighbours.
LEAST_WEIGHT = 0.02  # of the largest weight of an axis: none is left out; 0.005 to 0.1 chose alike
NEAR_PAIRS = 12  # pairs of near pilots per pilot that tell the weights: 6 to 40 took 0.7 to 1 times the work
SWEEPS = 50  # over the weights: scipy's to eight digits, but for axes that tell the same twice
APART = 1e6  # times the largest weight: what has 63 modes is farther from what has 64 than all others with 64


@dataclass(frozen=True, eq=False)
class Choice:
    """The rung of every variant. pilots (P,): their flat numbers; neighbours (V, k) numbers of pilots; rung (V,): of
    the ladder's columns x cuts. weights: how much each axis of the sweep counts."""

    cases: Cases
    ladder: Ladder
    results: tuple[Result, ...]
    pilots: Counts
    measured: Measured
    weights: Array
    neighbours: NDArray[np.unsignedinteger[Any]]
    rung: NDArray[np.int32]
    foreseen: Cheapest
    found: Cheapest

    def around(self, variants: Counts, vibration: Array | None = None) -> Around:
        """What pilots tell of some variants. vibration (V,): of their marches, where it is known."""
        places = coordinates(self.cases, variants) * self.weights
        if vibration is not None:
            places = np.concatenate([places, vibration[:, None]], axis=1)
        by = self.foreseen if vibration is None else self.found
        return Around(by, self._march, places, self.neighbours[variants].astype(np.int32))

    @cached_property
    def _march(self) -> NDArray[np.int32]:
        """(columns x cuts, P) the march that tells of a rung."""
        return self.measured.march.reshape(-1, self.measured.march.shape[2])


class Around(NamedTuple):
    """Some variants among pilots: weighted places (V, D), and numbers of neighbours (V, k) that tell by their marches
    (columns x cuts, P)."""

    by: Cheapest
    march: NDArray[np.int32]
    places: Array
    neighbours: Numbers

    def errors(self, rung: Numbers) -> Array:
        """(R, V) estimated errors of the variants on rungs (V,); NaN where no estimate exists."""
        return self.by.errors.errors(self.march, rung, self.places, self.neighbours)

    def held(self, rung: Numbers, tighter: Array) -> Array:
        """(V,) the largest of the errors that are held, less what the study fixes, over their tolerances; tighter (V,):
        `solver.tolerance` of the variants over the study's."""
        return self.by.errors.worst(rung, self.places, self.neighbours, tighter)

    def rungs(self, tighter: Array) -> Numbers:
        """(V,) the cheapest rungs that hold."""
        return self.by.of(self.places, self.neighbours, tighter)


class Cheapest(NamedTuple):
    """How variants find the cheapest rung that holds: what is wanted of rungs in the order of their work, their slopes
    and their numbers, how many are worth it where none holds, and the errors that are told."""

    errors: NeighbourErrors
    wanted: Array
    slopes: Array
    ranked: NDArray[np.int32]
    worth: int

    @classmethod
    def by(cls, errors: NeighbourErrors, cost: Array, held: Array) -> Cheapest:
        """By what pilots tell. cost (columns x cuts,), held (columns x cuts, P) of rungs, infinite where no pilot was
        on them."""
        ranked = np.argsort(cost, kind="stable").astype(np.int32)
        known = np.any(np.isfinite(held[ranked]), axis=1)
        ranked = ranked[known | ~known.any()]  # all of them where no pilot has values anywhere
        worth = max(1, int(np.count_nonzero(cost[ranked] <= MOST_UNHELD)))
        wanted, slopes = (np.ascontiguousarray(part[..., ranked]) for part in (errors.wanted, errors.held_slopes))
        return cls(errors, wanted, slopes, ranked, worth)

    def of(self, places: Array, neighbours: Numbers, tighter: Array) -> Numbers:
        """(V,) the rungs of variants at weighted places (V, D)."""
        rung = np.empty(tighter.size, dtype=np.int32)
        cheapest(self.wanted, (self.slopes, places), self.worth, neighbours, np.log(tighter), rung)
        return np.asarray(self.ranked[rung])


class Pilots(NamedTuple):
    """Pilots of a sweep (by flat numbers) and their scenes by number, which many variants share. span: of their
    tolerances."""

    asked: Asked
    cases: Cases
    grids: Mapping[int, SceneGrid]
    span: tuple[float, float]

    def measured(self, pilots: Counts, share: Share, scene: int) -> tuple[int, Counts, Measured]:
        """What some pilots of a scene find; with its number and theirs. Raises Halted, and Crashed."""
        grid = self.grids[scene]
        # Pilots serve the tightest that has them for neighbours.
        values = VariantValues.of(grid.scene.study, self.cases, pilots).all_as_tight(self.span[0])
        try:
            return scene, pilots, Climb(grid.of_pilots(), values, self.ladder(scene), share, self.span).go()
        except Crashed as crashed:
            raise Crashed(pilots[crashed.lanes]) from None

    def ladder(self, scene: int) -> Ladder:
        """The ladder of a scene."""
        return ladder_of(self.asked, self.grids[scene])

    def cost(self, scene: int) -> Array:
        """(columns x cuts,) modes x steps of every rung; nothing for statics."""
        grid, ladder = self.grids[scene], self.ladder(scene)
        modes = [0 if c.fidelity == "static" else grid.model(c).body_modes for c in ladder.columns]
        return np.asarray(np.outer(modes, grid.unit * np.array(ladder.cuts, dtype=np.float64)).reshape(-1))


class Found(NamedTuple):
    """What the pilots of a sweep found: their flat numbers in the order of what they found, and the first scene of
    these, whose ladder is that of all."""

    scene: int
    pilots: Counts
    measured: Measured


class Kept(Protocol):
    """What keeps what pilots found from one start of a run to the next."""

    def read(self, drawn: Counts) -> Found | None:
        """What these pilots found, where that is known."""

    def write(self, found: Found) -> None:
        """Keep it."""


def find(pilots: Pilots, members: Sequence[Counts], drawn: Counts, share: Share, told: Told = untold) -> Found:
    """What some ``drawn`` pilots of a sweep, whose scenes' variants are ``members``, find; told: of how many scenes are
    done. Raises Halted, and Crashed by flat numbers of pilots."""
    parts = [drawn[np.isin(drawn, part)] for part in members]
    own = pilots._replace(grids={scene: grid for scene, grid in pilots.grids.items() if parts[scene].size})
    found = sorted(over_scenes(share, own, Pilots.measured, parts, told), key=lambda one: (one[0], one[1][0]))
    order = np.concatenate([own for _, own, _ in found])
    return Found(found[0][0], order, _joined([measured for *_, measured in found]))


class _Neighbours(NamedTuple):
    """How variants find their neighbours among pilots, and with these their rung."""

    asked: Asked
    cases: Cases
    order: Counts
    sorts: Counts
    weights: Array
    foreseen: Cheapest

    def of(self, part: Counts, halted: Halted) -> tuple[Counts, Numbers, Numbers]:
        """The neighbours and the rungs of a row of variants, with their flat numbers."""
        neighbours = np.empty((part.size, min(NEIGHBOURS, self.order.size)), dtype=np.int32)
        own = VariantValues.of(self.asked.study, self.cases, part)
        places = coordinates(self.cases, part) * self.weights
        nearest(places, self.foreseen.errors.pilots, neighbours)
        first = neighbours[:, :1]
        neighbours = np.where(self.sorts[neighbours] == self.sorts[first], neighbours, first)
        inside = np.flatnonzero((self.order >= part[0]) & (self.order <= part[-1]))
        neighbours[self.order[inside] - part[0]] = inside[:, None]  # pilots know their own errors
        rung = self.foreseen.of(places, neighbours, own.tighter)
        return part, neighbours.astype(_number_type(self.order.size)), rung


def choose(of: Pilots, found: Found, share: Share) -> Choice:
    """The choice for all variants of a sweep by what its pilots found. Raises Halted."""
    (scene, order, measured), cases = found, of.cases
    along = coordinates(cases, order)
    places = Places(along, _weights(along, measured, _sets_modes(cases)))
    others, held = nearest_others(places.weighted, NEIGHBOURS), measured.held.reshape(-1, order.size)
    foreseen = Cheapest.by(neighbour_errors_of(of.asked, measured, places, others, of.span), of.cost(scene), held)
    known = foreseen
    if of.grids[scene].listens:
        beside = Places(np.c_[along, measured.vibration], np.append(places.weights, 1.0))
        known = Cheapest.by(neighbour_errors_of(of.asked, measured, beside, others, of.span), of.cost(scene), held)
    rung = np.empty(cases.size, dtype=np.int32)
    neighbours = np.empty((cases.size, min(NEIGHBOURS, order.size)), dtype=_number_type(order.size))
    rows = np.array_split(np.arange(cases.size), -(-cases.size // AT_ONCE))
    subject = _Neighbours(of.asked, cases, order, _sorts(of, found, along), places.weights, foreseen)
    for part, near, chosen in share(subject, [Job(_Neighbours.of, row) for row in rows]):
        neighbours[part[0] : part[-1] + 1], rung[part[0] : part[-1] + 1] = near, chosen
    ladder, results = of.ladder(scene), results_of(of.asked)
    return Choice(cases, ladder, results, order, measured, places.weights, neighbours, rung, foreseen, known)


def _number_type(pilots: int) -> np.dtype[Any]:
    """The smallest type that numbers of so many pilots have: every variant keeps those of its neighbours."""
    return np.min_scalar_type(pilots - 1)


MOST_UNHELD = 5e6  # modes x steps, about two milliseconds, that a variant takes whose tolerance nothing holds
AT_ONCE = 65536  # variants that are chosen for at once: some ten milliseconds


def tolerance_span(asked: Asked, cases: Cases) -> tuple[float, float]:
    """The least and the largest `solver.tolerance` of the variants over the study's."""
    found = cases_tolerance(asked.study, cases)
    return float(found.min()), float(found.max())


def _sets_modes(cases: Cases) -> Mask:
    """(D,) which axes of places fix a number of modes: with another one a rung is another march."""
    found = [any(path.endswith(".modes") for path in axis.paths) for axis in varied(cases)]
    return np.array(found or [False])


def _sorts(of: Pilots, found: Found, along: Array) -> Counts:
    """(P,) which pilots tell together: those of the same fixed modes, and apart from these those whose reference is
    doubtful or did not converge: few of them made many others miss a tolerance that these hold."""
    results = deciding(results_of(of.asked), of.asked.study.solver.tolerance)
    doubtful = ~(worst_held(found.measured.reference, results, of.span[0]) <= DOUBTED)
    labels = np.column_stack([along[:, _sets_modes(of.cases)], doubtful])
    return np.asarray(np.unique(labels, axis=0, return_inverse=True)[1].reshape(-1), dtype=np.int64)


def _weights(points: Array, measured: Measured, apart_along: Mask) -> Array:
    """(D,) how much each axis counts, so much along some that what differs there is farthest."""
    found = _weights_by_errors(points, measured)
    return np.where(apart_along, APART * found.max(), found)


def _weights_by_errors(points: Array, measured: Measured) -> Array:
    """(D,) the same without these: squares of differences in the logarithm of errors between near pilots, as sums of
    weighted squares of their distances along the axes, by least squares without negative weights."""
    held = measured.held[measured.marched]
    logs = np.log(np.clip(held, *TELLING))
    logs = logs[(logs.max(axis=1) - logs.min(axis=1)) > 0.1]
    one, other = np.triu_indices(len(points), 1)
    apart = (points[one] - points[other]) ** 2
    near = np.argsort(apart.sum(axis=1), kind="stable")[: NEAR_PAIRS * len(points)]
    if not logs.size or not near.size:
        return np.ones(points.shape[1])
    change = np.mean((logs[:, one[near]] - logs[:, other[near]]) ** 2, axis=0)
    found = _without_negative(apart[near], change)
    return np.sqrt(np.maximum(found, LEAST_WEIGHT * found.max())) if found.max() > 0.0 else np.ones(points.shape[1])


def _without_negative(columns: Array, wanted: Array) -> Array:
    """Least squares without negative weights, one weight after the other (Franc, Hlavac and Navara 2005): scipy's takes
    a sixth of a second to import, this a millisecond."""
    gram, product = columns.T @ columns, columns.T @ wanted
    found = np.zeros(len(product))
    for _ in range(SWEEPS):
        for d in range(len(found)):
            rest = product[d] - gram[d] @ found + gram[d, d] * found[d]
            found[d] = max(0.0, rest / gram[d, d]) if gram[d, d] > 0.0 else 0.0
    return found


def _joined(parts: Sequence[Measured]) -> Measured:
    """The pilots of all scenes."""
    marches = np.cumsum([0, *(len(part.error) for part in parts)])
    pilots = np.cumsum([0, *(part.reference.shape[1] for part in parts)])
    return Measured(
        np.concatenate([part.error for part in parts]),
        np.concatenate([part.pilot + first for part, first in zip(parts, pilots, strict=False)]),
        np.concatenate([part.march + np.int32(first) for part, first in zip(parts, marches, strict=False)], axis=2),
        np.concatenate([part.held for part in parts], axis=2),
        np.concatenate([part.reference for part in parts], axis=1),
        np.concatenate([part.by_elements for part in parts], axis=1),
        np.any([part.marched for part in parts], axis=0),
        sum(part.work for part in parts),
        np.concatenate([part.spent for part in parts]),
        np.concatenate([part.vibration for part in parts]),
        parts[0].free,
    )
