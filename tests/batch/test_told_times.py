"""Told errors of settling times, of variants whose readings may be off by known parts of their band."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from engine.accuracy.groups import Found
from engine.accuracy.results import results_of
from engine.batch.chunk import told_errors
from engine.batch.plan import make_plan
from engine.march.settling import WIDER
from engine.observation.cycle_reduction import HISTORY_PART
from tests.engine.build import beam, fixed, force, study

BAND = 1e-3
MOVE = {"kind": "point-to-point", "start": 0.2, "end": 0.7, "speed": 3.0, "acceleration": 9.0, "dwell": 1.5}


def test_a_settling_time_is_off_by_what_a_wider_or_narrower_band_changes_it() -> None:
    """The larger change; none where it surely stays within; no estimate where the narrower band is not kept, also of
    what has settled at once, where nothing is known of the readings, or where it has not settled."""
    given = study(
        beam(modes=1), force(2.0, MOVE), sensor={"m": fixed(0.5) | {"settling_band": BAND}}, output={"residual": True}
    )
    asked = make_plan(given).asked
    names = [result.name for result in results_of(asked)]
    residual = BAND * np.array([2.0, 0.999, 0.5, 2.0, 2.0, 0.999])
    took = np.array([0.5, 0.0, 0.0, 0.5, np.nan, 0.0])
    bands = np.broadcast_to(took[:, None, None], (6, 2, len(WIDER))).copy()
    bands[0, 0, 1], bands[0, 1, 1] = 0.45, 0.6  # of parts between the first and the second
    bands[[1, 5], 1] = np.nan
    error = np.zeros((len(names), 6))
    error[names.index("m_residual")] = HISTORY_PART * BAND * np.array([0.004, 0.004, 0.004, np.nan, 0.004, np.nan])
    numbers = {"m_residual": residual, "m_settling_time": took, "m_move_and_settle_time": 1.5 + took}
    outcome: Any = SimpleNamespace(numbers=numbers, scale=np.ones((6, 1)), other_bands={"m": bands})
    used = {"steps_used": np.full(6, 100)}
    told = told_errors(Found(outcome, used, error, error[0]), asked)
    settling, both = (told[names.index(f"m_{one}")] for one in ("settling_time", "move_and_settle_time"))
    np.testing.assert_allclose(settling, [0.2, np.nan, 0.0, np.nan, np.nan, np.nan])
    np.testing.assert_allclose(both, [0.1 / 2.0, np.nan, 0.0, np.nan, np.nan, np.nan])
