"""How long position errors take to settle after a stop: within a band of where they come to rest, under weight."""

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline

import studies
from engine.floating.model import build
from engine.floating.settling import longest_period
from engine.scene.study import Study
from results_schema.errors import BadInput
from studies.findings.absolute_errors import absolute_errors
from studies.pictures.moving_frames import pictures
from studies.protocol.study import kind_of
from studies.results.formatting import quantity
from studies.results.results import Results

LENGTH, AREA, SECOND_MOMENT, MODULUS, DENSITY, GRAVITY = 1.5, 4e-4, 2e-8, 7e10, 2700.0, 9.81
ARM = {
    "kind": "beam",
    "length": LENGTH,
    "area": AREA,
    "second_moment": SECOND_MOMENT,
    "youngs_modulus": MODULUS,
    "density": DENSITY,
    "supports": "clamped-free",
    "damping_ratio": 0.02,
}
ANGLE, BAND = 0.6, 1e-3
RATIO = "body.arm.damping_ratio"


JOINT = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "steady", "rate": 0.1}}


def turned(seconds: float = 6.0, time: float = 0.4, band: float = BAND, **more: object) -> Study:
    """An arm that is turned upward about y, under its weight; seconds: of the run, time: of the move."""
    motion = {"kind": "waypoints", "times": [0, time], "values": [0, -ANGLE]}
    reads = {"body": "arm", "at": LENGTH, "quantity": "position_error", "settling_band": band}
    tables: dict[str, object] = {
        "gravity": GRAVITY,
        "body": {"arm": ARM},
        "frame": {"arm": {"joints": [{"kind": "revolute", "axis": [0, 1, 0], "motion": motion}]}},
        "sensor": {"tip": reads, "height": reads | {"direction": "z"}, "bare": reads | {"settling_band": None}},
        "question": {"duration": seconds},
        "sweep": {"damping": {"of": RATIO, "values": [0.01, 0.02, 0.05]}},
        "output": {"histories": "all"},
    }
    return Study(kind="moving-frames", **(tables | more))


@pytest.fixture(scope="module")
def found() -> xr.Dataset:
    return studies.run(turned())


def test_a_settled_arm_stays_within_its_band_of_its_static_sag(found: xr.Dataset) -> None:
    """By histories, beside an arm that stands where that one stops; its sag is that of a clamped beam, and beyond the
    band."""
    sag = DENSITY * AREA * GRAVITY * np.cos(ANGLE) * LENGTH**4 / (8.0 * MODULUS * SECOND_MOMENT)
    assert sag > 2.0 * BAND
    still = JOINT | {"motion": {"kind": "waypoints", "times": [0, 0.1], "values": [0, 0]}}
    frame = {"arm": {"turned": [0, -ANGLE, 0], "joints": [still]}}
    stands = studies.run(turned(0.2, frame=frame, initial="equilibrium", sweep={}))
    assert float(stands["tip_max"]) == pytest.approx(sag, rel=3e-3)
    times = np.linspace(0.4, 6.0, 40_001)
    for name in ("tip", "height"):
        rest = float(stands[f"{name}_max"])
        whole, own = found[f"{name}_move_and_settle_time"].values, found[f"{name}_settling_time"].values
        doubt = absolute_errors(Results.of(found), f"{name}_settling_time")
        assert whole == pytest.approx(own + 0.4) and (doubt < 0.2 * own).all()
        for lane, history in enumerate(found[name].values):
            read = CubicSpline(found["elapsed"].values[lane], history)(times)
            last = times[np.flatnonzero(np.abs(read - rest) > BAND)[-1]]
            assert abs(whole[lane] - last) < doubt[lane] + times[1] - times[0]
    assert (np.diff(found["tip_settling_time"]) < 0.0).all()  # the sooner the more it is damped
    assert "bare_settling_time" not in found


def test_told_errors_of_settling_times_hold(found: xr.Dataset) -> None:
    fine = studies.run(turned(solver={"tolerance": 5e-5}))
    for name in ("tip", "height"):
        apart = np.abs(found[f"{name}_settling_time"] - fine[f"{name}_settling_time"]).values
        told = absolute_errors(Results.of(found), f"{name}_settling_time")
        assert (told > 0.0).all() and (apart <= told).all()


