"""Natural frequencies of all bodies together, as `check` shows them."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from engine.floating.frequencies import natural_vibrations
from engine.floating.model import FloatingModel, build
from engine.scene.study import Study
from studies.kinds.moving_frames import KIND
from tests.floating.scenes import ARM, FLYER, history, steps

TURN = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "waypoints", "times": [0, 1], "values": [0.7, 0]}}
HINGE = {"kind": "revolute", "axis": [0, 1, 0], "stiffness": 9.0}
WAVE = np.sqrt(ARM["youngs_modulus"] * ARM["second_moment"] / (ARM["density"] * ARM["area"])) / ARM["length"] ** 2


def arm(joint: dict[str, Any], bodies: dict[str, Any], frames: dict[str, Any], **tables: Any) -> Study:
    """An arm that hangs on a joint, and what hangs on it."""
    given = {"body": {"arm": ARM} | bodies, "frame": {"arm": {"joints": [joint]}} | frames, "gravity": 0.0}
    return Study(kind="moving-frames", question={"duration": 1.0}, **(given | tables))


def natural_omega(model: FloatingModel) -> np.ndarray | None:
    found = natural_vibrations(model)
    return None if found is None else found.omega


def point(mass: float) -> dict[str, Any]:
    return {"kind": "rigid", "length": 0.1, "mass": mass, "inertia": 1e-9, "centre": 0.0}


def rooted(frequency: Any, between: list[tuple[float, float]]) -> np.ndarray:
    return np.array([brentq(frequency, *pair) for pair in between]) ** 2 * WAVE


def test_a_cantilever_with_a_point_at_its_end_is_as_in_closed_form() -> None:
    """Wherever its joint has it, hung or carried."""
    part = 15.0 / (ARM["density"] * ARM["area"] * ARM["length"])

    def zero(b: float) -> float:
        return float(1 + np.cos(b) * np.cosh(b) + part * b * (np.cos(b) * np.sinh(b) - np.sin(b) * np.cosh(b)))

    wanted = rooted(zero, [(0.3, 1.9), (3.0, 4.7), (6.5, 7.85)])
    hung = arm(TURN, {"tool": point(15.0)}, {"tool": {"on": "arm"}})
    way = {"kind": "cruise", "start": 10.0, "end": 9.0, "speed": 0.1}
    carried = arm(TURN, {}, {}, carriage={"load": {"kind": "mass", "on": "arm", "mass": 15.0, "motion": way}})
    for study, accuracy in ((hung, 1e-6), (carried, 2e-3)):  # modes that hang in shapes of what hangs there
        found = natural_omega(build(study))
        assert found is not None
        np.testing.assert_allclose(found[:2], wanted[:2], rtol=accuracy)


def test_a_hinge_on_a_spring_is_as_in_closed_form() -> None:
    """Of a rod about its end where the spring is soft; the arm's own modes are those of a pinned beam then."""
    found = natural_omega(build(arm(HINGE, {}, {})))
    assert found is not None
    inertia = ARM["density"] * ARM["area"] * ARM["length"] ** 3 / 3.0
    assert found[0] == pytest.approx(np.sqrt(9.0 / inertia), rel=0.02)
    assert found[1] == pytest.approx(3.9266**2 * WAVE, rel=0.02)


def test_two_links_swing_as_fast_as_a_march_of_them() -> None:
    """Both bent, one hung beside the other's end and turned against it; by crossings of zero over twenty periods."""
    bodies = {"second": ARM | {"length": 6.0}, "tool": point(4.0)}
    frames = {"second": {"on": "arm", "at": 8.0, "turned": [0.0, 0.6, 0.0]}, "tool": {"on": "second"}}
    still = TURN | {"motion": {"kind": "waypoints", "times": [0, 2.0], "values": [0.0, 1e-6]}}
    study = arm(still, bodies, frames, sensor={"end": {"body": "second", "at": 6.0}})
    omega = natural_omega(build(study))
    assert omega is not None
    duration = 20.0 * 2.0 * np.pi / float(omega[0])
    model, marched = steps(study, duration, 24_000)
    signal = history(model, marched, "sensors")[2000:, 0]
    spectrum = np.abs(np.fft.rfft(signal * np.hanning(signal.size), 16 * signal.size))
    peak = float(np.argmax(spectrum[8:]) + 8) / (16 * signal.size) * 24_000 / duration
    assert 2.0 * np.pi * peak == pytest.approx(float(omega[0]), rel=2e-3)


