"""The scene in normalised time: windows, sides of events, who is where; and what a study's reduction is given."""

from typing import Any

import numpy as np
import pytest

from engine.batch.execution import run
from engine.batch.plan import make_plan
from engine.model.rider import Rider
from engine.model.timeline import build_timeline
from engine.scene.motions.along_bodies import Cruise, OutAndBack, Sinusoidal
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.engine.build import beam, cruise, fixed, force, mass, shuttle, study, swing, under
from tests.engine.kept_cycles import Kept
from tests.reference import closed_forms


def shuttling(turn: float, cycles: int) -> OutAndBack:
    return OutAndBack(kind="out-and-back", start=0.5, end=0.9, speed=1.0, turn=turn, cycles=cycles)


PASSAGE = Cruise(kind="cruise", start=-0.5, end=1.5, speed=1.0)


def test_sides_of_a_reversal() -> None:
    """On each side of an instant turn the speed is that side's, whatever rounding does to delay and pace."""
    rng = np.random.default_rng(4)
    for _ in range(500):
        rider = Rider(shuttling(0.0, 2), 1.0, float(rng.uniform(0.1, 5.0)), float(rng.uniform(0.0, 3.0)))
        cuts = [rider.delay + k / 2.0 / rider.pace for k in range(5)]
        for k in range(4):
            path = rider.path(np.linspace(cuts[k], cuts[k + 1], 7), cuts[k], cuts[k + 1])
            sign = 1.0 if k % 2 == 0 else -1.0
            np.testing.assert_allclose(path.dS, sign * 0.8 * rider.pace, rtol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.7])
def test_window_of_the_last_cycle(delay: float) -> None:
    """One cycle of the first carriage, whatever its delay and however long others go on."""
    late = Rider(PASSAGE, 1.0, 0.1, 0.2)
    for others in ((), (late,)):
        rider = Rider(shuttling(0.1, 3), 1.0, 1.0, delay)
        timeline = build_timeline((rider, *others), 200, "last-cycle")
        first, last = timeline.window
        tau = timeline.moments(np.array([first, last]))[1]
        np.testing.assert_allclose(tau, [delay + 2.0, delay + 3.0], rtol=0, atol=1e-9)
        assert 200 <= last - first <= 203
        recorded = [segment for segment in timeline.segments if segment.recorded]
        assert sum(segment.steps for segment in recorded) == last - first


def test_events_are_step_boundaries() -> None:
    riders = (
        Rider(PASSAGE, 1.0, 1.0, 0.0),
        Rider(shuttling(0.0, 2), 1.0, 1.7, 0.13),
        Rider(Sinusoidal(kind="sinusoidal", centre=0.5, amplitude=0.2, frequency=1.0, cycles=1), 1.0, 0.9, 0.4),
    )
    timeline = build_timeline(riders, 100, "whole")
    starts = [segment.start for segment in timeline.segments if segment.fresh]
    events = [0.0, 0.25, 0.75, 1.0, 0.13, *(0.13 + k / 2 / 1.7 for k in (1, 2, 3, 4)), 0.4]
    np.testing.assert_allclose(starts, sorted(events), rtol=0, atol=1e-12)
    assert timeline.steps == sum(segment.steps for segment in timeline.segments)
    for segment, following in zip(timeline.segments, timeline.segments[1:], strict=False):
        assert segment.end == following.start
        assert segment.first + segment.steps == following.first
        assert segment.step <= 0.01 * (1.0 + 1e-9)


def test_position_at_an_arrival_and_a_departure() -> None:
    """The station at which a carriage comes or goes has its place on the body."""
    timeline = build_timeline((Rider(PASSAGE, 1.0),), 100, "whole")
    counts = np.array([0.0, 24.0, 25.0, 26.0, 75.0, 76.0, -1.0])
    found = timeline.positions(0, counts)
    np.testing.assert_allclose(found, [np.nan, np.nan, 0.0, 0.02, 1.0, np.nan, np.nan], atol=1e-12)


SENSORS = {"midspan": fixed(0.5), "moment": fixed(0.3, "bending_moment"), "below": under("car")}


def test_rounding_does_not_leave_the_body() -> None:
    """Of a carriage that comes on as another one does, but for rounding: one step boundary serves both, where its own
    path is beyond the end."""
    rider = Rider(Cruise(kind="cruise", start=143.0, end=0.0, speed=1.0), 35.0, 0.25)
    late = Rider(PASSAGE, 1.0, 1.0, next(rider.passes(35.0)) - 3e-12)
    timeline = build_timeline((rider, late), 97, "whole")
    beyond = [rider.path(np.array([one.start]), one.start, one.end).S[0] for one in timeline.segments if one.active[0]]
    places = timeline.positions(0, np.arange(timeline.steps + 1))
    known = places[np.isfinite(places)]
    assert max(beyond) > 35.0 * (1.0 + 1e-12)
    assert known.min() >= 0.0 and known.max() == 35.0


