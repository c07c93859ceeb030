"""Two archives side by side: what differs in their studies, in the statuses, and in results beyond their errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from engine.study_file.changes import Change, changes
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.lazy_imports import xr
from results_schema.status import Status, label
from studies.at_rest.told_errors import errors_along
from studies.findings.absolute_errors import absolute_errors
from studies.reporting.summary import Range, asked
from studies.results.results import Results
from studies.runs.identity import SOURCES

LAST_DIGITS = 1e-14  # of a value: what sums in another order differ by, and no error that is told


class Difference(NamedTuple):
    """A result in both archives: its values in the first and second where they exceed their errors the most, or where
    none does differ most (NaN where one has no number), where that is, both estimated errors together there (NaN: none
    is known), in how many variants it lies beyond these, in how many it differs and none is known, and its value of
    largest size in each."""

    name: str
    units: str
    values: tuple[float, float]
    where: str
    allowed: float
    beyond: int
    unknown: int
    extremes: tuple[float, float]

    @property
    def largest(self) -> float:
        """The largest difference: second less first."""
        return 0.0 if np.array_equal(*self.values, equal_nan=True) else self.values[1] - self.values[0]

    @property
    def blurred(self) -> bool:
        """Whether the errors are larger than both values, so that nothing follows from lying within them."""
        return bool(self.largest and self.allowed > np.abs(self.values).max())


@dataclass(frozen=True)
class Comparison:
    """What differs between two archives. programs: the program's version and the hash of its sources in each, where
    these are not the same. variants: in both; only_first, only_second: in one of them. statuses: how many
    went from which status to which. only_in_one: results that the other has not, or not in the same shape.
    """

    changes: list[Change]
    programs: tuple[str, ...]
    variants: int
    only_first: int
    only_second: int
    statuses: Mapping[tuple[str, str], int]
    differences: list[Difference]
    only_in_one: list[str]

    @property
    def agree(self) -> bool:
        """Whether the variants of both have the same statuses, and results that their errors explain."""
        explained = not any(found.beyond or found.unknown for found in self.differences)
        return not (self.statuses or self.only_in_one) and explained


def compare(first: xr.Dataset, second: xr.Dataset) -> Comparison:
    """What differs between two datasets of studies, from memory or from their archives, as the command tells it: its
    `agree` says whether estimated errors explain all of that. Raises BadInput where they have other axes."""
    return compared(Results.of(first), Results.of(second))


def compared(first: Results, second: Results) -> Comparison:
    """Compare two archives where their sweeps agree. Raises BadInput where these have other axes."""
    for one in (first, second):
        if not one.study.output.keeps_variants:
            what = "an archive that keeps cells alone has no variants to compare"
            raise BadInput(what, where=one.study.title or one.study.kind, expected='output.keep = "all"')
    if first.dims != second.dims:
        what = "the archives have different axes, so there is nothing to compare"
        axes = [", ".join(one.dims) or "none" for one in (first, second)]
        received = f"{axes[0]} in the first, {axes[1]} in the second"
        remedy = "run both over the same axes; their values may differ: those that both have are compared"
        raise BadInput(what, where="compare", expected="the same axes in both", received=received, remedy=remedy)
    mine, other = xr.align(first.dataset, second.dataset, join="inner", copy=False, exclude=_not_swept(first, second))
    both, own = Results(mine, first.study, first.models), Results(other, second.study, second.models)
    found, missing = _shared(both, own)
    return Comparison(
        changes=changes(first.study.source.text, second.study.source.text),
        programs=_programs(first, second),
        variants=both.size,
        only_first=first.size - both.size,
        only_second=second.size - both.size,
        statuses=_statuses(both, own) if both.size else {},
        differences=list(_differences(both, own, found)) if both.size else [],
        only_in_one=missing,
    )


def _programs(*archives: Results) -> tuple[str, ...]:
    """What made each archive, where that differs."""
    made = [(one.dataset.attrs.get("packages", ["unknown"])[0], one.dataset.attrs.get(SOURCES)) for one in archives]
    found = tuple(f"{version}, sources {sources}" for version, sources in made if sources)  # of archives alone
    return found if len(set(found)) > 1 else ()


def _not_swept(first: Results, second: Results) -> set[str]:
    names = {str(dim) for results in (first, second) for dim in results.dataset.dims}
    return names - set(first.dims)


def _shared(first: Results, second: Results) -> tuple[list[tuple[Range, str]], list[str]]:
    """The results of the first that the second has in the same shape, with full names; the names of others."""
    mine, other = ({f"{one.name} {one.sensor}".strip(): one for one in asked(results)} for results in (first, second))
    shared = {
        name: found
        for name, found in mine.items()
        if name in other and _of(first, found).shape == _of(second, other[name]).shape
    }
    return [(found, name) for name, found in shared.items()], sorted((set(mine) | set(other)) - set(shared))


def _statuses(first: Results, second: Results) -> dict[tuple[str, str], int]:
    pairs = zip(first.dataset["status"].values.ravel(), second.dataset["status"].values.ravel(), strict=True)
    counts = Counter((label(Status(int(old))), label(Status(int(new)))) for old, new in pairs if old != new)
    return dict(counts)


def _differences(first: Results, second: Results, names: list[tuple[Range, str]]) -> Iterator[Difference]:
    for found, name in names:
        old, new = (_of(results, found).values.astype(np.float64) for results in (first, second))
        apart = np.where((old == new) | (np.isnan(old) & np.isnan(new)), 0.0, np.abs(new - old))
        allowed = _allowed(first, second, found, apart)
        rounding = LAST_DIGITS * np.fmax(np.abs(old), np.abs(new))
        beyond = np.isnan(apart) | ((apart > allowed) & (apart > rounding))
        unknown = (apart > rounding) & np.isnan(allowed)
        # np.argmax takes a NaN, a number in one of them alone, for the largest
        most = np.argmax(np.where(beyond, apart - np.nan_to_num(allowed), 0.0) if beyond.any() else apart)
        place = tuple(map(int, np.unravel_index(int(most), apart.shape))) if apart.ndim else ()
        values = float(old[place]), float(new[place])
        extremes = _extreme(found.name, old), _extreme(found.name, new)
        where, counts = first.at(place[: len(first.dims)]), (int(beyond.sum()), int(unknown.sum()))
        yield Difference(name, found.units, values, where, float(allowed[place]), *counts, extremes)


def _extreme(name: str, values: Array) -> float:
    """The value of largest size, of what ends in _min the smallest; NaN where there is none."""
    size = -values if name.endswith("_min") else np.abs(values)
    return float(values.flat[np.argmax(np.where(np.isnan(values), -np.inf, size))])


def _of(results: Results, found: Range) -> xr.DataArray:
    array = results.of_sensor(found.name, found.sensor) if found.sensor else results.dataset[found.name]
    return array.transpose(*results.dims, ...)


def _allowed(first: Results, second: Results, found: Range, apart: Array) -> Array:
    """Both estimated errors of a result together, in its unit; NaN where no estimate exists."""
    along = [errors_along(results, found.name) for results in (first, second) if "position" in _of(results, found).dims]
    if len(along) == 2 and along[0] is not None and along[1] is not None:
        return along[0] + along[1]
    if apart.shape != first.shape:
        return np.full(apart.shape, np.nan)
    errors = [absolute_errors(results, found.name, found.sensor) for results in (first, second)]
    return np.asarray(errors[0] + errors[1], dtype=np.float64)
