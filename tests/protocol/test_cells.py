"""Archives of cells against numpy on the archive of all variants of the same study."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import engine
import studies
from engine.accuracy.jobs import Job
from engine.batch.executors import Threads
from engine.batch.plan import Plan
from engine.scene.study import Study
from results_schema.arrays import Counts
from results_schema.errors import BadInput
from results_schema.gravest_status import lost
from results_schema.status import Status
from results_schema.store import rows
from results_schema.store.archive import open_archive
from studies.commands.cli import main as command
from studies.protocol.parts import Variants, Work
from studies.protocol.store import Memory
from studies.protocol.study import kind_of
from studies.reporting.tabulated import table_of
from studies.results.formatting import quantity
from studies.results.results import Results
from tests.studies.every_way import assert_same_archives
from tests.studies.small import SEPARATED

PERCENT = (5.0, 50.0, 99.0)
# Random masses and dampings at each of three speeds: some lift off.
TEXT = (
    SEPARATED.split("[sweep]")[0]
    + """
[sensor.quarter]
body = "beam"
at = 0.25
quantity = "bending_moment"

[sweep]
speed = { of = "carriage.trolley.motion.speed", values = [1.0, 4.0, 9.0] }
mass = { of = "carriage.trolley.mass", sobol = 300, from = 0.1, to = 10.0 }
damping = { of = "body.beam.damping_ratio", sobol = 300, from = 0.0, to = 0.05 }

