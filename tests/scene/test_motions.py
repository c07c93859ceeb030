"""Laws of motion against numerical derivatives, closed forms, symmetry and the naive twins."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.scene.motions.along_bodies import Cruise, OutAndBack, Sinusoidal, Waypoints
from engine.scene.motions.base import BetweenPlaces, Motion
from engine.scene.motions.minimum_jerk import MinimumJerk
from engine.scene.motions.point_to_point import PointToPoint, TimedMove
from tests.naive import motions as naive
from tests.naive.robots_as_particles import pieces

places = st.floats(0.0, 20.0).map(lambda x: round(x, 3))
speeds = st.floats(0.01, 50.0)


@st.composite
def strokes(draw: st.DrawFn) -> dict[str, float]:
    start, end = draw(st.tuples(places, places).filter(lambda pair: abs(pair[0] - pair[1]) > 0.01))
    return {"start": start, "end": end}


cruises = st.builds(lambda s, v: Cruise(kind="cruise", speed=v, **s), strokes(), speeds)
shuttles = st.builds(
    lambda s, v, turn, n: OutAndBack(kind="out-and-back", speed=v, turn=turn, cycles=n, **s),
    strokes(),
    speeds,
    st.just(0.0) | st.floats(0.01, 0.5),
    st.integers(1, 4),
)
sines = st.builds(
    lambda c, a, f, n: Sinusoidal(kind="sinusoidal", centre=c, amplitude=a, frequency=f, cycles=n),
    places,
    st.floats(0.01, 9.0),
    speeds,
    st.integers(1, 4),
)


@st.composite
def waypoints(draw: st.DrawFn) -> Waypoints:
    spans = draw(st.lists(st.floats(0.1, 5.0), min_size=1, max_size=6))
    positions = draw(st.lists(places, min_size=len(spans) + 1, max_size=len(spans) + 1))
    return Waypoints(kind="waypoints", times=[0.0, *np.cumsum(spans).tolist()], positions=positions)


moves = st.builds(
    lambda s, v, a, j, rest: PointToPoint(kind="point-to-point", speed=v, acceleration=a, jerk=j, dwell=rest, **s),
    strokes(),
    st.floats(0.1, 10.0),
    st.floats(0.1, 100.0),
    st.none() | st.floats(0.1, 1000.0),
    st.just(0.0) | st.floats(0.01, 3.0),
)
timed = st.builds(
    lambda s, time, rest: TimedMove(kind="timed-move", time=time, dwell=rest, **s),
    strokes(),
    st.floats(0.1, 10.0),
    st.just(0.0) | st.floats(0.01, 3.0),
)
smooth = st.builds(
    lambda s, time, rest: MinimumJerk(kind="minimum-jerk", time=time, dwell=rest, **s),
    strokes(),
    st.floats(0.1, 10.0),
    st.just(0.0) | st.floats(0.01, 3.0),
)
laws = cruises | shuttles | sines | waypoints() | moves | timed | smooth


def smooth_instants(motion: Motion, margin: float) -> np.ndarray:
    tau = np.linspace(0.0, motion.duration, 401)[1:-1] * (1 - 1e-3)
    edges = [*motion.breaks(), 0.0, motion.duration]
    if isinstance(motion, OutAndBack):  # the third derivative jumps there
        first, last = motion.legs.cruise
        edges += [k + part for k in range(motion.cycles) for part in (first, last, 1 - last, 1 - first)]
    if isinstance(motion, Waypoints):
        edges += [time / motion.times[-1] for time in motion.times]
    return tau[np.abs(tau[:, None] - np.array(edges)).min(axis=1) > margin]


@given(laws)
@settings(max_examples=60, deadline=None)
def test_derivatives(motion: Motion) -> None:
    step = 1e-5
    tau = smooth_instants(motion, 3 * step)
    before, here, after = (motion.path(tau + shift) for shift in (-step, 0.0, step))
    scale = np.abs(here.ddS).max() + motion.max_speed
    assert tau.size > 50
    np.testing.assert_allclose((after.S - before.S) / (2 * step), here.dS, rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose((after.dS - before.dS) / (2 * step), here.ddS, rtol=0, atol=1e-3 * scale)


@given(laws)
@settings(max_examples=60, deadline=None)
def test_range_and_largest_speed(motion: Motion) -> None:
    tau = np.linspace(0.0, motion.duration, 4001)
    if isinstance(motion, Waypoints):  # a short interval between two instants needs its own
        edges = np.array(motion.times) / motion.times[-1]
        tau = np.concatenate([np.linspace(a, b, 401) for a, b in pairwise(edges)])
    if isinstance(motion, PointToPoint):  # the top speed may last no time
        tau = np.union1d(tau, motion.breaks())
    for extreme in (np.argmin, np.argmax):  # short intervals beside long ones turn between two of those instants
        near = extreme(motion.path(tau).S)
        tau = np.union1d(tau, np.linspace(tau[max(near - 1, 0)], tau[min(near + 1, tau.size - 1)], 401))
    path = motion.path(tau)
    low, high = motion.range()
    slack = 1e-5 * (high - low)
    assert path.S.min() >= low - 1e-12 * (1 + abs(low))
    assert path.S.max() <= high + 1e-12 * (1 + abs(high))
    assert path.S.min() <= low + slack
    assert path.S.max() >= high - slack
    fastest = np.abs(path.dS).max()
    assert fastest <= motion.max_speed * (1 + 1e-12)
    assert fastest >= motion.max_speed * (1 - 1e-4)


@given(laws)
@settings(max_examples=40, deadline=None)
def test_outside_its_time(motion: Motion) -> None:
    early, late = motion.path([-3.0, -1e-9]), motion.path([motion.duration * 1.001, motion.duration + 5])
    np.testing.assert_array_equal(early.S, motion.path(0.0).S)
    assert not np.any(early.dS) and not np.any(early.ddS)
    assert all(np.isnan(part).all() for part in late)
    assert np.isfinite(motion.path([0.0, motion.duration, motion.duration * (1 + 1e-15)])).all()


def at(motion: Motion, t: float, side: str = "right") -> tuple[float, float, float]:
    """s, s', s'' in time."""
    scale = motion.time_scale
    path = motion.path(t / scale, side)  # type: ignore[arg-type]
    return float(path.S), float(path.dS) / scale, float(path.ddS) / scale**2


