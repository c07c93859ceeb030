"""The engine's march against the naive twin at the same instants: every sensor, every contact force."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from engine.batch.execution import run
from engine.scene.study import Study
from tests.engine.build import beam, cruise, fixed, force, mass, shuttle, swing, under
from tests.engine.build import study_of_steps as study
from tests.engine.reading import Reading
from tests.engine.twin import Twin, march_twin

ALL = {"histories": "all"}
SENSORS = {
    "place": fixed(0.61),
    "rate": fixed(0.61, "velocity"),
    "jerked": fixed(0.61, "acceleration"),
    "moment": fixed(0.3713, "bending_moment"),
    "shear": fixed(0.3713, "shear_force"),
    "below": under("car"),
    "below_rate": under("car", "velocity"),
    "below_acceleration": under("car", "acceleration"),
    "below_moment": under("car", "bending_moment"),
    "below_shear": under("car", "shear_force"),
}
SPRINGS = [{"at": 0.0, "stiffness": 60.0, "rotational": 0.3}, {"at": 1.0, "stiffness": 90.0}]
DAMPED = [{"at": 0.0, "stiffness": 60.0, "damping": 2.0}, {"at": 0.9, "stiffness": 90.0, "damping": 0.7}]
ENTERING = {"kind": "waypoints", "times": [0.0, 0.5, 0.9, 1.4], "positions": [-0.3, 0.4, 0.7, 1.2]}
STOPPING = {
    "kind": "point-to-point", "start": 0.2, "end": 0.9, "speed": 1.0, "acceleration": 3.0, "dwell": 0.3,
}  # fmt: skip
LONG = beam(length=2.0, area=0.03, second_moment=0.002, youngs_modulus=700.0, density=50.0, damping_ratio=0.01)
LONG_SENSORS = {"place": fixed(0.83), "moment": fixed(0.83, "bending_moment"), "below": under("car")}
THREE = {
    "car": mass(0.4, cruise(0.0, 1.0, 1.1)),
    "slow": mass(0.3, cruise(1.0, 0.0, 0.5), delay=0.21),
    "late": force(6.0, cruise(-0.1, 1.2, 0.9), headway=0.35),
}


def case(bed: dict[str, Any], carriages: dict[str, Any], steps: int = 64, **changes: Any) -> Study:
    solver = {"steps": steps} | changes.pop("solver", {})
    given = {"sensor": SENSORS, "output": ALL, "solver": solver} | changes
    return study(bed, carriages, **given)


def scheme(name: str, **changes: Any) -> dict[str, Any]:
    return {"solver": {"scheme": name} | changes}


def two_bodies() -> Study:
    """A beam and a stiffer one on springs, each with its carriages, the sensors on both."""
    other = beam(supports=SPRINGS, modes=3, youngs_modulus=2.0, damping_ratio=0.05)
    carriages = {
        "car": mass(0.5, cruise(0.0, 1.0, 0.8)),
        "next": mass(0.4, cruise(-0.2, 1.1, 1.3), delay=0.1) | {"on": "table"},
        "third": force(4.0, cruise(0.0, 1.0, 0.9), delay=0.3),
    }
    sensors = {
        "place": fixed(0.61),
        "below": under("next"),
        "below_acceleration": under("next", "acceleration"),
        "moment": fixed(0.2713, "bending_moment", "table"),
    }
    bed = beam()
    return case(bed, carriages, body={"bed": bed, "table": other}, sensor=sensors)


HALF = mass(0.5, cruise(0.0, 1.0, 0.8))
SCENES: dict[str, Callable[[], Study]] = {
    "force": lambda: case(beam(), force(5.0, cruise(0.0, 1.0, 0.8))),
    "mass": lambda: case(beam(), HALF),
    "mass, seven modes": lambda: case(beam(modes=7), HALF),
    "mass as force": lambda: case(beam(), HALF, **scheme("average-acceleration", fidelity="force")),
    "without convective": lambda: case(
        beam(), HALF, **scheme("average-acceleration", fidelity="mass-without-convective")
    ),
    "other units": lambda: case(LONG, mass(0.7, cruise(0.0, 2.0, 0.9)), sensor=LONG_SENSORS),
    "backward": lambda: case(beam(damping_ratio=0.03), mass(0.5, cruise(1.0, 0.0, 0.8))),
    "off both ends": lambda: case(beam(), mass(0.5, cruise(-0.3, 1.4, 0.8))),
    "free vibration": lambda: case(beam(damping_ratio=0.02), mass(0.5, cruise(0.0, 1.0, 0.8, after=1.3))),
    "three carriages": lambda: case(beam(damping_ratio=0.01), THREE),
    "springs, entering and leaving": lambda: case(beam(supports=SPRINGS), mass(0.5, cruise(-0.2, 1.3, 0.8))),
    "springs, second one arrives": lambda: case(
        beam(supports=SPRINGS, damping_ratio=0.02),
        {"car": mass(0.5, cruise(0.0, 1.0, 0.8)), "next": mass(0.4, cruise(1.2, -0.1, 1.03), delay=0.317)},
    ),
    "springs, arrival without convective": lambda: case(
        beam(supports=SPRINGS),
        {"car": mass(0.5, cruise(0.0, 1.0, 0.8)), "next": mass(0.4, cruise(0.0, 1.0, 1.0), delay=0.3)},
        **scheme("average-acceleration", fidelity="mass-without-convective"),
    ),
    "dampers": lambda: case(beam(supports=DAMPED), HALF),
    "dampers and three carriages": lambda: case(beam(supports=DAMPED, damping_ratio=0.01), THREE, steps=80),
    "cantilever": lambda: case(beam(supports="clamped-free"), mass(0.5, cruise(0.0, 1.0, 0.8))),
    "cantilever, entering at the tip": lambda: case(
        beam(supports="clamped-free"),
        {"car": mass(0.5, cruise(1.0, 0.0, 0.8)), "next": mass(0.2, cruise(1.3, 0.0, 0.9), delay=0.2)},
    ),
    "free": lambda: case(beam(supports="free-free", modes=5), HALF),
    "Rayleigh": lambda: case(beam(damping_ratio={"rayleigh": [0.3, 0.002]}), HALF),
    "listed damping": lambda: case(beam(damping_ratio=[0.01, 0.05, 0.0, 0.2]), HALF),
    "fewer ratios than modes": lambda: case(beam(damping_ratio=[0.01, 0.2]), HALF),
    "more ratios than modes": lambda: case(beam(damping_ratio=[0.01, 0.05, 0.0, 0.2, 0.3]), HALF),
    "instant turns": lambda: case(beam(damping_ratio=0.02), mass(0.5, shuttle(0.3, 0.8, 1.0, 0.0, 2))),
    "instant turns on springs": lambda: case(beam(supports=SPRINGS), mass(0.5, shuttle(0.8, 0.0, 1.0, 0.0, 2))),
    "turns from rest": lambda: case(beam(), mass(0.5, shuttle(0.3, 0.8, 1.0, 0.2, 1)), initial="rest"),
    "sinusoidal": lambda: case(beam(damping_ratio=0.02), mass(0.5, swing(0.5, 0.4, 0.7, 2))),
    "cruise from equilibrium": lambda: case(beam(), mass(0.5, cruise(0.3, 1.0, 0.8)), initial="equilibrium"),
    "waypoints from off the body": lambda: case(beam(supports=SPRINGS), mass(0.5, ENTERING)),
    "point to point, and rest": lambda: case(beam(damping_ratio=0.02), mass(0.5, STOPPING)),
    "point to point while another passes": lambda: case(
        beam(supports=SPRINGS), {"car": mass(0.5, STOPPING, delay=0.1), "next": mass(0.4, cruise(0.0, 1.0, 0.7))}
    ),
    "shuttle waits": lambda: case(beam(), mass(0.5, shuttle(0.3, 0.8, 1.0, 0.1, 1), delay=0.25)),
    "stands while another passes": lambda: case(
        beam(),
        {"car": mass(0.5, shuttle(0.3, 0.8, 1.7, 0.1, 1), delay=0.1), "next": mass(0.4, cruise(0.0, 1.0, 0.3))},
        steps=64,
    ),
    "delayed instant turns": lambda: case(
        beam(supports=DAMPED),
        {
            "car": force(0.126, shuttle(1.0, 0.072, 1.227, 0.205, 2)),
            "next": mass(0.641, shuttle(0.863, 0.292, 1.958, 0.0, 2), delay=0.468),
        },
        steps=90,
        **scheme("linear-acceleration"),
    ),
    "sets off at once, stops at once": lambda: case(
        beam(supports=SPRINGS),
        {"car": mass(0.3, cruise(0.0, 1.0, 0.5)), "next": mass(0.4, swing(0.4, 0.3, 1.3, 1), delay=0.4)},
        steps=90,
        initial="rest",
    ),
    "two bodies": two_bodies,
    "own weight from rest": lambda: case(beam(own_weight=True), HALF),
    "own weight from equilibrium": lambda: case(beam(own_weight=True, damping_ratio=0.02), HALF, initial="equilibrium"),
    "own weight, springs, arriving": lambda: case(
        beam(own_weight=True, supports=SPRINGS), mass(0.5, cruise(-0.2, 1.1, 0.8))
    ),
    "own weight, turning": lambda: case(
        beam(own_weight=True, supports=SPRINGS), mass(0.5, shuttle(0.2, 0.9, 0.8, 0.0, 1))
    ),
    "no correction": lambda: case(beam(), HALF, **scheme("average-acceleration", static_correction=False)),
    "linear acceleration": lambda: case(beam(), HALF, **scheme("linear-acceleration")),
    "Fox-Goodwin": lambda: case(beam(), HALF, steps=200, **scheme("fox-goodwin")),
    "scaled Fox-Goodwin": lambda: case(beam(damping_ratio=0.02), HALF, steps=48, **scheme("scaled-fox-goodwin")),
    "scaled Fox-Goodwin, arriving on springs, and free vibration": lambda: case(
        beam(supports=SPRINGS, damping_ratio=0.02, modes=6),
        {"car": mass(0.5, cruise(-0.2, 1.3, 0.8)), "next": mass(0.4, cruise(1.2, 0.0, 1.03))},
        **scheme("scaled-fox-goodwin"),
    ),
    "scaled Fox-Goodwin, turning": lambda: case(
        beam(damping_ratio=0.02), mass(0.5, shuttle(0.3, 0.8, 1.0, 0.0, 2)), steps=40, **scheme("scaled-fox-goodwin")
    ),
    "central difference": lambda: case(beam(), HALF, steps=200, **scheme("central-difference")),
    "damped Newmark, turning": lambda: case(
        beam(supports=DAMPED), mass(0.5, shuttle(0.3, 0.8, 1.0, 0.0, 1)), **scheme("newmark", beta=0.4, gamma=0.7)
    ),
    "HHT-alpha": lambda: case(beam(), HALF, **scheme("hht-alpha", alpha=-0.1)),
    "generalized-alpha, turning, two ties": lambda: case(
        beam(supports=DAMPED), mass(0.5, shuttle(0.3, 0.8, 1.0, 0.0, 1)), **scheme("generalized-alpha", rho_inf=0.0)
    ),
}


def assert_close(found: Any, expected: Any, scale: float, tolerance: float) -> int:
    """Equal within a part of the scale, with NaN in the same places; returns how many numbers were compared."""
    found, expected = np.atleast_1d(np.asarray(found)), np.atleast_1d(np.asarray(expected))
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    numbers = np.isfinite(expected)
    np.testing.assert_allclose(found[numbers], expected[numbers], rtol=0.0, atol=tolerance * scale, equal_nan=False)
    return int(numbers.sum())


def compare(given: Study, tolerance: float = 1e-9) -> int:
    """Every sensor's history and extremes and every contact force's extremes against the twin."""
    dataset = run(given, threads=1)
    assert int(dataset.status) in (0, 1)
    t = dataset.elapsed.values
    assert np.all(np.diff(t) > 0.0)
    count = 0
    twins = {body: march_twin(given, body, t) for body in given.body}
    for name, sensor in given.sensor.items():
        twin = twins[given.body_of(name)]
        reading = Reading(given, twin, sensor)
        expected = reading.values
        scale = np.nanmax(np.abs(expected))
        assert scale > 0.0
        count += assert_close(dataset[name].values, expected, scale, tolerance)
        if sensor.quantity in ("displacement", "bending_moment"):
            pair = [dataset[f"{name}_max"], dataset[f"{name}_min"]]
            seen = np.array([*expected, *reading.values_before])
            count += assert_close(pair, [np.nanmax(seen), np.nanmin(seen)], scale, tolerance)
            size = math.sqrt(reading.mean_square)
            count += assert_close(dataset[f"{name}_rms"], size, size, tolerance)
            if sensor.under is None and sensor.body == given.carriage["car"].on:
                count += compare_places(dataset, name, reading, twin, tolerance)
    for twin in twins.values():
        count += compare_contact_forces(given, dataset, twin, tolerance)
    return count


def compare_places(dataset: Any, name: str, reading: Reading, twin: Twin, tolerance: float) -> int:
    """Where the first carriage was at the extremes over all steps, as they end."""
    ends = reading.values
    for event, value in zip(twin.history.before, reading.values_before, strict=True):
        ends[event.step] = value
    count = 0
    events = {event.step for event in twin.history.before}
    for kind, at in (("max", int(np.argmax(ends))), ("min", int(np.argmin(ends)))):
        if at not in events:
            place = twin.history.position[at, twin.riders.index("car")]
            count += assert_close(dataset[f"{name}_{kind}_position"], place, 1.0, 1e-9)
    return count


def compare_contact_forces(given: Study, dataset: Any, twin: Twin, tolerance: float) -> int:
    """Extremes of the contact forces over 0-98 % of the span towards held ends, both sides of every event."""
    count = 0
    for r, name in enumerate(twin.riders):
        forces, history = twin.history.contact_force[:, r], twin.history
        low, high = counted_span(given, name, twin.bed.length)
        counted = (history.position[:, r] >= low) & (history.position[:, r] <= high)
        seen = list(forces[counted])
        for event in twin.history.before:
            phase = twin.scene.loads[r].phase(event.t, "left")
            if phase is not None and low <= phase.s(event.t) <= high:
                seen.append(event.contact_force[r])
        pair = [dataset[f"{name}_contact_force_max"], dataset[f"{name}_contact_force_min"]]
        count += assert_close(pair, [max(seen), min(seen)], np.abs(seen).max(), tolerance)
    return count


def counted_span(given: Study, carriage: str, length: float) -> tuple[float, float]:
    """Where contact forces count: not on the last 2 % towards a pinned or clamped end."""
    motion: Any = given.carriage[carriage].motion
    left, right = given.body[given.carriage[carriage].on].ends  # type: ignore[attr-defined]
    forward = motion.kind != "cruise" or motion.end > motion.start
    backward = motion.kind != "cruise" or motion.end < motion.start
    low = 0.02 * length if backward and left != "free" else 0.0
    return low, 0.98 * length if forward and right != "free" else length


@pytest.mark.parametrize("name", SCENES)
def test_engine_agrees_with_the_twin(name: str) -> None:
    given = SCENES[name]()
    steps = int(given.solver.steps)  # type: ignore[arg-type]
    assert compare(given) > 0.5 * steps * len(given.sensor)
