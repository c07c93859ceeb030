"""The variants of one scene, grouped by what was chosen for them: model, modes, scheme and step count."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from engine.bodies.body import MAX_MODES
from engine.bucket import Bucket
from engine.checking import can_be_halved
from engine.choice import Asked, Choice, automatic_bodies, fixed_steps, with_choice
from engine.choosing import choose
from engine.fidelity import Needs, check_even_steps, check_most_steps, needed_steps, round_up
from engine.kernels.schemes import USUAL_SCHEME
from engine.lanes import LaneValues
from engine.model import SceneModel, simplified
from engine.resolution import steps_to_resolve
from engine.resonance import spring_steps
from engine.scenes import split
from engine.settings import PARAMETERS
from engine.sweep import Cases
from engine.tables import SceneTables
from results_schema.errors import BadInput
from results_schema.status import Fidelity, SchemeUsed

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
CheckSteps = Callable[[SceneModel, LaneValues, Counts], None]
Reasons = Callable[[Counts], str]

STATIC_STEPS = 800  # stations of statics over one passage or cycle
FULL_MODES = 20  # of the full model that costs are compared with


def buckets_of(
    scene: SceneModel, cases: Cases, variants: Counts, asked: Asked, check_steps: CheckSteps
) -> Iterator[Bucket]:
    """Variants of one scene by their model, modes and step counts."""
    columns = cases.columns_of(variants)
    told = choose(scene, LaneValues(scene.study, columns, variants.size), asked)
    full_cost = _full_cost(scene, LaneValues(scene.study, columns, variants.size))
    chosen = automatic_bodies(scene)
    kinds = (told.fidelity * (MAX_MODES + 1) + told.modes) * len(SchemeUsed) + told.scheme
    for own in split(np.arange(variants.size), kinds.astype(np.int64)):
        fidelity, modes, scheme = (int(column[own[0]]) for column in (told.fidelity, told.modes, told.scheme))
        model = with_choice(scene, Fidelity(fidelity), modes, SchemeUsed(scheme))
        values = LaneValues(model.study, cases.columns_of(variants[own]), own.size)
        steps, reasons = _chosen_steps(model, values, told.of(own), check_steps)
        pace = values.time_scale(scene.carriages[0].name)  # of like pace they rise and fall together: fewer extremes
        fixed = fixed_steps(model.study, values)
        alone = fixed and model.scheme.stride == 1  # a Richardson pair tells its steps itself
        halved = can_be_halved(model, values, steps) if alone else np.ones(own.size, dtype=np.bool_)
        for part in split(np.arange(own.size), 2 * steps + halved):
            lanes = own[part[np.argsort(pace[part], kind="stable")]]
            stride = model.scheme.stride if fixed else max(2, model.scheme.stride)  # all segments can be halved
            stops: Literal["events", "kinks"] = "events" if fixed or model.scheme.stride > 1 else "kinks"
            tables = SceneTables(model, int(steps[part[0]]), asked.window, refinement=stride, stops=stops)
            _check_readings(model, tables)
            even = all(segment.steps % 2 == 0 for segment in tables.timeline.segments)
            compared: Literal["half", "twice"] = "half" if halved[part[0]] and even else "twice"
            yield Bucket(tables, variants[lanes], reasons(part), told.of(lanes), full_cost[lanes], chosen, compared)


def steps_of(scene: SceneModel, values: LaneValues, check_steps: CheckSteps) -> tuple[Counts, Reasons]:
    """Steps of every variant over a passage or cycle where the tolerance does not choose them, and what says why some
    of them need so many: the study, or rules of thumb. Raises BadInput."""
    if scene.fidelity is Fidelity.STATIC:
        return np.full(values.size, STATIC_STEPS, dtype=np.int64), lambda part: "statics: nothing is marched"
    if fixed_steps(scene.study, values):
        steps = values.of("solver.steps").astype(np.int64)
        check_even_steps(scene, steps)
        check_most_steps(scene, steps)
        check_steps(scene, values, steps)
        return steps, lambda part: "as the study says"
    found = _needs(scene, values)
    check_most_steps(scene, found.total)
    return round_up(found.total), lambda part: _reason(found, part)


def _needs(scene: SceneModel, values: LaneValues) -> Needs:
    """Steps that rules of thumb ask for."""
    distinct, inverse = np.unique(values.time_scale(scene.carriages[0].name), return_inverse=True)
    needs, own = needed_steps(scene, distinct).per_rule, spring_steps(scene, values)
    if scene.scheme.stride > 1:
        own |= {"every mode of a Richardson pair resolved": steps_to_resolve(scene, values)}
    return Needs({name: needed[inverse] for name, needed in needs.items()} | own)


def _chosen_steps(
    scene: SceneModel, values: LaneValues, told: Choice, check_steps: CheckSteps
) -> tuple[Counts, Reasons]:
    """Steps of every variant, chosen by its tolerance where the study leaves them open."""
    if scene.fidelity is Fidelity.STATIC or scene.scheme.stride > 1 or fixed_steps(scene.study, values):
        return steps_of(scene, values, check_steps)
    check_most_steps(scene, told.steps)
    return told.steps.astype(np.int64), lambda part: "rules for any march" if told.ruled[part].any() else "tolerance"


def _full_cost(scene: SceneModel, values: LaneValues) -> Array:
    """(V,) modes x steps of the carriages' own model with many modes, by the usual scheme with the steps that all its
    rules ask for."""
    changes: dict[str, Any] = {f"body.{name}.modes": FULL_MODES for name in automatic_bodies(scene)}
    if scene.study.solver.scheme not in PARAMETERS:  # whose keys no other scheme has
        changes["solver.scheme"] = USUAL_SCHEME
    full = simplified(scene, changes | {"solver.fidelity": "full", "solver.steps": "auto"})
    columns = {path: column for path, column in values.columns.items() if path != "solver.steps"}
    needs = _needs(full, LaneValues(full.study, columns, values.size))
    if scene.fidelity is not Fidelity.STATIC and not fixed_steps(scene.study, values):
        check_most_steps(full, needs.total)
    return np.asarray(full.body_modes * round_up(needs.total), dtype=np.float64)


def _check_static(scene: SceneModel, tables: SceneTables) -> None:
    for sensor in tables.sensors:
        if sensor.offset_order:
            raise BadInput(
                f'fidelity = "static" has no {sensor.quantity}',
                where=scene.study.source.where(f"sensor.{sensor.name}.quantity"),
                expected="a quantity that statics tell, such as displacement",
            )


def _check_readings(scene: SceneModel, tables: SceneTables) -> None:
    """Refuse a sensor under a carriage that is never on its body while anything is recorded, and rates of what is at
    rest. Raises BadInput."""
    if scene.fidelity is Fidelity.STATIC:
        _check_static(scene, tables)
    for sensor in tables.sensors:
        seen = [s for s in tables.timeline.segments if s.recorded and (sensor.under is None or s.active[sensor.under])]
        if not seen:
            raise BadInput(
                "the carriage is off its body for all of the recorded part, so the sensor reads nothing",
                where=scene.study.source.where(f"sensor.{sensor.name}.under"),
                expected="a carriage on its body",
            )


def _reason(needs: Needs, lanes: Counts) -> str:
    """The rule that decides for the most demanding of some variants."""
    worst = lanes[np.argmax(needs.total[lanes])]
    return list(needs.per_rule)[int(needs.deciding[worst])]
