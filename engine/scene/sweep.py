"""From the axes of a sweep to its cases, by index arithmetic: a million cases cost their axes only."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.scene.axes import Values, check_distinct, check_targets, listed, ranged, sampled, sobol_points
from engine.scene.study import Study, checks
from engine.study_file.checks import Check
from results_schema.errors import BadInput

MAX_VARIANTS = 2**31
MAX_AXIS = 2**24
TWO_DECADES = 100.0  # damping from 1e-6 on, say, would go by its smallest values alone: chosen, not measured
CHECKED_AT_ONCE = 2**18
VARIANT = "variant"

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Axis:
    """One named axis: its values (int64 or float64, SI) along one dimension, and the keys that it sets.

    of: the keys as they were written. targets: the numbers of the scene that it sets, each with the factor of
    the value. units: UDUNITS text, "" without dimension. noun: the dimension in words, "" for counts.
    """

    name: str
    dim: str
    of: tuple[str, ...]
    targets: Mapping[str, float]
    values: Values
    units: str
    noun: str

    @property
    def paths(self) -> tuple[str, ...]:
        """Dotted keys of the numbers that it sets."""
        return tuple(self.targets)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Its smallest and its largest value."""
        return float(self.values.min()), float(self.values.max())

    @property
    def goes_by_ratios(self) -> bool:
        """Whether what depends on it does so nearly by a power of its values: all positive, within two decades."""
        least, most = self.ends
        return least > 0.0 and most <= TWO_DECADES * least

    def columns(self, entries: Any) -> dict[str, Any]:
        """What it sets at some entries of its values, by dotted key."""
        own = self.values[entries]
        return {path: own if factor == 1.0 else own * factor for path, factor in self.targets.items()}


@dataclass(frozen=True, eq=False)
class Cases:
    """All variants of a study. Variant i has the index np.unravel_index(i, shape): the last dimension is fastest.

    Without a sweep there is one case and no dimension.
    """

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    axes: tuple[Axis, ...]

    @property
    def size(self) -> int:
        """Number of variants."""
        return prod(self.shape)

    @property
    def paths(self) -> tuple[str, ...]:
        """Dotted keys of all swept numbers."""
        return tuple(path for axis in self.axes for path in axis.paths)

    def positions(self, indices: ArrayLike) -> dict[str, Indices]:
        """Index along each dimension of variants given by their flat numbers (V,)."""
        unravelled = np.unravel_index(np.asarray(indices, dtype=np.int64), self.shape) if self.dims else ()
        return dict(zip(self.dims, unravelled, strict=True))

    def columns_of(self, indices: ArrayLike) -> dict[str, NDArray[np.float64]]:
        """Swept numbers (V,) of variants given by their flat numbers (V,), by dotted key."""
        if np.array_equal(indices, np.arange(self.size)):
            return {path: self.column(path) for path in self.paths}
        entries = self.positions(indices)
        return {
            path: np.asarray(column, dtype=np.float64)
            for axis in self.axes
            for path, column in axis.columns(entries[axis.dim]).items()
        }

    def column(self, path: str) -> NDArray[np.float64]:
        """One swept number of all variants (size,). KeyError if it is not swept."""
        axis = next((axis for axis in self.axes if path in axis.paths), None)
        if axis is None:
            raise KeyError(path)
        place = self.dims.index(axis.dim)
        values: NDArray[np.float64] = axis.columns(slice(None))[path].astype(np.float64, copy=False)
        if len(self.dims) > 1:
            values = np.tile(np.repeat(values, prod(self.shape[place + 1 :])), prod(self.shape[:place]))
        return values

    def values_of(self, index: int) -> dict[str, int | float]:
        """Swept numbers of one variant by dotted key; integers stay integers."""
        positions = self.positions([index])
        return {
            path: value.item() for axis in self.axes for path, value in axis.columns(positions[axis.dim][0]).items()
        }

    def part(self, variants: Indices) -> Cases:
        """Some of the variants (n,), as rows of a sample."""
        positions = self.positions(variants)
        axes = (replace(axis, dim=VARIANT, values=axis.values[positions[axis.dim]]) for axis in self.axes)
        return Cases((VARIANT,), (variants.size,), tuple(axes))

    def along(self, dims: Sequence[str]) -> Cases:
        """The grid of some of the dimensions alone."""
        sizes = {dim: size for dim, size in zip(self.dims, self.shape, strict=True) if dim in dims}
        return Cases(tuple(sizes), tuple(sizes.values()), tuple(axis for axis in self.axes if axis.dim in sizes))

    def numbers_in(self, cells: Cases, variants: Indices) -> Indices:
        """(n,) the flat numbers of the cells, points of some of the dimensions, to which variants belong."""
        positions = self.positions(variants)
        if not cells.dims:
            return np.zeros(variants.size, dtype=np.int64)
        return np.asarray(np.ravel_multi_index([positions[dim] for dim in cells.dims], cells.shape))

    def study_of(self, study: Study, index: int) -> Study:
        """One variant as a study of its own, without a sweep."""
        return (study.without_sweep() if study.sweep.axes else study).with_values(self.values_of(index))


