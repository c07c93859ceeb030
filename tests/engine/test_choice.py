"""The choice per variant: monotone in the tolerance, a function of the variant alone, and without jumps in results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.execution import run
from engine.plan import Plan, make_plan
from engine.scene import Study
from results_schema.status import Fidelity, Status
from tests.calibration.choice_scenes import draw
from tests.engine.build import Table, beam, cruise, fixed, mass, oscillator, study

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

TOLERANCES = np.geomspace(1e-1, 1e-5, 41)
SEED = 5
SCENES = [1, 5, 13, 15, 17, 20, 24, 25, 26]  # lane 3 of 25: a spring that few models know


def used(plan: Plan) -> Counts:
    """(V, 3) model, modes and steps that a plan gives its variants; statics take none."""
    found = np.zeros((plan.size, 3), dtype=np.int64)
    for bucket in plan.buckets:
        steps = 0 if bucket.scene.fidelity is Fidelity.STATIC else bucket.steps
        found[bucket.variants] = (int(bucket.scene.fidelity), bucket.scene.body_modes, steps)
    return found


def costs(chosen: Counts) -> Array:
    """(V,) modes x steps."""
    return np.asarray(chosen[:, 1] * chosen[:, 2], dtype=np.float64)


def at_tolerances(given: Study) -> Study:
    sweep = {"tolerance": {"of": "solver.tolerance", "values": TOLERANCES.tolist()}}
    return given.with_values({"sweep": sweep})


def drawn(number: int, lane: int) -> Study:
    """One variant of a random scene of the calibration."""
    scene = draw(SEED, number)
    return scene.study(np.array([lane])).with_values(
        {"sweep": {}} | {path: float(column[lane]) for path, column in scene.columns.items()}
    )


@pytest.mark.parametrize("number", SCENES)
def test_a_tighter_tolerance_never_gets_a_cheaper_model(number: int) -> None:
    chosen = used(make_plan(at_tolerances(drawn(number, 3))))
    assert np.all(np.diff(costs(chosen)) >= 0.0), chosen[np.flatnonzero(np.diff(costs(chosen)) < 0.0)[0] :][:2]


BED = beam(modes="auto", damping_ratio=0.02)
CROSSING = cruise(0.0, 1.0, 0.5)


@pytest.mark.parametrize(
    "given",
    [
        study(beam(modes=6), mass(0.2, CROSSING)),
        study(BED, mass(0.2, CROSSING), solver={"fidelity": "force"}),
        study(BED, mass(0.2, CROSSING), solver={"scheme": "fox-goodwin"}),
        study(BED, mass(0.2, CROSSING), solver={"static_correction": False}),
        study(BED, mass(0.2, CROSSING), sensor={"speed": fixed(0.5, "velocity")}),
        study(BED, oscillator(0.2, 1e4, CROSSING)),
        study(BED, {"a": mass(0.2, CROSSING), "b": mass(0.1, CROSSING, delay=0.5)}),
    ],
    ids=["fixed modes", "fixed model", "conditional", "uncorrected", "velocity", "stiff spring", "two carriages"],
)
def test_monotone_whatever_is_fixed(given: Study) -> None:
    chosen = used(make_plan(at_tolerances(given)))
    assert np.all(np.diff(costs(chosen)) >= 0.0), chosen
    assert costs(chosen)[-1] > costs(chosen)[0]


def test_choices_aim_at_less_than_the_tolerance() -> None:
    """All errors that are told beforehand sum up to 0.6 of it at most, as one of them may be larger than told."""
    plan = make_plan(at_tolerances(study(BED, mass(0.2, CROSSING))))
    part = np.zeros(TOLERANCES.size)
    for bucket in plan.buckets:
        told = bucket.told
        part[bucket.variants] = told.error_fidelity + told.error_modes + told.error_steps
    held = TOLERANCES >= 1e-3  # with no more than the 24 modes that are chosen from
    part = (part / TOLERANCES)[held]
    assert np.all(part <= 0.6) and np.median(part) > 0.3


def test_springs_that_are_as_good_as_none_or_rigid() -> None:
    """A soft spring carries a force, a stiff one a mass; both hold the tolerance against the carriage's own model."""
    springs = {"spring": {"of": "carriage.car.stiffness", "values": [0.01, 3e3]}}
    carriage = oscillator(0.05, 1.0, cruise(0.0, 1.0, 0.03), damping=0.02)
    given = study(BED, carriage, sweep=springs, solver={"tolerance": 1e-2})
    found, truth = run(given), run(given.with_values({"solver.fidelity": "full", "solver.tolerance": 5e-3}))
    assert found.fidelity_used.values.tolist() == [Fidelity.FORCE, Fidelity.MASS]
    assert np.all(found.relative_cost.values < 0.1)
    for end in ("max", "min"):
        gap = np.abs(found[f"midspan_{end}"].values - truth[f"midspan_{end}"].values)
        assert np.all(gap <= 1e-2 * truth.midspan_static.values)


