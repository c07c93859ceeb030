"""Levels of more and more modes and steps: what they converge to, and what is told of what they miss."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.accuracy.grids import SceneGrid
from engine.accuracy.reference import (
    STAYS,
    STAYS_UNCORRECTED,
    Beyond,
    Converged,
    Marches,
    as_fixed,
    converge,
    in_full,
    is_free,
    left_along,
    level_work,
)
from engine.accuracy.results import differences, results_of, tolerances
from engine.batch.audit import audit
from engine.batch.plan import make_plan
from engine.bodies.frame.assembly import assemble
from engine.bodies.frame.frame import Frame
from engine.bodies.modal.description import MAX_MODES
from engine.march.outcome import outcome
from engine.scene.study import Study
from results_schema.status import Status
from studies.protocol.library import find_study
from tests.accuracy.passages import OPEN, WEIGHT, only_grid, passages
from tests.engine.build import beam, cruise, fixed, force, mass, shuttle, study, swing
from tests.reference import values
from tests.studies.at_rest import PORTAL

PART = 0.1  # of the tolerance by which an answer may still change


def levels(grid: SceneGrid, part: float = PART, beyond: int = 0) -> Converged:
    return converge(Marches(grid, grid.values, as_fixed(grid)), part, Beyond(beyond, math.inf))


def told(grid: SceneGrid, found: Converged, name: str) -> np.ndarray:
    return found.error[[result.name for result in results_of(grid.asked)].index(name)]


def crossing(alpha: float, mu: float, **changes: Any) -> Study:
    """A published passage, with its 20 modes and no static correction."""
    way = cruise(0.0, 1.0, math.pi * alpha)
    solver = {"static_correction": False} | changes.pop("solver", {})
    car = mass(mu, way) if mu else force(values.WEIGHT, way)
    return study(beam(modes=20, **changes), car, gravity=values.WEIGHT / (mu or 1.0), solver=solver)


@pytest.mark.parametrize("case", values.MOVING_MASS, ids=lambda case: f"{case.mu}-{case.alpha}")
def test_levels_converge_to_the_published_moving_masses(case: values.MovingMass) -> None:
    grid = only_grid(crossing(case.alpha, case.mu))
    found = levels(grid)
    error = told(grid, found, "midspan_max")[0]
    assert error <= 1e-3
    assert abs(found.outcome.numbers["midspan_max"][0] - case.largest) <= error + 1e-8


def test_levels_converge_to_moving_forces_of_many_modes() -> None:
    for alpha, largest in values.MOVING_FORCE.items():
        way = force(values.WEIGHT, cruise(0.0, 1.0, math.pi * alpha))
        grid = only_grid(study(beam(modes="auto"), way))
        found = levels(grid)
        assert is_free(grid) and found.settled[0]
        off = abs(found.outcome.numbers["midspan_max"][0] - largest)
        assert off <= told(grid, found, "midspan_max")[0] + 1e-6


@pytest.mark.parametrize("modes", [3, "auto"])
def test_steps_that_a_study_fixes_are_doubted(modes: int | str) -> None:
    """After 40 cycles without damping the phase of 240 steps a period is off; levels that all took as many steps as the
    study's own would agree with it, and with each other."""
    way = swing(0.5, 0.5, 0.304 * math.pi, 40)
    fine = study(beam(modes=12), mass(0.002, way), kind="double-peak", solver={"steps": 6400, "scheme": "fox-goodwin"})
    given = study(beam(modes=modes), mass(0.002, way), kind="double-peak", solver={"steps": 400, "tolerance": 0.1})
    found, truth = studies.run(given), studies.run(fine)
    told = found.estimated_error.sel(result=["midspan_max", "midspan_min"]).values
    off = abs(np.array([found[name] - truth[name] for name in ("midspan_max", "midspan_min")]))
    off /= float(found.midspan_max / found.dynamic_amplification.sel(sensor="midspan"))
    assert (off > 1e-2).all() and (off <= told).all() and (told <= 10.0 * off).all()


