"""When a Richardson pair may be believed: every kept mode must be resolved.

A scheme whose period error is e(omega h) turns a mode too slowly or too fast by omega t e in a time t, average
acceleration by omega^3 h^2 t/12 (mechanics section 6); t is the run's length, or what the mode remembers, 1/(zeta
omega), where that is shorter. A mode whose phase error is d has the error |1 - exp(i d)| in its amplitude; the pair
sees a third of the difference of d and 4 d, which is (1 + 2 cos d)/3 of it: half of it at d = 1.3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engine.lanes import LaneValues
from engine.model import SceneModel
from engine.resonance import bounce_omega
from engine.tables import SceneTables

Array = NDArray[np.float64]

RESOLVED = 1.3  # rad: the largest phase error of any kept mode in the finer march; `tests.calibration.richardson`


def phase_errors(tables: SceneTables, values: LaneValues, felt: Array | None = None) -> Array:
    """(V,) the largest phase error in rad that a mode of the march gathers before its damping forgets it.

    felt: (V,) number of the lowest modes of every body that are looked at; all without.
    """
    timeline = tables.timeline
    scale = values.time_scale(tables.model.carriages[0].name)
    moving = [segment for segment in timeline.segments if not segment.free]
    widths = np.array([segment.end - segment.start for segment in moving])
    steps = np.array([segment.step for segment in moving])
    longest, gathered = steps.max() * scale, [np.sum(widths * steps**power) * scale ** (power + 1) for power in (2, 4)]
    free = sum(segment.steps for segment in timeline.segments if segment.free)
    if free:
        rest = _free_seconds(tables.model)
        longest = np.maximum(longest, rest / free)
        gathered = [part + rest * (rest / free) ** power for power, part in zip((2, 4), gathered, strict=True)]
    return _worst(tables.model, values, gathered, longest, felt)


def steps_to_resolve(model: SceneModel, values: LaneValues) -> Array:
    """(V,) steps per unit of scene time that are enough for every mode; free vibration has as many per first period."""
    scale = values.time_scale(model.carriages[0].name)
    unit = scale if _free_seconds(model) == 0.0 else np.maximum(scale, 2.0 * np.pi / model.first_omega)
    duration = scale * max(rider.end for rider in model.riders) + _free_seconds(model)
    return np.sqrt(_worst(model, values, [duration * unit**2, np.zeros_like(unit)], unit) / RESOLVED)


def _worst(
    model: SceneModel, values: LaneValues, gathered: Sequence[Array], step: Array, felt: Array | None = None
) -> Array:
    """(V,) largest phase error: of steps whose squares and fourth powers have gathered over the run, s^3 and s^5, or of
    the longest ``step``, s, in the time that a mode remembers."""
    worst = np.zeros(values.size)
    for part in model.bodies:
        rates = values.damping_rates(part.name, part.modal.omega)
        memory = np.divide(2.0, rates, out=np.full_like(rates, np.inf), where=rates > 0.0)
        lasting = [np.minimum(run, memory * step**power) for run, power in zip(gathered, (2, 4), strict=True)]
        behind = _behind(model, part.modal.omega[:, None], lasting)
        if felt is not None:
            behind = np.where(np.arange(part.modal.omega.size)[:, None] < felt, behind, 0.0)
        worst = np.maximum(worst, behind.max(axis=0))
    return np.maximum(worst, _behind(model, bounce_omega(model, values), gathered))


def _behind(model: SceneModel, omega: Array, gathered: Sequence[Array]) -> Array:
    """Phase error of frequencies, rad/s, from squares and fourth powers of steps times how long they are taken."""
    square, fourth = model.scheme.period_error
    return np.asarray(omega**3 * square * gathered[0] + omega**5 * fourth * gathered[1])


def _free_seconds(model: SceneModel) -> float:
    """Length of free vibration after the last carriage."""
    return max(float(getattr(rider.motion, "after", 0.0)) for rider in model.riders) * 2.0 * np.pi / model.first_omega
