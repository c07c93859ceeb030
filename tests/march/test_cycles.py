"""What a study's reduction is given of a cycle."""

import numpy as np
import pytest

from engine.batch.execution import run
from engine.batch.plan import make_plan
from engine.model.rider import Rider
from engine.model.timeline import build_timeline
from engine.observation.histories import counts_reduced
from tests.engine.build import beam, cruise, force, study, swing
from tests.engine.kept_cycles import Kept


def test_phases_are_those_of_the_motion_where_steps_are_not_equal() -> None:
    """Another load leaves the beam within the last cycle, where steps are cut: counts of steps tell no phase."""
    kept, frequency = Kept(1000), 0.3
    passing = force(1.0, cruise(0.0, 1.0, frequency / 1.37))
    given = study(
        beam(modes=3), {"car": force(1.0, swing(0.5, 0.4, frequency, 2)), "next": passing}, solver={"steps": 97}
    )
    run(given, reduction=kept)
    cycle = kept.cycles[0]
    assert cycle.phase[0] == 0.0 and cycle.phase[-1] == 1.0
    assert np.ptp(np.diff(cycle.phase)) > 1e-3 / 97
    np.testing.assert_allclose(cycle.position, 0.5 + 0.4 * np.sin(2.0 * np.pi * cycle.phase), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("steps", "stations", "expected"),
    [
        (400, 8192, 400),
        (6400, 8192, 6400),
        (12800, 400, 400),
        (102400, 8192, 12800),
        (120354, 8192, 9258),
        (97, 40, 97),
    ],
)
def test_stations_of_a_cycle(steps: int, stations: int, expected: int) -> None:
    """From the beginning of the last of three cycles to its end, as many as wanted and less than twice as many where
    the number of steps has such a divisor."""
    given = study(beam(modes=2), force(1.0, swing(0.5, 0.3, 0.3, 3)), kind="double-peak")
    motion = make_plan(given, reduction=Kept(1000)).base.riders[0].motion
    timeline = build_timeline((Rider(motion, 1.0),), steps, "last-cycle")
    counts = counts_reduced(timeline, stations)
    assert (counts[0], counts[-1]) == (2 * steps, 3 * steps)
    assert counts.size == expected + 1 and np.ptp(np.diff(counts)) == 0
