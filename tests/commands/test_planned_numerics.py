"""The table of `check` that tells what variants are computed with, and what some seconds of measuring forecast."""

import math
import re
import time
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import scipy.linalg

from engine.accuracy.groups import Found
from engine.accuracy.jobs import InTurn
from engine.accuracy.results import results_of
from engine.batch.audit import audit_seconds, audited
from engine.batch.plan import Plan, make_plan
from engine.scene.study import Study
from studies.commands import forecast as forecasting
from studies.commands.forecast import forecast
from studies.commands.planned_numerics import HEADINGS, chosen, converged, rows, told_missed
from studies.commands.preview import preview
from studies.protocol.study import kind_of
from studies.results.formatting import quantity
from tests.engine.build import beam, cruise, force, mass, oscillator, study

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
    found.choose(InTurn(), 32)
    return found


def standing(given: Study) -> list[tuple[str, ...]]:
    """What `check` says of the first carriage where it stands."""
    tables = preview(kind_of(given).parts(given), 1).tables
    return [row for table in tables if table.title.startswith("Where the first") for row in table.rows]


def test_where_the_first_carriage_stands() -> None:
    """W L^3/(48 E I) under it in the middle; by Rayleigh pi^2/sqrt(1 + 2 m), over the supports pi^2, and so its damping
    ratio."""
    way = {"kind": "point-to-point", "start": 0.0, "end": 1.0, "speed": 0.1, "acceleration": 1.0}
    solver = {"steps": 2000, "audit": 0}
    bed = beam(modes=12, damping_ratio=0.02)
    ((car, sag, frequencies, damping),) = standing(study(bed, mass(0.1, way), gravity=4.8, solver=solver))
    assert car == "car" and sag == f"up to {quantity(0.01, 'm')}, at {quantity(0.5, 'm')}"
    low, _, high = frequencies.removesuffix(" Hz").partition(" to ")
    assert float(low) == pytest.approx(0.5 * math.pi / math.sqrt(1.2), rel=1e-2)
    assert float(high) == pytest.approx(0.5 * math.pi, rel=1e-2)
    assert [float(end) for end in damping.split(" to ")] == pytest.approx([0.02 / math.sqrt(1.2), 0.02], rel=1e-2)
    ((*_, damping),) = standing(study(bed, oscillator(0.3, 9.0, way), gravity=4.8, solver=solver))
    stiffness = np.array([[math.pi**4 + 18.0, -9.0 * math.sqrt(2.0)], [-9.0 * math.sqrt(2.0), 9.0]])
    square, shapes = scipy.linalg.eigh(stiffness, np.diag([1.0, 0.3]))  # of the first mode alone, in the middle
    ratio = 0.02 * math.pi**2 * shapes[0, 0] ** 2 / math.sqrt(square[0])
    assert [float(end) for end in damping.split(" to ")] == pytest.approx([0.0, ratio], rel=3e-2, abs=1e-12)


def test_what_moves_away_stands_nowhere() -> None:
    way = cruise(0.0, 1.0, 0.5)
    assert standing(study(beam(supports="free-free"), mass(0.1, way), solver={"steps": 2000, "audit": 0})) == []


def column(table: list[tuple[str, ...]], name: str) -> list[str]:
    return [row[COLUMN[name]] for row in table]


def test_every_variant_is_in_one_row_of_its_model_modes_and_scheme(plan: Plan) -> None:
    table = rows(plan, chosen(plan))
    assert sum(int(count.replace(",", "")) for count in column(table, "variants")) == 360
    kinds = set(zip(*(column(table, name) for name in ("model", "modes", "scheme")), strict=True))
    assert len(kinds) == len(table) > 2
    assert table[0][COLUMN["model"]] == "statics" and table[-1][COLUMN["model"]] == "moving mass"
    assert table[0][COLUMN["modes"]] == table[0][COLUMN["steps"]] == "none"


def test_what_the_study_fixes_is_one_row() -> None:
    found = planned(beam(modes=5), {"speed": SPEEDS, "mass": MASSES}, steps=1200, fidelity="mass")
    found.choose(InTurn(), 16)
    (row,) = rows(found, chosen(found))
    assert row[COLUMN["modes"]] == "5" and row[COLUMN["steps"]] == "1,200"


