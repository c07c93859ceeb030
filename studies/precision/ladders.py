"""The measurements of a work-precision study: one scene over schemes, steps, modes, SciPy's solvers, and the program's
own choice."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from engine.batch.executors import Shared, Threads
from engine.batch.plan import make_plan
from engine.march.tables import SceneTables
from engine.methods.ode import ModalEquations
from engine.scene.axes import sobol_points
from engine.scene.study import Study
from studies.precision import jax_march, precision
from studies.precision.variables import MARCHED, QUANTITIES
from studies.protocol.parts import Work

if TYPE_CHECKING:
    from studies.kinds.work_precision import Question

SOLVERS = {"DOP853": (1e-2, 1e-4, 1e-6, 1e-8, 1e-10), "Radau": (1e-2, 1e-4, 1e-6, 1e-8)}
REFERENCE_TOLERANCES = (1e-12, 1e-10)
AROUND, FACTOR = 2048, 2.0  # variants of the sweep around a scene: many more than pilots; from 1/2 to 2 of its values


def steps(study: Study, overrides: Mapping[str, Any], asked: Question, work: Work) -> xr.Dataset:
    """Every scheme over the ladder of steps, at the study's own number of modes."""
    model = precision.scene_model(study, overrides)
    solutions = [ModalEquations(model).solve("DOP853", tol, work.halted) for tol in REFERENCE_TOLERANCES]
    reference, other = (precision.modal_reference(model, states) for states in solutions)
    shape = (len(asked.schemes), len(asked.step_counts))
    errors, seconds = np.full((*shape, len(QUANTITIES)), np.nan), np.full(shape, np.nan)
    marched = {s: precision.with_scheme(model, s) if s in MARCHED else model for s in asked.schemes}
    for n, count in enumerate(asked.step_counts):
        for i, scheme in enumerate(asked.schemes):
            tables = precision.tables_of(marched[scheme], count)
            found = precision.run_scheme(tables, scheme, work)
            errors[i, n] = reference.errors(found)
            if not found.diverged:
                seconds[i, n] = precision.seconds_per_variant(tables, scheme, work)
    apart = reference.errors(precision.as_run(other, model))
    return xr.Dataset(
        {
            "error": (("scheme", "step_count", "quantity"), errors),
            "seconds": (("scheme", "step_count"), seconds),
            "reference_error": ("quantity", apart),
            "modes": model.omega.size,
            "threads": work.threads,
        }
    )


def solvers(study: Study, overrides: Mapping[str, Any], work: Work) -> xr.Dataset:
    """SciPy's solvers on the same equations, one variant."""
    model = precision.scene_model(study, overrides)
    equations = ModalEquations(model)
    reference = precision.modal_reference(model, equations.solve("DOP853", REFERENCE_TOLERANCES[0], work.halted))
    errors, seconds = [], []
    for method, tolerances in SOLVERS.items():
        for tolerance in tolerances:
            start = time.perf_counter()
            states = equations.solve(method, tolerance, work.halted)
            seconds.append(time.perf_counter() - start)
            errors.append(reference.errors(precision.as_run(precision.modal_reference(model, states), model)))
    return xr.Dataset({"error": (("solver", "quantity"), np.array(errors)), "seconds": ("solver", seconds)})


def by_jax(study: Study, overrides: Mapping[str, Any], asked: Question, work: Work) -> xr.Dataset:
    """Average acceleration by jax.vmap over the steps that fit one table: error of histories, seconds per variant."""
    model = precision.with_scheme(precision.scene_model(study, overrides), "average-acceleration")
    reference = precision.modal_reference(
        model, ModalEquations(model).solve("DOP853", REFERENCE_TOLERANCES[0], work.halted)
    )
    shape = len(asked.step_counts)
    errors, seconds = np.full(shape, np.nan), np.full(shape, np.nan)
    for n, count in enumerate(asked.step_counts):
        work.check()
        if count <= jax_march.MOST_STEPS:
            tables = precision.tables_of(model, count)
            found, seconds[n] = jax_march.march(tables)
            sensors = found.shape[1]
            exact = reference.read(tables, np.arange(1, found.shape[0] + 1))[:, :sensors]
            errors[n] = (np.abs(found - exact).max(axis=0) / reference.scale).max()
    return xr.Dataset({"error": ("step_count", errors), "seconds": ("step_count", seconds)})


