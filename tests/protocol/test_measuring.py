"""Studies that measure: refused options, pieces that are kept, runs that are interrupted, and the commands."""

from __future__ import annotations

import json
import os
import signal
import threading
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import engine
import studies
from engine.study_file.spec import Spec
from results_schema.errors import ArchiveBusy, BadInput, Interrupted, OutputFailed
from results_schema.store import files
from results_schema.store.archive import open_archive
from results_schema.store.pieces import PieceStore, pieces_so_far
from studies.commands.cli import main
from studies.protocol.measuring import MeasuringKind, Piece, Work, measure, question_of
from studies.protocol.options import RunOptions
from studies.protocol.stopping import Stop
from studies.runs.runner import run_to_archive
from tests.schema.samples import FailNth
from tests.studies import precision, scenes

Captured = pytest.CaptureFixture[str]


def numbers(value: float) -> xr.Dataset:
    """A piece's dataset with numbers, text, a scalar and attributes."""
    data = {"x": ("n", np.array([value, np.nan])), "name": ("n", ["a", "ä"]), "count": 3}
    return xr.Dataset(data, coords={"n": [1, 2]}, attrs={"told": "yes"})


def piece(name: str, value: float = 1.0) -> Piece:
    return Piece(name, "numbers", lambda work: numbers(value))


# ---- pieces ----


def test_pieces_are_computed_in_their_order_and_handed_over() -> None:
    kept: list[str] = []
    shown: list[tuple[int, int]] = []
    found = measure(
        [piece("b", 2.0), piece("a", 1.0)],
        Work(),
        keep=lambda name, _: kept.append(name),
        progress=lambda finished, total: shown.append((finished, total)),
    )
    assert kept == list(found) == ["b", "a"] and shown == [(0, 2), (1, 2), (2, 2)]
    assert float(found["b"].x[0]) == 2.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_between_pieces_keeps_the_finished_ones(number: signal.Signals) -> None:
    stop, kept = Stop(), list[str]()

    def keep(name: str, _: xr.Dataset) -> None:
        kept.append(name)
        stop.ask(number.value)

    with pytest.raises(Interrupted) as caught:
        measure([piece("a"), piece("b")], Work(stop=stop), keep=keep)
    assert kept == ["a"] and caught.value.exit_code == 128 + number


def test_a_piece_that_never_looks_does_not_hold_up_a_stop() -> None:
    stop, forever = Stop(), threading.Event()

    def endless(work: Work) -> xr.Dataset:
        stop.ask()
        forever.wait()
        return numbers(1.0)

    with pytest.raises(Interrupted):
        measure([Piece("a", "", endless)], Work(stop=stop))
    forever.set()


# ---- pieces on the disk ----


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.nc"


def test_pieces_come_back_as_they_were(path: Path) -> None:
    with PieceStore(path, "key") as store:
        assert store.finished() == {}
        store.write("one", numbers(1.0))
        store.write("two", numbers(2.0))
    assert pieces_so_far(path) == 2
    with PieceStore(path, "key") as store:
        found = store.finished()
        assert set(found) == {"one", "two"}
        xr.testing.assert_equal(found["two"], numbers(2.0))
        assert found["two"].attrs == {"told": "yes"}
        store.remove()
    assert list(path.parent.iterdir()) == []


def test_damaged_pieces_and_strangers_are_removed(path: Path) -> None:
    with PieceStore(path, "key") as store:
        whole, cut, lost = (store.write(name, numbers(1.0)) for name in ("whole", "cut", "lost"))
        cut.write_bytes(cut.read_bytes()[:-40])
        files.sidecar(lost).unlink()
        (whole.parent / "notes.txt").write_text("hello", encoding="utf-8")
        assert pieces_so_far(path) == 1
        assert set(store.finished()) == {"whole"}
        assert sorted(entry.name for entry in whole.parent.iterdir()) == sorted(
            ["key", whole.name, files.sidecar(whole).name]
        )


def test_pieces_of_another_study_are_refused_or_discarded(path: Path) -> None:
    with PieceStore(path, "key") as store:
        store.write("one", numbers(1.0))
    with pytest.raises(BadInput, match="--overwrite"), PieceStore(path, "other"):
        pass
    with PieceStore.discard_foreign(path, "other") as store:
        assert store.finished() == {}


def test_one_run_at_a_time(path: Path) -> None:
    with PieceStore(path, "key"), pytest.raises(ArchiveBusy), PieceStore(path, "key"):
        pass


