"""How many steps a variant needs whatever its accuracy, as a pure function of that variant alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.kernels.schemes import Scheme
from engine.lanes import LaneValues
from engine.model import SceneModel
from results_schema.errors import BadInput

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

STEPS_PER_PERIOD = 200  # where nothing is known of the accuracy
LEAST_STEPS = 200
ALIAS_MARGIN = 1.5
LIMIT_MARGIN = 1.05  # a conditionally stable scheme stays this far inside its limit
# Fixed steps must be so many times the rule's. Right above the rule average acceleration still grows by up to 1.23 per
# passage in narrow bands, conditionally stable schemes by 10 to 7000; from here on by 1.12 or less (rarely 1.18).
LEAST_MARGIN = 1.1
MOST_STEPS = 100_000_000  # over one passage or cycle
_STAIR = 2  # step counts are LEAST_STEPS times 1, or 2 or 3 times a power of two: few tables, little waste


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


def needed_steps(model: SceneModel, time_scale: Array) -> Needs:
    """Steps per passage or cycle of variants whose scene time lasts ``time_scale`` (V,) s per unit, where nothing is
    known of the accuracy."""
    periods = time_scale * model.first_omega / (2.0 * math.pi)
    return Needs({f"{STEPS_PER_PERIOD} per first period": STEPS_PER_PERIOD * periods} | safe_steps(model, time_scale))


def safe_steps(model: SceneModel, time_scale: Array, finer: float = 1.0) -> dict[str, Array]:
    """Steps (V,) per passage or cycle by the rules that no march may break, by rule; so that one with ``finer`` times
    fewer may not either."""
    rules = {f"{LEAST_STEPS} per passage or cycle": np.full_like(time_scale, LEAST_STEPS)}
    alias = alias_steps(model, time_scale)
    if alias.any():
        rules["the alias rule of the highest mode"] = max(ALIAS_MARGIN, finer * LEAST_MARGIN) * alias
    if math.isfinite(model.scheme.stability_limit):
        rules["the scheme's stability limit"] = finer * limit_steps(model, float(model.omega.max()), time_scale)
    return rules


def limit_steps(model: SceneModel, highest: float, time_scale: Array) -> Array:
    """(V,) steps that stay inside the scheme's stability limit with a highest frequency, rad/s; 0 without a limit."""
    return np.asarray(LIMIT_MARGIN * highest * time_scale / model.scheme.stability_limit)


def free_steps(model: SceneModel) -> int:
    """Steps per first period of free vibration, after the last carriage."""
    limit = LIMIT_MARGIN * float(model.omega.max()) * 2.0 * math.pi / model.first_omega / model.scheme.stability_limit
    return max(STEPS_PER_PERIOD, math.ceil(limit))


def alias_steps(model: SceneModel, time_scale: Array, kept: int | None = None) -> Array:
    """(V,) least steps per passage or cycle of the alias rule for the masses that ride on their bodies; 0 without any.

    A mass sees the highest mode's wave pass at k_N s' while the scheme turns that mode by its own phase; together they
    must stay below half a turn per step, k_N s' h + phase(omega_N h) < pi, else the march may resonate with itself.
    For average acceleration that is k_N s' h < 2 atan(2/(omega_N h)) (mechanics section 7.2). kept: of all modes.
    """
    found = np.zeros_like(time_scale)
    joined = {spring.carriage for spring in model.springs if spring.rigid}
    for number, carriage in enumerate(model.carriages):
        if carriage.inertia != "force" or number in joined:
            body = model.bodies[carriage.body].modal
            wave = float(body.wave_number[:kept].max()) * carriage.rider.top_speed
            found = np.maximum(found, _alias_root(model.scheme, wave, float(body.omega[:kept].max()) * time_scale))
    return model.scheme.stride * found


