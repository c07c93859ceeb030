"""What a study makes of sampled histories, and the stations at which they are sampled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.histories import counts_reduced
from engine.lanes import LaneValues, weights
from engine.plan import STATIONS, Plan
from engine.reduction import Cycle
from engine.tables import SceneTables

Array = NDArray[np.float64]
Counts = NDArray[np.int64]


def counts_sampled(plan: Plan, tables: SceneTables) -> Counts:
    """Stations by their count: those that the study's reduction wants, or some over the whole run, which a march with
    half the steps has too."""
    if plan.reduction is not None:
        return counts_reduced(tables.timeline, plan.reduction.stations)
    first, last = tables.timeline.window
    return np.arange(first, last + 1, 2 * max(1, (last - first) // (2 * STATIONS)))


def reduced(
    plan: Plan, tables: SceneTables, values: LaneValues, counts: Counts, history: Array
) -> dict[str, NDArray[np.generic]]:
    """The study's own results (V, ...) from histories (H, J, V) of its cycle; none where it has no such."""
    if plan.reduction is None:
        return {}
    loads = weights(tables.model, values)

    def static() -> Array:
        unit = tables.static_at(counts)
        found = unit.gravity[:, :, None] * values.of("gravity")
        for r in range(loads.shape[0]):
            found = found + unit.force[:, :, r, None] * loads[r]
        return found

    tau = tables.timeline.moments(counts)[1]
    cycle = Cycle(
        phase=(tau - tau[0]) / (tau[-1] - tau[0]),
        position=tables.timeline.positions(0, counts.astype(np.float64)),
        history=history,
        motion=tables.model.carriages[0].rider.motion,
        find_static=static,
        find_slope=lambda: tables.static_slope_at(counts)[:, :, None] * loads[0],
    )
    return dict(plan.reduction(cycle))