def test_listed_ratios_leave_the_modes_open() -> None:
    """The last of a list goes on, whatever number of modes is taken: as if every ratio were written out."""
    one, short, whole = (
        only_grid(passages(2, 2, bed=OPEN | {"damping_ratio": ratios}))
        for ratios in (0.02, [0.02, 0.2], [0.02, *[0.2] * (MAX_MODES - 1)])
    )
    assert is_free(short)
    found = [levels(grid).outcome.numbers["midspan_max"] for grid in (one, short, whole)]
    np.testing.assert_array_equal(found[1], found[2])
    assert (found[0] != found[1]).all()


SCENES: dict[str, Study] = {
    "passages": passages(4, 4),
    "moments": passages(3, 3, sensor={"moment": fixed(0.5, "bending_moment")}),
    "shuttles": passages(3, 3, car=mass(0.2, shuttle(0.2, 0.8, 0.5, 0.1, 2)), bed=OPEN | {"damping_ratio": 0.05}),
    "free vibration": passages(3, 3, car=mass(0.2, cruise(0.0, 1.0, 0.9, after=2.0))),
}


@pytest.mark.parametrize("name", SCENES)
def test_what_is_told_is_no_less_than_the_truth(name: str) -> None:
    """Of the held results, against a level beyond those that changed by a hundredth."""
    grid = only_grid(SCENES[name])
    found = converge(Marches(grid, grid.values, in_full(grid)), 0.5)
    truth = converge(Marches(grid, grid.values, in_full(grid)), 0.01, beyond=Beyond(1, math.inf))
    off = differences(grid.asked, grid.scene, grid.values, found.outcome, truth.outcome)
    held = np.isfinite([result.tolerance for result in results_of(grid.asked)])
    over = off[held] / (found.error[held] + truth.error[held])
    assert over.max() <= 1.0
    assert np.all(off[held] <= 1e-3)


def test_levels_end_where_nothing_changes_any_more() -> None:
    """A wider tolerance takes less work, and what is settled says so."""
    fine, coarse = (levels(only_grid(passages(3, 3, solver={"tolerance": t}))) for t in (1e-4, 1e-2))
    assert coarse.settled.all() and fine.settled.all()
    assert np.all(coarse.used["work"] <= fine.used["work"]) and coarse.used["work"].sum() < fine.used["work"].sum()


def test_a_variant_does_not_depend_on_its_neighbours() -> None:
    grid = only_grid(passages(4, 3, output={"histories": "auto"}))
    whole = levels(grid)
    for lane in (0, 5, 11):
        alone = converge(Marches(grid, grid.values.part(np.array([lane])), as_fixed(grid)), PART)
        for name, numbers in alone.outcome.numbers.items():
            assert numbers.tobytes() == whole.outcome.numbers[name][[lane]].tobytes(), name
        assert alone.error.tobytes() == np.ascontiguousarray(whole.error[:, [lane]]).tobytes()
        assert {name: column[0] for name, column in alone.used.items()} == {
            name: column[lane] for name, column in whole.used.items()
        }


def test_a_diverging_variant_has_no_error() -> None:
    """Parametric resonance without damping grows until nothing is left."""
    way = swing(0.5, 0.5, 0.608 * 0.5 * math.pi, 150)
    sweep = {"weight": {"of": WEIGHT, "values": [0.001, 1.0, 0.002]}}
    grid = only_grid(study(beam(modes=3), mass(0.5, way), sweep=sweep, solver={"steps": 200}))
    found = converge(Marches(grid, grid.values, in_full(grid)), 1.0)
    assert found.outcome.status.tolist() == [Status.OK, Status.DIVERGED, Status.OK]
    assert np.isnan(found.error[:, 1]).all() and not found.settled[1]
    assert np.isnan(found.outcome.numbers["midspan_max"]).tolist() == [False, True, False]


