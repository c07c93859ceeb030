"""Audits of runs: what they find, their group in the archive, what is told of them, going on after an interruption."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import studies
from engine.batch.plan import make_plan
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.status import Status
from results_schema.store.archive import open_archive
from results_schema.validate import validate
from results_schema.variables import expand
from studies.commands.cli import main
from studies.commands.screens import show_outcome
from studies.protocol.parts import Work
from studies.reporting.summary import exit_code
from studies.results.formatting import number, scientific
from studies.results.results import Results
from studies.runs.audit import GROUP, audit_group
from studies.runs.audit_findings import Verdict, as_json, relative_errors, told_accuracy, told_audit
from studies.runs.not_audited import NONE_AUDITED, NONE_COMPARED, NONE_OF_THOSE_ASKED
from studies.runs.runner import Outcome
from tests.engine.build import beam, mass, shuttle, study
from tests.floating.scenes import sliding_mass
from tests.robots.scenes import scene
from tests.studies import at_rest
from tests.studies.audits import FINE, POOR, RICH, by_hand, crossing, group_of, outcome
from tests.studies.small import SMALL, write


@pytest.fixture(scope="module")
def fine(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """A run whose audit holds."""
    return outcome(crossing(RICH, FINE), tmp_path_factory.mktemp("fine"))


def test_few_modes_and_steps_are_found_out(tmp_path: Path) -> None:
    found = outcome(crossing(POOR, {"audit": 4, "steps": 40, "static_correction": False}), tmp_path)
    verdict = Verdict.of(group_of(found))
    assert verdict.count == 4 and verdict.missed == 4 and verdict.worst > 5.0
    assert exit_code(found) == 3
    told = told_audit(found.audit, Results.of(found.results))
    assert told[-1] == "the tolerance was not held: 4 of 4 variants missed it"


def test_what_is_observed_is_what_a_finer_march_by_hand_says(tmp_path: Path) -> None:
    given = crossing(POOR, {"audit": 4, "steps": 400})
    found = outcome(given, tmp_path)
    for sample in range(4):
        own = group_of(found).isel(sample=sample)
        fine = by_hand(given, own)
        reported = found.results.sel(speed=own["speed"], mass=own["mass"])
        static = abs(float(fine["midspan_max"] / fine["dynamic_amplification"].sel(sensor="midspan")))
        gap = abs(float(reported["midspan_max"] - fine["midspan_max"])) / static
        observed = float(own["observed_error"].sel(result="midspan_max"))  # at least half of what histories differ by
        assert 0.98 * gap <= observed <= 5.0 * gap + 2e-4


def test_what_nothing_holds_is_audited_and_told(fine: Outcome) -> None:
    group, results = group_of(fine).copy(deep=True), Results.of(fine.results)
    group["tolerance"][:] = np.nan
    own = group.sel(result=[name for name in group["result"].values if not name.endswith("_position")])
    worst = own["observed_error"].max("sample").idxmax().item()
    told = told_audit(group, results)[0]
    assert "no number" not in told and f"({worst};" in told
    assert f"at most {scientific(float(own['observed_error'].max()))} " in told
    unheld = fine.results.assign(tolerance=group["tolerance"])
    assert told_accuracy(group, Results.of(unheld)).startswith("nothing is held to a tolerance; ")
    assert Verdict.of(group).held


def test_what_is_far_beyond_its_estimate_is_told_beside_what_is_held(fine: Outcome) -> None:
    """A smallest contact force near a support, say: 47 % where 6 % was estimated, of which nothing was said."""
    group, results = group_of(fine).copy(deep=True), Results.of(fine.results)
    (loose, *_) = (str(name) for name in group["result"].values if str(name).endswith("contact_force_min"))
    at = {"result": loose}
    group["tolerance"].loc[at], group["observed_error"].loc[at], group["estimated_error"].loc[at] = np.nan, 0.0, 0.05
    before = told_accuracy(group, results)
    for observed in (0.04, np.nan):  # within the estimate, or unknown
        group["observed_error"].loc[at] = observed
        assert told_accuracy(group, results) == before
    group["observed_error"].loc[{"result": loose, "sample": group["sample"][0]}] = 0.47
    told = f"{loose}, which nothing holds, differs by 47 % where 5 % was estimated."
    assert told_accuracy(group, results) == f"{before} {told}" and Verdict.of(group).held
    group["estimated_error"].loc[at] = group["observed_error"].loc[at] = 0.01
    group["observed_error"].loc[at] = 0.015  # hardly seen in a figure
    assert told_accuracy(group, results) == before


def test_plenty_holds(fine: Outcome) -> None:
    verdict = Verdict.of(group_of(fine))
    assert verdict.held and 0.0 < verdict.worst < 1.0 and exit_code(fine) == 0
    (told,) = told_audit(fine.audit, Results.of(fine.results))
    sample = group_of(fine).isel(sample=verdict.place)
    at = f"speed {float(sample['speed']):g} m/s, mass {float(sample['mass']):g} kg"
    assert told.startswith("asked 2e-3, audit of 3 variants found at most ") and f"worst at {at} (midspan" in told


def test_the_group_is_as_declared_and_the_same_however_it_was_run(fine: Outcome, tmp_path: Path) -> None:
    group = open_archive(fine.archive).groups[GROUP]
    validate(group, GROUP, expand(GROUP))
    assert {"speed", "mass", "sample", "result"} == set(group.coords) and int(group["left_out"]) == 0
    flat = np.ravel_multi_index((np.searchsorted([0.2, 0.5, 0.9], group["speed"]), group["mass"] > 0.2), (3, 2))
    np.testing.assert_array_equal(group["sample"].values, flat)
    xr.testing.assert_identical(group_of(outcome(crossing(RICH, FINE), tmp_path, threads=2)), group_of(fine))
    finished = outcome(crossing(RICH, FINE), fine.archive.parent)
    assert finished.was_finished and exit_code(finished) == 0
    xr.testing.assert_identical(group_of(finished), group)


def test_it_goes_on_to_the_same_group(fine: Outcome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped after the march, before the audit."""

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("studies.runs.runner.audit_group", stopped)
        with pytest.raises(KeyboardInterrupt):
            outcome(crossing(RICH, FINE), tmp_path)
    resumed = outcome(crossing(RICH, FINE), tmp_path)
    assert resumed.resumed == 6
    xr.testing.assert_identical(group_of(resumed), group_of(fine))


