"""Bending stresses of rails against closed forms, a finer rail and all modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engine.robots.march import march, rest, stretches
from engine.robots.model import build
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
    np.testing.assert_allclose(largest_stress(model, record), max(moments) * HIGH / 1e-3, rtol=2e-4)


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
        found.append(largest_stress(model, record))
    largest = found[1].max(axis=0)
    assert (largest > 1e6).all() and (np.abs(found[0] - found[1]).max(axis=0) < 2e-2 * largest).all()
