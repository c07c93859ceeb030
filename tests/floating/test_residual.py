"""The equations of motion in space, and each of their terms, beside particles over the ground."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.floating.residual_twin import TERMS
from tests.readme import README


def test_every_term_of_the_equations() -> None:
    """In a process of its own, as kernels that are not compiled can be asked and changed."""
    command = [sys.executable, "-m", "tests.floating.residual_twin"]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    finished = subprocess.run(command, cwd=README.parent, env=environment, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr[-2000:]
    assert finished.stdout.count("without ") == len(TERMS) > 40
