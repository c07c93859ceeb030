"""What is looked for of results, side by side for the few values of a swept number, beside a march of each alone."""

from __future__ import annotations

import numpy as np
import pytest

import studies
from studies.protocol.parts import TextTable
from studies.reporting import answers
from studies.reporting.side_by_side import side_by_side
from studies.reporting.summary import in_tables
from studies.results.formatting import quantity
from studies.results.results import Results
from tests.studies import scenes

PACE = 'pace = { of = "carriage.table.motion.speed", from = 1, to = 5, count = 5 }'
MASS = 'mass = { of = "carriage.table.mass", values = [200, 50, 100] }'
WAY = 'way = { of = "carriage.table.motion.direction", values = ["backward", "forward"] }'
EXTRA = '[sensor.quarter]\nbody = "bed"\nat = 2.5'


def beside(*sweep: str) -> tuple[Results, TextTable]:
    results = Results.of(scenes.run("passage", "\n".join(sweep), extra=EXTRA))
    found = side_by_side(results, in_tables(results))
    assert found is not None
    return results, found


def test_the_largest_stand_side_by_side_with_where_they_are() -> None:
    """At which speed a bridge swings most at each mass took a study of its own."""
    results, found = beside(PACE, MASS)
    assert found.headings == ("result", "mass 50 kg", "mass 100 kg", "mass 200 kg")
    assert found.title == "Largest for each mass (of what ends in _min the smallest), and at which pace"
    rows = {row[0]: row[1:] for row in found.rows}
    for name, most in (("midspan_max", np.argmax), ("quarter_max", np.argmax), ("midspan_min", np.argmin)):
        lines = results.dataset[name].transpose("mass", "pace").values[[1, 2, 0]]
        largest = float(np.abs(results.dataset["midspan_max"]).max())
        told = [quantity(float(line[most(line)]), "m", beside=largest) for line in lines]
        pace = results.dataset["pace"].values
        assert all(cell.startswith(value) for cell, value in zip(rows[name], told, strict=True))
        ends = [f" at {quantity(float(pace[most(line)]), 'm s-1')}" for line in lines]
        assert rows[name] == tuple(value + end for value, end in zip(told, ends, strict=True))


def test_a_direction_stands_side_by_side_forward_first() -> None:
    results, found = beside(PACE, MASS, WAY)
    assert found.headings == ("result", "forward", "backward") and found.title.endswith("at which pace and mass")
    (row,) = (row for row in found.rows if row[0] == "quarter_max")
    for cell, way in zip(row[1:], (1.0, -1.0), strict=True):
        own = results.dataset["quarter_max"].sel(way=way)
        assert cell.startswith(f"{quantity(float(own.max()), 'm')} at ") and cell.endswith(", 200 kg")


def test_the_number_that_changes_results_most_stands_side_by_side() -> None:
    """Of two with few values; where a sensor reads changes nothing but that one."""
    place = 'place = { of = "sensor.quarter.at", values = [2.4, 2.5] }'
    _, found = beside(PACE, place, MASS)
    assert found.headings[1] == "mass 50 kg" and found.title.endswith("at which pace and place")


@pytest.mark.parametrize("sweep", [(PACE,), (MASS,), ("zip = true", MASS, WAY.replace("]", ', "forward"]'))])
def test_nothing_stands_side_by_side_where_there_are_no_few_values(sweep: tuple[str, ...]) -> None:
    results = Results.of(scenes.run("passage", "\n".join(sweep)))
    assert side_by_side(results, in_tables(results)) is None


def test_what_no_variant_of_a_column_has_is_left_blank() -> None:
    results, _ = beside(PACE, MASS)
    lost = results.dataset["midspan_max"].where(results.dataset["mass"] > 50.0)
    part = Results(results.dataset.assign(midspan_max=lost), results.study)
    found = side_by_side(part, in_tables(part))
    assert found is not None
    (row,) = (row for row in found.rows if row[0] == "midspan_max")
    assert row[1] == "" and all(row[2:])


def test_contact_forces_of_few_values_are_curves() -> None:
    """A direction was drawn as a map from -2 to 2."""
    pace = PACE.replace("to = 5", "to = 30")
    own = {"carriage.table.mass": 600.0, "body.bed.supports": "clamped-pinned"}
    both = studies.run(scenes.study("passage", f"{pace}\n{WAY}").with_values(own))
    results = Results.of(both)
    (figure,) = (one for one in answers.figures(both) if one.name.startswith("contact"))
    (axes,) = (one for one in figure.drawing.axes if "contact force" in one.get_ylabel())
    force = results.dataset["table_contact_force_min"] / (600.0 * 9.80665)
    drawn = {line.get_label(): np.asarray(line.get_ydata()) for line in axes.lines}
    for value, name in ((1.0, "forward"), (-1.0, "backward")):
        np.testing.assert_allclose(drawn[name], force.sel(way=value), rtol=1e-6)
