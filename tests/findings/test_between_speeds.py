"""Where a limit is exceeded nowhere, it is said when a resonance may lie between swept speeds, once in an answer."""

from __future__ import annotations

from typing import Any

import pytest

import studies
from engine.scene.study import Study
from studies.reporting import answers
from tests.engine.build import beam, cruise, fixed, force, study

WAY = cruise(0.0, 1.0, 0.8)
COARSE = {"of": "train.tram.motion.speed", "values": ["1.00 m/s", "1.02 m/s", "1.04 m/s"]}


def answer_of(given: Study) -> list[str]:
    """The paragraphs of the answer."""
    return answers.answer(studies.run(given))


def crossed(speed: dict[str, Any] = COARSE, zeta: Any = 0.005, limit: float = 100.0, **changes: Any) -> Study:
    """A bed that a row of forces crosses, with two sensors whose limit is nowhere near."""
    tram = force(1.0, WAY) | {"axles": 3, "spacing": 0.3}
    own = {
        "train": {"tram": tram},
        "sweep": {"speed": speed},
        "question": {"displacement": limit},
        "sensor": {"midspan": fixed(0.5), "quarter": fixed(0.25)},
        "solver": {"audit": 0, "steps": 400, "scheme": "average-acceleration"},
        "output": {"histories": "none"},
    }
    return study(beam(modes=1, damping_ratio=zeta), {}, **(own | changes))


def test_it_is_said_once_behind_the_first_limit_that_is_exceeded_nowhere() -> None:
    told = answer_of(crossed())
    first = next(text for text in told if text.startswith("midspan: "))
    apart = "Speeds stand 0.02 m/s apart; a resonance at 0.5 % damping is about 1 % of its speed wide"
    assert f"exceeds 100 m nowhere from 1 to 1.04 m/s. {apart}, so peaks between them may be higher: sweep" in first
    assert "\n".join(told).count("sweep more closely around the highest") == 1
    assert not any("Speeds stand" in text for text in answer_of(crossed(limit=1e-6)))


def test_the_widest_gap_and_the_lowest_damping_count() -> None:
    speeds = COARSE | {"values": [1.0, 1.005, 1.05]}
    damping = {"of": "body.bed.damping_ratio", "values": [0.03, 0.005, 0.01]}
    said = "\n".join(answer_of(crossed(speeds, 0.03, sweep={"speed": speeds, "zeta": damping})))
    assert "Speeds stand up to 0.045 m/s apart; a resonance at 0.5 % damping" in said


@pytest.mark.parametrize(
    "given",
    [
        crossed(zeta=0.0105),  # 2 % of the lowest speed
        crossed(COARSE | {"values": [1.0, 1.009, 1.018]}),
        crossed(zeta=0.0),  # which is how a study says nothing of damping
        crossed(zeta=[0.005]),
        crossed(train={"tram": force(1.0, WAY) | {"axles": 2, "spacing": 0.3}}),
        crossed(sweep={"zip": True, "speed": COARSE, "mass": {"of": "gravity", "values": [9.0, 9.5, 10.0]}}),
        crossed(sweep={"scale": {"of": "train.tram.load_scale", "values": [1.0, 2.0]}}),
        crossed(question={}),
    ],
)
def test_where_it_need_not_be_said(given: Study) -> None:
    """Speeds near enough, damping not known, too few loads, samples, no speeds, no limit."""
    assert not any("Speeds stand" in text for text in answer_of(given))
