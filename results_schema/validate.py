"""A dataset against the declarations: what is there, in which shape and unit, and why numbers are missing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from results_schema.blocks import slices
from results_schema.errors import ArchiveError
from results_schema.gravest_status import lost
from results_schema.lazy_imports import xr
from results_schema.variables import Variable, axes, expand

_TEXT_KINDS = "UTO"
_COUNT_SHOWN = 3
LARGEST = 1e150  # of a number: the square of a larger one is none


def validate(dataset: xr.Dataset, kind: str, declared: Mapping[str, Variable]) -> None:
    """Compare a dataset of a kind ("passage"; a group: "/audit") with what is declared, as `expand` has it.

    The grid is the dimensions of `status` (of a group: none). Raises ArchiveError that lists all findings.
    """
    findings = list(findings_of(dataset, kind, declared))
    if findings:
        raise ArchiveError(f"the results of {kind} are not as declared: " + "; ".join(findings))


def findings_of(dataset: xr.Dataset, kind: str, declared: Mapping[str, Variable]) -> Iterator[str]:
    """Every difference from the declarations as one text."""
    grid = tuple(map(str, dataset["status"].dims)) if "status" in dataset else ()
    for name, variable in declared.items():
        if variable.required and name not in dataset:
            yield f"{name}: expected in every {kind}, received nothing"
    for name in map(str, list(dataset.data_vars)):
        if name not in declared:
            yield f"{name}: expected a declared name, received an unknown one"
            continue
        array, variable = dataset[name], declared[name]
        yield from _shape_findings(array, variable, grid)
        yield from _attribute_findings(array, variable)
        if array.dtype.kind == "f":
            yield from _value_findings(dataset, name, variable)
    for name in map(str, list(dataset.coords)):
        yield from _coordinate_findings(dataset, name)


def root_findings(dataset: xr.Dataset, kind: str, declared: Mapping[str, Variable]) -> Iterator[str]:
    """Every difference of what an archive holds from the declarations, and every number that cannot be."""
    yield from _number_findings(dataset)
    yield from findings_of(dataset, kind, declared)
    yield from _index_findings(dataset, "history", int(dataset["status"].size))


def group_findings(dataset: xr.Dataset, path: str, size: int) -> Iterator[str]:
    """The same of a group of an archive ("/audit"). size: variants of the study."""
    yield from _number_findings(dataset)
    yield from findings_of(dataset, path, expand(path))
    yield from _index_findings(dataset, "sample", size)


def _number_findings(dataset: xr.Dataset) -> Iterator[str]:
    """Flags that mean nothing, and numbers that are too large to reckon with."""
    for name, array in dataset.variables.items():
        if array.dtype.kind not in "iuf":
            continue
        if "flag_values" in array.attrs and not np.isin(array.values, array.attrs["flag_values"]).all():
            strange = np.setdiff1d(array.values, array.attrs["flag_values"])
            yield f"{name}: expected one of its flag_values, received {_shown(strange)}"
        if array.dtype.itemsize < 8 or array.dtype.kind != "f":
            continue  # which holds no such number
        values = array.values
        large = np.abs(values) > LARGEST
        if large.any():
            yield f"{name}: expected numbers below {LARGEST:g}, received {values[large].flat[0]:g}"


def _index_findings(dataset: xr.Dataset, name: str, size: int) -> Iterator[str]:
    """Flat numbers of variants, where a coordinate has such."""
    if name not in dataset.coords:
        return
    values = dataset[name].values
    known = values.dtype.kind in "iu" and values.min() >= 0 and values.max() < size
    if not known or len(np.unique(values)) < values.size:
        yield f"{name}: expected different numbers from 0 to {size - 1}, received {_shown(values)}"


def _shown(values: np.ndarray) -> str:
    return ", ".join(str(value) for value in values.ravel()[:_COUNT_SHOWN]) + ", ..." * (values.size > _COUNT_SHOWN)


def _shape_findings(array: xr.DataArray, variable: Variable, grid: tuple[str, ...]) -> Iterator[str]:
    leads: dict[str, list[tuple[str, ...]]] = {"grid": [grid], "history": [grid, ("history",)], "none": [()]}
    dims = tuple(map(str, array.dims))
    fits = variable.lead == "some" or any(_dims_fit(dims, (*lead, *variable.dims)) for lead in leads[variable.lead])
    if not fits:
        wanted = " or ".join(str((*lead, *variable.dims)) for lead in leads[variable.lead])
        yield f"{array.name}: expected dimensions {wanted}, received {dims}"
    if _type_name(array) != variable.dtype:
        yield f"{array.name}: expected {variable.dtype}, received {_type_name(array)}"


def _dims_fit(dims: tuple[str, ...], wanted: tuple[str, ...]) -> bool:
    return len(dims) == len(wanted) and all(
        name in choice.split("|") for name, choice in zip(dims, wanted, strict=True)
    )


def _type_name(array: xr.DataArray) -> str:
    return "str" if array.dtype.kind in _TEXT_KINDS else str(array.dtype.name)


def _attribute_findings(array: xr.DataArray, variable: Variable) -> Iterator[str]:
    for key, wanted in variable.attributes().items():
        received = array.attrs.get(key)
        if key == "comment" or (key == "long_name" and received):
            continue
        if received is None:
            yield f"{array.name}: expected the attribute {key} = {wanted!r}, received none"
        elif not _agree(received, wanted, key):
            yield f"{array.name}: expected {key} = {wanted!r}, received {received!r}"


def _agree(received: Any, wanted: Any, key: str) -> bool:
    """Whether an attribute is as declared; flags may have been added since an archive was written."""
    if key == "flag_meanings":
        received, wanted = str(received).split(), str(wanted).split()
    if key.startswith("flag_"):
        found = np.atleast_1d(received)
        return found.size > 0 and np.array_equal(found, np.atleast_1d(wanted)[: found.size])
    return np.array_equal(received, wanted)


def _value_findings(dataset: xr.Dataset, name: str, variable: Variable) -> Iterator[str]:
    array = dataset[name]
    parts = slices(array.shape, array.dtype.itemsize) if array.shape else [...]
    infinite = sum(int(np.isinf(array[part].values).sum()) for part in parts)
    if infinite:
        yield f"{name}: expected finite numbers or NaN, received {infinite} infinite ones"
    if variable.nan_allowed:
        return
    failed = _failed(dataset, array)
    if failed is None:
        return
    missing = np.isnan(array.values)
    if variable.gaps_allowed:
        lead = 1 if "history" in array.dims else dataset["status"].ndim if "status" in dataset else 0
        missing &= missing.all(axis=tuple(range(lead, array.ndim)), keepdims=True)
    unexplained = missing & ~failed
    if unexplained.any():
        yield f"{name}: expected numbers where the status keeps them, received NaN at {_places(unexplained)}"
    unwanted = ~np.isnan(array.values) & failed
    if unwanted.any():
        yield f"{name}: expected NaN where the status keeps no values, received numbers at {_places(unwanted)}"


def _failed(dataset: xr.Dataset, array: xr.DataArray) -> np.ndarray | None:
    """Where no values are kept, in the shape of `array`; None where that cannot be said (its dims are wrong)."""
    if "status" not in dataset:
        return np.zeros(array.shape, bool)
    status = dataset["status"]
    failed = lost(status.values)
    if "history" in array.dims and "history" in dataset.coords:
        chosen = dataset["history"].values
        if chosen.min() < 0 or chosen.max() >= failed.size:
            return None
        failed = failed.ravel()[chosen]
    elif array.dims[: status.ndim] != status.dims:
        return None
    return np.broadcast_to(failed.reshape(failed.shape + (1,) * (array.ndim - failed.ndim)), array.shape)


def _places(mask: np.ndarray) -> str:
    places = [tuple(map(int, index)) for index in np.argwhere(mask)[:_COUNT_SHOWN]]
    more = int(mask.sum()) - len(places)
    return ", ".join(map(str, places)) + (f" and {more} more" if more > 0 else "")


def _coordinate_findings(dataset: xr.Dataset, name: str) -> Iterator[str]:
    array = dataset.coords[name]
    if "_FillValue" in array.attrs or array.encoding.get("_FillValue") is not None:
        yield f"{name}: expected a coordinate without _FillValue, received one"
    if not array.attrs.get("long_name"):
        yield f"{name}: expected the attribute long_name, received none"
    is_text = array.dtype.kind in _TEXT_KINDS
    if not is_text and not array.attrs.get("units"):
        yield f"{name}: expected the attribute units, received none"
    if array.dtype.kind == "f" and not np.isfinite(array.values).all() and name not in ("elapsed",):
        yield f"{name}: expected finite numbers, received NaN or infinite ones"
    variable = axes().get(name)
    if variable is None:
        return
    if _type_name(array) != variable.dtype:
        yield f"{name}: expected {variable.dtype}, received {_type_name(array)}"
    wanted = variable.attributes().get("units")
    if wanted and array.attrs.get("units") not in (None, wanted):
        yield f"{name}: expected units = {wanted!r}, received {array.attrs.get('units')!r}"