def test_errors_are_told_beside_the_tolerance_of_the_same_result() -> None:
    """The largest error was told beside that over its tolerance of another result: 2.4e-2 beside 12 of 1e-3."""
    swept = {"speed": {"of": SPEEDS["of"], "from": 0.1, "to": 1.0, "count": 20}}
    sensors = {
        "tight": {"body": "bed", "at": 0.5, "tolerance": 1e-3},
        "loose": {"body": "bed", "at": 0.3, "quantity": "acceleration", "tolerance": 0.5},
    }
    found = make_plan(study(beam(), mass(0.1, cruise(0.0, 1.0, 0.1)), sensor=sensors, sweep=swept))
    names = [result.name for result in results_of(found.asked)]
    error = np.zeros((len(names), 2))
    error[names.index("tight_max")], error[names.index("loose_max")] = (1e-4, 5e-3), (2e-2, 1e-2)
    told = {"fidelity_used": 3, "modes_used": 4, "scheme_used": 0, "steps_used": 100}
    used = {name: np.full(2, value) for name, value in told.items()}
    known = Found(None, used, error, np.array([0.1, 5.0]))  # type: ignore[arg-type]
    parts = list(converged(found, known, np.array([1.0, 1.0])))
    assert rows(found, parts[:1]) == [("1", "moving mass", "4", "average-acceleration", "100", "1e-4", "1e-3")]
    assert rows(found, parts)[0][-2:] == ("5e-3", "1e-3")
    missed = told_missed(found, parts)
    assert told_missed(found, parts[:1]) == "" and "5e-3 where 1e-3 is asked, for tight_max" in missed
    assert missed.endswith("or tolerance = 0.01 on sensor tight")
    unknown = [part._replace(error=np.full_like(part.error, np.nan)) for part in parts]
    assert rows(found, unknown)[0][-2:] == ("unknown", "") and told_missed(found, unknown) == ""


def test_tolerances_that_nothing_holds_are_remarked() -> None:
    """An acceleration under a force that comes at an instant, to which every mode adds; where it is told nothing is
    missed."""
    moving = force(1.0, cruise(0.3, 1.0, 0.1))
    sensor = {"body": "bed", "at": 0.5, "quantity": "acceleration", "tolerance": 1e-4}
    for own, words in (
        (1e-4, "(?s)2 of 2 variants looked at would miss .* 1e-4 is asked.*on sensor mid"),
        ("told", ""),
    ):
        sweep = {"speed": {"of": SPEEDS["of"], "values": [0.3, 0.6]}}
        found = study(
            beam(modes="auto", damping_ratio=0.02), moving, sensor={"mid": sensor | {"tolerance": own}}, sweep=sweep
        )
        seen = forecast(make_plan(found), 1, 1e9, ())
        assert re.search(words, seen.remark) and bool(seen.remark) == bool(words)
        assert [row[COLUMN["asked"]] for row in seen.rows] == (["1e-4"] if words else ["nothing"])


def test_some_variants_are_told_with_what_they_converged() -> None:
    seen = forecast(planned(beam(modes="auto"), {"speed": SPEEDS}, tolerance=1e-2), 1, 1e9, ())
    assert seen.title.startswith("What 60 variants converged with") and seen.seconds > 0.0
    assert sum(int(count) for count in column(list(seen.rows), "variants")) == 60
    assert seen.remark == "" and seen.plan.converges


def test_compiling_kernels_is_no_part_of_what_is_forecast() -> None:
    """Of a first `check`, which compiled for half a minute, 1.9 min were told of a run of 17 s."""
    sweep, compiled = {"speed": SPEEDS}, 3600.0
    found = [
        forecast(planned(beam(modes="auto"), sweep, tolerance=1e-2), 1, 1e9, (), compiled=seconds).seconds
        for seconds in (time.process_time() - 1.0, 0.0)
    ]
    assert 0.0 < found[0] < found[1] < compiled


def test_pilots_are_measured_where_there_is_time() -> None:
    sweep = {"speed": SPEEDS, "mass": MASSES}
    seen = forecast(planned(beam(modes="auto"), sweep, tolerance=1e-2), 1, 1e9, (16, 24))
    assert "24 pilots" in seen.title and seen.remark == "" and seen.plan.choice is not None
    assert sum(int(count) for count in column(list(seen.rows), "variants")) == 360


