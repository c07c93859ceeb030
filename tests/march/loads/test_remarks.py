"""What is worth knowing about forces that pulsate, and when an answer names the frequency that they meet."""

from typing import Any

import pytest

import studies
from engine.batch.plan import make_plan
from engine.batch.remarks_of_carriages import pulls_by_pulsation, pulsates_together
from engine.scene.study import Study
from studies.reporting.answers import answer
from tests.engine.build import beam, cruise, force, mass, study

WAY = cruise(0.0, 1.0, 0.1)
PULSE = {"amplitude": 1.0, "frequency": 1.57}
ROW = force(2.0, WAY, pulsation=PULSE) | {"axles": 2, "spacing": 0.2, "delay": 1.0}


def walkers(*each: dict[str, Any], **more: Any) -> Study:
    """Forces of 2 N that pulsate by 1 N at 1.57 Hz, with keys of their own."""
    names = {
        f"w{n}": force(2.0, WAY, pulsation=PULSE | own.get("pulse", {}), delay=own.get("delay", 0.0))
        for n, own in enumerate(each, start=1)
    }
    return study(beam(damping_ratio=0.02), names, **more)


def delayed(count: int) -> dict[str, Any]:
    return {"sweep": {"delay": {"of": f"carriage.w{count}.delay", "values": [0.5, 1.0]}}}


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (walkers({}, {"delay": 1.0}), "phases count from the run's start, not from when w2 sets off, "),
        (walkers({}, {}, **delayed(2)), "phases count from the run's start, not from when w2 sets off, "),
        (walkers({}, {}), ""),
        (walkers({"delay": 1.0}), ""),
        (walkers({}, {"delay": 1.0, "pulse": {"phase": -2.0}}), ""),
        (study(beam(), {}, train={"row": ROW}), ""),
    ],
    ids=["a delay", "a swept delay", "none", "one alone", "a phase", "a train"],
)
def test_phases_count_from_the_runs_start(given: Study, told: str) -> None:
    found = list(pulsates_together(make_plan(given)))
    assert [text[: len(told)] for text in found] == [told] * bool(told)


def test_who_pulls_is_asked_about() -> None:
    given = walkers({}, {"pulse": {"amplitude": 2.5}})
    assert list(pulls_by_pulsation(make_plan(given))) == [
        "carriage w2 pulls for a part of each swing, as its amplitude, 2.5 N, is above its force"
    ]


def test_no_frequency_is_named_that_a_mass_shifts() -> None:
    standing = {"kind": "standing", "at": 0.5, "time": 10.0}
    for riding, named in (({}, True), ({"box": mass(0.4, standing)}, False)):
        given = study(beam(damping_ratio=0.02), {"car": force(2.0, WAY, pulsation=PULSE), **riding})
        told = " ".join(answer(studies.run(given)))
        assert ("in step with the first frequency" in told) == named