def compare_with_phases(motion: Motion, phases: tuple[Any, ...]) -> None:
    assert motion.duration * motion.time_scale == pytest.approx(phases[-1].end, rel=1e-13)
    for phase in phases:
        for part in (0.03, 0.37, 0.5, 0.92):
            t = phase.start + part * (phase.end - phase.start)
            assert at(motion, t) == pytest.approx((phase.s(t), phase.ds(t), phase.dds(t)), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("start", "end"), [(7.5, 14.7), (14.7, 7.5)])
def test_against_the_naive_twins(start: float, end: float) -> None:
    keys: dict[str, Any] = {"kind": "out-and-back", "start": start, "end": end, "speed": 5.0, "cycles": 3}
    compare_with_phases(OutAndBack(turn=0.1, **keys), naive.out_and_back(start, end, 5.0, 0.1, 3))
    compare_with_phases(OutAndBack(turn=0.0, **keys), naive.instant_out_and_back(start, end, 5.0, 3))
    compare_with_phases(Cruise(kind="cruise", start=start, end=end, speed=5.0), naive.cruise(start, end, 5.0))
    wave = Sinusoidal(kind="sinusoidal", centre=7.5, amplitude=7.0, frequency=0.3, cycles=2)
    compare_with_phases(wave, naive.sinusoidal(7.5, 7.0, 2 * math.pi * 0.3, 2))


LIMITS = {
    "all limits are reached": (1.0, 6.0, 200.0),
    "the speed is not": (10.0, 6.0, 200.0),
    "the jerk alone limits": (10.0, 100.0, 5.0),
    "the acceleration is not": (0.5, 100.0, 20.0),
    "a trapezoid": (1.0, 6.0, None),
    "a triangle": (10.0, 6.0, None),
}


