"""The command: what it prints, what it writes, and every exit code."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.kernels.compiling import WORDS
from results_schema.errors import WorkersGaveUp
from results_schema.store import files
from results_schema.store.archive import open_archive
from results_schema.store.parts import Lock
from studies.commands import catalogue
from studies.commands import error_exit as trouble
from studies.commands.cli import main
from tests.engine.build import beam, mass, study, swing
from tests.schema.samples import FailNth, ReadOnlyFrom
from tests.studies.every_way import assert_same_archives
from tests.studies.small import SEPARATED, SMALL, write

Captured = pytest.CaptureFixture[str]
pytestmark = pytest.mark.usefixtures("here")


def run_json(capsys: Captured, *arguments: str) -> tuple[int, dict[str, Any]]:
    """Exit code and JSON of a run."""
    capsys.readouterr()
    code = main(["run", *arguments, "--json"])
    return code, json.loads(capsys.readouterr().out)


def refused(capsys: Captured, *arguments: str, code: int = 2) -> str:
    """The one line of complaint of a command that must fail with this code, and print nothing else."""
    capsys.readouterr()
    assert main(list(arguments)) == code
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith("wanderlast: ") and "Traceback" not in output.err
    assert output.err.count("\n") == 1
    return output.err


def test_run_writes_an_archive_and_a_summary(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0
    output = capsys.readouterr()
    assert output.err in ("", f"small: {WORDS}\n")
    for words in ("small", "midspan_max", "trolley_contact_force_min", "16 variants", "small.nc"):
        assert words in output.out
    archive = open_archive("small.nc")
    assert archive.root.sizes["speed"] == 8 and archive.root.sizes["mass"] == 2
    assert "/model/beam" in archive.groups
    attributes = archive.root.attrs
    assert attributes["study"] == SMALL and attributes["schema_version"] == 2 and attributes["study_kind"] == "passage"
    assert attributes["Conventions"].startswith("CF-") and attributes["run_seconds"] > 0
    assert any(text.startswith("numpy ") for text in attributes["packages"])
    assert sorted(path.name for path in here.iterdir()) == ["small.nc", "small.toml"]


def test_run_prints_one_json_object(here: Path, capsys: Captured) -> None:
    write(here)
    code, found = run_json(capsys, "small.toml", "-o", "other.nc", "--threads", "1")
    assert code == found["exit_code"] == 0
    assert found["archive"] == "other.nc" and found["variants"] == 16 and found["status"] == {"ok": 16}
    largest = next(entry for entry in found["results"] if entry["name"] == "midspan_max")["largest"]
    root = open_archive("other.nc").root
    assert largest["value"] == float(root.midspan_max.max())
    assert float(root.midspan_max.sel(largest["at"])) == largest["value"]


@pytest.mark.fault(28)
def test_a_finished_study_is_left_alone_and_its_code_stays(here: Path, capsys: Captured) -> None:
    write(here, SEPARATED)
    code, first = run_json(capsys, "small.toml")
    assert code == 3 and first["status"]["separated"] > 0 and not first["was_finished"]
    before = Path("small.nc").read_bytes()
    code, second = run_json(capsys, "small.toml")
    assert code == 3 and second["was_finished"] and second["results"] == first["results"]
    assert Path("small.nc").read_bytes() == before
    code, third = run_json(capsys, "small.toml", "--overwrite")
    assert code == 3 and not third["was_finished"] and third["resumed"] == 0


@pytest.mark.fault(17)
def test_a_study_in_which_a_variant_diverges_ends_with_3(here: Path, capsys: Captured) -> None:
    """Parametric resonance without damping, beside two light carriages."""
    sweep = {"weight": {"of": "carriage.car.mass", "values": [0.001, 1.0, 0.002]}}
    way = swing(0.5, 0.5, 0.608 * 0.5 * math.pi, 40)
    given = study(beam(modes=3), mass(0.5, way), sweep=sweep, solver={"steps": 400, "tolerance": 0.1})
    write(here, given.source.text)
    code, told = run_json(capsys, "small.toml")
    assert code == told["exit_code"] == 3 and told["status"] == {"ok": 2, "diverged": 1}
    root = open_archive("small.nc").root
    assert root.status.values.tolist() == [0, 5, 0] and np.isnan(root.midspan_max.values).tolist() == [0, 1, 0]
    assert (root.diverged_step.values >= 0).tolist() == [0, 1, 0]


@pytest.mark.fault(28)
def test_another_study_is_overwritten_only_if_asked(here: Path, capsys: Captured) -> None:
    write(here)
    write(here, SEPARATED, "heavy.toml")
    assert main(["run", "small.toml", "-o", "a.nc"]) == 0
    before = Path("a.nc").read_bytes()
    assert "a.nc" in refused(capsys, "run", "heavy.toml", "-o", "a.nc")
    assert Path("a.nc").read_bytes() == before
    assert main(["run", "heavy.toml", "-o", "a.nc", "--overwrite"]) == 3
    assert open_archive("a.nc").root.title == "heavy"


def test_draw_writes_one_page_beside_the_study(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["draw", "small.toml"]) == 0
    assert "small-drawing/drawing.html" in capsys.readouterr().out
    assert {path.name for path in here.iterdir()} == {"small.toml", "small-drawing"}


@pytest.mark.fault(27, 28, 40)
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "nothing.toml"], "nothing.toml.*cannot be read"),
        (["run", "asymetry"], 'did you mean "asymmetry"'),
        (["run", "small.toml", "-o", "missing/a.nc"], "missing: the output folder does not exist"),
        (["run", "small.toml", "-o", "small.toml/a.nc"], "the output folder is a file"),
        (["run", "small.toml", "-o", "small.toml"], "the output is the study file itself"),
        (["run", "small.toml", "-o", "small.toml", "--overwrite"], "the output is the study file itself"),
        (["run", "small.toml", "-o", "linked.toml", "--overwrite"], "the output is the study file itself"),
        (["run", "linked.toml", "-o", "small.toml", "--overwrite"], "the output is the study file itself"),
        (["run", "small.toml", "-o", "twin.toml", "--overwrite"], "the output is the study file itself"),
        (["run", "small.toml", "-o", "broken.toml", "--overwrite"], "broken.toml: .*never replaced"),
        (["run", "small.toml", "-o", "broken.toml"], "broken.toml: .*never replaced"),
        (["run", "small.toml", "--scheduler", "localhost:1"], "not the address of a scheduler"),
        (["run", "small.toml", "--scheduler", "tcp://192.0.2.1:8786"], "on another host is met by TLS alone"),
        (["run", "small.toml", "--scheduler", "tls://192.0.2.1:8786"], "DASK_DISTRIBUTED__COMM__TLS__CA_FILE"),
        (["run", "small.toml", "--scheduler", "tcp://127.0.0.1:1", "--workers", "2"], "are there already"),
        (["check", "broken.toml"], "body.beam.lenght: unknown key.*length"),
        (["run", "broken.toml"], "body.beam.lenght: unknown key"),
        (["init", "asymetry"], 'did you mean "asymmetry"'),
        (["init", "passage", "small.toml"], "small.toml: there is a file already"),
        (["init", "passage", "missing/a.toml"], "the output folder does not exist"),
        (["draw", "nothing.toml"], "nothing.toml.*cannot be read"),
        (["draw", "broken.toml"], "body.beam.lenght: unknown key"),
        (["draw", "small.toml", "-o", "missing/folder"], "the folder above the page's does not exist"),
        (["info", "nothing.nc"], "nothing.nc: no such file"),
        (["report", "nothing.nc"], "nothing.nc: no such file"),
    ],
)
def test_bad_input_is_refused_and_nothing_written(
    here: Path, capsys: Captured, arguments: list[str], words: str
) -> None:
    write(here)
    write(here, SMALL.replace("length = 1.0", "lenght = 1.0"), "broken.toml")
    Path("linked.toml").symlink_to("small.toml")
    Path("twin.toml").hardlink_to("small.toml")
    before = {path: path.read_bytes() for path in here.iterdir()}
    message = refused(capsys, *arguments)
    assert re.search(words, message), message
    assert {path: path.read_bytes() for path in here.iterdir()} == before


@pytest.mark.parametrize(
    "arguments",
    [
        ["run"],
        ["frobnicate"],
        ["run", "asymmetry", "--fast"],
        ["bench", "--modes", "0"],
        ["run", "x", "--threads", "0"],
    ],
    ids=str,
)
def test_usage_errors_are_bad_input(capsys: Captured, arguments: list[str]) -> None:
    assert main(arguments) == 2
    output = capsys.readouterr()
    assert output.out == "" and output.err.startswith("wanderlast: ") and "--help" in output.err


def test_no_arguments_print_the_help(capsys: Captured) -> None:
    assert main([]) == 2
    output = capsys.readouterr()
    assert output.out == "" and output.err.startswith("Usage: wanderlast") and "\n  run " in output.err
    assert output.err.count("Usage") == 1 and "try " not in output.err


def test_help_and_version(capsys: Captured) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for name in ("init", "check", "run", "report", "info", "list", "bench"):
        assert f"\n  {name} " in text
        assert main([name, "--help"]) == 0
    assert main(["--version"]) == 0
    assert "wanderlast 0." in capsys.readouterr().out


def test_check_explains_and_writes_nothing(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["check", "small.toml"]) == 0
    output = capsys.readouterr().out
    # f1 = pi/2 sqrt(E I/(rho A L^4)) = 15.708 Hz; critical speed 31.4 m/s; masses 0.1 and 1 over 10 kg
    for words in (
        "15.7, 62.8, 141",
        "16 = 8 speed x 2 mass",
        "0.0159 to 0.318",
        "0.01 to 0.1",
    ):
        assert words in output, output
    assert [path.name for path in here.iterdir()] == ["small.toml"]


def test_list_names_studies_and_kinds(capsys: Captured) -> None:
    assert main(["list"]) == 0
    output = capsys.readouterr().out
    assert "Does a machine bed feel" in output
    for name in (*catalogue.built_in(), *catalogue.starts()):
        assert name in output


def test_info_tells_what_is_inside(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0
    capsys.readouterr()
    assert main(["info", "small.nc"]) == 0
    output = capsys.readouterr().out
    for words in ("whole", "midspan_max", "/model/beam", "speed", "ok", "--all"):
        assert words in output


@pytest.mark.fault(37)
def test_a_damaged_archive_is_code_4(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0
    whole = Path("small.nc").read_bytes()
    Path("cut.nc").write_bytes(whole[: len(whole) // 2])
    Path("text.nc").write_text("hello", encoding="utf-8")
    for name in ("cut.nc", "text.nc"):
        assert name in refused(capsys, "info", name, code=4)
        assert name in refused(capsys, "report", name, code=4)


@pytest.mark.fault(37)
def test_a_damaged_archive_of_the_same_study_needs_overwrite(here: Path, capsys: Captured) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0
    damaged = bytearray(Path("small.nc").read_bytes())
    values = open_archive("small.nc").root.midspan_max.values
    place = damaged.find(values.reshape(-1)[:1].tobytes())
    Path("small.nc").write_bytes(damaged[: place if place > 0 else -100])
    assert "small.nc" in refused(capsys, "run", "small.toml", code=4)
    assert main(["run", "small.toml", "--overwrite"]) == 0
    np.testing.assert_array_equal(open_archive("small.nc").root.midspan_max, values)


@pytest.mark.fault(30)
def test_a_held_archive_is_code_75(here: Path, capsys: Captured) -> None:
    write(here)
    lock = Lock(here / "small.nc.lock")
    lock.take()
    assert "another run" in refused(capsys, "run", "small.toml", code=75)
    lock.release()
    assert main(["run", "small.toml"]) == 0


def test_workers_that_give_up_are_code_70(here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    write(here)

    def give_up(*_: object, **__: object) -> None:
        raise WorkersGaveUp("no worker is left", remedy="run again to resume")

    monkeypatch.setattr("engine.batch.execution.execute", give_up)
    assert "no worker is left" in refused(capsys, "run", "small.toml", code=70)


@pytest.mark.fault(26)
@pytest.mark.parametrize("way", [(), ("--workers", "1")])
def test_a_disk_that_becomes_read_only_is_code_74_and_the_next_start_finishes(
    way: tuple[str, ...], here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(here)
    assert main(["run", "small.toml", "-o", "clean.nc"]) == 0
    for number in (6, 12):
        monkeypatch.setattr(files, "FAULTS", ReadOnlyFrom(number))
        assert main(["run", "small.toml", *way]) == 74
        said = capsys.readouterr().err
        assert "Read-only file system" in said and "bytes free there" in said and "free some space" not in said
        assert Path("small.nc.parts").is_dir() and not Path("small.nc").exists()
    monkeypatch.setattr(files, "FAULTS", files.Faults())
    assert main(["run", "small.toml", *way]) == 0
    assert_same_archives(open_archive("small.nc"), open_archive("clean.nc"))


@pytest.mark.fault(26)
def test_a_full_disk_is_code_74_and_the_next_start_finishes(
    here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(here)
    assert main(["run", "small.toml", "-o", "clean.nc"]) == 0
    clean = open_archive("clean.nc").root
    for number in range(1, 60, 7):
        monkeypatch.setattr(files, "FAULTS", FailNth(number))
        capsys.readouterr()
        code = main(["run", "small.toml"])
        monkeypatch.setattr(files, "FAULTS", files.Faults())
        if code == 0:
            break
        assert code == 74 and "bytes free there" in capsys.readouterr().err
        assert main(["run", "small.toml"]) == 0
        np.testing.assert_array_equal(open_archive("small.nc").root.midspan_max, clean.midspan_max)
        Path("small.nc").unlink()
    assert code == 0 and number > 8


def test_our_own_bug_leaves_a_log(here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    write(here)

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("one\nover nothing")

    monkeypatch.setattr("engine.batch.plan.make_plan", broken)
    message = refused(capsys, "run", "small.toml", code=1)
    (log,) = here.glob("wanderlast-*.log")
    assert str(log) in message and "one over nothing" in message
    assert "Traceback" in log.read_text(encoding="utf-8")


def test_a_log_goes_elsewhere_where_the_folder_cannot_be_written(
    here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    monkeypatch.setattr(Path, "cwd", lambda: here / "missing")
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(elsewhere))

    def broken() -> int:
        raise ValueError("broken")

    assert trouble.exit_code_of(broken) == 1
    (log,) = elsewhere.glob("wanderlast-*.log")
    assert str(log) in capsys.readouterr().err


@pytest.mark.parametrize(("number", "code"), [(28, 74), (5, 74), (2, 1)])
def test_output_that_cannot_be_written(number: int, code: int, capsys: Captured) -> None:
    def full() -> int:
        raise OSError(number, "no luck")

    assert trouble.exit_code_of(full) == code
    assert "no luck" in capsys.readouterr().err


@pytest.mark.parametrize("kind", sorted(catalogue.starts()))
def test_init_writes_a_study_that_runs(here: Path, kind: str, capsys: Captured) -> None:
    assert main(["init", kind]) == 0
    assert main(["check", f"{kind}.toml"]) == 0
    assert f"{kind}.toml" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["passage", "machine-bed-run"])
def test_init_names_its_own_file_in_its_commands(here: Path, kind: str) -> None:
    assert main(["init", kind, "slide.toml"]) == 0
    commands = [line for line in (here / "slide.toml").read_text().splitlines() if line.startswith("#     wanderlast")]
    assert any("run slide.toml" in line for line in commands) and any("slide.nc" in line for line in commands)
    assert not any(kind in line for line in commands)


def test_the_first_study_that_people_run_ends_well(here: Path) -> None:
    assert main(["init", "passage"]) == 0
    assert main(["run", "passage.toml"]) == 0


@pytest.mark.fault(39)
def test_titles_cannot_speak_to_the_terminal(here: Path, capsys: Captured) -> None:
    write(here, SMALL.replace('title = "small"', 'title = "[red]a[/red] \\u001b[31m {{7*7}} <script>"'))
    for arguments in (["check", "small.toml"], ["run", "small.toml"], ["info", "small.nc"]):
        assert main(arguments) == 0
        output = capsys.readouterr().out
        assert "\x1b" not in output and "[red]a[/red] \\x1b[31m {{7*7}} <script>" in output
