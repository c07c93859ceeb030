"""What a simpler model leaves out, evaluated on what it found: against marches of both models."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.bucket import Bucket
from engine.checking import can_be_marched
from engine.execution import run
from engine.plan import make_plan
from engine.scene import Study
from results_schema.status import Fidelity
from tests.engine.build import Table, beam, cruise, mass, oscillator, study

BED = beam(modes="auto", damping_ratio=0.05)
SPEEDS = {"speed": {"of": "carriage.car.motion.speed", "values": [0.05, 0.1, 0.2, 0.3]}}
CROSSING = cruise(0.0, 1.0, 0.2)


def only_bucket(given: Study) -> Bucket:
    (bucket,) = make_plan(given).buckets
    return bucket


def gaps(one: Study, other: Study) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(V,) difference of extremes of two studies, and of whole histories, over the static value."""
    found, again = (run(given.with_values({"output.histories": "all"})) for given in (one, other))
    static = found.midspan_static.values
    ends = [np.abs(found[name].values - again[name].values) for name in ("midspan_max", "midspan_min")]
    whole = np.abs(found.midspan.values - again.midspan.values).max(axis=1)
    return np.max(ends, axis=0) / static, whole / static


@pytest.mark.parametrize("model", ["force", "mass-without-convective"])
def test_a_fixed_model_knows_what_it_leaves_out(model: str) -> None:
    fixed = {"modes": 6}
    given = study(BED | fixed, mass(0.05, CROSSING), sweep=SPEEDS, solver={"fidelity": model, "steps": 1600})
    ends, whole = gaps(given, given.with_values({"solver.fidelity": "full"}))
    told = run(given).error_fidelity.values
    assert np.all(told >= 0.98 * ends) and np.all(told <= 1.02 * whole) and ends.max() > 1e-3


def test_a_chosen_model_knows_what_it_leaves_out() -> None:
    given = study(BED, mass(0.003, CROSSING), sweep=SPEEDS, solver={"tolerance": 3e-2})
    found = run(given)
    assert set(found.fidelity_used.values.tolist()) == {Fidelity.FORCE}
    finest = {"body.bed.modes": 12, "solver.steps": 3200}
    force, full = (given.with_values(finest | {"solver.fidelity": name}) for name in ("force", "full"))
    ends, whole = gaps(force, full)
    assert np.all(found.error_fidelity.values >= 0.9 * ends) and np.all(found.error_fidelity.values <= 2.0 * whole)
    for bucket in make_plan(given).buckets:
        lanes = bucket.variants
        assert np.all(found.error_fidelity.values[lanes] < bucket.told.error_fidelity)  # which is on the safe side


def test_the_own_model_is_compared_with_nothing() -> None:
    bucket = only_bucket(study(BED, mass(0.3, CROSSING), solver={"fidelity": "full"}))
    assert bucket.checks is not None and bucket.checks.model is None
    assert run(study(BED, mass(0.3, CROSSING), solver={"fidelity": "full"})).error_fidelity.item() == 0.0


@pytest.mark.parametrize(
    ("moving", "steps", "sound"),
    [
        (mass(0.05, CROSSING), 800, True),
        (mass(0.05, cruise(0.0, 1.0, 8.0)), 8, False),  # the alias rule of a mass
        (oscillator(0.05, 50.0, CROSSING), 800, True),
        (oscillator(0.05, 5e6, CROSSING), 800, False),  # a contact that swings faster
    ],
    ids=["mass", "fast mass", "soft spring", "stiff spring"],
)
def test_it_is_told_beforehand_where_the_own_model_would_want_more_steps(
    moving: Table, steps: int, sound: bool
) -> None:
    given = study(
        BED | {"modes": 6},
        moving,
        solver={"fidelity": "force" if "stiffness" not in moving else "mass", "steps": steps},
    )
    bucket = only_bucket(given)
    assert bucket.checks is not None and bucket.checks.model is not None
    compared = bucket.checks.model
    values = make_plan(given).values(bucket, np.zeros(1, dtype=np.int64))
    assert can_be_marched(compared.model, values, compared.steps).tolist() == [sound]
    told, found = bucket.told.error_fidelity[0], run(given).error_fidelity.item()
    assert np.isfinite(found) and (found != told) == sound


def test_work_of_the_comparison_is_paid_for() -> None:
    given = study(BED | {"modes": 6}, mass(0.05, CROSSING), solver={"fidelity": "force", "steps": 800})
    with_model = only_bucket(given)
    assert with_model.checks is not None
    without = with_model.checks._replace(model=None)
    assert with_model.checks.cost(with_model.tables) == without.cost(with_model.tables) + 0.5
