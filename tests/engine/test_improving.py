"""Variants that miss their tolerance are marched again with more; what is kept of them is that of the better march."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import engine.bucketing as bucketing
import engine.improving as improving
from engine.choice import Choice
from engine.estimates import Errors
from engine.execution import run
from engine.lanes import LaneValues
from engine.plan import make_plan
from engine.scene import Study
from results_schema.status import Fidelity, Status
from tests.engine.build import beam, cruise, fixed, force, mass, oscillator, study

Array = NDArray[np.float64]

CROSSING = cruise(0.0, 1.0, 0.5)
SPEEDS = {"speed": {"of": "carriage.car.motion.speed", "values": [0.2, 0.35, 0.5, 0.7]}}
OPEN = beam(modes="auto", damping_ratio=0.02)


def too_cheap(monkeypatch: pytest.MonkeyPatch, modes: int, steps: int) -> None:
    """The choice is always these modes, and as few steps as the rules allow."""
    real = bucketing.choose

    def cheap(*args: Any) -> Choice:
        told = real(*args)
        return told._replace(
            fidelity=np.full_like(told.fidelity, Fidelity.MASS),
            modes=np.full_like(told.modes, modes),
            steps=np.full_like(told.steps, steps),
            error_fidelity=np.zeros_like(told.modes),
        )

    monkeypatch.setattr(bucketing, "choose", cheap)


def improved(**changes: Any) -> Study:
    return study(OPEN, mass(0.3, CROSSING), **({"sweep": SPEEDS, "solver": {"tolerance": 1e-3}} | changes))


def test_what_misses_is_marched_again_and_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    truth = run(study(OPEN | {"modes": 16}, mass(0.3, CROSSING), sweep=SPEEDS, solver={"steps": 12800}))
    expected = run(improved())
    too_cheap(monkeypatch, 2, 200)
    first = {bucket.steps for bucket in make_plan(improved()).buckets}
    found = run(improved())
    assert found.status.values.tolist() == [Status.OK] * 4
    assert np.all(found.error_estimate.values <= 1e-3)
    assert np.all(found.modes_used.values > 2) and np.all(found.steps_used.values >= min(first))
    for dataset in (found, expected):
        for end in ("max", "min"):
            gap = np.abs(dataset[f"midspan_{end}"].values - truth[f"midspan_{end}"].values)
            assert np.all(gap <= 1e-3 * truth.midspan_static.values)


def test_all_marches_are_paid_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cost of an improved variant is that of all its rounds with their checks; no more rounds, no more cost."""
    too_cheap(monkeypatch, 2, 200)
    found = run(improved())
    monkeypatch.setattr(improving, "ROUNDS", 0)
    once = run(improved())
    assert np.all(once.status.values == Status.TOLERANCE_MISSED)
    assert np.all(once.error_estimate.values > 1e-3) and np.all(np.isfinite(once.midspan_max.values))
    assert np.all(found.relative_cost.values > once.relative_cost.values)
    full_steps = 2 * 200 * once.relative_cost.values / found.relative_cost.values
    own = found.modes_used.values * found.steps_used.values
    assert np.all(own > full_steps)
    cost_of_full = once.modes_used.values * once.steps_used.values / once.relative_cost.values
    assert np.all(found.relative_cost.values > once.relative_cost.values + own / cost_of_full / 2.0)


