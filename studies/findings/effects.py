"""What each of several swept numbers does to the largest of a result over all others, in one sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import NamedTuple

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from studies.results.axes import DIRECTION, VARIANT, Axis
from studies.results.formatting import ALIKE, listed, number, percent, quantity
from studies.results.results import Results

MOST_AXES = 4  # whose spans are told in one breath
MOST_EFFECTS = 6  # swept numbers, of which it is told what each does
HARDLY = 0.005  # of the smallest value: what no figure shows
TIMES = 1.5  # the largest over the smallest from which on it is told how many times, else by how many percent
HALVED = 2.0  # the same of what falls
#: Times both estimated errors, beyond which two ways differ: of 1,000 pairs of a symmetric portal two were beyond.
SURELY = 2.0
#: Parts of samples along a swept number, and variants in each at least: 1,200 draws of 30 to 1,000 variants all named
#: the number that did most, whether rising, with a peak in the middle or up and down. And samples that are looked at.
PARTS, LEAST_IN_PART, LOOKED_AT = 8, 5, 2**14


def unchanged(results: Results, values: Array) -> str:
    """That values (in the sweep's shape) do not change over it, as the end of a sentence; "" where they change by
    more than rounding, or nothing is swept."""
    known = values[results.with_values & np.isfinite(values)]
    over = _over_all(results)
    if known.size < 2 or not over or np.ptp(known) > ALIKE * np.abs(known).max():
        return ""
    return f"does not change {over}"


def hardly_changed(results: Results, values: Array, words: Callable[[float], str]) -> str:
    """That values (in the sweep's shape) change by less over it than words show, as the end of a sentence; "" where
    they do not, or nothing is swept: where the largest is would say nothing."""
    known, over = values[results.with_values & np.isfinite(values)], _over_all(results)
    alike = known.size > 1 and words(float(known.min())) == words(float(known.max()))
    return f"hardly changes {over}" if alike and over else ""


def _over_all(results: Results) -> str:
    """Over what is swept; "" without a sweep."""
    varied = [axis for axis in results.axes if len(axis.values) > 1]
    over = [f"{axis.noun} {axis.span}" for axis in varied[:MOST_AXES]]
    return f"over {listed(over) if len(varied) <= MOST_AXES else 'the sweep'}" if over else ""


def by_effect(results: Results, values: Array) -> list[Axis]:
    """The swept numbers, that first along which values (in the sweep's shape) change most on average; of samples that
    which tells most of them."""
    varied = [axis for axis in results.axes if axis.values.size > 1]
    if VARIANT in results.dims:
        return sorted(varied, key=lambda axis: -_explained(results, axis, values))
    known = xr.DataArray(np.where(results.with_values, values, np.nan), dims=results.dims)
    ranges = {axis.name: known.max(axis.dim) - known.min(axis.dim) for axis in varied}
    return sorted(varied, key=lambda axis: -float(ranges[axis.name].fillna(0.0).mean()))


def _explained(results: Results, axis: Axis, values: Array) -> float:
    """How much the means of ranks of values (in the sweep's shape) vary over parts of a swept number with as many
    variants each; 0 where nothing is known."""
    known = np.flatnonzero(results.with_values & np.isfinite(values))
    known = known[:: -(-max(1, known.size) // LOOKED_AT)]
    own = results.everywhere(results.dataset[axis.name]).reshape(-1)[known]
    ranks = np.argsort(np.argsort(values.reshape(-1)[known]))[np.argsort(own, kind="stable")]
    parts = np.array_split(ranks, max(1, min(PARTS, ranks.size // LEAST_IN_PART)))
    return float(np.var([part.mean() for part in parts])) if ranks.size else 0.0


def told_effects(results: Results, values: Array, what: str, error: Array | float = 0.0) -> str:
    """How the largest of positive values (in the sweep's shape) over all other swept numbers changes along each, that
    first along which it changes most; "" without several numbers on a grid, or where any variant does not count: what
    is largest is not known then. error: of the values, within which a change may be none."""
    axes = [axis for axis in results.axes if len(axis.values) > 1]
    known = np.where(results.with_values, values, np.nan)
    if not 2 <= len(axes) <= MOST_EFFECTS or VARIANT in results.dims or not np.isfinite(known).all():
        return ""
    doubt = np.broadcast_to(np.nan_to_num(error), known.shape)
    lines = {axis: _worst(results, axis, known, doubt) for axis in axes}
    own = [axis for axis in axes if not axis.sets(DIRECTION)]  # which `told_both_ways` tells
    own = [axis for axis in own if (lines[axis][0] > 0.0).all()]
    own.sort(key=lambda axis: -float(lines[axis][0].max() / lines[axis][0].min()))
    told = [_effect(axis, *lines[axis]) for axis in own]
    return f"With the worst of all else that is swept, {what} {listed(told)}." if told else ""


class Choice(NamedTuple):
    """The least of a largest value over what is there to choose, where that is, and that it is at the worst of all else
    where anything else is swept."""

    value: float
    where: str
    end: str


def of_absorbers(results: Results) -> list[Axis]:
    """The swept numbers of what stands on a spring."""
    sprung = {name: one.motion for name, one in results.study.carriage.items() if one.suspension is not None}
    ranges = {name: motion.range() for name, motion in sprung.items() if not motion.slides}
    stands = tuple(f"carriage.{name}." for name, (low, high) in ranges.items() if low == high)
    return [axis for axis in results.axes if all(path.startswith(stands) for path in axis.paths)]


def best_choice(results: Results, values: Array, free: Sequence[Axis]) -> Choice | None:
    """For which of some swept numbers positive values (in the sweep's shape) are least at the worst of all others; None
    where there are no more than two to choose from, or all are alike, or others are swept in samples with them."""
    varied = [axis for axis in results.axes if axis.values.size > 1]
    free = [axis for axis in varied if axis in free]
    sampled = VARIANT in results.dims
    if not free or (sampled and free != varied) or prod({axis.dim: axis.values.size for axis in free}.values()) <= 2:
        return None
    own = {results.dims.index(axis.dim) for axis in free}
    others = tuple(n for n in range(values.ndim) if n not in own)
    worst = np.where(results.with_values & np.isfinite(values), values, np.inf).max(axis=others, keepdims=True)
    place = np.unravel_index(int(np.argmin(worst)), worst.shape)
    least, most = float(worst[place]), float(worst.max(initial=0.0, where=np.isfinite(worst)))
    if not np.isfinite(least) or least > (1.0 - ALIKE) * most:
        return None
    where = ", ".join(axis.at(int(place[results.dims.index(axis.dim)])) for axis in free)
    end = " at the worst of all else" if prod(values.shape[n] for n in others) > 1 else ""
    return Choice(least, where, end)


class BothWays(NamedTuple):
    """Values forward and backward where they differ most beyond their errors, and where that is; part: by how much of
    the larger one, and whether that is more than their errors."""

    forward: float
    backward: float
    at: str
    part: float
    beyond_errors: bool

    def words(self, units: str) -> str:
        """Both values, and where."""
        where = f" at {self.at}" if self.at else ""
        return f"{quantity(self.forward, units)} forward, {quantity(self.backward, units)} backward{where}"


def both_ways(results: Results, values: Array, error: Array | float = 0.0) -> BothWays | None:
    """Positive values (in the sweep's shape) in both directions of a motion where these differ most; None where no
    direction is swept, or nothing is known. error: of the values."""
    axis = next((axis for axis in results.axes if axis.sets(DIRECTION) and axis.values.size > 1), None)
    if axis is None or axis.dim == VARIANT:
        return None
    order, rest = np.argsort(-axis.values), [dim for dim in results.dims if dim != axis.dim]
    known, doubt = np.where(results.with_values, values, np.nan), np.broadcast_to(np.nan_to_num(error), values.shape)
    pairs, doubts = (np.moveaxis(one, results.dims.index(axis.dim), 0)[order] for one in (known, doubt))
    apart = np.abs(pairs[0] - pairs[1])
    if not np.isfinite(apart).any():
        return None
    unsure = SURELY * doubts.sum(axis=0)
    flat = int(np.nanargmax(apart - unsure))
    worst = dict(zip(rest, map(int, np.unravel_index(flat, apart.shape)), strict=True))
    others = [other for other in results.axes if other is not axis and other.values.size > 1]
    forward, backward = pairs.reshape(2, -1)[:, flat].tolist()
    part = abs(forward - backward) / max(forward, backward) if forward != backward else 0.0
    beyond = bool(apart.flat[flat] > unsure.flat[flat])
    return BothWays(forward, backward, ", ".join(other.at(worst[other.dim]) for other in others), part, beyond)


def told_both_ways(results: Results, values: Array, what: str, units: str, error: Array | float = 0.0) -> str:
    """Whether positive values are the same forward and backward, and where they differ most, as a sentence behind
    another; "" where `both_ways` finds nothing."""
    found = both_ways(results, values, error)
    if found is None:
        return ""
    if found.part <= ALIKE:
        return f" Forward and backward {what} is the same."
    if not found.beyond_errors:
        return f" Forward and backward {what} is the same within its estimated error."
    at = found.at and f" at {found.at}"
    if quantity(found.forward, units) == quantity(found.backward, units):
        return f" Forward and backward {what} hardly differs: by at most {percent(found.part)}{at and f',{at}'}."
    return f" Forward and backward {what} differs{at and f' most{at}'}: {found._replace(at='').words(units)}."


def _worst(results: Results, axis: Axis, values: Array, error: Array) -> tuple[Array, Array]:
    """The largest of values for every value of an axis, ascending, and their errors."""
    place, rows = results.dims.index(axis.dim), np.argsort(axis.values)
    flat, off = (np.moveaxis(one, place, 0).reshape(rows.size, -1)[rows] for one in (values, error))
    top = np.argmax(flat, axis=1)[:, None]
    return np.take_along_axis(flat, top, axis=1)[:, 0], np.take_along_axis(off, top, axis=1)[:, 0]


def _effect(axis: Axis, line: Array, error: Array | None = None) -> str:
    """What a swept number does, in words.

    >>> speed = Axis("speed", "speed", {}, np.array([1.0, 2.0, 4.0]), "m s-1")
    >>> _effect(speed, np.array([1.0, 2.0, 3.2]))
    'grows 3.2 times over speed 1 to 4 m/s'
    >>> _effect(speed, np.array([1.1, 1.0, 1.05]))
    'changes by up to 10 % over speed 1 to 4 m/s (largest at 1 m/s)'
    >>> _effect(speed, np.array([1.0, 0.9, 0.8])), _effect(speed, np.ones(3))
    ('falls by 20 % over speed 1 to 4 m/s', 'stays the same over speed 1 to 4 m/s')
    >>> _effect(speed, np.array([5.0, 4.0, 3.2])), _effect(speed, np.array([5.0, 4.0, 2.0]))
    ('falls by 36 % over speed 1 to 4 m/s', 'falls to 1/2.5 over speed 1 to 4 m/s')
    >>> _effect(speed, np.array([1.0, 1.0004, 1.0003]))
    'hardly changes over speed 1 to 4 m/s'
    >>> _effect(speed, np.array([1.0, 1.3, 1.2]), np.array([0.2, 0.2, 0.1]))
    'changes within its estimated error over speed 1 to 4 m/s'
    """
    over, ratio = f"over {axis.noun} {axis.span}", float(line.max() / line.min())
    steps = np.diff(line)
    if ratio - 1.0 <= ALIKE:
        return f"stays the same {over}"
    if ratio - 1.0 <= HARDLY:
        return f"hardly changes {over}"
    if error is not None and line.max() - line.min() <= error[np.argmax(line)] + error[np.argmin(line)]:
        return f"changes within its estimated error {over}"
    if (steps >= 0.0).all():
        return f"grows {'' if ratio >= TIMES else 'by '}{_times(ratio)} {over}"
    if (steps <= 0.0).all():
        return f"falls {f'to 1/{number(ratio, 2)}' if ratio > HALVED else f'by {percent(1.0 - 1.0 / ratio)}'} {over}"
    top = axis.in_words(float(np.sort(axis.values)[int(np.argmax(line))]))
    return f"changes {'up to' if ratio >= TIMES else 'by up to'} {_times(ratio)} {over} (largest at {top})"


def _times(ratio: float) -> str:
    """How much larger the larger of two is."""
    return f"{number(ratio, 2)} times" if ratio >= TIMES else percent(ratio - 1.0)
