"""Runs that are interrupted: exit codes, what is kept, and that what goes on ends as if nothing had happened."""

import os
import shlex
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import engine
from results_schema.errors import Interrupted, OutputFailed
from results_schema.store.archive import open_archive
from results_schema.store.rows import Chunk, Gatherer, Rows
from studies.commands.cli import main
from studies.protocol.options import RunOptions
from studies.protocol.stopping import GRACE_SECONDS, Stop, stop_on_signals
from studies.runs.runner import run_to_archive
from tests.studies.every_way import assert_same_results
from tests.studies.small import LONG, ROOT, SCENES, command, start, write


@pytest.fixture(autouse=True)
def study(here: Path) -> None:
    """A study in the working folder."""
    write(here, SCENES)


def after_parts(monkeypatch: pytest.MonkeyPatch, number: int, number_of_signal: int) -> None:
    """Write a part for every chunk, and let a signal arrive after so many."""
    written, add = [], Gatherer.add

    def add_and_signal(self: Gatherer, chunk: Chunk) -> None:
        add(self, chunk)
        self.flush()
        written.append(chunk)
        if len(written) == number:
            os.kill(os.getpid(), number_of_signal)

    monkeypatch.setattr(Gatherer, "add", add_and_signal)


def interrupted(
    monkeypatch: pytest.MonkeyPatch, parts: int, study: str = "small.toml", sent: int = signal.SIGINT, code: int = 130
) -> None:
    """A run that a signal stops after so many parts."""
    with monkeypatch.context() as patch:
        after_parts(patch, parts, sent)
        assert main(["run", study]) == code


@pytest.mark.fault(21, 25)
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_and_the_next_start_goes_on(
    number: signal.Signals, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "small.toml", "-o", "whole.nc"]) == 0
    capsys.readouterr()
    interrupted(monkeypatch, 2, sent=number, code=code)
    output = capsys.readouterr()
    assert output.out == "" and "finished work is kept" in output.err
    assert not Path("small.nc").exists() and len(list(Path("small.nc.parts").glob("*.nc"))) >= 2
    assert signal.getsignal(number) is not None
    outcome = run_to_archive(engine.load("small.toml"), Path("small.nc"), RunOptions())
    assert 2 <= outcome.resumed < 16
    assert_same_results(open_archive("small.nc").root, open_archive("whole.nc").root)
    assert not Path("small.nc.parts").exists() and not Path("small.nc.lock").exists()


