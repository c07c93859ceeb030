"""What is allowed and yet often a mistake is remarked; an ordinary study is not."""

from typing import Any

import pytest

from engine.batch.plan import make_plan
from engine.batch.plausibility import REMARKS, remarks
from engine.scene.study import Study
from tests.engine.build import beam, cruise, mass, study

WAY = cruise(0.0, 1.0, 0.5)


def passing(bed: Any = None, car: Any = None, **changes: Any) -> Study:
    return study(bed or beam(), car or mass(0.1, WAY), gravity=0.1, **changes)


CASES = {
    "210 GPa": passing(beam(youngs_modulus=210.0, density=7850.0)),
    "move away": passing(beam(supports="free-free")),
    "released undeformed": passing(beam(own_weight=True)),
    "leaves its body": passing(
        car=mass(0.1, {"kind": "waypoints", "times": [0.0, 2.0, 5.0], "positions": [0.1, 0.99, 0.99]})
    ),
    "critical speed": passing(car=mass(0.1, cruise(0.0, 1.0, 50.0))),
    "times its body": passing(car=mass(5.0, WAY)),
    "no structure bends so far": passing(car=mass(1.9, WAY), bed=beam(youngs_modulus=0.0005)),
    "small-deflection": passing(car=mass(1.9, WAY), bed=beam(youngs_modulus=0.01)),
    "in a first period": passing(beam(modes=1), solver={"steps": 30}),
}


@pytest.mark.parametrize("words", CASES)
def test_remarked(words: str) -> None:
    assert any(words in sentence for sentence in remarks(make_plan(CASES[words])))


def test_an_ordinary_study_is_not_remarked() -> None:
    assert remarks(make_plan(passing())) == []


def test_every_remark_has_its_case() -> None:
    assert len(CASES) > len(REMARKS)
