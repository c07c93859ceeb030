"""Ways of carriages that are given: as pieces beside their law, and beside bodies that stand."""

import numpy as np
import pytest

import studies
from engine.floating.lanes import lanes
from engine.floating.model import build
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput
from tests.floating.scenes import PAPER_BEAM

SHUTTLE = {"kind": "out-and-back", "start": 2.0, "end": 12.0, "speed": 4.0, "turn": 0.2, "cycles": 2}
STOPPING = {"kind": "point-to-point", "start": 2.0, "end": 12.0, "speed": 4.0, "acceleration": 6.0}
MOTIONS = {
    "there first": SHUTTLE,
    "backward": SHUTTLE | {"start": 12.0, "end": 2.0, "turn": 0.5},
    "instant": SHUTTLE | {"turn": 0.0, "cycles": 3},
    "a sine that ends": {"kind": "sinusoidal", "centre": 7.0, "amplitude": 3.0, "frequency": 0.4, "cycles": 3},
    "backward cruise": {"kind": "cruise", "start": 12.0, "end": 2.0, "speed": 3.0},
    "jerk-limited": STOPPING | {"jerk": 20.0, "dwell": 0.5},
    "in a time": {"kind": "timed-move", "start": 2.0, "end": 12.0, "time": 4.5, "dwell": 0.5},
    "of least jerk": {"kind": "minimum-jerk", "start": 12.0, "end": 2.0, "time": 4.5, "dwell": 0.5},
    "a trapezoid, backward": STOPPING | {"start": 12.0, "end": 2.0},
    "too short for its speed": STOPPING | {"end": 2.5, "jerk": 20.0},
    "standing": {"kind": "standing", "at": 4.0},
    "spline": {"kind": "waypoints", "times": [0, 2, 5], "positions": [3, 10, 4]},
}


def study(motion: dict[str, object], **more: object) -> Study:
    load = {"kind": "mass", "on": "beam", "mass": 100.0, "motion": motion}
    tables: dict[str, object] = {
        "body": {"beam": PAPER_BEAM | {"modes": 3}},
        "carriage": {"load": load},
        "sensor": {"midspan": {"body": "beam", "at": 7.5}},
        "question": {"duration": 11.0},
    }
    return Study(kind="moving-frames", gravity=9.81, **(tables | more))


def at(pieces: np.ndarray, t: float) -> np.ndarray:
    """Value, rate and acceleration of a motion in pieces."""
    start, *powers, amplitude, rate, phase = pieces[np.flatnonzero(pieces[:, 0] <= t)[-1]]
    x = t - start
    polynomial = [np.polynomial.Polynomial(powers).deriv(order)(x) for order in range(3)]
    sine = [amplitude * rate**order * np.sin(rate * x + phase + 0.5 * np.pi * order) for order in range(3)]
    return np.add(polynomial, sine)


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_pieces_are_the_law(motion: dict[str, object]) -> None:
    """Place, speed and acceleration at many times, of all variants; then the carriage stays where it is."""
    scene = study(motion)
    own = scene.carriage["load"].motion
    pieces = lanes(build(scene), VariantValues(scene, {}, 1), np.ones(1)).motions[0, 0]
    end = own.duration * own.time_scale
    for t in np.random.default_rng(1).uniform(0.0, end, 200):
        path = own.path(t / own.time_scale)
        wanted = [path.S, path.dS / own.time_scale, path.ddS / own.time_scale**2]
        assert at(pieces, t) == pytest.approx(np.array(wanted, dtype=float), abs=1e-9)
    assert at(pieces, end + 1.0) == pytest.approx([float(own.path(own.duration).S), 0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("turn", [0.2, 0.0])
def test_a_shuttle_beside_a_body_that_stands(turn: float) -> None:
    """The deflection of a beam on the ground, also by the march of bodies that stand, to 1e-4."""
    motion = SHUTTLE | {"turn": turn}
    scheme = {"scheme": "average-acceleration", "tolerance": 1e-4}
    moving = studies.run(study(motion, solver=scheme))
    beam = PAPER_BEAM | {"modes": 3, "own_weight": True}
    standing = Study(
        kind="trajectory",
        gravity=9.81,
        initial="rest",
        body={"beam": beam},
        carriage={"load": {"kind": "mass", "on": "beam", "mass": 100.0, "motion": motion}},
        sensor={"midspan": {"body": "beam", "at": 7.5}},
        solver={"static_correction": False, "fidelity": "full", "tolerance": 1e-4},
        output={"histories": "all"},
    )
    other = studies.run(standing)
    times, found = moving["elapsed"].values, moving["midspan"].values
    deflection = other["midspan"].values - other["midspan"].values[0]  # own weight of what is not among the modes
    wanted = np.interp(times, other["elapsed"].values, deflection)
    inside = times <= other["elapsed"].values[-1]
    assert found[inside] == pytest.approx(wanted[inside], abs=1e-4 * np.abs(wanted).max() + 2e-5)


def test_numbers_of_a_shuttle_may_be_swept() -> None:
    """Each variant has its own pieces, also where one turns at an instant; cycles make scenes of their own."""
    sweep = {
        "turn": {"of": "carriage.load.motion.turn", "values": [0.0, 0.3]},
        "cycles": {"of": "carriage.load.motion.cycles", "values": [1, 2]},
    }
    found = studies.run(study(SHUTTLE, sweep=sweep, question={"duration": 8.0}, solver={"tolerance": 1e-2}))
    for k, turn in enumerate([0.0, 0.3]):
        for n, cycles in enumerate([1, 2]):
            one = study(SHUTTLE | {"turn": turn, "cycles": cycles}, question={"duration": 8.0})
            alone = studies.run(one.with_values({"solver.tolerance": 1e-2}))
            assert found["midspan_max"].values[k, n] == pytest.approx(float(alone["midspan_max"]), rel=1e-9)


def test_limits_of_a_point_to_point_motion_may_be_swept() -> None:
    """Each variant has its own pieces, also with a jerk that the scene without sweep does not have."""
    sweep = {
        "jerk": {"of": "carriage.load.motion.jerk", "values": [5.0, 50.0]},
        "acceleration": {"of": "carriage.load.motion.acceleration", "values": [3.0, 9.0]},
    }
    found = studies.run(study(STOPPING, sweep=sweep, question={"duration": 6.0}, solver={"tolerance": 1e-2}))
    for k, jerk in enumerate([5.0, 50.0]):
        for n, acceleration in enumerate([3.0, 9.0]):
            one = study(STOPPING | {"jerk": jerk, "acceleration": acceleration}, question={"duration": 6.0})
            alone = studies.run(one.with_values({"solver.tolerance": 1e-2}))
            assert found["midspan_max"].values[k, n] == pytest.approx(float(alone["midspan_max"]), rel=1e-9)


def test_too_many_cycles_are_refused() -> None:
    with pytest.raises(BadInput, match=r"carriage\.load\.motion\.cycles"):
        build(study(SHUTTLE | {"cycles": 1001}))