def test_statics_need_their_correction() -> None:
    """Without it they leave 3 % of a bending moment out with twelve modes."""
    slow = mass(0.2, cruise(0.0, 1.0, 1e-4))
    for corrected in (True, False):
        solver = {"static_correction": corrected}
        plan = make_plan(study(BED, slow, sensor={"moment": fixed(0.5, "bending_moment")}, solver=solver))
        assert (used(plan)[0, 0] == Fidelity.STATIC) == corrected


def test_a_fixed_model_costs_no_accuracy_elsewhere() -> None:
    """What a model leaves out that the study asks for is no reason for more modes or steps."""
    fixed_model = study(BED, mass(0.2, CROSSING), solver={"fidelity": "force"})
    found = used(make_plan(fixed_model))
    assert costs(found)[0] <= 2.0 * costs(used(make_plan(study(BED, mass(0.2, CROSSING)))))[0]


NAMES = (
    "midspan_max",
    "midspan_min",
    "midspan_rms",
    "midspan_max_position",
    "midspan_static",
    "error_estimate",
    "error_fidelity",
    "error_modes",
    "error_steps",
    "relative_cost",
    "fidelity_used",
    "modes_used",
    "steps_used",
    "status",
)


def numbers(given: Study, variant: int = 0, **how: Any) -> dict[str, float]:
    """What is reported of one variant."""
    found = run(given, **how)
    return {name: float(np.asarray(found[name].values).reshape(-1)[variant]) for name in NAMES}


def variants(count: int) -> list[tuple[float, float, float, str]]:
    """Speed, mass, damping ratio and supports."""
    random = np.random.default_rng(20)
    return [
        (
            float(np.exp(random.uniform(np.log(0.02), np.log(1.5)))),
            float(np.exp(random.uniform(np.log(0.01), 0.0))),
            float(random.choice([0.004, 0.013, 0.05])),
            str(random.choice(["pinned-pinned", "clamped-pinned", "clamped-free"])),
        )
        for _ in range(count)
    ]


@pytest.mark.parametrize(("speed", "kilograms", "damping", "supports"), variants(2))
def test_a_function_of_the_variant_alone(speed: float, kilograms: float, damping: float, supports: str) -> None:
    """The same variant alone, in a line, in a grid, in pairs, and beside other bodies: the same to the last bit."""
    given = study(
        beam(modes="auto", damping_ratio=damping, supports=supports), mass(kilograms, cruise(0.0, 1.0, speed))
    )

    def swept(together: bool = False, **axes: Any) -> Study:
        tables = {f"axis{k}": {"of": path, "values": values} for k, (path, values) in enumerate(axes.items())}
        return given.with_values({"sweep": tables | ({"zip": True} if together else {})})

    pace, load, zeta = "carriage.car.motion.speed", "carriage.car.mass", "body.bed.damping_ratio"
    alone = numbers(given)
    assert alone["status"] in (Status.OK, Status.SEPARATED)
    for other in (
        swept(**{pace: [speed, 1.3 * speed, 0.4 * speed], load: [kilograms, 0.3]}),
        swept(together=True, **{zeta: [damping, 0.02, 0.07], pace: [speed, 0.3, speed]}),
        swept(**{"solver.tolerance": [1e-3, 1e-2]}),
        swept(**{"body.bed.length": [1.0, 2.0], load: [kilograms, 2.0 * kilograms]}),
    ):
        np.testing.assert_equal(numbers(other), alone)


