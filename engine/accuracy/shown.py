"""Histories that are kept of some variants: at which stations, and those that marches find which these converge by."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import lcm
from typing import TYPE_CHECKING

import numpy as np

from engine.observation.histories import CYCLE_STATIONS, WHOLE_STATIONS, counts_at_rest, counts_shown
from results_schema.arrays import Array, Counts
from results_schema.status import Fidelity

if TYPE_CHECKING:
    from engine.accuracy.grids import SceneGrid
    from engine.march.outcome import Asked
    from engine.march.tables import SceneTables
    from engine.model.scene_model import SceneModel

Histories = dict[str, Array]  # (n, stations) of variants, by name


def fine_enough(grid: SceneGrid, model: SceneModel, by: int) -> int:
    """``by``, steps in one of the grid's; where the study leaves its steps open, more if they are too few for a
    history."""
    unit = grid.unit * model.scheme.stride
    if grid.fixed or grid.asked.study.output.histories != "auto":
        return by
    if grid.asked.window == "last-cycle":  # all variants have the same phases
        return lcm(by * unit, CYCLE_STATIONS) // unit
    return by * -(-(WHOLE_STATIONS - 1) // (by * unit))


def stations_shown(asked: Asked, tables: SceneTables) -> Counts:
    """Stations of kept histories by their count in a march."""
    wanted = asked.study.output.histories
    counts = counts_shown(tables.timeline, asked.window, wanted)
    if tables.watches_rest and wanted == "auto":
        counts = np.union1d(counts, counts_at_rest(tables.timeline))
    return counts


@dataclass(eq=False)
class Shown:
    """Histories of some variants, by their places (``lanes``), out of the last march of each that has them."""

    lanes: Counts
    _found: dict[int, tuple[int, Histories]] = field(default_factory=dict)

    def stations(self, grid: SceneGrid, tables: SceneTables, by: int, lanes: Counts) -> Counts:
        """Stations, by their count, of which a march of some variants with ``by`` steps in one of the grid's is to keep
        histories: none where it has too few, or none of the variants, or where statics tell them, at the grid's own."""
        marched = tables.model.fidelity is not Fidelity.STATIC and fine_enough(grid, tables.model, by) == by
        wanted = marched and np.isin(lanes, self.lanes).any()
        return stations_shown(grid.asked, tables) if wanted else np.zeros(0, dtype=np.int64)

    def keep(self, lanes: Counts, found: Histories) -> None:
        """Take the histories of some variants, in place of those of earlier marches."""
        for place, lane in enumerate(lanes.tolist()):
            self._found.pop(lane, None)
            if found:
                self._found[lane] = (place, found)

    def rows(self) -> Iterator[tuple[Counts, Histories]]:
        """The variants, by their places, whose histories are known, with these."""
        for lane in np.sort(self.lanes).tolist():
            if lane in self._found:
                place, found = self._found[lane]
                yield np.array([lane]), {name: array[place : place + 1] for name, array in found.items()}
