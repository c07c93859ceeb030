"""The loop that all steppers share, and the codes of lanes that come out of the kernels."""

import numpy as np
import pytest

from engine.kernels.layout import DIVERGED, LANES, NOT_CONVERGED, SOUND
from engine.march.march import prepare
from engine.march.stepper import Codes, Halted, go
from engine.march.tables import SceneTables
from engine.model.scene_model import build_model
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from tests.engine.build import beam, cruise, fixed, mass, study


class Written:
    """A stepper of two lanes that writes down what is asked of it; a segment is the code of its second lane."""

    def __init__(self) -> None:
        self.asked: list[object] = []

    def tabulate(self, segment: int) -> str:
        return f"table {segment}"

    def observe(self, segment: int, table: str) -> str:
        return f"watch {table}"

    def start(self, segment: int, table: str, observed: str, before: int | None) -> None:
        self.asked.append((segment, table, observed, before))

    def step(self, segment: int, table: str, observed: str) -> Codes:
        self.asked.append(segment)
        return np.array([SOUND, segment], dtype=np.int8)


def test_a_segment_is_started_and_stepped_with_its_own_table_and_the_worst_code_stays() -> None:
    stepper = Written()
    np.testing.assert_array_equal(go(stepper, [SOUND, DIVERGED, NOT_CONVERGED]), [SOUND, DIVERGED])
    assert stepper.asked[:3] == [(0, "table 0", "watch table 0", None), 0, (2, "table 2", "watch table 2", 0)]


def test_a_halt_comes_between_segments() -> None:
    stepper = Written()
    with pytest.raises(Halted):
        go(stepper, [SOUND, SOUND, SOUND], lambda: len(stepper.asked) == 4)
    assert len(stepper.asked) == 4


def crossing() -> Study:
    solver = {"scheme": "central-difference", "steps": 100}
    return study(beam(), mass(0.1, cruise(0.0, 1.0, 1.0)), sensor={"mid": fixed(0.5)}, solver=solver)


@pytest.mark.fault(17)
def test_a_lane_that_diverges_says_so_and_its_neighbours_do_not() -> None:
    """Central differences leave omega h = 2 behind where a variant is slow; the others share its block."""
    given = crossing()
    speeds = np.full(LANES, 4.0 * 157.9 / 200.0)  # omega_4 h = 157.9/(100 v) = 0.5
    speeds[3] = 157.9 / 250.0  # 2.5
    values = VariantValues(given, {"carriage.car.motion.speed": speeds}, LANES)
    tables = SceneTables(build_model(given, {}, {}), 100, "whole")
    codes = prepare(tables, values, np.zeros(0, dtype=np.int64)).go()
    expected = np.full((1, LANES), SOUND)
    expected[0, 3] = DIVERGED
    np.testing.assert_array_equal(codes, expected)
