"""The comparison schemes: the same numbers as dense matrices, their orders, their limits, and how they fail."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from engine.kernels.layout import LARGEST, LARGEST_AT, SMALLEST, Newmark, State
from engine.kernels.schemes import generalized_alpha
from engine.march.march import march
from engine.march.tables import SceneTables
from engine.methods.comparison import (
    COMPARISON,
    Compared,
    ComparisonScheme,
    coupled,
    frozen_track,
    march_comparison,
    propagate_comparison,
    rigid_tie,
    wilson_theta,
)
from engine.model.lane_table import from_blocks, lane_table, padded, to_blocks
from engine.model.scene_model import SceneModel, build_model
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from results_schema.errors import BadInput
from results_schema.status import Status
from tests.engine.build import beam, cruise, force, mass, shuttle, study, swing
from tests.engine.twin import bed_of, damping_of, load_of
from tests.naive import comparison as naive
from tests.naive import ode
from tests.naive import scene as scenes
from tests.naive.scene import Array

CALM = rigid_tie(generalized_alpha(0.5).coefficients)  # m = 0, f = 1/3
SCHEMES = {**COMPARISON, "rigid-tie-calm": CALM}
PLAIN = {"static_correction": False}


def tables_of(given: Study, steps: int) -> SceneTables:
    """The tables of a study."""
    return SceneTables(build_model(given, {}, {}), steps, "whole")


def run(scheme: ComparisonScheme, tables: SceneTables, **columns: Any) -> Compared:
    """March variants by a scheme with everything sampled at every station."""
    size = max((len(column) for column in columns.values()), default=1)
    variants = padded(np.arange(size))
    swept = {path.replace("__", "."): np.asarray(column)[variants] for path, column in columns.items()}
    values = VariantValues(tables.model.study, swept, variants.size)
    counts = np.arange(tables.timeline.steps + 1)
    return march_comparison(scheme, tables, values, counts, size, sampled=len(tables.signals))


def marched(tables: SceneTables) -> Array:
    """(H, signals) of the march itself."""
    values = VariantValues(tables.model.study, {}, 16)
    counts = np.arange(tables.timeline.steps + 1)
    return march(tables, values, counts, 1, sampled=len(tables.signals)).history[:, :, 0]


def naive_scene(given: Study, end: float) -> tuple[scenes.Scene, Array]:
    """The study for dense matrices, and the row of its sensor."""
    bed = bed_of(given, "bed")
    zeta = damping_of(given.body["bed"].damping_ratio, bed.omega)
    return scenes.Scene(bed.phi, bed.omega, zeta, (load_of(given, "car", bed.length, end),)), bed.phi(0.5, 0)


def crossing(kilograms: float = 0.04, **changes: Any) -> Study:
    """A mass that crosses the middle of a beam of four damped modes."""
    given = {"solver": PLAIN} | changes
    return study(beam(damping_ratio=0.02), mass(kilograms, cruise(0.1, 0.8, 1.3)), **given)


def turning(kilograms: float = 0.04) -> Study:
    """A mass that turns at an instant, twice."""
    return study(beam(damping_ratio=0.02, modes=3), mass(kilograms, shuttle(0.25, 0.75, 1.0, 0.0, 1)), solver=PLAIN)


def twin_step(name: str, scene: scenes.Scene, counts: list[int]) -> naive.Step:
    """The dense step of a scheme."""
    steps: dict[str, naive.Step] = {
        "wilson-theta": naive.wilson(1.4),
        "rk4": naive.rk4,
        "lagged-inertia": naive.lagged_inertia,
        "lagged-convective": naive.lagged_convective,
        "picard": naive.picard(counts, relaxed=False),
        "picard-relaxed": naive.picard(counts, relaxed=True),
        "rigid-tie": naive.Rigid(scene).step,
        "rigid-tie-calm": naive.Rigid(scene, 0.0, 1.0 / 3.0).step,
    }
    return steps[name]


@pytest.mark.parametrize("name", SCHEMES)
def test_as_dense_matrices(name: str) -> None:
    given = crossing()
    tables = tables_of(given, 90)
    found = run(SCHEMES[name], tables)
    duration = 0.7 / 1.3
    scene, row = naive_scene(given, duration)
    counts: list[int] = []
    twin = naive.march(scene, np.linspace(0.0, duration, 91), scenes.rest(scene), twin_step(name, scene, counts))
    same_history(found, np.array([[row @ now.q, now.force] for now in twin]))
    assert found.effort.iterations[0] == pytest.approx(sum(counts) / 90, abs=1e-12)
    assert found.effort.unconverged[0] == 0


@pytest.mark.parametrize("name", SCHEMES)
def test_as_dense_matrices_with_instant_turns(name: str) -> None:
    given = turning()
    tables = tables_of(given, 60)
    scene, row = naive_scene(given, 1.0)
    start = scenes.equilibrium(scene, 0.0)
    twin = naive.march(scene, np.linspace(0.0, 1.0, 61), start, twin_step(name, scene, []))
    same_history(run(SCHEMES[name], tables), np.array([[row @ now.q, now.force] for now in twin]))


def same_history(found: Compared, expected: Array) -> None:
    """Sensor and contact force within 1e-9 of their size; the marks are those of the history."""
    history = found.history[:, :, 0]
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(history / size, expected / size, rtol=0, atol=1e-9, equal_nan=False)
    np.testing.assert_array_equal(found.statistics[:, LARGEST, 0], history.max(axis=0))
    np.testing.assert_array_equal(found.statistics[:, LARGEST_AT, 0], history.argmax(axis=0))
    np.testing.assert_array_equal(found.statistics[:, SMALLEST, 0], history.min(axis=0))


ORDERS = {"rk4": 4.0, "wilson-theta": 2.0, "picard-relaxed": 2.0, "rigid-tie-calm": 2.0}
ORDERS |= {"lagged-convective": 1.0, "lagged-inertia": 1.0}
SMOOTH_STEPS = (400, 800, 1600, 3200)


def swinging() -> Study:
    """A mass that swings smoothly over a beam of three modes."""
    swinging = swing(0.5, 0.3, 0.6, 1)
    return study(beam(modes=3, damping_ratio=0.02), mass(0.1, swinging), solver=PLAIN, initial="equilibrium")


@cache
def exact() -> Array:
    """(201, 2) sensor and contact force of that scene by DOP853."""
    given = swinging()
    scene, row = naive_scene(given, 1.0 / 0.6)
    start = scenes.equilibrium(scene, 0.0)
    times = np.linspace(0.0, 1.0 / 0.6, 201)
    history = ode.solve(scene, times, start, float(np.abs(start.q).max()))
    return np.column_stack([history.displacement(row), history.contact_force[:, 0]])


@pytest.mark.parametrize("name", ORDERS)
def test_order(name: str) -> None:
    errors = []
    for steps in SMOOTH_STEPS:
        found = run(SCHEMES[name], tables_of(swinging(), steps)).history[:: steps // 200, :, 0]
        errors.append(np.abs(found - exact()).max(axis=0) / np.abs(exact()).max(axis=0))
    slopes = -np.polyfit(np.log(SMOOTH_STEPS), np.log(errors), 1)[0]
    assert slopes == pytest.approx(ORDERS[name], abs=0.25)
    assert SCHEMES[name].order == ORDERS[name]


def test_picard_is_the_implicit_march_where_it_converges() -> None:
    for given in (crossing(0.02), study(beam(own_weight=True), mass(0.02, cruise(-0.1, 1.1, 0.9, after=1.0)))):
        tables = tables_of(given, 200)
        expected = marched(tables)
        for name in ("picard", "picard-relaxed"):
            found = run(COMPARISON[name], tables)
            for signal, values in enumerate(expected.T):
                read = np.isfinite(values)  # the contact force is not at the end of the span
                assert read.mean() > 0.3
                size = np.abs(values[read]).max()
                history = found.history[read, signal, 0]
                np.testing.assert_allclose(history / size, values[read] / size, rtol=0, atol=1e-9, equal_nan=False)
            assert found.effort.unconverged[0] == 0
            assert found.status[0] == Status.OK


@pytest.mark.fault(22)
def test_picard_contracts_where_r_is_below_one() -> None:
    """r = m sum phi^2/(1 + 2 zeta omega gamma h + beta h^2 omega^2) of the worst place; relaxed it always does."""
    tables = tables_of(crossing(), 300)
    bed = bed_of(tables.model.study, "bed")
    h = 0.7 / 1.3 / 300
    places = np.array([bed.phi(s, 0) for s in np.linspace(0.1, 0.8, 301)])
    worst = float((places**2 / (1.0 + 0.02 * bed.omega * h + 0.25 * h**2 * bed.omega**2)).sum(axis=1).max())
    masses = np.array([0.3, 0.5, 1.05, 2.0, 5.0]) / worst
    plain = run(COMPARISON["picard"], tables, carriage__car__mass=masses)
    relaxed = run(COMPARISON["picard-relaxed"], tables, carriage__car__mass=masses)
    assert (plain.effort.unconverged[:2] == 0).all()
    assert (plain.effort.unconverged[2:] > 0).all()
    assert np.isnan(plain.history[-1, :, 2:]).all()
    expected = np.where(plain.effort.unconverged == 0, Status.OK, Status.NOT_CONVERGED)
    np.testing.assert_array_equal(plain.status, expected)
    assert (relaxed.effort.unconverged == 0).all()
    assert (relaxed.status == Status.OK).all()
    assert ((relaxed.effort.iterations > 3.0) & (relaxed.effort.iterations < 7.0)).all()
    assert (plain.effort.iterations[:2] > relaxed.effort.iterations[:2]).all()


def test_a_rigid_tie_rings_and_damping_of_the_highest_frequencies_calms_it() -> None:
    """Section 4: with average acceleration the force alternates from step to step and never stops doing so, after a
    mass was set down on the beam."""
    tables = tables_of(study(beam(modes=5), mass(0.1, cruise(0.1, 0.9, 0.8)), solver=PLAIN), 400)
    smooth = marched(tables)[:, 1]

    def alternating(scheme: ComparisonScheme) -> Array:
        """What changes its sign at every step, in weights: the most of it in each quarter of the passage."""
        error = (run(scheme, tables).history[:, 1, 0] - smooth) / 0.981
        part = 0.25 * (error[2:] - 2.0 * error[1:-1] + error[:-2])
        return np.array([np.abs(quarter).max() for quarter in np.split(part[:396], 4)])

    rings, calm = alternating(COMPARISON["rigid-tie"]), alternating(CALM)
    assert rings[0] > 0.1
    assert (np.diff(rings) > 0.0).all()
    assert rings[-1] > 1.0
    assert (calm < 0.02).all()


def test_own_weight_acts_on_the_contact() -> None:
    """The curve of the sag is a part of the convective terms."""
    given = study(beam(own_weight=True, damping_ratio=0.02, modes=2), mass(0.1, cruise(0.2, 0.8, 1.5)), solver=PLAIN)
    fine = marched(tables_of(given, 3200))[::8, 1]
    for name in ("rk4", "wilson-theta", "lagged-inertia", "lagged-convective", "picard-relaxed"):
        found = run(COMPARISON[name], tables_of(given, 400)).history[:, 1, 0]
        assert np.abs(found - fine).max() < 0.01 * np.abs(fine).max(), name


@pytest.mark.parametrize("name", SCHEMES)
def test_a_whole_passage_with_what_comes_after(name: str) -> None:
    """On to the body, off it and free vibration: near the march with a step eight times finer."""
    given = study(beam(modes=3, damping_ratio=0.02), mass(0.1, cruise(-0.25, 1.25, 0.9, after=2.0)), solver=PLAIN)
    tables = tables_of(given, 600)
    last = tables.timeline.segments[-1].first  # the steps of the free vibration do not follow from the others
    assert tables.timeline.segments[-1].free
    fine = marched(tables_of(given, 4800))[: 8 * last + 1 : 8, 0]
    found = run(SCHEMES[name], tables)
    assert np.abs(found.history[: last + 1, 0, 0] - fine).max() < 0.02 * np.abs(fine).max()
    free, same = found.history[last:, 0, 0], marched(tables)[last:, 0]
    assert np.abs(free - same).max() < 0.05 * np.abs(same).max()


@pytest.mark.parametrize("name", SCHEMES)
def test_variants_do_not_disturb_each_other(name: str) -> None:
    """Two blocks of variants, the last of them alone."""
    tables = tables_of(crossing(), 40)
    masses, speeds = np.linspace(0.01, 0.04, 20), np.linspace(0.5, 1.5, 20)
    both = {"carriage__car__mass": masses, "carriage__car__motion__speed": speeds}
    together = run(SCHEMES[name], tables, **both)
    assert together.history.shape[2] == 20
    for number in (0, 19):
        alone = run(SCHEMES[name], tables, **{path: column[[number]] for path, column in both.items()})
        np.testing.assert_array_equal(together.history[:, :, number], alone.history[:, :, 0])
        assert np.isfinite(alone.history).all()


def test_what_they_do_not_march_is_refused() -> None:
    way = cruise(0.0, 1.0, 1.0)
    two = build_model(study(beam(), {"car": mass(0.1, way), "next": mass(0.1, way)}), {}, {})
    springs = [{"at": 0.0, "stiffness": 60.0}, {"at": 1.0, "stiffness": 90.0, "damping": 0.5}]
    damped = build_model(study(beam(supports=springs), mass(0.1, way)), {}, {})
    for model in (two, damped):
        with pytest.raises(BadInput, match="one carriage, no dampers"):
            frozen_track(COMPARISON["rk4"], model, 0.5, 1)
    for refused in (study(beam(), force(1.0, way)), study(beam(own_weight=True), mass(0.1, way))):
        with pytest.raises(BadInput, match="own weight does not act"):
            frozen_track(COMPARISON["rigid-tie"], build_model(refused, {}, {}), 0.5, 1)
    with pytest.raises(BadInput, match="beta > 0"):
        rigid_tie(Newmark(0.0, 0.5))
    with pytest.raises(BadInput, match=r"1\.37 or more"):
        wilson_theta(1.0)


# ---- where they turn unstable: bisection on what kernels make of unit states at a held place ----


def held(modes: int, kilograms: float, damping: float = 0.0) -> SceneModel:
    """A beam with a mass to be held; a mass of 0 is a force."""
    way = cruise(0.0, 1.0, 1.0)
    car = mass(kilograms, way) if kilograms > 0.0 else force(1.0, way)
    return build_model(study(beam(modes=modes, damping_ratio=damping), car), {}, {})


def one_step(scheme: ComparisonScheme, model: SceneModel, step: float, advance: float = 0.0) -> Array:
    """(3N, 3N) what one step in s at a held midspan makes of (q, h q', h^2 q'')."""
    modes = model.omega.size
    units = 3 * modes
    size = padded(np.arange(units)).size
    lanes = lane_table(model, VariantValues(model.study, {}, size)).steps_of(to_blocks(np.full(size, step)))
    unit = np.eye(units, size).reshape(3, modes, size)
    state = State(*(to_blocks(part / step**power) for power, part in enumerate(unit)), np.zeros_like(lanes.stiffness))
    moved = propagate_comparison(scheme, frozen_track(scheme, model, 0.5, 1, advance), lanes, state).state
    return np.concatenate([from_blocks(part, units) * step**power for power, part in enumerate(moved[:3])])


def grows(scheme: ComparisonScheme, model: SceneModel, step: float, advance: float = 0.0) -> bool:
    """Whether a step at the held midspan makes something larger."""
    return bool(np.abs(np.linalg.eigvals(one_step(scheme, model, step, advance))).max() > 1.0 + 1e-7)


def bisected(unstable: Callable[[float], bool], low: float, high: float) -> float:
    """Where a scheme turns unstable, to 1e-4 of itself."""
    assert not unstable(low)
    assert unstable(high)
    while high - low > 1e-4 * low:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return 0.5 * (low + high)


@pytest.mark.parametrize("modes", [1, 4])
def test_limit_of_runge_kutta(modes: int) -> None:
    model = held(modes, 0.0)
    rk4 = COMPARISON["rk4"]
    limit = bisected(lambda x: grows(rk4, model, x / float(model.omega.max())), 2.0, 4.0)
    assert limit == pytest.approx(2.0 * math.sqrt(2.0), rel=1e-3)
    assert rk4.stability_limit == pytest.approx(limit, rel=1e-3)


def test_lagged_convective_stays_stable_where_lagged_inertia_fails() -> None:
    assert not grows(COMPARISON["lagged-convective"], held(10, 0.5, 0.01), 3e-3, advance=1e-4)
    assert grows(COMPARISON["lagged-inertia"], held(10, 0.5, 0.01), 3e-3, advance=1e-4)


def test_limits_are_those_of_the_scheme_of_the_modes() -> None:
    linear = Newmark(1 / 6, 1 / 2)
    model = held(2, 0.0)
    for scheme in (coupled("lagged-inertia", linear), coupled("picard-relaxed", linear)):
        limit = bisected(lambda x, one=scheme: grows(one, model, x / float(model.omega.max())), 2.0, 5.0)
        assert limit == pytest.approx(math.sqrt(12.0), rel=1e-3)
        assert scheme.stability_limit == pytest.approx(limit, rel=1e-3)
