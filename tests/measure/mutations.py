"""Damaged model files and archives: `python -m tests.measure.mutations [CASES [SEED]]`.

Each case is a file with damage, given to the command in a forked process of its own, as is the reader of model files
(which the command starts anew each time: a second or more). Model files end with 2, or with 0 or 3 where the damage
leaves a model; archives end with 4, or with 0 where the command finds what it found before the damage. Whatever else
comes (another code, a signal, a traceback, more than SECONDS) is told with its number, and the file is kept.
Needs the extras `nastran` and `ansys`.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import chdir, redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from engine.bodies.files import child_process, reader
from engine.bodies.reduced.body import save_body
from studies.commands.cli import main as command
from tests.bodies.frames import PINNED, body, straight
from tests.bodies.models import damaged
from tests.protocol.test_cells import KEPT, TEXT
from tests.studies import imported
from tests.studies.every_way import TEXTS
from tests.studies.forked import exit_code, forked

SECONDS = 150.0  # a reader ends by itself after 120
EXTRAS = ("mapdl_archive", "ansys.mapdl.reader", *(f"pyyeti.nastran.{name}" for name in ("op2", "op4", "n2p")))
SENSOR = {"middle": {"body": "bed", "at": 2.0}}
MOTION = {"kind": "cruise", "start": 0.0, "end": 4.0, "speed": 20.0}
CARRIAGE = {"car": {"on": "bed", "kind": "mass", "mass": 50.0, "motion": MOTION}}
RUN = ("run", "bed.toml", "--overwrite", "-o", "found.nc")
EXPORT = ("export", "a.nc", "found.csv")


@dataclass(frozen=True)
class Target:
    """What is damaged: its name, the file, what the command is given then and what it leaves that must stay the same,
    the share of all cases, and whether single bits are flipped."""

    name: str
    file: str
    arguments: tuple[str, ...]
    left: str = ""
    share: float = 0.06
    bits: bool = False


def model_targets() -> Iterator[tuple[str, dict[str, Any], list[Target]]]:
    """Bodies out of files, written into folders by these names."""
    folder = Path("matrices")
    yield (
        str(folder),
        imported.matrices(_made(folder)),
        _files("stiffness.mtx", "mass.npz", "nodes.csv", "freedoms.csv"),
    )
    folder = Path("cards")
    yield str(folder), imported.nastran(_made(folder)), _files("matrices.pch", "nodes.bdf", "grids.bdf")
    truss = Path(import_module("pyyeti").__file__ or "").parent / "tests"
    folder = _copied(Path("op4"), truss / "cla_test_data", "outboard.op4", "outboard.asm", "outboard.pch")
    found = {"kind": "nastran", "matrices": "outboard.op4", "nodes": "outboard.asm", "track": {"nodes": [3, 11]}}
    yield str(folder), found, _files("outboard.op4", "outboard.asm", "outboard.pch", share=0.04)
    folder = _copied(Path("op2"), truss / "nas2cam_extseout", "nas2cam.op2", "nas2cam.op4")
    found |= {"matrices": "nas2cam.op4", "nodes": "nas2cam.op2", "superelement": 101}
    yield str(folder), found, _files("nas2cam.op2", share=0.04)
    solid = Path(import_module("ansys.mapdl.reader").__file__ or "").parent / "examples"
    folder = _copied(Path("ansys"), solid, "file.full", "file.rst", "HexBeam.cdb")
    found = {"kind": "ansys", "full": "file.full", "nodes": "HexBeam.cdb", "gravity_direction": [0.0, -1.0, 0.0]}
    found |= {"track": {"from": [0.0, 1.0, 0.0], "to": [0.0, 1.0, 5.0]}, "modes": 4}
    yield str(folder), found, _files("HexBeam.cdb", "file.full", share=0.03)
    folder = _copied(Path("rst"), solid, "file.full", "file.rst")
    yield str(folder), found | {"nodes": "file.rst"}, _files("file.rst", share=0.03)
    save_body(body(straight(PINNED, modes=6)), _made(Path("reduced")) / "body.nc")
    yield "reduced", {"kind": "reduced", "file": "body.nc"}, _files("body.nc")


def _files(*names: str, share: float = 0.06) -> list[Target]:
    return [Target(name, name, RUN, share=share) for name in names]


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def _copied(folder: Path, origin: Path, *names: str) -> Path:
    for name in names:
        (_made(folder) if not folder.exists() else folder).joinpath(name).write_bytes((origin / name).read_bytes())
    return folder


def archive_targets() -> Iterator[tuple[str, str, list[Target]]]:
    """Studies of every way to compute and to keep, whose archives are damaged."""
    for name, text in (TEXTS | {"cells": TEXT + KEPT["percentiles"]}).items():
        some = Target(f"archive, {name}", "a.nc", EXPORT, "found.csv", share=0.04)
        yield name, text, [some, Target(f"bits of archive, {name}", "a.nc", EXPORT, "found.csv", 0.02, bits=True)]


def flipped(text: bytes, count: int, seed: int) -> Iterator[bytes]:
    """Single bits at random."""
    for place in np.random.default_rng(seed).integers(0, 8 * len(text), count).tolist():
        found = bytearray(text)
        found[place // 8] ^= 1 << (place % 8)
        yield bytes(found)


def read_in_fork(arguments: list[str], **how: Any) -> subprocess.CompletedProcess[str]:
    """The reader of model files, as `subprocess.run` would start it, in a fork of a process that has loaded it."""
    with tempfile.TemporaryDirectory() as folder:
        asked, said = Path(folder) / "asked", Path(folder) / "said"
        asked.write_text(how["input"], encoding="utf-8")
        number = os.fork()
        if number == 0:
            sys.stdin = asked.open(encoding="utf-8")
            os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT), 2)
            try:
                code = child_process.main()
            except BaseException:
                traceback.print_exc()
                code = 1
            sys.stderr.flush()
            os._exit(code)
        if not _ends_in(number, how["timeout"]):
            os.kill(number, signal.SIGKILL)
            exit_code(number)
            raise subprocess.TimeoutExpired(arguments, how["timeout"])
        return subprocess.CompletedProcess(
            arguments, exit_code(number), "", said.read_text(encoding="utf-8", errors="replace")
        )


def _ends_in(number: int, seconds: float) -> bool:
    """Whether a process ends in so many seconds (it can still be waited for)."""
    end = time.monotonic() + seconds
    while not (ended := os.waitid(os.P_PID, number, os.WEXITED | os.WNOHANG | os.WNOWAIT)) and time.monotonic() < end:
        time.sleep(0.002)
    return ended is not None


def outcome(target: Target, wanted: bytes) -> str:
    """What becomes of the command, in this folder: its code, or "" and what was wrong with it."""
    number = forked(*target.arguments, screen="said")
    if not _ends_in(number, SECONDS):
        os.kill(number, signal.SIGKILL)
        return f"BAD: {exit_code(number)} after {SECONDS} s"
    code, said = exit_code(number), Path("said").read_text(encoding="utf-8", errors="replace")
    allowed = (0, 4) if target.left else (0, 2, 3)
    if code not in allowed or "Traceback" in said:
        return f"BAD: code {code}, {said[-300:]}"
    if code == 0 and target.left and Path(target.left).read_bytes() != wanted:
        return "BAD: other numbers"
    return f"code {code}"


def cases(target: Target, count: int, seed: int) -> Iterator[str]:
    """What becomes of so many damaged files."""
    assert outcome(Target(target.name, target.file, target.arguments), b"") == "code 0", Path("said").read_text()
    wanted = Path(target.left).read_bytes() if target.left else b""
    whole = Path(target.file).read_bytes()
    for number, text in enumerate((flipped if target.bits else damaged)(whole, count, seed)):
        for left in ("found.nc", "found.csv"):
            Path(left).unlink(missing_ok=True)
        Path(target.file).write_bytes(text)
        found = outcome(target, wanted)
        if found.startswith("BAD"):
            kept = Path(tempfile.gettempdir()) / f"bad-{os.getpid()}-{number}-{target.file}"
            kept.write_bytes(text)
            print(f"{target.name}, case {number} of seed {seed}: {found}; kept as {kept}", flush=True)
        yield found.partition(":")[0]
    Path(target.file).write_bytes(whole)


def _quietly(*arguments: str) -> None:
    """The command in this process, so that forks of it have loaded and compiled everything."""
    with redirect_stdout(StringIO()):
        assert command(arguments) in (0, 3)


def told(targets: list[Target], count: int, seed: int) -> None:
    """The lines of what is damaged in this folder."""
    for target in targets:
        found = Counter(cases(target, round(target.share * count), seed))
        print(f"{target.name}: {', '.join(f'{many} {what}' for what, many in sorted(found.items()))}", flush=True)


def main(count: int, seed: int) -> None:
    """All of it."""
    for name in EXTRAS:
        import_module(name)
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for name, table, targets in model_targets():
            imported.write(Path(name), table, kind="eigenfrequencies", sensor=SENSOR, carriage=CARRIAGE)
            with chdir(name), mock.patch.object(reader.subprocess, "run", read_in_fork):
                _quietly(*RUN)
                told(targets, count, seed)
        for name, text, targets in archive_targets():
            with chdir(_made(Path(name))):
                Path("study.toml").write_text(text, encoding="utf-8")
                _quietly("run", "study.toml", "-o", "a.nc")
                told(targets, count, seed)


if __name__ == "__main__":
    main(*map(int, (*sys.argv[1:], *("10000", "1")[len(sys.argv) - 1 :])))
