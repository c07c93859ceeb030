"""Studies that measure: refused options, pieces that are kept, runs that are interrupted, and the commands."""

import json
import os
import signal
import threading
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import engine
import studies
from engine.scene.study import Study
from engine.study_file.spec import Spec
from results_schema.errors import BadInput, Interrupted, OutputFailed
from results_schema.store import files
from results_schema.store.archive import open_archive
from results_schema.store.parts import PartStore, finished_so_far
from results_schema.store.tables import Table, from_dataset, to_dataset
from studies.commands.cli import main
from studies.protocol.listener import Listener
from studies.protocol.options import RunOptions
from studies.protocol.parts import Piece, Pieces, Work
from studies.protocol.stopping import Stop
from studies.protocol.store import Memory
from studies.protocol.study import PiecedKind, question_of
from studies.runs.runner import run_to_archive
from tests.schema.samples import FailNth
from tests.studies import precision, scenes

Captured = pytest.CaptureFixture[str]
TEXT = precision.TEXT.replace("tolerances = [1e-2, 1e-1]", "tolerances = [1e-1]")


def numbers(value: float) -> xr.Dataset:
    """A piece's dataset with numbers, text, a scalar and attributes."""
    data = {"x": ("n", np.array([value, np.nan])), "name": ("n", ["a", "ä"]), "count": 3}
    return xr.Dataset(data, coords={"n": [1, 2]}, attrs={"told": "yes"})


def piece(name: str, value: float = 1.0) -> Piece:
    return Piece(name, "numbers", lambda work: numbers(value))


