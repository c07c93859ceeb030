"""What elements of bodies whose frames move leave is part of the told errors, and makes no status."""

from typing import Any

import numpy as np
import pytest

from engine.floating.converge import Level, converge, levels
from engine.floating.model import build
from engine.floating.model_choice import choose
from engine.floating.results import differences, results_of
from engine.scene.study import Study
from engine.scene.sweep import expand
from engine.scene.variants import VariantValues
from results_schema.status import Status
from tests.floating.scenes import ARM

TIME, VARIANTS = 4.0, 24
SWING = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "spin-up", "rate": -0.5, "time": 2.0}}
READ = ("displacement", "acceleration", "bending_moment")


def swung(elements: int) -> Study:
    """An arm of one member that is swung."""
    own = {key: ARM[key] for key in ("area", "youngs_modulus", "density")} | {"second_moment": 2e-6}
    stiff = {"second_moment_lateral": 1e-6, "shear_modulus": 2.7e10, "torsion_constant": 1e-6}
    body: dict[str, Any] = {
        "kind": "frame",
        "node": {"root": [0, 0, 0], "tip": [10, 0, 0]},
        "section": {"all": own | stiff},
        "member": {"all": {"nodes": ["root", "tip"], "section": "all", "elements": elements}},
        "supports": {"root": "clamped"},
        "track": {"members": ["all"]},
        "damping_ratio": 0.02,
        "own_weight": True,
    }
    return Study(
        kind="moving-frames",
        gravity=9.81,
        body={"arm": body},
        frame={"arm": {"joints": [SWING]}},
        sensor={name: {"body": "arm", "at": 6.2, "quantity": name} for name in READ},
        sweep={"rate": {"of": "frame.arm.joints.0.motion.rate", "from": 0.2, "to": 0.6, "count": VARIANTS}},
        question={"duration": TIME},
        solver={"tolerance": 1e-2},
    )


@pytest.mark.parametrize("elements", [2, 4])
def test_told_errors_are_above_those_beside_many_elements(elements: int) -> None:
    given, many = swung(elements), swung(8 * elements)
    cases, scene = expand(given), given.without_sweep()
    values = VariantValues(scene, cases.columns_of(np.arange(VARIANTS)), VARIANTS)
    duration = np.full(VARIANTS, TIME)
    pilots = np.linspace(0, VARIANTS - 1, 16).astype(np.int64)
    rung = choose(scene, values.part(pilots), duration[pilots], TIME)
    found = converge(scene, values, duration, TIME, rung)
    fine = [level for level in levels(rung.of(scene), TIME, rung.modes) if level.steps >= found.steps.max()][1]
    whole = Level(build(rung.of(many.without_sweep()), rung.modes), fine.steps, fine.every, fine.scheme)
    true = differences(whole.model, found.outcome, whole.march(values, duration))
    held = np.isfinite([result.tolerance for result in results_of(whole.model)])
    assert true[held].max() > 1e-3 and np.isin(found.status, [Status.OK, Status.BEYOND_THEORY]).all()
    matter = true > 1e-4
    told = found.error[matter] / true[matter]
    assert np.mean(told >= 1.0) > 0.97 and np.median(told) < 5.0
