"""Small studies for tests of the command, and the command itself in this process and in one of its own."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

SMALL = """\
schema_version = 1
title = "small"
kind = "passage"

[body.beam]
kind = "beam"
length = 1.0
area = 0.01
second_moment = 1e-6
youngs_modulus = 1e9
density = 1000.0
supports = "pinned-pinned"
damping_ratio = 0.02
modes = 4

[carriage.trolley]
on = "beam"
kind = "mass"
mass = 1.0
motion = { kind = "cruise", start = 0.0, end = 1.0, speed = 5.0 }

[sensor.midspan]
body = "beam"
at = 0.5

[sweep]
speed = { of = "carriage.trolley.motion.speed", from = 0.5, to = 10.0, count = 8, spacing = "log" }
mass = { of = "carriage.trolley.mass", values = [0.1, 1.0] }

[solver]
steps = "auto"
audit = 2
"""

# The heavy ones lift off near the exit.
SEPARATED = SMALL.replace("values = [0.1, 1.0]", "values = [0.1, 10.0]").replace('title = "small"', 'title = "heavy"')

# As many variants, of eight scenes, each of which is a chunk of its own.
SCENES = SMALL.replace(
    'speed = { of = "carriage.trolley.motion.speed", from = 0.5, to = 10.0, count = 8, spacing = "log" }',
    'length = { of = "body.beam.length", from = 1.0, to = 1.07, count = 8 }',
)

# Minutes of marching in many chunks: so many scenes that all their variants converge.
LONG = SMALL.replace("[sweep]", '[sweep]\nlength = { of = "body.beam.length", from = 1.0, to = 1.3, count = 300 }')
LONG = LONG.replace('steps = "auto"', "steps = 40000")


def write(folder: Path, text: str = SMALL, name: str = "small.toml") -> Path:
    """A study file in a folder."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def command(*arguments: str) -> list[str]:
    """The command line of `wanderlast` with these arguments."""
    return [sys.executable, "-m", "studies", *arguments]


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """The command in a process of its own, in a folder; output and errors are kept."""
    return subprocess.Popen(
        command(*arguments),
        cwd=folder,
        env=_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The same, to its end."""
    return subprocess.run(
        command(*arguments), cwd=folder, env=_environment(), capture_output=True, text=True, timeout=120, check=False
    )


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT)}
