"""Audits of runs: what is compared and how, exit codes, sentences, archive and report."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import studies
from engine.lanes import LaneValues
from engine.plan import make_plan
from engine.reduction import Compared
from engine.scene import Study
from results_schema.archive import open_archive
from results_schema.errors import BadInput
from results_schema.status import Status
from results_schema.validate import validate
from studies.actions import exit_code
from studies.audit import (
    GROUP,
    Again,
    Pair,
    Verdict,
    _differences,
    _scale,
    as_json,
    audit_group,
    planned_audit,
    refuse_audit,
    told_audit,
)
from studies.cli import main
from studies.kinds import asymmetry, double_peak
from studies.kinds.double_peak import _peak_gap
from studies.measuring import Work
from studies.options import RunOptions
from studies.preview import preview
from studies.report import write_report
from studies.results import Results
from studies.runner import Outcome, run_to_archive
from tests.engine.build import beam, cruise, fixed, mass, shuttle, study, swing
from tests.studies.small import SMALL, write

SWEEP = {
    "speed": {"of": "carriage.car.motion.speed", "values": [0.2, 0.5, 0.9]},
    "mass": {"of": "carriage.car.mass", "values": [0.1, 0.3]},
}
POOR = beam(modes=1, damping_ratio=0.02)
RICH = beam(modes=12, damping_ratio=0.02)
FINE = {"audit": 3, "steps": 1600, "tolerance": 2e-3}


def crossing(bed: dict[str, Any], solver: dict[str, Any], **changes: Any) -> Study:
    """A mass over a beam at three speeds."""
    return study(bed, mass(0.2, cruise(0.0, 1.0, 0.5)), **({"sweep": SWEEP, "solver": solver} | changes))


def outcome(given: Study, folder: Path, threads: int = 1) -> Outcome:
    return run_to_archive(given, folder / "found.nc", RunOptions(threads=threads))


def group_of(found: Outcome) -> xr.Dataset:
    assert found.audit is not None
    return found.audit


def again(given: Study, sample: xr.Dataset, modes: int) -> xr.Dataset:
    """By hand: one variant with all terms, more modes and the audit's steps."""
    values = {"carriage.car.motion.speed": float(sample["speed"]), "carriage.car.mass": float(sample["mass"])}
    values |= {"body.bed.modes": modes, "solver.steps": int(sample["steps_used"]), "solver.audit": 0}
    values |= {"solver.fidelity": "auto", "solver.static_correction": True}
    return studies.run(given.without_sweep().with_values(values))


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


@pytest.mark.parametrize("solver", [{"steps": 300}, {"fidelity": "static"}, {"fidelity": "force", "steps": 300}])
def test_observed_errors_are_those_of_two_runs(solver: dict[str, Any], tmp_path: Path) -> None:
    """Extremes of a displacement over the static one by the closed form, m g L^3/(48 E I)."""
    given = crossing(beam(modes=3), solver | {"audit": 3}, gravity=9.81)
    found = outcome(given, tmp_path)
    group = group_of(found)
    for place in range(3):
        sample = group.isel(sample=place)
        finer = again(given, sample, 6)
        own = found.results.sel(speed=sample["speed"], mass=sample["mass"])
        gaps = [abs(float(own[name]) - float(finer[name])) for name in ("midspan_max", "midspan_min")]
        static = float(sample["mass"]) * 9.81 / 48.0
        assert float(sample["observed_error"]) == pytest.approx(max(gaps) / static, rel=2e-5)
        assert int(sample["modes_used"]) == 6 and int(sample["steps_used"]) >= 800
        assert str(sample["worst_result"].values) == f"midspan_{'max' if gaps[0] > gaps[1] else 'min'}"
    if "fidelity" in solver:
        assert Verdict.of(group).worst > 0.02


def test_velocities_count_by_their_own_size(tmp_path: Path) -> None:
    given = crossing(beam(modes=3), {"steps": 600, "audit": 2}, sensor={"fast": fixed(0.5, "velocity")})
    found = outcome(given, tmp_path)
    for place in range(2):
        sample = group_of(found).isel(sample=place)
        finer, own = again(given, sample, 6), found.results.sel(speed=sample["speed"], mass=sample["mass"])
        size = max(abs(float(finer["fast_max"])), abs(float(finer["fast_min"])))
        gap = max(abs(float(own[name]) - float(finer[name])) for name in ("fast_max", "fast_min"))
        assert float(sample["observed_error"]) == pytest.approx(gap / size, rel=1e-9)


