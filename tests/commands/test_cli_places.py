"""The command: places where nothing can be written, other people's words, and remarks."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from results_schema.store import files
from studies.commands.cli import main
from tests.commands.test_cli import Captured, here, refused
from tests.studies.small import SMALL, write

__all__ = ["here"]  # a fixture


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

    monkeypatch.setattr(files.tempfile, "TemporaryFile", refuse)
    monkeypatch.setattr("engine.batch.plan.make_plan", compute)
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


def test_remarks_are_told(here: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    write(here)
    monkeypatch.setattr("engine.batch.plausibility.remarks", lambda _: ["too \x1b fast"])
    assert main(["check", "small.toml"]) == 0
    assert "Worth knowing\n- too \\x1b fast\n" in capsys.readouterr().out
    assert main(["run", "small.toml", "--json"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out)["remarks"] == ["too \x1b fast"]
    assert output.err == "worth knowing: too \\x1b fast\n"


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