def modes(study: Study, overrides: Mapping[str, Any], asked: Question, work: Work) -> xr.Dataset:
    """The schemes of the march over steps and modes, with and without static correction, against what is converged."""
    schemes = [scheme for scheme in asked.schemes if scheme in MARCHED]
    reference, apart = precision.converged(study, overrides, asked.reference_modes, asked.step_counts[-1], work)
    shape = (len(asked.mode_counts), 2, len(schemes), len(asked.step_counts))
    errors = np.full((*shape, len(QUANTITIES)), np.nan)
    seconds = np.full((shape[0], *shape[2:]), np.nan)
    for m, number in enumerate(asked.mode_counts):
        bare = precision.scene_model(study, overrides, number)
        models = [
            [precision.with_correction(precision.with_scheme(bare, s), c) for c in (False, True)] for s in schemes
        ]
        for n, count in enumerate(asked.step_counts):
            for i, c in np.ndindex(len(schemes), 2):
                tables = precision.tables_of(models[i][c], count)
                found = precision.run_scheme(tables, schemes[i], work)
                errors[m, c, i, n] = reference.errors(found)
                if c and not found.diverged:
                    seconds[m, i, n] = precision.seconds_per_variant(tables, schemes[i], work)
    dims = ("mode_count", "correction", "scheme", "step_count", "quantity")
    return xr.Dataset(
        {
            "error": (dims, errors),
            "seconds": (("mode_count", "scheme", "step_count"), seconds),
            "reference_error": ("quantity", apart),
        }
    )


def automatic(study: Study, overrides: Mapping[str, Any], asked: Question, tolerance: float, work: Work) -> xr.Dataset:
    """What the program chooses for a scene by itself in a sweep around it: error of histories against what is
    converged, seconds per variant."""
    tables = chosen_tables(around(study.with_values(overrides), tolerance), work)
    scheme = tables.model.scheme.name
    reference, _ = precision.converged(study, overrides, asked.reference_modes, asked.step_counts[-1], work)
    error = reference.errors(precision.run_scheme(tables, scheme, work))[list(QUANTITIES).index("history")]
    seconds = precision.seconds_per_variant(tables, scheme, work)
    return xr.Dataset(
        {"error": error, "seconds_per_variant": seconds, "modes": tables.model.body_modes, "steps": tables.steps}
    )


def leaves_modes_open(study: Study) -> bool:
    """Whether the program may choose the number of modes of the body."""
    name = f"body.{next(iter(study.carriage.values())).on}"
    return study.with_values({f"{name}.modes": "auto"}).body[name.partition(".")[2]].modes_are_open


def around(study: Study, tolerance: float) -> Study:
    """A sweep around a scene with everything left open: its own variant first, then others with a sample of masses,
    speeds and damping ratios."""
    name, carriage = next(iter(study.carriage.items()))
    keys = (
        *(f"carriage.{name}.{key}" for key in ("mass", "motion.speed", "motion.frequency")),
        f"body.{carriage.on}.damping_ratio",
    )
    own = {key: value for key, value in study.numbers().items() if key in keys and value > 0.0}
    points = 2.0 * sobol_points(AROUND, len(own)) - 1.0
    points[0] = 0.0
    axes = {
        f"around_{number}": {"of": key, "values": (value * FACTOR ** points[:, number]).tolist()}
        for number, (key, value) in enumerate(own.items())
    }
    everything = {f"body.{carriage.on}.modes": "auto", "solver.tolerance": tolerance, "output.histories": "auto"}
    return study.with_values(everything | {"sweep": {"zip": True} | axes})


def chosen_tables(study: Study, work: Work) -> SceneTables:
    """The tables of the march that is chosen for the first variant of a study of many. Raises Halted."""
    plan = make_plan(study)
    plan.choose(Shared(Threads(work.threads), work.halted))
    return next(group.tables for group in plan.groups if 0 in group.variants)
