"""Every number that a study reports of a variant, the tolerance that it is held to, and how far two marches differ.

Results come in families (`FAMILIES`); a family names its results and tells by how much each differs between two
outcomes, over the scale that the second one has.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from engine.march.envelopes import envelope_names
from engine.march.outcome import Asked, Outcome
from engine.model.scene_model import SceneModel
from engine.model.variant_values import VariantValues, weights
from engine.observation.contact_forces import contact_forces
from engine.observation.cycle_reduction import HISTORY_PART, Compared
from engine.scene.study import Study
from results_schema.quantities import QUANTITIES
from results_schema.status import Status

Array = NDArray[np.float64]

EXTREMES = ("max", "min", "rms")
ENDS = ("max", "min")


class Result(NamedTuple):
    """A reported number. of: the sensor, carriage or envelope that it is read of. tolerance: that of its own, NaN where
    its error is only told; follows: whether it is `solver.tolerance`, which a sweep may set."""

    name: str
    of: str
    tolerance: float = np.nan
    follows: bool = False


class Pair(NamedTuple):
    """Two outcomes of the same variants of a scene. apart (S, V): the largest difference of the histories of every
    signal at common stations."""

    asked: Asked
    model: SceneModel
    values: VariantValues
    one: Outcome
    other: Outcome
    apart: Array

    def gap(self, name: str) -> Array:
        """|difference| of a result; 0 where neither has a number, infinite where only one has."""
        left, right = self.one.numbers[name], self.other.numbers[name]
        gap = np.where(np.isnan(left) & np.isnan(right), 0.0, np.abs(left - right))
        return np.where(np.isnan(gap), np.inf, gap)

    @property
    def length(self) -> float:
        """m of the first carriage's track."""
        return self.model.riders[0].length


class Family(Protocol):
    """Results of one sort, in the same order in both."""

    def results(self, asked: Asked) -> Iterator[Result]:
        """What a study has of them."""

    def differences(self, pair: Pair) -> Iterator[Array]:
        """(V,) how far each is apart, over its scale."""


class OfSensors:
    """Extremes, root mean squares, the carriage's places at extremes, and kept histories."""

    def results(self, asked: Asked) -> Iterator[Result]:
        for name, sensor in asked.study.sensor.items():
            held = _held(asked.study, sensor.quantity, sensor.tolerance)
            yield from (Result(f"{name}_{end}", name, *held) for end in EXTREMES)
            yield from (Result(f"{name}_{end}_position", name) for end in ENDS)
            if asked.keeps_histories:
                yield Result(name, name, *held)

    def differences(self, pair: Pair) -> Iterator[Array]:
        for j, name in enumerate(pair.asked.study.sensor):
            scale = pair.other.scale[:, j]
            for end in EXTREMES:
                yield np.maximum(pair.gap(f"{name}_{end}"), HISTORY_PART * pair.apart[j]) / scale
            yield from (pair.gap(f"{name}_{end}_position") / pair.length for end in ENDS)
            if pair.asked.keeps_histories:
                yield pair.apart[j] / scale


class OfAccelerations:
    """Histories of the accelerations of the carriages, which stand behind the sensors."""

    def results(self, asked: Asked) -> Iterator[Result]:
        for name in asked.study.carriage if asked.accelerated else ():
            yield Result(f"{name}_acceleration_across", name)

    def differences(self, pair: Pair) -> Iterator[Array]:
        first, last = len(pair.asked.study.sensor), len(pair.apart) - len(contact_forces(pair.model))
        for j in range(first, last):
            yield _over(pair.apart[j], np.nanmax(np.abs(pair.other.history[:, j]), axis=0, initial=0.0))


class OfContactForces:
    """Extremes of the contact forces over the weight, and the carriage's place at the smallest."""

    def results(self, asked: Asked) -> Iterator[Result]:
        for name in asked.study.carriage:
            yield from (Result(f"{name}_contact_force_{end}", name) for end in ENDS)
            yield Result(f"{name}_contact_force_min_position", name)

    def differences(self, pair: Pair) -> Iterator[Array]:
        forces, weight = contact_forces(pair.model), np.abs(weights(pair.model, pair.values))
        histories = pair.apart[len(pair.apart) - len(forces) :]
        for c, name in enumerate(pair.asked.study.carriage):
            apart = histories[[force.carriage == c for force in forces]].max(axis=0)
            for end in ENDS:
                yield _over(np.maximum(pair.gap(f"{name}_contact_force_{end}"), HISTORY_PART * apart), weight[c])
            yield pair.gap(f"{name}_contact_force_min_position") / pair.length


