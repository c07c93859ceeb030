"""Bodies in a tree: two links, rigid and flexible, and a spring-driven joint."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from engine.scene.study import Study
from tests.floating.scenes import FOX_GOODWIN, history, steps

HINGE = {"kind": "revolute", "axis": [0, 1, 0]}
LINK = {"kind": "rigid", "length": 1.0, "mass": 2.0, "inertia": 2.0 / 12.0, "own_weight": True}


def double_pendulum(upper: dict[str, object], lower: dict[str, object], **second: object) -> Study:
    return Study(
        kind="moving-frames",
        gravity=9.81,
        body={"upper": upper, "lower": lower},
        frame={"upper": {"joints": [HINGE]}, "lower": {"on": "upper", "joints": [HINGE | {"start": 0.5} | second]}},
    )


def test_two_rigid_links_against_lagrange() -> None:
    """Absolute angles (below the horizontal) of two slender links, equations from a textbook, by SciPy, to 1e-9: the
    steps' error is of order 2 and extrapolated away."""
    m, length, g = 2.0, 1.0, 9.81

    def rates(t: float, s: np.ndarray) -> np.ndarray:
        a, b, da, db = s
        M = np.array([[4 / 3, 0.5 * np.cos(a - b)], [0.5 * np.cos(a - b), 1 / 3]]) * m * length**2
        curve = 0.5 * m * length**2 * np.sin(a - b)
        force = np.array(
            [-curve * db**2 + 1.5 * m * g * length * np.cos(a), curve * da**2 + 0.5 * m * g * length * np.cos(b)]
        )
        return np.concatenate([[da, db], np.linalg.solve(M, force)])

    # turning about +y brings x up: an angle of the joint is one above the horizontal
    exact = solve_ivp(rates, (0.0, 1.0), [0.0, -0.5, 0.0, 0.0], rtol=1e-12, atol=1e-12).y[:, -1]
    ends = []
    for count in (2000, 4000, 8000):
        model, marched = steps(double_pendulum(LINK, LINK), 1.0, count, count)
        ends.append(history(model, marched, "ends", 0, 6)[-1])
    wanted = [np.cos(exact[0]), 0.0, np.sin(exact[0])]
    wanted += [wanted[0] + np.cos(exact[1]), 0.0, wanted[2] + np.sin(exact[1])]
    errors = [np.abs(end - wanted).max() for end in ends]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)
    once = [(4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(ends)]
    assert (16.0 * once[1] - once[0]) / 15.0 == pytest.approx(wanted, abs=1e-9)


def test_a_flexible_double_pendulum_keeps_its_energy() -> None:
    """To 1e-4 over 10 s with 350 steps per first period; order 2."""
    beam = {
        "kind": "beam",
        "length": 1.0,
        "area": 4e-4,
        "second_moment": 2e-8,
        "youngs_modulus": 7e10,
        "density": 3000.0,
        "modes": 2,
        "own_weight": True,
    }
    study = double_pendulum(beam | {"supports": "pinned-pinned"}, beam | {"supports": "clamped-free"})
    drifts = []
    for per_period in (350, 700):
        count = int(10.0 * 120.0947844956109 / (2.0 * np.pi) * per_period)
        model, marched = steps(study, 10.0, count, 11)
        kinetic, potential = history(model, marched, "whole", 0, 2).T
        drifts.append(np.abs(kinetic + potential - kinetic[0] - potential[0]).max() / kinetic.max())
    assert drifts[0] < 1e-4
    assert np.log2(drifts[0] / drifts[1]) == pytest.approx(2.0, abs=0.4)


def test_a_controlled_joint_follows_its_motion() -> None:
    """A stiff controller holds a joint near the motion that it steers to; a driven one is on it."""
    motion = {"kind": "waypoints", "times": [0, 1], "values": [0.5, 1.0]}
    found = []
    for own in ({"stiffness": 1e7, "damping": 1e4}, {}):
        joint = {"motion": motion, **own} | ({"start": 0.5} if own else {"start": None})
        joint = {key: value for key, value in joint.items() if value is not None}
        hinge = HINGE | joint
        study = Study(
            kind="moving-frames",
            gravity=9.81,
            body={"upper": LINK, "lower": LINK},
            frame={"upper": {"joints": [HINGE]}, "lower": {"on": "upper", "joints": [hinge]}},
        )
        model, marched = steps(study, 1.0, 4000, 4000, FOX_GOODWIN)
        found.append(history(model, marched, "ends", 0, 6)[-1])
    assert found[0] == pytest.approx(found[1], abs=1e-4)
