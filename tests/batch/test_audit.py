"""Which variants an audit takes, and what it finds of them."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from engine.accuracy.reference import usual_work
from engine.accuracy.results import results_of
from engine.batch import audit as module
from engine.batch.audit import audit, audit_size, joined, may_go_further, sampled
from engine.batch.plan import Plan, make_plan
from tests.accuracy.chosen import STUDIES, chosen_plan, run_of
from tests.accuracy.passages import WEIGHT, axis, passages
from tests.engine.build import beam, cruise, mass, study, swing


def on(plan: Plan, variants: Any) -> Any:
    return audit(plan, np.asarray(variants, dtype=np.int64))


def masses(count: int, **changes: Any) -> Plan:
    return make_plan(passages(sweep={"weight": axis(WEIGHT, 0.05, 0.25, count)}, bed=beam(modes=4), **changes))


def test_the_draw_is_the_studys_alone() -> None:
    first, again, fewer = (sampled(masses(200, solver={"audit": count})) for count in (16, 16, 8))
    np.testing.assert_array_equal(first, again)
    assert first.size == 16 == np.unique(first).size and set(fewer.tolist()) < set(first.tolist())
    assert first.min() >= 0 and first.max() < 200


@pytest.mark.parametrize(("count", "wanted", "found"), [(7, 7, 7), (7, 9, 7), (2, 1, 1), (15, 14, 14), (15, 0, 0)])
def test_as_many_as_are_wanted(count: int, wanted: int, found: int) -> None:
    assert sampled(masses(count, solver={"audit": wanted})).size == found


def test_no_pilot_is_audited() -> None:
    with_all = STUDIES["passages"].with_values({"solver.audit": 300})
    plan = chosen_plan(with_all)
    assert plan.choice is not None
    others = np.setdiff1d(np.arange(300), plan.choice.pilots)
    np.testing.assert_array_equal(sampled(plan), others)


def test_a_hundredth_is_audited() -> None:
    assert [audit_size(masses(count)) for count in (3, 100, 4000, 100_000)] == [3, 16, 40, 256]


def test_work_is_the_same_of_all_and_of_some_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = masses(4000, solver={"tolerance": 1e-5})
    (grid,) = plan.grids
    work, number = module._works(grid, 1e5)
    whole = np.unique(usual_work(grid, grid.values, 1e5), return_counts=True)
    monkeypatch.setattr(module, "AT_ONCE", 301)
    for found in ((work, number), module._works(grid, 1e5)):
        np.testing.assert_array_equal(found, whole)
    assert number.sum() == 4000


def test_less_is_audited_of_what_takes_long_beside_the_run() -> None:
    """Statics of ever slower masses, which cost nothing but in an audit."""
    cars = [mass(0.2, cruise(0.0, 1.0, speed)) for speed in (1e-3, 1e-4, 1e-5)]
    sizes = [audit_size(masses(4000, car=car, solver={"fidelity": "static"})) for car in cars]
    assert sizes == sorted(sizes, reverse=True) and (sizes[0], sizes[-1]) == (40, 0)


def test_what_pilots_took_tells_how_many_are_audited() -> None:
    """Of the same sweep, whose references take a million times as long, none is."""
    plan = chosen_plan(STUDIES["passages"])
    assert plan.choice is not None and audit_size(plan) == 16
    measured = plan.choice.measured
    plan.choice = replace(plan.choice, measured=replace(measured, spent=1e6 * measured.spent))
    assert audit_size(plan) == 0


def test_what_variants_took_tells_how_many_of_those_are_audited_that_converge_by_themselves() -> None:
    """Foreseen to go two levels on, the first `asymmetry` of `init` was not audited, as that would take too long."""
    plan = make_plan(passages(3, 3))
    assert plan.choice is None
    steps, modes = 1000 * np.arange(1, 10), np.full(9, 8)
    sizes = [audit_size(plan, {"modes_used": modes, "steps_used": times * steps}) for times in (1, 20, 10**6)]
    assert sizes[0] == 9 > sizes[1] > sizes[2] == 0


def test_parts_are_joined_to_the_same_audit() -> None:
    plan = run_of("lengths").plan
    picked = np.arange(0, plan.size, 23)
    whole, parts = on(plan, picked), joined([on(plan, picked[1::2]), on(plan, picked[::2])], plan, picked.size)
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(one, other)


def test_few_variants_are_audited_too() -> None:
    plan = make_plan(passages(3, 3))
    found = on(plan, sampled(plan))
    assert found.variants.tolist() == list(range(9))
    assert np.all(found.observed[:3] <= np.maximum(found.told[:3], 1e-4)) and np.all(found.doubt[:3] < 1e-3)


def test_what_is_observed_is_the_difference_of_the_numbers_and_not_of_histories() -> None:
    """A half of what the histories differ by, which estimates add, was counted as an error that the numbers had."""
    variants = np.arange(9)
    coarse, fine = (
        make_plan(passages(3, 3, bed=bed, solver=given))
        for bed, given in ((beam(modes=2), {"steps": 60}), (beam(), {"tolerance": 1e-7}))
    )
    found = on(coarse, variants)
    own, true = (found_by(plan, variants) for plan in (coarse, fine))
    names = [result.name for result in results_of(coarse.asked)]
    for name in (names[0], names[2]):  # largest and root mean square
        by_hand = np.abs(own.numbers[name] - true.numbers[name]) / true.scale[:, 0]
        assert by_hand.max() > 1e-4
        np.testing.assert_allclose(found.observed[names.index(name)], by_hand, atol=1e-4)


def found_by(plan: Plan, variants: Any) -> Any:
    (group,) = plan.groups
    return group.found(plan.values(group, variants), variants, None, lambda: False).outcome


def test_marches_that_are_dear_are_compared_with_others_too() -> None:
    """The next level takes more than a reference of pilots is worth; without it a march would be its own judge."""
    stiff = beam(length=2.5, area=0.03, second_moment=1e-4, youngs_modulus=110e9, density=7200.0, damping_ratio=0.04)
    stiff |= {"supports": [{"at": at, "stiffness": 2e7} for at in (0.2, 1.25, 2.3)]}
    motion = {"kind": "out-and-back", "start": 0.2, "end": 2.3, "speed": 3.0, "turn": 0.1, "cycles": 16}
    sweep = {"weight": {"of": WEIGHT, "values": [240.0, 250.0]}}
    plan = make_plan(study(stiff, mass(250.0, motion), sweep=sweep, sensor={"middle": {"body": "bed", "at": 1.25}}))
    found = on(plan, [1])
    names = [result.name for result in results_of(plan.asked)]
    assert 0.0 < found.observed[names.index("middle_max"), 0] < 1e-3


def test_variants_without_a_truth_are_left_out() -> None:
    """Parametric resonance without damping grows until nothing is left."""
    sweep = {"weight": {"of": WEIGHT, "values": [0.001, 1.0, 0.002]}}
    car = mass(0.5, swing(0.5, 0.5, 0.608 * 0.5 * math.pi, 150))
    plan = make_plan(study(beam(modes=3), car, sweep=sweep, solver={"steps": 200, "tolerance": 0.1}))
    found = on(plan, [0, 1])
    assert found.variants.tolist() == [0] and found.left_out == 1


def test_what_nothing_finer_is_left_of_is_known_without_a_march() -> None:
    """The same are left out by an audit that marches them."""
    asked = {"of": "solver.tolerance", "values": [1e-2, 1e-9, 1e-4]}
    plan = make_plan(passages(sweep={"asked": asked}, solver={"tolerance": 1e-2}))
    (group,) = plan.groups
    everyone = np.arange(3)
    used = group.found(plan.values(group, everyone), everyone, None, lambda: False).used
    further = may_go_further(plan, everyone, used)
    assert further.tolist() == [True, False, True]
    assert on(plan, everyone).variants.tolist() == np.flatnonzero(further).tolist()


def test_no_variants_are_an_audit_too() -> None:
    plan = make_plan(passages(2, 2))
    found = on(plan, [])
    assert found.variants.size == 0 == found.left_out and found.observed.shape == (len(results_of(plan.asked)), 0)