class Some(PiecedKind):
    """A kind of these pieces."""

    name = "some"

    def __init__(self, *own: Piece) -> None:
        self.own = own

    def pieces(self, study: Study) -> tuple[Piece, ...]:
        return self.own

    def gather(self, pieces: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
        return xr.Dataset({name: float(found.x[0]) for name, found in pieces.items()})


def parts(*own: Piece) -> Pieces:
    return Pieces(Some(*own), engine.Study(kind="passage"))


# ---- pieces ----


def test_pieces_are_computed_in_their_order_and_handed_over() -> None:
    shown: list[tuple[int, int]] = []
    own, store = parts(piece("b", 2.0), piece("a", 1.0)), Memory()
    assert own.compute(store, Work(listener=Listener(lambda finished, total: shown.append((finished, total))))) == 0
    assert list(store.finished()) == ["b", "a"] and shown == [(0, 2), (1, 2), (2, 2)]
    assert dict(own.gather(store).data_vars) == {"b": 2.0, "a": 1.0}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_between_pieces_keeps_the_finished_ones(number: signal.Signals) -> None:
    stop, store = Stop(), Memory()

    def ask(finished: int, total: int) -> None:
        if finished:
            stop.ask(number.value)

    with pytest.raises(Interrupted) as caught:
        parts(piece("a"), piece("b")).compute(store, Work(stop=stop, listener=Listener(ask)))
    assert list(store.finished()) == ["a"] and caught.value.exit_code == 128 + number


def test_a_piece_that_never_looks_does_not_hold_up_a_stop() -> None:
    stop, forever = Stop(), threading.Event()

    def endless(work: Work) -> xr.Dataset:
        stop.ask()
        forever.wait()
        return numbers(1.0)

    with pytest.raises(Interrupted):
        parts(Piece("a", "", endless)).compute(Memory(), Work(stop=stop))
    forever.set()


# ---- pieces on the disk ----


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.nc"


def test_pieces_come_back_as_they_were(path: Path) -> None:
    with PartStore(path, "key") as store:
        for name, value in (("one", 1.0), ("two", 2.0)):
            store.write(name, {"/": from_dataset(numbers(value))})
    assert [found.size for found in finished_so_far(path) or ()] == [0, 0]
    with PartStore(path, "key") as store:
        assert set(store.finished()) == {"one", "two"}
        found = to_dataset(store.read("two")["/"])
        xr.testing.assert_equal(found, numbers(2.0))
        assert found.attrs == {"told": "yes"}
        store.remove()
    assert list(path.parent.iterdir()) == []


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


@pytest.mark.parametrize("kind", [kind for kind in scenes.MOTIONS if studies.kind_named(kind).settings is None])
def test_kinds_without_options_refuse_them(kind: str) -> None:
    with pytest.raises(BadInput, match=r"question: studies of the kind .* have no options.*modes"):
        scenes.run(kind, extra="[question]\nmodes = 3")


@pytest.mark.parametrize("kind", [name for name in studies.kind_names() if name not in scenes.MOTIONS])
def test_measuring_kinds_are_such_and_some_refuse_a_sweep(kind: str) -> None:
    found = studies.kind_named(kind)
    assert isinstance(found, PiecedKind) and found.name == kind
    assert found.summary and found.question.endswith("?") and found.settings and issubclass(found.settings, Spec)
    if found.sweeps:
        return
    text = scenes.text_of("passage", scenes.pace("passage")).replace('"passage"', f'"{kind}"')
    with pytest.raises(BadInput, match=rf"sweep: a study of the kind {kind} takes no sweep.*pace"):
        studies.run(engine.load(text))


# ---- the commands ----


@pytest.fixture
def here(here: Path) -> Path:
    """A working folder with the small study, of one tolerance."""
    (here / "small.toml").write_text(TEXT, encoding="utf-8")
    return here


def after_pieces(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """Let a SIGINT arrive when so many pieces are written."""
    written, write = [], PartStore.write

    def write_and_signal(self: PartStore, name: str, part: Mapping[str, Table]) -> Path:
        written.append(write(self, name, part))
        if len(written) == number:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.5)  # until the thread has heard it that hears signals
        return written[-1]

    monkeypatch.setattr(PartStore, "write", write_and_signal)


def test_check_lists_the_pieces_and_writes_nothing(here: Path, capsys: Captured) -> None:
    assert main(["check", "small.toml"]) == 0
    output = capsys.readouterr().out
    for words in ("work-precision", "steps-light", "modes-heavy-and-slow", "pieces", "About"):
        assert words in output
    assert [path.name for path in here.iterdir()] == ["small.toml"]


@pytest.mark.fault(21)
def test_a_stopped_run_goes_on_from_its_pieces(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    with monkeypatch.context() as patch:
        after_pieces(patch, 2)
        assert main(["run", "small.toml"]) == 130
    assert "finished work is kept" in capsys.readouterr().err and not Path("small.nc").exists()
    assert main(["info", "small.nc"]) == 2
    assert "2 finished pieces" in capsys.readouterr().err
    first = xr.load_dataset("small.nc.parts/steps-light.nc")
    assert main(["run", "small.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["resumed"] == 2 and found["status"]["diverged"] > 0 and found["exit_code"] == 0
    root = open_archive("small.nc").root
    np.testing.assert_array_equal(root.seconds_per_variant.sel(scene="light"), first.seconds)
    assert root.attrs["study"] == TEXT and root.attrs["run_seconds"] > 0
    assert sorted(path.name for path in here.iterdir()) == ["small.nc", "small.toml"]
    assert main(["run", "small.toml"]) == 0
    output = " ".join(capsys.readouterr().out.split())
    assert "nothing to do" in output and " diverged: what swings grew beyond all numbers" in output
    assert main(["info", "small.nc", "--all"]) == 0
    assert "total_error" in capsys.readouterr().out
    assert main(["report", "small.nc"]) == 0
    page = Path("small-report/report.html").read_text(encoding="utf-8")
    assert "Points by status" in page and "heavy and slow" in page and "seconds_<wbr>per_<wbr>variant" in page


def test_a_full_disk_keeps_the_finished_pieces(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = engine.load("small.toml")
    monkeypatch.setattr(files, "FAULTS", FailNth(25))
    with pytest.raises(OutputFailed):
        run_to_archive(study, Path("small.nc"), RunOptions())
    assert 1 <= len(finished_so_far("small.nc") or ()) < 6 and not Path("small.nc").exists()


def test_a_kind_without_pieces_cannot_be_made() -> None:
    class Unfinished(PiecedKind):
        name = "unfinished"

    with pytest.raises(TypeError, match=r"abstract methods.* gather.*pieces"):
        Unfinished()  # type: ignore[abstract]
