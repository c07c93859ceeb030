"""Frequencies that springs under sprung masses bring in, and the steps that they need.

With the mass held by nothing and the contact by the kept modes alone, spring k swings at
omega_c^2 = k (1/m + 1/m_c),  1/m_c = mu/(1 + m_w mu),  mu = largest sum of phi^2 along the track: no frequency of the
coupled scene exceeds (omega_N^2 + sum omega_c^2)^1/2. A body on its contacts has sum v^2, its own mobility there, in
place of 1/m. Where a step is many contact periods long, the tie is as good as rigid at position level and the march may
grow: measured at omega_c h = 200, 6e5 times per passage with average acceleration, 2.8e3 times with HHT-alpha -0.02, at
most 1.4 with -0.05. Up to omega_c h = 2 pi it was 1.3 at most.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from engine.fidelity import LIMIT_MARGIN, STEPS_PER_PERIOD, check_fixed_steps
from engine.lanes import LaneValues
from engine.model import SceneModel
from engine.ties import CarriageTie, SpringTie
from results_schema.errors import BadInput

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

STEPS_PER_CONTACT_PERIOD = 20
PLACES = 257  # along the track, at which the mobility is looked for


def bounce_omega(model: SceneModel, values: LaneValues) -> Array:
    """(V,) rad/s: of the fastest sprung mass on a spring that stands on rigid ground; 0 without any. Bodies on contacts
    have no rule of this kind: where they swing faster than what they ride they are like its higher modes."""
    found = np.zeros(values.size)
    for spring in model.sprung:
        found = np.maximum(found, np.sqrt(values.of(f"{spring.key}.stiffness") / values.of(f"{spring.key}.mass")))
    return found


def contact_omega(model: SceneModel, values: LaneValues) -> Array:
    """(V,) rad/s: omega_c of all springs, the root of the sum of squares; 0 without any."""
    return np.sqrt(sum((_contact_square(model, values, one) for one in model.springs), np.zeros(values.size)))


def _contact_square(model: SceneModel, values: LaneValues, spring: SpringTie) -> Array:
    if spring.rigid:
        return np.zeros(values.size)
    body = model.bodies[model.carriages[spring.carriage].body].modal
    mobility = float(np.max(np.sum(body.shape(np.linspace(0.0, body.length, PLACES)) ** 2, axis=1)))
    stiffness = values.of(f"{spring.key}.stiffness")
    if spring.held is not None:
        own = spring.held.fixed_row(model.bodies[spring.held.body].modal)
        return np.asarray(stiffness * (float(np.sum(own**2)) + mobility))
    contact = mobility / (1.0 + values.of(f"{spring.key}.wheel_mass") * mobility)
    return np.asarray(stiffness * (1.0 / values.of(f"{spring.key}.mass") + contact))


def spring_steps(
    model: SceneModel, values: LaneValues, per_period: float | Array = STEPS_PER_PERIOD, finer: float = 1.0
) -> dict[str, Array]:
    """Steps (V,) per unit of scene time that the springs ask for, by rule; empty without any.

    per_period: of a sprung mass. finer: times the steps that the scheme's limit asks for.
    """
    if not model.springs:
        return {}
    check_free_vibration(model)
    turns = values.time_scale(model.carriages[0].name) / (2.0 * math.pi)
    rules = (
        {} if not model.sprung else {"the period of a sprung mass": per_period * turns * bounce_omega(model, values)}
    )
    rules |= {
        f"{STEPS_PER_CONTACT_PERIOD} per period of a contact resonance": STEPS_PER_CONTACT_PERIOD
        * turns
        * contact_omega(model, values),
    }
    if math.isfinite(model.scheme.stability_limit):
        rules["the scheme's stability limit with springs"] = finer * LIMIT_MARGIN * least_for_limit(model, values)
    return {name: model.scheme.stride * steps for name, steps in rules.items()}


def check_steps(model: SceneModel, values: LaneValues, steps: Counts) -> None:
    """Refuse fixed steps (V,) that cannot be right. Raises BadInput with limit and suggestion."""
    time_scale = values.time_scale(model.carriages[0].name)
    check_fixed_steps(model, time_scale, steps)
    if not model.springs:
        return
    check_free_vibration(model)
    if math.isfinite(model.scheme.stability_limit):
        _refuse(model, least_for_limit(model, values), steps, "the step is beyond the scheme's stability limit")
    least = model.scheme.stride * time_scale * contact_omega(model, values) / (2.0 * math.pi)
    _refuse(model, least, steps, "a step is longer than a period of the contact on its spring: the march could grow")


def vibrates_freely(carriage: CarriageTie) -> bool:
    """Whether a carriage leaves free vibration behind."""
    return bool(getattr(carriage.rider.motion, "after", 0.0) > 0.0)


def check_free_vibration(model: SceneModel) -> None:
    """Refuse free vibration with springs by a conditionally stable scheme: its steps follow from the bodies' modes
    alone, whatever the springs of a variant. Raises BadInput."""
    for carriage in model.carriages:
        if math.isfinite(model.scheme.stability_limit) and vibrates_freely(carriage):
            raise BadInput(
                "free vibration with springs needs a scheme that is stable with any step",
                where=model.study.source.where(f"carriage.{carriage.name}.motion.after"),
                expected="0",
                remedy='scheme = "average-acceleration"',
            )


def least_for_limit(model: SceneModel, values: LaneValues) -> Array:
    """(V,) steps at which the coupled scene reaches the scheme's limit, at most."""
    highest = np.sqrt(float(model.omega.max()) ** 2 + contact_omega(model, values) ** 2)
    return np.asarray(highest * values.time_scale(model.carriages[0].name) / model.scheme.stability_limit)


def _refuse(model: SceneModel, least: Array, steps: Counts, what: str) -> None:
    worst = int(np.argmax(least / steps))
    if least[worst] > steps[worst]:
        stride = model.scheme.stride
        enough = stride * math.ceil(LIMIT_MARGIN * float(least.max()) / stride)
        raise BadInput(
            what,
            where=model.study.source.where("solver.steps"),
            expected=f"at least {math.ceil(float(least[worst]))} steps over a passage or cycle",
            received=str(int(steps[worst])),
            remedy=f'steps = {enough} or more, or steps = "auto"',
        )
