"""Largest values between steps, against recordings that are much denser."""

import numpy as np
import pytest

from engine.kernels.robots.layout import HOLDS, MOVES, WORKS
from engine.robots.converge import Ladder, Rung, climb, marched
from engine.robots.march import doing, stretches
from engine.robots.model import build
from engine.robots.peaks import Steps, peaks
from engine.robots.results import DOING, OF_TOOLS, ways, works
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
    """A jump between two stretches is no top."""
    stretch = np.array([0, 0, 0, 1, 1, 1])
    values = np.array([0.0, 1.0, 3.0, 1.0, 0.5, 0.0])
    whole = peaks(values, stretch)
    assert (whole.value, whole.missed) == (3.0, 0.0)
    part = peaks(values, stretch, stretch == 1)
    assert (part.value, part.missed) == (1.0, 0.0)
    none = peaks(values, stretch, np.zeros(6, dtype=np.bool_))
    assert np.isnan(none.value) and none.missed == 0.0


def test_stretches_end_where_robots_begin_and_end_what_they_do() -> None:
    """So that every step belongs to one of moving, working and holding, beside each robot's own plan at its time."""
    model = build(scene())
    cut = stretches(model, float(model.done.max()) + 0.5, 0.02, 2)
    ends = [time for way in (*ways(model), *works(model)) for time in (way.start, way.end)]
    assert np.abs(np.array(ends)[:, None] - np.append(cut.start, cut.start[-1] + 1e9)).min(axis=1).max() < 1e-9
    assert (np.diff(cut.start) > 1e-6).all() and (cut.steps >= 2).all()
    assert np.isclose(cut.start[-1] + cut.step[-1] * cut.steps[-1], model.done.max() + 0.5)
    for middle, done in zip(cut.start + 0.5 * cut.step * cut.steps, doing(model, cut), strict=True):
        for r in range(2):
            moves, working = (
                [w for w in own(model) if w.robot == r and w.start < middle < w.end] for own in (ways, works)
            )
            assert done[r] == (MOVES if moves else WORKS if working else HOLDS)


def test_what_is_known_at_stations_goes_straight_between_them() -> None:
    ladder = Ladder.of(scene(), 2.0, 0.0)
    coarse, fine = (Steps.of(ladder.level(Rung(0, steps)).times) for steps in (0, 2))
    np.testing.assert_allclose(fine.between_stations(coarse.times), fine.times, atol=1e-12)
    jumping = coarse.stretch.astype(float)
    np.testing.assert_array_equal(fine.between_stations(jumping), fine.stretch)


@pytest.mark.parametrize("more", [{}, FAST], ids=["usual", "fast"])
def test_largest_values_hold_beside_steps_that_are_sixteen_times_as_dense(more: dict[str, float]) -> None:
    """Reported values, against the told errors; stations alone miss four times as much or more."""
    study = scene(solver={"tolerance": 5e-3}).with_values(more)
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
