"""What commands do with finished archives: tables, comparisons, the study's text; and the same from Python."""

import csv
import json
import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import engine
import studies
from results_schema.store.archive import open_archive
from studies.commands import catalogue
from studies.commands.cli import main
from studies.commands.screens import show_comparison
from studies.reporting import comparison, summary
from studies.results.formatting import quantity
from studies.results.results import Results
from studies.runs.archived import results_of
from studies.runs.identity import sources, sources_hash
from tests.studies.small import SEPARATED, SMALL, write

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def narrow(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A screen of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")


def output(capsys: Captured, *arguments: str, code: int = 0) -> str:
    """What a command prints that ends with this code."""
    capsys.readouterr()
    assert main(list(arguments)) == code
    return capsys.readouterr().out


def test_screens_fit_80_columns_and_speak_the_units_of_the_file(here: Path, capsys: Captured) -> None:
    typed = SMALL.replace("from = 0.5, to = 10.0", 'from = "1.8 km/h", to = "36 km/h"')
    write(here, typed)
    shown = output(capsys, "run", "small.toml", "-v")
    assert "36 km/h" in shown and "m/s" not in shown
    checked = output(capsys, "check", "small.toml")
    screens = [shown, checked, *(output(capsys, *command) for command in (["info", "small.nc"], ["list"]))]
    assert all(len(line) <= 80 for screen in screens for line in screen.splitlines())
    assert "1.8 to 36 km/h" in checked


WIDE = (
    SMALL[: SMALL.index("speed = {")]
    + """
speed = { of = "carriage.trolley.motion.speed", sobol = 8, from = "2 km/h", to = "36 km/h" }
mass = { of = "carriage.trolley.mass", sobol = 8, from = 0.1, to = 1.0 }
damping_ratio = { of = "body.beam.damping_ratio", sobol = 8, from = 0.01, to = 0.03 }
gravity = { of = "gravity", sobol = 8, from = 9, to = 10 }

[output]
percentiles = [5, 50, 95]

[solver]
steps = 400
audit = 0
"""
)


def test_no_table_breaks_within_a_number_or_before_its_unit(here: Path, capsys: Captured) -> None:
    """Where columns have no room each result is a block; which of its ends is where is told."""
    write(here, WIDE)
    write(here, WIDE.replace("modes = 4", "modes = 3"), "other.toml")
    shown = output(capsys, "run", "small.toml") + output(capsys, "run", "small.toml", "-v")
    assert main(["run", "other.toml"]) == 0
    compared = output(capsys, "compare", "small.nc", "other.nc")
    assert all(len(line) <= 80 for line in (shown + compared).splitlines())
    assert not re.search(r"\d *\n *(m|mm|µm|N|kN|m/s²|km/h|kg|%|s|Hz)\b", shown + compared)
    results = results_of(open_archive("small.nc"))
    for one in summary.in_tables(results):
        values = (one.smallest.value, *one.percentiles, one.largest.value)
        assert one.is_constant or all(f" {one.value(value)}" in shown for value in values)
        assert one.is_constant or f"{one.name} {one.sensor}".strip() in shown.splitlines()
    differences = comparison.compared(results, results_of(open_archive("other.nc"))).differences
    for found in differences:
        assert all(quantity(value, found.units) in compared for value in (*found.values, *found.extremes))
    blocks = shown[shown.index("\ntrolley_contact_force_min\n") :].split("\n  ")
    lowest = float(results.dataset.trolley_contact_force_min.min())
    [apart] = [one for one in differences if one.name == "trolley_contact_force_min"]
    assert apart.extremes[0] == lowest
    [low] = [one for one in summary.in_tables(results) if one.name == "trolley_contact_force_min"]
    assert low.telling.value == lowest and blocks[2].startswith(f"smallest at speed {low.telling.words['speed']}")
    [high] = [one for one in summary.in_tables(results) if one.name == "midspan_max"]
    assert high.telling.value == float(results.dataset.midspan_max.max())


def test_forces_that_press_as_they_are_written_stand_in_no_table(here: Path, capsys: Captured) -> None:
    """But in the archive; what is the same everywhere has one line."""
    train = "[train.tram]\non = 'beam'\nkind = 'force'\nforce = 2.0\nspacing = [0.2]\n"
    motion = "motion = { kind = 'cruise', start = 0.0, end = 0.5, speed = 1.0 }\n\n"
    fixed = SMALL.replace('steps = "auto"\naudit = 2', "steps = 400\naudit = 0\ntolerance = 0.1")
    write(here, fixed.replace("[carriage.trolley]", f"{train}{motion}[carriage.trolley]", 1))
    told = output(capsys, "run", "small.toml", "-v")
    assert "trolley_contact_force_max" in told and "tram_1" not in told and "tram_2" not in told
    assert main(["report", "small.nc", "-o", "page"]) == 0
    results = results_of(open_archive("small.nc"))
    assert not [one.name for one in summary.in_tables(results) if one.name.startswith("tram")]
    assert float(results.dataset["tram_2_contact_force_max"].max()) == 2.0
    names = [one.name for one in summary.shown(results) if one.is_constant]
    details = told.partition("Smallest and largest of results")[2]
    assert names and all(len(re.findall(rf"^{name} ", details, re.MULTILINE)) == 1 for name in names)


def test_statuses_that_a_study_expects_end_with_0(here: Path, capsys: Captured) -> None:
    write(here, SEPARATED)
    assert main(["run", "small.toml"]) == 3
    calm = SEPARATED.replace("audit = 2", "audit = 0")  # the fixed number of modes would miss the tolerance
    write(here, 'expected = ["separated"]\n' + calm, "calm.toml")
    assert "as the study expects" in output(capsys, "run", "calm.toml")
    write(here, 'expected = ["seperated"]\n' + SEPARATED, "wrong.toml")
    assert main(["check", "wrong.toml"]) == 2
    assert 'did you mean "separated"' in capsys.readouterr().err


def test_export_writes_one_row_per_variant(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0
    assert "wrote small.csv" in output(capsys, "export", "small.nc", "small.csv")
    rows = list(csv.DictReader(Path("small.csv").read_text(encoding="utf-8").splitlines()))
    root = open_archive("small.nc").root
    assert len(rows) == 16 and {row["status"] for row in rows} == {"ok"}
    for row in rows:
        at = root.sel(speed=float(row["speed (m s-1)"]), mass=float(row["mass (kg)"]))
        assert float(row["midspan_max (m)"]) == float(at.midspan_max)
        assert float(row["dynamic_amplification midspan"]) == float(at.dynamic_amplification.sel(sensor="midspan"))
    assert main(["export", "small.nc", "small.csv"]) == 2
    assert main(["export", "small.nc", "small.xls"]) == 2


def test_histories_are_no_rows_of_a_table(here: Path, capsys: Captured) -> None:
    """A file without what was asked for was written, and the command said that it had done so."""
    write(here)
    assert main(["run", "small.toml"]) == 0
    assert main(["export", "small.nc", "small.csv", "--results", "midspan"]) == 2
    assert "its extremes, midspan_max,midspan_min" in " ".join(capsys.readouterr().err.split())
    assert not Path("small.csv").exists()


def exported(archive: str, *arguments: str) -> list[dict[str, str]]:
    Path("own.csv").unlink(missing_ok=True)
    assert main(["export", archive, "own.csv", *arguments]) == 0
    return list(csv.DictReader(Path("own.csv").read_text(encoding="utf-8").splitlines()))


def test_an_exported_table_has_swept_numbers_as_typed_and_the_chosen_results(here: Path, capsys: Captured) -> None:
    typed = SMALL.replace("from = 0.5, to = 10.0", 'from = "10 km/h", to = "45 km/h"').replace(', spacing = "log"', "")
    write(here, typed)
    assert main(["run", "small.toml"]) == 0
    rows = exported("small.nc", "--results", "midspan_max, dynamic_amplification")
    assert list(rows[0]) == [
        *("speed (km/h)", "mass (kg)", "status", "midspan_max (m)", "dynamic_amplification midspan"),
    ]
    assert [row["speed (km/h)"] for row in rows[::2]] == [f"{speed}.0" for speed in range(10, 46, 5)]
    assert main(["export", "small.nc", "other.csv", "--results", "midspan_mux"]) == 2
    assert 'did you mean "midspan_max"' in capsys.readouterr().err


def test_an_exported_table_has_no_contact_forces_of_forces(here: Path) -> None:
    write(here, SMALL.replace('kind = "mass"\nmass = 1.0', 'kind = "force"\nforce = 1.0').replace("mass", "force"))
    assert main(["run", "small.toml"]) == 0
    headings = list(exported("small.nc")[0])
    assert "midspan_max (m)" in headings and "estimated_error midspan_max" in headings
    assert not [name for name in headings if "contact_force" in name or "separation" in name]
    assert "trolley_contact_force_min (N)" in exported("small.nc", "--results", "trolley_contact_force_min")[0]


def test_compare_tells_what_differs(here: Path, capsys: Captured) -> None:
    write(here)
    write(here, SMALL.replace("damping_ratio = 0.02", "damping_ratio = 0.03"), "damped.toml")
    write(here, SMALL.replace("modes = 4", "modes = 5"), "finer.toml")
    write(here, SMALL[: SMALL.index("mass = {")], "other.toml")
    for name in ("small", "damped", "finer", "other"):
        assert main(["run", f"{name}.toml"]) in (0, 3)
    shown = output(capsys, "compare", "small.nc", "damped.nc", code=3)
    assert "body.beam.damping_ratio" in shown and "midspan_max" in shown and "They differ" in shown
    assert "agree within" in output(capsys, "compare", "small.nc", "small.nc")
    assert "Wherever errors are told" not in shown
    assert main(["compare", "small.nc", "other.nc"]) == 2
    assert "received speed, mass in the first, speed in the second" in capsys.readouterr().err
    apart = open_archive("finer.nc").root.midspan_max - open_archive("small.nc").root.midspan_max
    found = comparison.compared(results_of(open_archive("small.nc")), results_of(open_archive("finer.nc")))
    told = next(one for one in found.differences if one.name == "midspan_max")
    assert abs(told.largest) == pytest.approx(float(abs(apart).max()), rel=1e-12)
    assert [(change.key, change.first, change.second) for change in found.changes] == [("body.beam.modes", 4, 5)]


def test_compare_tells_other_states_of_the_program(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0
    made = results_of(open_archive("small.nc"))
    other = Results(made.dataset.assign_attrs(sources="0123456789ab"), made.study, made.models)
    assert comparison.compared(made, made).programs == ()
    found = comparison.compared(other, made)
    own = f"wanderlast {version('wanderlast')}, sources "
    assert found.programs == (f"{own}0123456789ab", own + sources_hash(sources())[:12]) and found.agree
    show_comparison(found)
    assert f"Made by different states of the program: {own}0123456789ab and" in " ".join(
        capsys.readouterr().out.split()
    )


def test_compare_shows_both_values_where_they_differ_most_and_both_of_largest_size(
    here: Path, capsys: Captured
) -> None:
    write(here)
    write(here, SMALL.replace("damping_ratio = 0.02", "damping_ratio = 0.03"), "damped.toml")
    for name in ("small", "damped"):
        assert main(["run", f"{name}.toml"]) == 0
    shown = output(capsys, "compare", "small.nc", "damped.nc", code=3)
    lines = shown.splitlines()
    assert max(map(len, lines)) <= 80
    told = [line for line in lines if line.startswith("midspan_max ")]
    pair = [open_archive(f"{name}.nc").root.midspan_max.values for name in ("small", "damped")]
    place = np.unravel_index(np.abs(pair[1] - pair[0]).argmax(), pair[0].shape)
    apart = [quantity(float(value), "m") for value in (pair[0][place], pair[1][place], (pair[1] - pair[0])[place])]
    assert re.split("  +", told[0])[1:4] == apart
    assert re.split("  +", told[1])[1:3] == [quantity(float(values.max()), "m") for values in pair]


def test_a_number_that_is_missing_in_one_archive_differs(here: Path, capsys: Captured) -> None:
    write(here)
    whole = Results.of(studies.run(engine.load("small.toml")))
    gaps = whole.dataset.copy(deep=True)
    gaps["midspan_max"][3, 1] = np.nan
    for pair in ((whole, Results.of(gaps)), (Results.of(gaps), whole)):
        found = comparison.compared(*pair)
        told = next(one for one in found.differences if one.name == "midspan_max")
        assert np.isnan(told.largest) and told.beyond == 1 and not found.agree
    less = comparison.compared(whole, Results.of(whole.dataset.drop_vars("midspan_min")))
    assert less.only_in_one == ["midspan_min"] and not less.agree
    assert comparison.compared(whole, whole).agree


def test_info_prints_the_study_file(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0
    assert output(capsys, "info", "small.nc", "--study") == SMALL
    assert "numpy" in output(capsys, "info", "small.nc", "--all")


def test_the_schema_knows_every_key_of_every_built_in_study(capsys: Captured) -> None:
    schema = json.loads(output(capsys, "schema"))
    jsonschema.Draft202012Validator.check_schema(schema)
    known = jsonschema.Draft202012Validator(schema)
    for name in (*catalogue.built_in(), *catalogue.starts()):
        known.validate(tomllib.loads(catalogue.start_text(name)))
    for wrong in ({"kind": "passage", "boddy": {}}, {"kind": "pasage"}):
        assert not known.is_valid(wrong)


def test_answers_say_what_is_not_held_and_where_a_sweep_ends(here: Path, capsys: Captured) -> None:
    force = SMALL.replace('kind = "mass"\nmass = 1.0', 'kind = "force"\nforce = 10.0')
    force = force.replace('mass = { of = "carriage.trolley.mass", values = [0.1, 1.0] }\n', "")
    text = force.replace("[sweep]", '[sensor.shake]\nbody = "beam"\nat = 0.5\nquantity = "acceleration"\n\n[sweep]')
    write(here, text)
    shown = " ".join(output(capsys, "run", "small.toml").split())
    assert "an end of the swept speed" in shown and "contact_force" not in shown
    errors = open_archive("small.nc").root.estimated_error.sel(result="shake_max")
    assert ("held to no tolerance: shake_max up to" in shown) == bool(errors.max() > 0.02)
    wild = text.replace('of = "carriage.trolley.motion.speed"', 'of = "carriage.*.motion.speed"')
    write(here, wild, "wild.toml")
    assert main(["check", "wild.toml"]) == 2
    assert 'of = ["carriage.trolley.motion.speed"]' in capsys.readouterr().err


def test_percentiles_are_told(here: Path, capsys: Captured) -> None:
    write(here, f"{SMALL}\n[output]\npercentiles = [5, 50]\n")
    capsys.readouterr()
    assert main(["run", "small.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    values = open_archive("small.nc").root.midspan_max.values
    told = next(entry for entry in found["results"] if entry["name"] == "midspan_max")["percentiles"]
    assert told == {"5.0": np.percentile(values, 5), "50.0": np.percentile(values, 50)}
    assert "50 %" in output(capsys, "run", "small.toml")


def test_python_writes_and_reports_what_the_command_does(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml", "-o", "command.nc"]) == 0
    dataset = studies.run(engine.load("small.toml"))
    studies.write(dataset, "python.nc")
    first, second = open_archive("command.nc"), open_archive("python.nc")
    assert set(first.root.variables) == set(second.root.variables)
    for name in first.root.variables:
        np.testing.assert_array_equal(first.root[name].values, second.root[name].values)
    assert set(second.groups) == {group for group in first.groups if group != "/audit"}
    assert first.root.attrs["results_key"] == second.root.attrs["results_key"]
    assert main(["compare", "command.nc", "python.nc"]) == 0
    page = studies.report(dataset, "page").read_text(encoding="utf-8")
    assert main(["report", "python.nc", "-o", "other"]) == 0
    other = Path("other/report.html").read_text(encoding="utf-8")
    leads = [[line for line in text.splitlines() if '<p class="lead"' in line] for text in (page, other)]
    assert leads[0] and leads[0] == leads[1]
    assert main(["info", "python.nc"]) == 0
    study = engine.load("small.toml")
    assert "small" in study._repr_html_() and "16 variants" in engine.make_plan(study)._repr_html_()
    assert "<svg" in studies.figures(dataset)[0]._repr_html_()
