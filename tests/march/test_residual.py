"""Residual vibration: how far sensors swing about their static values when all carriages rest, against closed forms, an
ODE and the kept history."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import engine
from engine.model.timeline import MOST_STATIONS
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.status import Fidelity
from tests.engine.build import Table, beam, cruise, fixed, force, mass, oscillator, shuttle, study, under

OMEGA = math.pi**2  # of the first mode of `beam`
MOVE: Table = {"kind": "point-to-point", "start": 0.2, "end": 0.7, "speed": 1.4, "acceleration": 9.0, "dwell": 1.5}
RESIDUAL = {"output": {"histories": "all", "residual": True}}
ONE_MODE = {"static_correction": False, "tolerance": 1e-5}


@pytest.mark.parametrize("speed", [0.7, OMEGA / (3.0 * math.pi), 1.4, math.pi])
def test_after_a_force_has_left(speed: float) -> None:
    """One mode, undamped: 2 F phi^2 W/w |cos(w T/2)|/(w^2 - W^2) with W = pi v/L, T = L/v: nothing at v = L w/(3 pi),
    F phi^2 pi/(2 w^2) in resonance."""
    given = study(beam(modes=1), force(2.0, cruise(0.0, 1.0, speed, after=1.5)), solver=ONE_MODE, **RESIDUAL)
    found, rate = engine.run(given), math.pi * speed
    factor = 0.25 * math.pi / OMEGA**2
    if speed != math.pi:
        factor = abs(math.cos(0.5 * OMEGA / speed)) / abs(OMEGA**2 - rate**2)
    static = 2.0 * 2.0 / OMEGA**2
    expected = 2.0 * 2.0 * 2.0 * rate / OMEGA * factor
    assert float(found.midspan_residual) == pytest.approx(expected, abs=2e-5 * static)
    assert found.midspan_residual.attrs["units"] == "m"
    assert float(found.tolerance.sel(result="midspan_residual")) == 1e-5


@pytest.mark.parametrize("jerk", [None, 60.0])
@pytest.mark.parametrize("scheme", ["average-acceleration", "fox-goodwin", "richardson"])
def test_after_a_stop(jerk: float | None, scheme: str) -> None:
    """One damped mode under a force that moves and stops, by an ODE on the motion's own law."""
    move = MOVE if jerk is None else MOVE | {"jerk": jerk}
    bed = beam(modes=1, damping_ratio=0.03)
    given = study(bed, force(2.0, move), solver=ONE_MODE | {"scheme": scheme}, **RESIDUAL)
    motion = given.carriage["car"].motion
    end, scale = motion.rests_from * motion.time_scale, motion.time_scale

    def shape(s: float) -> float:
        return math.sqrt(2.0) * math.sin(math.pi * s)

    def rates(t: float, state: Any) -> list[float]:
        place = float(motion.path(min(t, end) / scale).S)
        return [state[1], 2.0 * shape(place) - 0.06 * OMEGA * state[1] - OMEGA**2 * state[0]]

    start = [2.0 * shape(0.2) / OMEGA**2, 0.0]
    times = np.linspace(end, scale, 20001)
    at = solve_ivp(rates, (0.0, scale), start, t_eval=times, rtol=1e-11, atol=1e-13, max_step=0.01).y[0]
    expected = np.abs(shape(0.5) * (at - 2.0 * shape(0.7) / OMEGA**2)).max()
    found = engine.run(given)
    assert float(found.midspan_residual) == pytest.approx(expected, abs=2e-5 * float(found.midspan_max))
    assert expected > 0.01 * float(found.midspan_max)  # so that something was compared


@pytest.mark.parametrize("scheme", ["average-acceleration", "richardson"])
def test_it_is_that_of_the_history(scheme: str) -> None:
    """Of masses and sensors that move along, in slices of one segment; and extremes count the rest too."""
    cars = {"car": mass(0.3, MOVE), "next": mass(0.2, MOVE | {"start": 0.9, "end": 0.4, "jerk": 80.0}, delay=0.1)}
    sensors = {"midspan": fixed(0.5), "below": under("next")}
    bed = beam(damping_ratio=0.02, own_weight=True)
    solver = {"scheme": scheme, "steps": 24_000, "tolerance": 0.5}
    given = study(bed, cars, sensor=sensors, solver=solver, **RESIDUAL)
    found = engine.run(given)
    still = engine.run(study(bed, cars, sensor=sensors, solver={"fidelity": "static"}, **RESIDUAL))
    ends = [(car.delay or 0.0) + car.motion.rests_from * car.motion.time_scale for car in given.carriage.values()]
    rest = found.elapsed.values >= max(ends) - 1e-9
    assert np.count_nonzero(rest) > MOST_STATIONS
    for name in sensors:
        history, static = found[name].values, float(still[name].values[-1])
        expected = float(np.abs(history[rest] - static).max())
        assert float(found[f"{name}_residual"]) == pytest.approx(expected, rel=1e-6)
        assert float(found[f"{name}_max"]) == pytest.approx(history.max(), rel=1e-6)
        assert float(found[f"{name}_min"]) == pytest.approx(history.min(), rel=1e-6)
        assert float(still[f"{name}_residual"]) <= 1e-14


