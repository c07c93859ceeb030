"""The ladder of models, cheapest first: what each costs and what error it leaves, told before anything is marched.

Per variant, from the lowest modes, their size at the track, mass, speed, damping and the springs of contacts
(`neglect`); errors are of displacement, as parts of the largest static value, over the whole motion. For a pinned
beam, alpha = v/v_critical and mu = m/(rho A L), they are about (mechanics section 8)

    static                     alpha/(1 - alpha) + pi^2 mu alpha^2/3
    force                      2 alpha sin(min(pi/2, pi mu/(4 alpha))) + pi^2 mu alpha^2/3
    mass-without-convective    alpha (sqrt(1 + 2 mu) - 1) + pi^2 mu alpha^2/3
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.carriages import BodyCarriage, OscillatorCarriage
from engine.fidelity import needed_steps, round_up
from engine.lanes import LaneValues
from engine.model import SceneModel
from engine.moving_load import Load
from engine.neglect import left_out
from engine.resonance import spring_steps
from engine.ties import Inertia
from results_schema.status import Fidelity

Array = NDArray[np.float64]

STILL = 1e-6  # of the largest static value: places that move less, such as supports, say nothing

_INERTIA: dict[Fidelity, Inertia] = {  # of the models below a tied carriage, cheapest first
    Fidelity.STATIC: "force",
    Fidelity.FORCE: "force",
    Fidelity.MASS_WITHOUT_CONVECTIVE: "mass-without-convective",
    Fidelity.MASS: "mass",
}


class Rung(NamedTuple):
    """A model of some variants: its cost in modes x steps over one passage or cycle (V,), and the error that it leaves
    (V,), as a part of the largest static displacement; NaN where nobody can tell: nothing weighs anything, or a
    carriage rides on what rides itself."""

    fidelity: Fidelity
    cost: Array
    error: Array


def full_fidelity(model: SceneModel) -> Fidelity:
    """The model that its carriages' own kinds ask for."""
    kinds = [model.study.carriage[carriage.name] for carriage in model.carriages]
    if any(isinstance(kind, OscillatorCarriage | BodyCarriage) for kind in kinds):
        return Fidelity.TIED
    return Fidelity.MASS if any(kind.inertial for kind in kinds) else Fidelity.FORCE


def ladder(model: SceneModel, values: LaneValues) -> tuple[Rung, ...]:
    """All models of a scene up to its carriages' own, which leaves no error."""
    errors = model_errors(model, values) | {full_fidelity(model): np.zeros(values.size)}
    return tuple(Rung(rung, _cost(model, values, rung), error) for rung, error in errors.items())


def model_errors(model: SceneModel, values: LaneValues) -> dict[Fidelity, Array]:
    """Estimated error (V,) of every model below the carriages' own, the worst of all displacements that are read."""
    rungs = [rung for rung in _INERTIA if rung < full_fidelity(model)]
    riding = {carriage.rides for carriage in model.carriages}
    if any(carriage.body in riding for carriage in model.carriages):  # what it rides is not held by itself
        return {rung: np.full(values.size, np.nan) for rung in rungs}
    loads = [(n, *load) for n, carriage in enumerate(model.carriages) for load in carriage.loads]
    follows = len(loads) > 1 or any(getattr(c.rider.motion, "after", 0.0) > 0.0 for c in model.carriages)
    parts: dict[int, list[tuple[Load, dict[Fidelity, Array]]]] = {}
    for number, rider, share in loads:
        body = model.carriages[number].body
        load = Load(model, values, number, rider, share, _places(model, body), follows)
        parts.setdefault(body, []).append((load, left_out(load)))
    return {rung: np.max([_relative(on_body, rung) for on_body in parts.values()], axis=0) for rung in rungs}


def _relative(loads: list[tuple[Load, dict[Fidelity, Array]]], rung: Fidelity) -> Array:
    """(V,) what a model leaves out of all loads on a body, over the largest static value of any."""
    error = np.sum([errors[rung] for _, errors in loads], axis=0)
    scale = np.max([load.scale for load, _ in loads], axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(scale >= STILL * scale.max(axis=0), error / scale, 0.0)
    return np.asarray(np.max(part, axis=0))


def _places(model: SceneModel, body: int) -> tuple[float | None, ...]:
    """Where displacement is read on a body: places of its track, m; else None, under the loads."""
    sensors, name = model.study.sensor.values(), model.bodies[body].name
    read = {s.at for s in sensors if s.quantity == "displacement" and s.body == name and s.at is not None}
    return tuple(sorted(read)) or (None,)


def _cost(model: SceneModel, values: LaneValues, rung: Fidelity) -> Array:
    """(V,) modes x steps over one passage or cycle; statics march nothing."""
    if rung is Fidelity.STATIC:
        return np.zeros(values.size)
    if model.study.solver.steps != "auto" or "solver.steps" in values.columns:
        return np.asarray(model.body_modes * values.of("solver.steps"))
    carriages = tuple(replace(c, inertia=_INERTIA.get(rung, c.inertia)) for c in model.carriages)
    distinct, inverse = np.unique(values.time_scale(model.carriages[0].name), return_inverse=True)
    steps = needed_steps(replace(model, carriages=carriages), distinct).total[inverse]
    if rung is Fidelity.TIED:
        steps = np.max([steps, *spring_steps(model, values).values()], axis=0)
    return np.asarray(model.body_modes * round_up(steps), dtype=np.float64)
