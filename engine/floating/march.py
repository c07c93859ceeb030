"""Variants of one scene with frames that move, marched, and what is observed of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.floating.lanes import in_blocks, lanes, out_of_blocks
from engine.kernels.floating import layout
from engine.kernels.floating.layout import Lane, Record, Weights
from engine.kernels.floating.march import march as march_lanes
from engine.kernels.floating.observe import CONTACT_FORCE, OF_CARRIAGE
from engine.kernels.layout import LANES
from results_schema.arrays import Array, Counts
from results_schema.gravest_status import gravest
from results_schema.status import Fidelity, Status

if TYPE_CHECKING:
    from engine.floating.model import FloatingModel
    from engine.scene.variants import VariantValues

STATUS = np.array([Status.OK, Status.NOT_CONVERGED, Status.DIVERGED, Status.SEPARATED], dtype=np.int8)


@dataclass(frozen=True, eq=False)
class Marched:
    """What a march of V variants leaves: statistics (V, signals, STATISTICS), history (V, stations, signals) with its
    times (V, stations) s, statuses (V,), the step (V,) s, and the last station that each has reached (V,); stops
    (V, tips) s, infinite where there is none, and settled (V, tips, bands): steps after which tips are within bands for
    good, -inf where they always are."""

    statistics: Array
    history: Array
    times: Array
    status: NDArray[np.int8]
    step: Array
    last: Counts
    stops: Array
    settled: Array


def march(
    model: FloatingModel,
    values: VariantValues,
    duration: Array,
    steps: int,
    stations: Counts,
    scheme: Weights,
    fidelity: Fidelity = Fidelity.FRAME,
) -> Marched:
    """March variants for a duration (V,) s in so many steps, with signals kept at stations (ascending); fidelity: what
    `engine.floating.model_choice` chose."""
    V, h = values.size, duration / steps
    table = lanes(model, values, h)
    in_lanes = Lane(*map(in_blocks, table))
    shape = (len(in_lanes.step), model.signals)
    statistics = np.zeros((*shape, layout.STATISTICS, LANES))
    statistics[:, :, layout.LARGEST], statistics[:, :, layout.SMALLEST] = -np.inf, np.inf
    history = np.full((shape[0], stations.size, shape[1], LANES), np.nan)
    codes, last = np.zeros((2, shape[0], LANES), dtype=np.int64)
    system = model.system._replace(given=fidelity == Fidelity.GIVEN_FRAME)
    settled = np.full((shape[0], *system.bands.shape, LANES), -np.inf)
    kept = statistics, history, settled, codes, last
    march_lanes(system, in_lanes, scheme, steps, Record(np.asarray(stations), *kept))
    statistics, history, settled, codes, last = (out_of_blocks(part, V) for part in kept)
    # without gravity nothing lies on a track: it holds what moves on it
    heavy = table.gravity[:, 2] > 0.0
    first = model.signal_of("carriages") + CONTACT_FORCE
    lifts = heavy & (
        statistics[:, first : model.signal_of("ends") : OF_CARRIAGE, layout.SMALLEST].min(axis=1, initial=0.0) < 0.0
    )
    status = gravest(STATUS[codes], np.where(lifts, np.int8(Status.SEPARATED), np.int8(Status.OK)))
    return Marched(statistics, history, stations * h[:, None], status, h, last, table.stops, settled)
