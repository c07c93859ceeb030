"""Beams that turn steadily about the vertical, beside their static equilibrium by SciPy: pulled by themselves, by the
radius of a hub, by a carriage."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from engine.scene.study import Study
from tests.floating.scenes import ARM, history, steps

LENGTH, STIFFNESS, PER_METRE, GRAVITY, RATE = 10.0, 7e10 * 2e-7, 1.2, 0.3, 5.0  # the first frequency is 3.8 rad/s
HUB, MASS, PLACE = 4.0, 2.0, 7.0


def static(hub: float, mass: float) -> float:
    """Deflection of the tip, m: (E I w'')'' - (T w')' = m g, T the pull by all that is further out."""

    def slopes(x: float, s: np.ndarray) -> np.ndarray:
        far, inside = hub + LENGTH, mass * (x < PLACE)
        pull = 0.5 * PER_METRE * RATE**2 * (far**2 - (hub + x) ** 2) + inside * RATE**2 * (hub + PLACE)
        further = (PER_METRE * (LENGTH - x) + inside) * GRAVITY
        return np.array([s[1], s[2] / STIFFNESS, pull * s[1] - further])

    def tip(moment: float) -> np.ndarray:
        """w, w' and the moment at the tip by the moment at the root, in which they are linear."""
        state = np.array([0.0, 0.0, moment])
        for ends in ((0.0, PLACE), (PLACE, LENGTH)):
            inner = (ends[0] + 1e-12, ends[1] - 1e-12)
            state = solve_ivp(slopes, inner, state, "DOP853", rtol=1e-11, atol=1e-9).y[:, -1]
        return state

    none, one = tip(0.0), tip(1.0)
    return float((none - none[2] / (one[2] - none[2]) * (one - none))[0])


@pytest.mark.parametrize(
    ("hub", "mass", "hung"), [(0.0, 0.0, 0.0), (HUB, 0.0, 0.0), (HUB, MASS, 0.0), (HUB, 0.0, MASS)]
)
def test_a_steadily_turning_beam_hangs_as_in_statics(hub: float, mass: float, hung: float) -> None:
    """Under its own weight and a carriage's or a body's that hangs on it, turning about the vertical above its first
    frequency: 0.1 %."""
    spin = {"kind": "revolute", "axis": [0, 0, 1], "motion": {"kind": "spin-up", "rate": RATE, "time": 5.0}}
    arm = ARM | {"modes": 10, "damping_ratio": 0.5, "own_weight": True}
    body, frame = {"arm": arm}, {"arm": {"stiffening": True, "joints": [spin]}}
    carriage = {}
    if hub:
        body["hub"] = {"kind": "rigid", "length": hub, "mass": 3.0, "inertia": 1.0, "own_weight": True}
        frame = {"hub": {"joints": [spin]}, "arm": {"on": "hub", "stiffening": True}}
    if mass:
        motion = {"kind": "waypoints", "times": [0, 1], "positions": [PLACE, PLACE]}
        carriage["load"] = {"kind": "mass", "on": "arm", "mass": mass, "motion": motion}
    if hung:
        small = {"length": 0.1, "inertia": 1e-6, "centre": 0.0}
        body["payload"] = {"kind": "rigid", "mass": hung, "own_weight": True} | small
        frame["payload"] = {"on": "arm", "at": PLACE}
    study = Study(kind="moving-frames", gravity=GRAVITY, body=body, frame=frame, carriage=carriage)
    model, marched = steps(study, 25.0, 25000, 25000)
    tip = history(model, marched, "ends", 3 * list(model.bodies).index("arm"), 3)[-1]
    assert np.hypot(tip[0], tip[1]) == pytest.approx(hub + LENGTH, rel=1e-9)
    assert tip[2] == pytest.approx(static(hub, mass + hung), rel=1e-3)
    without = PER_METRE * GRAVITY * LENGTH**4 / (8.0 * STIFFNESS)
    assert tip[2] < 0.6 * without  # what stiffens decides
