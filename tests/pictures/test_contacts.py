"""Contact forces of several carriages in one figure of a passage."""

from __future__ import annotations

import numpy as np
import pytest

from studies.pictures.common.figures import Figure
from studies.pictures.passage import pictures
from studies.results.results import Results
from tests.findings.test_answers import FOLLOWER
from tests.studies import scenes

PACE = scenes.pace("passage", 2, 40, 8)


def contacts(sweep: str, extra: str) -> tuple[Results, list[Figure]]:
    results = Results.of(scenes.run("passage", sweep, extra=extra))
    return results, [figure for figure in pictures(results) if figure.name.startswith("contact")]


def least(results: Results, name: str) -> np.ndarray:
    mass = results.parameter(f"carriage.{name}.mass")
    return np.asarray(results.dataset[f"{name}_contact_force_min"] / (mass * results.parameter("gravity")))


def test_each_carriage_has_a_curve() -> None:
    results, (figure,) = contacts(PACE, FOLLOWER)
    assert figure.name == "contact" and figure.title.startswith("2 carriages keep their contact, with at")
    axes = figure.drawing.axes[0]
    drawn = {line.get_label(): line.get_ydata() for line in axes.lines if not line.get_label().startswith("_")}
    for name in ("table", "second"):
        np.testing.assert_allclose(drawn[name], least(results, name))
    legend = axes.get_legend()
    assert legend is not None and [text.get_text() for text in legend.get_texts()] == ["table", "second"]


def test_a_map_shows_the_smallest_of_all() -> None:
    masses = 'mass = { of = "carriage.table.mass", from = 50, to = 400, count = 7 }'
    results, (figure,) = contacts(f"{PACE}\n{masses}", FOLLOWER)
    assert "Of 2 carriages the smallest." in figure.caption
    assert figure.title.startswith("The first of 2 carriages would lift off from")
    (mesh,) = figure.drawing.axes[0].collections[:1]
    both = np.fmin(least(results, "table"), np.broadcast_to(least(results, "second"), (8, 7)))
    assert float(np.nanmin(mesh.get_array())) == pytest.approx(float(np.nanmin(both)))
    assert float(np.nanmax(mesh.get_array())) == pytest.approx(float(np.nanmax(both)))


def test_one_carriage_is_named() -> None:
    _, (figure,) = contacts(PACE, "")
    assert figure.name == "contact-table" and figure.title.startswith("table keeps its contact, with at least")
    assert "carriages" not in figure.caption
