"""When a sensor has settled whose swings come and go by beats that are longer than the rest."""

import numpy as np
import pytest

import studies
from engine.march.rest import BEATS, Rest
from tests.engine.build import beam, force, study

FAST, SLOW = 2.0 * np.pi * np.array([10.0, 9.5])  # rad/s: a beat is 2 s
PERIOD, LONGEST = 2.0 * np.pi / SLOW, BEATS * 2.0


def rest(seconds: float, band: float) -> Rest:
    """Two swings of 1 m each that begin against each other: together they are 2 m after half a beat, 1 s."""
    times = np.linspace(0.0, seconds, 2001)[:, None]
    off = np.abs(np.sin(FAST * times) - np.sin(SLOW * times))
    return Rest("tip", off, times, np.zeros(1), np.array([PERIOD]), np.array([LONGEST]), band)


@pytest.mark.parametrize("seconds", [0.15, 0.3, 0.6, 1.2, 2.0])
def test_what_may_grow_beyond_its_band_is_not_known_to_have_settled(seconds: float) -> None:
    for band in (0.5, 1.0, 1.5, 1.95):
        (told,) = rest(seconds, band).settled_within(np.ones(1))[0]
        assert np.isnan(told), (band, told)


@pytest.mark.parametrize("seconds", [0.3, 0.6, 1.2])
def test_what_is_seen_long_enough_of_a_wide_band_has_settled(seconds: float) -> None:
    """By twice as much as two swings may come to; in a rest shorter than a period nothing is known."""
    wide = 4.0 / np.sin(np.pi * seconds / LONGEST)
    assert rest(seconds, wide).settled_within(np.ones(1)).tolist() == [[0.0]]
    assert np.isnan(rest(0.5 * PERIOD, wide).settled_within(np.ones(1))).all()
    assert rest(2.0 * LONGEST, 2.1).settled_within(np.ones(1)).tolist() == [[0.0]]


def test_what_stays_within_its_band_is_not_said_to_have_left_it() -> None:
    """Of a rest shorter than a period: neither has it settled for good, nor does it take longer than a limit."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 1.0}}
    move = {"kind": "point-to-point", "start": 0.2, "end": 0.5, "speed": 1.0, "acceleration": 8.0, "dwell": 0.05}
    sweep = {"force": {"of": "carriage.car.force", "values": [1.0, 2.0]}}
    asked = {"output": {"residual": True}, "question": {"settling_time": 0.01}, "sweep": sweep}
    found = studies.run(study(beam(modes=1), force(2.0, move), sensor=sensors, **asked))
    assert np.isnan(found.midspan_settling_time).all() and (found.midspan_residual < 1.0).all()
    (said,) = (text for text in studies.answer(found) if "after the stop it" in text)
    assert "it takes longer than 0.01 s nowhere" in said and "not settled" not in said
    stay = "2 variants stay within 1 m of its static value, over force everywhere from 1 to 2 N"
    assert f"{stay}, but the rest is too short to tell that it is for good" in said
