"""What the engine computes does not depend on what else was imported."""

import subprocess
import sys

import pytest

from engine.accuracy.ladder import ladder_of
from engine.batch.plan import EVERY_MARCH, make_plan
from results_schema.errors import BadInput
from studies.protocol.study import kind_of
from tests.studies import scenes

SLOW = "[solver]\ntolerance = 1e-2\n"
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


def test_a_run_is_the_same_with_and_without_studies() -> None:
    """The choice of the model and what is kept, in fresh processes with different imports."""
    told = {
        subprocess.run(
            [sys.executable, "-c", RUN.format(imports=imports), scenes.text_of("trajectory", extra=SLOW)],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for imports in IMPORTS
    }
    assert len(told) == 1
    assert told.pop().startswith("3 ")  # so few that each converges with all terms


def test_a_study_says_whose_results_it_keeps() -> None:
    """Accelerations, which a trajectory keeps and statics have not, take more than statics."""
    study = scenes.study("trajectory").with_values({"body.bed.modes": "auto", "carriage.table.mass": 1.0})
    kind = kind_of(study)
    plans = {results: make_plan(study, results=results) for results in (EVERY_MARCH, kind.name)}
    lowest = {results: ladder_of(plan.asked, plan.grids[0]).columns[0].fidelity for results, plan in plans.items()}
    assert lowest == {EVERY_MARCH: "static", "trajectory": "force"}
    with pytest.raises(BadInput, match="no such kind of results"):
        make_plan(study, results="nonsense")
