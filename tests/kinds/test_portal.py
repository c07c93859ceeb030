"""Studies of robots on rails: from the study file to the dataset and its sentences."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import studies
from engine.robots.converge import Ladder, Rung, by_fixed, converge, marched
from engine.robots.results import (
    OF_DRIVES,
    are_held,
    are_largest,
    are_of_drives,
    by_drives,
    differences,
    handled,
    of_histories,
    results_of,
    works,
)
from engine.scene.study import Study
from engine.scene.sweep import expand
from results_schema.errors import BadInput
from results_schema.status import Status
from studies.pictures.portal import pictures
from studies.protocol.study import kind_of
from studies.reporting.comparison import compared
from studies.reporting.summary import asked
from studies.reporting.tabulated import table_of
from studies.results.results import Results
from studies.robots.findings import front, of_front
from tests.robots.scenes import FOX_GOODWIN, GANTRY, rail, scene
from tests.robots.scenes import marched as by_steps

SWEPT = {
    "acceleration": {"of": ["robot.portal.acceleration_scale"], "values": [0.5, 1.0, 3.0]},
    "payload": {"of": ["robot.portal.payload_scale"], "values": [0.0, 2.0]},
}
SCALES = ("acceleration_scale", "speed_scale")


def swept(**more: Any) -> Study:
    question = {"after": 0.5, "one_at_a_time": True, "mode_counts": [2, 4, 12]}
    return scene(solver={"tolerance": 1e-2}, sweep=SWEPT, question=question, **more)


@pytest.fixture(scope="module")
def found() -> Any:
    return studies.run(swept(), threads=2)


@pytest.mark.fault(20)
def test_a_sweep_has_every_variant_as_it_is_alone(found: Any) -> None:
    study = swept()
    cases = expand(study)
    assert found["error_moving"].dims == ("acceleration", "payload", "robot")
    assert (found["status"] == Status.OK).all()  # without what its fixed modes leave, all are told 1e-2 at most
    assert np.isfinite(found["error_estimate"]).all()
    alone = converge(cases.study_of(study, 4), None, 0.5, "start")
    for name in ("cycle_time", "error_moving", "error_largest", "beyond_rest_working", "deflection_largest"):
        np.testing.assert_array_equal(found[name].values[2, 0], alone.outcome.numbers[name])
    assert (found["cycle_time"].diff("acceleration") < 0.0).all()


def test_errors_are_told_in_units_of_results(found: Any) -> None:
    """Of what tools are off over the longest of all, of deflections over their own."""
    errors, parts = studies.errors(found), found.estimated_error.sel(result="largest error of portal")
    own = errors.error_moving.sel(robot="portal")
    longest = np.fmax(found.error_moving, np.fmax(found.error_working, found.error_holding)).sel(robot="portal")
    known = own.notnull()
    np.testing.assert_allclose(own.values[known], (parts * longest / (1.0 - parts)).values[known], rtol=1e-6)
    assert known.any() and set(errors.data_vars) >= {"error_moving", "error_holding", "deflection_largest"}


@pytest.mark.fault(22)
def test_a_variant_that_falls_over_has_no_values(found: Any) -> None:
    """By a million times its payload, which no joint holds up; results and histories of the others stay."""
    swept = {"payload": {"of": ["robot.portal.payload_scale"], "values": [0.0, 1e6, 2.0]}}
    own = studies.run(scene(solver={"tolerance": 1e-2}, sweep=swept, question={"after": 0.5}))
    assert own["status"].values.tolist() == [Status.OK, Status.FALLS_OVER, Status.OK]
    for name in ("cycle_time", "error_largest", "at_rest", "tool_centre_point_error", "rail_deflection"):
        values, others = own[name].values, found[name].sel(acceleration=1.0).values
        assert np.isnan(values[1]).all() and np.isfinite(others).any(), name
        assert values[[0, 2]].tobytes() == np.ascontiguousarray(others).tobytes(), name


def test_statics_do_for_all_of_the_time_where_robots_crawl(found: Any) -> None:
    assert ((found["at_rest"] > 0.0) & (found["at_rest"] < 0.2)).all()
    crawling = {f"robot.{name}.{key}": 1e-3 for name in ("portal", "hanging") for key in SCALES}
    alone = converge(scene(solver={"tolerance": 1e-2}).with_values(crawling), 2.0, 0.0, "unloaded")
    np.testing.assert_allclose(alone.outcome.numbers["at_rest"], 1.0)


@pytest.mark.parametrize("modes", [6, "auto"])
def test_estimated_errors_are_no_smaller_than_true_ones(modes: int | str) -> None:
    """Against a march with eight times the steps and all modes of the rails."""
    study = swept()
    cases = expand(study)
    for variant in (1, 4):
        own = cases.study_of(study, variant).with_values({f"body.{name}.modes": modes for name in study.body})
        found = converge(own, None, 0.5, "start")
        whole = own.with_values({f"body.{name}.modes": 64 for name in study.body})
        finest = Ladder.of(whole, None, 0.5).level(Rung(0, found.rung.steps + 3))
        exact, names = marched(finest, "start"), results_of(found.model)
        held, drives = are_held(names), are_of_drives(names)
        true_of_all = differences(found.model, found.outcome, exact)
        true = true_of_all[held]
        assert (true <= found.error[held]).all() and found.status == Status.OK and (true > 1e-5).all()
        largest = are_largest(names)
        assert (true_of_all[largest] <= found.error[largest]).all() and (true_of_all[largest] > 0.0).all()
        assert (found.error[largest] <= found.error[of_histories(names)]).all()
        own_ladder = Ladder.of(own, None, 0.5)
        fixed = by_fixed(own_ladder, marched(own_ladder.level(Rung(0, 0)), "start"), "start")
        assert modes == 6 or (found.error - fixed)[held].max() <= 1e-2  # elements are told and not held
        off = {name: np.abs(found.outcome.numbers[name] - exact.numbers[name]) for name in OF_DRIVES}
        of_drives = by_drives(found.model, off, exact.numbers)
        assert (of_drives <= found.error[drives]).all() and (found.error[drives] < 0.15).all()
        many = own.with_values({f"body.{name}.modes": 20 for name in own.body})
        fuller = marched(Ladder.of(many, None, 0.5).level(Rung(0, found.rung.steps + 3)), "start")
        assert (differences(found.model, found.outcome, fuller)[:2] < 2e-2).all()


def test_a_robot_that_stands_still_leaves_the_others_alone(found: Any) -> None:
    still = found["error_without"]
    assert still.sel(still="portal", robot="portal") < 0.2 * still.sel(still="hanging", robot="portal")
    assert still.sel(still="hanging", robot="portal") > 0.0


def test_answers_and_figures_name_what_the_data_say(found: Any) -> None:
    results = Results.of(found)
    answer = " ".join(kind_of(results.study).findings(results))
    best = of_front(results)
    assert f"{best.size} of 6 variants are best, as none is both faster and nearer to rest at work: " in answer
    assert (
        "While portal stands still" in answer
        and "left goes down by" in answer
        and "stress" not in answer
        and "Statics alone would" in answer
    )
    figures = pictures(results)
    assert [figure.name for figure in figures] == ["front", "errors", "modes", "over-time", "rails", "worst-move"]


def test_numbers_of_modes_change_errors_by_what_marches_with_them_differ(found: Any) -> None:
    study = swept().without_sweep()
    own = converge(study, None, 0.5, "start")
    for count in found["mode_count"].values:
        other = converge(
            study.with_values({f"body.{name}.modes": int(count) for name in study.body}), None, 0.5, "start"
        )
        off = np.linalg.norm(other.outcome.error - own.outcome.error, axis=2).max(axis=0)
        wanted = off / np.linalg.norm(own.outcome.error, axis=2).max(axis=0)
        np.testing.assert_allclose(found["error_by_modes"].sel(mode_count=count), wanted, rtol=0.1, atol=1e-3)
    np.testing.assert_allclose(found["error_by_modes_doubt"], own.error[:2], rtol=1e-6)
    worst = found["error_by_modes"].max("robot").values
    assert worst[0] > 1e-2 > worst[2]
    told = [text for text in kind_of(swept()).findings(Results.of(found)) if "modes of every rail" in text]
    assert len(told) == 1 and told[0].startswith(
        "With 2, 4 and 12 modes of every rail errors of tools are off by up to "
    )
    assert told[0].endswith(f"{4 if worst[1] <= 1e-2 else 12} are enough for 1 %.")


def test_what_moves_at_the_longest_error_is_told_of_every_robot_in_a_sweep(found: Any) -> None:
    answer = kind_of(swept()).findings(Results.of(found))
    told = [text for text in answer if "is longest at" in text]
    assert len(told) == 2 and all("at acceleration" in text and "during move " in text for text in told)


def test_work_and_payloads_are_shown_when_robots_are_told_of_them() -> None:
    study = scene()
    model = Ladder.of(study, None, 0.5).coarsest
    starts = model.system.moves[0, :, 0]
    assert list(handled(model)) == [(0, starts[1], True), (0, starts[2], False)]  # 80 kg, then 10 kg
    holds = [move.hold for robot in study.robot.values() for move in robot.moves if move.process and move.hold]
    assert [way.end - way.start for way in works(model)] == pytest.approx(holds) == [0.3]


def test_every_number_is_told_with_the_variant_that_it_belongs_to(found: Any) -> None:
    own = found.copy(deep=True)
    own["at_rest"][:] = 0.8
    own["error_moving"].loc[{"robot": "portal", "acceleration": 3.0, "payload": 2.0}] = 2.0
    own["error_working"].loc[{"robot": "portal", "acceleration": 0.5, "payload": 0.0}] = 1.0
    own["beyond_rest_working"].loc[{"acceleration": 3.0, "payload": 0.0}] = 0.0
    answer = " ".join(kind_of(swept()).findings(Results.of(own)))
    assert "2 m in moves at acceleration 3, payload 2, and 1 m at work at acceleration 0.5, payload 0; from" in answer
    assert "largest errors for 80 % of the time" in answer and "1 of 6 variants is best" in answer
    own["error_working"].loc[{"robot": "portal", "acceleration": 3.0, "payload": 2.0}] = 1.5
    answer = " ".join(kind_of(swept()).findings(Results.of(own)))
    assert "2 m in moves and 1.5 m at work at acceleration 3, payload 2; from" in answer


def test_drives_are_told_by_what_they_exert_the_most(found: Any) -> None:
    """At every step of a finer march; forces of joints that slide, torques of those that turn."""
    own = expand(swept()).study_of(swept(), 4)
    model, record = by_steps(own, 0.002, float(found["cycle_time"][2, 0]) + 0.5, scheme=FOX_GOODWIN)
    most = np.abs(record.drive).max(axis=0)
    force, torque = (found[f"drive_{what}_largest"].values[2, 0] for what in ("force", "torque"))
    slides = np.array([[True, True, True, False, False], [True, False, False, False, False]])
    there = np.array([[True] * 5, [True] * 3 + [False] * 2])
    assert list(found["joint"].values) == ["rail", "link 1", "link 2", "link 3", "link 4"]
    np.testing.assert_array_equal(np.isfinite(force), slides)
    np.testing.assert_array_equal(np.isfinite(torque), ~slides & there)
    np.testing.assert_allclose(np.where(slides, force, torque)[there], most[there], rtol=2e-2)
    assert (found["drive_force_largest"].sel(robot="portal", joint="link 2") > 9.81 * (120 + 60 + 25)).all()
    told = found["estimated_error"].sel(result=[f"drive {sort} of portal" for sort in ("force", "torque")])
    assert ((told > 0.0) & (told < 0.2)).all() and np.isnan(found["tolerance"].sel(result=told["result"])).all()
    assert model.robots == ("portal", "hanging")


def test_what_linear_rails_leave_out_is_told_where_it_is_more_than_the_tolerance(found: Any) -> None:
    assert ((found["beyond_linear"] > 0.0) & (found["beyond_linear"] < 1e-2)).all()
    assert "grow shorter" not in " ".join(kind_of(swept()).findings(Results.of(found)))
    own = found.copy(deep=True)
    own["beyond_linear"].loc[{"robot": "hanging", "acceleration": 3.0, "payload": 2.0}] = 0.02
    told = [text for text in kind_of(swept()).findings(Results.of(own)) if "grow shorter" in text]
    assert len(told) == 1 and "the error of hanging by up to 2 % at acceleration 3, payload 2, which" in told[0]


def test_the_worst_move_is_played_as_exaggerated_as_its_caption_says(found: Any) -> None:
    """Rails in the SVG element, at the station where a rail is down the most, against the dataset."""
    results = Results.of(found)
    figure = pictures(results)[-1]
    rest = [_points(path) for path in re.findall(r'stroke="#c9ced6"[^>]* d="([^"]*)"', figure.moving)]
    played = [
        np.array([_points(path) for path in values.split(";")])
        for values in re.findall(r'attributeName="d" values="([^"]*)"', figure.moving)
    ]
    assert len(rest) == len(played) == 2 and "<script" not in figure.moving
    times = float(re.findall(r"deflections ([\d,]+) times", figure.caption)[0].replace(",", ""))
    per_metre = np.ptp(rest[0][:, 0]) / 12.0
    sunk = max(float((line - still)[..., 1].max()) for line, still in zip(played, rest, strict=True))
    index = next(i for i in np.ndindex(3, 2) if f"At {results.at(i)}." in pictures(results)[-3].caption)
    down = results.row(found["rail_deflection"], index)
    assert sunk / per_metre / times <= float(down.max()) * 1.02
    assert sunk / per_metre / times >= float(down.max()) * 0.8


def _points(path: str) -> Any:
    return np.array([float(x) for x in re.findall(r"[\d.]+", path)]).reshape(-1, 2)


def test_the_front_is_what_no_point_beats() -> None:
    random = np.random.default_rng(2)
    points = random.integers(0, 12, (200, 2)).astype(float)
    points[3] = np.nan
    chosen = front(points[:, 0], points[:, 1])
    for number, (x, y) in enumerate(points):
        beaten = any((a <= x and b < y) or (a < x and b <= y) for a, b in points)
        assert chosen[number] == (not beaten and number != 3)


def test_errors_count_from_the_start_or_from_unloaded_rails() -> None:
    study = scene(solver={"steps": 200})
    start, unloaded = (converge(study, 1.0, 0.0, zero).outcome for zero in ("start", "unloaded"))
    np.testing.assert_allclose(unloaded.error - unloaded.error[0], start.error, atol=1e-15)
    np.testing.assert_allclose(unloaded.error[0], start.numbers["error_at_start"], atol=1e-15)
    assert np.abs(unloaded.error[0]).max() > 1e-4


def test_open_modes_grow_until_nothing_changes() -> None:
    study = scene({"modes": "auto"}, solver={"tolerance": 2e-2})
    found = converge(study, 1.0, 0.0, "start")
    assert found.status == Status.OK and found.model.modes > 12 and found.rung.modes == 1


def _rail(**more: Any) -> Callable[[], Study]:
    return lambda: scene(body={"left": rail(-3.0) | more, "right": rail(3.0)})


ELSEWHERE = {"node": {"west": [0, -3, 5], "east": [0, 9, 5]}}
BEAM = {
    "kind": "beam",
    "length": 12.0,
    "area": 1.0,
    "second_moment": 1.0,
    "youngs_modulus": 1.0,
    "density": 1.0,
    "supports": "pinned-pinned",
}


def _robot(**more: Any) -> Callable[[], Study]:
    robot = {"arm": "gantry", "rails": ["left", "right"], "start": [3.0, 0, 0, 0, 0]}
    return lambda: scene(robot={"portal": robot | more})


@pytest.mark.parametrize(
    ("make", "where"),
    [
        (_rail(**ELSEWHERE), "body.left.track"),
        (_rail(own_weight=True), "body.left.own_weight"),
        (_rail(gravity_direction=[0, 1, -1]), "body.left.gravity_direction"),
        (_rail(spring={}), "body.left.supports"),
        (lambda: scene(body={"left": BEAM, "right": rail(3.0)}), "body.left.kind"),
        (_robot(arm="nobody"), "robot.portal.arm"),
        (_robot(rails=["left", "nowhere"]), "robot.portal.rails.1"),
        (_robot(rails=["left", "left"]), "robot.portal"),
        (_robot(start=[3.0, 0]), "robot.portal.start"),
        (_robot(start=[13.0, 0, 0, 0, 0]), "robot.portal.start"),
        (_robot(moves=[{"to": [-1.0, 0, 0, 0, 0]}]), "robot.portal.moves.0.to"),
        (lambda: scene(robot={}), "robot"),
        (lambda: scene(kind="passage"), "robot"),
        (lambda: scene(solver={"scheme": "hht-alpha", "alpha": -0.1}), "solver.scheme"),
        (lambda: scene(solver={"fidelity": "static"}), "solver.fidelity"),
        (lambda: scene(output={"histories": {"every": 3}}), "output.histories"),
        (lambda: scene(sensor={"tip": {"body": "left", "at": 1.0}}), "sensor"),
        (
            lambda: scene(
                arm={"gantry": GANTRY | {"rail": {"speed": 1, "acceleration": 1, "jerk": 1, "damping": 3.0}}}
            ),
            "",
        ),
    ],
)
def test_what_cannot_be_marched_is_refused(make: Callable[[], Study], where: str) -> None:
    with pytest.raises(BadInput) as caught:
        study = make()
        kind_of(study).parts(study)
    assert caught.value.where.endswith(where)


def test_results_of_robots_and_rails_are_in_tables_and_compared(found: Any) -> None:
    """Every robot has its row or column; archives that differ in nothing else are told apart."""
    results = Results.of(found)
    rows = {f"{one.name} {one.sensor}": one for one in asked(results)}
    assert {"error_moving portal", "error_working portal", "deflection_largest left"} <= set(rows)
    assert rows["error_moving portal"].largest.value == found["error_moving"].sel(robot="portal").values.max()
    table, _ = table_of(results, ["error_moving"])
    wanted = found["error_moving"].sel(robot="hanging").values.ravel()
    np.testing.assert_array_equal(table["error_moving hanging (m)"], wanted)
    other = found.copy(deep=True)
    other["error_moving"] = 1.5 * other["error_moving"]
    told = compared(results, Results.of(other))
    assert not told.agree and compared(results, results).agree
    rounded = found.copy(deep=True)
    rounded["error_moving"] = (1.0 + 1e-15) * rounded["error_moving"]  # as sums in another order
    assert compared(results, Results.of(rounded)).agree
    assert {one.name for one in told.differences if one.beyond} == {"error_moving portal", "error_moving hanging"}
