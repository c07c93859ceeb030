"""Marches with more and more steps, by the modes that pilots found enough, until what they report stays as it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.accuracy.reference import left_over
from engine.floating.march import march
from engine.floating.model import build
from engine.floating.results import Outcome, Result, differences, outcome, results_of
from engine.floating.schemes import USUAL, scheme_of, weights_of
from engine.floating.settling import tell_times
from engine.march.halting import stop_if_asked
from results_schema.arrays import Array, Counts
from results_schema.gravest_status import gravest, lost
from results_schema.status import Fidelity, Status

if TYPE_CHECKING:
    from engine.floating.model import FloatingModel
    from engine.floating.model_choice import Rung
    from engine.kernels.schemes import AlphaScheme, NewmarkScheme
    from engine.scene.study import Study
    from engine.scene.variants import VariantValues

#: Steps per first elastic period of the coarsest level, which double. A sliding mass at 1e-3 ends at the third.
FIRST_STEPS, MOST_STEPS = 25, 4_000_000
LEVELS = 12
MORE_MODES = 2  # times as many, of what an answer is compared with
HOPELESS = 32  # times the coarsest steps, at which a march that fails is given up
STATIONS = 800  # at which histories are compared and kept
#: Of its limit: joints and masses shift the frequencies of bodies; where too far, measured errors show it.
FAR_WITHIN = 0.8
ENOUGH = 0.5  # of the tolerance by which an answer may be told to be off, as in a march of bodies that stand
#: Of the largest of a signal: a coarser march that is further off tells nothing but that it failed, as Fox-Goodwin's
#: beyond its limit, which joints and masses that shift frequencies bring nearer.
UNLIKE = 2.0


@dataclass(frozen=True, eq=False)
class Level:
    """A model, and steps over the whole time by a scheme; every: steps between stations, which are at the same times on
    every level."""

    model: FloatingModel
    steps: int
    every: int
    scheme: NewmarkScheme | AlphaScheme

    @property
    def stations(self) -> Counts:
        """(S,) stations at the same times on every level."""
        return np.arange(0, self.steps + 1, self.every, dtype=np.int64)

    def march(self, values: VariantValues, duration: Array, fidelity: Fidelity = Fidelity.FRAME) -> Outcome:
        """What variants report that take a duration (V,) s."""
        how = self.steps, self.stations, weights_of(self.scheme), fidelity
        return outcome(self.model, march(self.model, values, duration, *how))


@dataclass(frozen=True, eq=False)
class Converged:
    """What V variants report: error (R, V) of every result, NaN where no estimate exists; modes, steps (V,) that each
    took, all by one scheme and one model; status (V,): that of the march, or whether what is held has no estimate or
    misses its tolerance."""

    outcome: Outcome
    error: Array
    modes: Counts
    steps: Counts
    scheme: NewmarkScheme | AlphaScheme
    fidelity: Fidelity
    status: NDArray[np.int8]


def levels(study: Study, duration: float, modes: int) -> Iterator[Level]:
    """Coarse to fine, for a time (s) that the longest of the variants takes; modes: of bending, where these are
    open."""
    fixed, model = study.solver.steps, build(study, modes)
    coarsest, factor = int(fixed) if fixed != "auto" else usual_steps(model, duration), 1
    scheme = scheme_of(study)
    every = int(np.ceil(coarsest / STATIONS))
    if fixed == "auto" and scheme is not USUAL:
        while coarsest * factor * FAR_WITHIN * scheme.stability_limit < duration * model.highest_omega:
            factor *= 2
    for _ in range(LEVELS):
        if coarsest * factor > MOST_STEPS:
            return
        yield Level(model, coarsest * factor, every * factor, scheme)
        factor *= 2


def usual_steps(model: FloatingModel, duration: float) -> int:
    """Of the coarsest level, a multiple of the stations."""
    least = duration * model.first_omega / (2.0 * np.pi) * FIRST_STEPS
    return STATIONS * max(1, int(np.ceil(least / STATIONS)))


def converge(
    study: Study,
    values: VariantValues,
    duration: Array,
    longest: float,
    rung: Rung,
) -> Converged:
    """March variants of one scene level by level; duration (V,) s, the longest of all variants of the scene, and its
    model. Where the study fixes the steps, these are marched, and twice as many to tell the error. Raises Halted."""
    study, V = rung.of(study), values.size
    found: Outcome | None = None
    active = np.arange(V)
    for level in islice(levels(study, longest, rung.modes), LEVELS if study.solver.steps == "auto" else 2):
        stop_if_asked()
        model, own = level.model, values.part(active)
        now = level.march(own, duration[active], rung.fidelity)
        if found is None:
            found, results, scheme = now, results_of(model), level.scheme
            error, least = np.full((len(results), V), np.nan), np.array([[result.left] for result in results])
            change, held = error.copy(), np.full(V, np.nan)
            modes, steps, coarsest = np.full(V, model.modes), np.full(V, level.steps), level.steps
            continue
        apart = differences(model, found.of(active), now)
        unlike = np.isnan(change[:, active]).all(axis=0) & (apart > UNLIKE).any(axis=0)
        by_steps = np.maximum(left_over(apart, change[:, active], least), now.sooner)
        told = by_steps + rung.left_out[:, None]
        error[:, active], change[:, active] = told + rung.by_fixed.told(own.columns, own.size), apart
        modes[active], steps[active] = model.modes, level.steps
        found = _replaced(found, active, now)
        failed = lost(now.status)
        hopeless = failed & (level.steps >= HOPELESS * coarsest)
        # more steps are of no use where it is the model that misses the tolerance
        by_model = worst(np.broadcast_to(rung.left_out[:, None], told.shape), results, own)
        held[active] = worst(told, results, own) if study.solver.steps == "auto" else by_model
        done = worst(by_steps, results, own) <= np.where(by_model > 1.0, by_model, ENOUGH * (1.0 - by_model))
        active = active[(~done | unlike) & ~hopeless]
        if not active.size:
            break
    assert found is not None
    some_held = np.any(np.isfinite([result.tolerance for result in results]))
    # where nothing is held, the steps that a study fixes are its own affair
    unresolved = np.isnan(held) & (some_held or study.solver.steps == "auto")
    unresolved |= np.isnan(error[np.isfinite([result.tolerance for result in results])]).any(axis=0)
    missed = np.where(held > 1.0, np.int8(Status.TOLERANCE_MISSED), np.int8(Status.OK))
    status = np.where(unresolved, np.int8(Status.UNRESOLVED), missed)
    error[:, lost(found.status)] = np.nan
    of_results = {result.name: own for result, own in zip(results, error, strict=True)}
    tell_times(model, found.numbers, found.other_bands, of_results)
    return Converged(found, error, modes, steps, scheme, rung.fidelity, gravest(status, found.status))


def observed(
    study: Study,
    values: VariantValues,
    duration: Array,
    longest: float,
    rung: Rung,
) -> tuple[Array, Array]:
    """What `converge` reports beside one level beyond that of each variant: how far results are off, and the errors
    told of them (R, V); NaN where there is no such level, or no values. The level beyond has the floating frame, and
    more modes where these are open. Raises Halted."""
    found = converge(study, values, duration, longest, rung)
    apart, left = np.full_like(found.error, np.nan), ~lost(found.status)
    for level in levels(rung.of(study), longest, MORE_MODES * rung.modes):
        lanes = np.flatnonzero(left & (found.steps < level.steps))
        stop_if_asked()
        if lanes.size:
            beyond = level.march(values.part(lanes), duration[lanes])
            apart[:, lanes] = differences(level.model, found.outcome.of(lanes), beyond)
            left[lanes] = False
        if not left.any():
            break
    return np.where(np.isfinite(apart), apart, np.nan), found.error


def worst(error: Array, results: tuple[Result, ...], values: VariantValues) -> Array:
    """(V,) the largest error of what is held over its tolerance; 0 where nothing is."""
    found = np.zeros(error.shape[1])
    for result, own in zip(results, error, strict=True):
        if np.isfinite(result.tolerance):
            found = np.maximum(found, own / (result.tolerance * (values.tighter if result.follows else 1.0)))
    return found


def _replaced(found: Outcome, lanes: Counts, other: Outcome) -> Outcome:
    """The same with the outcome of other marches for some of the variants."""
    if lanes.size == found.status.size:
        return other
    found.put(lanes, other)
    return found
