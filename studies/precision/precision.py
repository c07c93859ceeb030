"""Error against cost: a scene marched by a scheme, compared with a reference, and timed in a batch.

Errors are of three quantities: "history", the largest difference over time of any sensor over the scene's largest
static value; "extremes", the difference of the largest values over the same; "contact_force", the largest difference
over time over the weight, on 0-98 % of the span.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from engine.batch.execution import seconds_of, seconds_of_jobs
from engine.kernels.layout import LANES, LARGEST, SMALLEST
from engine.kernels.schemes import SCHEMES
from engine.march.march import Marched, march, prepare
from engine.march.richardson import march_pair
from engine.march.tables import SceneTables
from engine.methods.comparison import COMPARISON, march_comparison, prepare_comparison
from engine.methods.ode import ModalEquations, Solution
from engine.model.scene_model import SceneModel, build_model
from engine.observation.histories import counts_shown
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.lazy_imports import interpolate
from results_schema.status import Status
from studies.precision.variables import QUANTITIES
from studies.protocol.parts import Work

RICHARDSON = "richardson"
_OWN: Mapping[str, Mapping[str, Any]] = {"hht-alpha": {"alpha": -0.05}, "generalized-alpha": {"rho_inf": 0.8}}

BATCH_WORK = 4e6  # modes x steps x variants of a timing: some milliseconds
STEP_MODES = 6  # what a step costs besides its modes, in modes
SMALLEST_BATCH, LARGEST_BATCH = 64, 4096
BEST_OF = 3
LONG = 0.03  # s: a timing that is not repeated
FINE_STATIONS = 1 << 14  # per unit of scene time, at which a reference's largest value is looked for


class Run(NamedTuple):
    """A march of one variant: readings (S, signals) at stations of its tables by their count, the largest magnitude of
    each sensor (J,) over all stations, and whether it left the finite numbers or every meaning."""

    tables: SceneTables
    counts: Counts
    readings: Array
    largest: Array
    diverged: bool


@dataclass(frozen=True, eq=False)
class Reference:
    """What runs are compared with: readings at stations of tables, and each sensor's largest magnitude (J,).

    scale (J,): largest static values of the sensors. weight: N.
    """

    read: Callable[[SceneTables, Counts], Array]
    largest: Array
    scale: Array
    weight: float
    _kept: dict[int, Array] = field(default_factory=dict)

    def readings(self, run: Run) -> Array:
        """(S, signals) at the stations of a run; runs of equal steps have equal stations."""
        if run.tables.steps not in self._kept:
            self._kept[run.tables.steps] = self.read(run.tables, run.counts)
        return self._kept[run.tables.steps]

    def errors(self, run: Run) -> Array:
        """(quantities,) errors of a run; NaN where it diverged."""
        if run.diverged:
            return np.full(len(QUANTITIES), np.nan)
        apart = np.nanmax(np.abs(run.readings - self.readings(run)), axis=0)
        extremes = np.abs(run.largest - self.largest) / self.scale
        return np.array([(apart[:-1] / self.scale).max(), extremes.max(), apart[-1] / self.weight])


def scene_model(study: Study, overrides: Mapping[str, Any], modes: int | None = None) -> SceneModel:
    """The model of a study with other values at dotted keys, and so many modes of its one body, without the static part
    of those that are left out. Raises BadInput."""
    changed = study.with_values(overrides) if overrides else study
    if modes is not None:
        changed = changed.with_values({f"body.{next(iter(changed.carriage.values())).on}.modes": modes})
    return with_correction(build_model(changed, {}, {}), False)


def with_scheme(model: SceneModel, scheme: str) -> SceneModel:
    """The same model marched by one of the schemes of the march, with the parameters that are compared here."""
    return replace(model, numerics=model.numerics._replace(scheme=SCHEMES[scheme](_OWN.get(scheme, {}))))


def with_correction(model: SceneModel, corrected: bool) -> SceneModel:
    """The same model with or without the static part of the modes that are left out."""
    return replace(model, numerics=model.numerics._replace(static_correction=corrected))


def tables_of(model: SceneModel, steps: int) -> SceneTables:
    """The tables of a scene, cut so that a Richardson pair can halve them."""
    return SceneTables(model, steps, "whole", refinement=2)


def run_scheme(tables: SceneTables, scheme: str, work: Work) -> Run:
    """March one variant by a scheme, or by a pair. tables: of a model with the scheme, where that is the march's."""
    work.check()
    counts = counts_shown(tables.timeline, "whole", "auto")
    values, sampled = VariantValues(tables.model.study, {}, LANES), len(tables.signals)
    with np.errstate(all="ignore"):
        if scheme == RICHARDSON:
            return _pair(tables, values, work)
        if scheme in COMPARISON:
            found: Marched = march_comparison(COMPARISON[scheme], tables, values, counts, 1, work.halted, sampled)
        else:
            found = march(tables, values, counts, 1, work.halted, sampled)
    return _run(tables, counts, found, found.history[:, :, 0])