@pytest.mark.parametrize("dwell", [0.0, 0.4])
@pytest.mark.parametrize(("start", "end"), [(0.6, 3.6), (3.6, 0.6)])
@pytest.mark.parametrize("limits", LIMITS.values(), ids=LIMITS)
def test_point_to_point(limits: tuple[float, float, float | None], start: float, end: float, dwell: float) -> None:
    """What jerks add up to by a search for the highest speed; no limit is broken, and one of them is always reached."""
    speed, acceleration, jerk = limits
    keys: dict[str, Any] = {"start": start, "end": end, "speed": speed, "acceleration": acceleration}
    motion = PointToPoint(kind="point-to-point", jerk=jerk, dwell=dwell, **keys)
    parts, push = [], 0.0
    for length, change in pieces(speed / 3.0, acceleration / 3.0, (jerk or 1e9) / 3.0):
        parts.append((float(length), push, change))
        push += float(length) * change
    naive_end = sum(length for length, _, _ in parts)
    if jerk is None:  # a jerk of 1e9 m/s3 is as good as none
        assert motion.time_scale - dwell == pytest.approx(naive_end, rel=1e-7)
        up = min(speed / acceleration, math.sqrt(3.0 / acceleration))
        steady = 3.0 / speed - up if speed < math.sqrt(3.0 * acceleration) else 0.0
        parts = [(up, acceleration / 3.0, 0.0), (steady, 0.0, 0.0), (up, -acceleration / 3.0, 0.0)]
    moving = [part for part in parts if part[0] > 1e-9]
    compare_with_phases(motion, naive.point_to_point(start, end, [*moving, (dwell, 0.0, 0.0)] if dwell else moving))
    assert motion.rests_from * motion.time_scale == pytest.approx(motion.time_scale - dwell, rel=1e-12)
    assert [float(motion.path(tau).S) for tau in (0.0, motion.rests_from, 1.0)] == [start, end, end]
    tau = np.union1d(np.linspace(0.0, 1.0, 20001), motion.breaks())
    path, scale = motion.path(tau), motion.time_scale
    fastest, hardest = np.abs(path.dS).max() / scale, np.abs(path.ddS).max() / scale**2
    assert fastest <= speed * (1 + 1e-12) and hardest <= acceleration * (1 + 1e-12)
    assert np.all(np.sign(end - start) * np.diff(path.S) >= -1e-15)
    sides = [motion.path(motion.breaks(), side) for side in ("left", "right")]
    for order, slack in ((0, 1e-14), (1, 1e-12), *([(2, 1e-9)] if jerk else [])):
        np.testing.assert_allclose(sides[0][order], sides[1][order], rtol=0, atol=slack * scale**order * 10)


@given(st.one_of(cruises, shuttles, moves, timed))
@settings(max_examples=60, deadline=None)
def test_backward_is_the_same_motion_with_its_ends_exchanged(motion: BetweenPlaces) -> None:
    """To the last bit, also as pieces of time, each variant in its own direction."""
    numbers = motion.model_dump()
    backward = type(motion)(**numbers | {"direction": "backward"})
    exchanged = type(motion)(**numbers | {"start": motion.end, "end": motion.start})
    tau = np.linspace(-0.1, motion.duration, 101)
    for side in ("left", "right"):
        for one, other in zip(backward.path(tau, side), exchanged.path(tau, side), strict=True):
            np.testing.assert_array_equal(one, other)
    assert (backward.legs, backward.reversals(), backward.range()) == (
        exchanged.legs,
        exchanged.reversals(),
        exchanged.range(),
    )
    middle = 0.5 * (motion.start + motion.end)
    assert backward.passing(middle) == exchanged.passing(middle)

    def pieces_of(motion: Motion, *directions: int) -> np.ndarray:
        columns = motion.model_dump() | {"direction": directions}
        return motion.pieces(lambda key: np.broadcast_to(columns[key] or 0.0, len(directions)).astype(float))

    np.testing.assert_array_equal(
        pieces_of(motion, 1, -1), np.concatenate([pieces_of(motion, 1), pieces_of(exchanged, 1)])
    )


@pytest.mark.parametrize("dwell", [0.0, 0.4])
@pytest.mark.parametrize(("start", "end"), [(0.6, 3.6), (3.6, 0.6)])
def test_a_timed_move_has_a_constant_jerk_in_each_quarter(start: float, end: float, dwell: float) -> None:
    time, jerk = 1.3, 32.0 / 1.3**3
    motion = TimedMove(kind="timed-move", start=start, end=end, time=time, dwell=dwell)
    assert motion.time_scale == pytest.approx(time + dwell, rel=1e-14)
    assert motion.max_speed / motion.time_scale == pytest.approx(2.0 * 3.0 / time, rel=1e-12)
    quarter, push = 0.25 * time, 0.25 * time * jerk
    phases = [(quarter, 0.0, jerk), (quarter, push, -jerk), (quarter, 0.0, -jerk), (quarter, -push, jerk)]
    compare_with_phases(motion, naive.point_to_point(start, end, [*phases, (dwell, 0.0, 0.0)] if dwell else phases))
    assert [float(motion.path(tau).S) for tau in (0.0, motion.rests_from, 1.0)] == [start, end, end]


