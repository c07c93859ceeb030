"""Error against cost, from the points alone: fitted orders, the Pareto front, the cheapest choice for an accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array, Counts
from results_schema.lazy_imports import xr

FORMAL_ORDERS = {"richardson": 4, "rk4": 4, "lagged-inertia": 1, "lagged-convective": 1}  # of all others 2
SLOPES_ALIKE = 0.3  # of three or more errors, where their slope is the scheme's own within NEAR
NEAR = 0.35
STRAIGHT, ENOUGH, LEAST = 0.15, 5, 0.85  # what else counts: so even, so many errors, and falling at least so fast


def formal_order(scheme: str, quantity: str) -> int:
    """What theory says; largest values lie between two stations, which are of second order.

    >>> formal_order("rk4", "history"), formal_order("rk4", "extremes"), formal_order("fox-goodwin", "history")
    (4, 2, 2)
    """
    order = FORMAL_ORDERS.get(scheme, 2)
    return min(order, 2) if quantity == "extremes" else order


def fitted_order(
    steps: Sequence[int] | Counts, errors: Array, floor: float, formal: float, ceiling: float = 0.05
) -> float:
    """The power with which errors fall with the number of steps, where they do so evenly; NaN where nowhere.

    Of the points between floor and ceiling the finest run of neighbours counts that is as long as it can be: at least
    three whose slopes differ by less than 0.3 from that of the line through all of them, which is near the formal
    order; or at least five on a line as good as straight, whatever its slope, if it falls as an order 1 does.

    >>> n = np.array([50, 100, 200, 400, 800])
    >>> round(fitted_order(n, 3.0 / n**2, 1e-9, 2), 6), fitted_order(n, 0.001 / n**0.5, 1e-9, 2)
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
            line, uneven = _line(x[first : last + 1], y[first : last + 1])
            if uneven > SLOPES_ALIKE:
                break
            is_own = abs(-line - formal) <= NEAR
            is_other = uneven <= STRAIGHT and last - first + 1 >= ENOUGH and -line >= LEAST
            found = -line if is_own or is_other else found
        if np.isfinite(found):
            return found
    return float("nan")


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Slope of the line through points, and how far slopes between neighbours are from it; infinite where one rises."""
    line, slopes = float(np.polyfit(x, y, 1)[0]), np.diff(y) / np.diff(x)
    return line, float(np.abs(slopes - line).max()) if slopes.max() < 0.0 else float("inf")


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
    """All points of one scene and quantity that have an error and a time, from cheap to dear."""
    total = dataset["total_error"].sel(scene=scene, quantity=quantity)
    total = total.transpose("mode_count", "correction", "scheme", "step_count")
    seconds = dataset["total_seconds_per_variant"].sel(scene=scene).transpose("mode_count", "scheme", "step_count")
    worst = dependable(total.values)
    found = []
    for m, c, i, n in np.argwhere(np.isfinite(worst) & np.isfinite(seconds.values[:, None])):
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
        for i, n in np.argwhere(np.isfinite(worst) & np.isfinite(seconds))
    ]
    return _sorted(found)


def _sorted(found: list[Choice]) -> list[Choice]:
    """From cheap to dear; of equals first the better one, then the one with the static correction."""
    return sorted(found, key=lambda choice: (choice.seconds, choice.error, not choice.corrected))


def cheapest(points: Sequence[Choice], tolerance: float, known: float) -> Choice | None:
    """The point of least seconds whose error is at most the tolerance even with the reference's own error, known, on
    top of it; None where there is none."""
    return next((point for point in points if point.error + known <= tolerance), None)


def is_out_of_reach(points: Sequence[Choice], tolerance: float, known: float) -> bool:
    """Whether every point errs more than the tolerance even where the reference's own error, known, is all against
    it."""
    return all(point.error - known > tolerance for point in points)


class Automatic(NamedTuple):
    """The program's own choice for one scene: the tolerance asked, the error of its histories (infinite where it
    diverged), seconds per variant, and those of the cheapest point that surely holds the tolerance; None where no point
    does."""

    scene: str
    asked: float
    error: float
    seconds: float
    front: float | None

    @property
    def over_front(self) -> float | None:
        """How many times as long it takes as the cheapest point."""
        return None if self.front is None else self.seconds / self.front


def automatic_choices(dataset: xr.Dataset, tolerance: float) -> list[Automatic]:
    """The program's own choices at a tolerance, of the scenes that have one."""
    found = []
    for scene in map(str, dataset["scene"].values):
        own = dataset.sel(scene=scene, asked_tolerance=tolerance)
        if not int(own["automatic_steps"]):
            continue
        known = float(dataset["total_reference_error"].sel(scene=scene, quantity="history"))
        best = cheapest(choices(dataset, scene, "history"), tolerance, known)
        error, seconds = float(own["automatic_error"]), float(own["automatic_seconds_per_variant"])
        error = error if np.isfinite(error) else float("inf")
        found.append(Automatic(scene, tolerance, error, seconds, None if best is None else best.seconds))
    return found