def test_what_still_swings_near_the_end_has_not_settled() -> None:
    """Nor what has no stop; what does not leave its band has settled at once, unless the rest is shorter than its
    swings."""
    least = 2.0 * longest_period(build(turned().without_sweep(), 4))
    brief = studies.run(turned(seconds=0.4 + 0.9 * least, band=1.0, sweep={}))
    assert np.isnan(brief["tip_settling_time"]) and np.isnan(brief["tip_move_and_settle_time"])
    wide = studies.run(turned(seconds=0.4 + 1.1 * least, band=1.0, sweep={}))
    assert wide["tip_settling_time"] == 0.0 and wide["tip_move_and_settle_time"] == pytest.approx(0.4)
    assert (wide["estimated_error"].sel(result=["tip_settling_time", "tip_move_and_settle_time"]) == 0.0).all()
    narrow = studies.run(turned(seconds=1.0, band=1e-6, sweep={}))
    assert np.isnan(narrow["tip_settling_time"])
    assert np.isnan(narrow["estimated_error"].sel(result="tip_settling_time"))
    never = studies.run(turned(seconds=0.3, sweep={}))
    assert np.isnan(never["tip_settling_time"])


@pytest.mark.parametrize(("gravity", "rests"), [(GRAVITY, True), (0.0, False)])
def test_what_turns_freely_beside_an_arm_needs_a_rest(gravity: float, rests: bool) -> None:
    """A pendulum, whose hinge has no frequency without weight, leaves the arm's times alone where it hangs."""
    bob = {"kind": "rigid", "length": 0.5, "mass": 1.0, "inertia": 0.1}
    hangs = {"turned": [0, "-90 deg", 0], "joints": [{"kind": "revolute", "axis": [0, 1, 0]}]}
    alone = turned(sweep={}, gravity=gravity)
    frame = {"arm": alone.frame["arm"].model_dump(exclude_unset=True), "bob": hangs}
    found = studies.run(turned(sweep={}, gravity=gravity, body={"arm": ARM, "bob": bob}, frame=frame))
    wanted = float(studies.run(alone)["tip_settling_time"])
    assert wanted > 0.0
    assert float(found["tip_settling_time"]) == pytest.approx(wanted if rests else np.nan, abs=0.01, nan_ok=True)


def test_the_longest_period_is_that_of_the_loaded_arm() -> None:
    """Of a mass at the end of an arm that is light beside it: sqrt(3 EI / m L^3)."""
    tool = {"kind": "rigid", "length": 0.1, "mass": 50.0, "inertia": 0.0}
    given = turned(sweep={}, body={"arm": ARM, "tool": tool}, frame={"arm": {"joints": [JOINT]}, "tool": {"on": "arm"}})
    omega = np.sqrt(3.0 * MODULUS * SECOND_MOMENT / (50.0 * LENGTH**3))
    assert longest_period(build(given, 4)) == pytest.approx(2.0 * np.pi / omega, rel=0.1)


def test_the_answer_and_a_figure_tell_it(found: xr.Dataset) -> None:
    said = " ".join(kind_of(turned()).findings(Results.of(found)))
    longest = quantity(float(found["tip_settling_time"].max()), "s")
    assert f"it has settled within 1 mm of its static value {longest}" in said
    drawn = next(one for one in pictures(Results.of(found)) if one.name == "settling")
    assert "takes up to" in drawn.title


def test_moves_of_different_length_are_told_until_the_tip_has_settled() -> None:
    swept = {"speed": {"of": "frame.arm.joints.0.motion.acceleration", "values": [4.0, 8.0, 16.0]}}
    motion = {"kind": "point-to-point", "start": 0.0, "end": -ANGLE, "speed": 3.0, "acceleration": 8.0, "jerk": 400.0}
    frame = {"arm": {"joints": [{"kind": "revolute", "axis": [0, 1, 0], "motion": motion}]}}
    given = turned(frame=frame, sweep=swept, question={"duration": 3.0, "settling_time": 0.01})
    found = studies.run(given)
    said = kind_of(given).findings(Results.of(found))
    least = quantity(float(found["tip_move_and_settle_time"].min()), "s")
    assert any(one.startswith("Until all of tip and height have settled, move and settling take") for one in said)
    assert any(f"take {least} at least" in one for one in said) and any(
        "it takes longer than 0.01 s everywhere" in one for one in said
    )


def test_limits_and_bands_of_what_is_not_told_are_refused() -> None:
    without = {"tip": {"body": "arm", "at": LENGTH, "quantity": "position_error"}}
    given = turned(sensor=without, question={"duration": 1.0, "settling_time": 0.2})
    with pytest.raises(BadInput, match=r"question\.settling_time: .* no sensor has"):
        kind_of(given).check(given)
    with pytest.raises(BadInput, match="in frames that move a position error alone settles"):
        turned(sensor={"tip": {"body": "arm", "at": LENGTH, "settling_band": 1e-3}})
    with pytest.raises(BadInput, match="a settling_band is one of displacements"):
        turned(sensor={"tip": {"body": "arm", "at": 0.0, "quantity": "drive_torque", "settling_band": 1e-3}})
