"""Largest values between steps, against recordings that are much denser."""

import numpy as np
import pytest

from engine.robots.converge import Ladder, Rung, climb, marched
from engine.robots.peaks import Steps, peaks
from engine.robots.results import DOING, OF_TOOLS
from tests.robots.scenes import scene

FAST = {"robot.portal.acceleration_scale": 3.0, "robot.portal.payload_scale": 2.0}


@pytest.mark.parametrize("per_period", [8, 16])
def test_a_parabola_finds_tops_between_steps_and_tells_what_it_adds(per_period: int) -> None:
    """Sines of all phases, of which the steps miss up to 1 - cos(pi/n), and the parabola a seventh of that."""
    t = 2.0 * np.pi * np.arange(3 * per_period) / per_period
    shifts = np.linspace(0.0, 1.0, 40)
    values = np.sin(t[:, None] + shifts)
    found = peaks(values, np.zeros(t.size, dtype=np.int64))
    largest = values.max(axis=0)
    assert largest.min() < 0.5 + 0.5 * np.cos(np.pi / per_period)
    assert (1.0 - found.value <= np.minimum(0.15 * (1.0 - np.cos(np.pi / per_period)), found.missed + 1e-15)).all()
    np.testing.assert_allclose(found.missed, found.value - largest, atol=1e-15)


def test_peaks_are_of_one_stretch_and_of_what_is_done_then() -> None:
    """A jump between two stretches is no top; what falls from a change of phase on may begin as high as the step
    before."""
    stretch = np.array([0, 0, 0, 1, 1, 1])
    values = np.array([0.0, 1.0, 3.0, 1.0, 0.5, 0.0])
    whole = peaks(values, stretch)
    assert (whole.value, whole.missed) == (3.0, 0.0)
    part = peaks(values[3:], stretch[3:], np.array([False, True, True]))
    assert (part.value, part.missed) == (0.5, 0.5)
    none = peaks(values, stretch, np.zeros(6, dtype=np.bool_))
    assert np.isnan(none.value) and none.missed == 0.0


def test_what_is_known_at_stations_goes_straight_between_them() -> None:
    ladder = Ladder.of(scene(), 2.0, 0.0)
    coarse, fine = (Steps.of(ladder.level(Rung(0, steps)).times) for steps in (0, 2))
    np.testing.assert_allclose(fine.between_stations(coarse.times), fine.times, atol=1e-12)
    jumping = coarse.stretch.astype(float)
    np.testing.assert_array_equal(fine.between_stations(jumping), fine.stretch)


@pytest.mark.parametrize("more", [{}, FAST], ids=["usual", "fast"])
def test_largest_values_hold_beside_steps_that_are_sixteen_times_as_dense(more: dict[str, float]) -> None:
    """Reported values, against the told errors; stations alone miss four times as much or more."""
    study = scene(solver={"tolerance": 1e-2}).with_values(more)
    ladder = Ladder.of(study, None, 0.5)
    found = climb(ladder, "start")
    dense = marched(ladder.level(Rung(found.rung.modes, found.rung.steps + 4)), "start")
    tools = len(study.robot)
    longest = np.nanmax([dense.numbers[f"error_{doing}"] for doing in DOING], axis=0)
    for name in OF_TOOLS:
        off = np.abs(found.outcome.numbers[name] - dense.numbers[name]) / longest
        assert (np.nan_to_num(off) <= found.error[:tools]).all() and np.nanmax(off) < 1e-3, name
    deep = dense.numbers["deflection_largest"]
    off = np.abs(found.outcome.numbers["deflection_largest"] - deep) / deep
    assert (off <= found.error[tools : tools + len(deep)]).all()
    bodies = found.model.system.body
    stations = np.array([found.outcome.sunk[:, bodies == b].max() for b in range(len(deep))])
    assert (4.0 * off < 1.0 - stations / deep).any()
    assert (found.outcome.missed > 0.0).all() and (found.error > found.outcome.missed).all()
