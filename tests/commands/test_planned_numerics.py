"""The table of `check` that tells what variants are computed with, and what a second of measuring forecasts."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from engine.accuracy.groups import MarchGroup
from engine.batch.execution import run_jobs
from engine.batch.plan import Plan, make_plan
from results_schema.status import Fidelity
from studies.commands import forecast as forecasts
from studies.commands.forecast import forecast
from studies.commands.planned_numerics import HEADINGS, chosen, rows
from studies.commands.preview import preview
from studies.results.formatting import scientific
from tests.engine.build import beam, cruise, mass, study

SPEEDS = {"of": "carriage.car.motion.speed", "from": 1e-3, "to": 1.0, "count": 60, "spacing": "log"}
MASSES = {"of": "carriage.car.mass", "from": 0.01, "to": 0.1, "count": 6}
COLUMN = {name: place for place, name in enumerate(HEADINGS)}


def planned(bed: dict[str, Any], sweep: dict[str, Any], **solver: Any) -> Plan:
    moving = mass(0.1, cruise(0.0, 1.0, 0.1))
    return make_plan(study(bed | {"damping_ratio": 0.02}, moving, sweep=sweep, solver=solver))


@pytest.fixture(scope="module")
def plan() -> Plan:
    """A plan of many variants with its choice, by a few pilots."""
    found = planned(beam(modes="auto"), {"speed": SPEEDS, "mass": MASSES}, tolerance=1e-2)
    found.choose(lambda jobs: run_jobs(jobs, 1), lambda: False, 32)
    return found


def column(table: list[tuple[str, ...]], name: str) -> list[str]:
    return [row[COLUMN[name]] for row in table]


def test_every_variant_is_in_one_row_of_its_model_modes_and_scheme(plan: Plan) -> None:
    table = rows(chosen(plan))
    assert sum(int(count.replace(",", "")) for count in column(table, "variants")) == 360
    kinds = set(zip(*(column(table, name) for name in ("model", "modes", "scheme")), strict=True))
    assert len(kinds) == len(table) > 2
    assert table[0][COLUMN["model"]] == "statics" and table[-1][COLUMN["model"]] == "moving mass"
    assert table[0][COLUMN["modes"]] == table[0][COLUMN["steps"]] == table[0][COLUMN["modes x steps"]] == "none"
    shares = [float(share.removesuffix(" %")) for share in column(table, "share")]
    assert abs(sum(shares) - 100.0) < 2.0


def test_rows_tell_the_range_of_steps_and_the_largest_error(plan: Plan) -> None:
    assert plan.choice is not None
    groups = [group for group in plan.groups if isinstance(group, MarchGroup)]
    held = [place for place, result in enumerate(plan.choice.results) if np.isfinite(result.tolerance)]
    compared = 0
    for row in rows(chosen(plan)):
        own = [group for group in groups if group.model.fidelity is Fidelity.MASS]
        own = [group for group in own if str(group.model.body_modes) == row[COLUMN["modes"]]]
        own = [group for group in own if group.model.scheme.name == row[COLUMN["scheme"]]]
        if row[COLUMN["model"]] != "moving mass":
            continue
        for name, values in (("steps", [g.steps for g in own]), ("modes x steps", [g.work for g in own])):
            ends = [int(text.replace(",", "")) for text in re.findall(r"[\d,]+", row[COLUMN[name]])]
            assert (ends[0], ends[-1]) == (min(values), max(values))
        variants = np.concatenate([group.variants for group in own])
        largest = np.max(plan.choice.errors(variants)[held], axis=0)
        assert row[COLUMN["estimated error"]].split(",")[0] == scientific(float(np.nanmax(largest)))
        compared += 1
    assert compared


def test_what_the_study_fixes_is_one_row() -> None:
    found = planned(beam(modes=5), {"speed": SPEEDS, "mass": MASSES}, steps=1200, fidelity="mass")
    found.choose(lambda jobs: run_jobs(jobs, 1), lambda: False, 16)
    (row,) = rows(chosen(found))
    assert row[COLUMN["modes"]] == "5" and row[COLUMN["steps"]] == "1,200" and row[COLUMN["share"]] == "100 %"
    assert row[COLUMN["modes x steps"]] == "6,000"


@pytest.mark.parametrize("sweep", [{"speed": SPEEDS}, {"speed": SPEEDS, "mass": MASSES}])
def test_check_shows_what_some_variants_converged_with(sweep: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forecasts, "SECONDS", 1e9)
    monkeypatch.setattr(forecasts, "ROUNDS", ())
    found = planned(beam(modes="auto"), sweep, tolerance=1e-2)
    seen = forecast(found, 1)
    assert seen.title.startswith("What 8 variants converged with") and seen.seconds > 0.0
    assert sum(int(count) for count in column(list(seen.rows), "variants")) == 8
    (table,) = (table for table in preview(found, 1).tables if table.title == seen.title)
    assert [row[:6] for row in table.rows] == [row[:6] for row in seen.rows] and tuple(table.headings) == HEADINGS
    assert (seen.remark == "") == found.converges


def test_pilots_are_measured_where_there_is_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forecasts, "SECONDS", 1e9)
    monkeypatch.setattr(forecasts, "ROUNDS", (16, 24))
    seen = forecast(planned(beam(modes="auto"), {"speed": SPEEDS, "mass": MASSES}, tolerance=1e-2), 1)
    assert "24 pilots" in seen.title and seen.remark == "" and seen.plan.choice is not None
    assert sum(int(count) for count in column(list(seen.rows), "variants")) == 360


@pytest.mark.parametrize("sweep", [{"speed": SPEEDS}, {"speed": SPEEDS, "mass": MASSES}])
def test_what_a_second_was_not_enough_for_is_said(sweep: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forecasts, "SECONDS", -1.0)
    shown = preview(planned(beam(modes="auto"), sweep), 1)
    assert not any(tuple(table.headings) == HEADINGS for table in shown.tables)
    assert "a second was not enough" in shown.remarks[-1]
