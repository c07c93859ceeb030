"""What the engine computes does not depend on what else was imported."""

from __future__ import annotations

import subprocess
import sys

import pytest

from engine.accuracy.ladder import ladder_of
from engine.batch.plan import EVERY_MARCH, make_plan
from engine.scene.study import load
from results_schema.errors import BadInput
from studies.protocol.study import kind_of

TEXT = """
schema_version = 1
kind = "{kind}"

[body.bed]
kind = "beam"
length = 10.0
area = 0.01
second_moment = 8e-6
youngs_modulus = "210 GPa"
density = 7850
supports = "pinned-pinned"
damping_ratio = 0.03

[carriage.table]
on = "bed"
kind = "mass"
mass = 1.0
motion = {{ kind = "cruise", start = 0.0, end = 10.0, speed = 0.01 }}

[sensor.midspan]
body = "bed"
at = 5.0

[solver]
tolerance = 1e-2
"""
RUN = """
import sys
{imports}
import engine
from hashlib import sha256
found = engine.run(engine.load(sys.argv[1]), threads=1)
text = [found.attrs, sorted((name, array.dims, array.values.tolist()) for name, array in found.variables.items())]
print(int(found.fidelity_used), sha256(repr(text).encode()).hexdigest())
"""
IMPORTS = ("", "import studies", "import studies\nfor kind in studies.kind_names(): studies.kind_named(kind)")


@pytest.mark.parametrize("kind", ["trajectory", "passage"])
def test_a_run_is_the_same_with_and_without_studies(kind: str) -> None:
    """The choice of the model and what is kept, in fresh processes with different imports."""
    text = TEXT.format(kind=kind)
    told = {
        subprocess.run(
            [sys.executable, "-c", RUN.format(imports=imports), text], capture_output=True, text=True, check=True
        ).stdout
        for imports in IMPORTS
    }
    assert len(told) == 1
    assert told.pop().startswith("3 ")  # so few that each converges with all terms


def test_a_study_says_whose_results_it_keeps() -> None:
    """Accelerations, which a trajectory keeps and statics have not, take more than statics."""
    study = load(TEXT.format(kind="trajectory"))
    kind = kind_of(study)
    plans = {results: make_plan(study, results=results) for results in (EVERY_MARCH, kind.name)}
    lowest = {results: ladder_of(plan.asked, plan.grids[0]).columns[0].fidelity for results, plan in plans.items()}
    assert lowest == {EVERY_MARCH: "static", "trajectory": "force"}
    with pytest.raises(BadInput, match="no such kind of results"):
        make_plan(study, results="nonsense")
