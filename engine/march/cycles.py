"""What a study makes of the histories of a cycle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.march.tables import SceneTables
from engine.model.variant_values import VariantValues, weights
from engine.observation.cycle_reduction import Cycle, Reduction
from results_schema.arrays import Array, Counts


def reduced(
    reduction: Reduction | None, tables: SceneTables, values: VariantValues, counts: Counts, history: Array
) -> dict[str, NDArray[Any]]:
    """The study's own results (V, ...) from histories (H, J, V) of its cycle; none where it has no such."""
    if reduction is None:
        return {}
    loads = weights(tables.model, values)

    def static() -> Array:
        unit = tables.static_at(counts)
        found = unit.gravity[:, :, None] * values.gravity
        for r in range(loads.shape[0]):
            found = found + unit.force[:, :, r, None] * loads[r]
        return found

    tau = tables.timeline.moments(counts)[1]
    cycle = Cycle(
        phase=(tau - tau[0]) / (tau[-1] - tau[0]),
        position=tables.timeline.positions(0, counts.astype(np.float64)),
        history=history,
        motion=tables.model.clock,
        find_static=static,
        find_slope=lambda: tables.static_slope_at(counts)[:, :, None] * loads[0],
    )
    return dict(reduction(cycle))
