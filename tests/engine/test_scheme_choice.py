"""The scheme of a variant: average acceleration or Fox-Goodwin, whichever is cheaper."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engine.audit import Sample, Used, audit_plan, expected
from engine.choice import scheme_used
from engine.execution import run
from engine.fidelity import least_steps, stair
from engine.kernels.schemes import SCHEMES
from engine.lanes import LaneValues
from engine.plan import Plan, make_plan
from engine.scene import Study
from engine.settings import PARAMETERS
from results_schema.status import SchemeUsed, Status, label
from studies.kinds.asymmetry import Asymmetry
from tests.engine.build import Table, beam, cruise, fixed, mass, oscillator, shuttle, study

UNDAMPED = beam(modes="auto", supports="clamped-free", damping_ratio=0.0)
DAMPED = UNDAMPED | {"damping_ratio": 0.4}
SLOWLY = cruise(0.3, 1.0, 0.05)  # leaves the free end, after many periods
AVERAGE, FOX_GOODWIN = SchemeUsed.AVERAGE_ACCELERATION, SchemeUsed.FOX_GOODWIN
OTHERS: dict[str, dict[str, float]] = {
    "newmark": {"beta": 0.3025, "gamma": 0.6},
    "hht-alpha": {"alpha": -0.05},
    "generalized-alpha": {"rho_inf": 0.8},
}


def schemes(plan: Plan) -> set[SchemeUsed]:
    return {scheme_used(bucket.scene.study) for bucket in plan.buckets}


def crossing(bed: Table, motion: Table = SLOWLY, **solver: Any) -> Study:
    return study(bed, mass(0.1, motion), solver=dict(solver))


def test_long_vibration_takes_the_scheme_that_is_true_in_phase() -> None:
    assert schemes(make_plan(crossing(UNDAMPED))) == {FOX_GOODWIN}
    assert schemes(make_plan(crossing(DAMPED))) == {AVERAGE}


def test_what_the_study_says_is_taken() -> None:
    assert schemes(make_plan(crossing(UNDAMPED, scheme="average-acceleration"))) == {AVERAGE}
    assert schemes(make_plan(crossing(DAMPED, scheme="fox-goodwin"))) == {FOX_GOODWIN}
    assert schemes(make_plan(crossing(UNDAMPED, steps=20_000))) == {AVERAGE}


@pytest.mark.parametrize("name", list(SCHEMES))
def test_every_scheme_has_a_number_in_archives(name: str) -> None:
    given = crossing(beam(modes=2), cruise(0.0, 1.0, 0.3), scheme=name, steps=2000, **OTHERS.get(name, {}))
    (number,) = set(run(given, threads=1).scheme_used.values.reshape(-1).tolist())
    assert label(SchemeUsed(number)) == name
    assert set(PARAMETERS) == set(OTHERS)


def test_the_scheme_saves_work_and_holds_the_tolerance() -> None:
    """Against 24 modes by a pair of fourth order."""
    chosen, average = (run(crossing(UNDAMPED, **solver)) for solver in ({}, {"scheme": "average-acceleration"}))
    exact = run(crossing(UNDAMPED | {"modes": 24}, scheme="richardson", steps=200_000))
    assert chosen.status.item() == Status.OK and chosen.error_estimate.item() <= 1e-3
    for name in ("midspan_max", "midspan_min"):
        assert abs(chosen[name].item() - exact[name].item()) <= 1e-3 * exact.midspan_static.item()
    assert chosen.relative_cost.item() < 0.7 * average.relative_cost.item()


def test_springs_that_go_on_vibrating_take_the_scheme_that_is_stable_with_any_step() -> None:
    for after, expected_schemes in ((0.0, {FOX_GOODWIN}), (2.0, {AVERAGE})):
        moving = oscillator(0.1, 2.0, SLOWLY | {"after": after})
        assert schemes(make_plan(study(UNDAMPED, moving))) == expected_schemes


@pytest.mark.parametrize("after", [0.0, 3.0])
def test_steps_keep_inside_the_limit_with_all_that_is_compared(after: float) -> None:
    given = crossing(UNDAMPED, SLOWLY | {"after": after})
    (bucket,) = make_plan(given).buckets
    assert scheme_used(bucket.scene.study) is FOX_GOODWIN and bucket.checks is not None
    for tables in (bucket.tables, bucket.checks.steps, bucket.checks.modes):
        assert tables is not None
        values = LaneValues(tables.model.study, {}, 1)
        time = values.time_scale("car")
        moving = max(segment.step for segment in tables.timeline.segments if not segment.free)
        assert tables.model.omega.max() * moving * time[0] < tables.model.scheme.stability_limit
        assert least_steps(tables.model, time)[0] <= tables.steps
        free = [segment for segment in tables.timeline.segments if segment.free]
        if free:
            period = 2.0 * np.pi / tables.model.first_omega
            longest = after * period / sum(segment.steps for segment in free)
            assert tables.model.omega.max() * longest < tables.model.scheme.stability_limit


@pytest.mark.parametrize(
    ("bed", "solver"),
    [(UNDAMPED, {"tolerance": 3e-2}), (UNDAMPED | {"modes": 2}, {}), (beam(modes=2), {"steps": 600})],
    ids=["chosen", "fixed", "with fixed steps"],
)
def test_few_modes_are_compared_with_more_within_the_limit(bed: Table, solver: Table) -> None:
    """Two modes are compared with five, whose frequency is six times as high and more."""
    given = crossing(bed, cruise(0.3, 0.9, 0.05), scheme="fox-goodwin", **solver)
    (bucket,) = make_plan(given).buckets
    assert bucket.checks is not None and bucket.checks.modes is not None and bucket.checks.modes.model.body_modes == 5
    found = run(given, threads=1)
    assert found.status.item() in (Status.OK, Status.TOLERANCE_MISSED) and 0.0 < found.error_estimate.item() < 0.1


def test_an_audit_marches_by_the_scheme_that_was_used() -> None:
    sweep = {"zeta": {"of": "body.bed.damping_ratio", "values": [0.0, 0.4, 1e-6, 0.42]}}
    plan = make_plan(study(UNDAMPED, mass(0.1, SLOWLY), sweep=sweep))
    first = expected(plan)
    assert first.scheme.tolist() == [FOX_GOODWIN, AVERAGE, FOX_GOODWIN, AVERAGE]
    for used in (first, Used(first.modes, first.steps, first.scheme[::-1].copy())):
        found = audit_plan(plan, Sample(np.arange(4), np.inf), used)
        assert found is not None
        for bucket in found.buckets:
            assert {scheme_used(bucket.scene.study)} == set(used.scheme[bucket.variants].tolist())


def test_a_cycle_is_chosen_for_alike() -> None:
    given = study(UNDAMPED, mass(0.05, shuttle(0.2, 0.9, 0.02, 0.0, 2)), kind="asymmetry", sensor={"place": fixed(0.4)})
    plan = make_plan(given, reduction=Asymmetry().reduction(given))
    assert schemes(plan) == {FOX_GOODWIN}


def test_stairs_are_rounded_counts() -> None:
    steps = stair(1e6)
    assert steps[-1] >= 1e6 > steps[-2] and np.all(np.diff(steps) > 0.0)
    assert np.all(steps[1:] / steps[:-1] <= 2.0)


@pytest.mark.parametrize("after", [0.0, 2.0])
@pytest.mark.parametrize("model", ["force", "mass"])
def test_comparisons_with_springs_keep_inside_the_limit(model: str, after: float) -> None:
    """A comparison beyond it would tell errors of any size."""
    sweep = {"k": {"of": "carriage.car.stiffness", "values": [50.0, 362.0, 1357.0, 5083.0, 1e6]}}
    moving = oscillator(0.02, 50.0, cruise(0.3, 1.0, 0.1) | {"after": after})
    found = run(study(UNDAMPED, moving, sweep=sweep, solver={"fidelity": model}))
    assert np.all(found.error_fidelity.values < 10.0) and np.all(found.error_steps.values < 1e-2)
    bare = study(UNDAMPED | {"modes": 2}, oscillator(0.1, 500.0, cruise(0.0, 1.0, 0.1)))
    for solver in ({"steps": 600}, {"fidelity": model}):
        told = run(bare.with_values({"solver.scheme": "fox-goodwin"} | {f"solver.{k}": v for k, v in solver.items()}))
        assert 0.0 < told.error_estimate.item() < 1.0
