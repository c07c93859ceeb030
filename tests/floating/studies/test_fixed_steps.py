"""Steps that a study of moving frames fixes, and those of which no others tell the error."""

import numpy as np
import pytest

import studies
from results_schema.status import Status
from tests.floating.studies.scenes import driven
from tests.kinds.test_moving_frames import paper


@pytest.mark.parametrize("steps", [500, 1001])
def test_fixed_steps_are_told_of(steps: int) -> None:
    """Whatever their number, histories go on to the end, and twice as many steps tell the error."""
    found = studies.run(paper(2.0, solver={"steps": steps}, sweep={}))
    assert found["steps_used"] == 2 * steps
    assert float(found["elapsed"].max()) == pytest.approx(2.0, rel=2e-3)
    assert 0.0 < found["estimated_error"].sel(result="load_position_max") < 1e-2


def test_fixed_steps_make_no_status() -> None:
    """Their error is told, whatever it is: what a study fixes is its own affair."""
    found = studies.run(paper(2.0, solver={"steps": 40, "tolerance": 1e-5}, sweep={}))
    assert float(found["error_estimate"]) > 1e-3 and found["status"] == Status.OK


@pytest.mark.slow
def test_what_nobody_could_estimate_is_unresolved_though_nothing_is_held() -> None:
    """An arm without joints, so stiff that twice the steps of its only march are more than any may take."""
    stiff, told = {"modes": 1, "youngs_modulus": 7e20}, {"tip": {"body": "arm", "at": 10.0, "tolerance": "told"}}
    given = driven({"start": 1.0, "end": 1.01, "speed": 0.1}, stiff, joints=(), sensor=told, question={"duration": 1.5})
    found = studies.run(given)
    assert np.isnan(found.estimated_error).all() and np.isfinite(found.tip_max)
    assert found.status == Status.UNRESOLVED
