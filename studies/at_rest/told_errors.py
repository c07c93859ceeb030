"""Estimated errors of studies at rest along the way, in their own units and in a sentence."""

from __future__ import annotations

import numpy as np

from results_schema.arrays import Array
from studies.results.formatting import scientific
from studies.results.results import Results

ROUNDING = 1e-8  # of stiff systems that are solved: no error is told below it
OF_ITSELF = "frequency"  # whose errors are parts of itself; those of others, of the largest along the way


def errors_along(results: Results, name: str) -> Array | None:
    """The estimated errors of a result along the way, in its unit and the shape of its values with the sweep first;
    None where it has none."""
    array = results.dataset[name].transpose(*results.dims, "position", ...)
    values = np.abs(np.asarray(array.values, dtype=np.float64))
    labels = array[array.dims[-1]].values if array.ndim > len(results.dims) + 1 else None
    names = [name] if labels is None else [f"{name} {label}" for label in labels]
    parts = np.stack([results.estimated_error(one) for one in names], axis=-1)[..., None, :]
    if labels is None:
        values = values[..., None]
    size = values if name == OF_ITSELF else np.fmax.reduce(values, axis=-2, keepdims=True)
    found = np.broadcast_to(parts * size, values.shape)
    return None if np.isnan(found).all() else found.reshape(array.shape)


def told_errors(results: Results) -> str:
    """The largest estimated error of any number; "" where none is known."""
    if "estimated_error" not in results.dataset or "position" not in results.dataset.dims:
        return ""
    errors = results.dataset["estimated_error"].max(results.dims)
    if not np.isfinite(errors).any():
        return ""
    worst = int(np.nanargmax(errors.values))
    if float(errors[worst]) <= ROUNDING:
        return f"estimated errors at most {scientific(ROUNDING)}, which is rounding."
    return (
        f"estimated errors at most {scientific(float(errors[worst]))} ({errors['result'].values[worst]}), "
        "by twice the modes and elements of every body."
    )
