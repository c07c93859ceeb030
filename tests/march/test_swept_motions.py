"""Every number of every motion, swept beside alone: motions whose times do not all go with a speed are other scenes."""

import numpy as np
import pytest

import engine
from engine.batch.plan import make_plan
from tests.engine.build import Table, beam, cruise, force, mass, oscillator, shuttle, study, swing

MOTIONS: dict[str, Table] = {
    "cruise": cruise(0.0, 1.0, 0.3, after=0.5),
    "out-and-back": shuttle(0.2, 0.8, 0.4, 0.1, 2),
    "sinusoidal": swing(0.5, 0.3, 0.2, 2),
    "point-to-point": {
        "kind": "point-to-point",
        "start": 0.1,
        "end": 0.9,
        "speed": 0.4,
        "acceleration": 0.8,
        "jerk": 5.0,
        "dwell": 1.0,
    },
    "timed-move": {"kind": "timed-move", "start": 0.1, "end": 0.9, "time": 3.0, "dwell": 1.0},
    "minimum-jerk": {"kind": "minimum-jerk", "start": 0.1, "end": 0.9, "time": 3.0, "dwell": 1.0},
    "standing": {"kind": "standing", "at": 0.4, "time": 6.0},
    "waypoints": {"kind": "waypoints", "times": [0.0, 2.0, 4.0], "positions": [0.1, 0.8, 0.3]},
}
NUMBERS = [(kind, key) for kind, motion in MOTIONS.items() for key, value in motion.items() if isinstance(value, float)]
NUMBERS += [("waypoints", "times.2"), ("waypoints", "positions.1")]
CHANGES = 0.01, 0.03  # of a number


@pytest.mark.parametrize(("kind", "key"), NUMBERS, ids=[".".join(pair) for pair in NUMBERS])
def test_swept_numbers_of_motions_do_what_they_do_alone(kind: str, key: str) -> None:
    carriages = {"car": mass(0.2, MOTIONS[kind]), "other": mass(0.1, cruise(0.0, 1.0, 0.25))}
    given = study(beam(), carriages, solver={"steps": 1600, "fidelity": "full"})
    path = f"carriage.car.motion.{key}"
    values = [given.value(path) + change for change in CHANGES]
    swept = engine.run(given.with_values({"sweep": {"a": {"of": path, "values": values}}}))
    for number, value in enumerate(values):
        alone = engine.run(given.with_values({path: value}))
        for end in ("max", "min", "rms"):
            np.testing.assert_allclose(swept[f"midspan_{end}"][number], alone[f"midspan_{end}"], rtol=1e-9)
    assert swept.midspan_rms[0] != swept.midspan_rms[1]


@pytest.mark.parametrize("first", [True, False])
def test_what_stands_stands_as_by_waypoints(first: bool) -> None:
    """As the first carriage, where none moves, whose time is that of the scene, and beside one that moves."""
    found = []
    for way in (
        {"kind": "standing", "at": 0.3, "time": 5.0},
        {"kind": "waypoints", "times": [0, 5], "positions": [0.3] * 2},
    ):
        carriages = {"other": mass(0.1, way if first else cruise(0.0, 1.0, 0.25)), "car": mass(0.2, way)}
        given = study(beam(), carriages, initial="rest", solver={"steps": 800, "fidelity": "full"})
        found.append(engine.run(given))
    for name in found[0].data_vars:
        if found[0][name].dtype.kind == "f" and "contact" not in str(name):
            np.testing.assert_allclose(found[0][name], found[1][name], rtol=1e-9, atol=1e-12)


def test_what_moves_comes_before_what_stands() -> None:
    """The first carriage's way is what places, figures and steps go by: "with tmd at 11.3 m" was said of trains."""
    absorber = oscillator(0.05, 4.0, {"kind": "standing", "at": 0.5, "time": 1.0})
    carriages = {
        "absorber": absorber,
        "first": mass(0.2, cruise(0.0, 1.0, 0.2)),
        "second": force(1.0, MOTIONS["cruise"]),
    }
    given = study(beam(), carriages)
    assert list(given.carriage) == ["first", "second", "absorber"] and given.clock == "first"
    placed = given.with_values({"kind": "influence", "question": {"positions": [0.2, 0.5]}})
    assert list(placed.carriage) == list(carriages)
    assert float(engine.run(given).midspan_max_position) == pytest.approx(0.445, abs=0.02)


def test_a_carriage_that_stands_later_does_not_make_the_run_longer() -> None:
    """Its delay and its time end before the passage does."""
    absorber = oscillator(0.05, 4.0, {"kind": "standing", "at": 0.5, "time": 1.0}, delay=1.0)
    given = study(beam(), {"car": mass(0.2, cruise(0.0, 1.0, 0.2)), "absorber": absorber}, solver={"steps": 1600})
    found = engine.run(given.with_values({"output.histories": "all"}))
    assert float(found["elapsed"].max()) == pytest.approx(5.0)


@pytest.mark.parametrize(("time", "scenes"), [(1.0, 1), (2.0, 3), (20.0, 4)])
def test_speeds_beside_a_carriage_that_stands_no_longer_share_a_scene(time: float, scenes: int) -> None:
    """Passages take 1.25 to 5 s; of those that are shorter than it stands the run goes on until then."""
    absorber = oscillator(0.05, 4.0, {"kind": "standing", "at": 0.5, "time": time}, damping=0.05)
    given = study(beam(), {"car": mass(0.2, cruise(0.0, 1.0, 0.4)), "absorber": absorber}, solver={"steps": 1600})
    speeds = [0.2, 0.4, 0.6, 0.8]
    swept = given.with_values({"sweep": {"speed": {"of": "carriage.car.motion.speed", "values": speeds}}})
    assert len(make_plan(swept).grids) == scenes
    found = engine.run(swept)
    for speed in speeds:
        alone = engine.run(given.with_values({"carriage.car.motion.speed": speed}))
        for name in ("midspan_max", "midspan_min", "absorber_contact_force_max"):
            assert float(found[name].sel(speed=speed)) == pytest.approx(float(alone[name]), rel=1e-6)
