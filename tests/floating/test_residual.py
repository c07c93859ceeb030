"""The equations of motion in space, their tangent, and each of their terms, beside particles over the ground, virtual
work and differences."""

import os
import subprocess
import sys

from tests.floating import given_twin, loads_twin, residual_twin, stiffening_twin, tangent_twin
from tests.readme import README

TERMS = {
    "residual_twin": residual_twin.TERMS,
    "loads_twin": loads_twin.TERMS,
    "stiffening_twin": stiffening_twin.TERMS | stiffening_twin.TURNING,
    "tangent_twin": tangent_twin.TERMS,
    "given_twin": given_twin.TERMS | given_twin.LINEARISED,
}


def test_every_term_of_the_equations() -> None:
    """In a process of its own, as kernels that are not compiled can be asked and changed."""
    lines = "\n".join(f"import tests.floating.{twin} as t; print('twin'); t.main()" for twin in TERMS)
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", lines]
    finished = subprocess.run(command, cwd=README.parent, env=environment, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr[-2000:]
    counts = [said.count("without ") for said in finished.stdout.split("twin\n")[1:]]
    assert counts == [len(terms) for terms in TERMS.values()] and min(counts) > 2
