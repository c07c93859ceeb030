"""The equations of motion in space, their tangent, and each of their terms, beside particles over the ground, virtual
work and differences."""

import os
import subprocess
import sys

import pytest

from tests.floating import given_twin, loads_twin, residual_twin, stiffening_twin, tangent_twin
from tests.readme import README

TERMS = {
    "residual_twin": residual_twin.TERMS,
    "loads_twin": loads_twin.TERMS,
    "stiffening_twin": stiffening_twin.TERMS,
    "tangent_twin": tangent_twin.TERMS,
    "given_twin": given_twin.TERMS | given_twin.LINEARISED,
}


@pytest.mark.parametrize("twin", TERMS)
def test_every_term_of_the_equations(twin: str) -> None:
    """In a process of its own, as kernels that are not compiled can be asked and changed."""
    command = [sys.executable, "-m", f"tests.floating.{twin}"]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    finished = subprocess.run(command, cwd=README.parent, env=environment, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr[-2000:]
    assert finished.stdout.count("without ") == len(TERMS[twin]) > 2