def _pair(tables: SceneTables, values: VariantValues, work: Work) -> Run:
    """A Richardson pair: its extremes as the march makes them, its histories from both marches at the coarse stations,
    (4 fine - coarse)/3."""
    counts = counts_shown(tables.coarser.timeline, "whole", "auto")
    readings = _extrapolated(tables, values, counts, work)
    found, _ = march_pair(tables, values, counts[:0], 1, work.halted)
    return _run(tables.coarser, counts, found, readings)


def _extrapolated(tables: SceneTables, values: VariantValues, counts: Counts, work: Work) -> Array:
    """(S, signals) histories of the march and of one with half its steps at the stations of the latter."""
    sampled = len(tables.signals)
    fine = march(tables, values, 2 * counts, 1, work.halted, sampled).history[:, :, 0]
    rough = march(tables.coarser, values, counts, 1, work.halted, sampled).history[:, :, 0]
    return (4.0 * fine - rough) / 3.0


def _run(tables: SceneTables, counts: Counts, found: Marched, readings: Array) -> Run:
    marks = found.statistics[:, :, 0]
    largest = np.maximum(marks[:, LARGEST], -marks[:, SMALLEST])[: len(tables.sensors)]
    gone = bool(found.status[0] != Status.OK) or not np.isfinite(largest).all()
    return Run(tables, counts, readings, largest, gone)


def as_run(reference: Reference, model: SceneModel) -> Run:
    """What a reference reads, as if it were marched with 400 steps."""
    tables = SceneTables(model, 400, "whole")
    counts = counts_shown(tables.timeline, "whole", "auto")
    return Run(tables, counts, reference.read(tables, counts), reference.largest, False)


def static_scale(model: SceneModel) -> tuple[Array, float]:
    """Largest static value (J,) of every sensor under the weight, with the static correction; and the weight."""
    tables = SceneTables(with_correction(model, True), 400, "whole")
    weight = ModalEquations(model).weight
    return np.abs(tables.statics.over_window[:, :, 0]).max(axis=0) * weight, weight


def modal_reference(model: SceneModel, states: Solution) -> Reference:
    """A reference from a solution of the same modal equations."""
    equations = ModalEquations(model)

    def read(tables: SceneTables, counts: Counts) -> Array:
        _, tau = tables.timeline.moments(counts)
        return equations.readings(tables, counts, states(tau))

    fine = SceneTables(model, FINE_STATIONS, "whole")
    everywhere = read(fine, np.arange(fine.timeline.window[1] + 1))
    return Reference(read, refined_largest(everywhere[:, : len(fine.sensors)]), *static_scale(model))


