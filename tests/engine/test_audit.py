"""Which variants an audit takes, and with how many modes and steps it marches them again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engine.audit import audit_plan, audit_seconds, audited, in_full, spread_quasi_randomly, suggested_size
from engine.plan import make_plan
from engine.scene import Study
from engine.sweep import Cases, expand
from results_schema.status import Fidelity
from tests.engine.build import beam, cruise, fixed, force, mass, oscillator, shuttle, study
from tests.engine.test_unreduced import frame

CROSSING = cruise(0.0, 1.0, 0.3)
SPEEDS = {"speed": {"of": "carriage.car.motion.speed", "from": 0.1, "to": 1.0, "count": 40}}


def cases(*shape: int) -> Cases:
    return Cases(tuple("abcdefg"[: len(shape)]), shape, ())


def grown(bed: dict[str, Any], **changes: Any) -> Study:
    """The study that audits a scene on some bed."""
    return in_full(make_plan(study(bed, mass(0.2, CROSSING), **changes)).base)


def test_variants_are_spread_over_every_axis() -> None:
    picked = spread_quasi_randomly(cases(64, 64), 64)
    rows, columns = np.unravel_index(picked, (64, 64))
    for halves in (rows // 32, columns // 32, 2 * (rows // 32) + columns // 32):
        counts = np.bincount(halves)
        assert counts.min() >= 0.8 * 64 / counts.size
    assert len(np.unique(rows)) > 50 and len(np.unique(columns)) > 50


@pytest.mark.parametrize(("shape", "count"), [((7,), 7), ((7,), 9), ((), 1), ((5, 3), 14), ((5, 3), 0), ((1, 1, 9), 4)])
def test_variants_are_distinct_and_as_many_as_wanted(shape: tuple[int, ...], count: int) -> None:
    size = int(np.prod(shape))
    picked = spread_quasi_randomly(cases(*shape), count)
    assert picked.size == min(size, count) and np.all(np.diff(picked) > 0)
    assert picked.size == 0 or (picked.min() >= 0 and picked.max() < size)


def test_the_choice_is_the_studys_alone() -> None:
    sixteen = study(beam(), mass(0.2, CROSSING), sweep=SPEEDS, solver={"audit": 16})
    first, again = (audited(make_plan(sixteen)) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert first.size == 16 and set(audited(make_plan(sixteen.with_values({"solver.audit": 8})))) < set(first)
    for none in (0, "auto"):
        assert audited(make_plan(sixteen.with_values({"solver.audit": none}))).size == 0


def test_all_terms_and_twice_the_modes() -> None:
    poor = {"fidelity": "force", "steps": 100, "static_correction": False}
    full = grown(beam(modes=4), solver=poor)
    assert full.solver.fidelity == "auto" and full.solver.static_correction and full.body["bed"].modes == 8
    assert grown(beam(modes="auto")).body["bed"].modes == 24
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
    counts = [audit_plan(plan, np.arange(1)).buckets[0].scene.body_modes for plan in plans]
    assert counts == [12, 3 * 17 - 3]


def test_four_times_the_steps_or_more() -> None:
    plan = make_plan(study(beam(), mass(0.2, CROSSING), sweep=SPEEDS, solver={"steps": 1500}))
    found = audit_plan(plan, np.array([0, 7, 39]))
    assert [bucket.steps for bucket in found.buckets] == [6000]
    assert sorted(np.concatenate([bucket.variants for bucket in found.buckets])) == [0, 7, 39]
    automatic = make_plan(study(beam(), mass(0.2, CROSSING), sweep=SPEEDS))
    steps = {int(v): bucket.steps for bucket in automatic.buckets for v in bucket.variants}
    for bucket in audit_plan(automatic, np.arange(0, 40, 2)).buckets:
        assert bucket.variants.size <= 16
        assert all(bucket.steps >= 4 * steps[int(v)] for v in bucket.variants)


def test_few_fixed_steps_do_not_let_the_audit_ring() -> None:
    """With twice the modes a march takes no fewer steps than it would choose by itself."""
    few = make_plan(study(beam(), force(1.0, CROSSING), solver={"steps": 20}))
    chosen = make_plan(study(beam(modes=8), force(1.0, CROSSING)))
    assert audit_plan(few, np.arange(1)).buckets[0].steps == chosen.buckets[0].steps > 80


def test_free_vibration_has_four_times_the_steps_too() -> None:
    plan = make_plan(study(beam(), mass(0.2, cruise(0.0, 1.0, 3.0, after=2.0))))
    one, other = (p.buckets[0].tables.timeline.segments for p in (plan, audit_plan(plan, np.arange(1))))
    free = [sum(segment.steps for segment in segments if segment.free) for segments in (one, other)]
    assert free[0] > 0 and free[1] >= 4 * free[0]


def test_statics_are_marched() -> None:
    static = make_plan(study(beam(), oscillator(0.2, 30.0, CROSSING), solver={"fidelity": "static"}))
    found = audit_plan(static, np.arange(1)).buckets[0]
    assert found.scene.fidelity is Fidelity.TIED and found.steps >= 800


def test_swept_modes_and_steps_are_exceeded_too() -> None:
    swept = {
        "modes": {"of": "body.bed.modes", "values": [2, 6]},
        "steps": {"of": "solver.steps", "values": [1000, 3000]},
    }
    plan = make_plan(study(beam(), mass(0.2, CROSSING), sweep=swept))
    found = audit_plan(plan, np.arange(4))
    assert {(bucket.scene.body_modes, bucket.steps) for bucket in found.buckets} == {(4, 12000), (12, 12000)}


def test_envelopes_are_not_marched_again() -> None:
    watched = study(beam(), mass(0.2, CROSSING), envelope={"line": {"body": "bed", "quantity": "displacement"}})
    found = audit_plan(make_plan(watched), np.arange(1))
    assert found.buckets[0].envelopes == () and not found.study.envelope


def test_too_many_steps_are_refused() -> None:
    from results_schema.errors import BadInput

    plan = make_plan(study(beam(), mass(0.2, CROSSING), solver={"steps": 50_000_000}))
    with pytest.raises(BadInput, match="too many steps"):
        audit_plan(plan, np.arange(1))


def test_the_suggested_size_is_a_hundredth_within_its_time() -> None:
    def plan_of(count: int, motion: dict[str, Any]) -> Any:
        masses = {"mass": {"of": "carriage.car.mass", "from": 0.1, "to": 0.5, "count": count}}
        return make_plan(study(beam(), mass(0.2, motion), sweep=masses))

    sizes = [suggested_size(plan_of(count, cruise(0.0, 1.0, 1.0))) for count in (3, 100, 4000, 100_000)]
    assert sizes == [3, 16, 40, 256]
    long = plan_of(40, shuttle(0.2, 0.8, 0.005, 0.1, 60))
    few = suggested_size(long)
    allowed = max(2.0, 0.3 * long.total_seconds(1))
    assert few < 16 and audit_seconds(audit_plan(long, spread_quasi_randomly(long.cases, 16))) > allowed
    assert few == 0 or audit_seconds(audit_plan(long, spread_quasi_randomly(long.cases, few))) <= allowed
    assert expand(long.study).size == 40
