"""Modes that are too fast for a step take a larger beta of Newmark's: a march is stable and keeps Fox-Goodwin's phase
of what is slow, where masses slide and where bodies hang on bodies that bend."""

import numpy as np
import pytest

from engine.floating.march import march
from engine.floating.model import build
from engine.kernels.floating.layout import Weights
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.status import Fidelity, Status
from tests.floating.scenes import AVERAGE_ACCELERATION, FOX_GOODWIN

USUAL = FOX_GOODWIN._replace(raised=True)
STATIONS, TIME = 25, 1.0
ARM = {
    "kind": "beam",
    "length": 1.2,
    "area": 3.487e-4,
    "second_moment": 6.01e-8,
    "youngs_modulus": 7e10,
    "density": 2700.0,
    "supports": "clamped-free",
    "damping_ratio": 0.01,
    "modes": 10,
}
TURN = {"kind": "swing", "amplitude": 0.3, "frequency": 1.0}
TIP = {"at": 1.2, "quantity": "displacement"}
HINGE = {"kind": "revolute", "axis": [0, 1, 0], "motion": TURN}


def sliding() -> Study:
    """An arm that swings, and a mass three times its own that goes out on it."""
    way = {"kind": "waypoints", "times": [0, TIME], "positions": [0.3, 1.2]}
    load = {"on": "arm", "kind": "mass", "mass": 4.0, "motion": way}
    tables = {
        "frame": {"arm": {"joints": [HINGE]}},
        "carriage": {"load": load},
        "sensor": {"tip": TIP | {"body": "arm"}},
    }
    return Study(kind="moving-frames", gravity=0.0, question={"duration": TIME}, body={"arm": ARM}, **tables)


def chain() -> Study:
    """Two arms and a payload at the end of the second: their static shapes, and modes that move against each other,
    leave little mass, so that frequencies are many times those of each alone."""
    payload = {"kind": "rigid", "length": 0.1, "mass": 2.0, "inertia": 0.01}
    bodies = {"upper": ARM | {"modes": 3}, "lower": ARM | {"modes": 3}, "payload": payload}
    frames = {"upper": {"joints": [HINGE]}, "lower": {"on": "upper", "joints": [HINGE]}, "payload": {"on": "lower"}}
    return Study(
        kind="moving-frames",
        gravity=0.0,
        question={"duration": TIME},
        body=bodies,
        frame=frames,
        sensor={"tip": TIP | {"body": "lower"}},
    )


def bending(study: Study, steps: int, scheme: Weights, fidelity: Fidelity = Fidelity.FRAME) -> np.ndarray:
    """Of the last arm's end at all stations, m; empty where the march does not come through."""
    model = build(study)
    kept = np.arange(0, steps + 1, steps // STATIONS)
    found = march(model, VariantValues(study, {}, 1), np.array([TIME]), steps, kept, scheme, fidelity)
    return found.history[0, :, model.signal_of("sensors")] if found.status[0] == Status.OK else np.zeros(0)


@pytest.mark.parametrize(
    ("study", "fidelity", "off"),
    [
        (sliding(), Fidelity.FRAME, 1e-3),
        (sliding(), Fidelity.GIVEN_FRAME, 1e-3),
        (chain(), Fidelity.FRAME, 1e-2),
    ],
    ids=["sliding", "sliding, given", "chain"],
)
def test_no_step_is_too_long(study: Study, fidelity: Fidelity, off: float) -> None:
    """Where Fox-Goodwin alone grows without bound; what is slow stays as it is."""
    wanted = bending(study, 51_200, AVERAGE_ACCELERATION, fidelity)
    for steps in (400, 800, 1600):
        assert not bending(study, steps, FOX_GOODWIN, fidelity).size
        found = bending(study, steps, USUAL, fidelity)
        np.testing.assert_allclose(found, wanted, atol=off * np.abs(wanted).max())


@pytest.mark.parametrize(("study", "times"), [(sliding(), 10.0), (chain(), 1.5)], ids=["sliding", "chain"])
def test_it_is_closer_than_average_acceleration(study: Study, times: float) -> None:
    wanted = bending(study, 51_200, USUAL)
    for steps in (800, 1600, 3200):
        usual, plain = (np.abs(bending(study, steps, one) - wanted).max() for one in (USUAL, AVERAGE_ACCELERATION))
        assert usual < plain / times


def test_where_all_modes_are_slow_it_is_fox_goodwin() -> None:
    found, alone = (bending(sliding(), 25_600, one) for one in (USUAL, FOX_GOODWIN))
    np.testing.assert_allclose(found, alone, atol=1e-11)
