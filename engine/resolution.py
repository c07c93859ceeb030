"""When a Richardson pair may be believed: every kept mode must be resolved.

Average acceleration turns a mode by 2 atan(omega h/2) a step, so it falls behind by omega^3 h^2 t/12 in a time t
(mechanics section 6); t is the run's length, or what the mode remembers, 1/(zeta omega), where that is shorter. A mode
whose phase error is d has the error |1 - exp(i d)| in its amplitude; the pair sees a third of the difference of d and
4 d, which is (1 + 2 cos d)/3 of it: half of it at d = 1.3.
"""

from __future__ import annotations

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
    longest, gathered = steps.max() * scale, np.sum(widths * steps**2) * scale**3
    free = sum(segment.steps for segment in timeline.segments if segment.free)
    if free:
        rest = _free_seconds(tables.model)
        longest, gathered = np.maximum(longest, rest / free), gathered + rest * (rest / free) ** 2
    return _worst(tables.model, values, gathered, longest**2, felt)


def steps_to_resolve(model: SceneModel, values: LaneValues) -> Array:
    """(V,) steps per unit of scene time that are enough for every mode; free vibration has as many per first period."""
    scale = values.time_scale(model.carriages[0].name)
    unit = scale if _free_seconds(model) == 0.0 else np.maximum(scale, 2.0 * np.pi / model.first_omega)
    duration = scale * max(rider.end for rider in model.riders) + _free_seconds(model)
    return np.sqrt(_worst(model, values, duration * unit**2, unit**2) / RESOLVED)


def _worst(model: SceneModel, values: LaneValues, gathered: Array, square: Array, felt: Array | None = None) -> Array:
    """(V,) largest omega^3/12 times what has gathered, in s^3: over the run, or h^2 times what the mode remembers."""
    worst = np.zeros(values.size)
    for part in model.bodies:
        rates = values.damping_rates(part.name, part.modal.omega)
        memory = np.divide(2.0, rates, out=np.full_like(rates, np.inf), where=rates > 0.0)
        behind = part.modal.omega[:, None] ** 3 / 12.0 * np.minimum(gathered, memory * square)
        if felt is not None:
            behind = np.where(np.arange(part.modal.omega.size)[:, None] < felt, behind, 0.0)
        worst = np.maximum(worst, behind.max(axis=0))
    return np.maximum(worst, bounce_omega(model, values) ** 3 / 12.0 * gathered)


def _free_seconds(model: SceneModel) -> float:
    """Length of free vibration after the last carriage."""
    return max(float(getattr(rider.motion, "after", 0.0)) for rider in model.riders) * 2.0 * np.pi / model.first_omega
