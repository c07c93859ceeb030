"""Frames that are given in time, whose steps are linear equations, beside the floating frame."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import studies
from engine.floating.march import march
from engine.floating.model import build
from engine.kernels.floating.layout import Weights
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.status import Fidelity
from tests.floating.bodies.test_frames_of_beams import PORTAL
from tests.floating.scenes import ARM, FOX_GOODWIN, given_arm, history, steps

MODES_ALONE = {"solver.static_correction": False}  # of which so many steps are within Fox-Goodwin's limit
ALPHA = Weights(0.3025, 0.6, -0.1 / 1.1, 0.0)  # of generalized-alpha


def apart(study: Study, scheme: Weights = FOX_GOODWIN) -> tuple[np.ndarray, np.ndarray]:
    """Largest differences of all signals over 2 s, and their largest values; by a common step."""
    model, count = build(study), 2000
    stations, values = np.arange(0, count + 1, 5), VariantValues(study, {}, 1)
    given, full = (
        march(model, values, np.array([2.0]), count, stations, scheme, fidelity).history[0]
        for fidelity in (Fidelity.GIVEN_FRAME, Fidelity.FRAME)
    )
    return np.abs(given - full).max(axis=0), np.abs(full).max(axis=0)


@pytest.mark.parametrize("scheme", [FOX_GOODWIN, ALPHA], ids=["fox-goodwin", "generalized-alpha"])
@pytest.mark.parametrize("scale", [0.01, 1.0])
def test_frames_that_are_given_are_those_that_float(scale: float, scheme: Weights) -> None:
    """Small and large motion of an arm in space with a mass, an oscillator and loads: all signals to 1e-6."""
    gap, largest = apart(given_arm(scale), scheme)
    assert (largest > 0.0).sum() > 40
    assert (gap <= 1e-6 * largest).all()


SWING = {"kind": "revolute", "axis": [0.3, 1.0, 0.4], "motion": {"kind": "swing", "amplitude": 0.2, "frequency": 0.6}}
SPIN = {"kind": "revolute", "axis": [0, 1, 0], "motion": {"kind": "spin-up", "rate": 2.0, "time": 0.73}}
WAY = {"kind": "waypoints", "times": [0, 2], "positions": [0.2, 1.0]}
JUMP = {"kind": "out-and-back", "speed": 5.0, "start": 1.0, "end": 6.0, "turn": 0, "cycles": 1}


@pytest.mark.parametrize(
    ("body", "frame", "motion"),
    [(PORTAL, {"joints": [SWING]}, WAY), (ARM, {"joints": [SPIN], "stiffening": True}, JUMP)],
    ids=["modes in all directions", "jumps between steps"],
)
def test_other_bodies_and_motions_too(body: dict[str, object], frame: dict[str, object], motion: object) -> None:
    """A frame of beams in space, and a carriage that turns at an instant on an arm that spins up: to 1e-6."""
    load = {"kind": "mass", "on": "body", "mass": 2.0, "motion": motion}
    bodies = {"body": body | {"own_weight": True, "modes": 3, "damping_ratio": 0.01}}
    gap, largest = apart(
        Study(kind="moving-frames", gravity=0.0, body=bodies, frame={"body": frame}, carriage={"load": load})
    )
    assert (largest > 0.0).sum() >= 18
    assert (gap <= 1e-6 * largest).all()


def test_what_is_linearised_differs_in_second_order() -> None:
    """Stiffening by axial forces of the arm's own vibration, and torques that turn, of the tip's deflection: order 2 of
    the motion, and below 1e-6 where that is small."""
    found = []
    for scale in (0.16, 0.08, 0.04, 0.02):
        gap, largest = apart(given_arm(scale, curved=True).with_values(MODES_ALONE))
        found.append(gap[0] / largest[0])
    assert np.log2(np.array(found[:-1]) / found[1:]) == pytest.approx(2.0, abs=0.1)
    assert found[-1] < 1e-6


@pytest.mark.slow
def test_the_model_is_measured() -> None:
    """Pilots of the scene choose: the same arm within 1e-3 by frames that are given, which the told error covers, and
    within 1e-9 by the floating frame; so where that is asked for, or a joint moves by itself."""
    sweep = {"mass": {"of": "carriage.load.mass", "values": [0.5, 2.0]}}
    data = {key: value for key, value in given_arm(0.16, curved=True).data.items() if key != "schema_version"}
    study = Study(**(data | {"sweep": sweep, "solver": {"steps": 1000}}))
    given = studies.run(study)
    assert (given["fidelity_used"] == Fidelity.GIVEN_FRAME).all()
    full = studies.run(study.with_values({"solver.fidelity": "full"}))
    assert (full["fidelity_used"] == Fidelity.FRAME).all()
    gap = np.abs(given["tip_max"] - full["tip_max"]) / np.abs(full["tip_max"])
    told = given["estimated_error"] - full["estimated_error"]
    assert (gap > 0.0).all() and (gap <= told.sel(result="tip_max") + 1e-6).all()
    fine = studies.run(study.with_values({"solver.tolerance": 1e-9}))
    assert fine["tip_max"].equals(full["tip_max"])
    hinged = study.with_values({"frame.arm.joints.0": {"kind": "revolute", "axis": [0.2, 1.0, 0.3]}})
    assert (studies.run(hinged)["fidelity_used"] == Fidelity.FRAME).all()


def test_a_spring_to_a_place_is_marched_in_full() -> None:
    """An arm whose base is shaken, its tip on a long spring with a damper, beside its modes' own equations."""
    shake = {"kind": "prismatic", "axis": [0, 0, 1], "motion": {"kind": "swing", "amplitude": 0.05, "frequency": 0.7}}
    far, stiffness, damping = 1e4, 40.0, 6.0
    ends = [{"on": "arm"}, {"position": [10.0, 0.0, far]}]
    spring = {"stay": {"ends": ends, "stiffness": stiffness, "damping": damping, "length": far}}
    tip = {"tip": {"body": "arm", "at": 10.0}}
    joints = {"arm": {"joints": [shake]}}
    question = {"duration": 2.0}
    scene = Study(
        kind="moving-frames", body={"arm": ARM}, frame=joints, spring=spring, sensor=tip, gravity=0.0, question=question
    )
    assert (studies.run(scene)["fidelity_used"] == Fidelity.FRAME).all()

    beam = scene.body["arm"]
    modal, x = beam.build(), np.linspace(0.0, 10.0, 2001)
    shapes = modal.shapes.derivatives(x, (0,))[0]
    drag, own, rate = 1.2 * np.trapezoid(shapes, x, axis=0), shapes[-1], 2.0 * np.pi * 0.7

    def law(t: float, state: np.ndarray) -> np.ndarray:
        q, u = np.split(state, 2)
        place, speed = 0.05 * np.sin(rate * t), 0.05 * rate * np.cos(rate * t)
        pull = stiffness * (place + own @ q) + damping * (speed + own @ u)
        return np.concatenate([u, rate**2 * place * drag - modal.omega**2 * q - own * pull])

    model, marched = steps(scene, 2.0, 8000, 80)
    begun = np.zeros(12)
    wanted = own @ solve_ivp(law, (0, 2), begun, "DOP853", marched.times[0], rtol=1e-10, atol=1e-13).y[:6]
    assert history(model, marched, "sensors")[:, 0] == pytest.approx(wanted, abs=1e-3 * np.abs(wanted).max())
