"""One grid for all marches of a scene: they meet at its stations, and none breaks a rule of its scheme."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.accuracy.climb import Climb, Measured
from engine.accuracy.grids import SceneGrid
from engine.accuracy.ladder import ENOUGH, March, ladder_of
from engine.batch.plan import make_plan
from engine.march.step_rules import least_steps
from studies.protocol.study import kind_of
from tests.accuracy.passages import OPEN, only_grid, passages
from tests.calibration.scenes import draw
from tests.engine.bodies_on_contacts import FLEXIBLE, THREE, riding
from tests.engine.build import Table, beam, cruise, fixed, force, mass, oscillator, shuttle, swing

SCENES: dict[str, dict[str, Any]] = {
    "cruise": {},
    "over both ends": {"car": mass(0.2, cruise(-0.13, 1.21, 0.9))},
    "free vibration": {"car": mass(0.2, cruise(0.0, 1.0, 0.9, after=1.7))},
    "kink": {"sensor": {"moment": fixed(0.3137, "bending_moment")}},
    "out and back": {"car": mass(0.2, shuttle(0.2, 0.83, 0.7, 0.1, 2))},
    "swing": {"car": mass(0.2, swing(0.4, 0.3, 0.6, 3))},
    "several": {"car": {"a": mass(0.2, cruise(0.0, 1.0, 0.9)), "b": mass(0.1, cruise(1.1, 0.0, 0.5), delay=0.37)}},
    "pairs": {"solver": {"scheme": "richardson"}, "car": mass(0.2, cruise(-0.13, 1.21, 0.9, after=0.4))},
}


def instants(grid: SceneGrid, by: int) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Whether the grid's stations are in free vibration, and when they are, in scene time or in parts of it."""
    tables, counts = grid.tables(grid.scene, by), grid.stations(grid.scene, by)
    number, time = tables.timeline.moments(counts)
    free = np.array([segment.free for segment in tables.timeline.segments])
    first = min((segment.first for segment in tables.timeline.segments if segment.free), default=0)
    after = (counts - first) / (tables.timeline.segments[-1].first + tables.timeline.segments[-1].steps - first)
    return free[number], np.where(free[number], after, time)