def marched_reference(model: SceneModel, steps: int, work: Work) -> Reference:
    """A reference by Richardson's extrapolation of two marches of second order, with `steps` and half as many.

    They are marches of Fox-Goodwin, whose phases are the best, or where those would be near its limit of average
    acceleration.
    """
    swiftest = with_scheme(model, "fox-goodwin")
    near = model.omega.max() * ModalEquations(model).time_scale / (steps // 2) > SAFE * swiftest.scheme.stability_limit
    tables = tables_of(with_scheme(model, "average-acceleration") if near else swiftest, steps)
    counts = np.arange(tables.coarser.timeline.window[1] + 1)
    readings = _extrapolated(tables, VariantValues(model.study, {}, LANES), counts, work)
    _, along = tables.coarser.timeline.moments(counts)
    known = [np.isfinite(column) for column in readings.T]
    curves = [
        interpolate.CubicSpline(along[here], column[here], extrapolate=False)
        for column, here in zip(readings.T, known, strict=True)
    ]

    def read(tables: SceneTables, counts: Counts) -> Array:
        _, tau = tables.timeline.moments(counts)
        return np.stack([curve(tau) for curve in curves], axis=1)

    return Reference(read, refined_largest(readings[:, : len(tables.sensors)]), *static_scale(model))


SAFE = 0.9  # of the stability limit
REFERENCE_REFINED = 4  # times the finest step count has the reference
MODES_ORDER = 2  # power with which its error falls with the number of modes at least


def converged(
    study: Study, overrides: Mapping[str, Any], modes: int, steps: int, work: Work
) -> tuple[Reference, Array]:
    """A reference converged in modes and steps, and its own estimated errors (quantities,).

    steps: finest number to be compared. The estimate: the change from half as many modes over 2^2 - 1, plus the
    change from half as many steps.
    """
    found = []
    for count, refined in ((modes, 1), (modes // 2, 1), (modes, 2)):
        model = with_correction(scene_model(study, overrides, count), True)
        found.append(marched_reference(model, REFERENCE_REFINED * steps // refined, work))
    fewer, coarser = (as_run(reference, model) for reference in found[1:])
    parts = [found[0].errors(fewer) / (2**MODES_ORDER - 1), found[0].errors(coarser)]
    return found[0], np.sum(parts, axis=0)


def refined_largest(values: Array) -> Array:
    """(J,) largest magnitudes of histories (S, J), between stations by a parabola.

    >>> float(refined_largest(np.cos(np.linspace(-1.0, 2.0, 1000))[:, None])[0].round(9))
    1.0
    """
    found = []
    for column in np.abs(values).T:
        top = int(np.argmax(column))
        if not 0 < top < column.size - 1:
            found.append(column[top])
            continue
        before, here, after = column[top - 1 : top + 2]
        bend = before - 2.0 * here + after
        found.append(here - (after - before) ** 2 / (8.0 * bend) if bend < 0.0 else here)
    return np.array(found)


def seconds_per_variant(tables: SceneTables, scheme: str, work: Work) -> float:
    """Wall time of a variant in a batch on all threads: the best of a few, the tables of the scene left out.

    tables: of a run by this scheme, which has filled them.
    """
    modes, threads = tables.model.omega.size, work.threads
    size = min(max(BATCH_WORK / ((modes + STEP_MODES) * tables.timeline.steps), SMALLEST_BATCH), LARGEST_BATCH)
    part = LANES * max(1, round(size / (threads * LANES)))
    best = np.inf
    for _ in range(BEST_OF):
        work.check()
        with np.errstate(all="ignore"):
            seconds = _seconds(tables, scheme, part, threads)
        best = min(best, seconds / (part * threads))
        if seconds > LONG:
            break
    return float(best)


def _seconds(tables: SceneTables, scheme: str, size: int, threads: int) -> float:
    """Wall time of so many variants on every thread."""
    values, nothing = VariantValues(tables.model.study, {}, size), np.zeros(0, dtype=np.int64)
    if scheme == RICHARDSON:
        return seconds_of_jobs([partial(march_pair, tables, values, nothing, size)] * threads, threads)
    known = COMPARISON.get(scheme)
    ready = partial(prepare, tables) if known is None else partial(prepare_comparison, known, tables)
    return seconds_of([ready(values, nothing) for _ in range(threads)], threads)