@pytest.mark.parametrize(("wanted", "after"), [("all", 1.0), ("auto", 0.0), ({"every": 4}, 1.0), ({"every": 3}, 0.0)])
def test_histories_of_improved_variants(wanted: Any, after: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are those of the better march, at the stations that the first one had."""
    given = improved(output={"histories": wanted}, carriage={"car": mass(0.3, CROSSING | {"after": after})})
    too_cheap(monkeypatch, 2, 200)
    with monkeypatch.context() as local:
        local.setattr(improving, "ROUNDS", 0)
        once = run(given)
    found = run(given)
    assert np.all(found.modes_used.values > 2) and np.all(found.status.values == Status.OK)
    np.testing.assert_allclose(found.elapsed.values, once.elapsed.values, rtol=1e-9, atol=1e-12)
    held = np.isfinite(found.midspan.values)
    assert np.array_equal(held, np.isfinite(once.midspan.values)) and held.any(axis=1).all()
    largest = np.nanmax(found.midspan.values, axis=1)
    static = found.midspan_static.values
    assert np.all(largest <= found.midspan_max.values * (1.0 + 1e-12))
    assert np.all(found.midspan_max.values - largest <= 5e-3 * static)
    gap = np.nanmax(np.abs(found.midspan.values - once.midspan.values), axis=1)
    assert np.all(gap > 0.0) and np.all(gap <= once.error_estimate.values * static * 1.5)


def test_variants_that_hold_are_not_marched_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that misses, among some that hold, does not change these by a bit."""
    tolerances = {"tolerance": {"of": "solver.tolerance", "values": [0.3, 1e-3]}}
    too_cheap(monkeypatch, 2, 200)
    both = run(improved(sweep=tolerances))
    alone = run(improved(sweep={"tolerance": {"of": "solver.tolerance", "values": [0.3]}}))
    assert both.modes_used.values.tolist()[0] == 2 < both.modes_used.values.tolist()[1]
    for name in ("midspan_max", "midspan_rms", "error_estimate", "relative_cost", "steps_used"):
        assert both[name].values[0] == alone[name].values[0]


@pytest.mark.parametrize(("part", "again"), [(0.9, True), (0.75, True), (0.65, False)])
def test_what_holds_by_little_is_marched_again(part: float, again: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """An estimate of more than 0.7 of the tolerance may be of an error that misses it."""
    too_cheap(monkeypatch, 2, 200)
    with monkeypatch.context() as local:
        local.setattr(improving, "ROUNDS", 0)
        once = run(improved(sweep={}))
    tolerance = float(once.error_estimate) / part
    found = run(improved(sweep={}, solver={"tolerance": tolerance}))
    assert int(found.status) == Status.OK
    assert (float(found.relative_cost) > float(once.relative_cost)) == again
    assert float(found.error_estimate) < 0.7 * tolerance
    assert (float(found.midspan_max) != float(once.midspan_max)) == again


def test_a_tight_tolerance_is_worth_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """A force steps on where a spring holds: its high modes ring, undamped."""
    springs = [{"at": 0.1, "stiffness": 200.0}, {"at": 0.5, "stiffness": 300.0}, {"at": 0.9, "stiffness": 100.0}]
    bed = beam(modes="auto", supports=springs, damping_ratio=0.0)
    given = study(bed, force(1.0, CROSSING), solver={"tolerance": 1e-4, "audit": 0})
    found = run(given)
    assert int(found.status) == Status.OK and 100.0 < float(found.relative_cost) < 10.0 * 10.0**1.5
    monkeypatch.setattr(improving, "COST_ORDER", 0.0)
    cheap = run(given)
    assert int(cheap.status) == Status.TOLERANCE_MISSED and float(cheap.relative_cost) < 40.0
    for end in ("max", "min"):
        gap = abs(float(found[f"midspan_{end}"]) - float(cheap[f"midspan_{end}"])) / float(found.midspan_static)
        assert gap <= float(cheap.error_estimate) + 1e-4


def test_what_the_study_fixes_is_not_improved() -> None:
    """With fixed modes only steps are added, with fixed steps only modes, with both nothing."""
    rough = {"tolerance": 1e-4}
    modes = run(study(beam(modes=3, damping_ratio=0.02), mass(0.3, CROSSING), solver=rough))
    assert int(modes.modes_used) == 3 and float(modes.error_modes) > 1e-4 and int(modes.status) == Status.OK
    steps = run(study(OPEN, mass(0.3, CROSSING), solver=rough | {"steps": 800}))
    assert int(steps.steps_used) == 800
    both = run(study(beam(modes=3), mass(0.3, CROSSING), solver=rough | {"steps": 200}))
    assert (int(both.steps_used), int(both.modes_used), int(both.status)) == (200, 3, Status.OK)
    assert float(both.error_steps) > 1e-4


def errors(fidelity: float, modes: float, steps: float) -> Errors:
    return Errors(*(np.array([part]) for part in (fidelity, modes, steps)))


@pytest.mark.parametrize(
    ("parts", "status"),
    [
        ((2e-4, 3e-4, 4e-4), Status.OK),
        ((4e-4, 4e-4, 4e-4), Status.TOLERANCE_MISSED),
        ((np.nan, 0.0, 0.0), Status.UNRESOLVED),
        ((0.0, np.nan, 0.0), Status.UNRESOLVED),
        ((0.0, 0.0, np.nan), Status.UNRESOLVED),
        ((np.inf, 0.0, 0.0), Status.TOLERANCE_MISSED),
    ],
)
def test_status_by_errors(parts: tuple[float, float, float], status: Status) -> None:
    given = study(OPEN, mass(0.3, CROSSING))
    found = errors(*parts).status(given, LaneValues(given, {}, 1), ("bed",))
    assert found.tolist() == [status]


def test_without_sensors_nothing_is_estimated() -> None:
    found = run(study(OPEN, mass(0.3, CROSSING), sensor={}))
    assert int(found.status) == Status.UNRESOLVED and np.isnan(float(found.error_estimate))
    assert np.isfinite(float(found.car_contact_force_max))


def test_what_cannot_be_estimated_is_unresolved(monkeypatch: pytest.MonkeyPatch) -> None:
    """An estimate that is no number is never fine, whatever the variant is marched with; the values are kept."""
    monkeypatch.setattr("engine.estimates.Estimator._apart", lambda *_: np.full(_[0].variants.size, np.nan))
    found = run(improved())
    assert found.status.values.tolist() == [Status.UNRESOLVED] * 4
    assert np.all(np.isnan(found.error_estimate.values)) and np.all(np.isfinite(found.midspan_max.values))


@pytest.mark.parametrize("chunk", [1])
def test_improved_variants_do_not_depend_on_chunks(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    too_cheap(monkeypatch, 3, 200)
    given = improved(output={"histories": "all"})
    whole, parts = run(given, threads=1), run(given, threads=2, chunk=chunk)
    for name in ("midspan_max", "midspan", "error_estimate", "relative_cost", "modes_used", "steps_used", "status"):
        np.testing.assert_array_equal(whole[name].values, parts[name].values)


def test_a_model_that_turns_out_too_simple_gives_way_to_the_carriages_own() -> None:
    moving = oscillator(0.486, 923.56, cruise(-0.2, 0.8, 0.134)) | {"damping": 2.12}
    bed = beam(modes="auto", supports="clamped-free", damping_ratio=0.1)
    given = study(bed, {"car": moving, "two": moving | {"headway": 0.2}}, sensor={"mid": fixed(0.45)})
    (bucket,) = make_plan(given).buckets
    assert bucket.scene.fidelity is Fidelity.MASS
    found, truth = run(given), run(given.with_values({"solver.fidelity": "full", "body.bed.modes": 24}))
    assert found.fidelity_used.item() == Fidelity.TIED and found.status.item() == Status.OK
    assert found.error_fidelity.item() == 0.0
    for end in ("mid_max", "mid_min"):
        assert abs(found[end].item() - truth[end].item()) <= 1e-3 * truth.mid_static.item()


def test_nothing_is_improved_without_a_sensor() -> None:
    bare = run(study(OPEN, mass(0.3, CROSSING), sensor={}))
    read = run(study(OPEN, mass(0.3, CROSSING)))
    assert bare.status.item() == Status.UNRESOLVED and bare.relative_cost.item() < 2.0 * read.relative_cost.item()
