"""Estimated errors of all results of a dataset, in their own units."""

from __future__ import annotations

import numpy as np

from results_schema.lazy_imports import xr
from studies.at_rest.told_errors import errors_along
from studies.findings.absolute_errors import DYNAMIC_AMPLIFICATION, absolute_errors, told_as_of
from studies.results.cells import single_numbers
from studies.results.results import Results


def errors(dataset: xr.Dataset) -> xr.Dataset:
    """The estimated error of every result of a study's dataset, in the result's own unit: variables of the same names
    over the same sweep (and sensors, or along the way), NaN where no estimate or no result exists. Raises BadInput
    where the dataset is none of a study."""
    results, found = Results.of(dataset), dict[str, list[xr.DataArray]]()
    if "estimated_error" not in results.dataset or not results.study.output.keeps_variants:
        return xr.Dataset(attrs={"title": "no estimates of errors"})
    for name, sensor, array in single_numbers(results.dataset):
        if set(array.dims) == set(results.dims) and told_as_of(name, sensor) in results.dataset["result"].values:
            attributes = {"long_name": f"estimated error of {name}", "units": _unit(results, array, sensor)}
            values = array.transpose(*results.dims)
            own = values.copy(data=absolute_errors(results, name, sensor)).where(values.notnull())
            found.setdefault(name, []).append(own.assign_attrs(attributes))
    told = [str(name) for name in results.dataset.data_vars if _is_told_along(results, str(name))]
    along = {name: _along(results, name) for name in told}
    return xr.Dataset({name: _joined(results.dataset[name], parts) for name, parts in found.items()} | along)


def _is_told_along(results: Results, name: str) -> bool:
    """Whether errors of a result are told along the way, of itself or of what it lists."""
    told = results.dataset["result"].values
    return "position" in results.dataset[name].dims and any(one == name or one.startswith(f"{name} ") for one in told)


def _along(results: Results, name: str) -> xr.DataArray:
    """The errors of a result along the way."""
    array = results.dataset[name].transpose(*results.dims, "position", ...)
    values, known = errors_along(results, name), array.notnull()
    attributes = {"long_name": f"estimated error of {name}", "units": str(array.attrs.get("units", "") or "1")}
    own = array.copy(data=np.full(array.shape, np.nan) if values is None else values).where(known)
    own.attrs = attributes
    return own.transpose(*results.dataset[name].dims)


def _unit(results: Results, array: xr.DataArray, sensor: str) -> str:
    """The unit of a result, or of its sensor; a ratio has none."""
    own = str(array.attrs.get("units", "") or "1")
    if own != "1" or not sensor or array.name == DYNAMIC_AMPLIFICATION:
        return own
    return str(results.dataset["sensor_unit"].sel(sensor=sensor).item())


def _joined(array: xr.DataArray, parts: list[xr.DataArray]) -> xr.DataArray:
    """Errors of one result, over its sensors where it is over these."""
    others = [dim for dim in array.dims if dim not in parts[0].dims]
    if not others:
        return parts[0]
    bare = [part.drop_vars("sensor_unit", errors="ignore") for part in parts]
    known = xr.concat(bare, others[0], coords="different", compat="equals")
    return known.reindex({others[0]: array[others[0]].values}).transpose(*array.dims)