def test_an_asymmetry_compares_its_indices(tmp_path: Path) -> None:
    sensors = {"midspan": fixed(0.5), "quarter": fixed(0.3)}
    motion = shuttle(0.5, 0.9, 0.4, 0.1, 3)
    given = study(
        beam(modes=2, damping_ratio=0.05),
        mass(0.2, motion),
        kind="asymmetry",
        sensor=sensors,
        solver={"steps": 400, "audit": 2},
        sweep=SWEEP,
    )
    found = outcome(given, tmp_path)
    for place in range(2):
        sample = group_of(found).isel(sample=place)
        finer, own = again(given, sample, 4), found.results.sel(speed=sample["speed"], mass=sample["mass"])
        gaps = {name: np.abs(own[name].values - finer[name].values) for name in ("lag", "odd_rms", "even_excess")}
        gaps["lag"] = gaps["lag"] / (0.4 * 0.8)
        extremes = []
        for x in (0.5, 0.3):
            name, static = {0.5: "midspan", 0.3: "quarter"}[x], float(sample["mass"]) * 9.81 * _largest(x)
            extremes += [
                abs(float(own[f"{name}_{end}"]) - float(finer[f"{name}_{end}"])) / static for end in ("max", "min")
            ]
        expected = max(*extremes, *(float(gap.max()) for gap in gaps.values()))
        assert float(sample["observed_error"]) == pytest.approx(expected, rel=1e-3)


def _largest(x: float) -> float:
    """Largest deflection at x per newton anywhere from 0.5 to 0.9 of a pinned beam with L = E I = 1."""
    s = np.linspace(0.5, 0.9, 40001)
    near, far = np.minimum(x, s), np.maximum(x, s)
    return float((near * (1 - far) * (1 - near**2 - (1 - far) ** 2) / 6).max())


def test_a_double_peak_compares_peaks_and_harmonics(tmp_path: Path) -> None:
    given = study(
        beam(modes=2, damping_ratio=0.05),
        mass(0.2, swing(0.5, 0.4, 0.2, 4)),
        kind="double-peak",
        solver={"steps": 300, "audit": 1},
    )
    found = outcome(given, tmp_path)
    finer = studies.run(
        given.with_values(
            {"body.bed.modes": 4, "solver.audit": 0, "solver.steps": int(group_of(found)["steps_used"][0])}
        )
    )
    static = 0.2 * 9.81 / 48.0
    gaps = [abs(float(found.results[name]) - float(finer[name])) for name in ("midspan_max", "midspan_min")]
    for name in ("peak_value", "harmonic"):
        gaps.append(float(np.nanmax(np.abs(found.results[name].values - finer[name].values))))
    assert float(group_of(found)["observed_error"][0]) == pytest.approx(max(gaps) / static, rel=2e-5)


def test_what_the_kinds_add_is_relative_as_it_should_be() -> None:
    """By hand: a cruise of (1 - 2 x 0.1) times the stroke, which the sweep makes 0.4 and 0.25 m; a scale of 2 and 4."""
    scene = study(beam(), mass(0.2, shuttle(0.5, 0.9, 0.4, 0.1, 3)), kind="asymmetry")
    values = LaneValues(scene, {"carriage.car.motion.end": np.array([0.9, 0.25])}, 2)
    scale, loud = np.array([[2.0], [4.0]]), np.zeros((2, 1), dtype=np.bool_)
    reported = {name: np.zeros((2, 1)) for name in ("lag", "odd_rms", "even_excess")}
    once_more = {
        "lag": np.array([[0.032], [-0.02]]),
        "odd_rms": np.full((2, 1), 0.3),
        "even_excess": np.full((2, 1), 0.7),
    }
    kind = asymmetry.KIND.reduction(scene)
    found = kind.differences(Compared(reported, once_more, scale, values))
    np.testing.assert_allclose(found["lag"], [[0.1], [0.1]], rtol=1e-12)
    np.testing.assert_allclose([found["odd_rms"][0, 0], found["even_excess"][1, 0]], [0.3, 0.7])
    ends = {f"midspan_{end}": np.array([1.0, 2.0]) for end in ("max", "min")}
    whole = Pair(("midspan",), reported | ends, once_more | ends, scale, loud, values)
    every = _differences(whole, kind)
    np.testing.assert_array_equal(every["lag"], found["lag"])
    assert set(every) == {"max", "min", "lag", "odd_rms", "even_excess"} and not every["max"].any()
    assert not _differences(replace(whole, silent=~loud), kind)["odd_rms"].any()


