"""What pilots tell of the variants around them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.accuracy.climb import Measured
from engine.accuracy.neighbour_errors import (
    AGAINST_SLOPES,
    NeighbourErrors,
    Places,
    nearest_others,
    neighbour_errors_of,
    slopes,
    worst_but_one,
)
from engine.accuracy.results import results_of
from engine.march.outcome import Asked
from results_schema.arrays import Array
from tests.accuracy.chosen import run_of

COUNT, NEAR = 200, 8
TOLERANCE = 1e-2


def asked() -> Asked:
    return run_of("passages").plan.asked


def measured(error: Array, reference: float = 0.0, by_elements: Array | float = 0.0) -> Measured:
    """One rung, on which every one of some pilots has the same error (P,) of all results, and by its elements."""
    results = len(results_of(asked()))
    marches = np.vstack([np.full((1, results), np.inf), np.repeat(error[:, None], results, axis=1)])
    return Measured(
        error=marches,
        pilot=np.concatenate([[0], np.arange(COUNT)]),
        march=np.arange(1, COUNT + 1, dtype=np.int32).reshape(1, 1, COUNT),
        held=(error / TOLERANCE).reshape(1, 1, COUNT),
        reference=np.full((results, COUNT), reference),
        by_elements=np.zeros((results, COUNT)) + by_elements,
        marched=np.ones((1, 1), dtype=np.bool_),
        work=0.0,
        spent=np.zeros(COUNT),
        vibration=np.zeros(COUNT),
        free=True,
    )


PLACES = Places(np.linspace(0.0, 1.0, COUNT)[:, None], np.ones(1))


def others() -> NDArray[np.int32]:
    return nearest_others(PLACES.weighted, NEAR)


def told_by(given: Measured) -> NeighbourErrors:
    return neighbour_errors_of(asked(), given, PLACES, others(), (1.0, 1.0))


def held_by(found: NeighbourErrors, wanted: bool = False) -> Array:
    """(P, rungs) what is held to the study's tolerance, at the places of the pilots."""
    levels = (found.wanted if wanted else found.held)[:, 0]
    return np.exp(levels + found.pilots.T @ found.held_slopes)


def test_neighbours_of_a_pilot_are_others() -> None:
    found = others()
    assert found.shape == (COUNT, NEAR)
    assert np.all(found != np.arange(COUNT)[:, None])
    assert set(found[20, :2].tolist()) == {19, 21}


def test_the_worst_is_left_out_and_what_is_unknown_is_the_worst() -> None:
    errors = np.random.default_rng(3).random((5, 7))
    np.testing.assert_array_equal(worst_but_one(errors, axis=1), np.sort(errors, axis=1)[:, -2])
    np.testing.assert_array_equal(worst_but_one(errors[:, :1], axis=1), errors[:, 0])
    errors[:, 2] = np.nan
    np.testing.assert_array_equal(worst_but_one(errors, axis=1), np.nanmax(errors, axis=1))


@pytest.mark.parametrize("near", [1, 2, 10])
def test_what_variants_are_told_is_the_worst_but_one_of_their_neighbours(near: int) -> None:
    """The kernels beside numpy, with errors that are not known and such that have no bound."""
    random = np.random.default_rng(near)
    rungs, pilots, variants = 6, 40, 300
    march = random.permutation(rungs * pilots).reshape(rungs, pilots).astype(np.int32)
    error = np.exp(random.normal(size=(rungs * pilots, 3)))
    error[random.random(error.shape) < 0.15] = np.nan
    error[random.random(error.shape) < 0.05] = np.inf
    held = random.exponential(0.7, size=(pilots, 2, rungs))
    neighbours = np.argsort(random.random((variants, pilots)), axis=1)[:, :near].astype(np.int32)
    rung, tighter = random.integers(rungs, size=variants).astype(np.int32), random.uniform(0.5, 1.0, variants)
    slope, at, places = (random.normal(size=shape) for shape in ((2, rungs), (2, pilots), (variants, 2)))
    levels = np.log(held) - (at.T @ slope)[:, None]
    by_elements = np.exp(random.normal(size=(pilots, 3)))
    found = NeighbourErrors(at, error, levels, levels, slope, slope, by_elements)
    rises = np.exp(np.sum(slope[:, rung].T[:, None] * (places[:, None] - at.T[neighbours]), axis=2))
    told = worst_but_one(error[march[rung[:, None], neighbours]] * rises[:, :, None], axis=1)
    told = np.where(np.isfinite(told), told, np.nan).T + worst_but_one(by_elements[neighbours], axis=1).T
    np.testing.assert_allclose(found.errors(march, rung, places, neighbours), told, rtol=1e-13)
    limited = np.maximum(held[:, 0] / tighter[:, None, None], held[:, 1])[np.arange(variants)[:, None], neighbours]
    of_all = worst_but_one(limited[np.arange(variants), :, rung] * rises, axis=1)
    np.testing.assert_allclose(found.worst(rung, places, neighbours, tighter), of_all, rtol=1e-12)


