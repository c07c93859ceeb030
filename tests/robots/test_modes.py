"""Numbers of rails' modes, and the errors that are told of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engine.kernels.robots.layout import SUNK
from engine.robots.converge import Converged, Ladder, Rung, climb, marched
from engine.robots.march import rest, stretches
from engine.robots.model import build
from engine.robots.modes import MODES, missed_part
from engine.robots.results import are_held, differences, results_of
from engine.scene.study import Study
from results_schema.status import Status
from tests.robots.scenes import drive, rail, scene

PLACES, ROD = (3.0, 9.0), 2e-3  # m: where rods hang, their diameter
LIFT = {
    "mass": 900.0,
    "rail": drive(8e6, 3e4),
    "tool": [0, 0, -0.3],
    "links": [{"kind": "prismatic", "axis": [0, 0, 1], "mass": 250, "centre": [0, 0, -1.5], **drive(6e6, 2e4)}],
}
MOVES = [{"to": [7.0, -0.8], "hold": 0.3}, {"to": [4.0, 0.0], "payload": 80.0, "hold": 0.2}]


def hung_with_rods(rods: int) -> Study:
    """A robot on a rail from which thin rods hang, whose modes are lower than all that the robot bends."""
    bed, second = rail(0.0), np.pi * ROD**4 / 64.0
    section = {"second_moment": second, "second_moment_lateral": second, "torsion_constant": 2.0 * second}
    steel = {key: bed["section"]["box"][key] for key in ("youngs_modulus", "poissons_ratio", "density")}
    bed["section"]["rod"] = {"area": np.pi * ROD**2 / 4.0, **section, **steel}
    nodes = ["west", "third", "last", "east"]
    bed["node"] |= {"third": [PLACES[0], 0, 5], "last": [PLACES[1], 0, 5]}
    spans = {f"span_{n}": {"nodes": nodes[n : n + 2], "section": "box", "elements": (6, 12, 6)[n]} for n in range(3)}
    bed |= {"member": spans, "track": {"members": list(spans)}, "modes": "auto"}
    for n in range(rods):
        bed["node"][f"end_{n}"] = [PLACES[n % 2], 0.3 * (n // 2 + 1), 2.0 + 0.3 * n]
        bed["member"][f"rod_{n}"] = {"nodes": [nodes[1 + n % 2], f"end_{n}"], "section": "rod", "elements": 16}
    robot = {"arm": "lift", "rails": ["rail"], "start": [3.0, 0.0], "moves": MOVES}
    tables: dict[str, Any] = {"body": {"rail": bed}, "arm": {"lift": LIFT}, "robot": {"lift": robot}}
    return Study(kind="portal", gravity=9.81, solver={"tolerance": 5e-2}, **tables)


def with_modes(study: Study, modes: int) -> Study:
    """More than a study file may fix, too."""
    own = {name: body.model_copy(update={"modes": modes}) for name, body in study.body.items()}
    return study.model_copy(update={"body": own})


def off_and_told(study: Study, found: Converged, modes: int) -> tuple[np.ndarray, np.ndarray]:
    """(results,) how far a march is from one with many modes and four times the steps, and what is told; of what is
    held."""
    ladder = Ladder.of(study, None, 0.5)
    whole = build(with_modes(study, modes))
    level = Ladder(with_modes(study, modes), whole, ladder.duration, ladder.step).level(Rung(0, found.rung.steps + 2))
    held = are_held(results_of(found.model))
    return differences(found.model, found.outcome, marched(level, "start"))[held], found.error[held]


def test_levels_have_more_modes_where_the_first_sway_beside_the_robots() -> None:
    """Of 48 modes none bends the rail; what they change among themselves said 4e-3 where 0.13 was true."""
    study = hung_with_rods(8)
    ladder = Ladder.of(study, None, 0.5)
    assert ladder.missed_by(build(with_modes(study, 48))) > 0.99 > 0.5 > ladder.missed_by(ladder.coarsest)
    found = climb(ladder, "start")
    assert found.status == Status.OK and found.model.modes > 2 * MODES[1]
    true, told = off_and_told(study, found, 400)
    assert (true <= told).all() and true.max() < 1e-2
    assert Ladder.of(scene({"modes": "auto"}), 1.0, 0.0).times == 1


def test_what_modes_miss_is_told_where_no_level_has_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.robots.converge.MOST_TIMES", 1)
    study = hung_with_rods(8)
    found = climb(Ladder.of(study, None, 0.5), "start")
    assert found.model.modes == MODES[1] and found.status == Status.TOLERANCE_MISSED
    true, told = off_and_told(study, found, 400)
    assert (true <= told).all() and true.min() > 3e-2


@pytest.mark.parametrize("modes", [2, 4, 6, 12, 24])
def test_errors_by_modes_that_a_study_fixes_are_told_and_miss_nothing(modes: int) -> None:
    """Against all modes of the rails; what is told is a few times what is true."""
    study = scene({"modes": modes}, solver={"tolerance": 1e-2})
    found = climb(Ladder.of(study, None, 0.5), "start")
    true, told = off_and_told(study, found, 64)
    assert (true <= told).all() and told.max() < 8.0 * true.max()
    assert found.status == Status.OK and found.model.modes == 2 * modes


@pytest.mark.parametrize("modes", [4, 12, 30])
def test_what_modes_miss_is_of_all_that_robots_bend(modes: int) -> None:
    """A robot that stands on the axis of a rail: by how much less this goes down by its modes alone."""
    study = with_modes(hung_with_rods(0), modes)
    down = []
    for corrected in (True, False):
        own = study.with_values({"solver.static_correction": corrected, "robot.lift.moves": []})
        model = build(with_modes(own, modes))
        resting, _ = rest(model, stretches(model, 0.1, 0.1, 1))
        down.append(float(resting.grips[0, 0, 0, SUNK]))
        part = missed_part(model, resting)
    assert part == pytest.approx(1.0 - down[1] / down[0], rel=1e-3) and 1e-4 < part < 0.5
