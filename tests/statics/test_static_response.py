"""Static readings along the timelines of marches of other steps: those of the coarsest at the stations that it has."""

import numpy as np
import pytest

from engine.batch.plan import make_plan
from engine.statics.static_response import Statics
from tests.engine.build import Table, beam, cruise, fixed, mass, shuttle, study, under

READ = {"middle": fixed(0.5), "below": under("car"), "rate": fixed(0.4, "velocity")}
MOTIONS: dict[str, Table] = {"cycle": shuttle(0.2, 0.8, 0.5, 0.1, 2), "passage": cruise(0.0, 1.0, 0.5) | {"after": 3.0}}


@pytest.mark.parametrize("name", MOTIONS)
def test_finer_marches_ask_the_coarsest(name: str) -> None:
    kind = "asymmetry" if name == "cycle" else "passage"
    plan = make_plan(study(beam(modes=6), mass(0.3, MOTIONS[name]), kind=kind, sensor=READ))
    (grid,) = plan.grids
    coarse, fine = (grid.tables(grid.scene, by).statics for by in (1, 8))
    stations = grid.stations(grid.scene, 8)
    fresh = Statics(fine.model, fine.timeline, fine.sensors)
    size = np.abs(fresh.at(stations)).max()
    assert np.abs(fine.at(stations) - fresh.at(stations)).max() <= 1e-12 * size
    assert np.abs(fine.slope_at(stations) - fresh.slope_at(stations)).max() <= 1e-7 * size
    assert fine.over_window is coarse.over_window
    assert fine.largest_influences.tolist() == fresh.largest_influences.tolist()
    if name == "cycle":
        assert fine.at(stations) is coarse.at(grid.stations(grid.scene, 1))
    between = stations[:-1] + 1
    assert np.abs(fine.at(between) - fresh.at(between)).max() == 0.0