def test_slopes_are_least_squares_over_the_pilots_that_know() -> None:
    random = np.random.default_rng(5)
    along, weights = random.random((COUNT, 3)), np.array([1.0, 0.3, 2.0])
    errors = np.exp(random.normal(size=(1, 4, COUNT)) + along @ [3.0, -1.0, 0.5])
    errors[random.random(errors.shape) < 0.1] = np.inf
    found = slopes(errors, Places(along, weights), (1e-6, 1e6))
    for own, slope in zip(errors[0], found.T * weights, strict=True):
        known = np.isfinite(own)
        apart, logs = along[known] - along[known].mean(axis=0), np.log(own[known])
        rows = np.vstack([apart, np.sqrt(AGAINST_SLOPES) * np.eye(3)])
        wanted = np.linalg.lstsq(rows, np.concatenate([logs - logs.mean(), np.zeros(3)]))[0]
        np.testing.assert_allclose(slope, wanted, rtol=1e-10)


def test_errors_that_rise_over_the_sweep_are_told_beyond_all_pilots() -> None:
    given = measured(0.1 * TOLERANCE * np.exp(4.0 * PLACES.along[:, 0]))
    found, march, rung = told_by(given), given.march.reshape(1, COUNT), np.zeros(1, dtype=np.int32)
    told = found.errors(march, rung, np.full((1, 1), 1.2), others()[[COUNT - 1]])[0, 0]
    assert 0.95 < told / (0.1 * TOLERANCE * np.exp(4.0 * 1.2)) < 1.05


def test_one_pilot_at_a_resonance_is_not_believed_by_all_around() -> None:
    error = np.full(COUNT, 0.1 * TOLERANCE)
    error[20] = 50.0 * TOLERANCE
    found = told_by(measured(error))
    rung, beside = np.zeros(1, dtype=np.int32), others()[[21]]
    assert 20 in beside and found.worst(rung, PLACES.along[[21]], beside, np.ones(1)) < 0.2


def test_margins_are_what_pilots_that_are_left_out_need() -> None:
    """Errors that are twice those of all neighbours, now and then, double what is told."""
    error = np.full(COUNT, 0.1 * TOLERANCE)
    error[[4, 14, 24, 34]] *= 2.0
    plain, found = told_by(measured(np.full(COUNT, 0.1 * TOLERANCE))), told_by(measured(error))
    np.testing.assert_allclose(held_by(plain), 0.1, rtol=1e-12)
    np.testing.assert_allclose(held_by(found)[20], 0.2, rtol=1e-2)


@pytest.mark.parametrize(("reference", "decides"), [(0.2, 0.3), (0.39, 0.49), (3.0, 0.1)])
def test_references_that_do_not_settle_are_told_but_do_not_decide(reference: float, decides: float) -> None:
    given = measured(np.full(COUNT, 0.1 * TOLERANCE), reference * TOLERANCE)
    found = told_by(given)
    np.testing.assert_allclose(held_by(found, wanted=True), decides, rtol=1e-12)
    np.testing.assert_allclose(held_by(found), 0.1 + reference, rtol=1e-12)


@pytest.mark.fault
@pytest.mark.parametrize("free", [True, False])
def test_rungs_that_none_marched_hold_nothing_whatever_the_first_reference_is(free: bool) -> None:
    """Rungs point to a blank march of the first pilot: where its reference did not converge they seemed to be exact."""
    given = measured(np.full(COUNT, 0.1 * TOLERANCE))
    given.reference[:, 0] = np.nan
    march, held = given.march.copy(), given.held.copy()
    march[:, :, 20:], held[:, :, 20:] = 0, np.inf
    found = told_by(replace(given, march=march, held=held, free=free))
    assert np.isposinf(found.wanted[20:, 0]).all() and np.isposinf(found.error[0]).all()
    assert np.isfinite(found.wanted[1:20, 0]).all()


def test_what_the_study_fixes_makes_nothing_dearer() -> None:
    given = replace(measured(np.full(COUNT, 0.1 * TOLERANCE), 0.2 * TOLERANCE), free=False)
    found = told_by(given)
    np.testing.assert_allclose(held_by(found), 0.1, rtol=1e-12)
    np.testing.assert_array_equal(found.wanted, found.held)


def test_margins_are_those_of_the_whole_error_where_the_study_fixes_all() -> None:
    """The march that is wanted is the one that is taken, so that nothing is held; what is told still needs a margin."""
    error = np.full(COUNT, 0.1 * TOLERANCE)
    error[[4, 14, 24, 34]] *= 2.0
    given = replace(measured(error), held=np.zeros((1, 1, COUNT)), free=False)
    found = told_by(given)
    np.testing.assert_allclose(found.error[21], 0.2 * TOLERANCE, rtol=1e-2)
    np.testing.assert_array_equal(held_by(found), 0.0)


def test_what_elements_leave_is_told_and_does_not_decide() -> None:
    """By what their neighbours tell it is no less for nearly all pilots; on its own it misses no promise."""
    own = 30.0 * TOLERANCE * np.random.default_rng(3).uniform(0.5, 1.0, COUNT)
    without, given = (measured(np.full(COUNT, 0.1 * TOLERANCE), 0.0, elements) for elements in (0.0, own))
    found, before, rung = told_by(given), told_by(without), np.zeros(COUNT, dtype=np.int32)
    around = given.march.reshape(1, COUNT), rung, PLACES.along, others()
    beside = found.errors(*around) - before.errors(*around)
    assert np.mean(beside >= own) > 0.95 and np.median(beside / own) < 2.0
    np.testing.assert_array_equal(held_by(found), held_by(before))
    np.testing.assert_array_equal(held_by(found, wanted=True), held_by(before, wanted=True))