def test_it_is_on_by_default_and_covers_every_result(tmp_path: Path) -> None:
    found = outcome(crossing(beam(modes="auto", damping_ratio=0.02), {"tolerance": 1e-2}), tmp_path)
    group, flat = group_of(found), group_of(found)["sample"].values
    assert sorted(flat) == list(range(6)) and list(group["result"].values) == list(found.results["result"].values)
    np.testing.assert_array_equal(group["variant_status"], found.results["status"].values.reshape(-1)[flat])
    assert Verdict.of(group).held and Verdict.of(group).worst < 1.0
    told = found.results["estimated_error"].values.reshape(6, -1)[flat]
    np.testing.assert_allclose(group["estimated_error"], told, rtol=1e-6)  # in single precision there


def test_every_variant_has_its_tolerance(tmp_path: Path) -> None:
    swept = {"wanted": {"of": "solver.tolerance", "values": [1e-9, 0.5]}}
    found = outcome(crossing(RICH, {"audit": 2, "steps": 2000, "tolerance": 0.5}, sweep=swept), tmp_path)
    verdict = Verdict.of(group_of(found))
    np.testing.assert_allclose(group_of(found)["tolerance_asked"].values, [2e-9, 1.0])
    assert (verdict.missed, verdict.place) == (1, 0)
    errors = relative_errors(group_of(found))
    held = np.isfinite(group_of(found)["tolerance"].values)
    np.testing.assert_allclose(errors[0, held] * 1e-9, group_of(found)["observed_error"].values[0, held])


def test_variants_without_values_are_left_out_and_counted() -> None:
    plan = make_plan(crossing(RICH, FINE | {"audit": 4, "steps": 2000}))
    dataset = studies.run(plan.study)
    whole = audit_group(plan, dataset, Work(1))[GROUP]
    status = dataset["status"].copy()
    status.values.reshape(-1)[int(whole["sample"][1])] = Status.DIVERGED
    less = audit_group(plan, dataset.assign(status=status), Work(1))[GROUP]
    assert int(less["left_out"]) == 1
    xr.testing.assert_identical(less["observed_error"], whole["observed_error"].isel(sample=[0, 2, 3]))
    told = "1 further variant picked for the audit could not be compared: "
    assert told_audit(less, Results.of(dataset.assign(status=status)))[-1] == (
        f"{told}without values, or nothing finer is left"
    )
    assert told_audit(less, Results.of(dataset))[-1] == f"{told}nothing finer is left"
    assert audit_group(plan, dataset.assign(status=xr.full_like(status, Status.DIVERGED)), Work(1)) == {}
    assert told_audit(None, Results.of(dataset)) == [NONE_OF_THOSE_ASKED.format(4)]
    auto = studies.run(crossing(RICH, {}))
    auto["status"].values.reshape(-1)[0] = Status.DIVERGED
    assert told_audit(None, Results.of(auto)) == [NONE_COMPARED]


