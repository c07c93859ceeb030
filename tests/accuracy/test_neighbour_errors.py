"""What pilots tell of the variants around them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.accuracy.choice import NeighbourErrors, nearest_others, neighbour_errors_of, worst_but_one
from engine.accuracy.ladder import Measured
from engine.accuracy.results import results_of
from engine.march.outcome import Asked
from results_schema.arrays import Array
from tests.accuracy.chosen import run_of

COUNT, NEAR = 200, 8
TOLERANCE = 1e-2


def asked() -> Asked:
    return run_of("passages").plan.asked


def measured(error: Array, reference: float = 0.0) -> Measured:
    """One rung, on which every one of some pilots has the same error (P,) of all results."""
    results = len(results_of(asked()))
    marches = np.vstack([np.full((1, results), np.inf), np.repeat(error[:, None], results, axis=1)])
    return Measured(
        error=marches,
        pilot=np.concatenate([[0], np.arange(COUNT)]),
        march=np.arange(1, COUNT + 1, dtype=np.int32).reshape(1, 1, COUNT),
        held=(error / TOLERANCE).reshape(1, 1, COUNT),
        reference=np.full((results, COUNT), reference),
        marched=np.ones((1, 1), dtype=np.bool_),
        work=0.0,
        free=True,
    )


def others() -> NDArray[np.int32]:
    return nearest_others(np.linspace(0.0, 1.0, COUNT)[None], NEAR)


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
    found = NeighbourErrors(error, held, held)
    told = worst_but_one(error[march[rung[:, None], neighbours]], axis=1)
    np.testing.assert_array_equal(found.errors(march, rung, neighbours), np.where(np.isfinite(told), told, np.nan).T)
    limited = np.maximum(held[:, 0] / tighter[:, None, None], held[:, 1])
    of_all = worst_but_one(np.take_along_axis(limited, neighbours[:, :, None], axis=1), axis=1)
    np.testing.assert_array_equal(found.worst(rung, neighbours, tighter), of_all[np.arange(variants), rung])


def test_one_pilot_at_a_resonance_is_not_believed_by_all_around() -> None:
    error = np.full(COUNT, 0.1 * TOLERANCE)
    error[20] = 50.0 * TOLERANCE
    found = neighbour_errors_of(asked(), measured(error), others(), (1.0, 1.0))
    rung, beside = np.zeros(1, dtype=np.int32), others()[[21]]
    assert 20 in beside and found.worst(rung, beside, np.ones(1)) < 0.2


def test_margins_are_what_pilots_that_are_left_out_need() -> None:
    """Errors that are twice those of all neighbours, now and then, double what is told."""
    error = np.full(COUNT, 0.1 * TOLERANCE)
    error[[4, 14, 24, 34]] *= 2.0
    plain = neighbour_errors_of(asked(), measured(np.full(COUNT, 0.1 * TOLERANCE)), others(), (1.0, 1.0))
    found = neighbour_errors_of(asked(), measured(error), others(), (1.0, 1.0))
    np.testing.assert_allclose(plain.held[:, 0], 0.1, rtol=1e-12)
    np.testing.assert_allclose(found.held[20, 0, 0], 0.2, rtol=1e-12)


@pytest.mark.parametrize(("reference", "decides"), [(0.2, 0.3), (0.39, 0.49), (3.0, 0.1)])
def test_references_that_do_not_settle_are_told_but_do_not_decide(reference: float, decides: float) -> None:
    given = measured(np.full(COUNT, 0.1 * TOLERANCE), reference * TOLERANCE)
    found = neighbour_errors_of(asked(), given, others(), (1.0, 1.0))
    np.testing.assert_allclose(found.wanted[:, 0], decides, rtol=1e-12)
    np.testing.assert_allclose(found.held[:, 0], 0.1 + reference, rtol=1e-12)


def test_what_the_study_fixes_makes_nothing_dearer() -> None:
    given = replace(measured(np.full(COUNT, 0.1 * TOLERANCE), 0.2 * TOLERANCE), free=False)
    found = neighbour_errors_of(asked(), given, others(), (1.0, 1.0))
    np.testing.assert_allclose(found.held[:, 0], 0.1, rtol=1e-12)
    np.testing.assert_array_equal(found.wanted, found.held)


def test_margins_are_those_of_the_whole_error_where_the_study_fixes_all() -> None:
    """The march that is wanted is the one that is taken, so that nothing is held; what is told still needs a margin."""
    error = np.full(COUNT, 0.1 * TOLERANCE)
    error[[4, 14, 24, 34]] *= 2.0
    given = replace(measured(error), held=np.zeros((1, 1, COUNT)), free=False)
    found = neighbour_errors_of(asked(), given, others(), (1.0, 1.0))
    np.testing.assert_allclose(found.error[21], 0.2 * TOLERANCE, rtol=1e-12)
    np.testing.assert_array_equal(found.held, 0.0)
