"""Sprung masses: the engine's march against the naive twin, limits, energy, order, and what each term is worth."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from engine.scene.study import Study
from tests.engine import twin as twins
from tests.engine.build import aboard, beam, cruise, fixed, mass, oscillator, shuttle, swing, under
from tests.march.test_twin import DAMPED, ENTERING, SPRINGS, case, compare, scheme
from tests.naive import scene as scenes

CROSSING = cruise(0.0, 1.0, 0.8)
SENSORS = {
    "place": fixed(0.61),
    "moment": fixed(0.3713, "bending_moment"),
    "below": under("car"),
    "below_acceleration": under("car", "acceleration"),
    "up": aboard("car"),
    "up_rate": aboard("car", "velocity"),
    "up_acceleration": aboard("car", "acceleration"),
}


def car(motion: Any = CROSSING, **changes: Any) -> dict[str, Any]:
    return oscillator(0.6, 40.0, motion, **changes)


FULL = {"wheel_mass": 0.2, "damping": 1.5}
ONE = car(**FULL)
TWO = {"car": ONE, "next": oscillator(0.3, 25.0, cruise(1.2, -0.1, 1.03), delay=0.217, wheel_mass=0.1, damping=0.7)}
SCENES: dict[str, Callable[[], Study]] = {
    "wheel, spring and damper": lambda: case(beam(modes=7), ONE, steps=96),
    "one mode, free vibration": lambda: case(beam(modes=1), car(cruise(0.0, 1.0, 0.8, after=0.8), **FULL)),
    "off both ends": lambda: case(beam(), car(cruise(-0.3, 1.4, 0.8), **FULL)),
    "two and a mass and dampers": lambda: case(
        beam(supports=DAMPED), TWO | {"third": mass(0.3, cruise(0.0, 1.0, 0.9), headway=0.3)}, steps=96
    ),
    "springs, second one arrives": lambda: case(beam(supports=SPRINGS, damping_ratio=0.02), TWO),
    "instant turns": lambda: case(beam(supports=SPRINGS), car(shuttle(0.8, 0.1, 1.0, 0.0, 2), **FULL)),
    "sinusoidal": lambda: case(beam(damping_ratio=0.02), car(swing(0.5, 0.4, 0.7, 1), damping=0.8)),
    "waypoints from off the body": lambda: case(beam(supports=SPRINGS), car(ENTERING, **FULL)),
    "equilibrium of two": lambda: case(
        beam(),
        {"car": car(shuttle(0.3, 0.8, 1.7, 0.1, 1), **FULL), "next": oscillator(0.4, 30.0, swing(0.6, 0.2, 1.0, 1))},
        steps=90,
    ),
    "waits, stands while another passes, free vibration": lambda: case(
        beam(damping_ratio=0.02),
        {
            "car": car(shuttle(0.3, 0.8, 1.7, 0.1, 1), **FULL, delay=0.1),
            "next": mass(0.4, cruise(0.0, 1.0, 0.5, after=0.7)),
        },
        steps=90,
    ),
    "on two bodies": lambda: case(
        beam(),
        {"car": ONE, "next": TWO["next"] | {"on": "table"}, "third": TWO["next"]},
        steps=96,
        body={"bed": beam(), "table": beam(supports=SPRINGS, modes=3, youngs_modulus=2.0)},
    ),
    "own weight, springs, entering": lambda: case(
        beam(own_weight=True, supports=SPRINGS), car(cruise(-0.2, 1.1, 0.8), **FULL)
    ),
    "own weight, equilibrium": lambda: case(beam(own_weight=True), car(shuttle(0.2, 0.9, 0.8, 0.0, 1), **FULL)),
    "linear acceleration": lambda: case(beam(), ONE, **scheme("linear-acceleration")),
    "HHT-alpha": lambda: case(beam(), ONE, **scheme("hht-alpha", alpha=-0.1)),
    "generalized-alpha, turning": lambda: case(
        beam(supports=DAMPED),
        car(shuttle(0.3, 0.8, 1.0, 0.0, 1), **FULL),
        **scheme("generalized-alpha", rho_inf=0.3),
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_engine_agrees_with_the_twin(name: str) -> None:
    given = SCENES[name]()
    given = given.with_values({"sensor": SENSORS})
    steps = int(given.solver.steps)  # type: ignore[arg-type]
    assert compare(given) > 0.5 * steps * len(given.sensor)


TERMS: dict[str, Callable[[scenes.Load], scenes.Load]] = {
    "convective rate": lambda load: replace(load, sprung=replace(spring(load), convective=False)),
    "wheel's inertia": lambda load: replace(load, mass=0.0, convective_mass=0.0),
    "wheel's convective terms": lambda load: replace(load, convective_mass=0.0),
    "damper": lambda load: replace(load, sprung=replace(spring(load), damping=0.0)),
    "spring": lambda load: replace(load, sprung=replace(spring(load), stiffness=1.01 * spring(load).stiffness)),
    "sprung mass's inertia": lambda load: replace(load, sprung=replace(spring(load), mass=1.01 * spring(load).mass)),
    "sprung mass's weight": lambda load: replace(load, sprung=replace(spring(load), weight=0.0)),
    "wheel's weight": lambda load: replace(load, weight=0.0),
}


def spring(load: scenes.Load) -> scenes.Sprung:
    assert load.sprung is not None
    return load.sprung


@pytest.mark.parametrize("term", TERMS)
def test_every_term_counts(term: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the term the twin leaves the engine by far more than the tolerance."""
    given = case(beam(), ONE, sensor=SENSORS)
    whole = twins.load_of
    monkeypatch.setattr(twins, "load_of", lambda *args: TERMS[term](whole(*args)))
    with pytest.raises(AssertionError):
        compare(given, 1e-4)


@pytest.mark.parametrize("term", ["level", "climb"])
def test_the_sag_counts(term: str, monkeypatch: pytest.MonkeyPatch) -> None:
    given = case(beam(own_weight=True), ONE, sensor=SENSORS)
    whole = twins.sagging_spring

    def without(*args: Any) -> scenes.Sprung | None:
        found = whole(*args)
        return None if found is None else replace(found, **{term: 0.0})

    monkeypatch.setattr(twins, "sagging_spring", without)
    with pytest.raises(AssertionError):
        compare(given, 1e-4)
