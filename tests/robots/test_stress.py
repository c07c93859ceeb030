"""Bending stresses of rails against closed forms, a finer rail and all modes."""

from typing import Any

import numpy as np
import pytest

from engine.kernels.robots.layout import OF_GRIP, PASSED, PASSED_GRIPS, Record
from engine.robots.converge import Ladder, Rung, climb, marched
from engine.robots.march import march, rest, stretches
from engine.robots.model import RobotModel, build
from engine.robots.peaks import Steps, peaks
from engine.robots.stress import largest_stress
from engine.scene.study import Study
from tests.robots.scenes import FOX_GOODWIN, rail, scene

HIGH, WIDE, LENGTH = 0.3, 0.2, 12.0  # distances of fibres, length, m
ON_RAIL, BESIDE, ARM = 500.0, 200.0, 0.8  # kg, m


def fibred(y: float = 0.0, **more: Any) -> dict[str, Any]:
    found = rail(y, **more)
    found["section"]["box"] |= {"fibre_distance": HIGH, "fibre_distance_lateral": WIDE}
    return found


def weights(at: list[float], modes: int) -> Study:
    """Carriages that stand on a simply supported beam, with a weight beside that turns it about y too."""
    slow = {"speed": 1, "acceleration": 1, "jerk": 1}
    weight = {"kind": "prismatic", "axis": [0, 0, 1], "mass": BESIDE, "centre": [ARM, 0, 0], **slow}
    arm = {"mass": ON_RAIL, "rail": slow, "links": [weight]}
    beam = fibred(modes=modes, elements=20) | {
        "spring": {},
        "supports": {"west": ["x", "y", "z", "rx"], "east": ["y", "z"]},
    }
    robots = {f"mass_{n}": {"arm": "mass", "rails": ["beam"], "start": [x, 0.0], "moves": []} for n, x in enumerate(at)}
    return Study(kind="portal", gravity=9.81, body={"beam": beam}, arm={"mass": arm}, robot=robots)


def _of(model: RobotModel, record: Record) -> np.ndarray:
    """(S, B) at stations."""
    y = record.coordinates[:, : model.modes, 0]
    return np.stack([largest_stress(model, b, y, record.grips) for b in range(len(model.rails))], axis=1)


@pytest.mark.parametrize("at", [[3.7], [3.7, 4.2], [1.6, 2.9, 10.1]])
@pytest.mark.parametrize("modes", [3, 12])
def test_standing_weights_bend_a_beam_as_in_closed_form(at: list[float], modes: int) -> None:
    model = build(weights(at, modes))
    record, _ = rest(model, stretches(model, 0.1, 0.1, 1))
    load, torque, moments = 9.81 * (ON_RAIL + BESIDE), 9.81 * BESIDE * ARM, []
    for x in at:
        for right in (False, True):
            by_force = sum(load * min(x, s) * (LENGTH - max(x, s)) / LENGTH for s in at)
            by_torque = sum(torque * (x / LENGTH - (x > s or (x == s and right))) for s in at)
            moments.append(abs(by_force - by_torque))
    np.testing.assert_allclose(_of(model, record), max(moments) * HIGH / 1e-3, rtol=2e-4)


@pytest.mark.parametrize("faster", [1.0, 3.0])
def test_the_largest_stress_is_that_of_all_steps(faster: float) -> None:
    """Beside steps that are sixteen times as dense, and all steps read; parabolas through stations missed 4e-4."""
    study = scene(solver={"tolerance": 1e-3}, body={"left": fibred(-3.0), "right": fibred(3.0)})
    study = study.with_values({"robot.portal.acceleration_scale": faster})
    ladder = Ladder.of(study, None, 0.5)
    found = climb(ladder, "start")
    dense = marched(ladder.level(Rung(0, found.rung.steps + 4)), "start").numbers["stress_largest"]
    own = found.outcome.numbers["stress_largest"]
    off = np.abs(own - dense) / dense
    assert (off <= found.error[-2:]).all() and off.max() < 5e-5
    level = ladder.level(found.rung)
    record, _ = march(level.model, level.times, FOX_GOODWIN)
    grips = record.passed[:, :, PASSED_GRIPS:PASSED].reshape(-1, 2, 2, OF_GRIP)
    for b, value in enumerate(own):
        whole = largest_stress(level.model, b, record.bent, grips)
        assert peaks(whole, Steps.of(level.times).stretch).value == pytest.approx(value, rel=1e-12)


def test_a_moving_gantry_bends_its_rails_as_with_all_of_their_modes() -> None:
    """Few modes with what they miss at rest, against all that rails of twice the elements have."""
    found = []
    for modes, elements in ((8, 8), (54, 16)):
        study = scene({"modes": modes, "elements": elements})
        for body in study.body:
            section = f"body.{body}.section.box"
            study = study.with_values({f"{section}.fibre_distance": HIGH, f"{section}.fibre_distance_lateral": WIDE})
        model = build(study)
        record, _ = march(model, stretches(model, 6.0, 0.004, 5), FOX_GOODWIN)
        found.append(_of(model, record))
    largest = found[1].max(axis=0)
    assert (largest > 1e6).all() and (np.abs(found[0] - found[1]).max(axis=0) < 2e-2 * largest).all()
