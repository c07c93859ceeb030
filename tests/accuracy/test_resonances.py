"""Cycles that resonate between pilots: how much a variant vibrates tells of its error once it is marched."""

from functools import cache

import numpy as np

from engine.accuracy.reference import Marches, converge, in_full
from engine.accuracy.results import differences, results_of, worst_held
from engine.batch.execution import execute
from engine.batch.executors import Shared, Threads
from engine.batch.plan import Plan, make_plan
from engine.march.outcome import QUIET, Flat, Outcome, outcome, vibration
from engine.model.numerics import Numerics
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from results_schema.store.rows import Collector
from studies.protocol.study import kind_of
from tests.accuracy.passages import axis
from tests.engine.build import beam, fixed, mass, study, swing

MASS, RATE = "carriage.car.mass", "carriage.car.motion.frequency"
FIRST = 3.516 / (2.0 * np.pi)  # Hz, of a cantilever of unit length, stiffness and mass per length


def resonating() -> Study:
    """320 variants about the third to eighth part of the first frequency, hardly damped."""
    motion = swing(0.5, 0.3, 0.1, 20)
    tables = {"kind": "double-peak", "sensor": {"tip": fixed(1.0)}, "solver": {"tolerance": 3e-3}}
    sweep = {"rate": axis(RATE, FIRST / 8.0, FIRST / 3.0, 40), "mass": axis(MASS, 0.1, 0.4, 8)}
    bed = beam(supports="clamped-free", damping_ratio=0.001, modes="auto")
    return study(bed, mass(0.2, motion), **tables, sweep=sweep, gravity=9.81)


def marched(chunk: int, threads: int) -> tuple[Plan, Flat]:
    """The results of all variants, chosen for by few pilots."""
    given = resonating()
    kind = kind_of(given)
    plan = make_plan(given, reduction=kind.reduction(given), results=kind.name)
    plan.choose(Shared(Threads(threads)), 48)
    found = Collector(plan.size)
    execute(plan, found.add, Threads(threads), chunk=chunk)
    return plan, found.arrays


@cache
def whole() -> tuple[Plan, Flat]:
    return marched(64, 2)


def foreseen(plan: Plan) -> Array:
    """(V,) modes x steps of what pilots foresaw."""
    found = np.empty(plan.size)
    for group in plan.groups:
        found[group.variants] = group.work
    return found


def test_vibration_is_what_does_not_follow_the_load_slowly() -> None:
    """The largest second difference of histories about statics, of one that is marched and of one that rests."""
    plan, _ = whole()
    (grid,) = plan.grids
    values = VariantValues.of(grid.scene.study, plan.cases, np.arange(0, plan.size, 7))
    marches = [(grid.tables(model, 8), values, grid.stations(model, 8)) for model in map(grid.model, of_both())]
    moving, resting = (outcome(plan.asked, *march) for march in marches)
    heard = vibration(*marches[0], moving), vibration(*marches[1], resting)
    off = (moving.history - resting.history)[:, 0] / moving.scale[:, 0]
    plain = np.abs(off[2:] - 2.0 * off[1:-1] + off[:-2]).max(axis=0)
    np.testing.assert_allclose(np.exp(heard[0]), np.maximum(plain, QUIET), rtol=1e-6)
    np.testing.assert_allclose(np.exp(heard[1]), QUIET, rtol=1e-12)
    assert np.ptp(heard[0]) > 1.0


def of_both() -> tuple[Numerics, Numerics]:
    scheme = whole()[0].grids[0].scene.numerics.scheme
    return Numerics("full", scheme, True, 4), Numerics("static", scheme, True, 4)


def test_variants_that_resonate_between_pilots_are_marched_again_and_hold() -> None:
    plan, found = whole()
    assert plan.choice is not None
    (grid,), again = plan.grids, np.flatnonzero(found["work"] > foreseen(plan))
    assert again.size > 3
    values = VariantValues.of(grid.scene.study, plan.cases, again)
    truth = converge(Marches(grid, values, in_full(grid)), 0.1)
    before, after = [], []
    for group in plan.groups:
        own = np.flatnonzero(np.isin(again, group.variants))
        if own.size:
            now = group.found(values.part(own), again[own], plan.choice, lambda: False, "histories").outcome
            first = group._marched(values.part(own), lambda: False, "histories")  # type: ignore[attr-defined]
            before.append(off(plan, values.part(own), first, truth.outcome.of(own)))
            after.append(off(plan, values.part(own), now, truth.outcome.of(own)))
    worst_before, worst_after = (np.concatenate(part) for part in (before, after))
    assert np.count_nonzero(worst_before > 1.0) >= 3
    assert np.count_nonzero(worst_after > 1.0) <= 0.5 * np.count_nonzero(worst_before > 1.0)
    assert worst_after.max() < 0.5 * worst_before.max()


def off(plan: Plan, values: VariantValues, now: Outcome, truth: Outcome) -> Array:
    """(V,) the worst of what is held over its tolerance."""
    return worst_held(differences(plan.asked, plan.grids[0].scene, values, now, truth), results_of(plan.asked))


def test_what_is_marched_again_follows_from_the_study_alone() -> None:
    _, one = whole()
    _, other = marched(37, 1)
    for name, array in one.items():
        assert other[name].tobytes() == array.tobytes(), name
