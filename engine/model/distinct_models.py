"""The distinct scenes of a sweep, and which variants share each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.bodies.modal.description import MAX_MODES
from engine.model.scene_model import SceneModel, build_model
from engine.scene.study import Study
from engine.scene.sweep import Cases
from engine.scene.variants import VariantValues, structural
from results_schema.arrays import Counts, split


def scenes(study: Study, cases: Cases, chosen: Counts) -> Iterator[tuple[SceneModel, Counts]]:
    """Distinct scenes of some variants, given by their flat numbers, with those that share each."""
    base = study.without_sweep()
    for variants in split(chosen, structure(study, cases, chosen)):
        own = cases.study_of(base, int(variants[0])) if structural(study, cases) or _limited(study) else base
        values = VariantValues.of(own, cases, variants)
        timing = values.timing()
        columns = np.stack([column for pair in timing.values() for column in pair])
        codes = np.zeros(variants.size, dtype=np.int64)
        if np.any(columns != columns[:, :1]):
            codes = np.unique(columns, axis=1, return_inverse=True)[1].reshape(-1)
        parts = [(part, _timing_of(values, int(part[0]))) for part in split(np.arange(variants.size), codes)]
        del values, timing, columns  # while the scenes are looked at: those of ten million variants are large
        for part, when in parts:
            yield build_model(own, *when, cases.paths), variants[part]


def base_scene(study: Study) -> SceneModel:
    """The scene of a study without its sweep."""
    return build_model(study.without_sweep(), *_timing_of(VariantValues(study, {}, 1), 0))


def _timing_of(values: VariantValues, lane: int) -> tuple[dict[str, float], dict[str, float]]:
    """Paces and delays of one lane, by carriage."""
    timing = values.timing()
    return (
        {name: float(pace[lane]) for name, (pace, _) in timing.items()},
        {name: float(delay[lane]) for name, (_, delay) in timing.items()},
    )


def structure(study: Study, cases: Cases, variants: Counts) -> Counts:
    """(V,) number of the scene that each variant has, by the dimensions that change it, and the modes that it reads."""
    dims = {axis.dim for axis in cases.axes if set(axis.paths) & set(structural(study, cases))}
    positions = cases.positions(variants) if dims else {}
    code = np.zeros(variants.size, dtype=np.int64)
    for dim, size in zip(cases.dims, cases.shape, strict=True):
        if dim in dims:
            code = code * size + positions[dim]
    for within in _modes_within(study, cases, variants):
        code = code * (MAX_MODES + 1) + within
    return code


def _limited(study: Study) -> list[str]:
    """The keys of frequency limits that sensors and envelopes have."""
    readers = (("sensor", study.sensor), ("envelope", study.envelope))
    return [
        f"{table}.{name}.frequency_limit"
        for table, named in readers
        for name, one in named.items()
        if one.frequency_limit is not None
    ]


def _modes_within(study: Study, cases: Cases, variants: Counts) -> Iterator[Counts]:
    """For every frequency limit (V,) how many modes of variants lie within it: those that share a scene in units of
    their own read as many."""
    values = VariantValues.of(study, cases, variants)
    if values.units is None or not (keys := _limited(study)):
        return
    (body,) = study.body.values()
    omega = (body.with_modes(MAX_MODES) if body.modes_are_open else body).build().omega
    for key in keys:
        yield np.searchsorted(omega, 2.0 * np.pi * values.column(key), side="right")
