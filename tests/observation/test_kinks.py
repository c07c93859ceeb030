"""Where a load passes a sensor of moments its influence line has a kink, which no step may jump over."""

import numpy as np
import pytest

from engine.batch.execution import run
from engine.batch.plan import make_plan
from engine.march.outcome import outcome
from engine.march.tables import SceneTables
from engine.model.rider import Rider
from studies import kind_named
from tests.engine.build import Table, beam, cruise, fixed, force, shuttle, study, under

AT = 0.3137
MOMENT = {"moment": fixed(AT, "bending_moment")}
SLOW = force(1.0, cruise(0.0, 1.0, 0.02))


def test_the_times_at_which_a_way_passes_a_place() -> None:
    car = make_plan(study(beam(), force(1.0, shuttle(0.2, 0.8, 1.0, 0.0, 2)))).base.carriages[0]
    found = list(car.rider.passes(0.5))
    places = [float(car.rider.path(np.array([tau]), np.floor(tau), np.floor(tau) + 0.5).S[0]) for tau in found[::2]]
    assert len(found) == 4
    np.testing.assert_allclose(places, 0.5, atol=1e-9)
    assert list(Rider(car.rider.motion, 1.0).passes(0.9)) == []


def test_chosen_steps_do_not_jump_over_a_kink() -> None:
    """A slow force: the largest moment is P a b/L within what vibration adds, with 200 steps or so."""
    plan = make_plan(study(beam(modes=4, damping_ratio=0.1), SLOW, sensor=MOMENT, solver={"fidelity": "full"}))
    tables = plan.groups[0].tables
    places = tables.timeline.positions(0, np.arange(tables.timeline.steps + 1.0))
    assert np.abs(places - AT).min() < 1e-9
    jumped = SceneTables(plan.base, tables.steps, "whole", refinement=2)
    others = jumped.timeline.positions(0, np.arange(jumped.timeline.steps + 1.0))
    assert np.abs(others - AT).min() > 1e-5


def test_static_readings_know_the_kink() -> None:
    found = run(study(beam(modes=4), SLOW, sensor=MOMENT, solver={"fidelity": "static"}))
    assert float(found.moment_max) == pytest.approx(AT * (1.0 - AT), rel=1e-12)


@pytest.mark.parametrize("steps", [101, 130, 250])
def test_the_steps_of_a_cycle_do_not_jump_over_a_kink(steps: int) -> None:
    """A slow force to and fro: the largest moment is P a b/L there, and the shear forces on either side are its parts,
    though no station is near."""
    car = force(1.0, shuttle(0.05, 0.95, 0.002, 0.1, 1))
    sensors = MOMENT | {"shear": fixed(AT, "shear_force")}
    given = study(
        beam(modes=6, damping_ratio=0.1), car, sensor=sensors, solver={"steps": steps, "scheme": "average-acceleration"}
    )
    plan = make_plan(given, reduction=kind_named("double-peak").reduction(given))
    tables = plan.groups[0].tables
    assert np.abs(tables.timeline.positions(0, np.arange(steps + 1.0)) - AT).min() > 1e-4
    found = outcome(plan.asked, tables, plan.values(plan.groups[0], np.zeros(1, np.int64)), np.zeros(0, np.int64))
    assert float(found.numbers["moment_max"][0]) == pytest.approx(AT * (1.0 - AT), rel=1e-4)
    assert float(found.numbers["moment_max_position"][0]) == pytest.approx(AT, abs=1e-9)
    ends = sorted(float(abs(found.numbers[f"shear_{end}"][0])) for end in ("max", "min"))
    assert ends == pytest.approx([AT, 1.0 - AT], rel=2e-3)


MET = {"one": force(1.0, cruise(0.0, 1.0, 0.05)), "other": force(2.0, cruise(1.0, 0.0, 0.04))}


def test_static_readings_know_where_another_load_passes() -> None:
    """Both stand at 5/9 then: the moment under them is 3 P a b/L."""
    there = {"moment": under("one", "bending_moment")}
    found = run(study(beam(modes=4), MET, sensor=there, solver={"fidelity": "static"}))
    assert float(found.moment_max) == pytest.approx(3.0 * 5.0 / 9.0 * 4.0 / 9.0, rel=1e-12)


ON_THREE = [
    {"at": 0.0, "stiffness": 2e4},
    {"at": 0.402, "stiffness": 2e4, "rotational": 8.6},
    {"at": 1.0, "stiffness": 2e4},
]
BACK_AND_FORTH = {"one": shuttle(0.13, 0.8, 0.2, 0.2, 1), "other": shuttle(0.9, 0.25, 0.17, 0.2, 1)}


@pytest.mark.parametrize(
    ("bed", "ways"),
    [(beam(damping_ratio=0.05), list(BACK_AND_FORTH)), (beam(supports=ON_THREE, damping_ratio=0.05), ["one"])],
    ids=["another load", "an inner support"],
)
def test_errors_of_a_moment_under_a_load_know_what_it_passes(bed: Table, ways: list[str]) -> None:
    """They were up to seventeen times what was told: steps jumped over where it is largest or smallest."""
    cars = {name: force(1.0, BACK_AND_FORTH[name]) for name in ways}
    there = {"moment": under("one", "bending_moment")}
    found, finer = (
        run(study(bed | {"modes": "auto"}, cars, sensor=there, solver={"tolerance": one})) for one in (1e-2, 1e-5)
    )
    scale = float(found.moment_static)
    for end in ("moment_max", "moment_min"):
        off = abs(float(found[end]) - float(finer[end])) / scale
        assert off <= float(found.estimated_error.sel(result=end)) + 1e-6


FROM_REST: Table = {"kind": "point-to-point", "speed": 0.2, "acceleration": 1.0}
READ: Table = {"sensor": {"moment": under("car", "bending_moment")}, "solver": {"tolerance": 1e-2}}
MIRRORED = (
    (ON_THREE, force(1.0, FROM_REST | {"start": 0.2, "end": 0.7})),
    ([{**one, "at": 1.0 - one["at"]} for one in ON_THREE[::-1]], force(1.0, FROM_REST | {"start": 0.8, "end": 0.3})),
)


def test_both_values_of_what_jumps_are_read() -> None:
    """The moment under a load jumps at a support that holds the slope: mirrored scenes, in which the load comes from
    the other side, had other extremes by as much as a step changes them."""
    here, mirrored = (study(beam(supports=held, damping_ratio=0.05), crossing, **READ) for held, crossing in MIRRORED)
    one, other = run(here), run(mirrored)
    for end in ("moment_max", "moment_min"):
        assert float(one[end]) == pytest.approx(float(other[end]), rel=1e-9)