def test_a_study_whose_only_variant_diverges_has_no_error() -> None:
    way = swing(0.5, 0.5, 0.608 * 0.5 * math.pi, 40)
    found = studies.run(study(beam(modes=3), mass(1.0, way), solver={"steps": 400, "tolerance": 0.1}))
    assert int(found.status) == Status.DIVERGED and np.isnan(found.estimated_error).all() and np.isnan(found.work)


@pytest.mark.parametrize(
    ("changes", "free"),
    [
        ({}, True),
        ({"bed": beam(modes=4)}, False),
        ({"solver": {"fidelity": "force"}}, False),
        ({"solver": {"static_correction": False}}, False),
        ({"solver": {"scheme": "fox-goodwin"}}, False),
        ({"solver": {"steps": 400}}, False),
    ],
)
def test_levels_keep_to_what_the_study_fixes(changes: dict[str, Any], free: bool) -> None:
    grid = only_grid(passages(**changes))
    assert is_free(grid) == free
    study_, found = grid.scene.study, as_fixed(grid)
    for numerics in found.numerics:
        assert numerics.fidelity == study_.solver.fidelity
        assert numerics.static_correction == study_.solver.static_correction
        assert (numerics.modes == 0) == ("bed" in changes)
        assert study_.solver.scheme in ("auto", numerics.scheme.name)
    assert (found.steps == "grow") == (study_.solver.steps == "auto")
    assert {numerics.fidelity for numerics in in_full(grid).numerics} == {"full"}


@pytest.mark.parametrize("modes", ["auto", 4, 20, 64])
@pytest.mark.parametrize("scheme", ["auto", "average-acceleration", "central-difference"])
def test_no_two_levels_are_the_same_march(modes: Any, scheme: str) -> None:
    """Or nothing would seem to be missed: also where the rules of many modes ask for more steps than the levels do."""
    grid = only_grid(passages(3, bed=OPEN | {"modes": modes}, solver={"scheme": scheme}))
    for found in (as_fixed(grid), in_full(grid)):
        work = np.array([level_work(grid, grid.values, found, level) for level in range(len(found.numerics))])
        assert len(work) >= 4 and np.all(np.diff(work, axis=0) > 0.0)


def test_levels_of_many_fixed_steps_double_the_modes_twice_at_least() -> None:
    """Each took twice the steps, and so many that no second one was worth its work: estimated errors grew with the
    steps of a study, while its values were right."""
    grid = only_grid(passages(2, bed=OPEN | {"modes": 10}, solver={"steps": 200_000}))
    found = in_full(grid)
    work = np.array([level_work(grid, grid.values, found, level)[0] for level in range(4)])
    np.testing.assert_allclose(work, 2e6 * np.array([1.0, 2.0 * 2.0, 4.0 * 4.0, 6.4 * 4.0]))
    converged = converge(Marches(grid, grid.values, found), 1e-9)
    assert np.all(converged.level == 2) and converged.error.max() < 1e-4


@pytest.mark.slow
def test_a_train_is_told_about_what_it_is_off_by() -> None:
    """Forces that enter one after the other: what they bend converges fast, what they shake slowly."""
    axles = {f"axle{n}": force(1.0, cruise(0.0, 1.0, 0.8), headway=0.12 * n) for n in range(4)}
    sensor = {name: fixed(0.5, name) for name in ("displacement", "bending_moment", "acceleration")}
    grid = only_grid(study(OPEN | {"damping_ratio": 0.01}, axles, sensor=sensor))
    found = levels(grid, 0.02)
    model = grid.model(in_full(grid).numerics[-1])
    finest = outcome(grid.asked, grid.once(model, 1024), grid.values, grid.stations(model, 1024))
    off = differences(grid.asked, model, grid.values, found.outcome, finest)
    numbers = [number for number, result in enumerate(results_of(grid.asked)) if result.name.endswith("_rms")]
    ratios = found.error[numbers, 0] / off[numbers, 0]
    assert ratios.size == 3 and ratios.min() >= 1.0 and ratios.max() <= 10.0, ratios