def expand(study: Study) -> Cases:
    """All cases of a study, checked as a whole. Raises BadInput (faults 9, 10, 14, 15)."""
    axes = study.sweep.axes
    _check_sizes(study)
    _check_paths(study)
    sampled_values, joint = dict(_sampled(study)), study.sweep.joint
    dims: dict[str, int] = {}
    found = []
    for name, axis in axes.items():
        dim = VARIANT if name in joint else name
        own = listed if axis.values is not None else ranged
        values = sampled_values[name] if name in sampled_values else own(study, name, axis)
        _check_dimension(study, name, axis.of)
        unit = study.unit(axis.of[0])
        targets = {target: factor for path in axis.of for target, factor in study.targets(path).items()}
        symbol, noun = (unit.symbol, unit.noun) if unit else ("", "")
        found.append(Axis(name, dim, axis.of, targets, values, symbol, noun))
        dims.setdefault(dim, len(values))
    cases = Cases(tuple(dims), tuple(dims.values()), tuple(found))
    _check_repeats(study, cases)
    for check in checks(study):
        if unmet := broken(study, cases, check):
            _refuse(study, check, *unmet)
    return cases


def cells_of(study: Study, cases: Cases) -> Cases:
    """The cells of a study that reduces its variants. Raises BadInput."""
    asked = study.output.cells
    if not cases.dims:
        what = "there is one variant alone: nothing to reduce"
        raise study.source.fault("output.keep", what, expected='"all"', received=study.output.keep)
    if asked is None:
        return cases.along([dim for dim in cases.dims if dim != VARIANT] if VARIANT in cases.dims else [])
    grid = [dim for dim in cases.dims if dim != VARIANT]
    for name in asked:
        if name not in grid:
            expected = (
                f"axes of the grid: {', '.join(grid)}" if grid else "none: no axis of this sweep is one of a grid"
            )
            raise study.source.fault("output.cells", "no such axis of a grid", expected=expected, received=name)
    if set(asked) == set(cases.dims):
        what = "every variant would be a cell of its own"
        raise study.source.fault("output.cells", what, expected="fewer axes", remedy='keep = "all"')
    return cases.along(asked)


def _sampled(study: Study) -> Iterator[tuple[str, Values]]:
    """Values of all sampled axes, which form one joint sequence."""
    axes = {name: axis for name, axis in study.sweep.axes.items() if axis.sobol is not None}
    if axes:
        points = sobol_points(next(iter(axes.values())).size, len(axes))
        for column, (name, axis) in zip(points.T, axes.items(), strict=True):
            yield name, sampled(study, name, axis, column)


def _check_sizes(study: Study) -> None:
    """Sizes as Python's integers, before anything is allocated."""
    axes, where = study.sweep.axes, study.source.where("sweep")
    sizes = {name: axis.size for name, axis in axes.items()}
    together = {name: sizes[name] for name in study.sweep.joint}
    if len(set(together.values())) > 1:
        what = "zipped axes differ in length" if study.sweep.zip else "sampled axes differ in size"
        raise BadInput(what, where=where, expected="one length", received=_product(together, ", "))
    for name, size in sizes.items():
        if size > MAX_AXIS:
            here = study.source.where(f"sweep.{name}")
            raise BadInput("the axis is too long", where=here, expected=f"at most {MAX_AXIS}", received=str(size))
    factors = {name: size for name, size in sizes.items() if name not in together}
    total = prod(factors.values()) * (next(iter(together.values())) if together else 1)
    if total > MAX_VARIANTS:
        received = f"{_product(sizes, ' x ')} = {total}"
        raise BadInput("too many variants", where=where, expected=f"at most {MAX_VARIANTS}", received=received)