class OfEnvelopes:
    """Extremes along bodies, over the largest anywhere."""

    def results(self, asked: Asked) -> Iterator[Result]:
        for name in envelope_names(asked.study):
            own = name.rpartition("_envelope_")[0]
            yield Result(name, own, *_held(asked.study, asked.study.envelope[own].quantity, None))

    def differences(self, pair: Pair) -> Iterator[Array]:
        for name in envelope_names(pair.asked.study):
            yield _over(np.max(pair.gap(name), axis=1), np.max(np.abs(pair.other.numbers[name]), axis=1))


class OfCycles:
    """What the kind of study makes of the histories of a cycle."""

    def results(self, asked: Asked) -> Iterator[Result]:
        for result in () if asked.reduction is None else asked.reduction.compared:
            for name, sensor in asked.study.sensor.items():
                yield Result(f"{result} {name}", name, *_held(asked.study, sensor.quantity, sensor.tolerance))

    def differences(self, pair: Pair) -> Iterator[Array]:
        if pair.asked.reduction is not None:
            scale = pair.other.scale
            apart = pair.apart[: len(pair.asked.study.sensor)]
            compared = Compared(pair.one.numbers, pair.other.numbers, scale, apart, pair.values)
            for gaps in pair.asked.reduction.differences(compared).values():
                yield from np.where(np.isinf(scale), 0.0, gaps).T


FAMILIES: tuple[Family, ...] = (OfSensors(), OfAccelerations(), OfContactForces(), OfEnvelopes(), OfCycles())


def results_of(asked: Asked) -> tuple[Result, ...]:
    """All results of a study whose error is measured, in the order of `differences`."""
    return tuple(result for family in FAMILIES for result in family.results(asked))


def differences(asked: Asked, model: SceneModel, values: VariantValues, one: Outcome, other: Outcome) -> Array:
    """(R, V) how far two outcomes of the same variants are apart, by result: over the scale of each that ``other`` has.
    Infinite where only ``one`` has diverged, NaN where the other has."""
    with np.errstate(invalid="ignore", over="ignore"):  # of those that have diverged
        pair = Pair(asked, model, values, one, other, _apart(one, other))
        found = np.stack([gap for family in FAMILIES for gap in family.differences(pair)])
    found[:, one.status >= Status.NOT_CONVERGED] = np.inf
    found[:, other.status >= Status.NOT_CONVERGED] = np.nan
    return found


def _held(study: Study, quantity: str, own: float | str | None) -> tuple[float, bool]:
    """The tolerance of what a sensor reads, and whether it is the study's."""
    if own is None:
        return (np.nan, False) if QUANTITIES[quantity].told else (study.solver.tolerance, True)
    return (np.nan if own == "told" else float(own), False)


def deciding(results: tuple[Result, ...], tolerance: float) -> tuple[Result, ...]:
    """The results by which it is decided what is computed with: those that are held, else all but places, as if they
    were held to ``tolerance``."""
    if any(np.isfinite(result.tolerance) for result in results):
        return results
    return tuple(r if r.name.endswith("_position") else r._replace(tolerance=tolerance, follows=True) for r in results)


def tolerances(results: tuple[Result, ...]) -> Array:
    """(R,) tolerances; NaN where the error is only told."""
    return np.array([result.tolerance for result in results])


def worst_held(errors: Array, results: tuple[Result, ...], tighter: Array | float = 1.0) -> Array:
    """(V, ...) the largest of errors (R, V, ...) over their tolerances, NaN where one that is held is not known; -inf
    where none is held. tighter (V,): `solver.tolerance` of each variant over the study's."""
    found = np.full(errors.shape[1:], -np.inf)
    for result, error in zip(results, errors, strict=True):
        if np.isfinite(result.tolerance):
            found = np.maximum(found, error / (result.tolerance * (tighter if result.follows else 1.0)))
    return found


def _apart(one: Outcome, other: Outcome) -> Array:
    """(S, V) the largest difference of the histories of every signal at common stations."""
    left, right = one.history, other.history
    gap = np.where(np.isnan(left) & np.isnan(right), 0.0, np.abs(left - right))  # of a sensor that moves along
    return np.asarray(np.max(np.where(np.isnan(gap), np.inf, gap), axis=0, initial=0.0))


def _over(gap: Array, scale: Array) -> Array:
    """A gap over its scale; 0 where there is none."""
    return np.asarray(np.divide(gap, scale, out=np.where(gap > 0.0, np.inf, 0.0), where=scale > 0.0))
