"""Models out of files, read by a process of its own with limits of time and memory."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

from engine.bodies.files.model import FileModel, load_model
from engine.bodies.files.text import no_such_file
from results_schema.errors import BadInput

SECONDS = 120
MEMORY = 6 * 2**30
State = tuple[int, int, int]  # of a file: when it was changed, its size, its number on the disk
_TAIL = 400  # characters of a crash that are told


@dataclass(frozen=True)
class Request:
    """What is to be read: kind of files, their paths by role, and options by name."""

    kind: str
    files: tuple[tuple[str, str], ...]
    options: tuple[tuple[str, str | int], ...] = ()
    seconds: int = SECONDS
    memory: int = MEMORY


def read_files(request: Request) -> FileModel:
    """The model of some files; the last few are remembered while the files, included ones too, stay as they are.

    Raises BadInput with file, line and card where they are known.
    """
    named = tuple(_state(path) for _, path in request.files)
    model, states = _remembered(request, named)
    if states != _states(model):
        _remembered.cache_clear()  # an included file has changed
        model, _ = _remembered(request, named)
    return model


def role_of(fault: BadInput, files: Mapping[str, str]) -> str:
    """The role of the file that a refusal names, else the first one."""
    named = [role for role, path in files.items() if path and fault.where.startswith(path)]
    return max(named, key=lambda role: len(files[role])) if named else next(iter(files))


@lru_cache(maxsize=8)
def _remembered(request: Request, named: tuple[State, ...]) -> tuple[FileModel, tuple[State | None, ...]]:
    """A model and the states of all its files."""
    model = _read(request)
    return model, _states(model)


def _states(model: FileModel) -> tuple[State | None, ...]:
    """Of every file that was read; None of one that has gone."""
    return tuple(_state(path) if Path(path).exists() else None for path, _ in model.hashes)


def _state(path: str) -> State:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        raise no_such_file(path) from None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _read(request: Request) -> FileModel:
    with tempfile.TemporaryDirectory(prefix="wanderlast-") as folder:
        answer, refusal = Path(folder) / "model.npz", Path(folder) / "refusal.json"
        named = {"files": dict(request.files), "options": dict(request.options)}
        order = asdict(request) | named | {"answer": str(answer), "refusal": str(refusal)}
        try:
            done = subprocess.run(
                [sys.executable, "-P", "-m", "engine.bodies.files.child_process"],
                input=json.dumps(order),
                capture_output=True,
                text=True,
                errors="replace",
                timeout=request.seconds,
                env=_environment(folder),
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise _slow(request) from None
        if done.returncode == BadInput.exit_code and refusal.is_file():
            raise BadInput(**json.loads(refusal.read_text(encoding="utf-8")))
        if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            raise _slow(request)
        if done.returncode < 0 or "MemoryError" in done.stderr[-_TAIL:]:
            reason = done.stderr.strip()[-_TAIL:] or signal.Signals(-done.returncode).name
            what, where = "the file cannot be read: its reader broke down", request.files[0][1]
            raise BadInput(what, where=where, received=reason.splitlines()[-1])
        if done.returncode:
            raise RuntimeError(f"reading {request.files[0][1]}: {done.stderr.strip()[-_TAIL:]}")
        return load_model(answer)


def _slow(request: Request) -> BadInput:
    what = "reading the file takes too long"
    return BadInput(what, where=request.files[0][1], expected=f"at most {request.seconds} s")


def _environment(folder: str) -> dict[str, str]:
    """One thread each, our own modules (and none of the working folder), caches of packages in a folder that goes."""
    ours = str(Path(__file__).parents[3])
    before = os.environ.get("PYTHONPATH", "")
    one = {key: "1" for key in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    path = os.pathsep.join(part for part in (ours, before) if part)
    return os.environ | one | {"PYTHONPATH": path, "MPLCONFIGDIR": folder, "MPLBACKEND": "Agg"}
