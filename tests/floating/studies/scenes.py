"""An arm that is turned while a trolley is driven along it."""

from typing import Any

from engine.scene.study import Study
from tests.floating.scenes import ARM

TURN = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "waypoints", "times": [0, 1], "values": [0, -0.1]}}
WAY = {"kind": "cruise", "start": 1.0, "end": 9.0, "speed": 8.0}
TOOL = {"kind": "rigid", "length": 1.0, "mass": 0.1, "inertia": 0.04}


def driven(way: Any = None, arm: Any = None, joints: Any = (TURN,), **more: Any) -> Study:
    """A light trolley for a second, which its motion keeps on the arm."""
    tables = {
        "gravity": 0.0,
        "body": {"arm": ARM | {"modes": 2} | (arm or {})},
        "frame": {"arm": {"joints": list(joints)}},
        "carriage": {"trolley": {"kind": "mass", "on": "arm", "mass": 0.2, "motion": WAY | (way or {})}},
        "question": {"duration": 1.0},
    }
    return Study(kind="moving-frames", **(tables | more))
