"""What archives hold of cells of variants: counts by status, extremes with their variants, percentiles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.status import Status
from studies.results.axes import DIRECTION, direction_in_words
from studies.results.formatting import swept_quantity, typed_unit

if TYPE_CHECKING:
    from studies.results.results import Results

_BESIDE = ("_position",)  # where something was, shown by nothing but itself


class End(NamedTuple):
    """An extreme of a result: its value, the variant's number, its swept numbers by the names of their axes, and the
    estimated error as archives have it."""

    value: float
    variant: int
    at: Mapping[str, float]
    error: float


class CellRange(NamedTuple):
    """A result over all cells. sensor: "" where it is of none. percentiles: where there is one cell, else none."""

    name: str
    sensor: str
    units: str
    smallest: End
    largest: End
    percentiles: tuple[float, ...]


def single_numbers(dataset: xr.Dataset) -> Iterator[tuple[str, str, xr.DataArray]]:
    """The results of a march that are one number per variant, or one per variant and sensor, robot, body or place:
    name, the name of the sensor or another one or "", and values."""
    grid = dataset["status"].dims
    for name, array in dataset.data_vars.items():
        if array.dtype.kind != "f" or str(name).endswith(_BESIDE):
            continue
        of_places = len(array.dims) == len(grid) + 1 and str(array.dims[-1]).endswith("_place")
        if array.dims == grid or of_places:
            yield str(name), "", array
        elif len(array.dims) == len(grid) + 1 and array.dims[:-1] == grid and array.dims[-1] != "result":
            named = dataset.coords.get(array.dims[-1])
            for place, word in enumerate([] if named is None or named.dtype.kind not in "UO" else named.values):
                yield str(name), str(word), array.isel({array.dims[-1]: place})


def counts_of(dataset: xr.Dataset) -> dict[Status, int]:
    """Number of variants per status, those that occur."""
    if "status_count" in dataset:
        values = np.array(list(Status))
        counts = dataset["status_count"].values.reshape(-1, len(Status)).sum(axis=0)
    else:
        values, counts = np.unique(dataset["status"].values, return_counts=True)
    return {Status(int(value)): int(count) for value, count in zip(values, counts, strict=True) if count}


def cell_ranges(results: Results) -> Iterator[CellRange]:
    """The range of every result over all cells."""
    dataset = results.dataset
    cells = dataset["status"].size
    for place, full in enumerate(dataset["result"].values):
        ends = [
            _end(dataset, side, place, pick) for side, pick in (("smallest", np.nanargmin), ("largest", np.nanargmax))
        ]
        if ends[0] is None or ends[1] is None:
            continue
        name, _, sensor = str(full).partition(" ")
        units = str(dataset["result_unit"].values[place])
        parts: tuple[float, ...] = ()
        if "percentile" in dataset and cells == 1:
            parts = tuple(dataset["percentile"].isel(result=place).values.ravel().tolist())
        yield CellRange(name, sensor, units, ends[0], ends[1], parts)


def percentile_spans(results: Results) -> Iterator[tuple[str, str, Array]]:
    """Of every result of several cells its name, its unit, and each percentile's smallest and largest value (2, P)."""
    dataset = results.dataset
    if "percentile" not in dataset or results.size == 1:
        return
    values = dataset["percentile"].transpose("result", ..., "percent").values
    for name, units, own in zip(dataset["result"].values, dataset["result_unit"].values, values, strict=True):
        cells = own.reshape(-1, own.shape[-1])
        cells = cells[~np.isnan(cells).any(axis=1)]
        if cells.size:
            yield str(name), str(units), np.stack([cells.min(axis=0), cells.max(axis=0)])


def _end(dataset: xr.Dataset, side: str, place: int, pick: object) -> End | None:
    """The extreme of all cells."""
    values: Array = dataset[side].isel(result=place).values.ravel()
    if np.isnan(values).all():
        return None
    cell = int(pick(values))  # type: ignore[operator]
    names: Sequence[str] = dataset["swept"].values.tolist()
    at = dataset[f"{side}_at"].isel(result=place).values.reshape(-1, len(names))[cell]
    variant = int(dataset[f"{side}_variant"].isel(result=place).values.ravel()[cell])
    error = float(dataset[f"{side}_error"].isel(result=place).values.ravel()[cell])
    return End(float(values[cell]), variant, dict(zip(names, at.tolist(), strict=True)), error)


def words_of(results: Results, values: Mapping[str, float]) -> dict[str, str]:
    """Swept numbers of one variant, by the names of their axes, in words."""
    found = {}
    for name, value in values.items():
        path = results.study.sweep.axes[name].of[0]
        unit = results.study.unit(path)
        found[name] = swept_quantity(value, unit.symbol if unit else "1", typed_unit(results.study, name))
        if path.endswith(DIRECTION):
            found[name] = direction_in_words(value)
    return found
