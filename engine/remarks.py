"""What a user should know before believing a study: things that are allowed and yet often a mistake."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from engine.bucket import Bucket
from engine.lanes import LaneValues, moving_mass, weight
from engine.plan import Plan

Array = NDArray[np.float64]

FAST = 3.0  # times the critical speed
HEAVY = 2.0  # times the body's mass
DEEP = 0.1  # of the length: a static deflection beyond linear bending


def remarks(plan: Plan) -> list[str]:
    """One sentence per remark, each once, in the order of `REMARKS`; none for an ordinary study."""
    return list(dict.fromkeys(sentence for remark in REMARKS for sentence in remark(plan)))


def _unsupported(plan: Plan) -> Iterator[str]:
    riding = {carriage.rides for carriage in plan.base.carriages}
    for number, part in enumerate(plan.base.bodies):
        if part.modal.rigid_modes and number not in riding:
            yield f"nothing holds body {part.name} fully: it will move away as a rigid body"


def _released(plan: Plan) -> Iterator[str]:
    for part in plan.base.bodies:
        if part.own_weight and plan.study.start == "rest":
            yield (
                f"body {part.name} is released undeformed at time 0 and rings under its own weight; "
                'initial = "equilibrium" starts it in its sag'
            )


def _leaves_between(plan: Plan) -> Iterator[str]:
    for carriage in plan.base.carriages:
        low, high = carriage.rider.motion.range()
        if carriage.rider.stays and (low < 0.0 or high > carriage.rider.length):
            yield (
                f"the way of {carriage.name} leaves its body ({low:.4g} to {high:.4g} m of "
                f"{carriage.rider.length:.4g} m), where it does not act: a spline may pass beyond its waypoints"
            )


def _fast(plan: Plan) -> Iterator[str]:
    worst = max((_speed_ratio(plan, bucket).max() for bucket in plan.buckets), default=0.0)
    if worst > FAST:
        yield f"some variants run at up to {worst:.3g} times the critical speed omega_1 L/pi: are the units right?"


def _heavy(plan: Plan) -> Iterator[str]:
    worst = 0.0
    for bucket, values in _lanes(plan):
        for number, carriage in enumerate(bucket.scene.carriages):
            mass = bucket.scene.bodies[carriage.body].modal.mass
            worst = max(worst, float(moving_mass(bucket.scene, values, number).max()) / mass)
    if worst > HEAVY:
        yield f"a carriage weighs up to {worst:.3g} times its body: look at more modes and steps before believing it"


def _deep(plan: Plan) -> Iterator[str]:
    worst = 0.0
    for bucket, values in _lanes(plan):
        for number, carriage in enumerate(bucket.scene.carriages):
            body = bucket.scene.bodies[carriage.body].modal
            if not body.rigid_modes:
                s = np.linspace(0.0, body.length, 33)
                flexibility = np.abs(body.influence_at(s, s)).max() / body.length
                worst = max(worst, float(np.abs(weight(bucket.scene, values, number)).max()) * flexibility)
    if worst > DEEP:
        yield f"the static deflection alone reaches {worst:.3g} of the length: beyond small-deflection theory"


def _thin(plan: Plan) -> Iterator[str]:
    """Fewer than 20 fixed steps in a first period."""
    for bucket in plan.buckets:
        if bucket.reason == "as the study says":
            time_scale = plan.values(bucket, bucket.variants).time_scale(bucket.scene.carriages[0].name)
            periods = float(time_scale.max()) * bucket.scene.first_omega / (2.0 * np.pi)
            if bucket.steps < 20.0 * periods:
                yield f"{bucket.steps} steps are only {bucket.steps / periods:.2g} in a first period of the body"


def _lanes(plan: Plan) -> Iterator[tuple[Bucket, LaneValues]]:
    for bucket in plan.buckets:
        yield bucket, plan.values(bucket, bucket.variants)


def _speed_ratio(plan: Plan, bucket: Bucket) -> Array:
    """(V,) top speed of the first carriage over the critical speed."""
    scene = bucket.scene
    speed = scene.carriages[0].rider.top_speed / plan.values(bucket, bucket.variants).time_scale(
        scene.carriages[0].name
    )
    return np.asarray(speed * np.pi / (scene.first_omega * scene.leading_body.modal.length))


REMARKS: tuple[Callable[[Plan], Iterator[str]], ...] = (
    _unsupported,
    _released,
    _leaves_between,
    _fast,
    _heavy,
    _deep,
    _thin,
)
