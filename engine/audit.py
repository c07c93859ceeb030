"""The audit of a study: some of its variants once more with all terms, twice the modes and four times the steps.

Which variants, and how they are marched again, follows from the study alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.axes import sobol_points
from engine.bodies.body import AUTO_MODES, MAX_MODES, Body
from engine.bodies.frame import MAX_FIXED_INTERFACE_MODES, Frame
from engine.bodies.reduced import Reduced
from engine.bodies.reduced_body import load_body
from engine.bodies.rigid import Rigid
from engine.fidelity import allow_any_steps, check_most_steps
from engine.kernels.layout import LANES
from engine.lanes import LaneValues
from engine.model import SceneModel, build_model
from engine.plan import START_SECONDS, Bucket, Plan, steps_of
from engine.readings import Sensor
from engine.scene import Study
from engine.sweep import Cases
from engine.tables import SceneTables
from results_schema.status import Fidelity

Counts = NDArray[np.int64]

MORE_MODES, MORE_STEPS = 2, 4
LEAST_STEPS = 800  # of a variant that marched none
PART, FEWEST, MOST = 0.01, 16, 256  # of all variants, for `suggested_size`
MOST_TIME, FREE_SECONDS = 0.3, 2.0  # of the run's expected time; and what may be spent whatever that is
SILENT, PLACES = 1e-9, 33  # of the largest that its body's modes show at so many places: less is rounding
_MOST_DRAWS = 16  # per variant of the sweep; what is not drawn by then is taken in order


def audited(plan: Plan) -> Counts:
    """(n,) flat numbers of the variants that the study wants audited, ascending; "auto" is none."""
    wanted = plan.study.solver.audit
    return spread_quasi_randomly(plan.cases, 0 if wanted == "auto" else int(wanted))


def spread_quasi_randomly(cases: Cases, count: int) -> Counts:
    """(n,) flat numbers, ascending, of `count` variants or all: scrambled Sobol points over the sweep's dimensions."""
    if count >= cases.size:
        return np.arange(cases.size, dtype=np.int64)
    found, draws = np.zeros(0, dtype=np.int64), 2 * count
    while found.size < count and draws <= _MOST_DRAWS * cases.size:
        places = np.floor(sobol_points(draws, len(cases.shape)) * cases.shape).astype(np.int64)
        drawn = np.ravel_multi_index(tuple(places.T), cases.shape)
        found, draws = drawn[np.sort(np.unique(drawn, return_index=True)[1])], 2 * draws
    left = np.setdiff1d(np.arange(cases.size), found) if found.size < count else found[:0]
    return np.sort(np.concatenate([found, left])[:count])


def audit_plan(plan: Plan, variants: Counts) -> Plan:
    """The plan that marches some variants again; their flat numbers stay what they are, and no history is kept.

    Variants of one scene share the steps of the one that needs most, sixteen at a time. Raises BadInput where that is
    more than can be marched.
    """
    buckets: list[Bucket] = []
    by_scene: dict[int, list[Bucket]] = {}
    for bucket in plan.buckets:
        by_scene.setdefault(id(bucket.scene), []).append(bucket)
    for own in by_scene.values():
        chosen = [np.sort(bucket.variants[np.isin(bucket.variants, variants)]) for bucket in own]
        if sum(part.size for part in chosen):
            buckets += _finer_buckets(plan, own, chosen)
    study = plan.study.with_values({"envelope": {}}) if plan.study.envelope else plan.study
    return replace(plan, study=study, buckets=tuple(buckets), shown=np.zeros(0, dtype=np.int64))


def audit_seconds(plan: Plan) -> float:
    """Expected time of an `audit_plan` on one thread."""
    return plan.total_seconds(1) - START_SECONDS


def suggested_size(plan: Plan) -> int:
    """How many variants to audit: 1 % of them, 16 to 256, or half as many until that is expected to take no more than
    30 % of the run's time or 2 s; 0 where not even one is."""
    count = min(plan.size, int(np.clip(np.rint(PART * plan.size), FEWEST, MOST)))
    allowed = max(MOST_TIME * plan.total_seconds(1), FREE_SECONDS)
    while count and audit_seconds(audit_plan(plan, spread_quasi_randomly(plan.cases, count))) > allowed:
        count //= 2
    return count


