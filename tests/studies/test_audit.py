"""Audits of runs: what they find, their group in the archive, going on after an interruption."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from results_schema.archive import open_archive
from results_schema.errors import BadInput
from results_schema.validate import validate
from studies.actions import exit_code
from studies.audit import (
    GROUP,
    Verdict,
    refuse_audit,
    told_audit,
)
from studies.results import Results
from tests.engine.build import beam
from tests.studies.audits import FINE, POOR, RICH, crossing, group_of, outcome


def test_few_modes_and_steps_are_found_out(tmp_path: Path) -> None:
    found = outcome(crossing(POOR, {"audit": 4, "steps": 40, "static_correction": False}), tmp_path)
    verdict = Verdict.of(group_of(found))
    assert verdict.count == 4 and verdict.missed == 4 and verdict.worst > 5e-3
    assert exit_code(found) == 3
    told = told_audit(found.audit, Results.of(found.results))
    assert told[-1] == "the tolerance was not held: 4 of 4 variants missed it"


def test_plenty_holds(tmp_path: Path) -> None:
    found = outcome(crossing(RICH, FINE), tmp_path)
    verdict = Verdict.of(group_of(found))
    assert verdict.held and 0.0 < verdict.worst < 2e-3 and exit_code(found) == 0
    (told,) = told_audit(found.audit, Results.of(found.results))
    sample = group_of(found).isel(sample=verdict.place)
    at = f"speed {float(sample['speed']):g} m/s, mass {float(sample['mass']):g} kg"
    assert told.startswith("asked 2e-3, audit of 3 variants found at most ") and f"worst at {at} (midspan_m" in told


def test_the_group_is_as_declared_and_the_same_however_it_was_run(tmp_path: Path) -> None:
    first = outcome(crossing(RICH, FINE), tmp_path)
    group = open_archive(first.archive).groups[GROUP]
    validate(group, GROUP, {}, ())
    assert {"speed", "mass", "sample"} == set(group.coords) and int(group["left_out"]) == 0
    flat = np.ravel_multi_index((np.searchsorted([0.2, 0.5, 0.9], group["speed"]), group["mass"] > 0.2), (3, 2))
    np.testing.assert_array_equal(group["sample"].values, flat)
    (tmp_path / "other").mkdir()
    xr.testing.assert_identical(group_of(outcome(crossing(RICH, FINE), tmp_path / "other", threads=2)), group_of(first))
    finished = outcome(crossing(RICH, FINE), tmp_path)
    assert finished.was_finished and exit_code(finished) == 0
    xr.testing.assert_identical(group_of(finished), group)


def test_it_goes_on_to_the_same_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped after the march, before the audit."""
    whole = group_of(outcome(crossing(RICH, FINE), tmp_path))

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    (tmp_path / "again").mkdir()
    with monkeypatch.context() as patched:
        patched.setattr("studies.runner.audit_group", stopped)
        with pytest.raises(KeyboardInterrupt):
            outcome(crossing(RICH, FINE), tmp_path / "again")
    resumed = outcome(crossing(RICH, FINE), tmp_path / "again")
    assert resumed.resumed == 6
    xr.testing.assert_identical(group_of(resumed), whole)


def test_it_is_on_by_default_and_has_more_than_what_was_used(tmp_path: Path) -> None:
    """Every variant with twice the modes and four times the steps that the archive says it took."""
    given = crossing(beam(modes="auto", damping_ratio=0.02), {"tolerance": 1e-2})
    found = outcome(given, tmp_path)
    group, flat = group_of(found), group_of(found)["sample"].values
    assert sorted(flat) == list(range(6))
    used = {name: found.results[name].values.reshape(-1)[flat] for name in ("modes_used", "steps_used", "status")}
    assert (group["modes_used"] >= 2 * used["modes_used"]).all()
    assert (group["steps_used"] >= 4 * used["steps_used"]).all()
    np.testing.assert_array_equal(group["variant_status"], used["status"])
    assert Verdict.of(group).held and Verdict.of(group).worst < 1e-2
    estimates = found.results["error_estimate"].values.reshape(-1)[flat]
    np.testing.assert_array_equal(group["estimated_error"], estimates)


def test_every_variant_has_its_tolerance(tmp_path: Path) -> None:
    swept = {"tolerance": {"of": "solver.tolerance", "values": [1e-9, 0.5]}}
    found = outcome(crossing(RICH, {"audit": 2, "steps": 2000}, sweep=swept), tmp_path)
    verdict = Verdict.of(group_of(found))
    np.testing.assert_array_equal(group_of(found)["tolerance_asked"].values, [1e-9, 0.5])
    assert (verdict.missed, verdict.place, verdict.asked) == (1, 0, 1e-9)


def test_estimates_stand_beside(tmp_path: Path) -> None:
    pairs = outcome(crossing(beam(modes=4), {"audit": 2, "scheme": "richardson", "steps": 10_000}), tmp_path)
    estimated = group_of(pairs)["estimated_error"].values
    own = pairs.results["error_estimate"].values.reshape(-1)[group_of(pairs)["sample"].values]
    np.testing.assert_array_equal(estimated, own)
    assert np.isfinite(estimated).all()


def test_what_marches_nothing_refuses_it() -> None:
    given = crossing(RICH, {"audit": 3}).without_sweep().with_values({"kind": "influence"})
    with pytest.raises(BadInput, match=r"solver\.audit"):
        refuse_audit(given)
    refuse_audit(given.with_values({"solver.audit": "auto"}))
