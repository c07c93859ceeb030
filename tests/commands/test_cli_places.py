"""The command: places where nothing can be written, other people's words, and remarks."""

import errno
import json
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from engine.scene.study import load
from results_schema.store import files
from studies.commands.cli import main
from studies.protocol.study import kind_of
from tests.commands.test_cli import Captured, refused
from tests.commands.test_cli_interrupted import interrupted
from tests.studies.small import SCENES, SMALL, write


@pytest.mark.fault(27)
@pytest.mark.parametrize("arguments", [["run", "small.toml"], ["init", "passage"], ["report", "small.nc"]], ids=str)
def test_a_read_only_folder_is_code_74(
    here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    write(here)
    if arguments[0] == "report":
        assert main(["run", "small.toml"]) == 0
    before = sorted(here.iterdir())

    def refuse(**_: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    def compute(*_: object, **__: object) -> None:
        raise AssertionError("nothing is computed before")

    monkeypatch.setattr("engine.batch.plan.make_plan", compute)
    monkeypatch.setattr(files.tempfile, "TemporaryFile", refuse)
    message = refused(capsys, *arguments, code=74)
    assert "cannot be written" in message and "bytes free there" in message and "-o" not in message
    assert sorted(here.iterdir()) == before


def test_a_disk_too_small_is_code_74_before_computing(
    here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(here)
    monkeypatch.setattr(files.shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
    message = refused(capsys, "run", "small.toml", code=74)
    assert "16 variants would not fit" in message and "1000 bytes free there" in message
    assert [path.name for path in here.iterdir()] == ["small.toml"]


@pytest.mark.fault(46)
def test_resuming_demands_what_is_left(here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the disk that the whole study just fits on, and on one a byte too small."""
    write(here, SCENES)
    needed = kind_of(load("small.toml")).parts(load("small.toml")).disk_bytes
    interrupted(monkeypatch, 3)
    free = needed - sum(path.stat().st_size for path in Path("small.nc.parts").iterdir())
    assert free < needed - 10_000
    for left, code in ((free - 1, 74), (free, 0)):
        capsys.readouterr()
        monkeypatch.setattr(files.shutil, "disk_usage", lambda _, left=left: SimpleNamespace(free=left))
        assert main(["run", "small.toml"]) == code
        assert code == 0 or f"expected {free} bytes; remedy" in capsys.readouterr().err


@pytest.mark.fault(46)
@pytest.mark.parametrize(("number", "full"), [(errno.ENOSPC, True), (errno.EACCES, False), (errno.EIO, False)])
def test_a_remedy_fits_its_cause(number: int, full: bool) -> None:
    message = str(files.output_failed(Path("a.nc"), OSError(number, os.strerror(number))))
    assert os.strerror(number) in message and ("free some space" in message) is full


@pytest.mark.fault(50)
def test_a_finished_study_needs_no_place_to_write(
    here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(here)
    assert main(["run", "small.toml"]) == 0

    def refuse(**_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(files.tempfile, "TemporaryFile", refuse)
    capsys.readouterr()
    assert main(["run", "small.toml"]) == 0
    assert "finished" in capsys.readouterr().out
    assert "cannot be written" in refused(capsys, "run", "small.toml", "--overwrite", code=74)


def test_remarks_are_told(here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    write(here)
    monkeypatch.setattr("engine.batch.plausibility.remarks", lambda _: ["too \x1b fast"])
    assert main(["check", "small.toml"]) == 0
    assert "Worth knowing\n- too \\x1b fast\n" in capsys.readouterr().out
    assert main(["run", "small.toml", "--json"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out)["remarks"] == ["too \x1b fast"]
    assert output.err == "worth knowing: too \\x1b fast\n"


@pytest.mark.fault(10)
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("at = 0.5", 'at = 0.5\nquantity = "deflection"', 'did you mean "displacement"'),
        ("at = 0.5", 'at = 0.5\nquantity = "moment"', 'did you mean "bending_moment"'),
        ("at = 0.5", 'at = 0.5\nquantity = "shear"', 'did you mean "shear_force"'),
        ('"pinned-pinned"', '"Simply supported"', 'did you mean "pinned-pinned"'),
        ("speed = 5.0", "speed = -5.0", "end < start runs backward"),
        ("from = 0.5", "from = 0.0", "end < start runs backward"),
    ],
)
def test_words_that_others_use(here: Path, capsys: Captured, old: str, new: str, words: str) -> None:
    write(here, SMALL.replace(old, new).replace('spacing = "log"', 'spacing = "linear"'))
    assert words in refused(capsys, "check", "small.toml")
