"""Datasets from Python as archives and answers: those that went through files, and those that are refused."""

import csv
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import engine
import studies
from results_schema.errors import BadInput
from studies.commands.cli import main
from studies.runs.archived import results_of
from studies.runs.datasets import archive_of
from studies.runs.not_audited import told_none_briefly
from tests.engine.build import beam, cruise, fixed, force, study
from tests.studies import scenes

PASSAGES = scenes.pace("passage")


def refused(call: Any, *arguments: Any) -> str:
    with pytest.raises(BadInput) as error:
        call(*arguments)
    return str(error.value)


def test_own_variables_are_refused_by_name(tmp_path: Path) -> None:
    found = scenes.run("passage", PASSAGES)
    path = tmp_path / "mine.nc"
    said = refused(studies.write, found.assign(mine=2.0 * found.midspan_max), path)
    assert said.startswith("mine: ") and 'drop_vars(["mine"])' in said and "to_netcdf" in said and not path.exists()
    assert "drop_vars" in refused(studies.report, found.assign(mine=2.0 * found.midspan_max), tmp_path / "page")
    assert main(["info", str(studies.write(found, path))]) == 0


def test_what_info_would_refuse_is_refused_before_it_is_written(tmp_path: Path) -> None:
    found = scenes.run("passage", PASSAGES)
    path = tmp_path / "other.nc"
    assert "pace" in refused(studies.write, found.assign_coords(pace=2.0 * found.pace), path)
    assert "midspan_max" in refused(studies.write, found.drop_vars("midspan_max"), path)
    assert not path.exists()


def test_changed_numbers_are_not_written_as_those_of_the_study(tmp_path: Path) -> None:
    """A deflection in mm was archived as if the run had found it, and `info` said "whole"."""
    found = scenes.run("passage", PASSAGES)
    changed, path = found.assign(midspan_max=1e3 * found.midspan_max), tmp_path / "mine.nc"
    assert "values of this dataset were changed" in refused(studies.write, changed, path) and not path.exists()
    with xr.open_dataset(studies.write(found, path)) as again:
        assert "values_crc32" not in again.attrs and again.midspan_max.equals(found.midspan_max)


def test_archives_have_names_of_netcdf_files_and_replace_what_they_are_told_to(tmp_path: Path) -> None:
    """A "found.csv" was a netCDF file, and the message on a file that is there did not name `overwrite`."""
    found = scenes.run("passage", PASSAGES)
    said = refused(studies.write, found, tmp_path / "found.csv")
    assert 'studies.export(dataset, "found.csv")' in said and "ends with .nc" in said and not list(tmp_path.iterdir())
    path = studies.write(found, tmp_path / "found.nc")
    assert "overwrite=True" in refused(studies.write, found, path)


#: Calls in processes that have imported the packages, and nothing more.
FIRST = """
import os, sys
import xarray, studies
for call in sys.argv[1:]:
    if os.fork() == 0:
        name, *others = call.split()
        with xarray.open_dataset("found.nc") as found:
            getattr(studies, name)(found, *others)
        os._exit(0)
    assert os.wait()[1] == 0, call
"""


CALLS = ["write other.nc", "report page", "export found.csv", "answer", "figures", "errors"]


