"""Newton's method where nothing moves yet: what is left of balanced forces, and of motions that begin smoothly, is
rounding, of which no tangent can be made."""

from __future__ import annotations

import numpy as np
import pytest

from engine.floating.march import march
from engine.floating.model import build
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from tests.floating.scenes import ARM, AVERAGE_ACCELERATION, SPIN_UP, history, steps


@pytest.mark.parametrize("load", [0.1, 1.0])
def test_a_smooth_start_is_marched_at_every_rate(load: float) -> None:
    """The acceleration that is given at the start is a difference of two numbers that are equal but for rounding."""
    way = {"kind": "waypoints", "times": [0, 15], "positions": [2, 8]}
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body={"arm": ARM},
        frame={"arm": {"stiffening": True, "joints": [SPIN_UP]}},
        carriage={"load": {"on": "arm", "kind": "mass", "mass": load, "motion": way}},
        question={"duration": 20.0},
    )
    rates = np.linspace(1.0, 6.0, 160)  # 1.094, 3.453 and 4.428 gave up in the first step
    values = VariantValues(study, {"frame.arm.joints.0.motion.rate": rates}, rates.size)
    for count in (80, 160):
        found = march(build(study), values, np.full(rates.size, 2.0), count, np.zeros(1, int), AVERAGE_ACCELERATION)
        assert (found.status == 0).all()


@pytest.mark.parametrize("stiffness", [1e2, 1e6])
def test_a_body_between_two_springs_rests(stiffness: float) -> None:
    """Pulled as far by either."""
    for place in np.linspace(0.3, 2.9, 6):
        one, other = ([place + 0.5 + side, 0.2, 0.1] for side in (1.7, -1.7))
        study = Study(
            kind="moving-frames",
            gravity=0.0,
            body={"block": {"kind": "rigid", "length": 1.0, "mass": 3.7, "inertia": 0.31}},
            frame={"block": {"position": [place, 0.2, 0.1], "joints": [{"kind": "free"}]}},
            spring={
                name: {
                    "ends": [{"on": "block", "at": 0.5}, {"position": end}],
                    "stiffness": stiffness,
                    "length": 0.6,
                }
                for name, end in (("one", one), ("other", other))
            },
            question={"duration": 0.1},
        )
        model, found = steps(study, 0.1, 800)
        assert found.status[0] == 0
        assert np.abs(history(model, found, "ends")[:, 0] - place - 1.0).max() < 1e-12