@pytest.mark.parametrize("dwell", [0.0, 0.4])
@pytest.mark.parametrize(("start", "end"), [(0.6, 3.6), (3.6, 0.6)])
def test_a_move_of_least_jerk_is_the_quintic_at_rest_at_both_ends(start: float, end: float, dwell: float) -> None:
    """By its six conditions: what jerk's square is least for has a sixth derivative of 0."""
    time = 1.3
    motion = MinimumJerk(kind="minimum-jerk", start=start, end=end, time=time, dwell=dwell)
    powers = np.arange(6)
    conditions = [
        [math.factorial(k) / math.factorial(k - order) * at ** (k - order) if k >= order else 0.0 for k in powers]
        for at in (0.0, time)
        for order in range(3)
    ]
    quintic = np.polynomial.Polynomial(np.linalg.solve(conditions, [start, 0.0, 0.0, end, 0.0, 0.0]))
    times = np.linspace(0.0, time, 101)
    path = motion.path(times / motion.time_scale)
    for order, (found, size) in enumerate(zip(path, (1.0, 5.0, 20.0), strict=True)):
        wanted = quintic.deriv(order)(times)
        np.testing.assert_allclose(found / motion.time_scale**order, wanted, atol=1e-11 * size)
    speed = motion.max_speed / motion.time_scale
    assert speed == pytest.approx(np.abs(quintic.deriv()(times)).max(), rel=1e-12)
    rest = motion.path(np.linspace(motion.rests_from, 1.0, 5))
    assert (end == rest.S).all()
    assert not np.any(rest[1:])


def test_accelerations_of_a_trapezoid_are_one_sided() -> None:
    motion = PointToPoint(kind="point-to-point", start=0.0, end=3.0, speed=1.0, acceleration=2.0)
    scale = motion.time_scale**2
    np.testing.assert_allclose(motion.path(motion.breaks(), "left").ddS / scale, [2.0, 0.0])
    np.testing.assert_allclose(motion.path(motion.breaks(), "right").ddS / scale, [0.0, -2.0])
    np.testing.assert_allclose(motion.path([0.0, 1.0]).ddS / scale, [2.0, -2.0])
    np.testing.assert_array_equal(motion.path([0.0, 1.0]).dS, [0.0, 0.0])


def test_instant_turns_are_one_sided() -> None:
    motion = OutAndBack(kind="out-and-back", start=1.0, end=3.0, speed=1.0, turn=0, cycles=2)
    np.testing.assert_array_equal(motion.breaks(), [0.5, 1.0, 1.5])
    for tau, before, after in motion.reversals():
        assert (motion.path(tau, "left").dS, motion.path(tau, "right").dS) == (before, after)
        assert motion.path(tau, "left").S == motion.path(tau, "right").S
        np.testing.assert_array_equal(motion.path_on([tau - 0.5, tau], tau - 0.5, tau).dS, [before, before])
        np.testing.assert_array_equal(motion.path_on([tau, tau + 0.5], tau, tau + 0.5).dS, [after, after])
    assert [r.before for r in motion.reversals()] == [4.0, -4.0, 4.0]
    assert OutAndBack(kind="out-and-back", start=1.0, end=3.0, speed=1.0, turn=0.1, cycles=2).breaks().size == 0


def test_waypoints() -> None:
    motion = Waypoints(kind="waypoints", times=[0.0, "1 s", 4.0], positions=[1.0, "500 cm", 2.0])
    assert motion.time_scale == 4.0
    path = motion.path([0.0, 0.25, 1.0])
    np.testing.assert_allclose(path.S, [1.0, 5.0, 2.0], atol=1e-14)
    np.testing.assert_allclose(path.dS[[0, 2]], 0.0, atol=1e-13)
    left, right = motion.path(0.25 - 1e-12), motion.path(0.25 + 1e-12)
    np.testing.assert_allclose(left.ddS, right.ddS, rtol=1e-8)
    assert motion.range()[1] > 5.0


def test_speed_is_not_in_the_path() -> None:
    slow, fast = (OutAndBack(kind="out-and-back", start=1, end=3, speed=v, turn=0.1, cycles=2) for v in (1, 7))
    tau = np.linspace(0, 2, 33)
    np.testing.assert_array_equal(slow.path(tau), fast.path(tau))
    assert slow.time_scale == pytest.approx(7 * fast.time_scale)