def test_extremes_are_not_told_by_the_few_places_at_which_forces_jump() -> None:
    """A sensor's history and a contact force, each another at one place where neither is largest."""
    grid = only_grid(passages(car=mass(0.2, cruise(0.0, 1.0, 0.9, after=2.0)), output={"histories": "all"}))
    model = grid.model(in_full(grid).numerics[0])
    stations = grid.stations(model, 4)
    one = outcome(grid.asked, grid.once(model, 4), grid.values, stations)
    jumped = replace(one, history=one.history.copy())
    jumped.history[len(stations) // 3] += 0.5 * one.scale[:, :1].T
    names = [result.name for result in results_of(grid.asked)]
    off = dict(zip(names, differences(grid.asked, model, grid.values, one, jumped)[:, 0], strict=True))
    assert off["midspan"] == pytest.approx(0.5) and off["midspan_max"] == 0.0 == off["car_contact_force_min"]
    jumped.history[:] += 0.5 * one.scale[:, :1].T
    off = dict(zip(names, differences(grid.asked, model, grid.values, one, jumped)[:, 0], strict=True))
    assert off["midspan_max"] == pytest.approx(0.25) and off["car_contact_force_min"] > 0.0


@pytest.mark.parametrize("falls, stays", [(1, STAYS_UNCORRECTED), (3, STAYS)])
def test_what_forces_along_a_track_leave_is_told_with_the_modes_that_matter_missing_from_a_level(
    falls: int, stays: float
) -> None:
    """A tail of terms 1/k^(1 + order), of which a level brings all that it should or none."""
    terms = np.arange(1, 200_001, dtype=np.float64) ** -(1.0 + falls)
    for missing in (slice(0, 0), slice(16, 32)):
        own = terms.copy()
        own[missing] = 0.0
        left = [float(own[modes:].sum()) for modes in (8, 16, 32)]
        change, before = np.array([[left[1] - left[2]]]), np.array([[left[0] - left[1]]])
        told = left_along(change, before, stays).item()
        assert 0.9 * left[2] < told < (3.0 if falls == 1 else 8.0) * left[2], (told, left)
    assert np.isnan(left_along(np.array([np.inf]), np.array([1.0]), stays)).all()
    assert np.isnan(left_along(np.array([0.2]), np.array([np.nan]), stays)).all()


@pytest.mark.fault
@pytest.mark.parametrize("modes", [8, 16, 32, MAX_MODES])
def test_a_mass_that_is_let_go_touches_with_what_its_modes_weigh_there(modes: int) -> None:
    """g m m_N/(m + m_N) with 1/m_N = sum of phi_n(x)^2/M_n, and omega_N^2 R of what they miss: nothing with all modes,
    so that all of it is the error."""
    weight, place = 0.2 * 9.81, 0.2
    scene = study(beam(modes=modes), mass(0.2, cruise(place, 0.8, 0.3)), initial="rest", solver={"tolerance": 1e-2})
    found = studies.run(scene)
    omega = (np.arange(1, modes + 1) * np.pi) ** 2
    shapes = 2.0 * np.sin(np.sqrt(omega) * place) ** 2
    missed = (place * (1.0 - place)) ** 2 / 3.0 - np.sum(shapes / omega**2)
    least = float(found.car_contact_force_min)
    light = shapes.sum() + omega[-1] ** 2 * missed
    assert least == pytest.approx(weight / (1.0 + 0.2 * light), rel=1e-9)
    error = float(found.estimated_error.sel(result="car_contact_force_min"))
    assert np.isnan(error) if modes == MAX_MODES else least / weight <= error <= 5.0 * least / weight


SLIM = {"box": PORTAL["section"]["box"] | {"second_moment_lateral": 2e-7, "torsion_constant": 1e-6}}


@pytest.mark.parametrize(("elements", "mass"), [(8, 40.0), (12, 40.0), (12, 400.0), (20, 40.0), (20, 400.0)])
def test_a_last_level_of_hardly_more_modes_tells_no_less_of_what_these_converge_by(elements: int, mass: float) -> None:
    """Of 51, 59 and 64 modes the last ones change little: three times that was a half of the error. The truth is g m
    m_F/(m + m_F), m_F the mass that the whole finite-element model has there; sensors tell the same as carriages."""
    girder = PORTAL["member"]["girder"] | {"elements": elements}
    portal = PORTAL | {"section": SLIM, "member": PORTAL["member"] | {"girder": girder}, "damping_ratio": 0.02}
    car = {"car": {"on": "portal", "kind": "mass", "mass": mass, "motion": cruise(1.0, 3.0, 2.0)}}
    sensor = {"middle": {"body": "portal", "at": 2.0}, "wheel": {"carriage": "car", "quantity": "contact_force"}}
    found = studies.run(Study(kind="passage", initial="rest", body={"portal": portal}, carriage=car, sensor=sensor))
    assembly = assemble(Frame.model_validate(portal))
    node = np.flatnonzero(np.linalg.norm(assembly.mesh.points - [1.0, 0.0, 2.0], axis=1) < 1e-9)
    row = np.flatnonzero(assembly.free == 6 * node + 2).item()
    light = np.linalg.inv(assembly.mass.toarray())[row, row]
    least, weight = float(found.wheel_min), mass * 9.80665
    told = [float(found.estimated_error.sel(result=name)) for name in ("wheel_min", "car_contact_force_min")]
    assert least == float(found.car_contact_force_min)
    assert told[0] == told[1] >= least / weight - 1.0 / (1.0 + mass * light) > 0.0


def test_levels_have_more_and_more_of_the_modes_that_loads_excite() -> None:
    """A portal so slender across its plane that its first dozen modes sway and twist there, beside 60 modes; a beam,
    all of whose modes are excited."""
    way = cruise(0.5, 3.5, 60.0)
    sensor = {"middle": {"body": "portal", "at": 2.0}}

    def run(**modes: int) -> Any:
        portal = PORTAL | {"section": SLIM, "damping_ratio": 0.02} | modes
        car = {"car": {"on": "portal", "kind": "mass", "mass": 400.0, "motion": way}}
        scene = Study(kind="passage", body={"portal": portal}, carriage=car, sensor=sensor, solver={"tolerance": 1e-3})
        return studies.run(scene), scene

    (found, scene), (truth, _) = run(), run(modes=60)
    levels = make_plan(scene).grids[0].mode_levels
    assert levels[0] > 12 and list(levels) == sorted(levels) and len(levels) >= 3
    off = abs(float(found.middle_max - truth.middle_max)) / float(found.middle_max / found.dynamic_amplification[0])
    assert off <= float(found.estimated_error.sel(result="middle_max")) + 1e-4
    assert abs(float(found.dynamic_amplification[0]) - 1.0) > 1e-2  # what no mode of the first dozen tells
    assert only_grid(passages(sweep={})).mode_levels == (4, 8, 16, 32, 64)


@pytest.mark.slow
def test_errors_of_what_a_head_beside_the_axis_pushes_are_told() -> None:
    """Of a portal whose head brakes by a lever half of the errors by the first three levels were told too small, up to
    4.6 times, as long as the head did not feel all that few modes miss under it."""
    sweep = {"acceleration": {"of": "carriage.head.motion.acceleration", "values": [2.0, 3.0, 4.0, 5.0, 6.0, 7.0]}}
    told, observed = np.zeros(0), np.zeros(0)
    for wanted in (1e-2, 2e-2, 3e-2):
        given = engine.load(find_study("machine-tool"))
        plan = make_plan(given.with_values({"sweep": sweep, "solver.tolerance": wanted}))
        found = audit(plan, np.arange(plan.size))
        tolerance = tolerances(results_of(plan.asked))[:, None]
        matters = (found.observed > 0.01 * tolerance) & (found.observed > found.doubt)
        told = np.append(told, found.told[matters])
        observed = np.append(observed, found.observed[matters])
    assert observed.size > 10
    assert np.mean(told < observed) <= 0.02