@pytest.mark.parametrize(
    ("kind", "calls"),
    [pytest.param("passage", CALLS, marks=pytest.mark.slow), ("asymmetry", ["report page", "write other.nc"])],
)
def test_an_archive_is_known_to_a_fresh_process(kind: str, calls: list[str], tmp_path: Path) -> None:
    """`report` and `write` refused every archive whose kind of study had not been used before."""
    studies.write(scenes.run(kind, scenes.pace(kind)), tmp_path / "found.nc")
    order = [sys.executable, "-c", FIRST, *calls]
    done = subprocess.run(order, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_estimated_errors_are_exported_however_many_results_there_are(tmp_path: Path) -> None:
    sensors = {f"s{number}": fixed(number / 17) for number in range(1, 17)}
    found = studies.run(study(beam(), force(2.0, cruise(0.0, 1.0, 1.0)), sensor=sensors))
    assert found.sizes["result"] > 64
    (row,) = csv.DictReader(studies.export(found, tmp_path / "all.csv").read_text().splitlines())
    for name in found.result.values:
        if not name.startswith("car"):  # whose force is the same all the way
            told = float(found.estimated_error.sel(result=name))
            assert float(row[f"estimated_error {name}"]) == pytest.approx(told, nan_ok=True)


def test_a_dataset_is_exported_as_the_command_does(tmp_path: Path) -> None:
    found, results = scenes.run("passage", PASSAGES), ("midspan_max", "moment_min")
    archive = studies.write(found, tmp_path / "found.nc")
    by_command, by_call = tmp_path / "command.csv", tmp_path / "call.csv"
    assert main(["export", str(archive), str(by_command), "--results", ",".join(results)]) == 0
    assert studies.export(found, by_call, results) == by_call
    assert by_call.read_bytes() == by_command.read_bytes()
    assert main(["export", str(archive), str(by_command)]) == 2
    assert main(["export", str(archive), str(by_command), "--results", ",".join(results), "--overwrite"]) == 0
    assert by_call.read_bytes() == by_command.read_bytes()
    refusal = refused(studies.export, found, by_call)
    assert "there is a file already" in refusal and "overwrite=True" in refusal
    studies.export(found, by_call, overwrite=True)
    assert len(by_call.read_bytes()) > len(by_command.read_bytes())
    assert "no such result" in refused(studies.export, found, tmp_path / "other.csv", ["deflection"])
    said = refused(studies.export, found, tmp_path / "other.csv", ["pace"])
    assert "swept numbers are always in the table" in said and not (tmp_path / "other.csv").exists()


def test_what_was_selected_from_a_dataset_is_told_from_its_whole() -> None:
    """One sensor ended in an IndexError, one result in a ValueError, a new name of an axis as several studies."""
    found = scenes.run("passage", PASSAGES)
    for part in (
        found.sel(sensor="midspan"),
        found.sel(sensor=["midspan"]),
        found.sel(result="midspan_max"),
        found.isel(pace=slice(2)),
        found.isel(pace=0),
    ):
        for call in (studies.errors, studies.answer):
            said = refused(call, part)
            assert "a part of its study's results" in said and "give the whole dataset and select" in said
    said = refused(studies.errors, found.rename(pace="speed"))
    assert said.startswith("pace: this dataset has lost a swept number of its study")
    assert studies.BadInput is engine.BadInput is BadInput


def test_datasets_that_went_through_files(tmp_path: Path) -> None:
    """xarray gives coordinates a fill value of its own when it writes them."""
    scenes.run("passage", PASSAGES).to_netcdf(tmp_path / "kept.nc")
    with xr.open_dataset(tmp_path / "kept.nc") as again:
        assert "_FillValue" in again.pace.encoding
        assert studies.answer(again) == studies.answer(scenes.run("passage", PASSAGES))
        assert studies.report(again, tmp_path / "page").exists()
        archive = studies.write(again, tmp_path / "archive.nc", scenes.study("passage", PASSAGES))
        assert "_FillValue" in again.pace.encoding, "the user's own dataset is left alone"
    assert main(["info", str(archive)]) == 0


def test_what_is_no_dataset_of_a_study(tmp_path: Path) -> None:
    study = scenes.study("passage")
    marched = engine.run(study)
    for said in (
        refused(studies.answer, marched),
        refused(studies.figures, marched),
        refused(studies.report, marched, tmp_path / "page"),
        refused(studies.write, marched, tmp_path / "found.nc", study),
    ):
        assert "expected a dataset of studies.run" in said and "in place of engine.run" in said
    assert "received a DataArray" in refused(studies.answer, scenes.run("passage").midspan_max)


def test_what_python_runs_is_not_audited_and_says_so(tmp_path: Path) -> None:
    """That it "would have taken too long" was told of runs that audit nothing."""
    found = scenes.run("passage", PASSAGES)
    told = told_none_briefly(results_of(archive_of(found, tmp_path / "a.nc")))
    assert told == "no variant was audited, as studies.run audits none; the command run does."
    assert "xarray.open_dataset" in refused(studies.answer, "m.nc") and "engine.run" not in refused(
        studies.answer, "m.nc"
    )
    with pytest.raises(BadInput, match="threads: no threads to run on"):
        studies.run(scenes.study("passage"), threads="2")
    assert studies.run(scenes.study("passage"), threads=np.int64(1)).status == 0


def test_a_misspelt_name_in_a_dotted_key_gets_a_hint() -> None:
    """It makes a table of its own, of which the kind was said to be missing; whoever forgets that gets none."""
    given = scenes.study("passage")
    said = refused(given.with_values, {"carriage.tabel.motion.speed": 3.0})
    assert "carriage.tabel.kind: the kind is missing" in said and 'did you mean "table"?' in said
    assert "one that there is: table" in refused(given.with_values, {"carriage.z.motion.speed": 3.0})
    said = refused(given.with_values, {"carriage.table.motion.speed": [3.0, 4.0]})
    assert 'to vary it: [sweep] NAME = { of = "carriage.table.motion.speed", values = [3.0, 4.0] }' in said
    limited = type(given)(**(given.data | {"question": {"displacement": [5e-3]}}))
    said = refused(studies.run, limited)  # what is told of results is not swept
    assert "question.displacement: wrong type" in said and "to vary it" not in said
    second = {"on": "bed", "mass": 1.0, "motion": {"kind": "cruise", "start": 0.0, "end": 1.0, "speed": 1.0}}
    assert "did you mean" not in refused(given.with_values, {"carriage.table_2": second})