[solver]
steps = 200
audit = 4
"""
)
KEPT = {
    "all": "",
    "extremes": '\n[output]\nkeep = "extremes"\n',
    "percentiles": f'\n[output]\nkeep = "percentiles"\npercentiles = {list(PERCENT)}\n',
    "one cell": f'\n[output]\nkeep = "percentiles"\ncells = []\npercentiles = {list(PERCENT)}\n',
}


def study(kept: str, text: str = TEXT) -> Study:
    return engine.load(text + KEPT[kept])


@pytest.fixture(scope="module")
def whole() -> xr.Dataset:
    return studies.run(study("all"))


def columns(whole: xr.Dataset, name: str, one_cell: bool) -> np.ndarray:
    """(cells, variants of each) a result of all variants by its full name, in the order of their numbers."""
    result, _, sensor = name.partition(" ")
    array = whole[result].sel(sensor=sensor) if sensor else whole[result]
    values = array.transpose("speed", "variant").values
    return values.reshape(1, -1) if one_cell else values


def told(whole: xr.Dataset, name: str, one_cell: bool) -> np.ndarray:
    """(cells, variants of each) the estimated errors of a result, NaN where no estimate exists."""
    errors = whole["estimated_error"].transpose("speed", "variant", "result")
    known = name in whole["result"].values
    found = errors.sel(result=name).values if known else np.full(errors.shape[:2], np.nan)
    assert known is not name.startswith(("work", "error_estimate", "mass_ratio", "speed_ratio"))
    return found.reshape(1, -1) if one_cell else found


@pytest.mark.parametrize("kept", ["extremes", "percentiles", "one cell"])
def test_cells_have_what_numpy_finds_in_all_variants(whole: xr.Dataset, kept: str) -> None:
    """And count them by their statuses."""
    found, one = studies.run(study(kept)), kept == "one cell"
    assert found["status"].dims == (() if one else ("speed",))
    names = found["result"].values.tolist()
    assert {"midspan_max", "quarter_min", "trolley_contact_force_min", "dynamic_amplification quarter"} <= set(names)
    cells = 1 if one else 3
    statuses = columns(whole, "status", one)
    wanted = [[np.count_nonzero(row == status) for status in Status] for row in statuses]
    assert (statuses == Status.SEPARATED).any()
    np.testing.assert_array_equal(found["status_count"].values.reshape(-1, len(Status)), wanted)
    numbers = np.arange(900).reshape(cells, -1)
    swept = {"speed": np.repeat(whole["speed"].values, 300).reshape(cells, -1)}
    swept |= {name: np.tile(whole[name].values, 3).reshape(cells, -1) for name in ("mass", "damping")}
    for place, name in enumerate(names):
        values = columns(whole, name, one)
        for end, pick in (("smallest", np.nanargmin), ("largest", np.nanargmax)):
            at = pick(values, axis=1)
            places = np.arange(cells), at
            own = found.isel(result=place)
            np.testing.assert_array_equal(own[end].values.ravel(), values[places])
            np.testing.assert_array_equal(own[f"{end}_error"].values.ravel(), told(whole, name, one)[places])
            np.testing.assert_array_equal(own[f"{end}_variant"].values.ravel(), numbers[places])
            for axis, column in swept.items():
                np.testing.assert_array_equal(own[f"{end}_at"].sel(swept=axis).values.ravel(), column[places])
        if "percentile" in found:
            percentiles = np.nanpercentile(values, PERCENT, axis=1).T
            np.testing.assert_array_equal(own["percentile"].values.reshape(cells, -1), percentiles)


def test_variants_that_fail_are_counted_and_have_no_extreme(monkeypatch: pytest.MonkeyPatch) -> None:
    from engine.batch import chunk

    marched = chunk.run_chunk

    def failing(plan: Any, group: Any, variants: np.ndarray, *rest: Any) -> Any:
        """As if variants of a number that seven divides had diverged."""
        flat, selected = marched(plan, group, variants, *rest)
        bad = variants % 7 == 0
        flat["status"] = np.where(bad, np.int8(Status.DIVERGED), flat["status"])
        for array in flat.values():
            if array.dtype.kind == "f":
                array[bad] = np.nan
        return flat, selected

    monkeypatch.setattr(chunk, "run_chunk", failing)
    text = f'{TEXT}\n[output]\nhistories = "none"\n'
    whole, found = studies.run(engine.load(text)), studies.run(study("percentiles"))
    gone = lost(whole["status"].values)
    assert gone.sum() == np.count_nonzero(np.arange(900) % 7 == 0)
    counts = found["status_count"].sel(status_name="diverged").values
    np.testing.assert_array_equal(counts, np.count_nonzero(gone, axis=whole["status"].dims.index("variant")))
    assert (found["status"].values == Status.DIVERGED).all()
    assert (found["largest_variant"].values % 7 != 0).all()
    values = whole["midspan_max"].transpose("speed", "variant").values
    own = found.sel(result="midspan_max")
    np.testing.assert_array_equal(own["largest"], np.nanmax(values, axis=1))
    np.testing.assert_array_equal(own["percentile"], np.nanpercentile(values, PERCENT, axis=1).T)


class Deadly(Threads):
    """Threads of which variants of a number that seven divides are said to end every process; pilots end none."""

    def share_out(self, subject: Any, jobs: Sequence[Job[Any]], *rest: Any, **grace: float) -> Sequence[Counts]:
        if not isinstance(subject, Plan):
            return super().share_out(subject, jobs, *rest, **grace)
        safe = [replace(job, lanes=job.lanes[job.lanes % 7 != 0]) for job in jobs]
        super().share_out(subject, [job for job in safe if job.lanes.size], *rest, **grace)
        return [bad for job in jobs if (bad := job.lanes[job.lanes % 7 == 0]).size]


@pytest.mark.fault(18, 32)
@pytest.mark.parametrize("kept", ["extremes", "percentiles"])
def test_variants_that_end_every_process_are_counted_as_crashed(whole: xr.Dataset, kept: str) -> None:
    parts, store = kind_of(study(kept)).parts(study(kept)), Memory()
    parts.compute(store, Work(place=Deadly(2)))
    found = parts.gather(store)
    statuses, values = (whole[name].transpose("speed", "variant").values.copy() for name in ("status", "midspan_max"))
    bad = np.arange(900).reshape(3, 300) % 7 == 0
    statuses[bad], values[bad] = Status.CRASHED, np.nan
    wanted = [[np.count_nonzero(row == status) for status in Status] for row in statuses]
    np.testing.assert_array_equal(found["status_count"], wanted)
    assert (found["status"].values == Status.CRASHED).all()
    own = found.sel(result="midspan_max")
    np.testing.assert_array_equal(own["smallest"], np.nanmin(values, axis=1))
    np.testing.assert_array_equal(own["largest"], np.nanmax(values, axis=1))
    np.testing.assert_array_equal(own["largest_variant"] % 300, np.nanargmax(values, axis=1))
    if kept == "percentiles":
        np.testing.assert_array_equal(own["percentile"], np.nanpercentile(values, PERCENT, axis=1).T)


@pytest.mark.parametrize("kept", ["extremes", "percentiles"])
def test_a_resumed_run_has_the_same_bytes(here: Path, kept: str, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("study.toml").write_text(TEXT + KEPT[kept], encoding="utf-8")
    assert command(["run", "study.toml", "-o", "whole.nc"]) == 3
    written = []

    def stopped(self: Any, store: Any, chunk: Any) -> None:
        keep(self, store, chunk)
        written.append(chunk)
        raise KeyboardInterrupt

    keep = Variants._keep
    with monkeypatch.context() as patched:
        patched.setattr(rows, "BYTES_PER_PART", 1)
        patched.setattr(Variants, "_keep", stopped)
        assert command(["run", "study.toml", "-o", "again.nc"]) == 130
    assert written and not Path("again.nc").exists()
    assert command(["run", "study.toml", "-o", "again.nc"]) == 3
    assert_same_archives(open_archive("again.nc"), open_archive("whole.nc"))


def test_every_command_reads_archives_of_cells(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("study.toml").write_text(TEXT + KEPT["percentiles"], encoding="utf-8")
    assert command(["check", "study.toml"]) == 0
    assert "percentiles of 3 cells" in capsys.readouterr().out
    assert command(["run", "study.toml", "-v", "-o", "a.nc"]) == 3
    said = " ".join(capsys.readouterr().out.split())
    assert "Of 900 variants the archive keeps" in said and "of each of 3 cells (speed)" in said
    assert command(["run", "study.toml", "-o", "a.nc"]) == 3
    opened = Results.of(open_archive("a.nc").root).status_counts[Status.SEPARATED]
    counting = f'Values count {opened} variants whose contact opens, which keep = "all" leaves out.'
    assert opened and counting in " ".join(capsys.readouterr().out.split())
    assert command(["run", "study.toml", "--json", "-o", "a.nc"]) == 3
    assert '"variants": 900' in capsys.readouterr().out
    assert command(["info", "a.nc"]) == 0
    assert "900" in capsys.readouterr().out
    assert command(["report", "a.nc"]) == 0
    page = Path("a-report/report.html").read_text(encoding="utf-8")
    assert "900 variants range over" in page
    varied = page[page.index("What was varied") :].partition("</table>")[0].replace("\N{NO-BREAK SPACE}", " ")
    assert all(words in varied for words in ("3 values", "300 values", "1 to 9 m/s", "mass", "damping"))
    assert command(["export", "a.nc", "a.csv"]) == 0
    rows = Path("a.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + 3 * open_archive("a.nc").root.sizes["result"] and "smallest_at mass" in rows[0]
    assert "smallest_at speed (m s-1),smallest_at mass (kg),smallest_at damping,largest" in rows[0]
    capsys.readouterr()
    assert command(["compare", "a.nc", "a.nc"]) == 2
    assert "no variants to compare" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "where"),
    [
        (TEXT + '\n[output]\nkeep = "extremes"\nhistories = "all"\n', "output.histories"),
        (TEXT + '\n[output]\nkeep = "extremes"\nunreduced = 1\n', "output.unreduced"),
        (TEXT + '\n[output]\nkeep = "extremes"\npercentiles = [50]\n', "output"),
        (TEXT + '\n[output]\nkeep = "percentiles"\n', "output"),
        (TEXT + '\n[output]\ncells = ["speed"]\n', "output"),
        (TEXT + '\n[output]\nkeep = "extremes"\ncells = ["mass"]\n', "output.cells"),
        (TEXT.split("[sweep]")[0] + '\n[output]\nkeep = "extremes"\n', "output.keep"),
        (TEXT + '\n[output]\nkeep = "extremes"\n[envelope.all]\nbody = "beam"\n', "envelope"),
        (TEXT.replace('"passage"', '"influence"') + '\n[output]\nkeep = "extremes"\n', "output.keep"),
    ],
)
def test_what_cells_cannot_hold_is_refused(text: str, where: str) -> None:
    with pytest.raises(BadInput) as caught:
        studies.run(engine.load(text))
    assert caught.value.where == where or caught.value.where.endswith(f": {where}")


def test_tables_have_one_unit_for_a_swept_number(tmp_path: Path) -> None:
    text = TEXT.replace("[1.0, 4.0, 9.0]", '["3.6 km/h", "14.4 km/h"]').replace("sobol = 300", "sobol = 8")
    found = studies.run(engine.load(text + KEPT["extremes"]))
    table, _ = table_of(Results.of(found))
    np.testing.assert_array_equal(table["largest_at speed (km/h)"], table["speed (km/h)"])
    np.testing.assert_array_equal(table["largest_at mass (kg)"], found["largest_at"].sel(swept="mass").values.ravel())


@pytest.mark.parametrize("kept", ["percentiles", "one cell"])
def test_answers_of_cells_begin_with_the_limit_and_judge_it(
    whole: xr.Dataset, here: Path, kept: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """As all variants do; the terminal has the percentiles."""
    ends = [whole[f"quarter_{end}"].transpose("speed", "variant").values for end in ("max", "min")]
    largest = np.nanmax(np.abs(ends), axis=(0, 2))
    order, dims = np.argsort(largest), 1 if kept == "percentiles" else 0
    for limit, count in ((0.5 * largest.min(), 3), (largest[order[1:]].mean(), 1), (2.0 * largest.max(), 0)):
        text = TEXT.replace("[sweep]", f"[question]\nbending_moment = {float(limit)!r}\n\n[sweep]")
        first = studies.answer(studies.run(engine.load(text + KEPT[kept])))[0]
        assert first.startswith("quarter_max: from ") and "Its absolute value exceeds " in first
        some = f"in some variants of {'all' if count == 3 else count} of 3 cells" if dims else "in some of the variants"
        assert ("nowhere." in first) if count == 0 else (some in first)
        last = f", speed {whole.speed.values[order[-1]]:g} m/s; those whose contact opens count too."
        assert first.endswith(last) == (dims == 1 and count == 1)
    Path("study.toml").write_text(TEXT + KEPT[kept], encoding="utf-8")
    assert command(["run", "study.toml", "-o", "a.nc"]) == 3
    shown = " ".join(capsys.readouterr().out.split())
    assert ("Percentiles of 3 cells" in shown) == (dims == 1) and "50 %" in shown
    values = open_archive("a.nc").root["percentile"].sel(result="midspan_max", percent=50.0).values.ravel()
    assert quantity(values.min(), "m") in shown and quantity(values.max(), "m") in shown


def _largest(found: xr.Dataset) -> float:
    """The largest absolute moment."""
    names = ("quarter", "more_0", "more_1", "more_2", "more_3")
    sides = ("largest", "max"), ("smallest", "min")
    ends = [found[side].sel(result=[f"{name}_{end}" for name in names]) for side, end in sides]
    return max(float(np.abs(end).max()) for end in ends)


def test_every_limit_that_is_exceeded_and_supports_that_pull_are_told() -> None:
    """One sensor's was left out, as three sentences were told, and so was uplift."""
    more = "".join(
        f'[sensor.more_{n}]\nbody = "beam"\nat = {at}\nquantity = "bending_moment"\n'
        for n, at in enumerate((0.3, 0.4, 0.5, 0.6))
    )
    more += '[sensor.foot]\nbody = "beam"\nat = 0.0\nquantity = "support_reaction"\n'
    text = TEXT.replace("[sweep]", f"{more}\n[question]\nbending_moment = 1e-3\n\n[sweep]")
    found = studies.run(engine.load(text + KEPT["percentiles"]))
    told = studies.answer(found)
    assert [one.partition(":")[0] for one in told[:3]] == ["quarter_max", "more_0_max", "more_1_max"]
    largest, smallest = (
        float(found["largest"].sel(result="more_2_max").max()),
        found["smallest"].sel(result="more_2_min"),
    )
    size = quantity(max(largest, -float(smallest.min())), "N m")
    assert told[3].startswith(f"Of the other sensors with a limit more_2 (up to {size}) and more_3 (up")
    for error, why in ((0.5, "By its estimated errors"), (np.nan, "As no estimate exists")):
        wide = studies.run(engine.load(text.replace("1e-3", f"{1.1 * _largest(found)!r}") + KEPT["percentiles"]))
        assert not any("perhaps" in one for one in studies.answer(wide))
        for side in ("largest", "smallest"):
            wide[f"{side}_error"].loc[{"result": ["more_2_max", "more_2_min"]}] = error
        assert f"{why} more_2 perhaps exceeds its limit." in studies.answer(wide)
    least = float(found["smallest"].sel(result="foot_min").min())
    assert least < 0.0 and f"Supports pull: foot by up to {quantity(-least, 'N')}." in told


def test_limits_that_cells_keep_but_for_estimated_errors_are_no_verdict(whole: xr.Dataset, here: Path) -> None:
    """ "Nowhere" of values that are off by a sixth is told as what it is."""
    ends = [whole[f"quarter_{end}"].transpose("speed", "variant").values for end in ("max", "min")]
    limit = 1.1 * float(np.nanmax(np.abs(ends)))
    text = TEXT.replace("[sweep]", f"[question]\nbending_moment = {limit!r}\n\n[sweep]") + KEPT["percentiles"]
    dataset = studies.run(engine.load(text))
    assert "nowhere." in studies.answer(dataset)[0] and "estimated" not in studies.answer(dataset)[0]
    for side in ("largest", "smallest"):
        dataset[f"{side}_error"].loc[{"result": ["quarter_max", "quarter_min"]}] = 0.16
    first = studies.answer(dataset)[0]
    assert first.count("(estimated to within 16 %)") == 2
    assert "nowhere; by estimated errors of up to 16 % perhaps somewhere, which a tolerance of its own on" in first
    dataset["largest_error"].loc[{"result": "quarter_max"}] = np.nan
    assert "nowhere; where no estimate exists perhaps somewhere, which a tolerance of" in studies.answer(dataset)[0]