@pytest.mark.parametrize(
    ("sweep", "words"),
    [
        ({"speed": SPEEDS}, "seconds were not enough for a variant to converge"),
        ({"speed": SPEEDS, "mass": MASSES}, "there was no time for pilots"),
    ],
)
def test_what_there_was_no_time_for_is_said(sweep: dict[str, Any], words: str) -> None:
    seen = forecast(planned(beam(modes="auto"), sweep), 1, -1.0, patience=-1.0)
    assert not seen.rows and words in seen.remark


def test_of_several_scenes_a_few_pilots_are_measured_with_more_patience() -> None:
    """Four of 40 scenes, which the title says; what all pilots take is told by these."""
    lengths = {"of": "body.bed.length", "from": 1.0, "to": 2.0, "count": 40}
    found = planned(beam(modes="auto"), {"length": lengths, "speed": SPEEDS | {"count": 30}}, tolerance=1e-2)
    seen = forecast(found, 1, -1.0)
    assert "4 pilots; a run measures 128 and knows better" in seen.title and seen.remark == ""
    assert (
        seen.seconds > 0.0 and sum(int(count.replace(",", "")) for count in column(list(seen.rows), "variants")) == 1200
    )
    hurried = forecast(found, 1, -1.0, patience=-1.0)
    assert "there was no time for pilots" in hurried.remark


@pytest.mark.parametrize(("lengths", "more"), [(1, 1), (40, 16)])
def test_pilots_that_are_broken_off_tell_of_those_of_all(lengths: int, more: int) -> None:
    """Of 40 scenes 128 pilots are of 16, the first four of one."""
    axis = {"of": "body.bed.length", "from": 1.0, "to": 2.0, "count": 40}
    sweep = {"length": axis, "speed": SPEEDS | {"count": 30}} if lengths > 1 else {"speed": SPEEDS, "mass": MASSES}
    seen = forecasting._without_pilots(planned(beam(modes="auto"), sweep), 2.0, 1)
    assert seen.seconds == forecasting.BROKEN_OFF * 2.0 * more


def test_so_many_steps_that_nothing_ends_in_time_are_told_by_what_they_are() -> None:
    """Not by the time after which the first of them were broken off: 28 s of a thousand times 1e8 steps."""
    sweep = {"speed": SPEEDS, "mass": MASSES}
    few, many = (planned(beam(modes=8), sweep, steps=steps) for steps in (4000, 10_000_000))
    seen = [forecasting._without_pilots(one, 0.01, 2).seconds for one in (few, many)]
    assert seen[1] >= many.seconds / 2.0 > 10.0 > 100.0 * seen[0]


def test_the_audit_of_what_pilots_tell_is_forecast(plan: Plan) -> None:
    """More variants take longer, none take nothing."""
    own = plan.study.solver.audit
    assert own == "auto" and audited(plan) == 16
    seconds = []
    for count in (0, 16, 64):
        other = planned(beam(modes="auto"), {"speed": SPEEDS, "mass": MASSES}, tolerance=1e-2, audit=count)
        other.choice = plan.choice
        seconds.append(audit_seconds(other))
    assert seconds[0] == 0.0 < seconds[1] < seconds[2] and seconds[1] == audit_seconds(plan)


def test_a_mass_on_its_damper_over_a_stiff_beam_is_damped_as_by_itself() -> None:
    """0.25, beside next to nothing of the beam's own 2 %."""
    mass_, stiffness = 0.1, 1e-3
    car = oscillator(mass_, stiffness, cruise(0.3, 0.7, 0.1), damping=0.5 * math.sqrt(stiffness * mass_))
    given = study(beam(damping_ratio=0.02), car)
    tables = {table.title: table for table in preview(kind_of(given).parts(given), 1).tables}
    alone, standing = tables["Sprung masses by themselves"], tables["Where the first carriage stands"]
    assert alone.rows[0][2] == "0.25"
    assert standing.rows[0][standing.headings.index("its damping ratio")] == "0.25"


def test_the_shortest_march_is_not_taken_for_a_slow_processor() -> None:
    """Of 0.02 s for a march that should take a microsecond nearly all is what any march takes."""
    told = iter([0.0, 0.05, 0.05, 0.07])
    group = SimpleNamespace(variants=np.arange(1), seconds_per_variant=1e-6, found=lambda *_: None)
    pace, least = forecasting._pace(
        cast(Any, SimpleNamespace(values=lambda *_: None, choice=None)), cast(Any, group), lambda: next(told)
    )
    assert pace == forecasting.SLOWEST
    assert least == pytest.approx(0.03 + 0.02 - pace * 1e-6)
