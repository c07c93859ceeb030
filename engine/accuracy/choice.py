"""What every variant of a sweep is computed with, by the measured errors of its neighbours among some pilots.

A variant takes the cheapest rung of the ladder on which the errors of all its nearest pilots, times a margin, are
within its tolerance; the same largest error, times the margin of each result, is the error told for it. Distances count
every axis by how fast the errors of pilots change along it; margins are what pilots would have needed, had they been
left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.grids import SceneGrid
from engine.accuracy.ladder import Climb, Ladder, Measured, ladder_of
from engine.accuracy.reference import Halted, Share, across_and_within, is_free
from engine.accuracy.results import Result, deciding, results_of, worst_held
from engine.kernels.choice import cheapest, nearest
from engine.lanes import LaneValues
from engine.outcome import Asked
from engine.sweep import Cases

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

SEED = 20261122  # of the pilots; audits have another
PILOTS = 256  # 64 needed 2.7 times the least work for 208 passages at 1e-3, 256 took 2.0 times
#: Variants for each pilot, and the fewest pilots: by 128 pilots 2,000 variants took 1.25 times the work that they took
#: by 256, the pilots half the time; by 96 one of 20 missed its tolerance. One in 16 missed resonances of `double-peak`.
SHARE_OF_PILOTS, FEWEST_PILOTS = 12, 128
# What is said of the next six was measured on `asymmetry`, `double-peak` and 10,000 passages, with 128 to 256 pilots.
NEIGHBOURS = 6  # with 4, 4 % of `double-peak` missed their tolerance; 8 took 0.7 to 1.3 times the work
#: Of the errors told for pilots that were left out are no smaller than the true ones: 0.993 doubled the work of
#: `double-peak`, and told hardly better (displacements of 12 random scenes 2.0 % below the true errors, not 2.5 %).
SURE = 0.985
LOGARITHMIC = (
    3.0  # times an axis's smallest value, from where ratios count too: without, 0.7 (`double-peak`) to 1.3 times
)
LEAST_WEIGHT = 0.02  # of the largest weight of an axis: none is left out; 0.005 to 0.1 chose alike
NEAR_PAIRS = 12  # pairs of near pilots per pilot that tell the weights: 6 to 40 took 0.7 to 1 times the work
SWEEPS = 50  # over the weights: scipy's to eight digits, but for axes that tell the same twice
TOLERANCE = "solver.tolerance"
TELLING = (0.02, 10.0)  # of the tolerance: errors that tell; with 0.3 to 1.2 some variants of `double-peak` missed it


@dataclass(frozen=True, eq=False)
class Choice:
    """The rung of every variant. pilots (P,): their flat numbers; neighbours (V, k) numbers of pilots; rung (V,): of
    the ladder's columns x cuts; margin (R,) of each result; decisive (2, columns x cuts, P): errors that are held over
    their tolerances, of those that follow the study's and of those that have their own."""

    ladder: Ladder
    results: tuple[Result, ...]
    pilots: Counts
    measured: Measured
    neighbours: NDArray[np.int32]
    rung: NDArray[np.int32]
    margin: Array
    decisive: Array

    @property
    def work(self) -> float:
        """Modes x steps over a passage or cycle of all that pilots marched."""
        return self.measured.work

    def errors(self, variants: Counts) -> Array:
        """(R, V) errors told for some variants; NaN where no estimate exists."""
        marches = self._march[self.rung[variants, None], self.neighbours[variants]]
        worst = np.max(self._told[marches], axis=1)  # of (V, k, R)
        return np.where(np.isfinite(worst), worst, np.nan).T

    def held(self, variants: Counts, tighter: Array) -> Array:
        """(V,) the largest of the errors that are held, less what the study fixes, over their tolerances; tighter (V,):
        `solver.tolerance` of the variants over the study's."""
        follows, own = np.max(self.decisive[:, self.rung[variants, None], self.neighbours[variants]], axis=2)
        return np.asarray(np.maximum(follows / tighter, own))

    @cached_property
    def _told(self) -> Array:
        """(M, R) errors told by the marches of pilots."""
        return told(self.measured, self.margin)

    @cached_property
    def _march(self) -> NDArray[np.int32]:
        """(columns x cuts, P) the march that tells of a rung."""
        return self.measured.march.reshape(-1, self.measured.march.shape[2])


