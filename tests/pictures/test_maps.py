"""Maps over two swept numbers: panels, rings and lines, what is said of the best, and where curves say as much."""

import re

import numpy as np
import pytest

import studies
from studies.reporting import answers
from studies.results.formatting import listed, quantity
from studies.results.results import Results
from tests.engine.build import beam, force, study
from tests.kinds.test_residual import MOVE, stops


def test_each_value_of_what_is_no_motion_has_its_best_motion_in_words_and_on_a_map() -> None:
    """The shortest move with settling of each force, and rings around them; a line at the limit of what rings on."""
    sensors = {"midspan": {"body": "bed", "at": 0.5, "settling_band": 4e-3}}
    sweep = {
        "acceleration": {"of": "carriage.car.motion.acceleration", "from": 2.0, "to": 16.0, "count": 8},
        "jerk": {"of": "carriage.car.motion.jerk", "from": 20.0, "to": 300.0, "count": 8},
        "load": {"of": "carriage.car.force", "values": [1.0, 2.0]},
    }
    moves = force(2.0, MOVE | {"jerk": 50.0, "dwell": 4.0})
    question = {"residual": {"displacement": 5e-3}}
    damped, tables = beam(modes=1, damping_ratio=0.05), {"output": {"residual": True}, "solver": {"steps": 500}}
    found = studies.run(study(damped, moves, sensor=sensors, sweep=sweep, question=question, **tables))
    times, results = found.midspan_move_and_settle_time, Results.of(found)
    assert np.isfinite(times).all()
    best = [times.sel(load=load).values for load in (1.0, 2.0)]
    places = [np.unravel_index(int(np.argmin(one)), one.shape) for one in best]
    ends = [
        [
            name
            for name, at, size in zip(("acceleration", "jerk"), place, best[0].shape, strict=True)
            if at in (0, size - 1)
        ]
        for place in places
    ]
    at_an_end = {0: "", 1: ", an end of the swept ", 2: ", ends of the swept "}
    words = [
        f"{quantity(float(one[place]), 's')} at {results.at((*place, k)).rpartition(', ')[0]}"
        f"{at_an_end[len(ends[k])]}{listed(ends[k])} (load {k + 1} N)"
        for k, (one, place) in enumerate(zip(best, places, strict=True))
    ]
    said = re.sub(r" ± \S+ \S+", "", answers.answer(found)[0])
    assert said.startswith(f"Until midspan has settled, move and settling take at least {words[0]} and {words[1]}")
    figures = {one.name: one for one in studies.figures(found)}
    *panels, _ = figures["settling-map"].drawing.axes
    assert [axes.get_title(loc="left") for axes in panels] == ["load 1 N", "load 2 N"]
    for axes, place, own in zip(panels, places, best, strict=True):
        np.testing.assert_allclose(axes.collections[0].get_array().reshape(8, 8), own.T)
        at = [float(found[name][k]) for name, k in zip(("acceleration", "jerk"), place, strict=True)]
        assert [float(line[0]) for line in axes.lines[0].get_data()] == pytest.approx(at)
    limited = figures["residual-map"]
    assert "Orange line: the limit of 5 mm." in limited.caption and not limited.drawing.axes[0].lines
    beyond = found.midspan_residual.values > 5e-3
    for k, axes in enumerate(limited.drawing.axes[:2]):
        assert (len(axes.collections) == 2) == (beyond[..., k].any() and not beyond[..., k].all())


def test_a_map_of_stripes_or_of_one_colour_is_none() -> None:
    """A force multiplies; where it alone changes a result along its axis, or nothing does, curves say as much."""
    tables = {"output": {"residual": True}, "solver": {"steps": 250}}
    steps = {"of": "carriage.car.motion.acceleration", "from": 2.0, "to": 16.0, "count": 8}
    swept = {"acceleration": steps, "nothing": {"of": "carriage.car.motion.dwell", "from": 1.5, "to": 1.6, "count": 8}}
    names = [one.name for one in studies.figures(studies.run(stops(sweep=swept, **tables)))]
    assert "residual" in names and "residual-map" not in names
