"""Masses that outrun the waves of the modes that are kept, and passages that are short beside what swings then."""

import numpy as np
import pytest

import studies
from engine.batch.plan import make_plan
from engine.march.step_rules import pace_of_waves
from engine.scene.study import Study
from results_schema.status import Status
from tests.engine.build import beam, cruise, fixed, force, mass, study

CRITICAL = np.pi  # m/s, of a beam of length, stiffness and mass 1


def passing(times: float, kilograms: float = 0.5) -> Study:
    motion = cruise(0.0, 1.0, times * CRITICAL) | {"after": 2.0}
    carriage = mass(kilograms, motion) if kilograms else force(1.0, motion)
    bed = {key: value for key, value in beam(damping_ratio=0.01).items() if key != "modes"}
    return study(bed, carriage, sensor={"midspan": fixed(0.5)})


def test_of_a_beam_it_is_speed_over_critical_speed_and_number_of_modes() -> None:
    (grid,) = make_plan(passing(8.0)).grids
    model = grid.model(grid.scene.numerics._replace(modes=16))
    assert pace_of_waves(model, grid.values) == pytest.approx([8.0 / 16.0])


def test_where_all_modes_are_outrun_no_estimate_exists() -> None:
    """At 320 times the critical speed 16 modes were told to be right to 9e-5 of statics, and were 3e-3 off."""
    found = studies.run(passing(320.0))
    assert int(found.status) == Status.UNRESOLVED
    assert np.isnan(found.estimated_error.sel(result="midspan_max")) and np.isfinite(found.midspan_max)
    slower = studies.run(passing(4.0))
    assert int(slower.status) != Status.UNRESOLVED
    assert float(slower.estimated_error.sel(result="midspan_max")) < 1e-2
    assert int(studies.run(passing(320.0, 0.0)).status) == Status.OK  # no waves run with a force


@pytest.mark.parametrize(("times", "most"), [(1.0, 400), (3e4, 2048)])
def test_free_vibration_after_a_short_passage_is_cut_no_finer_than_it_swings(times: float, most: int) -> None:
    """As finely as the passage it took minutes."""
    (grid,) = make_plan(passing(times)).grids
    assert 8 <= grid.grid.free / grid.grid.free_periods <= most
