"""Estimated errors of studies at rest: the same scene once more, with bodies that are closer to what they stand for.

Every body has twice the modes there and twice the elements, is not reduced by an `interface`, and what the kept
modes miss is added. Frequencies with static correction converge with a third order or more, those of elements with the
fourth; so `REST` of the difference is what is left of a second order, and of these up to a third more than the error:
on beams of 2 to 16 modes and portals of 2 to 4 elements a member 1.02 to 1.33 times the true one. Statics with the
correction are exact but for rounding.
"""

from __future__ import annotations

import numpy as np

from engine.model.scene_model import SceneModel, build_model
from results_schema.arrays import Array
from studies.at_rest.told_errors import OF_ITSELF, ROUNDING

REST = 4.0 / 3.0  # of the difference
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