def test_it_is_said_why_fewer_variants_are_audited_than_were_asked_for() -> None:
    plan = make_plan(crossing(RICH, FINE | {"audit": 50}))
    results = Results.of(studies.run(plan.study))
    group = audit_group(plan, results.dataset, Work(1))[GROUP]
    said = told_accuracy(group, results)
    assert "6 variants computed again" in said and "Audit = 50 asks for more variants than there are." in said
    assert told_audit(group, results)[-1] == "audit = 50 asks for more variants than there are"
    assert "no variant was audited, though audit = 50: nothing finer is left" in told_accuracy(None, results)
    none = Results.of(studies.run(crossing(RICH, FINE | {"audit": 0})))
    assert told_audit(None, none) == []
    assert "no variant was audited, as the study asks for none." in told_accuracy(None, none)


def test_what_the_archive_marks_itself_is_told_apart() -> None:
    """A miss of a variant whose status says so is no broken promise, and neither is what comes after a separation."""
    plan = make_plan(crossing(RICH, {"audit": 6, "steps": 2000, "tolerance": 1e-9}))
    dataset = studies.run(plan.study)
    status = xr.full_like(dataset["status"], Status.OK)
    status.values.reshape(-1)[[1, 2, 5]] = Status.SEPARATED, Status.UNRESOLVED, Status.TOLERANCE_MISSED
    group = audit_group(plan, dataset.assign(status=status), Work(1))[GROUP]
    verdict = Verdict.of(group)
    assert (verdict.count, verdict.marked, verdict.missed, verdict.held) == (3, 3, 3, False)
    over = np.nanmax(relative_errors(group), axis=1)
    assert verdict.worst == over[[0, 3, 4]].max() and verdict.marked_worst == over[[1, 2, 5]].max()
    assert verdict.place in (0, 3, 4) and list(group["variant_status"].values) == [0, 1, 2, 0, 0, 3]
    told = told_audit(group, Results.of(dataset))
    assert told[1] == "the tolerance was not held: 3 of 3 variants missed it"
    of_them = f"the largest difference is {number(verdict.marked_worst, 2)} times the tolerance"
    assert told[2] == f"3 variants whose status is not ok were computed again with more of everything: {of_them}"
    marked = group.assign(variant_status=xr.full_like(group["variant_status"], Status.SEPARATED))
    (told_alone,) = told_audit(marked, Results.of(dataset))
    assert Verdict.of(marked).held and told_alone.startswith("6 variants whose status is not ok were computed again")
    none = dataset.assign(status=xr.full_like(status, Status.TOLERANCE_MISSED))
    assert told_accuracy(marked, Results.of(none)) == f"no status is ok where 1e-9 was asked; {told_alone}."
    assert np.isnan(Verdict.of(marked).worst) and as_json(marked, Results.of(dataset))["marked"] == 6


def test_the_lines_at_the_end_say_which_variants_they_are_of(fine: Outcome, capsys: pytest.CaptureFixture[str]) -> None:
    """An error below the tolerance beside a variant that misses it is that of the others."""
    results = fine.results.copy(deep=True)
    assert told_accuracy(fine.audit, Results.of(results)).startswith("estimated errors at most ")
    error, missed = results["estimated_error"].values, list(results["result"].values).index("midspan_max")
    results["status"].values[0, 0], error[0, 0, missed] = Status.TOLERANCE_MISSED, 0.9
    assert told_accuracy(fine.audit, Results.of(results)).startswith("estimated errors of those that are ok at most ")
    show_outcome(replace(fine, results=results))
    told = " ".join(capsys.readouterr().out.split())
    helps = 'helps: `tolerance = "told"` on the sensor midspan, so that errors are estimated and not held, or a larger'
    assert (
        "most of all for midspan_max: 9e-1 where" in told and f"was asked). What {helps} tolerance. Accuracy: " in told
    )


