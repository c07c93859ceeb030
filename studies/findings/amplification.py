"""Largest absolute over largest absolute static value, as more than one kind of study reports it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from engine.scene.study import Study
from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.findings.theory import moves_away
from studies.results.axes import Axis
from studies.results.formatting import ROUNDING
from studies.results.kept import kept
from studies.results.places import Index, extreme
from studies.results.results import Results

(DYNAMIC_AMPLIFICATION,) = outputs("""
    dynamic_amplification | sensor | | nan | dynamic amplification
        largest absolute value over the largest absolute static value of the same model; NaN where the static value is
        zero (velocities, accelerations); both with the body's own weight where own_weight = true
""")


@kept
def sizes(results: Results, sensor: str) -> Array:
    """The largest absolute value of a sensor, in the sweep's shape."""
    sides = (results.dataset[f"{sensor}_{side}"].transpose(*results.dims) for side in ("max", "min"))
    return np.asarray(np.maximum(*(np.abs(side.values) for side in sides)), dtype=np.float64)


def only_rounding(results: Results, sensor: str) -> bool:
    """Whether a sensor reads nothing, as all of its values are rounding beside those of another one in its unit."""
    alike = [name for name, units in results.sensors.items() if units == results.sensors[sensor]]
    scale = max(float(np.nanmax(sizes(results, name), initial=0.0)) for name in alike)
    own = sizes(results, sensor)
    return bool(np.isfinite(own).any()) and float(np.nanmax(own)) <= ROUNDING * scale


def size_errors(results: Results, sensor: str) -> Array:
    """The estimated error of the same: that of the extreme which is larger."""
    sides = [results.dataset[f"{sensor}_{side}"].transpose(*results.dims).values for side in ("max", "min")]
    errors = (results.estimated_error(f"{sensor}_{side}") for side in ("max", "min"))
    return np.where(np.abs(sides[0]) >= np.abs(sides[1]), *errors)


def largest(results: Results, values: Array) -> Index | None:
    """The variant with the largest of values, among those whose contact holds where there are such."""
    held = results.held if np.isfinite(values[results.held]).any() else np.isfinite(values)
    return extreme(np.where(held, values, np.nan))


def beside(results: Results, values: Array, place: Index, axis: Axis) -> Array:
    """What the two neighbours of a place of the sweep along an axis have of values; nothing at an end of the sweep, and
    where one of them has none."""
    value = axis.values[place[results.dims.index(axis.dim)]]
    at = int(np.searchsorted(np.sort(axis.values), value))
    near = results.along(axis, values, place)[at - 1 : at + 2 : 2] if at else values[:0]
    return near if near.size == 2 and np.isfinite(near).all() else near[:0]


def told_amplification(results: Results, sensor: str) -> Array:
    """The dynamic amplification of a sensor that sentences and figures tell, in the sweep's shape; NaN throughout where
    statics are no measure of what it reads: across gravity, of a body that carriages push along its track or across it
    by their inertia, which no static value counts, and of a body that moves away as nothing holds it."""
    own, body = results.study.sensor[sensor], results.study.body_of(sensor)
    pushed = any(one.on == body and one.pushes for one in results.study.carriage.values())
    aside = own.side is not None or (own.point is not None and not results.study.body[body].deflects_down(own.point))
    if body == results.carriage.on and moves_away(results):
        return np.full(results.shape, np.nan)
    if pushed and (aside or own.way[:2] != (0.0, 0.0)):
        return np.full(results.shape, np.nan)
    return results.numbers("dynamic_amplification", sensor)


def with_amplification(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """The dataset with `dynamic_amplification`, from `<sensor>_max`, `_min` and `_static`, and its errors."""
    ratios = []
    for sensor in study.sensor:
        largest, smallest = (abs(dataset[f"{sensor}_{side}"]) for side in ("max", "min"))
        static = dataset[f"{sensor}_static"]
        ratios.append(largest.where(largest > smallest, smallest) / static.where(static > 0.0))
    joined = xr.concat(ratios, "sensor").transpose(*dataset["status"].dims, "sensor")
    found = dataset.assign(
        dynamic_amplification=(joined.dims, joined.values, DYNAMIC_AMPLIFICATION.attributes()),
    )
    return with_derived_errors(found, derived_from(study))


def with_own_weight(study: Study, sensor: str) -> str:
    """That both parts of a sensor's amplification count own weight, to stand behind it; "" where that does not act."""
    weighs = study.body[study.body_of(sensor)].own_weight and not study.sensor[sensor].reads.of_contact
    return " (own weight in both)" if weighs else ""


def derived_from(study: Study) -> Mapping[str, tuple[str, ...]]:
    """The results whose errors the amplifications have: that of the larger extreme, as both are over the static
    value; rates have none."""
    steady = [name for name, sensor in study.sensor.items() if not sensor.reads.rate]
    return {f"dynamic_amplification {name}": (f"{name}_max", f"{name}_min") for name in steady}


def with_derived_errors(dataset: xr.Dataset, derived: Mapping[str, tuple[str, ...]]) -> xr.Dataset:
    """The dataset with errors of results that a study derives from others: the largest of theirs, with the tolerance of
    the first."""
    if "estimated_error" not in dataset:
        return dataset
    errors = dataset[["estimated_error", "tolerance"]]
    parts = [errors]
    for name, sources in derived.items():
        largest = errors["estimated_error"].sel(result=list(sources)).max("result", skipna=False)
        tolerance = errors["tolerance"].sel(result=sources[0], drop=True)
        own = xr.Dataset({"estimated_error": largest, "tolerance": tolerance})
        parts.append(own.expand_dims(result=np.array([name])))
    joined = xr.concat(parts, "result", combine_attrs="override")
    joined["estimated_error"] = joined["estimated_error"].transpose(*errors["estimated_error"].dims)
    joined["result"].attrs = dict(dataset["result"].attrs)
    return dataset.drop_dims("result").assign(joined)
