"""Moments at which loads pass sensors whose influence lines have a kink or a jump there: the largest moment under a
load that passes is read there, and steps must not miss it. A sensor under a carriage passes other loads and supports.

In whole runs such moments are boundaries of steps. The steps of a cycle stay equidistant: there the reading is
extrapolated, from either side, by the parabola through three stations.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.model.timeline import Timeline
    from engine.observation.readings import Sensor


SIDE = np.arange(3)  # stations of a parabola
AT_STATION = 1e-6  # of a step, by which a station may be off such a moment and still be it


class Side(NamedTuple):
    """A sensor's reading on one side of a kink: the sum of those at stations (3,), given by their count, times weights
    (3,). at: fractional count of the moment."""

    sensor: int
    at: float
    counts: Counts
    weights: Array


def passes(model: SceneModel, sensor: Sensor) -> Iterator[float]:
    """Scene times at which a load passes a sensor whose influence line has a kink there, in no order; or at which a
    sensor that moves passes one, or a joint of its body."""
    if not sensor.reads.has_kinks:
        return
    own = None if sensor.under is None else model.riders[sensor.under]
    if own is not None:
        for joint in model.bodies[sensor.body].modal.joints:
            yield from own.passes(joint)
    for load in (load for carriage in model.carriages for load in carriage.loads if load.body == sensor.body):
        rider = model.riders[load.rider]
        yield from rider.passes(sensor.at) if own is None else own.meets(rider)


def stops(model: SceneModel, sensors: Iterable[Sensor]) -> Iterator[float]:
    """The same of several sensors."""
    for sensor in sensors:
        yield from passes(model, sensor)


def sides(model: SceneModel, sensors: Iterable[Sensor], timeline: Timeline) -> tuple[Side, ...]:
    """Both sides of every kink in the recorded part, as far as stations of that side are recorded."""
    first, last = timeline.window
    found = []
    for number, sensor in enumerate(sensors):
        at = np.sort(timeline.counts_at(np.array(list(passes(model, sensor)))))
        at = at[(at > first) & (at < last)]
        for before, here, after in zip([first, *at], at, [*at[1:], last], strict=False):
            if abs(here - np.rint(here)) < AT_STATION:
                continue
            left, right = int(here) - SIDE[::-1], int(here) + 1 + SIDE
            if left[0] >= before:
                found.append(_side(number, float(here), left, timeline))
            if right[-1] <= after:
                found.append(_side(number, float(here), right, timeline))
    return tuple(found)


def _side(sensor: int, at: float, counts: Counts, timeline: Timeline) -> Side:
    """Lagrange's weights of the values at three stations in that of their parabola at a moment."""
    (tau,), times = timeline.moments(np.array([at]))[1], timeline.moments(counts)[1]
    apart = times[:, None] - times + np.eye(len(times))
    reach = np.where(np.eye(len(times), dtype=np.bool_), 1.0, tau - times)
    return Side(sensor, at, counts, np.prod(reach / apart, axis=1))