def test_the_rest_changes_no_other_result() -> None:
    """Extremes, their places and histories have the same bits whether the residual is told or not."""
    solver = {"steps": 900}
    told, silent = (
        engine.run(study(beam(), mass(0.3, MOVE), solver=solver, output={"histories": "all", "residual": residual}))
        for residual in (True, False)
    )
    assert set(told) - set(silent) == {"midspan_residual"}
    for name in silent:
        if "result" not in silent[name].dims:
            close = 1e-14 if name == "midspan_rms" else 0.0
            np.testing.assert_allclose(told[name].values, silent[name].values, rtol=close, atol=0.0, err_msg=str(name))


def test_slowly_there_is_none() -> None:
    """What is taken off is where the march ends."""
    slow = MOVE | {"speed": 0.02, "acceleration": 0.001, "jerk": 0.01}
    bed = beam(damping_ratio=0.1, own_weight=True)
    found = engine.run(
        study(bed, mass(0.3, slow), solver={"steps": 20_000, "fidelity": "full", "tolerance": 0.5}, **RESIDUAL)
    )
    assert float(found.midspan_residual) < 1e-4 * float(found.midspan_max)


@pytest.mark.parametrize(
    "motion", [cruise(0.0, 1.0, 1.0), shuttle(0.2, 0.8, 1.0, 0.2, 1), {**MOVE, "dwell": 0.0}], ids=str
)
def test_without_a_rest_it_is_refused(motion: Table) -> None:
    with pytest.raises(BadInput, match=r"output.residual.*rest at its end") as error:
        engine.run(study(beam(), mass(0.3, motion), **RESIDUAL))
    assert "dwell" in str(error.value)


def test_a_sprung_mass_rests_on_the_modes_that_are_marched() -> None:
    """On a bed of many short spans, where a body that leaves its modes open is as if it had many: about its sag by the
    twelve modes that such a body has at first it would swing for ever."""
    feet = [{"at": float(at), "stiffness": 3e5} for at in np.linspace(0.06, 0.94, 9)]
    move = MOVE | {"speed": 0.3, "acceleration": 0.6, "dwell": 4.0}
    rest = []
    for modes in ("auto", 64):
        bed = beam(supports=feet, damping_ratio=0.05, modes=modes)
        car, seen = oscillator(0.2, 800.0, move, damping=8.0), {"column": {"carriage": "car"}}
        found = engine.run(study(bed, car, sensor=seen, solver={"tolerance": 1e-3}, **RESIDUAL))
        assert int(found.modes_used) > 12
        rest.append(float(found.column_residual))
    assert rest[0] == pytest.approx(rest[1], rel=0.1)


def settles(band: float, dwell: float = 6.0, **changes: Any) -> Study:
    """One damped mode under a force that moves and stops."""
    sensors = {"midspan": fixed(0.5) | {"settling_band": band}}
    tables: Table = {"solver": ONE_MODE, "output": {"residual": True}, "sensor": sensors}
    return study(beam(modes=1, damping_ratio=0.03), force(2.0, MOVE | {"dwell": dwell}), **(tables | changes))


@pytest.mark.parametrize("scheme", ["average-acceleration", "fox-goodwin", "richardson"])
def test_when_it_has_settled(scheme: str) -> None:
    """The last time that an ODE is beyond the band; 0 where it never is, and none where it still is at the end."""
    motion = settles(1.0).carriage["car"].motion
    scale = motion.time_scale
    end = motion.rests_from * scale

    def shape(s: float) -> float:
        return math.sqrt(2.0) * math.sin(math.pi * s)

    def rates(t: float, state: Any) -> list[float]:
        place = float(motion.path(min(t, end) / scale).S)
        return [state[1], 2.0 * shape(place) - 0.06 * OMEGA * state[1] - OMEGA**2 * state[0]]

    times = np.linspace(end, scale, 100001)
    start = [2.0 * shape(0.2) / OMEGA**2, 0.0]
    at = solve_ivp(rates, (0.0, scale), start, t_eval=times, rtol=1e-10, atol=1e-13, max_step=0.01).y[0]
    off = np.abs(shape(0.5) * (at - 2.0 * shape(0.7) / OMEGA**2))
    for band in (5e-3, 7e-3, 9e-3):
        expected = times[np.flatnonzero(off > band)[-1]] - end
        found = engine.run(settles(band, solver=ONE_MODE | {"scheme": scheme}))
        assert float(found.midspan_settling_time) == pytest.approx(expected, abs=2e-4)
        assert float(found.midspan_move_and_settle_time) == pytest.approx(end + expected, abs=2e-4)
        assert found.midspan_settling_time.attrs["units"] == found.midspan_move_and_settle_time.attrs["units"] == "s"
        told = float(found.estimated_error.sel(result="midspan_settling_time")) * expected
        assert abs(float(found.midspan_settling_time) - expected) <= told + 7e-5  # as far as the ODE tells it
        of_both = float(found.estimated_error.sel(result="midspan_move_and_settle_time")) * (end + expected)
        assert of_both == pytest.approx(told, rel=1e-3)
    still = engine.run(settles(1e-3))
    assert np.isnan(float(still.midspan_settling_time)) and np.isnan(float(still.midspan_move_and_settle_time))
    at_once = engine.run(settles(0.5))
    assert float(at_once.midspan_settling_time) == 0.0
    assert float(at_once.midspan_move_and_settle_time) == pytest.approx(end, rel=1e-9)


