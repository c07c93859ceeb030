"""How many steps a variant needs, as a pure function of that variant alone.

Until error estimates choose, "auto" is the full model with steps enough for every rule of `RULES`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.kernels.schemes import Scheme
from engine.model import SceneModel
from results_schema.errors import BadInput

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

STEPS_PER_PERIOD = 200
LEAST_STEPS = 200
ALIAS_MARGIN = 1.5
LIMIT_MARGIN = 1.05  # a conditionally stable scheme stays this far inside its limit
MOST_STEPS = 100_000_000  # over one passage or cycle
_STAIR = 4  # step counts are LEAST_STEPS times 1, 2, 3, or 4 to 7 times a power of two: few tables, little waste


@dataclass(frozen=True)
class Needs:
    """Steps per unit of scene time that each rule asks for, each (V,), and the rule that decides."""

    per_rule: dict[str, Array]

    @property
    def total(self) -> Array:
        """The largest."""
        return np.asarray(np.max(np.stack(list(self.per_rule.values())), axis=0))

    @property
    def deciding(self) -> NDArray[np.int64]:
        """Number of the rule that asks for most."""
        return np.asarray(np.argmax(np.stack(list(self.per_rule.values())), axis=0))


def needed_steps(model: SceneModel, scheme: Scheme, time_scale: Array) -> Needs:
    """Steps per passage or cycle of variants whose scene time lasts ``time_scale`` (V,) s per unit."""
    periods = time_scale * model.first_omega / (2.0 * math.pi)
    highest = float(model.omega.max())
    rules = {
        f"{STEPS_PER_PERIOD} per first period": STEPS_PER_PERIOD * periods,
        f"{LEAST_STEPS} per passage or cycle": np.full_like(time_scale, LEAST_STEPS),
    }
    alias = [
        alias_steps(float(part.wave_number.max()), float(part.omega.max()), carriage.rider.top_speed, time_scale)
        for carriage in model.carriages
        if carriage.inertia == "mass"
        for part in (model.bodies[carriage.body].modal,)
    ]
    if alias:
        rules["the alias rule of the highest mode"] = ALIAS_MARGIN * np.max(np.stack(alias), axis=0)
    if math.isfinite(scheme.stability_limit):
        rules["the scheme's stability limit"] = LIMIT_MARGIN * highest * time_scale / scheme.stability_limit
    return Needs(rules)


def free_steps(model: SceneModel, scheme: Scheme) -> int:
    """Steps per first period of free vibration, after the last carriage."""
    limit = LIMIT_MARGIN * float(model.omega.max()) * 2.0 * math.pi / model.first_omega / scheme.stability_limit
    return max(STEPS_PER_PERIOD, math.ceil(limit))


def alias_steps(wave_number: float, omega: float, top_speed: float, time_scale: Array) -> Array:
    """Steps n (V,) at which k_N s' h = 2 atan(2/(omega_N h)), h = time_scale/n (mechanics section 7.2).

    top_speed: m per unit of scene time. Average acceleration may resonate with itself below; the left side falls and
    the right side rises with n, so bisection finds the one root.
    """
    low, high = np.zeros_like(time_scale), np.full_like(time_scale, 60.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        steps = np.exp(middle)
        short = wave_number * top_speed / steps > 2.0 * np.arctan(2.0 * steps / (omega * time_scale))
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.exp(high)


def round_up(steps: Array) -> Counts:
    """The next step count of the stair, so that neighbouring variants share tables.

    >>> round_up(np.array([3.0, 200.0, 201.0, 1000.0, 1001.0]))
    array([ 200,  200,  400, 1000, 1200])
    """
    scaled = np.maximum(np.asarray(steps, dtype=np.float64), LEAST_STEPS) / LEAST_STEPS
    tread = 2.0 ** np.maximum(np.floor(np.log2(scaled / _STAIR) + 1e-12), 0.0)
    return np.rint(LEAST_STEPS * tread * np.ceil(scaled / tread - 1e-9)).astype(np.int64)


def check_fixed_steps(model: SceneModel, scheme: Scheme, time_scale: Array, steps: Array | Counts) -> None:
    """Refuse fixed steps beyond a scheme's stability limit (fault 12). Raises BadInput with limit and suggestion."""
    if not math.isfinite(scheme.stability_limit):
        return
    highest = float(model.omega.max())
    worst = int(np.argmax(time_scale / steps))
    found = highest * float(time_scale[worst] / steps[worst])
    if found > scheme.stability_limit:
        enough = math.ceil(LIMIT_MARGIN * highest * float(time_scale[worst]) / scheme.stability_limit)
        raise BadInput(
            "the step is beyond the scheme's stability limit",
            where=model.study.source.where("solver.steps"),
            expected=f"omega h <= {scheme.stability_limit:.4g} with the highest mode kept ({highest:.4g} rad/s)",
            received=f"omega h = {found:.4g}",
            remedy=f'steps = {enough} or more, steps = "auto", or scheme = "average-acceleration"',
        )


def check_most_steps(model: SceneModel, steps: Array | Counts) -> None:
    """Refuse step counts beyond the cap (fault 13). Raises BadInput."""
    if steps.size and not float(np.max(steps)) <= MOST_STEPS:
        raise BadInput(
            "too many steps over one passage or cycle",
            where=model.study.source.where("solver.steps"),
            expected=f"at most {MOST_STEPS}",
            received=f"{float(np.max(steps)):.3g}",
            remedy="a faster motion, fewer modes or larger steps",
        )
