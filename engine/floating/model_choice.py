"""Which model a scene with frames that move is marched by: where nothing but modes and springs of carriages is left to
move by itself, one whose steps are linear equations, if pilots find that it agrees with the floating frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from engine.floating.converge import levels, stations, weights, worst
from engine.floating.march import march
from engine.floating.results import differences, outcome, results_of
from engine.kernels.layout import LANES
from engine.scene.frames import GROUND
from results_schema.arrays import Array
from results_schema.status import Fidelity

if TYPE_CHECKING:
    from engine.floating.model import FloatingModel
    from engine.scene.study import Study
    from engine.scene.variants import VariantValues

PILOTS = LANES  # of a scene: a block of lanes takes as long, however few of them are used
PART = 0.1  # of a tolerance that the cheaper model may take; the rest is for modes and steps


@dataclass(frozen=True, eq=False)
class Rung:
    """The model of a scene's variants, and what it leaves out: (R,) largest difference of every result among pilots."""

    fidelity: Fidelity
    left_out: Array


def choose(study: Study, pilots: VariantValues, duration: Array, longest: float) -> Rung:
    """The model of a scene, by some of its variants that take a duration (P,) s, marched on the coarsest level by
    both; longest: of all variants (s)."""
    level = next(iter(levels(study, longest)))
    model, results = level.model, results_of(level.model)
    full = Rung(Fidelity.FRAME, np.zeros(len(results)))
    if study.solver.fidelity == "full" or not is_given(model, pilots):
        return full
    cheap, dear = (
        outcome(model, march(model, pilots, duration, level.steps, stations(level), weights(level.scheme), fidelity))
        for fidelity in (Fidelity.GIVEN_FRAME, Fidelity.FRAME)
    )
    apart = differences(model, cheap, dear)
    known = ~np.isnan(apart).any(axis=0)  # what the floating frame itself has no values of tells nothing
    if not known.any() or (worst(apart, results, pilots)[known] > PART).any():
        return full
    return Rung(Fidelity.GIVEN_FRAME, apart[:, known].max(axis=1))


def is_given(model: FloatingModel, values: VariantValues) -> bool:
    """Whether all frames and places of carriages are given in time: joints are driven, what bodies hang on does not
    bend, no carriage turns with its track, and no springs are between places."""
    hang_on = [model.frame(name).on for name in model.bodies]
    bends = any(on != GROUND and model.bodies[on].omega.size for on in hang_on)
    free = any(joint.coordinate >= 0 for joint in model.joints) or bool(model.places or model.links)
    return not (bends or free or any(_turns(model, values, name) for name in model.study.carriage))


def _turns(model: FloatingModel, values: VariantValues, name: str) -> bool:
    """Whether it matters in some variant how a carriage is turned."""
    if model.study.carriage[name].suspension is not None:
        return False
    keys = [f"carriage.{name}.height", *(f"carriage.{name}.inertia.{axis}" for axis in range(3))]
    has_inertia = model.study.value(f"carriage.{name}.inertia") is not None
    return has_inertia or any(key in values.columns for key in keys) or bool(model.study.value(keys[0]))