# ---- options ----


class Asked(Spec):
    """Options of a kind for these tests."""

    modes: int = 3
    length: float = 1.0


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ({"mode": 2}, r'question.mode: unknown key.*did you mean "modes"'),
        ({"modes": 2.5}, r"question.modes: .*an integer.*2.5"),
        ({"length": "long"}, r"question.length: .*a number.*long"),
    ],
)
def test_bad_options_are_refused_with_their_key(question: dict[str, object], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        question_of(engine.Study(kind="passage", question=question), Asked)


@pytest.mark.parametrize("kind", scenes.MOTIONS)
def test_kinds_without_options_refuse_them(kind: str) -> None:
    with pytest.raises(BadInput, match=r"question: studies of the kind .* have no options.*modes"):
        scenes.run(kind, extra="[question]\nmodes = 3")


@pytest.mark.parametrize("kind", [name for name in studies.kind_names() if name not in scenes.MOTIONS])
def test_measuring_kinds_are_such_and_some_refuse_a_sweep(kind: str) -> None:
    found = studies.kind_named(kind)
    assert isinstance(found, MeasuringKind) and found.name == kind
    assert found.summary and found.question.endswith("?") and issubclass(found.settings, Spec)
    if found.sweeps:
        return
    text = scenes.text_of("passage", scenes.pace("passage")).replace('"passage"', f'"{kind}"')
    with pytest.raises(BadInput, match=rf"sweep: a study of the kind {kind} takes no sweep.*pace"):
        studies.run(engine.load(text))


# ---- the commands ----


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder with the small study."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    (tmp_path / "small.toml").write_text(precision.TEXT, encoding="utf-8")
    return tmp_path


def after_pieces(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """Let a SIGINT arrive when so many pieces are written."""
    written, write = [], PieceStore.write

    def write_and_signal(self: PieceStore, name: str, dataset: xr.Dataset) -> Path:
        written.append(write(self, name, dataset))
        if len(written) == number:
            os.kill(os.getpid(), signal.SIGINT)
        return written[-1]

    monkeypatch.setattr(PieceStore, "write", write_and_signal)


def test_check_lists_the_pieces_and_writes_nothing(here: Path, capsys: Captured) -> None:
    assert main(["check", "small.toml"]) == 0
    output = capsys.readouterr().out
    for words in ("work-precision", "steps-light", "modes-heavy-and-slow", "pieces", "About"):
        assert words in output
    assert [path.name for path in here.iterdir()] == ["small.toml"]


def test_a_stopped_run_goes_on_from_its_pieces(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    with monkeypatch.context() as patch:
        after_pieces(patch, 2)
        assert main(["run", "small.toml"]) == 130
    assert "finished work is kept" in capsys.readouterr().err and not Path("small.nc").exists()
    assert main(["info", "small.nc"]) == 2
    assert "2 finished pieces" in capsys.readouterr().err
    first = xr.load_dataset(next(p for p in here.glob("small.nc.parts/*.nc") if _name(p) == "steps-light"))
    assert main(["run", "small.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["resumed"] == 2 and found["status"]["diverged"] > 0 and found["exit_code"] == 0
    root = open_archive("small.nc").root
    np.testing.assert_array_equal(root.seconds_per_variant.sel(scene="light"), first.seconds)
    assert root.attrs["study"] == precision.TEXT and root.attrs["run_seconds"] > 0
    assert sorted(path.name for path in here.iterdir()) == ["small.nc", "small.toml"]
    assert main(["run", "small.toml"]) == 0
    output = capsys.readouterr().out
    assert "nothing to do" in output and "points diverged" in output
    assert main(["info", "small.nc"]) == 0
    assert "total_error" in capsys.readouterr().out
    assert main(["report", "small.nc"]) == 0
    page = Path("small-report/report.html").read_text(encoding="utf-8")
    assert "Points by status" in page and "heavy and slow" in page and "seconds_<wbr>per_<wbr>variant" in page


def _name(path: Path) -> str:
    return str(xr.open_dataset(path).attrs["piece"])


def test_a_full_disk_keeps_the_finished_pieces(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = engine.load("small.toml")
    monkeypatch.setattr(files, "FAULTS", FailNth(25))
    with pytest.raises(OutputFailed):
        run_to_archive(study, Path("small.nc"), RunOptions())
    assert 1 <= pieces_so_far("small.nc") < 6 and not Path("small.nc").exists()
