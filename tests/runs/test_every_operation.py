"""Whole runs that fail or die in their N-th operation on files, for every N, go on to the same archive."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from results_schema.store import files, parts
from results_schema.store.archive import open_archive
from studies.commands.cli import main
from tests.schema.samples import FailNth, KillNth, ReadOnlyFrom
from tests.studies.every_way import TEXTS, assert_same_archives
from tests.studies.forked import exit_code, forked
from tests.studies.small import ROOT, write

CALL = "import sys; from tests.runs.test_every_operation import every_operation as e; e(*sys.argv[1:])"
FAULTS: dict[str, Callable[[int], files.Faults]] = {"fails": FailNth, "stays read-only": ReadOnlyFrom, "dies": KillNth}
ON_DISK = "marched, results on the disk"
WAYS = TEXTS | {ON_DISK: TEXTS["marched"]}
ENDS = {"fails": 74, "stays read-only": 74, "dies": -signal.SIGKILL}


def child(*arguments: str) -> int:
    """Exit code of the command in a forked process."""
    return exit_code(forked("run", "small.toml", *arguments))


def every_operation(way: str, how: str) -> None:
    """A run for every N, with what goes wrong then, and the one that goes on, forked of a process that has run once."""
    parts.IN_MEMORY = 0 if way == ON_DISK else parts.IN_MEMORY
    write(Path(), WAYS[way])
    assert main(["run", "small.toml", "-o", "whole.nc"]) in (0, 3)
    whole, number, ended = open_archive("whole.nc"), 0, ENDS[how]
    while ended == ENDS[how]:
        number += 1
        files.FAULTS = FAULTS[how](number)
        ended = child()
        files.FAULTS = files.Faults()
        assert ended in (ENDS[how], 0, 3), (number, ended)
        assert child() in (0, 3), number
        assert_same_archives(open_archive("small.nc"), whole)
        assert {path.name for path in Path().iterdir()} == {"small.nc", "small.toml", "whole.nc"}, number
        Path("small.nc").unlink()
    assert number > 20
    print(f"{number - 1} operations")


@pytest.mark.slow
@pytest.mark.fault(21, 24, 26)
@pytest.mark.parametrize("how", FAULTS)
@pytest.mark.parametrize("way", WAYS)
def test_a_run_that_fails_or_dies_anywhere_goes_on(way: str, how: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CALL, way, how],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0 and "operations" in done.stdout, done.stderr[-3000:]