def silent(model: SceneModel, sensors: Iterable[Sensor]) -> NDArray[np.bool_]:
    """(J,) sensors where no mode of their body says anything, such as the deflection at a support: what they read is
    rounding, and has no relative error."""
    return np.array(
        [type(sensor) is Sensor and sensor.under is None and _says_nothing(model, sensor) for sensor in sensors]
    )


def _says_nothing(model: SceneModel, sensor: Sensor) -> bool:
    places = np.linspace(0.0, model.bodies[sensor.body].modal.length, PLACES)
    here, *elsewhere = (
        max(float(np.abs(channel.rows).max()) for channel in replace(sensor, at=at).channels(model, ()))
        for at in (sensor.at, *map(float, places))
    )
    return here <= SILENT * max(elsewhere)


def _finer_buckets(plan: Plan, own: list[Bucket], chosen: list[Counts]) -> list[Bucket]:
    """Some variants of the buckets of one scene, with its finer model."""
    scene = own[0].scene
    model = build_model(in_full(scene), *scene.timing, plan.cases.paths)
    numbers = np.concatenate(chosen)
    used = np.concatenate([np.full(part.size, bucket.steps) for bucket, part in zip(own, chosen, strict=True)])
    least = LEAST_STEPS if scene.fidelity is Fidelity.STATIC else MORE_STEPS * used
    steps = np.maximum(least, _own(plan, model, numbers))
    check_most_steps(model, steps)
    order = np.argsort(-steps, kind="stable")
    parts = [order[first : first + LANES] for first in range(0, order.size, LANES)]
    return [
        Bucket(SceneTables(model, int(steps[part].max()), plan.window, refinement=MORE_STEPS), numbers[part], "audit")
        for part in parts
    ]


def _own(plan: Plan, model: SceneModel, numbers: Counts) -> Counts:
    """(n,) steps that the finer model would take by itself: they keep its many modes from ringing by their steps."""
    columns = {path: column for path, column in plan.cases.columns_of(numbers).items() if path != "solver.steps"}
    return steps_of(model, LaneValues(model.study, columns, numbers.size), allow_any_steps)[0]


def in_full(scene: SceneModel) -> Study:
    """The study of a scene with all terms, no envelopes, and twice the modes of every body in use."""
    changes: dict[str, Any] = {"solver.fidelity": "auto", "solver.steps": "auto", "solver.static_correction": True}
    for part in scene.bodies:
        found = _more_modes(scene.study.body[part.name])
        changes |= {f"body.{part.name}.{key}": value for key, value in found.items()}
    return scene.study.with_values(changes | ({"envelope": {}} if scene.study.envelope else {}))


def _more_modes(body: Body) -> dict[str, Any]:
    """Values that give a body twice its modes, or as many as it has; those beyond a list of damping ratios have its
    last one."""
    if isinstance(body, Rigid):
        return {}
    found: dict[str, Any] = {}
    asked = AUTO_MODES if body.modes == "auto" else int(body.modes)
    if isinstance(body, Reduced):
        whole = load_body(body.file).omega.size
        found["modes"] = "auto" if body.modes == "auto" else min(MORE_MODES * asked, whole)
    elif isinstance(body, Frame) and body.interface:
        fixed = min(MORE_MODES * body.fixed_interface_modes, MAX_FIXED_INTERFACE_MODES)
        found |= {"fixed_interface_modes": fixed} | ({} if body.modes == "auto" else {"modes": _capped(asked)})
    else:
        found["modes"] = _capped(asked)
    if isinstance(body.damping_ratio, tuple):
        ratios = list(body.damping_ratio)
        found["damping_ratio"] = ratios + ratios[-1:] * (MAX_MODES - len(ratios))
    return found


def _capped(asked: int) -> int:
    return min(MORE_MODES * asked, MAX_MODES)
