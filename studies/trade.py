"""Error against cost, from the points alone: fitted orders, the Pareto front, the cheapest choice for an accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

SLOPES_ALIKE = 0.3


def fitted_order(steps: Sequence[int] | Counts, errors: Array, floor: float, ceiling: float = 0.05) -> float:
    """The power with which errors fall with the number of steps, where they do so evenly; NaN where nowhere.

    Of the points between floor and ceiling the finest run of at least three neighbours counts whose slopes differ by
    less than 0.3 from that of the line fitted through all of them, as long as it can be.

    >>> n = np.array([50, 100, 200, 400, 800])
    >>> round(fitted_order(n, 3.0 / n**2, 1e-9), 6), fitted_order(n, np.full(5, np.nan), 1e-9)
    (2.0, nan)
    """
    with np.errstate(all="ignore"):
        usable = np.isfinite(errors) & (errors > floor) & (errors < ceiling)
        x, y = np.log(np.asarray(steps, dtype=np.float64)), np.log(errors)
    for last in range(len(x) - 1, 1, -1):
        found = np.nan
        for first in range(last - 2, -1, -1):
            if not usable[first : last + 1].all():
                break
            line = np.polyfit(x[first : last + 1], y[first : last + 1], 1)[0]
            slopes = np.diff(y[first : last + 1]) / np.diff(x[first : last + 1])
            if np.abs(slopes - line).max() > SLOPES_ALIKE or slopes.max() >= 0.0:
                break
            found = -float(line)
        if np.isfinite(found):
            return found
    return float("nan")


def dependable(errors: Array) -> Array:
    """Errors (..., steps) of which each is at least that of every finer one, so that no lucky point counts; infinite
    where a finer one has none.

    >>> dependable(np.array([1e-2, 1e-5, 1e-3, 1e-4]))
    array([0.01  , 0.001 , 0.001 , 0.0001])
    """
    known = np.where(np.isfinite(errors), errors, np.inf)
    return np.asarray(np.maximum.accumulate(known[..., ::-1], axis=-1)[..., ::-1])


def fronts(errors: Array, seconds: Array) -> NDArray[np.int8]:
    """(scene, modes, correction, scheme, steps, quantity) 1 on the Pareto front of its scene and quantity.

    errors: of that shape; seconds (scene, modes, scheme, steps).
    """
    found = np.zeros(errors.shape, dtype=np.int8)
    worst = dependable(errors.swapaxes(-1, -2)).swapaxes(-1, -2)
    cost = np.broadcast_to(np.where(np.isfinite(seconds), seconds, np.inf)[:, :, None], errors.shape[:-1])
    for scene, quantity in np.ndindex(errors.shape[0], errors.shape[-1]):
        one, price = worst[scene, ..., quantity][:, ::-1], cost[scene][:, ::-1]  # of equals the one with correction
        places = np.zeros(one.size, dtype=np.int8)
        places[front(one.ravel(), price.ravel())] = 1
        found[scene, ..., quantity] = places.reshape(one.shape)[:, ::-1]
    return found


def front(errors: Array, seconds: Array) -> list[int]:
    """Numbers of the points (P,) than which no other is both cheaper and better, from cheap to dear.

    >>> front(np.array([0.1, 0.2, 0.01, np.inf]), np.array([1.0, 2.0, 3.0, 0.5]))
    [0, 2]
    """
    found: list[int] = []
    best = np.inf
    for place in np.lexsort((errors, seconds)):
        if np.isfinite(seconds[place]) and errors[place] < best:
            best = float(errors[place])
            found.append(int(place))
    return found


class Choice(NamedTuple):
    """A point of the trade: what is taken, the error that it holds with every finer step too, seconds per variant."""

    modes: int
    corrected: bool
    scheme: str
    steps: int
    error: float
    seconds: float


def choices(dataset: xr.Dataset, scene: str, quantity: str) -> list[Choice]:
    """All points of one scene and quantity that have an error, from cheap to dear."""
    total = dataset["total_error"].sel(scene=scene, quantity=quantity)
    total = total.transpose("mode_count", "correction", "scheme", "step_count")
    seconds = dataset["total_seconds_per_variant"].sel(scene=scene).transpose("mode_count", "scheme", "step_count")
    worst = dependable(total.values)
    found = []
    for m, c, i, n in np.argwhere(np.isfinite(worst)):
        scheme, steps = str(dataset["scheme"].values[i]), int(dataset["step_count"].values[n])
        modes, corrected = int(dataset["mode_count"].values[m]), bool(dataset["correction"].values[c])
        found.append(Choice(modes, corrected, scheme, steps, float(worst[m, c, i, n]), float(seconds.values[m, i, n])))
    return _sorted(found)


def step_choices(dataset: xr.Dataset, scene: str, quantity: str) -> list[Choice]:
    """The same of the steps alone: the march's schemes at the study's own number of modes, on the same equations."""
    error = dataset["error"].sel(scene=scene, quantity=quantity).transpose("scheme", "step_count")
    worst = dependable(error.where(dataset["comparison_only"] == 0).values)
    seconds = dataset["seconds_per_variant"].sel(scene=scene).transpose("scheme", "step_count").values
    modes = int(dataset["modes_used"].sel(scene=scene).values.flat[0])
    schemes, steps = dataset["scheme"].values, dataset["step_count"].values
    found = [
        Choice(modes, True, str(schemes[i]), int(steps[n]), float(worst[i, n]), float(seconds[i, n]))
        for i, n in np.argwhere(np.isfinite(worst))
    ]
    return _sorted(found)


def _sorted(found: list[Choice]) -> list[Choice]:
    """From cheap to dear; of equals first the better one, then the one with the static correction."""
    return sorted(found, key=lambda choice: (choice.seconds, choice.error, not choice.corrected))


def cheapest(points: Sequence[Choice], tolerance: float) -> Choice | None:
    """The point of least seconds whose error is at most the tolerance; None where there is none."""
    return next((point for point in points if point.error <= tolerance), None)