def test_harmonics_and_peaks_count_over_the_static_value() -> None:
    scene = study(beam(), mass(0.2, swing(0.5, 0.4, 0.2, 4)), kind="double-peak")
    scale, values = np.array([[2.0], [4.0]]), LaneValues(scene, {}, 2)
    number = np.array([[2.0], [1.0]])
    reported = {"peak_value": np.array([[[1.0, 2.0]], [[1.0, np.nan]]]), "harmonic": np.zeros((2, 1, 3))}
    once_more = {
        "peak_value": np.array([[[1.2, 2.1]], [[1.4, np.nan]]]),
        "harmonic": np.array([[[0.0, -0.6, 0.2]], [[0.8, np.nan, 0.0]]]),
    }
    reported["harmonic"][1, 0, 1] = np.nan
    compared = Compared(reported | {"peaks_per_cycle": number}, once_more | {"peaks_per_cycle": number}, scale, values)
    found = double_peak.KIND.reduction(scene).differences(compared)
    np.testing.assert_allclose(found["peak_value"], [[0.1], [0.1]])
    np.testing.assert_allclose(found["harmonic"], [[0.3], [0.2]])


def test_peaks_fit_round_the_cycle_and_differ_in_number_without_error() -> None:
    one = np.array([[[1.0, 2.0, 3.0, np.nan]], [[1.0, 2.0, np.nan, np.nan]], [[np.nan] * 4]])
    other = np.array([[[3.1, 1.0, 2.0, np.nan]], [[1.0, 2.0, 0.5, np.nan]], [[np.nan] * 4]])
    here, there = (
        {"peak_value": values, "peaks_per_cycle": np.isfinite(values).sum(axis=2)} for values in (one, other)
    )
    compared = Compared(here, there, np.ones((3, 1)), LaneValues(crossing(POOR, {}), {}, 3))
    np.testing.assert_allclose(_peak_gap(compared), [[0.1], [0.0], [0.0]], atol=1e-12)


def test_what_has_no_number_is_known_not_to_have_one() -> None:
    values = LaneValues(crossing(POOR, {}), {}, 3)
    reported = {"lag": np.array([[1.0], [np.nan], [np.nan]])}
    once_more = {"lag": np.array([[1.5], [np.nan], [2.0]])}
    compared = Compared(reported, once_more, np.array([[2.0], [0.0], [0.0]]), values)
    np.testing.assert_array_equal(compared.gap("lag"), [[0.5], [0.0], [np.nan]])
    np.testing.assert_array_equal(compared.relative(np.array([[0.5], [0.0], [1.0]])), [[0.25], [0.0], [np.nan]])


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


@pytest.mark.parametrize(
    ("supports", "at", "quantity"),
    [
        ("pinned-pinned", 1.0, "displacement"),
        ("clamped-pinned", 0.0, "velocity"),
        ("pinned-pinned", 0.0, "bending_moment"),
        ("clamped-free", 1.0, "bending_moment"),
    ],
)
def test_rounding_has_no_relative_error(supports: str, at: float, quantity: str, tmp_path: Path) -> None:
    """A sensor where nothing can be read, with and without one that reads."""
    bed = beam(modes=12, damping_ratio=0.02, supports=supports)
    for more in ({}, {"middle": fixed(0.5)}):
        given = crossing(bed, FINE | {"audit": 1}, sensor={"nothing": fixed(at, quantity)} | more, sweep={})
        (tmp_path / str(len(more))).mkdir()
        found = group_of(outcome(given, tmp_path / str(len(more))))
        assert (float(found["observed_error"][0]) > 0.0) == bool(more) and Verdict.of(found).held


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


def test_a_sensor_that_statics_leave_at_rest_counts_by_itself() -> None:
    """A static value that is but rounding is nothing to divide by."""
    arrays = {"x_static": np.array([1e-14, 0.0, 2.0]), "x_max": np.array([0.5, 0.5, 3.0]), "x_min": -np.ones(3)}
    np.testing.assert_array_equal(_scale(["x"], arrays), [[1.0], [1.0], [2.0]])


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


def test_one_scene_without_a_sweep(tmp_path: Path) -> None:
    found = outcome(crossing(RICH, FINE, sweep={}), tmp_path)
    assert group_of(found)["sample"].values.tolist() == [0]
    told = told_audit(found.audit, Results.of(found.results))
    assert "audit of 1 variant found at most" in told[0] and ", worst (midspan_m" in told[0]


def test_what_marches_nothing_refuses_it() -> None:
    given = crossing(RICH, {"audit": 3}).without_sweep().with_values({"kind": "influence"})
    with pytest.raises(BadInput, match=r"solver\.audit"):
        refuse_audit(given)
    refuse_audit(given.with_values({"solver.audit": "auto"}))


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
