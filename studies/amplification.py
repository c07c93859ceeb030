"""Largest absolute over largest absolute static value, as more than one kind of study reports it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from results_schema.variables import Variable

if TYPE_CHECKING:
    import xarray as xr

    from engine.scene import Study

DYNAMIC_AMPLIFICATION = Variable(
    "dynamic_amplification",
    ("sensor",),
    long_name="dynamic amplification",
    meaning="largest absolute value over the largest absolute static value of the same model; NaN where the static "
    "value is zero (velocities, accelerations)",
    nan_allowed=True,
)


def with_amplification(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """The dataset with `dynamic_amplification`, from `<sensor>_max`, `_min` and `_static`."""
    import xarray as xr

    ratios = []
    for sensor in study.sensor:
        largest, smallest = (abs(dataset[f"{sensor}_{side}"]) for side in ("max", "min"))
        static = dataset[f"{sensor}_static"]
        ratios.append(largest.where(largest > smallest, smallest) / static.where(static > 0.0))
    joined = xr.concat(ratios, "sensor").transpose(*dataset["status"].dims, "sensor")
    return dataset.assign(
        dynamic_amplification=(joined.dims, joined.values, DYNAMIC_AMPLIFICATION.attributes()),
    )