@pytest.mark.parametrize("name", SCENES)
def test_all_timelines_meet_at_the_grids_stations(name: str) -> None:
    grid = only_grid(passages(**SCENES[name]))
    coarse = instants(grid, 1)
    assert coarse[0].any() == (name in ("free vibration", "pairs"))
    for by in (2, 3, 8):
        free, time = instants(grid, by)
        np.testing.assert_array_equal(free, coarse[0])
        np.testing.assert_allclose(time, coarse[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("scheme", ["linear-acceleration", "fox-goodwin", "central-difference"])
@pytest.mark.parametrize("by", [1, 4, 32])
def test_free_vibration_is_within_the_schemes_limit(scheme: str, by: int) -> None:
    way = cruise(0.0, 1.0, 0.9, after=2.0)
    grid = only_grid(passages(bed=beam(modes=16), car=mass(0.2, way), solver={"scheme": scheme}))
    model = grid.scene
    steps = sum(segment.steps for segment in grid.tables(model, by).timeline.segments if segment.free)
    step = 2.0 * 2.0 * np.pi / model.first_omega / steps
    assert model.omega.max() * step <= model.scheme.stability_limit


def test_a_study_that_fixes_its_steps_has_a_grid_of_these() -> None:
    grid = only_grid(passages(solver={"steps": 333}))
    assert grid.fixed and grid.tables(grid.scene, 1).steps == 333
    assert only_grid(passages(solver={"steps": 334, "scheme": "richardson"})).unit == 167


def test_variants_that_need_more_steps_than_a_rung_has_take_them() -> None:
    """By a power of two, and only these."""
    grid = only_grid(passages(30, bed=beam(modes=24), solver={"scheme": "fox-goodwin"}))
    cuts = grid.safe_cuts(grid.scene.numerics, grid.values, 4)
    least = least_steps(grid.scene, grid.values)
    assert len(np.unique(cuts)) > 1
    assert np.all(least <= grid.unit * cuts * (1.0 + 1e-9))
    assert np.all((cuts == 4) | (2.0 * least > grid.unit * cuts))


def test_contacts_on_springs_are_resolved() -> None:
    """No step is longer than a period of the contact on its spring."""
    stiff = oscillator(0.5, 1e5, cruise(0.0, 1.0, 0.9))
    soft, hard = (only_grid(passages(bed=OPEN, car=stiff | {"stiffness": k})) for k in (1e2, 1e6))
    few, many = (float(least_steps(grid.scene, grid.values)[0]) for grid in (soft, hard))
    assert many > np.sqrt(1e6 / 0.5) / 0.9 / (2.0 * np.pi) > few


def test_very_many_steps_are_compared_at_some_stations() -> None:
    """The same of all marches, the ends of every part among them."""
    grid = only_grid(passages(car=mass(0.2, cruise(-0.13, 1.21, 0.9, after=0.4)), solver={"steps": 1_000_000}))
    free, time = instants(grid, 1)
    assert 4000 < time.size < 9000
    assert set(grid.grid.parts[1][:2]) <= set(time[~free].tolist())
    np.testing.assert_allclose(instants(grid, 2)[1], time, rtol=0, atol=1e-12)


# The ladder of what a variant may be computed with, and what pilots measure on it


FIXED: dict[str, tuple[Table, dict[str, set[Any]]]] = {
    "nothing": ({}, {"fidelity": {"static", "force", "auto"}, "scheme": {"scaled-fox-goodwin"}}),
    "fidelity": ({"solver": {"fidelity": "force"}}, {"fidelity": {"force"}}),
    "scheme": ({"solver": {"scheme": "hht-alpha", "alpha": -0.05}}, {"scheme": {"hht-alpha"}}),
    "modes": ({"bed": beam(modes=5)}, {"modes": {0}}),
    "no static correction": ({"solver": {"static_correction": False}}, {"fidelity": {"force", "auto"}}),
    "a force": ({"car": force(2.0, cruise(0.0, 1.0, 0.9))}, {"fidelity": {"static", "auto"}}),
    "a sprung mass": (
        {"car": oscillator(0.2, 30.0, cruise(0.0, 1.0, 0.9))},
        {"fidelity": {"static", "force", "mass", "auto"}},
    ),
    "soft springs and free vibration": (
        {"car": oscillator(0.2, 30.0, cruise(0.0, 1.0, 0.9, after=1.0))},
        {"scheme": {"scaled-fox-goodwin"}},
    ),
    "a stiff spring": (
        {"car": oscillator(0.2, 3e7, cruise(0.0, 1.0, 0.9))},
        {"scheme": {"scaled-fox-goodwin"}},
    ),
    "a very stiff spring": (
        {"car": oscillator(0.2, 3e10, cruise(0.0, 1.0, 0.9))},
        {"scheme": {"average-acceleration"}},
    ),
    "stiff springs and free vibration": (
        {"car": oscillator(0.2, 3e4, cruise(0.0, 1.0, 0.9, after=1.0))},
        {"scheme": {"average-acceleration"}},
    ),
    "a velocity": ({"sensor": {"fast": fixed(0.4, "velocity")}}, {"modes": {2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64}}),
}


@pytest.mark.parametrize("name", FIXED)
def test_columns_are_within_what_the_study_fixes(name: str) -> None:
    changes, wanted = FIXED[name]
    grid = only_grid(passages(**changes))
    ladder = ladder_of(grid.asked, grid)
    found = {
        "fidelity": {column.fidelity for column in ladder.columns},
        "scheme": {column.scheme.name for column in ladder.columns},
        "modes": {column.modes for column in ladder.columns},
    }
    assert {key: found[key] for key in wanted} == wanted
    assert len(ladder.cuts) > 20 and len(set(ladder.columns)) == len(ladder.columns)


def test_fixed_steps_are_the_only_rung() -> None:
    grid = only_grid(passages(solver={"steps": 400}))
    ladder = ladder_of(grid.asked, grid)
    assert ladder.cuts == (1,)
    assert {column.scheme.name for column in ladder.columns} == {"average-acceleration"}


def test_bodies_that_ride_have_statics_and_the_full_model() -> None:
    given = riding(cruise(0.3, 0.7, 0.8), THREE, FLEXIBLE, beam(modes="auto"), sensor={"place": fixed(0.5)})
    grid = only_grid(given.with_values({"solver.steps": "auto"}))
    assert {column.fidelity for column in ladder_of(grid.asked, grid).columns} == {"static", "auto"}


@cache
def climbed() -> Measured:
    """What fifteen pilots found."""
    grid = only_grid(passages(5, 3, solver={"tolerance": 1e-2}))
    return Climb(grid, grid.values, ladder_of(grid.asked, grid)).go()


def test_held_errors_fall_along_a_column() -> None:
    """Finer rungs are no worse than a little, down to what is called enough."""
    measured = climbed()
    for held in measured.held:
        known = np.isfinite(held)
        assert np.all(known[1:] | ~known[:-1])
        with np.errstate(invalid="ignore"):
            risen = held[1:] > 1.1 * np.maximum(held[:-1], ENOUGH)
        assert not np.any(risen & known[:-1])


def test_every_pilot_has_a_rung_that_holds() -> None:
    measured = climbed()
    assert np.all(measured.held.min(axis=(0, 1)) <= 1.0)
    assert np.all(measured.reference[:3] <= 0.5e-2)  # of extremes and root mean squares
    assert measured.work > 0.0 and measured.marched.any()


@pytest.mark.fault
def test_modes_that_steps_limit_are_judged_by_more_of_these() -> None:
    """Two swings of a sprung mass, whose columns of up to 24 modes left 0.59 and 0.44 of the tolerance by the steps
    that they were judged with, so that variants near them took 32."""
    given = draw(77, 11, 32, 1e-3)
    kind = kind_of(given)
    (grid,) = make_plan(given, reduction=kind.reduction(given), results=kind.name).grids
    columns = ladder_of(grid.asked, grid)
    held = Climb(grid, grid.values.part(np.array([24, 27])), columns).go().held
    few = [number for number, numerics in enumerate(columns.columns) if numerics.modes <= 24]
    assert np.all(held[few].min(axis=(0, 1)) <= 1.1 * ENOUGH)


def test_what_was_measured_of_a_finer_rung_stays() -> None:
    """Unless a coarser one is small: marches are not told in the order of their steps."""
    grid = only_grid(passages(2, 2))
    climb = Climb(grid, grid.values, ladder_of(grid.asked, grid))
    climb.go()
    climb.told_by[:] = -1  # as before any march
    for rung, held in ((6, 0.3), (2, 0.5)):
        found = np.array([held, held, held, ENOUGH * held])
        climb._take([March(0, rung, np.arange(4), np.zeros((climb.found[0][1].shape[1], 4)), found, 0.0)])
    assert np.all(climb.held[0, 2:6, :3] == 0.5) and np.all(climb.held[0, 6:, :3] == 0.3)
    assert np.all(climb.held[0, 2:, 3] == 0.5 * ENOUGH)


@pytest.mark.parametrize("fixed", [{}, {"fidelity": "mass"}, {"static_correction": False}])
def test_levels_of_references_are_rungs_that_need_no_march(fixed: Table) -> None:
    """What they tell of a rung is what a march of it would, to the last bit."""
    grid = only_grid(passages(3, 2, solver={"tolerance": 1e-3} | fixed))
    climb = Climb(grid, grid.values, ladder_of(grid.asked, grid))
    climb.go()
    assert len(climb.rungs.levels) >= 2
    for column in climb.rungs.levels:
        for known in climb.rungs.marched(np.flatnonzero(climb.rungs.known(column)), column):
            anew = climb.rungs.march(known.lanes, lambda: False, column, known.rung)
            assert known.error.tobytes() == anew.error.tobytes() and known.held.tobytes() == anew.held.tobytes()