@pytest.mark.parametrize("way", [swing(0.5, 0.4, 0.7, 3), shuttle(0.2, 0.8, 0.9, 0.1, 3)])
def test_cycle_of_a_reduction(way: dict[str, Any]) -> None:
    """The last of three cycles with both ends: equidistant phases, mirrored places, the march's histories, exact
    statics."""
    kept = Kept(64)
    carriages = {"car": mass(0.5, way), "next": force(2.0, way)}
    given = study(beam(modes=3), carriages, sensor=SENSORS, solver={"steps": 512})
    reduced = run(given, reduction=kept)
    whole = run(Study(**(given.data | {"output": {"histories": "all"}})))
    cycle = kept.cycles[0]
    stations = cycle.phase.size - 1
    assert 64 <= stations < 512
    np.testing.assert_allclose(cycle.phase, np.linspace(0.0, 1.0, stations + 1), rtol=0, atol=1e-15)
    stride = 512 // stations
    window = slice(2 * 512, 3 * 512 + 1, stride)
    s = whole.car_position.values[window]
    np.testing.assert_allclose(cycle.position, s, rtol=0, atol=1e-12)
    if way["kind"] == "out-and-back":
        np.testing.assert_allclose(s, s[::-1], rtol=0, atol=1e-12)
    for j, name in enumerate(SENSORS):
        np.testing.assert_array_equal(cycle.history[:, j, 0], whole[name].values[window])
        assert float(reduced.largest.values[j]) == cycle.history[:, j, 0].max()
        assert float(reduced[f"{name}_max"]) == whole[name].values[1024:].max()
    total = 0.5 * 9.81 + 2.0
    influence = closed_forms.influence_pinned
    for n in range(0, stations, 3):
        x = float(s[n])
        expected = [influence(0.5, x) * total, min(0.3, x) * (1.0 - max(0.3, x)) * total, influence(x, x) * total]
        np.testing.assert_allclose(cycle.static[n, :, 0], expected, rtol=1e-9)


def test_static_slope_of_a_reduction() -> None:
    """d static/d position of the only carriage; for a sensor under it both the load and the place move."""
    kept = Kept(64)
    given = study(beam(modes=3), force(2.0, swing(0.5, 0.4, 0.7, 1)), sensor=SENSORS, solver={"steps": 128})
    run(given, reduction=kept)
    cycle = kept.cycles[0]
    influence, h = closed_forms.influence_pinned, 1e-5
    compared = 0
    for n, x in enumerate(cycle.position):
        midspan = (influence(0.5, x + h) - influence(0.5, x - h)) / (2 * h)
        below = (influence(x + h, x + h) - influence(x - h, x - h)) / (2 * h)
        moment = 1.0 - 0.3 if x < 0.3 else -0.3
        if abs(x - 0.3) > 2e-3:
            np.testing.assert_allclose(cycle.static_slope[n, :, 0], 2.0 * np.array([midspan, moment, below]), atol=1e-8)
            compared += 1
    assert compared > 50


def test_a_parked_carriage_stays_through_free_vibration() -> None:
    """After the last motion the standing mass still bends the beam: strongly damped, its static deflection remains."""
    parked = mass(0.5, shuttle(0.5, 0.3, 2.0, 0.1, 1))
    given = study(
        beam(damping_ratio=0.3),
        {"parked": parked, "car": force(1.0, cruise(0.0, 1.0, 1.0, after=20.0))},
        sensor={"midspan": fixed(0.5)},
        gravity=10.0,
        output={"histories": "all"},
        solver={"steps": 2000},
    )
    ds = run(given)
    assert float(ds.midspan[-1]) == pytest.approx(0.5 * 10.0 / 48.0, rel=1e-6)


def test_a_sensor_that_never_reads_is_refused() -> None:
    given = study(
        beam(),
        {
            "first": mass(0.1, shuttle(0.3, 0.8, 1.0, 0.1, 3)),
            "early": force(1.0, cruise(0.0, 1.0, 5.0)),
        },
        sensor={"below": under("early")},
    )

    with pytest.raises(BadInput, match="reads nothing"):
        make_plan(given, reduction=Kept(100))
