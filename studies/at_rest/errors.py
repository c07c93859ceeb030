"""Estimated errors of studies at rest: the same scene once more, with bodies that are closer to what they stand for.

Every body has twice the modes there and twice the elements, and what the kept modes miss is added. Frequencies with
static correction converge with a third order or more, those of elements with the fourth; so `REST` of the difference is
what is left of a second order, and of these up to a third more than the error: on beams of 2 to 16 modes and portals of
2 to 4 elements a member 1.02 to 1.33 times the true one. Statics with the correction are exact but for rounding.
"""

from __future__ import annotations

import numpy as np

from engine.model.scene_model import SceneModel, build_model
from results_schema.arrays import Array
from studies.results.formatting import scientific
from studies.results.results import Results

REST = 4.0 / 3.0  # of the difference
ROUNDING = 1e-8  # of stiff systems that are solved: no error is told below it
OF_ITSELF = "frequency"  # whose errors are parts of itself; those of others, of the largest along the way
PART = "error of "  # before the names of results whose errors a piece has


def finer(model: SceneModel) -> SceneModel:
    """The same scene, closer to what it stands for. Raises BadInput."""
    bodies = {name: body.finer() for name, body in model.study.body.items()}
    study = model.study.model_copy(update={"body": bodies})
    return build_model(study, *model.timing, model.swept, model.numerics._replace(static_correction=True))


def error_of(name: str, own: Array, closer: Array) -> Array:
    """(V,) error of a result (V, S), or (V, K) of one (V, S, K), from that of the finer scene at the same positions."""
    apart, size = np.abs(own - closer), np.abs(closer)
    if name != OF_ITSELF:
        size = np.broadcast_to(np.fmax.reduce(size, axis=1, keepdims=True), size.shape)
    part = np.divide(apart, size, out=np.where(np.isnan(apart), np.nan, 0.0), where=size > 0.0)
    return np.asarray(np.maximum(REST * np.fmax.reduce(part, axis=1), ROUNDING))


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