def test_errors_within_several_tolerances_are_said_to_be_within_their_own(fine: Outcome) -> None:
    """ "At most 1.6e-3 where 1e-3 to 1e-2 was asked" would read as if one were missed."""
    results = fine.results.copy(deep=True)
    asked, held = results["tolerance"].values, np.isfinite(results["tolerance"].values)
    asked[np.flatnonzero(held)[0]] *= 10.0
    span = f"{scientific(float(np.nanmin(asked)))} to {scientific(float(np.nanmax(asked)))}"
    assert f", each within its own tolerance ({span}); " in told_accuracy(fine.audit, Results.of(results))
    error = results["estimated_error"].transpose(..., "result").values
    error[0, 0, np.flatnonzero(held)[-1]] = 2.0 * float(asked[np.flatnonzero(held)[-1]])
    results["estimated_error"] = results["estimated_error"].transpose(..., "result").copy(data=error)
    assert f"where {span} was asked; " in told_accuracy(fine.audit, Results.of(results))


def test_the_command_says_it_and_ends_with_3(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(here, SMALL.replace('"auto"\naudit = 2', "200\naudit = 5\ntolerance = 1e-7"))
    assert main(["run", "small.toml", "-v"]) == 3
    told = " ".join(capsys.readouterr().out.split())
    assert "of 5 variants computed again with more of everything, 5 variants did not hold it: " in told
    assert re.search(r"did not hold it: \S+ is off by \d\S*e-\d\.", told)
    assert "asked 1e-7, audit of 5 variants found at most" in told and "the tolerance was not held: 5 of 5" in told
    assert main(["run", "small.toml", "--json"]) == 3
    audit = json.loads(capsys.readouterr().out)["audit"]
    assert audit["held"] is False and audit["variants"] == 5 and set(audit["at"]) == {"speed", "mass"}
    assert audit["largest_observed_error"] > audit["tolerance"] == 1e-7
    assert main(["report", "small.nc"]) == 0
    page = (here / "small-report" / "report.html").read_text(encoding="utf-8")
    assert "Asked 1e-7, audit of 5 variants found at most" in page and "The audit found errors of at most" in page
    assert list((here / "small-report").glob("*-audit.svg"))


def test_it_is_said_that_no_audit_was_worth_its_time() -> None:
    assert told_audit(None, Results.of(studies.run(crossing(RICH, {})))) == [NONE_AUDITED]


def told_of_none(found: Outcome) -> str:
    """What is told at length and in a few words of a run without an audit, at its end as of its archive."""
    assert found.audit is None
    told = []
    for root in (found.results, open_archive(found.archive).root):
        results = Results.of(root)
        told.append("; ".join((*told_audit(None, results), told_accuracy(None, results))))
    assert told[0] == told[1]
    return told[0]


def test_a_run_of_one_variant_says_that_its_audit_would_take_too_long(tmp_path: Path) -> None:
    """And proposes no more variants than there are."""
    bed = beam(modes=8, damping_ratio=0.02)
    told = told_of_none(outcome(study(bed, mass(0.2, shuttle(0.2, 0.8, 0.001, 0.1, 3))), tmp_path))
    assert "no variant was audited: it would have taken too long (audit = 1 audits it all the same)" in told
    assert "no variant was audited, as it would have taken too long (audit = 1 audits it all the same)." in told
    assert "finer" not in told


@pytest.mark.parametrize(("asked", "though"), [("auto", "no variant was audited: "), (2, "though audit = 2: ")])
def test_a_run_that_has_nothing_finer_says_so(asked: int | str, though: str, tmp_path: Path) -> None:
    """Its variants were computed again all the same."""
    told = told_of_none(outcome(crossing(beam(modes=64), {"tolerance": 1e-9, "audit": asked}), tmp_path))
    assert f"{though}nothing finer than what variants were computed with is left to compare them with" in told
    assert "too long" not in told and "no values" not in told


def test_what_marches_nothing_refuses_it() -> None:
    with pytest.raises(BadInput, match=r"solver\.audit"):
        studies.run(at_rest.study("influence").with_values({"solver.audit": 3}))


def test_one_held_result_without_a_number_is_not_held(fine: Outcome) -> None:
    group = group_of(fine).copy(deep=True)
    held = int(np.flatnonzero(np.isfinite(group["tolerance"].values))[-1])
    group["observed_error"].values[0, held] = np.nan
    verdict = Verdict.of(group)
    assert verdict.unknown == 1 and not verdict.held


# ---- kinds that are computed in pieces: robots on rails, frames that move ----


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
