"""When sensors are largest and smallest: against the kept history, a closed form, and what the answer says of it."""

import math
from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.engine.build import beam, cruise, fixed, force, mass, study, under

TIMES: Any = {"output": {"histories": "all", "times": True}}
OMEGA = math.pi**2  # of the first mode of `beam`


@pytest.mark.parametrize(("scheme", "steps_off"), [("auto", 0.0), ("richardson", 1.0)])
def test_they_are_those_of_the_history(scheme: str, steps_off: float) -> None:
    """Of a sensor that stays and of one that moves along, with free vibration after the exit; Richardson's have
    parabolas between steps."""
    sensors = {"midspan": fixed(0.5), "below": under("car")}
    car = mass(0.3, cruise(0.0, 1.0, 0.9, after=1.5))
    given = study(beam(modes=4), car, sensor=sensors, solver={"scheme": scheme}, **TIMES)
    found = engine.run(given)
    for sensor in sensors:
        for end, pick in (("max", np.nanargmax), ("min", np.nanargmin)):
            times, place = found.elapsed.values.ravel(), pick(found[sensor].values)
            off = steps_off * (times[place] - times[place - 1])
            assert float(found[f"{sensor}_{end}_time"]) == pytest.approx(times[place], rel=0.0, abs=off)
            assert times[place] > 0.1


@pytest.mark.parametrize("speed", [0.4, 4.0])
def test_they_are_within_their_estimated_error(speed: float) -> None:
    """One undamped mode under a force that crosses: q ~ sin(W t) - W/w sin(w t) while it is on, W = pi v; at 4 the
    largest is after the exit, where the first carriage has no place."""
    found = engine.run(study(beam(modes=1), force(2.0, cruise(0.0, 1.0, speed, after=0.9)), **TIMES))
    rate, on = math.pi * speed, 1.0 / speed
    times = np.linspace(0.0, on, 100_001)
    driven = (np.sin(rate * times) - rate / OMEGA * np.sin(OMEGA * times)) / (OMEGA**2 - rate**2)
    rates = rate * (np.cos(rate * times) - np.cos(OMEGA * times)) / (OMEGA**2 - rate**2)
    free = np.linspace(0.0, 0.9 * 2.0 * math.pi / OMEGA, 100_001)
    freely = driven[-1] * np.cos(OMEGA * free) + rates[-1] / OMEGA * np.sin(OMEGA * free)
    expected = np.concatenate([times, on + free])[np.argmax(np.concatenate([driven, freely]))]
    assert (expected > on) == (speed > 1.0) == bool(np.isnan(found.midspan_max_position))
    error = float(found.estimated_error.sel(result="midspan_max_time")) / speed  # over the time of the passage
    assert abs(float(found.midspan_max_time) - expected) <= error < 0.02


def test_the_answer_tells_them() -> None:
    def answered(**output: Any) -> str:
        given = study(beam(modes=1), force(2.0, cruise(0.0, 1.0, 4.0, after=0.9)), output=output)
        return studies.answer(studies.run(given))[0]

    assert " after 0.602 s with car off its body, " in answered(times=True)
    assert " with car off its body" in answered()


@pytest.mark.parametrize(("kind", "remedy"), [("influence", ""), ("moving-frames", "always told")])
def test_kinds_without_them_say_so(kind: str, remedy: str) -> None:
    given = {"kind": kind, "output": {"times": True}}
    with pytest.raises(BadInput, match=r"output\.times.*times of extremes") as caught:
        studies.run(Study.model_validate(given))
    assert remedy in str(caught.value)