def told(measured: Measured, margin: Array) -> Array:
    """(M, R) errors of the marches of pilots with their margins, and those of their references."""
    return np.asarray(margin * measured.error + measured.reference.T[measured.pilot])


def choose(
    asked: Asked,
    cases: Cases,
    grids: Sequence[SceneGrid],
    members: Sequence[Counts],
    share: Share,
    halted: Halted,
    most: int = PILOTS,
) -> Choice:
    """The choice for all variants of a sweep, whose scenes' variants are ``members``, by at most so many pilots. Raises
    Halted."""
    pilots = pilots_of(cases, members, most)
    climbs, span = [], tolerance_span(asked, cases)
    parts = [pilots[np.isin(pilots, part)] for part in members]
    across, within = across_and_within(share, sum(part.size > 0 for part in parts))
    for grid, own in zip(grids, parts, strict=True):
        if own.size:
            columns = cases.columns_of(own)
            if TOLERANCE in columns:  # pilots serve the tightest that has them for neighbours
                columns = {**columns, TOLERANCE: np.full(own.size, span[0] * asked.study.solver.tolerance)}
            values = LaneValues(grid.scene.study, columns, own.size)
            climbs.append(Climb(grid.of_pilots(), values, ladder_of(asked, grid), halted, within, span))
    across([climb.go for climb in climbs])
    return _chosen(asked, cases, climbs, np.concatenate([own for own in parts if own.size]), share)


