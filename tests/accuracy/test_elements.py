"""What the elements of frames leave is part of every told error, and makes no status."""

from typing import Any

import numpy as np
import pytest

import studies
from engine.accuracy.groups import ConvergingGroup
from engine.accuracy.results import results_of
from engine.batch.plan import Plan, make_plan
from engine.scene.study import Study
from results_schema.arrays import Array, Counts
from results_schema.status import Status
from studies.results.results import Results
from studies.runs.audit_findings import told_accuracy
from tests.accuracy.chosen import executed
from tests.accuracy.passages import axis, passages
from tests.calibration.elements import MATTERS, draw, errors_of
from tests.engine.build import fixed, study

SEED, TOLERANCE = 20261203, 1e-3
SCENES = {"bridge of two spans": 0, "gantry": 1, "jib": 2}
SPEED, LOAD = "carriage.car.motion.speed", "carriage.car.force"


def bridge(elements: int = 4, **changes: Any) -> Study:
    """A force over two spans of so many elements each."""
    girder = {"area": 1.0, "second_moment": 1.0, "youngs_modulus": 2.6e9, "density": 900.0}
    bed = {
        "kind": "frame",
        "plane": "xz",
        "node": {"west": [0.0, 0.0], "pier": [32.0, 0.0], "east": [56.0, 0.0]},
        "section": {"girder": girder},
        "member": {
            "long": {"nodes": ["west", "pier"], "section": "girder", "elements": elements},
            "short": {"nodes": ["pier", "east"], "section": "girder", "elements": elements},
        },
        "supports": {"west": "pinned", "pier": ["z"], "east": ["z"]},
        "track": {"members": ["long", "short"]},
        "damping_ratio": 0.005,
    }
    pier = {"body": "bed", "node": "pier", "quantity": "support_reaction", "tolerance": "told"}
    spot = {"body": "bed", "member": "long", "at": 13.0}
    sensors = {"midspan": fixed(16.0), "pier": pier, "spot": spot, "felt": fixed(16.0, "acceleration")}
    motion = {"kind": "cruise", "start": 0.0, "end": 56.0, "speed": 20.0, "after": 1.0}
    car = {"on": "bed", "kind": "force", "force": 3e4, "motion": motion}
    return study(bed | {"length": 56.0}, car, **({"body": {"bed": bed}, "sensor": sensors} | changes))


def of_what_matters(plan: Plan, variants: Counts) -> tuple[Array, Array]:
    """Told and true errors that are known well enough to be compared."""
    told, true, doubt = np.concatenate([errors for _, errors in errors_of(plan, variants)], axis=1)
    matter = (true > MATTERS) & (doubt < 0.3 * true)
    return told[matter], true[matter]


@pytest.mark.parametrize(
    ("scene", "last"),
    [
        ("gantry", 9),
        pytest.param("bridge of two spans", 9, marks=pytest.mark.slow),
        pytest.param("jib", 15, marks=pytest.mark.slow),  # of whose accelerations few are known well enough
    ],
)
def test_told_errors_of_frames_are_above_those_beside_many_elements(scene: str, last: int) -> None:
    plans = [make_plan(draw(SEED, number, 4, TOLERANCE)) for number in range(SCENES[scene], last, len(SCENES))]
    told, true = np.concatenate([of_what_matters(plan, np.arange(plan.size)) for plan in plans], axis=1)
    assert true.size > 15 and true.max() > 5.0 * TOLERANCE
    assert np.mean(told >= true) > 0.97 and np.median(told / true) < 3.0


def test_variants_between_pilots_are_told_it_too() -> None:
    sweep = {"speed": axis(SPEED, 5.0, 40.0, 20), "load": axis(LOAD, 1e4, 4e4, 15)}
    run = executed(bridge(sweep=sweep, solver={"tolerance": 2e-3}))
    others = np.setdiff1d(np.arange(run.plan.size), run.choice.pilots)[::29]
    told, true = of_what_matters(run.plan, others)
    assert true.size > 15 and true.max() > 5.0 * TOLERANCE
    assert np.mean(told >= true) > 0.97 and np.median(told / true) < 5.0
    assert (run.arrays["status"] == Status.OK).all()


def test_elements_make_no_status() -> None:
    """What a study fixes is told and misses nothing; with more of them the same study is told to be closer."""
    errors = []
    for elements in (3, 16):
        plan = make_plan(bridge(elements))
        (group,) = plan.groups
        found = group.found(plan.values(group, group.variants), group.variants, None, lambda: False)
        held = np.isfinite([result.tolerance for result in results_of(plan.asked)])
        errors.append(found.error[held].max())
        assert isinstance(group, ConvergingGroup) and found.held.max() <= 1.0
    assert errors[0] > 2.0 * TOLERANCE and errors[1] < TOLERANCE


def test_answers_say_so() -> None:
    """And what helps, where the study fixes nothing else."""
    fixes = bridge(3), bridge(3, solver={"steps": 400}), bridge(16)
    said = [told_accuracy(None, Results.of(studies.run(given))) for given in fixes]
    why = "errors by what a study fixes itself, as its model, modes, steps or elements, change no status"
    alone = "errors by the elements of frames change no status: more elements lessen them"
    assert f"where 1e-3 was asked ({alone})" in said[0] and f"where 1e-3 was asked ({why})" in said[1]
    assert "where 1e-3 was asked;" in said[2]


def test_bodies_without_elements_are_not_marched_again() -> None:
    for given, elements in ((passages(2, 2), {1}), (bridge(), {1, 2})):
        plan = make_plan(given)
        (group,) = plan.groups
        found = group.found(plan.values(group, group.variants), group.variants, None, lambda: False)
        held = np.isfinite([result.tolerance for result in results_of(plan.asked)])
        assert np.isfinite(found.error[held]).all()
        assert {numerics.elements for numerics in group.grid._models} == elements


def test_finer_bodies_are_read_at_the_same_places() -> None:
    """Statics of elements are exact, so that every gauge reads the same under every load."""
    model = make_plan(bridge()).base
    finer = make_plan(bridge()).grids[0].model(model.numerics._replace(elements=2))
    s = np.linspace(0.0, 56.0, 15)
    one, other = (part.bodies[0].modal for part in (model, finer))
    assert other.joints == one.joints and set(other.gauges) == set(one.gauges) == {"pier", "spot"}
    for place in (13.0, 16.0):
        at = np.full(15, place)
        np.testing.assert_allclose(other.influence_at(at, s), one.influence_at(at, s), rtol=1e-9, atol=1e-18)
