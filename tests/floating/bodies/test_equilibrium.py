"""Bodies whose frames move, from static equilibrium: closed forms, a root by SciPy, stability, and what is refused."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from engine.floating.march import march
from engine.floating.model import build
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.protocol.study import kind_of
from tests.floating.scenes import ARM, AVERAGE_ACCELERATION, history, steps

GRAVITY, LENGTH, STIFFNESS, WEIGHT = 0.3, 10.0, 7e10 * 2e-7, 1.2 * 0.3
MASS, SPRING = 2.0, 30.0
TURNS: dict[str, Any] = {"kind": "revolute", "axis": [0, 1, 0]}
STILL = TURNS | {"motion": {"kind": "waypoints", "times": [0, 1], "values": [0, 0]}}


def resting(joint: dict[str, Any], **tables: Any) -> Study:
    """The arm on a joint."""
    return Study(
        kind="moving-frames",
        gravity=GRAVITY,
        initial="equilibrium",
        body={"arm": ARM | {"own_weight": True, "modes": 8}},
        frame={"arm": {"joints": [joint]}},
        sensor={"tip": {"body": "arm", "at": LENGTH}},
        question={"duration": 5.0},
        **tables,
    )


@pytest.mark.parametrize("joint", [STILL, TURNS | {"stiffness": 1e9}])
def test_a_cantilever_with_an_oscillator_at_its_end_stays_where_statics_have_it(joint: dict[str, Any]) -> None:
    """w = q L^4/(8 E I) + P L^3/(3 E I), and its spring is compressed by m g/k; nothing moves."""
    motion = {"kind": "waypoints", "times": [0, 1], "positions": [LENGTH - 1e-6] * 2}
    trolley = {"kind": "oscillator", "on": "arm", "mass": MASS, "wheel_mass": 0.1, "stiffness": SPRING, "damping": 0.0}
    model, marched = steps(resting(joint, carriage={"trolley": trolley | {"motion": motion}}), 5.0, 1000)
    tip, sprung = history(model, marched, "sensors")[:, 0], history(model, marched, "carriages", 7)[:, 0]
    wanted = WEIGHT * LENGTH**4 / (8.0 * STIFFNESS) + (MASS + 0.1) * GRAVITY * LENGTH**3 / (3.0 * STIFFNESS)
    assert tip[0] == pytest.approx(wanted, rel=1e-4)
    assert sprung[0] == pytest.approx(MASS * GRAVITY / SPRING, rel=1e-9)
    assert np.ptp(tip) < 1e-9 * wanted and np.ptp(sprung) < 1e-9 * wanted


def test_a_rigid_arm_sinks_on_its_soft_joint() -> None:
    """By a large angle: k angle = m g l cos(angle)."""
    study = resting(TURNS | {"stiffness": 4.0, "damping": 0.1})
    rigid = {"kind": "rigid", "length": LENGTH, "mass": 3.0, "inertia": 1.0, "own_weight": True}
    data = {key: table for key, table in study.data.items() if key not in ("schema_version", "body", "sensor")}
    model, marched = steps(Study(**(data | {"body": {"arm": rigid}})), 1.0, 100)
    wanted = brentq(lambda angle: 4.0 * angle - 3.0 * GRAVITY * 5.0 * np.cos(angle), 0.0, 1.5, xtol=1e-14)
    assert wanted > 0.7
    ends = history(model, marched, "ends", 0, 3)
    assert ends[0] == pytest.approx([LENGTH * np.cos(wanted), 0.0, LENGTH * np.sin(wanted)], abs=1e-9)
    assert np.ptp(ends, axis=0).max() < 1e-9


def test_only_what_would_fall_over_has_no_start() -> None:
    """An arm that stands upright on a spring, of k over or under m g l."""
    study = Study(
        kind="moving-frames",
        gravity=GRAVITY,
        initial="equilibrium",
        body={"arm": {"kind": "rigid", "length": LENGTH, "mass": 3.0, "inertia": 1.0, "own_weight": True}},
        frame={"arm": {"turned": [0.0, 0.5 * np.pi, 0.0], "joints": [TURNS | {"stiffness": 5.0}]}},
        question={"duration": 1.0},
    )
    key, fall = "frame.arm.joints.0.stiffness", 3.0 * GRAVITY * 5.0
    values = VariantValues(study, {key: np.array([1.01, 0.99]) * fall}, 2)
    found = march(build(study), values, np.ones(2), 100, np.arange(101), AVERAGE_ACCELERATION)
    assert found.status.tolist() == [Status.OK, Status.NOT_CONVERGED]


SLIDING = {"kind": "mass", "on": "arm", "mass": 1.0, "motion": {"kind": "free", "start": 2.0}}


@pytest.mark.parametrize(
    ("joint", "tables", "words"),
    [
        (TURNS, {}, r"frame\.arm\.joints\.0: no equilibrium is known where nothing holds this joint"),
        ({"kind": "spherical"}, {}, "nothing holds this joint"),
        (TURNS | {"stiffness": 1.0, "start": 0.5}, {}, r"joints\.0\.start: a joint that starts in equilibrium"),
        (STILL, {"carriage": {"load": SLIDING}}, r"carriage\.load\.motion\.kind: .* slides freely"),
    ],
)
def test_what_has_no_equilibrium_is_refused(joint: dict[str, Any], tables: dict[str, Any], words: str) -> None:
    study = resting(joint, **tables)
    with pytest.raises(BadInput, match=words):
        kind_of(study).parts(study)