def _chosen(asked: Asked, cases: Cases, climbs: Sequence[Climb], order: Counts, share: Share) -> Choice:
    """The choice, once the pilots (by flat numbers in the order of their climbs) are measured."""
    results, span = results_of(asked), climbs[0].span
    measured, cost = _joined([climb.measured() for climb in climbs]), _cost(climbs[0])
    pilots = coordinates(cases, order)
    weights = _weights(pilots, measured)
    pilots = np.ascontiguousarray((pilots * weights).T)
    margin, held_margin = _margins(measured, pilots, results, (TELLING[0] * span[0], TELLING[1] * span[1]))
    if is_free(climbs[0].grid):  # what is told is what decides
        error = told(measured, margin).T
        parts = [worst_held(error, part)[measured.march] for part in _parted(asked)]
    else:
        parts = [np.where(_holds(part), held_margin * measured.held, 0.0) for part in _parted(asked)]
    held = np.stack(parts)
    held = np.where(held > 0.0, held, 0.0).reshape(2, -1, order.size)  # pilots without a truth say nothing
    ranked = np.argsort(cost, kind="stable").astype(np.int32)
    ranked = ranked[np.any(np.isfinite(held[:, ranked].max(axis=0)), axis=1)]
    worth = max(1, int(np.count_nonzero(cost[ranked] <= MOST_UNHELD)))
    tighter, rung = cases_tolerance(asked, cases), np.empty(cases.size, dtype=np.int32)
    neighbours = np.empty((cases.size, min(NEIGHBOURS, order.size)), dtype=np.int32)

    def choose_for(part: Counts) -> None:
        own = slice(part[0], part[-1] + 1)
        nearest(coordinates(cases, part) * weights, pilots, neighbours[own])
        cheapest(held, ranked, worth, neighbours[own], tighter[own], rung[own])

    share([partial(choose_for, part) for part in np.array_split(np.arange(cases.size), -(-cases.size // AT_ONCE))])
    return Choice(climbs[0].ladder, results, order, measured, neighbours, rung, margin, held)


def _parted(asked: Asked) -> tuple[tuple[Result, ...], tuple[Result, ...]]:
    """The results that decide, held to the study's tolerance, which a sweep may set, and held to one of their own."""
    results = deciding(results_of(asked), asked.study.solver.tolerance)
    follow = tuple(r if r.follows else r._replace(tolerance=np.nan) for r in results)
    return follow, tuple(r._replace(tolerance=np.nan) if r.follows else r for r in results)


def _holds(results: tuple[Result, ...]) -> bool:
    """Whether any of some results is held to a tolerance."""
    return bool(np.isfinite([result.tolerance for result in results]).any())


def usual_pilots(size: int) -> int:
    """How many pilots are worth it for so many variants.

    >>> usual_pilots(500), usual_pilots(2400), usual_pilots(1_000_000)
    (128, 200, 256)
    """
    return min(PILOTS, max(FEWEST_PILOTS, size // SHARE_OF_PILOTS))


def pilots_of(cases: Cases, members: Sequence[Counts], most: int = PILOTS) -> Counts:
    """Flat numbers of pilots, as many as are worth it and at most so many, drawn at random: of a few scenes where there
    are many."""
    count = min(most, usual_pilots(cases.size))
    random = np.random.default_rng(SEED)
    chosen = random.permutation(len(members))[: max(1, min(MOST_SCENES, count // LEAST_IN_SCENE))]
    pool = np.concatenate([members[number] for number in np.sort(chosen)])
    return np.sort(random.permutation(pool)[:count])


LEAST_IN_SCENE = 8  # pilots of a scene, where there are so many: more than the neighbours that are asked
MOST_UNHELD = 5e6  # modes x steps, about two milliseconds, that a variant takes whose tolerance nothing holds
AT_ONCE = 65536  # variants that are chosen for at once: some ten milliseconds
MOST_SCENES = 24  # that pilots are drawn from: each climbs the ladder by tables of its own, about a second


def cases_tolerance(asked: Asked, cases: Cases) -> Array:
    """(V,) `solver.tolerance` of every variant over the study's."""
    if TOLERANCE not in cases.paths:
        return np.ones(cases.size)
    return cases.column(TOLERANCE) / asked.study.solver.tolerance


def tolerance_span(asked: Asked, cases: Cases) -> tuple[float, float]:
    """The least and the largest of them."""
    found = cases_tolerance(asked, cases)
    return float(found.min()), float(found.max())


def coordinates(cases: Cases, variants: Counts) -> Array:
    """(V, D) places of variants along the axes of the sweep, from 0 to 1; where an axis spans large ratios these too:
    the pilots tell which of both counts."""
    positions = cases.positions(variants)
    columns = []
    for axis in cases.axes:
        values = np.asarray(axis.values, dtype=np.float64)
        low, high = values.min(), values.max()
        if low == high or axis.paths == (TOLERANCE,):
            continue
        columns.append(_unit(values)[positions[axis.dim]])
        if low > 0.0 and high > LOGARITHMIC * low:
            columns.append(_unit(np.log(values))[positions[axis.dim]])
    return np.stack(columns, axis=1) if columns else np.zeros((variants.size, 1))


def _unit(values: Array) -> Array:
    """Values from 0 to 1."""
    return np.asarray((values - values.min()) / (values.max() - values.min()))


def _weights(points: Array, measured: Measured) -> Array:
    """(D,) how much each axis counts: squares of differences in the logarithm of errors between near pilots, as sums of
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


def _margins(
    measured: Measured, pilots: Array, results: tuple[Result, ...], telling: tuple[float, float]
) -> tuple[Array, float]:
    """(R,) what the largest error of a pilot's neighbours must be multiplied with to be no less than its own, for all
    but a few; and the same of what is held, for errors about the tolerance."""
    others = np.empty((pilots.shape[1], min(NEIGHBOURS + 1, pilots.shape[1])), dtype=np.int32)
    nearest(np.ascontiguousarray(pilots.T), pilots, others)
    others = others[:, 1:]  # the nearest is itself
    if not others.shape[1]:
        return np.ones(len(results)), 1.0
    held, march = measured.held[measured.marched], measured.march[measured.marched]
    most = np.max(held[:, others], axis=2)
    near = np.nonzero(np.isfinite(most) & np.isfinite(held) & (most > telling[0]) & (most < telling[1]))
    own, worst = measured.error[march[near]], np.max(measured.error[march[near[0][:, None], others[near[1]]]], axis=1)
    margin = np.array([_quantile(own[:, number], worst[:, number]) for number in range(len(results))])
    return margin, _quantile(held[near], most[near])


def _quantile(own: Array, told: Array) -> float:
    """The ratio of errors to what is told of them that few are beyond."""
    known = (told > 0.0) & np.isfinite(own) & np.isfinite(told)
    return float(max(1.0, np.quantile(own[known] / told[known], SURE))) if known.any() else 1.0


def _cost(climb: Climb) -> Array:
    """(columns x cuts,) modes x steps of every rung; nothing for statics."""
    grid, ladder = climb.grid, climb.ladder
    modes = [0 if c.fidelity == "static" else grid.model(c).body_modes for c in ladder.columns]
    return np.asarray(np.outer(modes, grid.unit * np.array(ladder.cuts, dtype=np.float64)).reshape(-1))


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
        np.any([part.marched for part in parts], axis=0),
        sum(part.work for part in parts),
    )