def _product(sizes: Mapping[str, int], sign: str) -> str:
    return sign.join(f"{size} ({name})" for name, size in sizes.items())


def _check_paths(study: Study) -> None:
    """Every key exists, and no number is set by two axes."""
    owners: dict[str, str] = {}
    for name, axis in study.sweep.axes.items():
        check_targets(study, name, axis)
        own = [(path, target) for path in axis.of for target in study.targets(path)]
        for path, target in own:
            clash = next((other for other in owners if f"{target}.".startswith(f"{other}.")), None)
            if clash is not None:
                what = "this number is set twice"
                raise study.source.fault(f"sweep.{name}.of", what, received=f"{path}, also by {owners[clash]}")
            owners[target] = name


def _check_dimension(study: Study, name: str, paths: Sequence[str]) -> None:
    """What one axis sets has one dimension."""
    units = [study.unit(path) for path in paths]
    if len({unit.symbol if unit else "" for unit in units}) > 1:
        told = [f"{path} ({unit.noun if unit else 'a count'})" for path, unit in zip(paths, units, strict=True)]
        what, remedy = "one value for numbers of several dimensions", "an axis for each; zip = true pairs them"
        raise study.source.fault(f"sweep.{name}.of", what, received=", ".join(told), remedy=remedy)


def _check_repeats(study: Study, cases: Cases) -> None:
    """No value twice on an axis of the grid, no row of values twice where axes are zipped; samples may repeat."""
    for axis in cases.axes:
        if axis.dim != VARIANT:
            check_distinct(study, axis.name, axis.values)
    paired = [axis.values for axis in cases.axes if axis.dim == VARIANT] if study.sweep.zip else []
    if not paired or any(np.unique(values).size == len(values) for values in paired):  # and with these every row
        return
    _, own, counts = np.unique(np.array(paired), axis=1, return_inverse=True, return_counts=True)
    if (counts > 1).any():
        repeated = counts[own.reshape(-1)] > 1
        first = np.flatnonzero(own.reshape(-1) == own.reshape(-1)[np.argmax(repeated)])
        received = (
            f"{int((counts > 1).sum())} repeated, first entry {first[1] + 1} as entry {first[0] + 1} of every axis"
        )
        raise study.source.fault("sweep", "zipped axes repeat a variant", received=received)


def broken(study: Study, cases: Cases, check: Check) -> tuple[Mapping[str, Any], Mapping[str, int]] | None:
    """Values that break a check, with the entry of each axis that it depends on; None where none do.

    On the grid of just these axes, in blocks.
    """
    touched = [axis for axis in cases.axes if set(axis.paths) & set(check.needs)]
    base = {key: study.value(key) for key in check.needs}
    sizes = {axis.dim: len(axis.values) for axis in touched}
    total = prod(sizes.values())
    for start in range(0, total, CHECKED_AT_ONCE):
        flat = np.arange(start, min(start + CHECKED_AT_ONCE, total))
        positions = dict(zip(sizes, np.unravel_index(flat, tuple(sizes.values())), strict=True)) if sizes else {}
        columns = {path: column for axis in touched for path, column in axis.columns(positions[axis.dim]).items()}
        met = np.broadcast_to(check.met(base | columns), flat.shape)
        if not met.all():
            worst = int(np.flatnonzero(~met)[0])
            entries = {axis.name: int(positions[axis.dim][worst]) for axis in touched}
            return base | {key: column[worst] for key, column in columns.items()}, entries
    return None


def _refuse(study: Study, check: Check, values: Mapping[str, Any], entries: Mapping[str, int]) -> NoReturn:
    places = ", ".join(f"sweep.{name} entry {entry}" for name, entry in entries.items())
    raise check.fault(values, study.source, f" ({places})")
