"""The table of simpler models that `check` shows."""

from __future__ import annotations

from typing import Any

import numpy as np

from engine.ladder import ladder
from engine.plan import make_plan
from engine.scene import Study
from studies.choices import NAMES
from studies.preview import SIMPLER, Table, preview
from studies.simpler import MOST_SCENES, _looked_at
from tests.engine.build import beam, cruise, mass, study


def swept(axis: dict[str, Any], **solver: Any) -> Study:
    return study(beam(), mass(0.1, cruise(0.0, 1.0, 0.1)), sweep={"axis": axis}, solver=solver)


def shown(given: Study) -> list[Table]:
    return [table for table in preview(make_plan(given), 1).tables if table.title == SIMPLER]


SPEEDS = {"of": "carriage.car.motion.speed", "from": 1e-3, "to": 1.0, "count": 50, "spacing": "log"}


def test_rows_tell_errors_share_and_cost() -> None:
    given = swept(SPEEDS, tolerance=1e-2)
    plan = make_plan(given)
    (table,) = shown(given)
    assert [row[0] for row in table.rows] == ["statics", "moving force", "moving mass without convective terms"]
    rungs = ladder(plan.base, plan.values(plan.buckets[0], np.arange(plan.size)))
    for row, rung in zip(table.rows, rungs[:-1], strict=True):
        assert row[0] == NAMES[rung.fidelity]
        assert row[2] == f"{100 * float(np.mean(rung.error <= 1e-2)):g} %"
    assert 0 < float(table.rows[0][2].split()[0]) < 100
    assert [row[3] for row in table.rows] == ["0", "1", "1"]


def test_a_tighter_tolerance_admits_no_more() -> None:
    shares = [float(shown(swept(SPEEDS, tolerance=t))[0].rows[0][2].split()[0]) for t in (1e-1, 1e-2, 1e-3, 1e-4)]
    assert shares == sorted(shares, reverse=True) and shares[0] > shares[-1]


def test_useless_models_are_called_so() -> None:
    (table,) = shown(swept({"of": "carriage.car.motion.speed", "values": [2.5]}))
    assert table.rows[0][1] == "more than 1"


def test_of_many_scenes_some_are_looked_at() -> None:
    plan = make_plan(swept({"of": "body.bed.length", "from": 1.0, "to": 2.0, "count": 40}))
    looked = list(_looked_at(plan))
    assert len(looked) == MOST_SCENES
    lengths = [scene.leading_body.modal.length for scene, _ in looked]
    assert min(lengths) == 1.0 and max(lengths) == 2.0


def test_who_chose_a_model_is_told_nothing() -> None:
    assert shown(swept(SPEEDS, fidelity="force")) == []
    assert len(shown(swept(SPEEDS, fidelity="static"))) == 1
