"""The table of `check` that tells what a plan chose."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from engine.plan import Plan, make_plan
from results_schema.status import Fidelity
from studies.chosen import HEADINGS, choices
from studies.preview import CHOSEN, preview
from studies.words import scientific
from tests.engine.build import beam, cruise, mass, study

SPEEDS = {"of": "carriage.car.motion.speed", "from": 1e-3, "to": 1.0, "count": 60, "spacing": "log"}
COLUMN = {name: place for place, name in enumerate(HEADINGS)}


def planned(bed: dict[str, Any], **solver: Any) -> Plan:
    moving = mass(0.1, cruise(0.0, 1.0, 0.1))
    return make_plan(study(bed | {"damping_ratio": 0.02}, moving, sweep={"speed": SPEEDS}, solver=solver))


def column(rows: list[tuple[str, ...]], name: str) -> list[str]:
    return [row[COLUMN[name]] for row in rows]


def test_every_variant_is_in_one_row_of_its_model_and_modes() -> None:
    plan = planned(beam(modes="auto"), tolerance=1e-2)
    rows = choices(plan)
    assert sum(int(count.replace(",", "")) for count in column(rows, "variants")) == 60
    assert len(set(zip(column(rows, "model"), column(rows, "modes"), strict=True))) == len(rows) > 2
    assert rows[0][COLUMN["model"]] == "statics" and rows[-1][COLUMN["model"]] == "moving mass"
    assert rows[0][COLUMN["modes"]] == rows[0][COLUMN["steps"]] == "none" and rows[0][COLUMN["cost"]] == "0 %"
    shares = [float(share.removesuffix(" %")) for share in column(rows, "share")]
    assert abs(sum(shares) - 100.0) < 2.0


def test_rows_tell_the_range_of_steps_and_the_largest_error() -> None:
    plan = planned(beam(modes="auto"), tolerance=1e-2)
    for row in choices(plan):
        own = [
            bucket
            for bucket in plan.buckets
            if bucket.scene.fidelity is not Fidelity.STATIC and str(bucket.scene.body_modes) == row[COLUMN["modes"]]
        ]
        if row[COLUMN["model"]] != "moving mass":
            continue
        own = [bucket for bucket in own if bucket.scene.fidelity is Fidelity.MASS]
        steps = [int(text.replace(",", "")) for text in re.findall(r"[\d,]+", row[COLUMN["steps"]])]
        assert (steps[0], steps[-1]) == (min(b.steps for b in own), max(b.steps for b in own))
        told = [bucket.told for bucket in own]
        largest = max(float(np.max(t.error_fidelity + t.error_modes + t.error_steps)) for t in told)
        assert row[COLUMN["expected error"]] == scientific(largest)
        took, full = (sum(float(np.sum(part)) for part in parts) for parts in _costs(own))
        assert float(row[COLUMN["cost"]].removesuffix(" %")) == float(f"{100 * took / full:.2g}")


def _costs(buckets: list[Any]) -> tuple[list[Any], list[Any]]:
    return [bucket.cost * np.ones(bucket.variants.size) for bucket in buckets], [b.full_cost for b in buckets]


def test_what_the_study_fixes_is_one_row() -> None:
    (row,) = choices(planned(beam(modes=5), steps=1200, fidelity="mass"))
    assert row[COLUMN["modes"]] == "5" and row[COLUMN["steps"]] == "1,200" and row[COLUMN["share"]] == "100 %"
    assert row[COLUMN["steps decided by"]] == "as the study says"


def test_check_shows_the_table() -> None:
    plan = planned(beam(modes="auto"), tolerance=1e-2)
    (table,) = (table for table in preview(plan, 1).tables if table.title == CHOSEN)
    assert list(table.rows) == choices(plan) and tuple(table.headings) == HEADINGS
