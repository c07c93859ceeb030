"""What is told of audits: verdicts, sentences, exit codes, the command's output and the report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import studies
from engine.plan import make_plan
from results_schema.archive import open_archive
from results_schema.status import Status
from studies.actions import exit_code
from studies.audit import (
    GROUP,
    NONE_AUDITED,
    Again,
    Verdict,
    as_json,
    audit_group,
    planned_audit,
    told_audit,
)
from studies.cli import main
from studies.measuring import Work
from studies.preview import preview
from studies.report import write_report
from studies.results import Results
from tests.engine.build import beam, cruise, mass, study
from tests.studies.audits import FINE, RICH, crossing, group_of, outcome
from tests.studies.small import SMALL, write


def test_variants_without_values_are_left_out_and_counted() -> None:
    plan = make_plan(crossing(RICH, FINE | {"audit": 4, "steps": 2000}))
    dataset, sample = studies.run(plan.study), planned_audit(plan)
    whole = audit_group(plan, sample, dataset, Work(1))[GROUP]
    status = dataset["status"].copy()
    status.values.reshape(-1)[int(whole["sample"][1])] = Status.DIVERGED
    less = audit_group(plan, sample, dataset.assign(status=status), Work(1))[GROUP]
    assert int(less["left_out"]) == 1
    xr.testing.assert_identical(less["observed_error"], whole["observed_error"].isel(sample=[0, 2, 3]))
    told = told_audit(less, Results.of(dataset))
    assert told[-1] == "1 further variant picked for the audit had no values"
    assert audit_group(plan, sample, dataset.assign(status=xr.full_like(status, Status.DIVERGED)), Work(1)) == {}
    assert audit_group(plan, None, dataset, Work(1)) == {} and told_audit(None, Results.of(dataset)) == []


def test_an_audit_that_diverges_has_not_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add = Again.add

    def diverged(self: Again, variants: Any, arrays: Any, selected: object) -> None:
        add(self, variants, arrays | {"status": np.full(variants.size, Status.DIVERGED, dtype=np.int8)}, selected)

    monkeypatch.setattr(Again, "add", diverged)
    found = outcome(crossing(RICH, FINE), tmp_path)
    assert np.isnan(group_of(found)["observed_error"].values).all() and exit_code(found) == 3
    told = told_audit(found.audit, Results.of(found.results))
    assert told == [
        "asked 2e-3, audit of 3 variants found no number to compare",
        "3 variants could not be compared, which counts as not held",
    ]
    assert write_report(found.archive, tmp_path / "report").exists()


def test_what_the_archive_marks_itself_is_told_apart() -> None:
    """A miss of a variant whose status says so is no broken promise, and neither is what comes after a separation."""
    plan = make_plan(crossing(RICH, {"audit": 6, "steps": 2000, "tolerance": 1e-9}))
    dataset, sample = studies.run(plan.study), planned_audit(plan)
    status = xr.full_like(dataset["status"], Status.OK)
    status.values.reshape(-1)[[1, 2, 5]] = Status.SEPARATED, Status.UNRESOLVED, Status.TOLERANCE_MISSED
    group = audit_group(plan, sample, dataset.assign(status=status), Work(1))[GROUP]
    verdict = Verdict.of(group)
    assert (verdict.count, verdict.marked, verdict.missed, verdict.held) == (3, 3, 3, False)
    observed, ours = group["observed_error"].values, np.array([0, 3, 4])
    assert verdict.worst == observed[ours].max() and verdict.marked_worst == observed[[1, 2, 5]].max()
    assert verdict.place in ours and list(group["variant_status"].values) == [0, 1, 2, 0, 0, 3]
    told = told_audit(group, Results.of(dataset))
    assert told[1] == "the tolerance was not held: 3 of 3 variants missed it"
    assert told[2].startswith("audit of 3 further variants that the archive marks itself; there it found at most ")
    marked = group.assign(variant_status=xr.full_like(group["variant_status"], Status.SEPARATED))
    (told_alone,) = told_audit(marked, Results.of(dataset))
    assert Verdict.of(marked).held and told_alone.startswith("audit of 6 variants that the archive marks itself")
    assert np.isnan(Verdict.of(marked).worst) and as_json(marked, Results.of(dataset))["marked"] == 6


def test_one_scene_without_a_sweep(tmp_path: Path) -> None:
    found = outcome(crossing(RICH, FINE, sweep={}), tmp_path)
    assert group_of(found)["sample"].values.tolist() == [0]
    told = told_audit(found.audit, Results.of(found.results))
    assert "audit of 1 variant found at most" in told[0] and ", worst (midspan_m" in told[0]


def test_the_command_says_it_and_ends_with_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path, SMALL.replace('steps = "auto"', "steps = 200\naudit = 5\ntolerance = 1e-7"))
    assert main(["run", "small.toml"]) == 3
    told = capsys.readouterr().out
    assert "asked 1e-7, audit of 5 variants found at most" in told and "the tolerance was not held: 5 of 5" in told
    assert main(["run", "small.toml", "--json"]) == 3
    audit = json.loads(capsys.readouterr().out)["audit"]
    assert audit["held"] is False and audit["variants"] == 5 and set(audit["at"]) == {"speed", "mass"}
    assert audit["largest_observed_error"] > audit["tolerance"] == 1e-7
    assert main(["check", "small.toml"]) == 0
    assert "The audit of 5 variants takes about" in capsys.readouterr().out
    assert main(["report", "small.nc"]) == 0
    page = (tmp_path / "small-report" / "report.html").read_text(encoding="utf-8")
    assert "Asked 1e-7, audit of 5 variants found at most" in page and "Errors that the audit observed" in page
    assert list((tmp_path / "small-report").glob("*-audit.svg"))


def test_without_an_audit_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path, SMALL.replace('steps = "auto"', 'steps = "auto"\naudit = 0'))
    assert main(["run", "small.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["audit"] is None
    assert GROUP not in open_archive("small.nc").groups
    assert main(["check", "small.toml"]) == 0
    assert capsys.readouterr().out.rstrip().endswith("No audit.")


def test_a_check_does_not_refuse_what_only_an_audit_could_not_do() -> None:
    """Four times the steps of a very slow cruise would be too many; nobody has asked for them."""
    slow = study(beam(), mass(0.5, cruise(0.0, 1.0, 1e-5)), solver={"steps": 50_000_000})
    assert "No audit: it would take too long" in preview(make_plan(slow), 1).cost


def test_it_is_said_that_no_audit_was_worth_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.audit.MOST_TIME", 0.0)
    monkeypatch.setattr("engine.audit.FREE_SECONDS", 0.0)
    found = outcome(crossing(RICH, {}), tmp_path)
    assert found.audit is None and exit_code(found) == 0
    assert told_audit(found.audit, Results.of(found.results)) == [NONE_AUDITED]
    (tmp_path / "none").mkdir()
    none = outcome(crossing(RICH, {"audit": 0}), tmp_path / "none")
    assert told_audit(none.audit, Results.of(none.results)) == []


def test_json_tells_the_choice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, SMALL.replace("[solver]", "[solver]\naudit = 0"))
    monkeypatch.chdir(tmp_path)
    main(["run", "small.toml", "--json"])
    told, root = json.loads(capsys.readouterr().out), open_archive("small.nc").root
    used, errors = root["modes_used"].values, root["error_estimate"].values
    assert sum(part["variants"] for part in told["choice"]) == told["variants"] == used.size
    assert min(part["modes"][0] for part in told["choice"]) == used.min()
    assert max(part["largest_error_estimate"] for part in told["choice"]) == errors.max()
    assert all(part["mean_relative_cost"] >= 0.0 for part in told["choice"])
