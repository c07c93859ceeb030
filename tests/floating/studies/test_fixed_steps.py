"""Steps that a study of moving frames fixes."""

import pytest

import studies
from results_schema.status import Status
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