def test_an_arm_on_a_rigid_hub_is_one_on_the_ground() -> None:
    """Of a hub that is driven; one that turns freely about the arm, whose inertia there is none, is not told."""
    hub = {"kind": "rigid", "length": 1.0, "mass": 3.0, "inertia": 2.0}
    on_hub = arm({"kind": "revolute", "axis": [1, 0, 0]}, {"hub": hub}, {"hub": {"joints": [TURN]}})
    frames = {"hub": {"joints": [TURN]}, "arm": {"on": "hub"}}
    driven = natural_omega(build(Study(**(on_hub.data | {"frame": frames}))))
    alone = natural_omega(build(arm(TURN, {}, {})))
    assert driven is not None and alone is not None
    np.testing.assert_allclose(driven, alone, rtol=1e-9)
    assert natural_omega(build(on_hub)) is None


def test_what_flies_freely_or_slides_is_not_told() -> None:
    flyer = Study(
        kind="moving-frames",
        body={"hull": FLYER},
        frame={"hull": {"joints": [{"kind": "free"}]}},
        question={"duration": 1.0},
        gravity=0.0,
    )
    assert natural_omega(build(flyer)) is None
    assert list(KIND.tables(flyer)) == []


def test_check_shows_them_where_they_say_more_than_each_body() -> None:
    assert list(KIND.tables(arm(TURN, {}, {}))) == []
    (table,) = KIND.tables(arm(TURN, {"tool": point(15.0)}, {"tool": {"on": "arm"}}))
    omega = natural_omega(build(arm(TURN, {"tool": point(15.0)}, {"tool": {"on": "arm"}})))
    assert omega is not None and table.title.startswith("All together at time 0")
    assert table.rows[0][0].startswith(f"{omega[0] / (2.0 * np.pi):.3g}, {omega[1] / (2.0 * np.pi):.3g}, ")


def test_damping_of_all_together_is_what_a_march_loses() -> None:
    """A point of twice an arm's mass at its end, which takes most of the swing and has no damping; by how much smaller
    peaks are sixteen periods later."""
    bodies = {"arm": ARM | {"damping_ratio": 0.02}, "tool": point(24.0)}
    still = TURN | {"motion": {"kind": "waypoints", "times": [0, 2.0], "values": [0.0, 1e-6]}}
    study = arm(still, bodies, {"tool": {"on": "arm"}}, sensor={"tip": {"body": "arm", "at": 10.0}})
    found = natural_vibrations(build(study))
    assert found is not None
    omega, ratio = float(found.omega[0]), float(found.damping_ratio[0])
    assert ratio < 0.5 * 0.02
    period = 2.0 * np.pi / omega
    model, marched = steps(study, 20.0 * period, 20_000)
    signal = np.abs(history(model, marched, "sensors")[:, 0])
    assert 3.0 * period > 2.0
    peaks = signal[3_000:4_000].max(), signal[19_000:20_000].max()
    assert np.log(peaks[0] / peaks[1]) == pytest.approx(16.0 * 2.0 * np.pi * ratio, rel=0.02)


def test_damping_of_a_joint_counts_with_that_of_modes() -> None:
    """Of a rod about its end on a soft spring: c/(2 omega I)."""
    found = natural_vibrations(build(arm(HINGE | {"damping": 0.5}, {}, {})))
    assert found is not None
    inertia = ARM["density"] * ARM["area"] * ARM["length"] ** 3 / 3.0
    assert found.damping_ratio[0] == pytest.approx(0.5 / (2.0 * np.sqrt(9.0 * inertia)), rel=0.02)
