"""By how much variants of a motion to and fro vibrate more from cycle to cycle: Floquet multipliers of one cycle.

A mass that goes to and fro changes the inertia of its body in time, and so may shake it ever more (mechanics section
7.5). Without weights the state after a cycle is a matrix times the one before, whose spectral radius tells.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels.schemes import SCHEMES
from engine.march.step_rules import least_steps
from engine.march.tables import SceneTables
from engine.methods.transition import spectral_radius, transitions
from engine.model.distinct_models import scenes
from engine.model.numerics import Numerics
from engine.model.scene_model import with_numerics
from engine.scene.study import Study
from engine.scene.sweep import expand
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts

#: Modes of bodies that leave them open, and least steps of a cycle: of a map of a swinging mass with 2 % damping they
#: judge none of 280 cells otherwise than 24 modes and 6,400 steps.
MODES, STEPS = 12, 1200
MOST_STEPS = 24_000  # of all cycles that are marched: a slower motion shakes nothing, and 64 of these take a second
GROWS = 1.0 + 1e-3  # rounding and steps make less of what does not grow


def growth_per_cycle(study: Study, variants: Counts) -> Array:
    """(variants,) the largest Floquet multipliers of some variants of a study, by their flat numbers; NaN where they
    are not known here: of several carriages, of forces, of bodies out of files, and of cycles of very many steps."""
    found = np.full(variants.size, np.nan)
    if not variants.size or not _is_known(study):
        return found
    key = f"carriage.{study.clock}.motion.cycles"
    swept = {path for axis in study.sweep.axes.values() for path in axis.of}
    own = study if key in swept else study.with_values({key: 1})
    cases, numerics = expand(own), Numerics("full", SCHEMES["average-acceleration"]({}), False, MODES)
    for scene, some in scenes(own, cases, np.sort(variants)):
        model = with_numerics(scene, numerics)
        values = VariantValues.of(model.study, cases, some)
        cycles = int(model.study.value(key))
        steps = np.maximum(STEPS, least_steps(model, values))
        few = np.flatnonzero(steps * cycles <= MOST_STEPS)
        if few.size:
            tables = SceneTables(model, math.ceil(steps[few].max()), "whole")
            radius = spectral_radius(transitions(tables, values.part(few))) ** (1.0 / cycles)
            here = np.isin(variants, some[few])
            found[here] = radius[np.searchsorted(some[few], variants[here])]
    return found


def _is_known(study: Study) -> bool:
    """One mass without springs that goes to and fro, on a body that is made here."""
    if len(study.carriage) != 1 or any(body.names_files for body in study.body.values()):
        return False
    carriage = study.carriage[study.clock]
    alone = carriage.suspension is None and carriage.riding_body is None and not (carriage.pushes or carriage.pulsates)
    return alone and carriage.inertial and carriage.motion.period is not None