GRID = {
    "speed": {"of": "carriage.car.motion.speed", "from": 0.02, "to": 1.0, "count": 6, "spacing": "log"},
    "mass": {"of": "carriage.car.mass", "values": [0.01, 0.5]},
}


@pytest.mark.parametrize(("threads", "chunk"), [(1, 7), (2, None)])
def test_neither_chunks_nor_threads_matter(threads: int, chunk: int | None) -> None:
    given = study(BED, mass(0.2, CROSSING), sweep=GRID)
    first, again = run(given, threads=1), run(given, threads=threads, chunk=chunk)
    assert np.unique(first.steps_used.values).size > 3
    for name in NAMES:
        np.testing.assert_array_equal(first[name].values, again[name].values)


def test_order_of_the_sweep_does_not_matter() -> None:
    values = np.geomspace(0.02, 1.0, 12)
    axis = {"of": "carriage.car.motion.speed"}
    there, back = (
        run(study(BED, mass(0.2, CROSSING), sweep={"speed": axis | {"values": part.tolist()}}))
        for part in (values, values[::-1])
    )
    for name in NAMES:
        np.testing.assert_array_equal(there[name].values, back[name].values[::-1])


def bracketed(
    given: Study, path: str, low: float, high: float, planned: Callable[[Study], Plan] = make_plan
) -> tuple[Array, Array]:
    """Pairs of values next to each other, on both sides of every change of what is chosen along a line."""

    def chosen(values: Array) -> Counts:
        sweep = {"line": {"of": path, "values": values.tolist()}}
        return used(planned(given.with_values({"sweep": sweep})))

    line = np.geomspace(low, high, 50)
    before, after = line[:-1], line[1:]
    for _ in range(3):
        fine = before[:, None] + (after - before)[:, None] * np.linspace(0.0, 1.0, 21)
        found = chosen(np.unique(fine))[np.searchsorted(np.unique(fine), fine)]
        changes = np.any(found[:, 1:] != found[:, :-1], axis=2)
        row, column = np.nonzero(changes)
        before, after = fine[row, column], fine[row, column + 1]
    return before, after


LINES: dict[str, tuple[Table, str, float, float]] = {
    "speed": (mass(0.3, CROSSING), "carriage.car.motion.speed", 0.01, 1.2),
    "mass": (mass(0.3, CROSSING), "carriage.car.mass", 0.005, 1.0),
    "damping": (mass(0.3, CROSSING), "body.bed.damping_ratio", 0.002, 0.1),
    "stiffness": (oscillator(0.3, 10.0, CROSSING), "carriage.car.stiffness", 1.0, 1000.0),
}


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [("speed", 1e-3), ("mass", 1e-2), ("damping", 1e-3), ("stiffness", 1e-2)],
)
def test_no_jumps_where_the_choice_changes(name: str, tolerance: float) -> None:
    carriage, path, low, high = LINES[name]
    given = study(BED, carriage, solver={"tolerance": tolerance})
    before, after = bracketed(given, path, low, high)
    assert before.size >= 1 and np.all((after - before) <= 5e-5 * before)
    sides = [run(given.with_values({"sweep": {"line": {"of": path, "values": v.tolist()}}})) for v in (before, after)]
    for end in ("max", "min"):
        one, two = (side[f"midspan_{end}"].values for side in sides)
        jump = np.abs(one - two) / sides[0].midspan_static.values
        assert np.all(jump <= 2.0 * tolerance)
