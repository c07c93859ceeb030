"""What pilots tell of the errors of the variants around them.

On every rung the logarithm of errors is a plane over the sweep, fitted to all pilots, and what each pilot leaves of it:
what a neighbour tells of a variant is its own error, times what the plane rises by from one to the other. Without the
plane errors at the edges of a sweep, of which all neighbours lie to one side, were told too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.results import Result, deciding, results_of, tolerances, worst_held
from engine.kernels.nearest_pilots import held_errors, nearest, rises, told_errors
from engine.march.outcome import Asked
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.accuracy.climb import Measured

Numbers = NDArray[np.int32]

#: Of the estimated errors for pilots that were left out are no smaller than the true ones: by 0.985 1.9 % of those of
#: `asymmetry` and `asymmetry-on-springs` were told too small, 1.3 by this, for a tenth and a twentieth more work.
SURE = 0.99
# What is said of the next two was measured on 60 random sweeps at 1e-2, 1e-3 and 1e-4, 64 variants of each judged.
TELLING = (0.02, 10.0)  # of the tolerance: errors that tell; with 0.3 to 1.2 some variants of `double-peak` missed it
WIDER = 10.0  # times beyond these, errors of a plane count as if they were no farther: 1 told 0.5 % more too small
#: Against the slopes of a plane over places from 0 to 1, in squares of logarithms: 0.1 to 3 told and took alike.
AGAINST_SLOPES = 1.0


#: Of the tolerance, up to which the error of a reference leaves room for that of a march: with 0.4 1.4 and 1.8 times as
#: many of 480 accelerations and reactions of their ends missed 1e-3, with the same work and with 0.9 of it.
LEAVES_ROOM = 0.9


class Places(NamedTuple):
    """Places (P, D) of pilots along the axes of the sweep, from 0 to 1, and how much each axis counts (D,); how much
    pilots vibrate may be a further axis, along which errors rise."""

    along: Array
    weights: Array

    @property
    def weighted(self) -> Array:
        """(D, P) as distances count them."""
        return np.ascontiguousarray((self.along * self.weights).T)


@dataclass(frozen=True, eq=False)
class NeighbourErrors:
    """What pilots at weighted places (D, P) tell their neighbours. error (M, R) told by each of their marches; held (P,
    2, columns x cuts): logarithms, less the planes, of the errors that are held over their tolerances, of those that
    follow the study's and of those that have their own; wanted: the same by which it is decided. told_slopes,
    held_slopes (D, columns x cuts): of the planes of what is told and of what is held, along the weighted places.
    by_elements (P, R): what is told besides of the elements of bodies, on every rung."""

    pilots: Array
    error: Array
    held: Array
    wanted: Array
    told_slopes: Array
    held_slopes: Array
    by_elements: Array

    def errors(self, march: Numbers, rung: Numbers, places: Array, neighbours: Numbers) -> Array:
        """(R, V) estimated errors by the marches (columns x cuts, P) of neighbours (V, k) that tell of the rung of a
        variant at its place (V, D); NaN where no estimate exists."""
        found, rise = np.empty((self.error.shape[1], rung.size)), np.empty(neighbours.shape)
        rises(self.told_slopes, rung, places, self.pilots, neighbours, rise)
        told_errors(self.error, march, rung, np.exp(rise), neighbours, found)
        if self.by_elements.any():
            own, level = np.arange(len(self.by_elements), dtype=np.int32)[None], np.ones(neighbours.shape)
            told_errors(self.by_elements, own, np.zeros_like(rung), level, neighbours, beside := np.empty_like(found))
            found += beside
        return found

    def worst(self, rung: Numbers, places: Array, neighbours: Numbers, tighter: Array) -> Array:
        """(V,) the largest of the errors that are held, less what the study fixes, over their tolerances; tighter (V,):
        `solver.tolerance` of the variants over the study's."""
        found = np.empty(rung.size)
        held_errors(self.held, rung, (self.held_slopes, places), neighbours, np.log(tighter), found)
        return np.exp(found)


def neighbour_errors_of(
    asked: Asked, measured: Measured, places: Places, others: Numbers, span: tuple[float, float]
) -> NeighbourErrors:
    """What pilots tell whose neighbours among each other are others (P, k). span: the least and the largest
    `solver.tolerance` of the study's variants over its own."""
    results = results_of(asked)
    decisive = deciding(results, asked.study.solver.tolerance)
    follow = tuple(r if r.follows else r._replace(tolerance=np.nan) for r in decisive)
    parts = follow, tuple(r._replace(tolerance=np.nan) if r.follows else r for r in decisive)
    telling = TELLING[0] * span[0], TELLING[1] * span[1]
    whole = worst_held(measured.error.T, decisive)[measured.march]  # with what the study fixes
    told_slopes = slopes(whole, places, telling)
    held_slopes = told_slopes if measured.free else slopes(measured.held, places, telling)
    left_out = _LeftOut(measured, others, telling)
    margin, worst_margin = left_out.margins(whole, _levels(told_slopes, places, whole.shape))
    margin = np.where(np.isfinite(tolerances(decisive)), worst_margin, margin)
    error = _beside_references(measured, margin, measured.reference.T)
    planes = _levels(held_slopes, places, whole.shape)
    if measured.free:  # what is told, but for what elements leave, is what decides
        wanting = _beside_references(measured, margin, _settled(measured, decisive, span[0]))
        held, wanted = (
            _by_rung([worst_held(e.T, part)[measured.march] for part in parts], planes) for e in (error, wanting)
        )
    else:
        _, held_margin = left_out.margins(measured.held, planes)
        matters = [np.isfinite(tolerances(part)).any() for part in parts]
        both = [held_margin * measured.held if own else np.zeros_like(whole) for own in matters]
        held = wanted = _by_rung(both, planes)
    by_elements = left_out.with_margins(measured.by_elements)
    return NeighbourErrors(places.weighted, error, held, wanted, told_slopes, held_slopes, by_elements)


