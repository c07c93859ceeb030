"""What the measured errors of pilots tell of the variants around them.

The largest error but one of a variant's nearest pilots bounds its own, times a margin that pilots would have needed,
had they been left out. Without the largest, as one pilot at a resonance is a neighbour of many.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.reference import DOUBTED
from engine.accuracy.results import deciding, results_of, tolerances, worst_held
from engine.kernels.nearest_pilots import nearest
from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.accuracy.ladder import Measured
    from engine.accuracy.results import Result
    from engine.march.outcome import Asked

Numbers = NDArray[np.int32]

#: Of the estimated errors for pilots that were left out are no smaller than the true ones: 0.993 doubled the work of
#: `double-peak`, and told hardly better (displacements of 12 random scenes 2.0 % below the true errors, not 2.5 %).
SURE = 0.985
TELLING = (0.02, 10.0)  # of the tolerance: errors that tell; with 0.3 to 1.2 some variants of `double-peak` missed it


@dataclass(frozen=True, eq=False)
class NeighbourErrors:
    """What pilots tell their neighbours. error (M, R) told by each of their marches; held (2, columns x cuts, P): the
    errors that are held over their tolerances, of those that follow the study's and of those that have their own;
    wanted: the same by which it is decided."""

    error: Array
    held: Array
    wanted: Array

    def errors(self, marches: Numbers) -> Array:
        """(R, V) estimated errors by the marches (V, k) of neighbours; NaN where no estimate exists."""
        error = worst_but_one(self.error[marches], axis=1)  # of (V, k, R)
        return np.where(np.isfinite(error), error, np.nan).T

    def worst(self, rung: Numbers, neighbours: Numbers, tighter: Array) -> Array:
        """(V,) the largest of the errors that are held, less what the study fixes, over their tolerances; tighter (V,):
        `solver.tolerance` of the variants over the study's."""
        follows, own = self.held[:, rung[:, None], neighbours]
        return worst_but_one(np.maximum(follows / tighter[:, None], own), axis=1)


def neighbour_errors_of(
    asked: Asked, measured: Measured, others: Numbers, span: tuple[float, float]
) -> NeighbourErrors:
    """What pilots tell whose neighbours among each other are others (P, k). span: the least and the largest
    `solver.tolerance` of the study's variants over its own."""
    results = results_of(asked)
    decisive = deciding(results, asked.study.solver.tolerance)
    follow = tuple(r if r.follows else r._replace(tolerance=np.nan) for r in decisive)
    parts = follow, tuple(r._replace(tolerance=np.nan) if r.follows else r for r in decisive)
    margin, held_margin = _margins(measured, others, len(results), (TELLING[0] * span[0], TELLING[1] * span[1]))
    margin = np.where(np.isfinite(tolerances(decisive)), held_margin, margin)
    error = np.asarray(margin * measured.error + measured.reference.T[measured.pilot])
    if measured.free:  # what is told is what decides
        wanted = margin * measured.error + _settled(measured, decisive, span[0])[measured.pilot]
        held, wanted = (_by_rung([worst_held(e.T, part)[measured.march] for part in parts]) for e in (error, wanted))
    else:
        held = _by_rung(
            [np.where(np.isfinite(tolerances(part)).any(), held_margin * measured.held, 0.0) for part in parts]
        )
        wanted = held
    return NeighbourErrors(error, held, wanted)


def _settled(measured: Measured, results: tuple[Result, ...], least: float) -> Array:
    """(P, R) errors of references; those that are off by more than they may ever be count as if they were not, as
    dearer marches of their neighbours could hardly be told to hold."""
    most: Array = np.array([DOUBTED * r.tolerance * (least if r.follows else 1.0) for r in results])
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


def _by_rung(held: Sequence[Array]) -> Array:
    """(2, columns x cuts, P) both parts of what is held; pilots without a truth say nothing."""
    found = np.stack(held)
    return np.where(found > 0.0, found, 0.0).reshape(2, -1, found.shape[-1])


def _margins(measured: Measured, others: Numbers, results: int, telling: tuple[float, float]) -> tuple[Array, float]:
    """(R,) what a pilot's neighbours tell of its errors must be multiplied with to be no less than these, for all but a
    few; and the same of what is held, for errors about the tolerance."""
    if not others.shape[1]:
        return np.ones(results), 1.0
    held, march = measured.held[measured.marched], measured.march[measured.marched]
    most = worst_but_one(held[:, others], axis=2)
    near = np.nonzero(np.isfinite(most) & np.isfinite(held) & (most > telling[0]) & (most < telling[1]))
    own = measured.error[march[near]]
    tell = worst_but_one(measured.error[march[near[0][:, None], others[near[1]]]], axis=1)
    return np.array([_quantile(own[:, r], tell[:, r]) for r in range(results)]), _quantile(held[near], most[near])


def _quantile(own: Array, told: Array) -> float:
    """The ratio of errors to what is told of them that few are beyond."""
    known = (told > 0.0) & np.isfinite(own) & np.isfinite(told)
    return float(max(1.0, np.quantile(own[known] / told[known], SURE))) if known.any() else 1.0
