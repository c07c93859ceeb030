"""Variants of one scene with frames that move, marched, and what is observed of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.floating.lanes import in_blocks, lanes, out_of_blocks
from engine.floating.theory import buckling_ratios
from engine.kernels.floating import layout
from engine.kernels.floating.layout import Lane, Record, Weights
from engine.kernels.floating.march import march as march_lanes
from engine.kernels.floating.observe import BODY_ATTITUDE, CONTACT_FORCE, OF_BODY, OF_CARRIAGE
from engine.kernels.layout import LANES
from engine.march.halting import flagged
from results_schema.arrays import Array, Counts, Mask
from results_schema.gravest_status import gravest
from results_schema.status import Fidelity, Status

if TYPE_CHECKING:
    from engine.floating.model import FloatingModel
    from engine.scene.variants import VariantValues

LEAST_WEIGHT = 0.02  # of it: what presses less, on tracks within a degree of upright, does not lie on them
STATUS = np.array([Status.OK, Status.NOT_CONVERGED, Status.DIVERGED, Status.SEPARATED], dtype=np.int8)


@dataclass(frozen=True, eq=False)
class Marched:
    """What a march of V variants leaves: statistics (V, signals, STATISTICS), history (V, stations, signals) with its
    times (V, stations) s, statuses (V,), the step (V,) s, and the last station that each has reached (V,); stops
    (V, tips) s, infinite where there is none, and settled (V, tips, bands): steps after which tips are within bands for
    good, -inf where they always are; buckling_ratio (V, B): weight at time 0 over what makes a body buckle."""

    statistics: Array
    history: Array
    times: Array
    status: NDArray[np.int8]
    step: Array
    last: Counts
    stops: Array
    settled: Array
    buckling_ratio: Array


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
    `engine.floating.model_choice` chose. Raises Halted."""
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
    with flagged() as stop:
        march_lanes(system, in_lanes, scheme, steps, Record(np.asarray(stations), *kept, stop))
    statistics, history, settled, codes, last = (out_of_blocks(part, V) for part in kept)
    first = model.signal_of("carriages") + CONTACT_FORCE
    pulls = statistics[:, first : model.signal_of("ends") : OF_CARRIAGE, layout.SMALLEST] < 0.0
    lifts = np.any(pulls & _may_lift(model, table.gravity, history[:, 0]), axis=1)
    status = gravest(STATUS[codes], np.where(lifts, np.int8(Status.SEPARATED), np.int8(Status.OK)))
    ratio = buckling_ratios(model, table, history[:, 0])
    return Marched(statistics, history, stations * h[:, None], status, h, last, table.stops, settled, ratio)


def _may_lift(model: FloatingModel, gravity: Array, signals: Array) -> Mask:
    """(V, C) whether nothing but weight presses carriages onto their tracks, by the signals (V, ...) at time 0. Without
    gravity, and where they stand upright, these hold what moves on them from both sides."""
    names, frames = list(model.bodies), model.signal_of("frames") + BODY_ATTITUDE
    first = [frames + OF_BODY * names.index(carriage.on) for carriage in model.study.carriage.values()]
    normal = np.stack([signals[:, np.add.outer(first, 3 * i + 2).astype(int)] for i in range(3)], axis=2)
    presses = np.einsum("vi,vci->vc", gravity, normal) > LEAST_WEIGHT * np.linalg.norm(gravity, axis=1)[:, None]
    rests = np.array([carriage.may_lift for carriage in model.study.carriage.values()], dtype=np.bool_)
    return np.asarray(presses & rests)