def test_settling_of_a_sweep_is_that_of_each_alone() -> None:
    """By pilots and chunks that keep no histories, and by more steps than stations."""
    damping = np.linspace(0.01, 0.1, 400).tolist()
    swept = {"damping": {"of": "body.bed.damping_ratio", "values": damping}}
    found = engine.run(settles(5e-3, 7.0, solver={"tolerance": 1e-3}, sweep=swept))
    fine = engine.run(settles(5e-3, 7.0, solver={"steps": 20_000, "scheme": "fox-goodwin"}, sweep=swept))
    here, there = (np.asarray(one.midspan_settling_time.values) for one in (found, fine))
    told = found.estimated_error.sel(result="midspan_settling_time").values * here
    known = np.isfinite(here) & np.isfinite(there)
    assert known.sum() > 340
    assert np.mean(np.abs(here - there)[known] <= told[known] + 1e-4) > 0.95
    assert found.tolerance.sel(result="midspan_residual") == 1e-3
    assert np.isnan(found.tolerance.sel(result="midspan_settling_time"))


@pytest.mark.parametrize(("damping", "expected"), [(0.003, np.nan), (0.02, 4.534)])
def test_what_beats_has_settled_when_the_beat_has_been_seen(damping: float, expected: float) -> None:
    """A load of 4 t on a rope of 1.4 Hz under a trolley of 6 t: 3.117 s were told after a rest of 4 s, as the bare
    girder's period of 0.23 s was all that was waited for. By solve_ivp of ten modes 4.534 s; the other goes on."""
    girder = {"area": 420.0 / 7850.0, "second_moment": 1.1e9 / 210e9, "youngs_modulus": 210e9, "density": 7850.0}
    bed = beam(length=24.0, modes=5, damping_ratio=damping, **girder)
    told = []
    for dwell in (0.2, 4.0, 8.0):
        move = {"kind": "point-to-point", "start": 2.0, "end": 18.0, "speed": 2.0, "acceleration": 2.0, "dwell": dwell}
        car = oscillator(4000.0, 4000.0 * (2.8 * math.pi) ** 2, move, wheel_mass=6000.0)
        sensor = {"midspan": fixed(12.0) | {"settling_band": 2e-5}}
        found = engine.run(study(bed, car, sensor=sensor, solver={"tolerance": 1e-4}, output={"residual": True}))
        told.append(float(found.midspan_settling_time))
        assert np.isnan(told[-1]) == np.isnan(float(found.estimated_error.sel(result="midspan_settling_time")))
    assert told == pytest.approx([np.nan, np.nan, expected], abs=2e-3, nan_ok=True)


def test_statics_do_not_tell_what_swings_on() -> None:
    """At a loose tolerance statics hold a slow way, and a residual of exactly 0 was told."""
    speeds = {"speed": {"of": "carriage.car.motion.speed", "from": 0.01, "to": 0.05, "count": 300}}
    slow = study(beam(damping_ratio=0.02, modes="auto"), force(2.0, cruise(0.0, 1.0, 0.1, after=1.0)), sweep=speeds)
    slow = slow.with_values({"solver.tolerance": 0.1})
    for asked in ({}, {"output": {"residual": True}}, {"sensor": {"midspan": fixed(0.5) | {"part": "dynamic"}}}):
        found = engine.run(slow.with_values(asked))
        assert (found.fidelity_used == Fidelity.STATIC).values.all() == (not asked)
        assert not asked or (found.get("midspan_residual", found.midspan_max) > 0.0).all()


def test_a_band_wants_a_displacement_and_residual_vibrations() -> None:
    with pytest.raises(BadInput, match=r"\[output\] residual = true"):
        settles(1e-3, output={})
    with pytest.raises(BadInput, match="a settling_band is one of displacements"):
        settles(1e-3, sensor={"midspan": fixed(0.5, "velocity") | {"settling_band": 1e-3}})
