"""Every reported number, the tolerance that it is held to, and how far two marches differ."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from engine.accuracy.grids import SceneGrid
from engine.accuracy.results import Result, differences, results_of, tolerances, worst_held
from engine.batch.plan import make_plan
from engine.march.outcome import Outcome, outcome
from engine.scene.study import Study
from results_schema.status import Status
from tests.accuracy.passages import only_grid, passages
from tests.engine.build import beam, fixed, under


def held(given: Study) -> dict[str, float]:
    """Tolerances of all results by name."""
    return {result.name: result.tolerance for result in results_of(make_plan(given).asked)}


@pytest.mark.parametrize(
    "quantity", ["displacement", "bending_moment", "shear_force", "velocity", "acceleration", "contact_force"]
)
def test_what_need_not_converge_is_told_only(quantity: str) -> None:
    place = under("car", quantity) if quantity == "contact_force" else fixed(0.4, quantity)
    if quantity == "contact_force":
        place = {"carriage": "car", "quantity": quantity}
    found = held(passages(sensor={"one": place}, solver={"tolerance": 2e-4}))
    wanted = np.nan if quantity in ("velocity", "acceleration", "contact_force") else 2e-4
    assert [found[f"one_{end}"] for end in ("max", "min", "rms")] == pytest.approx([wanted] * 3, nan_ok=True)


def test_places_and_contact_forces_are_told_only() -> None:
    found = held(passages())
    told = {name for name, tolerance in found.items() if np.isnan(tolerance)}
    assert told == {
        "midspan_max_position",
        "midspan_min_position",
        "car_contact_force_max",
        "car_contact_force_min",
        "car_contact_force_min_position",
    }


@pytest.mark.parametrize(("own", "wanted"), [(1e-2, 1e-2), ("1 %", 0.01), ("told", np.nan), (None, 1e-3)])
def test_a_sensor_may_have_a_tolerance_of_its_own(own: Any, wanted: float) -> None:
    more = {} if own is None else {"tolerance": own}
    sensors = {"plain": fixed(0.5), "own": fixed(0.3, "bending_moment") | more, "fast": fixed(0.3, "velocity") | more}
    found = held(passages(sensor=sensors))
    assert found["plain_max"] == 1e-3
    assert found["own_rms"] == pytest.approx(wanted, nan_ok=True)
    assert found["fast_max"] == pytest.approx(wanted if own is not None else np.nan, nan_ok=True)


def test_histories_are_results_where_they_are_kept() -> None:
    assert "midspan" in held(passages(output={"histories": "auto"}))
    assert "midspan" not in held(passages(output={"histories": "none"}))


def test_envelopes_are_held() -> None:
    line = {"body": "bed", "places": 5}
    found = held(passages(envelope={"w": line | {"quantity": "displacement"}, "v": line | {"quantity": "velocity"}}))
    assert found["w_envelope_max"] == 1e-3 and np.isnan(found["v_envelope_min"])


def test_what_is_worst_over_its_tolerance() -> None:
    """Of those that are held; a sweep of `solver.tolerance` tightens those that follow it."""
    results = (Result("a_max", "a", 1e-3, True), Result("b_max", "b", 1e-2), Result("c_max", "c"))
    errors = np.array([[1e-4, np.nan, 1e-4], [5e-3, 1e-4, 1e-4], [9.0, 9.0, np.nan]])
    np.testing.assert_array_equal(tolerances(results), [1e-3, 1e-2, np.nan])
    np.testing.assert_allclose(worst_held(errors, results), [0.5, np.nan, 0.1])
    np.testing.assert_allclose(worst_held(errors, results, np.full(3, 0.1)), [1.0, np.nan, 1.0])
    assert worst_held(errors[2:], results[2:]).tolist() == [-np.inf] * 3


def marched(grid: SceneGrid, by: int) -> Outcome:
    return outcome(grid.asked, grid.tables(grid.scene, by), grid.values, grid.stations(grid.scene, by))


LINE = {"moments": {"body": "bed", "quantity": "bending_moment", "places": 3}}


def test_a_march_does_not_differ_from_itself() -> None:
    grid = only_grid(passages(2, 2, envelope=LINE, output={"histories": "auto"}))
    one = marched(grid, 16)
    found = differences(grid.asked, grid.scene, grid.values, one, one)
    assert found.shape == (len(results_of(grid.asked)), 4)
    assert np.all(found == 0.0)


def test_differences_are_over_the_largest_static_value() -> None:
    """P L^3/48 E I of a displacement at midspan; rms are compared too."""
    grid = only_grid(passages(2, 2, bed=beam(modes=5)))
    one, other = marched(grid, 8), marched(grid, 64)
    found = differences(grid.asked, grid.scene, grid.values, one, other)
    names = [result.name for result in results_of(grid.asked)]
    static = grid.values.own_mass("car") * 9.81 / 48.0
    for name in ("midspan_max", "midspan_min", "midspan_rms"):
        gap = np.abs(one.numbers[name] - other.numbers[name]) / static
        assert np.all(found[names.index(name)] >= gap * (1.0 - 1e-4)) and np.all(gap > 0.0)


def test_what_has_diverged_is_infinitely_far_or_unknown() -> None:
    grid = only_grid(passages(3))
    one = marched(grid, 16)
    status = np.array([Status.OK, Status.DIVERGED, Status.OK], dtype=np.int8)
    bad = replace(one, status=status)
    assert np.all(np.isinf(differences(grid.asked, grid.scene, grid.values, bad, one)[:, 1]))
    assert np.all(np.isnan(differences(grid.asked, grid.scene, grid.values, one, bad)[:, 1]))
