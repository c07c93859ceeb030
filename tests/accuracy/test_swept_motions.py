"""Sweeps of a motion's limits, each value of which makes a scene of its own."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import engine
from engine.accuracy.grids import DAMPED, SCALED_FOX_GOODWIN, open_scheme
from engine.accuracy.ladder import ladder_of
from engine.accuracy.pilots import MOST_SCENES, coordinates, pilots_of
from engine.accuracy.results import results_of
from engine.batch.audit import audit
from engine.batch.plan import FEW_SCENES, Plan, make_plan
from engine.scene.study import Study
from tests.accuracy.chosen import chosen_plan
from tests.accuracy.passages import SPEED, axis, passages
from tests.engine.bodies_on_contacts import TWO, riding
from tests.engine.build import Table, beam, cruise, fixed, mass, oscillator, study, under

TOLERANCE, JUDGED = 1e-2, 12
CAR = "carriage.car"


def swept(count: int, **axes: Table) -> Study:
    """A beam on which a mass moves to and stops at accelerations between two limits."""
    move = {"kind": "point-to-point", "start": 0.1, "end": 0.9, "speed": 2.0, "acceleration": 1.0, "dwell": 1.0}
    return study(
        beam(modes="auto", damping_ratio=0.01),
        mass(0.3, move),
        sensor={"midspan": fixed(0.5), "tool": under("car")},
        output={"residual": True},
        solver={"tolerance": TOLERANCE},
        sweep={"acceleration": {"of": f"{CAR}.motion.acceleration", "from": 2.0, "to": 20.0, "count": count}} | axes,
    )


@pytest.mark.slow
def test_many_scenes_of_one_variant_are_chosen_for_by_a_few() -> None:
    """None of the variants is beyond its tolerance, few of their errors are told too small, and they take far less than
    the pilots' references."""
    assert make_plan(swept(FEW_SCENES)).converges
    plan = chosen_plan(swept(FEW_SCENES + 8))
    assert not plan.converges and plan.choice is not None and len(plan.grids) == plan.size
    assert plan.choice.pilots.size == pilots_of(plan.cases, plan.members).size == MOST_SCENES
    judged = np.setdiff1d(np.arange(plan.size), plan.choice.pilots)[:: plan.size // JUDGED]
    found = audit(plan, judged)
    held = np.isfinite([result.tolerance for result in results_of(plan.asked)])
    observed, told = found.observed[held], found.told[held]
    assert found.variants.size >= JUDGED - 2
    assert 1e-4 < observed.max() < TOLERANCE and np.isfinite(told).all()
    matters = observed > 0.01 * TOLERANCE
    assert matters.sum() > 20 and np.mean(told[matters] < observed[matters]) < 0.03
    work = np.mean([group.work for group in plan.groups])
    assert work < 0.1 * plan.choice.measured.spent.mean()


def test_scenes_of_a_few_variants_have_more_of_the_pilots() -> None:
    """All variants of their scenes are pilots."""
    masses = {"weight": {"of": f"{CAR}.mass", "values": [0.1, 0.2]}}
    plan = make_plan(swept(FEW_SCENES + 1, **masses))
    drawn = pilots_of(plan.cases, plan.members)
    of = [int(np.isin(members, drawn).sum()) for members in plan.members]
    assert drawn.size == 2 * MOST_SCENES and sorted(set(of)) == [0, 2]


def test_variants_that_differ_in_their_tolerance_are_one_pilot() -> None:
    wanted = {"wanted": {"of": "solver.tolerance", "values": [1e-3, 3e-3, 1e-2, 3e-2, 5e-2, 6e-2, 7e-2, 8e-2]}}
    plan = make_plan(swept(FEW_SCENES + 2, **wanted))
    drawn = pilots_of(plan.cases, plan.members)
    own = coordinates(plan.cases, drawn)[:, 0]
    assert drawn.size == np.unique(own).size == MOST_SCENES and own.min() == 0.0 and own.max() == 1.0
    of_one_scene = make_plan(passages(20, 5, sweep={"speed": axis(SPEED, 0.3, 1.2, 100)} | wanted))
    drawn = pilots_of(of_one_scene.cases, of_one_scene.members)
    assert drawn.size == np.unique(coordinates(of_one_scene.cases, drawn), axis=0).shape[0] == 100


@pytest.mark.slow
def test_scenes_of_which_some_may_not_be_marched_swiftly_share_a_ladder() -> None:
    """The mass on its spring swings freely after the bed: softly beside the modes of a short bed alone."""
    sprung = oscillator(0.3, 30.0, cruise(0.0, 1.0, 1.0, after=2.0), wheel_mass=0.05)
    beds = {"bed": {"of": "body.bed.length", "from": 1.0, "to": 5.6, "spacing": "log", "count": FEW_SCENES + 2}}
    plan = chosen_plan(study(beam(modes="auto"), sprung, solver={"tolerance": TOLERANCE}, sweep=beds))
    fits = [open_scheme(replace(grid, shared=None)) is SCALED_FOX_GOODWIN for grid in plan.grids]
    assert 10 < sum(fits) < len(fits) - 10
    _agree_and_hold(plan, "average-acceleration")


@pytest.mark.slow
def test_scenes_of_which_some_move_slowly_on_stiff_contacts_share_a_ladder() -> None:
    """References too are by the scheme that damps: beside those by others its rungs cost more, none was judged, and
    three of four variants of a gantry had no error."""
    key = "carriage.car.contacts.{}.stiffness"
    springs = {"of": [key.format(name) for name in TWO], "from": 100.0, "to": 1e5, "spacing": "log"}
    lengths = {"of": "body.bed.length", "from": 1.0, "to": 1.2}  # each makes a scene
    sweep = {axis: told | {"count": FEW_SCENES + 2} for axis, told in (("springs", springs), ("lengths", lengths))}
    plan = chosen_plan(
        riding(
            cruise(0.3, 0.7, 0.05),
            bed=beam(modes="auto", damping_ratio=0.02),
            initial="equilibrium",
            solver={"tolerance": TOLERANCE},
            sensor={"place": fixed(0.61)},
            sweep={"zip": True} | sweep,
        )
    )
    damps = [open_scheme(replace(grid, shared=None)) == DAMPED for grid in plan.grids]
    assert 10 < sum(damps) < len(damps) - 10
    _agree_and_hold(plan, "hht-alpha")


def _agree_and_hold(plan: Plan, scheme: str) -> None:
    """One ladder, by one scheme, by which variants that are no pilots hold their tolerance and know their errors."""
    (ladder,) = {ladder_of(plan.asked, grid).columns for grid in plan.grids}
    assert {column.scheme.name for column in ladder} == {scheme}
    judged = np.setdiff1d(np.arange(plan.size), plan.choice.pilots if plan.choice else [])[::20]
    held = np.isfinite([result.tolerance for result in results_of(plan.asked)])
    found = audit(plan, judged)
    assert found.observed[held].max() < TOLERANCE and found.told[held].max() <= TOLERANCE


def test_swept_numbers_of_modes_converge_by_themselves() -> None:
    """Pilots with some modes tell nothing of variants with others."""
    modes = {"modes": {"of": "body.bed.modes", "values": list(range(2, 12))}}
    lengths = {"length": axis("body.bed.length", 1.0, 2.0, 13)}
    plan = make_plan(passages(bed=beam(modes=3), sweep=modes | lengths))
    assert len(plan.grids) == 130 > FEW_SCENES and plan.converges


@pytest.mark.parametrize("histories", ["all", {"every": 7}])
def test_histories_of_statics_are_at_the_stations_of_their_grid(histories: Any) -> None:
    """However many steps their levels have."""
    given = passages(2, 2, solver={"fidelity": "static"}, output={"histories": histories})
    found = engine.run(given)
    plan = make_plan(given)
    steps = plan.grids[0].tables(plan.grids[0].scene, 1).timeline.steps
    every = 1 if histories == "all" else 7
    assert found.sizes["station"] == len(range(0, steps + 1, every)) < 100
