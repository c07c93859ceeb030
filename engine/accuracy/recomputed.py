"""Variants marched again with what they were computed with, for their histories."""

from __future__ import annotations

from collections.abc import Iterator
from math import lcm

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.grids import SceneGrid
from engine.accuracy.ladder import ladder_of
from engine.accuracy.reference import as_fixed
from engine.march.outcome import Flat, number_of
from engine.march.tables import SceneTables
from engine.model.scene_model import SceneModel
from engine.observation.histories import CYCLE_STATIONS, WHOLE_STATIONS
from results_schema.status import Fidelity

Counts = NDArray[np.int64]
USED = ("fidelity_used", "scheme_used", "modes_used", "steps_used")


def marches_again(grid: SceneGrid, used: Flat) -> Iterator[tuple[SceneTables, Counts]]:
    """The marches of some variants by what these were computed with, and which of them (lanes) each is for."""
    taken = np.stack([used[name] for name in USED], axis=1).astype(np.int64)
    rows, own = np.unique(taken, axis=0, return_inverse=True)
    for number, row in enumerate(rows):
        yield _tables(grid, *(int(part) for part in row)), np.flatnonzero(own.reshape(-1) == number)


def _tables(grid: SceneGrid, fidelity: int, scheme: int, modes: int, steps: int) -> SceneTables:
    """The tables of a march; where the study leaves its steps open, finer ones if there are too few for a history."""
    model = _model(grid, fidelity, scheme, modes)
    unit = grid.unit * model.scheme.stride
    by = max(1, steps // unit)
    if grid.fixed or grid.asked.study.output.histories != "auto":
        return grid.tables(model, by)
    if grid.asked.window == "last-cycle":  # all variants have the same phases
        return grid.tables(model, lcm(by * unit, CYCLE_STATIONS) // unit)
    return grid.tables(model, by * -(-(WHOLE_STATIONS - 1) // (by * unit)))


def _model(grid: SceneGrid, fidelity: int, scheme: int, modes: int) -> SceneModel:
    """The scene as a variant was computed with it; statics know all modes, and march none."""
    for numerics in (*as_fixed(grid).numerics, *ladder_of(grid.asked, grid).columns):
        model = grid.model(numerics)
        same = model.fidelity == fidelity and number_of(model.scheme) == scheme
        if same and (model.body_modes == modes or fidelity == Fidelity.STATIC):
            return model
    raise ValueError(f"modes: expected those of a march of this scene, received {modes}")
