"""The ladder of what a variant may be computed with, and what pilots measure on it."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from engine.accuracy.ladder import ENOUGH, Climb, Measured, ladder_of
from tests.accuracy.passages import only_grid, passages
from tests.engine.bodies_on_contacts import FLEXIBLE, THREE, riding
from tests.engine.build import Table, beam, cruise, fixed, force, oscillator

FIXED: dict[str, tuple[Table, dict[str, set[Any]]]] = {
    "nothing": ({}, {"fidelity": {"static", "force", "auto"}, "scheme": {"average-acceleration", "fox-goodwin"}}),
    "fidelity": ({"solver": {"fidelity": "force"}}, {"fidelity": {"force"}}),
    "scheme": ({"solver": {"scheme": "hht-alpha", "alpha": -0.05}}, {"scheme": {"hht-alpha"}}),
    "modes": ({"bed": beam(modes=5)}, {"modes": {0}}),
    "no static correction": ({"solver": {"static_correction": False}}, {"fidelity": {"force", "auto"}}),
    "a force": ({"car": force(2.0, cruise(0.0, 1.0, 0.9))}, {"fidelity": {"static", "auto"}}),
    "a sprung mass": (
        {"car": oscillator(0.2, 30.0, cruise(0.0, 1.0, 0.9))},
        {"fidelity": {"static", "force", "mass", "auto"}},
    ),
    "springs and free vibration": (
        {"car": oscillator(0.2, 30.0, cruise(0.0, 1.0, 0.9, after=1.0))},
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
    """What twelve pilots found."""
    grid = only_grid(passages(4, 3, solver={"tolerance": 1e-2}))
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
