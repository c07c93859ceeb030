"""Standard output that is closed, full, or read by somebody who leaves; colours and the progress bar."""

import os
import pty
import re
import subprocess
import time
from pathlib import Path

import pytest

from engine.kernels.compiling import WORDS
from results_schema.garbage import NEW_OBJECTS
from results_schema.status import Status
from studies.commands import screens
from studies.commands.console import paragraphs, progress_bar, say_compiling
from studies.reporting.summary import Extreme, Range
from tests.studies.small import ROOT, SEPARATED, command, finish, write


def shell(folder: Path, line: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command in a line of bash, where it stands as "$@"; the exit code is the command's."""
    return subprocess.run(
        ["bash", "-c", line, "bash", *command(*arguments)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize("arguments", [["--help"], ["list"]], ids=str)
def test_a_reader_may_leave(tmp_path: Path, arguments: list[str]) -> None:
    done = shell(tmp_path, '"$@" | true; exit ${PIPESTATUS[0]}', *arguments)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_run_keeps_its_code_when_its_reader_leaves(tmp_path: Path) -> None:
    write(tmp_path, SEPARATED)
    done = shell(tmp_path, '"$@" | true; exit ${PIPESTATUS[0]}', "run", "small.toml")
    assert (done.returncode, done.stderr) == (3, "")
    assert (tmp_path / "small.nc").exists()


@pytest.mark.fault(26)
@pytest.mark.parametrize("arguments", [["--help"], ["list"]], ids=str)
def test_full_output_is_code_74(tmp_path: Path, arguments: list[str]) -> None:
    done = shell(tmp_path, '"$@" > /dev/full', *arguments)
    assert done.returncode == 74 and "No space left" in done.stderr and "Traceback" not in done.stderr


def test_closed_output_is_no_error(tmp_path: Path) -> None:
    done = shell(tmp_path, '"$@" >&-', "list")
    assert (done.returncode, done.stderr) == (0, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.fault(50)
def test_ascii_screens_show_plain_letters(tmp_path: Path) -> None:
    write(tmp_path)
    line = 'export PYTHONIOENCODING=ascii LC_ALL=C; "$@" run small.toml -v && "$@" info small.nc'
    done = shell(tmp_path, line)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.isascii() and re.search(r"\d um\b", done.stdout) and "?" not in done.stdout


@pytest.mark.fault(50)
def test_too_little_memory_is_code_70(tmp_path: Path) -> None:
    write(tmp_path)
    done = shell(tmp_path, 'ulimit -v 500000; "$@"', "run", "small.toml")
    assert done.returncode == 70 and "limit of memory" in done.stderr and "received 512000000 bytes" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


def test_compiling_is_told_at_once_where_no_terminal_shows_a_bar(capsys: pytest.CaptureFixture[str]) -> None:
    """The other stages wait for the next line."""
    with progress_bar("small") as bar:
        bar.say("marching")
        bar.say(WORDS)
        assert capsys.readouterr().err == f"small: {WORDS}\n"
    say_compiling("other", WORDS)
    assert capsys.readouterr().err == f"other: {WORDS}\n"


@pytest.mark.fault(45)
def test_warnings_of_libraries_stay_away_from_the_screen(tmp_path: Path) -> None:
    """One is made on purpose: which of ours may make one is not known."""
    warned = "import warnings, studies.commands.cli as c; s = c.process.set_up"
    warned += "; c.process.set_up = lambda: (s(), warnings.warn('overflow', RuntimeWarning)); c.main()"
    done = shell(tmp_path, f'PYTHONWARNINGS= "$1" -c "{warned}" list')
    assert (done.returncode, done.stderr) == (0, "")


def test_commands_import_no_dask_and_collect_garbage_seldom(tmp_path: Path) -> None:
    """A third of a second each, of a run that takes one; who asks for dask afterwards has it."""
    write(tmp_path)
    told = "import gc, sys, studies.commands.cli as c; c.main(); print('dask' in sys.modules, gc.get_threshold()[0])"
    done = shell(tmp_path, f'"$1" -c "{told}; import dask.array" run small.toml')
    assert done.returncode == 0 and done.stdout.splitlines()[-1] == f"False {NEW_OBJECTS}"


def test_a_long_run_tells_how_far_it_is_where_no_terminal_shows_a_bar(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("small", seconds=0.01) as bar:
        bar.say("marching")
        bar.show(40, 400)
        bar.show(80, 400)
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"small: marching; 80 of 400 after 0.\d+ s, about \d\S* s left", lines[-1])


def test_it_is_told_how_many_pilots_are_measured_before_any_variant_is_finished(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Also after kernels were compiled meanwhile, which else would be said until the end."""
    with progress_bar("small", seconds=0.01) as bar:
        bar.say("choosing")
        bar.show(0, 400)
        bar.say(WORDS)
        bar.note("pilots of 3 of 24 scenes measured")
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"small: choosing, pilots of 3 of 24 scenes measured; 0 of 400 after 0.\d+ s", lines[-1])


def test_the_progress_bar_is_for_terminals(tmp_path: Path) -> None:
    write(tmp_path)
    assert finish(tmp_path, "run", "small.toml", "-o", "quiet.nc").stderr in ("", f"small: {WORDS}\n")
    master, terminal = pty.openpty()
    process = subprocess.Popen(
        command("run", "small.toml"),
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT), "TERM": "xterm", "NO_COLOR": "1"},
        stdout=subprocess.PIPE,
        stderr=terminal,
    )
    os.close(terminal)
    output = process.communicate(timeout=60)[0]
    shown = b""
    while True:
        try:
            part = os.read(master, 65536)
        except OSError:
            break
        if not part:
            break
        shown += part
    os.close(master)
    assert process.returncode == 0
    assert b"small" in shown and b"/16" in shown
    assert b"\x1b" not in output


def test_sentences_break_neither_numbers_nor_before_units(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "16")
    paragraphs("with car at 7.53 m, 15.2 kN m ± 3 N m")
    assert capsys.readouterr().out == "with car at\n7.53 m,\n15.2 kN m\n± 3 N m\n"


@pytest.mark.parametrize(
    ("name", "status", "closer"),
    [
        ("tool_residual", Status.OK, True),
        ("tool_residual", Status.TOLERANCE_MISSED, False),
        ("tool_max", Status.OK, False),
    ],
)
def test_loose_residual_vibrations_are_told_with_the_key_that_tells_them_closer(
    name: str, status: Status, closer: bool
) -> None:
    """They are held to a part of the largest static value, which may be a thousand times as large; not where that
    is missed as it is."""
    ends = [Extreme(value, {}, {"mass": "1 kg"}, error=0.5e-6) for value in (1e-6, 2e-6)]
    (said,) = screens.told_loosely([Range(name, "", "m", *ends)], {status: 1})
    assert "more than a tenth of the value: " in said and "2 µm ± 500 nm" in said
    assert ("smaller tolerance (sensor.tool.tolerance)" in said) == closer


@pytest.mark.parametrize(
    ("name", "loose"), [("stray_min", False), ("stray_max", True), ("car_contact_force_min", True)]
)
def test_the_smallest_of_what_is_far_larger_at_other_times_is_not_told_as_loose(name: str, loose: bool) -> None:
    """A distance that comes near zero is none the less told well enough; a contact force may well lift off there."""
    ends = [Extreme(value, {}, {"mass": "1 kg"}, error=9e-6) for value in (1e-7, 2e-6)]
    assert bool(screens.told_loosely([Range(name, "", "m", *ends, beside=2e-2)], {Status.OK: 1})) == loose
