"""Audits of kinds that are computed in pieces: robots on rails, frames that move."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.scene.study import Study
from results_schema.store.archive import open_archive
from studies.reporting.summary import exit_code
from studies.results.results import Results
from studies.runs.audit import GROUP, Verdict, told_accuracy, told_audit
from tests.floating.scenes import sliding_mass
from tests.robots.scenes import scene
from tests.studies.audits import group_of, outcome

LOADS = {"mass": {"of": "carriage.load.mass", "values": [50.0, 100.0]}}
PAYLOADS = {"payload": {"of": "robot.portal.payload_scale", "values": [0.0, 1.0, 2.0]}}


def sliding(**solver: Any) -> Study:
    """A mass that slides on a beam."""
    more = {"kind": "sliding-mass", "question": {"duration": 2.0}, "sweep": LOADS, "solver": solver}
    return Study(**{key: value for key, value in (sliding_mass().data | more).items() if key != "schema_version"})


def moving(**solver: Any) -> Study:
    """A gantry that carries more or less."""
    return scene(sweep=PAYLOADS, solver=solver, question={"duration": 2.0})


@pytest.mark.parametrize("study", [sliding, moving])
def test_what_holds_is_said_to_hold(study: Any, tmp_path: Path) -> None:
    found = outcome(study(audit=2, tolerance=1e-2), tmp_path)
    group, verdict = group_of(found), Verdict.of(group_of(found))
    assert verdict.held and verdict.count == 2 and exit_code(found) == 0
    known = np.isfinite(group["observed_error"].values) & np.isfinite(group["estimated_error"].values)
    assert known.any() and (group["observed_error"].values[known] <= group["estimated_error"].values[known]).all()
    assert "audit of 2 variants found at most" in told_audit(found.audit, Results.of(found.results))[0]
    # both fix the modes of their bodies, which stay as they are
    said = told_accuracy(found.audit, Results.of(found.results))
    assert "with more steps (modes of " in said and "more of everything" not in said
    archived = open_archive(tmp_path / "found.nc").groups[GROUP]
    np.testing.assert_array_equal(archived["observed_error"].values, group["observed_error"].values)


def test_steps_that_are_too_long_are_found_out(tmp_path: Path) -> None:
    found = outcome(moving(audit=3, steps=60, tolerance=1e-3), tmp_path)
    verdict = Verdict.of(group_of(found))
    assert verdict.worst > 1.0 or (verdict.marked == 3 and verdict.marked_worst > 1.0)
