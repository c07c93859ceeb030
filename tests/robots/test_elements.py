"""What elements of rails leave is part of the told errors of robots, and makes no status."""

from dataclasses import replace

import numpy as np
import pytest

from engine.robots.converge import Ladder, climb, marched
from engine.robots.model import build
from engine.robots.modes import MODES, with_open_modes
from engine.robots.results import are_held, differences, results_of
from results_schema.status import Status
from tests.robots.scenes import scene


@pytest.mark.parametrize("modes", ["auto", 6])
def test_told_errors_are_above_those_beside_many_elements(modes: int | str) -> None:
    few = scene({"modes": modes, "elements": 4}, solver={"tolerance": 1e-2})
    ladder = Ladder.of(few, None, 0.5)
    found = climb(ladder, "start")
    many = few.model_copy(update={"body": {name: body.with_more_elements(4) for name, body in few.body.items()}})
    finer = replace(ladder, study=many, coarsest=build(with_open_modes(many, ladder.times * MODES[0])))
    true = differences(found.model, found.outcome, marched(finer.level(found.rung), "start"))
    held = are_held(results_of(found.model))
    assert true[held].max() > 1.5e-2 and (true <= found.error).all()
    assert np.median(found.error / true) < 5.0 and found.status == Status.OK
