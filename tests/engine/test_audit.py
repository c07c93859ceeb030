"""Which variants an audit takes, and with how many modes and steps it marches them again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.audit import (
    Sample,
    Used,
    audit_plan,
    audit_seconds,
    expected,
    in_full,
    sampled,
    spread_quasi_randomly,
)
from engine.bucket import Bucket
from engine.plan import Plan, make_plan
from engine.scene import Study
from engine.sweep import Cases
from results_schema.errors import BadInput
from results_schema.status import Fidelity, SchemeUsed
from tests.engine.build import beam, cruise, fixed, force, mass, oscillator, shuttle, study
from tests.engine.test_unreduced import frame

CROSSING = cruise(0.0, 1.0, 0.3)
SPEEDS = {"speed": {"of": "carriage.car.motion.speed", "from": 0.1, "to": 1.0, "count": 40}}


def cases(*shape: int) -> Cases:
    return Cases(tuple("abcdefg"[: len(shape)]), shape, ())


def grown(bed: dict[str, Any], **changes: Any) -> Study:
    """The study that audits a scene on some bed."""
    return in_full(make_plan(study(bed, mass(0.2, CROSSING), **changes)).base, 7)


def by_average(modes: NDArray[np.int64], steps: NDArray[np.int64]) -> Used:
    """What variants were marched with by average acceleration."""
    return Used(modes, steps, np.full(modes.size, SchemeUsed.AVERAGE_ACCELERATION))


def again(plan: Plan, variants: Any, used: Used | None = None) -> tuple[Bucket, ...]:
    """What marches some variants again, however long that takes."""
    found = audit_plan(plan, Sample(np.asarray(variants), np.inf), used or expected(plan))
    return () if found is None else found.buckets


def test_variants_are_spread_over_every_axis() -> None:
    picked = spread_quasi_randomly(cases(64, 64), 64)
    spread(picked)
    spread(spread_quasi_randomly(cases(64, 64), 256)[:64])  # and so are the first of more


def spread(picked: Any) -> None:
    rows, columns = np.unravel_index(picked, (64, 64))
    for halves in (rows // 32, columns // 32, 2 * (rows // 32) + columns // 32):
        counts = np.bincount(halves)
        assert counts.min() >= 0.8 * 64 / counts.size
    assert len(np.unique(rows)) > 38 and len(np.unique(columns)) > 38


@pytest.mark.parametrize(("shape", "count"), [((7,), 7), ((7,), 9), ((), 1), ((5, 3), 14), ((5, 3), 0), ((1, 1, 9), 4)])
def test_variants_are_distinct_and_as_many_as_wanted(shape: tuple[int, ...], count: int) -> None:
    size = int(np.prod(shape))
    picked = spread_quasi_randomly(cases(*shape), count)
    assert picked.size == min(size, count) == np.unique(picked).size
    assert picked.size == 0 or (picked.min() >= 0 and picked.max() < size)


def test_the_choice_is_the_studys_alone() -> None:
    sixteen = study(beam(), mass(0.2, CROSSING), sweep=SPEEDS, solver={"audit": 16})
    first, more = (sampled(make_plan(sixteen)).variants for _ in range(2))
    np.testing.assert_array_equal(first, more)
    fewer = sampled(make_plan(sixteen.with_values({"solver.audit": 8}))).variants
    assert first.size == 16 and set(fewer) < set(first)
    assert sampled(make_plan(sixteen.with_values({"solver.audit": 0}))).variants.size == 0


def test_all_terms_and_twice_the_modes() -> None:
    poor = {"fidelity": "force", "steps": 100, "static_correction": False}
    full = grown(beam(modes=4), solver=poor)
    assert full.solver.fidelity == "full" and full.solver.static_correction and full.body["bed"].modes == 8
    assert grown(beam(modes="auto")).body["bed"].modes == 14
    assert grown(beam(modes=40)).body["bed"].modes == 64


def test_further_modes_have_the_last_ratio() -> None:
    found = grown(beam(modes=2, damping_ratio=[0.01, 0.03])).body["bed"]
    assert found.modes == 4 and found.damping_ratio[:4] == (0.01, 0.03, 0.03, 0.03)


def test_a_frame_gives_what_it_has() -> None:
    """16 elements in a plane: fewer than 64 degrees of freedom, and no more modes."""
    plans = []
    for modes in (6, 40):
        tables = {"schema_version": 1, "kind": "passage", "sensor": {"middle": fixed(0.5)}}
        car = {"car": mass(0.1, cruise(0.1, 0.9, 0.3))}
        plans.append(make_plan(Study(body={"bed": frame(16, modes=modes)}, carriage=car, **tables)))
    counts = [again(plan, [0])[0].scene.body_modes for plan in plans]
    assert counts == [12, 3 * 17 - 3]


def test_twice_the_modes_and_four_times_the_steps_that_were_used() -> None:
    """Of every variant, also where it was improved during the run."""
    plan = make_plan(study(beam(modes="auto"), mass(0.2, CROSSING), sweep=SPEEDS))
    used = by_average(np.full(40, 3), np.full(40, 500))
    used.modes[7], used.steps[7] = 16, 3000
    found = again(plan, np.arange(0, 40, 7), used)
    assert sorted(np.concatenate([bucket.variants for bucket in found])) == [0, 7, 14, 21, 28, 35]
    for bucket in found:
        for variant in bucket.variants:
            assert bucket.scene.body_modes >= 2 * used.modes[variant] and bucket.steps >= 4 * used.steps[variant]
    assert [(bucket.scene.body_modes, bucket.steps) for bucket in found] == [(32, 12000)]
    (alone,) = again(plan, [0], used)
    assert (alone.scene.body_modes, alone.steps) == (6, 2000)


def test_tables_are_shared_by_steps_of_one_size() -> None:
    plan = make_plan(study(beam(modes="auto"), mass(0.2, CROSSING), sweep=SPEEDS))
    used = by_average(np.full(40, 3), np.where(np.arange(40) < 20, 10_000, 1000))
    assert [bucket.steps for bucket in again(plan, np.arange(40), used)] == [40_000, 4000]
    used = by_average(np.full(40, 3), np.linspace(8000, 2000, 40).astype(np.int64))
    assert [bucket.steps for bucket in again(plan, np.arange(40), used)] == [32_000]
    many = masses(600, CROSSING)
    used = by_average(np.full(600, 3), np.linspace(8000, 2000, 600).astype(np.int64))
    assert 1 < len(again(many, np.arange(600), used)) <= 3


def test_few_fixed_steps_do_not_let_the_audit_ring() -> None:
    """Twenty steps of a passage of 5.2 first periods: four times as many would show no mode."""
    few = make_plan(study(beam(), force(1.0, CROSSING), solver={"steps": 20}))
    periods = few.buckets[0].scene.first_omega / 0.3 / (2.0 * np.pi)
    assert again(few, [0])[0].steps >= 200 * periods > 1000


def test_a_simpler_model_is_compared_with_steps_that_its_mass_needs() -> None:
    """Four times the steps of a force break the alias rule of twice the modes under the mass."""
    fast = study(beam(modes=32), mass(0.2, cruise(0.0, 1.0, 2.0)), solver={"fidelity": "force"})
    (found,) = again(make_plan(fast), [0], by_average(np.array([32]), np.array([20])))
    wave, omega, step = 64 * np.pi * 2.0, (64 * np.pi) ** 2, 0.5 / found.steps
    assert found.scene.fidelity is Fidelity.MASS and found.scene.body_modes == 64
    assert wave * step < 2.0 * np.arctan(2.0 / (omega * step))


def test_free_vibration_has_four_times_the_steps_too() -> None:
    plan = make_plan(study(beam(), mass(0.2, cruise(0.0, 1.0, 3.0, after=2.0))))
    free = [
        sum(segment.steps for segment in bucket.tables.timeline.segments if segment.free)
        for bucket in (plan.buckets[0], again(plan, [0])[0])
    ]
    assert free[0] > 0 and free[1] >= 4 * free[0]


def test_statics_are_marched() -> None:
    static = make_plan(study(beam(modes="auto"), oscillator(0.2, 30.0, CROSSING), solver={"fidelity": "static"}))
    (found,) = again(static, [0])
    assert found.scene.fidelity is Fidelity.TIED and found.steps >= 800 and found.scene.body_modes == 6


def test_swept_modes_and_steps_are_exceeded_too() -> None:
    swept = {
        "modes": {"of": "body.bed.modes", "values": [2, 6]},
        "steps": {"of": "solver.steps", "values": [1000, 3000]},
    }
    plan = make_plan(study(beam(), mass(0.2, CROSSING), sweep=swept))
    found = again(plan, np.arange(4))
    assert {(bucket.scene.body_modes, bucket.steps) for bucket in found} == {(4, 12000), (12, 12000)}


def test_envelopes_are_not_marched_again() -> None:
    watched = study(beam(), mass(0.2, CROSSING), envelope={"line": {"body": "bed", "quantity": "displacement"}})
    plan = make_plan(watched)
    found = audit_plan(plan, Sample(np.arange(1), np.inf), expected(plan))
    assert found is not None and found.buckets[0].envelopes == () and not found.study.envelope


def test_too_many_steps_are_refused_before_the_march() -> None:
    given = study(beam(), mass(0.2, CROSSING), solver={"steps": 50_000_000, "audit": 1})
    with pytest.raises(BadInput, match="too many steps"):
        sampled(make_plan(given))
    plan = make_plan(given.with_values({"solver.audit": "auto"}))
    assert audit_seconds(plan, sampled(plan))[0] == 0


def masses(count: int, motion: dict[str, Any]) -> Plan:
    swept = {"mass": {"of": "carriage.car.mass", "from": 0.1, "to": 0.5, "count": count}}
    return make_plan(study(beam(), mass(0.2, motion), sweep=swept))


def test_a_hundredth_is_audited() -> None:
    plans = [masses(count, cruise(0.0, 1.0, 1.0)) for count in (3, 100, 4000, 100_000)]
    assert [sampled(plan).variants.size for plan in plans] == [3, 16, 40, 256]
    assert audit_seconds(plans[1], sampled(plans[1]))[0] == 16
    assert all(sampled(plan).seconds == max(2.0, 0.3 * plan.total_seconds(1)) for plan in plans)


def test_half_as_many_until_that_takes_no_longer_than_it_may() -> None:
    plan = masses(40, shuttle(0.2, 0.8, 0.3, 0.1, 4))
    sample = sampled(plan)
    whole = audit_seconds(plan, sample._replace(seconds=np.inf))
    assert whole[0] == 16
    sizes = [audit_seconds(plan, sample._replace(seconds=part * whole[1])) for part in (1.0, 0.9, 0.5, 1e-6)]
    assert sizes[0] == whole and all(size < 16 for size, _ in sizes[1:]) and sizes[-1] == (0, 0)
    more = by_average(np.full(40, 6), np.full(40, 10_000_000))
    assert audit_plan(plan, sample, more) is None