@pytest.mark.parametrize("name", ["info", "report"])
def test_an_unfinished_run_is_told(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    interrupted(monkeypatch, 2)
    parts = sorted(Path("small.nc.parts").glob("*.nc"))
    kept = sum(xr.load_dataset(path).variants.size for path in parts[1:])
    parts[0].write_bytes(parts[0].read_bytes()[:-50])
    capsys.readouterr()
    before = {path: path.read_bytes() for path in Path("small.nc.parts").iterdir()}
    assert main([name, "small.nc"]) == 2
    message = capsys.readouterr().err
    assert f"{kept} finished variant" in message and "wanderlast run small.toml -o small.nc" in message
    assert {path: path.read_bytes() for path in Path("small.nc.parts").iterdir()} == before


def test_parts_of_another_study_need_overwrite(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    interrupted(monkeypatch, 1)
    write(here, SCENES.replace("damping_ratio = 0.02", "damping_ratio = 0.03"))
    capsys.readouterr()
    assert main(["run", "small.toml"]) == 2
    assert "--overwrite" in capsys.readouterr().err
    outcome = run_to_archive(engine.load("small.toml"), Path("small.nc"), RunOptions(overwrite=True))
    assert outcome.resumed == 0


@pytest.mark.fault(29)
def test_a_part_that_was_damaged_meanwhile_is_computed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted(monkeypatch, 3)
    part = sorted(Path("small.nc.parts").glob("*.nc"))[0]
    part.write_bytes(part.read_bytes()[:-50])
    assert main(["run", "small.toml"]) == 0
    assert main(["run", "small.toml", "-o", "whole.nc"]) == 0
    assert_same_results(open_archive("small.nc").root, open_archive("whole.nc").root)


@pytest.mark.fault(25, 48)
@pytest.mark.parametrize(
    ("signals", "code"),
    [pytest.param([signal.SIGTERM], 143, marks=pytest.mark.slow), ([signal.SIGINT] * 2, 130)],
    ids=str,
)
def test_a_long_run_ends_in_time(here: Path, signals: list[signal.Signals], code: int) -> None:
    write(here, LONG, "long.toml")
    process = start(here, "run", "long.toml")
    while not list(here.glob("long.nc.parts/*.sha256")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    for number in signals:
        process.send_signal(number)
        time.sleep(0.05)
    errors = process.communicate(timeout=30)[1]  # of minutes
    assert process.returncode == code and "finished work is kept" in errors and "Traceback" not in errors
    assert list(here.glob("long.nc.parts/*.sha256")) and not (here / "long.nc").exists()


@pytest.mark.slow
@pytest.mark.fault(48)
def test_a_run_ends_while_its_kernels_compile(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A signal comes when one kernel is compiled and the next one, which takes many seconds, is not."""
    monkeypatch.setenv("WANDERLAST_CACHE", str(here / "cache"))
    process = start(here, "run", "small.toml")
    while not list(here.glob("cache/*/*/*.nbc")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == 130 and "Traceback" not in errors
    assert not [path for path in here.glob("cache/*/*/*.nbc") if "march_one" in path.name]


def test_stop_carries_the_code_of_its_signal() -> None:
    before = signal.getsignal(signal.SIGINT)
    with stop_on_signals() as stop:
        stop.check()
        os.kill(os.getpid(), signal.SIGTERM)
        assert stop.event.wait(GRACE_SECONDS)
        with pytest.raises(Interrupted, match="finished work is kept") as caught:
            stop.check()
    assert caught.value.exit_code == stop.exit_code == 143
    assert signal.getsignal(signal.SIGINT) is before
    assert Stop().exit_code == 130


class Written:
    """Remembers the variants of what would have been written, and those that are kept."""

    def __init__(self) -> None:
        self.parts: list[tuple[list[int], list[int]]] = []

    def __call__(self, found: Chunk) -> None:
        (variants, arrays), selected = found
        assert (arrays["x"][:, 0] == variants + 0.5).all()
        self.parts.append((variants.tolist(), [] if selected is None else selected.variants.tolist()))


def chunk(*variants: int) -> Chunk:
    """A chunk of 8 MiB for every variant, one of which is kept."""
    numbers, x = np.array(variants), np.zeros((len(variants), 2**20))
    x[:, 0] = numbers + 0.5
    return Chunk(Rows(numbers, {"x": x}), Rows(numbers[:1], {"h": np.zeros((1, 3))}))


def test_chunks_share_a_part_of_32_mib() -> None:
    written = Written()
    with Gatherer(written) as parts:
        parts.add(chunk(4, 5))
        parts.add(chunk(1))
        assert written.parts == []
        parts.add(chunk(2))
        parts.add(Chunk(chunk(7).rows))
    assert written.parts == [([1, 2, 4, 5], [1, 2, 4]), ([7], [])]


@pytest.mark.parametrize(("error", "kept"), [(KeyboardInterrupt(), 1), (OutputFailed("full"), 0)], ids=str)
def test_what_has_gathered_is_kept_unless_the_disk_failed(error: BaseException, kept: int) -> None:
    written = Written()
    with pytest.raises(type(error)), Gatherer(written) as parts:
        parts.add(chunk(3))
        raise error
    assert len(written.parts) == kept


JUMPING = """\
import time

real = time.time
time.time = lambda: real() + 86400.0 * (int(2.0 * time.monotonic()) % 3 - 1)
"""


@pytest.mark.slow
@pytest.mark.fault(20)
@pytest.mark.parametrize("places", [(), ("--workers", "2")], ids=["threads", "workers"])
def test_a_pause_a_clock_that_jumps_and_few_open_files_change_nothing(places: tuple[str, ...], here: Path) -> None:
    assert main(["run", "small.toml", "-o", "whole.nc"]) == 0
    (here / "sitecustomize.py").write_text(JUMPING, encoding="utf-8")
    run = f"ulimit -n 64; exec {shlex.join(command('run', 'small.toml', '-o', 'small.nc', *places))}"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(here), str(ROOT)])}
    running = subprocess.Popen(["bash", "-c", run], env=environment)
    for number in (signal.SIGSTOP, signal.SIGCONT):
        time.sleep(4.0)
        running.send_signal(number)
    assert running.wait(timeout=300) == 0
    assert_same_results(open_archive("small.nc").root, open_archive("whole.nc").root)
