"""Two archives side by side: what differs in their studies, in the statuses, and in results beyond their errors."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.status import Status, label
from studies.reporting.summary import asked
from studies.results.results import Results, extreme

if TYPE_CHECKING:
    import xarray as xr


class Change(NamedTuple):
    """A key of the study file in both; None where one has it not."""

    key: str
    first: Any
    second: Any


class Difference(NamedTuple):
    """A result in both archives: the largest difference (second less first), where, and in how many variants it is
    larger than both estimated errors together; None where no estimate exists."""

    name: str
    units: str
    largest: float
    where: str
    beyond: int | None


@dataclass(frozen=True)
class Comparison:
    """What differs between two archives. variants: in both; only_first, only_second: in one of them. statuses: how many
    went from which status to which."""

    changes: list[Change]
    variants: int
    only_first: int
    only_second: int
    statuses: Mapping[tuple[str, str], int]
    differences: list[Difference]

    @property
    def agree(self) -> bool:
        """Whether the variants of both have the same statuses, and results that their errors explain."""
        return not self.statuses and not any(
            found.beyond or (found.beyond is None and found.largest) for found in self.differences
        )


def compare(first: Results, second: Results) -> Comparison:
    """Compare two archives where their sweeps agree. Raises BadInput where these have other axes."""
    import xarray as xr

    if first.dims != second.dims:
        raise BadInput(
            "the archives have different axes, so there is nothing to compare",
            where=", ".join(second.dims) or "no axes",
            expected=", ".join(first.dims) or "no axes",
        )
    mine, other = xr.align(first.dataset, second.dataset, join="inner", exclude=_not_swept(first, second))
    both, own = Results(mine, first.study), Results(other, second.study)
    return Comparison(
        changes=list(_changes(*(dict(_leaves(tomllib.loads(one.study.source.text))) for one in (first, second)))),
        variants=both.size,
        only_first=first.size - both.size,
        only_second=second.size - both.size,
        statuses=_statuses(both, own) if both.size else {},
        differences=list(_differences(both, own)) if both.size else [],
    )


def _not_swept(first: Results, second: Results) -> set[str]:
    names = {str(dim) for results in (first, second) for dim in results.dataset.dims}
    return names - set(first.dims)


def _leaves(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of nested tables by its dotted key."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _changes(first: Mapping[str, Any], second: Mapping[str, Any]) -> Iterator[Change]:
    for key in dict.fromkeys((*first, *second)):
        if first.get(key) != second.get(key):
            yield Change(key, first.get(key), second.get(key))


def _statuses(first: Results, second: Results) -> dict[tuple[str, str], int]:
    pairs = zip(first.dataset["status"].values.ravel(), second.dataset["status"].values.ravel(), strict=True)
    counts = Counter((label(Status(int(old))), label(Status(int(new)))) for old, new in pairs if old != new)
    return dict(counts)


def _differences(first: Results, second: Results) -> Iterator[Difference]:
    for found in asked(first):
        if found.name not in second.dataset:
            continue
        old, new = (_of(results, found.name, found.sensor) for results in (first, second))
        if old.dims != new.dims or old.shape != new.shape:
            continue
        apart = np.asarray(new.values - old.values, dtype=np.float64)
        place = extreme(np.abs(apart))
        if place is None:
            continue
        where = first.at(place[: len(first.dims)])
        beyond = _beyond(first, second, f"{found.name} {found.sensor}".strip(), found.name, np.abs(apart))
        yield Difference(f"{found.name} {found.sensor}".strip(), found.units, float(apart[place]), where, beyond)


def _of(results: Results, name: str, sensor: str) -> xr.DataArray:
    array = results.of_sensor(name, sensor) if sensor else results.dataset[name]
    return array.transpose(*results.dims, ...)


def _beyond(first: Results, second: Results, result: str, name: str, apart: Array) -> int | None:
    """In how many variants two results differ by more than both estimated errors, relative to their size."""
    errors = []
    for results in (first, second):
        if "estimated_error" not in results.dataset or result not in results.dataset["result"].values:
            return None
        errors.append(results.dataset["estimated_error"].sel(result=result).transpose(*results.dims).values)
    allowed = (errors[0] + errors[1]) * _size(first, name, apart.shape)
    if apart.shape != allowed.shape or not np.isfinite(allowed).any():
        return None
    return int(np.count_nonzero(apart > allowed))


def _size(results: Results, name: str, shape: tuple[int, ...]) -> Array:
    """What errors of a result are relative to: of a sensor's extremes the larger of both, in place of its static value;
    of a contact force likewise; of lengths that of the track; indices are as they are."""
    stem = name.removesuffix("_max").removesuffix("_min")
    ends = [f"{stem}_{end}" for end in ("max", "min") if f"{stem}_{end}" in results.dataset]
    if ends:
        values = [np.abs(results.dataset[end].transpose(*results.dims).values) for end in ends]
        return np.asarray(np.max(values, axis=0), dtype=np.float64)
    if results.dataset[name].attrs.get("units") == "m":
        return np.full(shape, float(results.models[results.carriage.on]["length"]) if results.models else 1.0)
    return np.ones(shape)
