"""Sweeps of a motion's limits, each value of which makes a scene of its own."""

import numpy as np

from engine.accuracy.choice import MOST_SCENES, pilots_of
from engine.accuracy.results import results_of
from engine.batch.audit import audit
from engine.batch.plan import FEW_SCENES, make_plan
from engine.scene.study import Study
from tests.accuracy.chosen import chosen_plan
from tests.engine.build import Table, beam, fixed, mass, study, under

TOLERANCE, JUDGED = 1e-2, 12
CAR = "carriage.car"


def swept(count: int, **axes: Table) -> Study:
    """A beam on which a mass moves to and stops at accelerations between two limits."""
    move = {"kind": "point-to-point", "start": 0.1, "end": 0.9, "speed": 2.0, "acceleration": 1.0, "dwell": 1.0}
    return study(
        beam(modes="auto", damping_ratio=0.01),
        mass(0.3, move),
        sensor={"midspan": fixed(0.5), "tool": under("car")},
        output={"residual": True},
        solver={"tolerance": TOLERANCE},
        sweep={"acceleration": {"of": f"{CAR}.motion.acceleration", "from": 2.0, "to": 20.0, "count": count}} | axes,
    )


def test_many_scenes_of_one_variant_are_chosen_for_by_a_few() -> None:
    """None of the variants is beyond its tolerance, few of their errors are told too small, and they take far less than
    the pilots' references."""
    assert make_plan(swept(FEW_SCENES)).converges
    plan = chosen_plan(swept(FEW_SCENES + 8))
    assert not plan.converges and plan.choice is not None and len(plan.grids) == plan.size
    assert plan.choice.pilots.size == pilots_of(plan.cases, plan.members).size == MOST_SCENES
    judged = np.setdiff1d(np.arange(plan.size), plan.choice.pilots)[:: plan.size // JUDGED]
    found = audit(plan, judged)
    held = np.isfinite([result.tolerance for result in results_of(plan.asked)])
    observed, told = found.observed[held], found.told[held]
    assert found.variants.size >= JUDGED - 2
    assert 1e-4 < observed.max() < TOLERANCE
    matters = observed > 0.01 * TOLERANCE
    assert matters.sum() > 20 and np.mean(told[matters] < observed[matters]) < 0.03
    work = np.mean([group.work for group in plan.groups])
    assert work < 0.1 * plan.choice.measured.spent.mean()


def test_scenes_of_a_few_variants_have_more_of_the_pilots() -> None:
    """All variants of their scenes are pilots."""
    masses = {"weight": {"of": f"{CAR}.mass", "values": [0.1, 0.2]}}
    plan = make_plan(swept(FEW_SCENES + 1, **masses))
    drawn = pilots_of(plan.cases, plan.members)
    of = [int(np.isin(members, drawn).sum()) for members in plan.members]
    assert drawn.size == 2 * MOST_SCENES and sorted(set(of)) == [0, 2]
