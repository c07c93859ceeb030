"""Tables of segments: built when they are needed, once for every march where they are too large to be kept."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest

import engine.march.tables as tables
from engine.accuracy.groups import Group
from engine.batch.plan import make_plan
from engine.march.outcome import Outcome, outcome
from engine.scene.study import Study
from tests.engine.build import beam, cruise, mass, oscillator, shuttle, study, under

ONE = mass(0.3, shuttle(0.1, 0.9, 1.0, 0.1, 2))
TWO = {"car": ONE, "next": oscillator(0.1, 50.0, cruise(0.0, 1.0, 0.4))}


def marched(given: Study, kept_bytes: int) -> tuple[Group, Outcome]:
    """The only group of a study, marched as the study says with so much room for tables."""
    plan = make_plan(given)
    (group,) = plan.groups
    own, stations = group.tables, group.grid.stations(group.scene, 1)
    own.kept_bytes = kept_bytes
    return group, outcome(plan.asked, own, plan.values(group, group.variants), stations)


@pytest.mark.parametrize("scheme", ["average-acceleration", "richardson"])
@pytest.mark.parametrize("carriages", [ONE, TWO], ids=["one", "two"])
def test_tables_that_are_not_kept_are_built_once(carriages: Any, scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As often as there are segments of a march, which is the same to the last bit."""
    solver = {"steps": 1000, "scheme": scheme}
    given = study(beam(modes=2), carriages, sensor={"below": under("car")}, solver=solver)
    group, kept = marched(given, tables.KEPT_BYTES)
    monkeypatch.setattr(tables, "KEPT_BYTES", 0)
    built, real = Counter[tuple[int, int]](), tables.tabulate_ties

    def counted(model: Any, along: Any, *others: Any) -> Any:
        built[model.body_modes, along[0].s.size] += 1
        return real(model, along, *others)

    monkeypatch.setattr(tables, "tabulate_ties", counted)
    _, again = marched(given, 0)
    wanted = Counter((group.scene.body_modes, segment.steps + 1) for segment in group.tables.timeline.segments)
    assert {size: built[size] for size in wanted} == wanted
    np.testing.assert_array_equal(again.history, kept.history)
    for name, array in kept.numbers.items():
        np.testing.assert_array_equal(again.numbers[name], array)
