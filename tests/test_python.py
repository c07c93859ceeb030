"""The program from Python: what it takes for a study, what it warns of, and what it refuses in words."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
import xarray as xr

import engine
import studies
from results_schema.errors import BadInput
from studies.findings.beyond import where_beyond
from studies.protocol.library import built_in
from studies.results.results import Results
from tests.floating.scenes import sliding_mass
from tests.studies import at_rest, scenes

RUNS = (engine.run, studies.run)
GIGAPASCALS = scenes.text_of("passage").replace('"210 GPa"', "70")


def refused(call: Any, *arguments: Any, **options: Any) -> str:
    with pytest.raises(BadInput) as error:
        call(*arguments, **options)
    return str(error.value)


@pytest.mark.parametrize("run", RUNS)
def test_a_study_file_is_run_by_its_path(run: Any, tmp_path: Path) -> None:
    study = scenes.study("passage")
    path = study.save(tmp_path / "passage.toml")
    wanted = run(study).midspan_max
    assert (run(path).midspan_max == wanted).all() and (run(str(path)).midspan_max == wanted).all()
    assert "cannot be read" in refused(run, tmp_path / "none.toml")


@pytest.mark.parametrize("run", RUNS)
def test_an_archive_is_no_study(run: Any, tmp_path: Path) -> None:
    """However large it is."""
    path = tmp_path / "found.nc"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(11_000_000))
    said = refused(run, path)
    assert "an archive of results, not a study" in said and "xarray.open_dataset(" in said


def test_what_runs_frames_that_move_is_said() -> None:
    """The engine marches bodies that stand."""
    said = refused(engine.run, sliding_mass())
    assert "here they move" in said and "studies.run, which knows this kind" in said


@pytest.mark.parametrize("call", [*RUNS, engine.Study])
def test_tables_are_no_study(call: Any) -> None:
    said = refused(call, {"kind": "passage"})
    assert said.startswith("study: this is no study; expected ") and "received a dict" in said
    assert "engine.Study(**tables)" in said


@pytest.mark.parametrize("run", RUNS)
def test_unknown_options_are_refused(run: Any) -> None:
    said = refused(run, scenes.study("passage"), nthreads=2)
    assert said.startswith("nthreads: unknown option; expected one of ") and 'did you mean "threads"?' in said


@pytest.mark.parametrize("run", RUNS)
def test_an_option_that_the_study_says_is_told_where(run: Any) -> None:
    assert 'study.with_values({"solver.tolerance": ...})' in refused(run, scenes.study("passage"), tolerance=1e-2)


@pytest.mark.parametrize("run", RUNS)
def test_progress_is_told_to_a_function(run: Any) -> None:
    said = refused(run, scenes.study("passage"), progress=True)
    assert said.startswith("progress: this cannot be called; expected a function") and "received True" in said


def test_a_misspelt_built_in_study_is_found() -> None:
    said = refused(studies.run, "passge")
    assert said.startswith("passge: no such file, and no built-in study") and 'did you mean "passage"?' in said


@pytest.mark.parametrize("values", ["carriage.table.mass", 3, ["mass", 3]])
def test_values_are_wanted_by_their_keys(values: Any) -> None:
    said = refused(scenes.study("passage").with_values, values)
    assert said.startswith("values: these are no values; expected a table of values by dotted key")


@pytest.mark.parametrize(("run", "category"), [(engine.run, engine.Remark), (studies.run, studies.Remark)])
def test_what_is_often_a_mistake_is_a_warning(run: Any, category: type[Warning]) -> None:
    with pytest.warns(category, match='70 Pa: no beam has this.*did you mean "70 GPa"') as told:
        run(engine.load(GIGAPASCALS))
    assert told[0].filename == __file__, "the line of the user"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(scenes.study("passage"))


@pytest.mark.parametrize("package", [engine, studies])
def test_public_names_are_completed(package: Any) -> None:
    assert set(package.__all__) <= set(dir(package))
    assert not [name for name in dir(package) if not name.startswith("__") and name not in package.__all__]
    package.__dict__.pop("run", None)
    assert "run" in dir(package) and "__doc__" in dir(package)


def test_quantities_of_pint_are_read_as_their_texts() -> None:
    unit = pint.UnitRegistry()
    whole = scenes.study("passage")
    given = {
        "carriage.table.mass": 60 * unit.kg,
        "body.bed.length": np.float64(1000) * unit.cm,
        "body.bed.density": 7.85 * unit.g / unit.cm**3,
        "body.bed.damping_ratio": 2 * unit.percent,
        "carriage.table.motion.speed": unit.Quantity(36, "km/h"),
        "gravity": 9.81 * unit.meter / unit.second**2,
    }
    found = whole.with_values(given)
    assert [found.value(key) for key in given] == [60.0, 10.0, 7850.0, 0.02, 10.0, 9.81]
    assert engine.load(found.toml()) == found
    assert "a length (m) where a mass (kg) is wanted" in refused(whole.with_values, {"carriage.table.mass": 6 * unit.m})
    sweep = {"mass": {"of": "carriage.table.mass", "values": [0.05, 0.2] * unit.t}}
    assert studies.run(whole.with_values({"sweep": sweep})).mass.values.tolist() == [50.0, 200.0]


def test_values_of_an_axis_are_any_array_of_one_dimension() -> None:
    whole, mass = scenes.study("passage"), "carriage.table.mass"
    for values in (
        xr.DataArray([50.0, 100.0], dims="mass"),
        xr.DataArray([50.0, 100.0]).to_series(),
        range(50, 101, 50),
    ):
        found = whole.with_values({"sweep": {"mass": {"of": mass, "values": values}}})
        assert found.sweep.axes["mass"].values == (50.0, 100.0)
    for values in (np.ones((2, 2)), np.ones((2, 2)) * pint.UnitRegistry().kg):
        said = refused(whole.with_values, {"sweep": {"mass": {"of": mass, "values": values}}})
        assert "sweep.mass.values.0: the values of an axis are one-dimensional" in said and "ravel" in said


def test_errors_in_units_of_the_results() -> None:
    """An archive has them as parts of a scale: of readings of the largest static value, as their amplification tells
    it."""
    found = studies.run(scenes.study("passage"))
    told, parts = studies.errors(found), found.estimated_error
    static = found.midspan_max / found.dynamic_amplification.sel(sensor="midspan")
    assert float(np.abs(found.midspan_min / found.midspan_max).max()) < 1.0  # so that the largest is the maximum
    np.testing.assert_allclose(told.midspan_max, parts.sel(result="midspan_max") * static, rtol=1e-6)
    amplified = told.dynamic_amplification.sel(sensor="midspan")
    np.testing.assert_allclose(amplified, parts.sel(result="dynamic_amplification midspan"), rtol=1e-6)
    assert told.midspan_max.attrs["units"] == "m" and told.midspan_max.dims == found.midspan_max.dims
    assert set(told) <= set(found) and "work" not in told


def test_two_datasets_are_compared_as_archives_are() -> None:
    first = studies.run(scenes.study("passage"))
    assert studies.compare(first, first).agree
    other = studies.compare(first, first.assign(midspan_max=2.0 * first.midspan_max))
    doubled = next(one for one in other.differences if one.name == "midspan_max")
    assert not other.agree and doubled.beyond == first.status.size


@pytest.mark.parametrize("call", [studies.answer, studies.figures])
def test_what_joins_several_studies_has_no_sentences_of_one(call: Any) -> None:
    """The new axis was left out of them without a word, and figures ended in a ValueError."""
    found = studies.run(scenes.study("passage"))
    assert "rope: this dataset joins the results of several studies" in refused(call, xr.concat([found, found], "rope"))
    assert "status: this dataset has lost the status" in refused(call, found.drop_vars("status"))


@pytest.mark.parametrize("run", RUNS)
@pytest.mark.parametrize("chunk", [0, -1, "a", 1.5, True])
def test_a_chunk_is_a_number_of_variants(run: Any, chunk: Any) -> None:
    assert "chunk: this is no number of variants; expected 1 or more" in refused(
        run, scenes.study("passage"), chunk=chunk
    )


def test_a_dict_is_no_file_and_a_number_no_key() -> None:
    assert "engine.Study(**tables) takes the tables of a dict" in refused(engine.load, {})
    assert "1: unknown key" in refused(scenes.study("passage").with_values, {1: 1})


def test_an_archive_is_written_again_where_that_is_asked_for(tmp_path: Path) -> None:
    """A cell of a notebook runs twice; nothing but an archive is replaced."""
    dataset, path = scenes.run("passage"), tmp_path / "run.nc"
    studies.write(dataset, path)
    with pytest.raises(BadInput, match="there is a file already"):
        studies.write(dataset, path)
    before = path.stat().st_mtime_ns
    assert studies.write(dataset, path, overwrite=True) == path and path.stat().st_mtime_ns > before
    (tmp_path / "notes.nc").write_text("mine")
    with pytest.raises(BadInput, match="no archive, and is never replaced"):
        studies.write(dataset, tmp_path / "notes.nc", overwrite=True)


def test_a_result_by_another_name_is_not_told_of() -> None:
    """Nor a dataset without it: sentences and tables are of all results."""
    found = scenes.run("passage")
    for changed in (found.rename(midspan_max="largest"), found.drop_vars("midspan_max")):
        with pytest.raises(BadInput, match="midspan_max: this dataset has lost a result of its study, or its name"):
            studies.answer(changed)


def test_one_result_is_exported_by_its_name(tmp_path: Path) -> None:
    found = scenes.run("passage")
    tables = [
        studies.export(found, tmp_path / f"{n}.csv", own) for n, own in enumerate(["midspan_max", ["midspan_max"]])
    ]
    assert tables[0].read_bytes() == tables[1].read_bytes() and b"midspan_max" in tables[0].read_bytes()


def test_swept_values_are_told_apart() -> None:
    """By as many digits as it takes: 11.25 m/s is neither 11.2 nor 11.3."""
    found = scenes.run("passage", 'speed = { of = "carriage.table.motion.speed", values = [11.0, 11.25, 11.5] }')
    (axis,) = Results.of(found).axes
    assert [axis.value(place) for place in range(3)] == ["11 m/s", "11.25 m/s", "11.5 m/s"]
    beyond = where_beyond(Results.of(found), np.array([0.0, 1.0, 0.0]), 0.5, axis)
    assert beyond == "at 11.25 m/s"  # as by itself, where nothing is beside it


def test_built_in_studies_are_run_by_their_names() -> None:
    """As by the command; a file of such a name has an ending."""
    found = studies.run("trajectory")
    assert found.attrs["title"] == engine.load(built_in()["trajectory"]).title
    with pytest.raises(BadInput, match=r"trajectory\.toml"):
        studies.run("trajectory.toml")


def test_errors_along_the_way_are_told_too() -> None:
    """Of frequencies and of influence lines there were none."""
    found = at_rest.run("eigenfrequencies", "positions = 5\nmodes = 4", at_rest.MASS)
    errors = studies.errors(found)
    assert list(errors.data_vars) == ["frequency"] and errors.frequency.attrs["units"] == "Hz"
    assert errors.frequency.dims == found.frequency.dims and float(errors.frequency.min()) > 0.0
    part = (errors.frequency / found.frequency).isel(mode=0)
    np.testing.assert_allclose(part.max("position"), found.estimated_error.sel(result="frequency 1"), rtol=1e-12)
    found = at_rest.run("influence", sweep=at_rest.MASS)
    errors = studies.errors(found)
    assert errors.middle.attrs["units"] == "m" and errors.middle.sizes == found.middle.sizes
    told = found.estimated_error.sel(result="middle") * np.abs(found.middle).max("position")
    np.testing.assert_allclose(errors.middle.max("position"), told, rtol=1e-12)
