"""Levels of steps and modes: what they are, and when they end."""

from __future__ import annotations

import pytest

from engine.floating.converge import levels
from engine.scene.study import Study
from tests.floating.scenes import ARM

TIP = {"kind": "rigid", "length": 0.2, "mass": 2.0, "inertia": 0.01}


@pytest.mark.parametrize("bodies", [{"arm": ARM}, {"arm": ARM, "tip": TIP}], ids=["an arm", "an arm and a rigid body"])
def test_only_modes_that_are_open_end_the_levels(bodies: dict[str, object]) -> None:
    """Those that are fixed are marched in ever more steps; a rigid body leaves no modes open, though it names none."""
    study = Study(
        kind="moving-frames",
        gravity=0.0,
        body=bodies,
        frame={"tip": {"on": "arm"}} if "tip" in bodies else {},
        load={"push": {"on": "arm", "force": [0.0, 0.0, 1.0]}},
        question={"duration": 1.0},
    )
    found = list(levels(study, 1.0))
    assert len(found) == 12
    assert len({level.model.modes for level in found}) == 1
