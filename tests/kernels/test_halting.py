"""Marches that somebody asks to stop: within their kernels, and between their levels."""

import time
from typing import Any

import numpy as np
import pytest

from engine.floating import march as floating
from engine.floating.converge import levels
from engine.march.halting import flagged, stop_if_asked, stoppable
from engine.march.stepper import Halted
from engine.robots import march as robots
from engine.robots.converge import Ladder, Rung
from engine.scene.study import load
from engine.scene.variants import VariantValues
from studies.commands.catalogue import built_in
from tests.robots.scenes import FOX_GOODWIN, scene


def test_who_does_not_ask_is_not_stopped() -> None:
    stop_if_asked()
    with stoppable(lambda: False):
        stop_if_asked()
        with flagged() as flag:
            assert flag.tolist() == [0]


def test_a_flag_goes_up_once_somebody_asks_and_not_outside() -> None:
    asks: list[bool] = []
    with pytest.raises(Halted), stoppable(lambda: bool(asks)), flagged() as flag:
        asks.append(True)
        while not flag[0]:
            time.sleep(0.01)
    stop_if_asked()


class Up:
    """A flag that is up from the beginning."""

    def __enter__(self) -> Any:
        return np.ones(1, dtype=np.int64)

    def __exit__(self, *error: object) -> None:
        pass


def test_robots_march_and_rest_no_further_than_that(monkeypatch: pytest.MonkeyPatch) -> None:
    level = Ladder.of(scene(), 2.0, 0.0).level(Rung(0, 0))
    monkeypatch.setattr(robots, "flagged", Up)
    for record, _ in (robots.march(level.model, level.times, FOX_GOODWIN), robots.rest(level.model, level.times)):
        assert np.isnan(record.coordinates).all()


@pytest.mark.filterwarnings("ignore:All-NaN slice")  # of what never moved
def test_frames_move_no_further_than_that(monkeypatch: pytest.MonkeyPatch) -> None:
    study = load(built_in()["spin-up"]).without_sweep()
    level = next(iter(levels(study, 1.0, 2)))
    values, duration = VariantValues(study, {}, 1), np.ones(1)
    whole = level.march(values, duration)
    monkeypatch.setattr(floating, "flagged", Up)
    found = level.march(values, duration)
    assert np.isfinite(whole.history).any() and not np.isfinite(found.history).any()
