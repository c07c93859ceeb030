"""The ladder of models, cheapest first: what each costs and what error it leaves, told before anything is marched.

Per variant, from the lowest modes, their size at the track, mass, speed, damping and the springs of contacts
(`neglect`); errors are those of the worst sensor, as parts of its largest static value, over the whole motion. For
displacement on a pinned beam, alpha = v/v_critical and mu = m/(rho A L), they are about (mechanics section 8)

    static                     alpha/(1 - alpha) + pi^2 mu alpha^2/3
    force                      2 alpha sin(min(pi/2, pi mu/(4 alpha))) + pi^2 mu alpha^2/3
    mass-without-convective    alpha (sqrt(1 + 2 mu) - 1) + pi^2 mu alpha^2/3
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.carriages import BodyCarriage, OscillatorCarriage
from engine.fidelity import needed_steps, round_up
from engine.lanes import LaneValues
from engine.model import SceneModel
from engine.moving_load import Load, noticed
from engine.neglect import left_out
from engine.resonance import spring_steps
from engine.route import MODES, Route, routes
from engine.ties import Inertia
from results_schema.status import Fidelity

Array = NDArray[np.float64]

_INERTIA: dict[Fidelity, Inertia] = {  # of the models below a tied carriage, cheapest first
    Fidelity.STATIC: "force",
    Fidelity.FORCE: "force",
    Fidelity.MASS_WITHOUT_CONVECTIVE: "mass-without-convective",
    Fidelity.MASS: "mass",
}


class Rung(NamedTuple):
    """A model of some variants: its cost in modes x steps over one passage or cycle (V,), and the error that it leaves
    (V,), as a part of the largest static value of the worst sensor; NaN where nobody can tell (`model_errors`)."""

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


def model_errors(model: SceneModel, values: LaneValues, most: int = MODES) -> dict[Fidelity, Array]:
    """Estimated error (V,) of every model below the carriages' own, of the worst of all sensors.

    most: how many of the lowest modes are looked at. Without sensors on a body, of the displacement under its loads.
    NaN where nobody can tell: nothing weighs anything, a carriage rides on what rides itself, or a sensor has no static
    value to compare with (velocity, acceleration, contact forces, what is read aboard a carriage).
    """
    return errors_along(model, routes(model, most), values)


def errors_along(model: SceneModel, along: tuple[Route, ...] | None, values: LaneValues) -> dict[Fidelity, Array]:
    """`model_errors` for one of many parts of the variants of a scene, whose `route.routes` are known."""
    rungs = [rung for rung in _INERTIA if rung < full_fidelity(model)]
    if along is None:
        return {rung: np.full(values.size, np.nan) for rung in rungs}
    found: dict[Fidelity, list[Array]] = {rung: [] for rung in rungs}
    for body in {route.tie.body for route in along}:
        loads = [Load(route, values) for route in along if route.tie.body == body]
        left = [left_out(load) for load in loads]
        for rung in rungs:
            found[rung].append(of_largest([(load, errors[rung]) for load, errors in zip(loads, left, strict=True)]))
    return {rung: np.max(on_bodies, axis=0) for rung, on_bodies in found.items()}


def of_largest(parts: Sequence[tuple[Load, Array]]) -> Array:
    """(V,) errors (J, V) by all loads on a body together, of its worst sensor, as parts of what it reads."""
    error = np.sum([errors for _, errors in parts], axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.max(error / noticed([load for load, _ in parts]), axis=0))


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
