"""When position errors have settled after a stop: within a band of where they come to rest, for good."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine.floating.frequencies import RIGID, natural_vibrations
from engine.march.settling import STILL, change_within, names_of_times, parts_of_bands, split, told_part
from results_schema.arrays import Array
from results_schema.quantities import AFTER_STOP

if TYPE_CHECKING:
    from collections.abc import Mapping

    from engine.floating.march import Marched
    from engine.floating.model import FloatingModel

SWINGS = 2.0  # longest periods before the end, in which nothing may leave a band: a variant's own may be longer


class Settled(NamedTuple):
    """When tips have settled. times (V,) s by result: after the stop, and since time 0; NaN where that is too near to
    the end, as it may swing out again, or no equilibrium is found. other_bands (V, 2, W) by sensor: the former in wider
    and narrower bands."""

    times: dict[str, Array]
    other_bands: dict[str, Array]


def banded(model: FloatingModel) -> dict[str, float]:
    """The sensors of which it is told when they have settled, with their bands, m."""
    return {name: sensor.settling_band for name, sensor in model.tips.items() if sensor.settling_band is not None}


def bands_of(model: FloatingModel) -> Array:
    """(T, 2 + 2 W) the bands in which it is looked for of every tip, m, the last one that of what stands still; (T, 0)
    where nobody asks."""
    if not banded(model):
        return np.zeros((len(model.tips), 0))
    own = [np.inf if sensor.settling_band is None else sensor.settling_band for sensor in model.tips.values()]
    return np.outer(own, [*parts_of_bands(), STILL])


def settled(model: FloatingModel, marched: Marched) -> Settled:
    """The times of all tips that have a band."""
    found = Settled({}, {})
    if not banded(model):
        return found
    longest, end = SWINGS * longest_period(model), marched.last * marched.step
    for t, (name, sensor) in enumerate(model.tips.items()):
        if sensor.settling_band is None:
            continue
        stop, steps = marched.stops[:, t], marched.settled[:, t].T
        *within, stands = np.maximum(steps * marched.step, stop) - stop
        may_swing = stands > 0.0
        unknown = ~(stop < end) | (may_swing & ~(end - stop - within >= longest))
        own, found.other_bands[name] = split(np.where(unknown, np.nan, within))
        found.times.update(zip(names_of_times(name), (own, stop + own), strict=True))
    return found


def longest_period(model: FloatingModel) -> float:
    """Of the natural vibrations of the study's own scene as it stands at time 0, s; where these are not known, of
    bodies."""
    found = natural_vibrations(model)
    swings = [] if found is None else found.omega[found.omega > RIGID * found.omega.max(initial=0.0)]
    return 2.0 * np.pi / float(min(swings, default=model.first_omega))


def tell_times(
    model: FloatingModel, numbers: Mapping[str, Array], others: Mapping[str, Array], error: Mapping[str, Array]
) -> None:
    """Errors (V,) of these times by result, changed in place: by how much they change in bands that are wider or
    narrower by what the readings after the stop may be off."""
    for name, band in banded(model).items():
        scale = np.maximum(*(np.abs(numbers[f"{name}_{end}"]) for end in ("max", "min")))
        off = np.maximum(*(error[f"{name}{AFTER_STOP}_{end}"] for end in ("max", "min"))) * scale
        own = names_of_times(name)
        change = change_within(others[name], off / band, numbers[own[0]])
        for result in own:
            error[result][:] = told_part(change, numbers[result], np.zeros(change.size, dtype=bool))