def _alias_root(scheme: Scheme, wave: float, angle: Array) -> Array:
    """(V,) steps n at which wave/n + phase(angle/n) = pi: the left side falls with n, so bisection finds the root."""
    low, high = np.zeros_like(angle), np.full_like(angle, 60.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        steps = np.exp(middle)
        short = wave / steps + scheme.phase(angle / steps) >= math.pi
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.exp(high)


def round_up(steps: Array) -> Counts:
    """The next step count of the stair, so that neighbouring variants share tables.

    >>> round_up(np.array([3.0, 200.0, 201.0, 1000.0, 1001.0]))
    array([ 200,  200,  400, 1200, 1200])
    """
    scaled = np.maximum(np.asarray(steps, dtype=np.float64), LEAST_STEPS) / LEAST_STEPS
    tread = 2.0 ** np.maximum(np.floor(np.log2(scaled / _STAIR) + 1e-12), 0.0)
    return np.rint(LEAST_STEPS * tread * np.ceil(scaled / tread - 1e-9)).astype(np.int64)


def stair(most: float) -> Array:
    """All step counts of the stair up to the first that is no less than ``most``.

    >>> stair(1000.0)
    array([ 200.,  400.,  600.,  800., 1200.])
    """
    found = [LEAST_STEPS]
    while found[-1] < most:
        found.append(int(round_up(np.array([found[-1] + 1.0]))[0]))
    return np.array(found, dtype=np.float64)


def least_steps(model: SceneModel, time_scale: Array) -> Array:
    """(V,) the fewest steps that neither the alias rule nor the scheme's stability limit refuses."""
    inside = float(model.omega.max()) * time_scale / model.scheme.stability_limit
    return np.asarray(np.maximum(inside, LEAST_MARGIN * alias_steps(model, time_scale)))


def check_fixed_steps(model: SceneModel, time_scale: Array, steps: Array | Counts) -> None:
    """Refuse fixed steps beyond the scheme's stability limit (fault 12), or too few for the alias rule where the scheme
    does not damp enough. Raises BadInput with limit and suggestion."""
    _check_limit(model, time_scale, steps)
    if not model.scheme.is_damped:
        _check_alias(model, time_scale, steps)


def allow_any_steps(model: SceneModel, values: LaneValues, steps: Counts) -> None:
    """In place of `resonance.check_steps` where accuracy is not the question."""


def _check_limit(model: SceneModel, time_scale: Array, steps: Array | Counts) -> None:
    limit = model.scheme.stability_limit
    highest = float(model.omega.max())
    found = highest * float(np.max(time_scale / steps))
    if found > limit:
        raise BadInput(
            "the step is beyond the scheme's stability limit",
            where=model.study.source.where("solver.steps"),
            expected=f"omega h <= {limit:.4g} with the highest mode kept ({highest:.4g} rad/s)",
            received=f"omega h = {found:.4g}",
            remedy=f'{_enough(model, time_scale)}, steps = "auto", or scheme = "average-acceleration"',
        )


def _check_alias(model: SceneModel, time_scale: Array, steps: Array | Counts) -> None:
    least = LEAST_MARGIN * alias_steps(model, time_scale)
    worst = int(np.argmax(least / steps))
    if least[worst] > steps[worst]:
        raise BadInput(
            "too few steps for the highest mode under a moving mass: the march could resonate with itself and grow",
            where=model.study.source.where("solver.steps"),
            expected=f"at least {math.ceil(float(least[worst]))} steps over a passage or cycle (the alias rule)",
            received=str(int(steps[worst])),
            remedy=f'{_enough(model, time_scale)}, steps = "auto", fewer modes, or scheme = "hht-alpha" with '
            "alpha = -0.05, which damps it",
        )


def _enough(model: SceneModel, time_scale: Array) -> str:
    """A number of steps that these two rules refuse for no variant."""
    enough = LIMIT_MARGIN * float(np.max(least_steps(model, time_scale)))
    stride = model.scheme.stride
    return f"steps = {stride * math.ceil(enough / stride)} or more"


def check_even_steps(model: SceneModel, steps: Counts) -> None:
    """Refuse a number of steps that a Richardson pair cannot halve. Raises BadInput."""
    odd = steps[steps % model.scheme.stride != 0]
    if odd.size:
        raise BadInput(
            "a Richardson pair halves the number of steps",
            where=model.study.source.where("solver.steps"),
            expected="an even number",
            received=str(int(odd[0])),
            remedy=f"steps = {int(odd[0]) + 1}",
        )


def check_most_steps(model: SceneModel, steps: Array | Counts) -> None:
    """Refuse step counts beyond the cap (fault 13). Raises BadInput."""
    if steps.size and not float(np.max(steps)) <= MOST_STEPS:
        raise BadInput(
            "too many steps over one passage or cycle",
            where=model.study.source.where("solver.steps"),
            expected=f"at most {MOST_STEPS}",
            received=f"{float(np.max(steps)):.3g}",
            remedy="a larger tolerance, a faster motion, fewer modes or larger steps",
        )
