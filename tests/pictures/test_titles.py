"""Titles and captions say no more than what holds: over the way or over the sweep, from where on, of how many."""

from __future__ import annotations

import numpy as np
import pytest

import studies
from studies.findings.amplification import largest, sizes
from studies.pictures.common import sweep_view
from studies.pictures.common.figures import Figure
from studies.pictures.common.sweep_view import view
from studies.pictures.moving_frames import MOST_TIPS, _of_tips
from studies.reporting import answers
from studies.results.results import Results
from tests.floating.bodies.test_position_errors import HINGE, LINK, arm, reads
from tests.studies import at_rest, scenes


def named(dataset: object, name: str) -> Figure:
    return next(figure for figure in answers.figures(dataset) if figure.name == name)


@pytest.mark.parametrize(
    ("forces", "words"),
    [
        ([900.0, -90.0, -90.0, -90.0], " from pace 3.333 m/s on"),
        ([900.0, -90.0, 900.0, 900.0], ", first at pace 3.333 m/s"),
        ([900.0, -90.0, np.nan, -90.0], " from pace 3.333 m/s on"),
    ],
)
def test_contacts_open_from_a_speed_on_where_they_stay_so(forces: list[float], words: str) -> None:
    dataset = scenes.run("passage", scenes.pace("passage"))
    dataset["table_contact_force_min"].values[:] = forces
    assert named(dataset, "contact-table").title == f"table would lift off{words.replace('3.333', '3.33')}"


def test_readings_change_along_the_way_or_over_the_sweep() -> None:
    dataset = at_rest.run("influence", sweep=at_rest.MASS).copy(deep=True)
    said = "The static displacement at 2 m of bed"
    dataset["middle"].values[:] = [[1e-3] * 5, [4e-3] * 5]
    assert (
        named(dataset, "readings").title == f"{said} lies between 1 mm and 4 mm over the sweep, each all along the way"
    )
    dataset["middle"].values[0, 2] = 2e-3
    assert named(dataset, "readings").title == f"{said} lies between 1 mm and 4 mm over the way and the sweep"
    dataset["middle"].values[:] = 1e-3
    assert named(dataset, "readings").title == f"{said} is 1 mm all along the way"
    alone = at_rest.run("influence").copy(deep=True)
    alone["middle"].values[:] = [1e-3, 2e-3, 3e-3, 2e-3, 1e-3]
    assert named(alone, "readings").title == f"{said} goes from 1 mm to 3 mm along the way"


def test_samples_that_are_drawn_are_counted_among_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of five samples at two dampings each, of which one is shown."""
    pace = scenes.pace("passage").replace("count = 4", "sobol = 5")
    damping = 'damping = { of = "body.bed.damping_ratio", values = [0.01, 0.03] }'
    seen = view(Results.of(scenes.run("passage", f"{pace}\n{damping}")))
    assert seen.is_sampled and seen.thinned == ""
    monkeypatch.setattr(sweep_view, "MOST_POINTS", 3)
    assert seen.thinned == "Drawn: 3 of 5 samples, evenly spread over their numbers."


def test_tips_that_are_said_to_be_in_the_archive_alone_are_not_drawn() -> None:
    sensors = {f"tip_{place}": reads("upper", 0.25 * place) for place in range(2, 7)}
    frames = {"upper": {"joints": [HINGE | {"motion": {"kind": "steady", "rate": 0.1}}]}}
    swept = {"density": {"of": "body.upper.density", "values": [3e3, 6e3]}}
    question = {"duration": 0.1}
    results = Results.of(studies.run(arm({"upper": LINK}, frames, sensor=sensors, question=question, sweep=swept)))
    top = largest(results, sizes(results, "tip_6"))
    assert top is not None
    tips = list(sensors)[::-1]
    figure = _of_tips(view(results, at=top), tips, (None, None), top)
    assert len(figure.drawing.axes) == MOST_TIPS and "2 more sensors in the archive." in figure.caption
    figure = _of_tips(view(results, at=top), tips[:3], (None, None), top)
    assert len(figure.drawing.axes) == MOST_TIPS and "more sensor" not in figure.caption
