"""By how much variants of a motion to and fro vibrate more from cycle to cycle: Floquet multipliers of one cycle.

A mass that goes to and fro changes the inertia of its body in time, and so may shake it ever more (mechanics section
7.5). Without weights the state after a cycle is a matrix times the one before, whose spectral radius tells.
"""

from __future__ import annotations

import math

import numpy as np

from engine.bodies.modal.description import Body
from engine.kernels.schemes import SCHEMES
from engine.march.step_rules import least_steps
from engine.march.tables import SceneTables
from engine.methods.transition import spectral_radius, transitions
from engine.model.distinct_models import scenes
from engine.model.numerics import Numerics
from engine.model.scene_model import SceneModel, with_numerics
from engine.scene.study import Study
from engine.scene.sweep import expand
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts

#: Modes at most, least steps of a cycle, and least ones of a first period in it: of a map of a swinging mass with 2 %
#: damping they judge none of 280 cells otherwise than 24 modes and 6,400 steps.
MODES, STEPS, PER_PERIOD = 12, 1200, 40
#: Times the steps, with which what grows is marched again: undamped bodies seem to grow by 1.3 % in slow cycles of few.
AGAIN = 4
MOST_STEPS = 24_000  # of all cycles that are marched: motions of more periods than 600 a cycle shake nothing
GROWS = 1.0 + 1e-3


def growth_per_cycle(study: Study, variants: Counts) -> Array:
    """(variants,) the largest Floquet multipliers of some variants of a study, by their flat numbers; NaN where they
    are not known here: of anything but one mass that rides without springs by all its terms, of bodies out of files,
    and of cycles of very many steps."""
    found = np.full(variants.size, np.nan)
    if not variants.size or not _is_known(study):
        return found
    key = f"carriage.{study.clock}.motion.cycles"
    swept = {path for axis in study.sweep.axes.values() for path in axis.of}
    many = {f"body.{name}.modes": MODES for name, body in study.body.items() if _has_many(body)}
    own = study.with_values({name: value for name, value in ({key: 1} | many).items() if name not in swept})
    cases, order = expand(own), np.argsort(variants)
    for scene, some in scenes(own, cases, variants[order]):
        values = VariantValues.of(scene.study, cases, some)
        found[order[np.searchsorted(variants[order], some)]] = _of_scene(scene, values, int(scene.study.value(key)))
    return found


def _of_scene(scene: SceneModel, values: VariantValues, cycles: int) -> Array:
    """(V,) of variants that share a scene of so many cycles."""
    model = with_numerics(scene, Numerics("full", SCHEMES["average-acceleration"]({}), False, MODES))
    periods = values.scene_time_scale * model.first_omega / (2.0 * math.pi)
    steps = np.maximum(np.maximum(STEPS, PER_PERIOD * periods), least_steps(model, values))
    found = np.full(values.size, np.nan)
    few = np.flatnonzero(steps * cycles <= MOST_STEPS)
    for times in (1, AGAIN):
        if few.size:
            tables = SceneTables(model, times * math.ceil(steps[few].max()), "whole")
            again = spectral_radius(transitions(tables, values.part(few))) ** (1.0 / cycles)
            found[few] = np.fmin(found[few], again)
            few = few[again > GROWS]
    return found


def _has_many(body: Body) -> bool:
    return body.modes != "auto" and int(body.modes) > MODES


def _is_known(study: Study) -> bool:
    """One mass without springs that goes to and fro, on a body that is made here."""
    if len(study.carriage) != 1 or any(body.names_files for body in study.body.values()):
        return False
    if study.solver.fidelity not in ("auto", "full"):
        return False
    carriage = study.carriage[study.clock]
    alone = carriage.suspension is None and carriage.riding_body is None and not (carriage.pushes or carriage.pulsates)
    return alone and carriage.inertial and carriage.motion.period is not None