def _beside_references(measured: Measured, margin: Array, reference: Array) -> Array:
    """(M, R) errors of marches with a margin and that of their pilots' references (P, R); infinite where none was
    marched, whatever is known of the references."""
    return np.where(np.isinf(measured.error), np.inf, margin * measured.error + reference[measured.pilot])


def slopes(errors: Array, places: Places, telling: tuple[float, float]) -> Array:
    """(D, columns x cuts) slopes, along weighted places, of planes in the logarithm of errors (columns, cuts, P) by
    least squares, as far as pilots know them."""
    of_rungs = errors.reshape(-1, errors.shape[2])
    known = np.isfinite(of_rungs)
    logs = np.log(np.clip(np.where(known, of_rungs, 1.0), telling[0] / WIDER, telling[1] * WIDER))
    count = np.maximum(known.sum(axis=1), 1)[:, None]
    apart = np.where(known[:, :, None], places.along - (known @ places.along / count)[:, None], 0.0)
    gram = np.swapaxes(apart, 1, 2) @ apart + AGAINST_SLOPES * np.eye(places.weights.size)
    found = np.linalg.solve(gram, np.swapaxes(apart, 1, 2) @ logs[:, :, None])[:, :, 0]
    return np.ascontiguousarray((found / places.weights).T)


def _levels(slopes: Array, places: Places, shape: tuple[int, ...]) -> Array:
    """(columns, cuts, P) what planes say at the places of pilots."""
    return np.asarray((slopes.T @ places.weighted).reshape(shape))


def _settled(measured: Measured, results: tuple[Result, ...], least: float) -> Array:
    """(P, R) errors of references; those that are off by more than they may ever be count as if they were not, as
    dearer marches of their neighbours could hardly be told to hold."""
    most: Array = np.array([LEAVES_ROOM * r.tolerance * (least if r.follows else 1.0) for r in results])
    return np.where(most < measured.reference.T, 0.0, measured.reference.T)


def worst_but_one(errors: Array, axis: int) -> Array:
    """The largest but one along an axis, the only one where there is one; NaN counts as the largest."""
    place = max(0, errors.shape[axis] - 2)
    return np.asarray(np.take(np.partition(errors, place, axis=axis), place, axis=axis))


def nearest_others(pilots: Array, count: int) -> Numbers:
    """(P, count or fewer) the nearest of pilots (D, P) to each, but itself."""
    found = np.empty((pilots.shape[1], min(count + 1, pilots.shape[1])), dtype=np.int32)
    nearest(np.ascontiguousarray(pilots.T), pilots, found)
    return found[:, 1:]


def _by_rung(held: Sequence[Array], planes: Array) -> Array:
    """(P, 2, columns x cuts) both parts of what is held, as logarithms less their planes; pilots without a truth say
    nothing."""
    found = np.stack(held)
    with np.errstate(divide="ignore"):
        found = (np.log(np.where(found > 0.0, found, 0.0)) - planes).reshape(2, -1, found.shape[-1])
    return np.ascontiguousarray(np.moveaxis(found, -1, 0))


class _LeftOut(NamedTuple):
    """Pilots as if each were left out: what its neighbours ``others`` (P, k) tell of its errors."""

    measured: Measured
    others: Numbers
    telling: tuple[float, float]

    def margins(self, worst: Array, planes: Array) -> tuple[Array, float]:
        """(R,) what neighbours tell of a pilot's errors must be multiplied with to be no less than these, for all but a
        few; and the same of the ``worst`` (columns, cuts, P) of some of them, where these matter on rungs that variants
        may take. planes (columns, cuts, P): of the logarithms of errors."""
        measured, others = self.measured, self.others
        if not others.shape[1]:
            return np.ones(measured.error.shape[1]), 1.0
        march = measured.march[measured.marched]
        worst, held, planes = (errors[measured.marched] for errors in (worst, measured.held, planes))
        rises = np.exp(planes[:, :, None] - planes[:, others])
        most, most_held = (worst_but_one(part[:, others] * rises, axis=2) for part in (worst, held))
        matter = np.isfinite(most) & np.isfinite(worst) & (most > self.telling[0])
        near = np.nonzero(matter & (most_held < self.telling[1]))
        own = measured.error[march[near]]
        tell = measured.error[march[near[0][:, None], others[near[1]]]] * rises[near][:, :, None]
        pairs = zip(own.T, worst_but_one(tell, axis=1).T, strict=True)
        return np.array([margin_of(*pair) for pair in pairs]), margin_of(worst[near], most[near])

    def with_margins(self, error: Array) -> Array:
        """(P, R) errors (R, P) that no march tells of, each times what it must be multiplied with to be no less than
        pilots' own by what their neighbours tell."""
        if not self.others.shape[1] or not error.any():
            return np.ascontiguousarray(error.T)
        pairs = zip(error, worst_but_one(error[:, self.others], axis=2), strict=True)
        return np.ascontiguousarray(error.T * [margin_of(*pair) for pair in pairs])


def margin_of(own: Array, told: Array) -> float:
    """The ratio of errors to what is told of them that few are beyond."""
    known = (told > 0.0) & np.isfinite(own) & np.isfinite(told)
    return float(max(1.0, np.quantile(own[known] / told[known], SURE))) if known.any() else 1.0
