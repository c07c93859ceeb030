"""How many steps, which scenes and groups: rules with numbers, refusals with their texts, sweeps of anything."""

import math
import threading
from functools import partial
from typing import Any

import numpy as np
import pytest

from engine.accuracy.reference import USUAL_LEVEL, in_full, level_work
from engine.batch.execution import run
from engine.batch.executors import run_jobs
from engine.batch.plan import LARGEST, make_plan, needed_memory
from engine.march.step_rules import MOST_STEPS
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.engine.build import beam, cruise, fixed, force, mass, oscillator, shuttle, study

MODES = 6


def swept(path: str, values: list[float], carriage: Any, bed: Any = None, **changes: Any) -> Study:
    sweep = {"axis": {"of": path, "values": values}}
    return study(bed or beam(modes=MODES), carriage, sweep=sweep, **changes)


SPEEDS = [0.02, 0.1, 0.3, 1.0, 2.0, 5.0, 20.0]


@pytest.mark.parametrize(
    ("scheme", "limit"), [("linear-acceleration", 12**0.5), ("fox-goodwin", 6**0.5), ("central-difference", 2.0)]
)
def test_auto_steps_stay_inside_the_stability_limit(scheme: str, limit: float) -> None:
    modes = 16
    given = swept(
        "carriage.car.motion.speed",
        SPEEDS,
        mass(0.1, cruise(0.0, 1.0, 1.0, after=1.0)),
        beam(modes=modes),
        solver={
            "scheme": scheme,
            "tolerance": 0.1,
            "fidelity": "full",
        },  # what undamped modes leave is not the question
    )
    highest = (modes * math.pi) ** 2
    ds = run(given)
    assert np.all(highest / (np.array(SPEEDS) * ds.steps_used.values) <= limit / 1.05 * (1 + 1e-12))
    assert set(ds.status.values.tolist()) <= {0, 1}
    assert np.isfinite(ds.midspan_max.values).all()


def test_swept_numbers_are_labelled_by_their_names() -> None:
    """In plots of xarray on one line; which keys they set stands beside it."""
    found = run(swept("carriage.car.motion.speed", SPEEDS, force(1.0, cruise(0.0, 1.0, 1.0))))
    assert found.axis.attrs == {"units": "m s-1", "long_name": "axis", "comment": "of carriage.car.motion.speed"}
    (line,) = found.midspan_max.plot()
    assert line.axes.get_xlabel() == "axis [m s-1]"


@pytest.mark.fault(12)
def test_a_step_beyond_the_limit_is_refused() -> None:
    """Fault 12: limit, what was found, and a suggestion that is then accepted."""

    def given(steps: int) -> Study:
        solver = {"scheme": "central-difference", "steps": steps}
        return study(beam(modes=10), mass(0.1, cruise(0.0, 1.0, 1.0)), solver=solver)

    with pytest.raises(BadInput) as caught:
        make_plan(given(300))
    error = caught.value
    assert error.exit_code == 2
    assert error.where == "solver.steps"
    assert "omega h <= 2 " in error.expected
    assert f"{(10 * math.pi) ** 2 / 300:.4g}" in error.received
    enough = int(error.remedy.split()[2])
    assert (10 * math.pi) ** 2 / enough < 2.0
    assert 'steps = "auto"' in error.remedy
    make_plan(given(enough))


@pytest.mark.fault(12)
def test_the_worst_variant_decides_whether_a_fixed_step_is_refused() -> None:
    given = swept(
        "carriage.car.motion.speed",
        [5.0, 0.05, 1.0],
        mass(0.1, cruise(0.0, 1.0, 1.0)),
        solver={"scheme": "fox-goodwin", "steps": 400},
    )
    with pytest.raises(BadInput, match="beyond the scheme's stability limit"):
        make_plan(given)


@pytest.mark.fault(10, 13)
def test_too_many_steps_are_refused() -> None:
    """Fault 13: asked for, or needed by a carriage that hardly moves."""
    with pytest.raises(BadInput) as caught:
        study(beam(), mass(0.1, cruise(0.0, 1.0, 1.0)), solver={"steps": MOST_STEPS + 1})
    assert caught.value.where == "solver.steps"
    with pytest.raises(BadInput) as caught:
        make_plan(study(beam(), mass(0.1, cruise(0.0, 1.0, 1e-9))))
    assert caught.value.where == "solver.steps"
    assert "too many steps" in caught.value.what
    assert str(MOST_STEPS) in caught.value.expected
    with pytest.raises(BadInput):
        make_plan(study(beam(), mass(0.1, cruise(0.0, 1.0, 1e-300))))


def test_a_variant_of_few_is_computed_as_by_itself() -> None:
    """What a part of a sweep is computed with is the part of what the whole is."""
    speeds = np.geomspace(0.05, 20.0, 12).tolist()
    masses = [0.1, 0.5, 2.0]
    carriage = mass(0.5, cruise(0.0, 1.0, 1.0))
    sweep = {"speed": {"of": "carriage.car.motion.speed", "values": speeds}}
    sweep["mass"] = {"of": "carriage.car.mass", "values": masses}
    whole = run(study(beam(modes=MODES), carriage, sweep=sweep)).steps_used.values
    chosen = [1, 5, 8, 11]
    sweep["speed"] = {"of": "carriage.car.motion.speed", "values": [speeds[i] for i in chosen]}
    sweep["mass"] = {"of": "carriage.car.mass", "values": masses[1:2]}
    part = run(study(beam(modes=MODES), carriage, sweep=sweep)).steps_used.values
    np.testing.assert_array_equal(part, whole[chosen, 1:2])
    for i in chosen:
        alone = study(beam(modes=MODES), mass(masses[2], cruise(0.0, 1.0, speeds[i])))
        assert int(run(alone).steps_used) == whole[i, 2]
    assert len(np.unique(whole)) > 3


def test_jobs_begin_in_their_order() -> None:
    """Tables are dropped behind the jobs that need them: while the first job lasts, another thread does the next ones
    in turn."""
    seen: list[int] = []
    enough = threading.Event()

    def job(number: int) -> None:
        if number == 0:
            enough.wait(10.0)
        seen.append(number)
        if number == 30:
            enough.set()

    run_jobs([partial(job, number) for number in range(60)], 2)
    assert seen[:30] == list(range(1, 31)) and sorted(seen) == list(range(60))


def test_the_memory_of_cycles_has_room_for_their_tables() -> None:
    """Beside what any study takes, about twice the tables of a usual reference; those of a passage are not kept."""
    for motion, times in ((shuttle(0.2, 0.8, 1.0, 0.1, 3), LARGEST), (cruise(0.0, 1.0, 1.0), 0)):
        plan = make_plan(study(beam(modes="auto"), mass(0.3, motion), sensor={"place": fixed(0.4)}))
        grid, levels = plan.grids[0], in_full(plan.grids[0])
        model = grid.model(levels.numerics[USUAL_LEVEL])
        by = level_work(grid, grid.values, levels, USUAL_LEVEL).max() / (model.body_modes * grid.unit)
        tables = grid.once(model, int(by))
        kept = sum({id(table): table.bytes for table in map(tables.table, tables.timeline.segments)}.values())
        room = plan.memory_bytes - needed_memory(plan.study, plan.size, plan.gathered_bytes)
        assert kept * times / 1.5 <= room <= kept * times * 1.5


def test_every_variant_is_in_one_group() -> None:
    sweep = {
        "speed": {"of": "carriage.car.motion.speed", "from": 0.1, "to": 5.0, "count": 9},
        "length": {"of": "body.bed.length", "values": [1.0, 1.5]},
        "steps": {"of": "solver.steps", "values": [100, 300]},
    }
    plan = make_plan(study(beam(), mass(0.5, cruise(0.0, 1.0, 1.0)), sweep=sweep))
    assert sorted(v for group in plan.groups for v in group.variants.tolist()) == list(range(36))
    assert {group.steps for group in plan.groups} == {100, 300}


SPRINGS = [{"at": 0.0, "stiffness": 300.0}, {"at": 1.0, "stiffness": 300.0, "damping": 0.5}]
ON_SPRINGS = beam(supports=SPRINGS, damping_ratio=0.01)
PASSING = mass(0.5, cruise(0.0, 1.0, 1.0))
SPRUNG = oscillator(0.6, 40.0, cruise(0.0, 1.0, 0.8), wheel_mass=0.2, damping=1.5)
RETURNING = mass(0.5, shuttle(0.3, 0.9, 1.0, 0.1, 2))
STRUCTURAL: dict[str, tuple[str, list[float], Any, Any]] = {
    "length": ("body.bed.length", [1.0, 1.2, 1.7], ON_SPRINGS, PASSING),
    "modes": ("body.bed.modes", [1, 3, 7], ON_SPRINGS, PASSING),
    "support": ("body.bed.supports.0.stiffness", [10.0, 300.0], ON_SPRINGS, PASSING),
    "damper": ("body.bed.supports.1.damping", [0.1, 5.0], ON_SPRINGS, PASSING),
    "modulus": ("body.bed.youngs_modulus", [0.5, 2.0], ON_SPRINGS, PASSING),
    "density": ("body.bed.density", [0.5, 2.0], ON_SPRINGS, PASSING),
    "turn": ("carriage.car.motion.turn", [0.0, 0.1, 0.5], ON_SPRINGS, RETURNING),
    "end": ("carriage.car.motion.end", [0.5, 0.8], ON_SPRINGS, RETURNING),
    "cycles": ("carriage.car.motion.cycles", [1, 3], ON_SPRINGS, RETURNING),
    "place": ("sensor.midspan.at", [0.2, 0.7], ON_SPRINGS, PASSING),
    "mass": ("carriage.car.mass", [0.1, 0.9], ON_SPRINGS, PASSING),
    "speed": ("carriage.car.motion.speed", [0.4, 2.0], ON_SPRINGS, PASSING),
    "gravity": ("gravity", [1.0, 9.0], ON_SPRINGS, PASSING),
    "damping": ("body.bed.damping_ratio", [0.0, 0.3], ON_SPRINGS, PASSING),
    "delay": ("carriage.car.delay", [0.0, 0.2], ON_SPRINGS, PASSING),
    "steps": ("solver.steps", [150, 333], ON_SPRINGS, PASSING),
    "Rayleigh": ("body.bed.damping_ratio.rayleigh.1", [0.0, 0.01], {"rayleigh": [0.1, 0.0]}, PASSING),
    "list": ("body.bed.damping_ratio.2", [0.0, 0.2], [0.0, 0.1, 0.2, 0.3], PASSING),
    "wheel": ("carriage.car.wheel_mass", [0.1, 0.3], ON_SPRINGS, SPRUNG),
    "shock absorber": ("carriage.car.damping", [0.5, 2.0], ON_SPRINGS, SPRUNG),
    "beta": ("solver.beta", [0.25, 0.3], ON_SPRINGS, PASSING),
}


@pytest.mark.parametrize("name", STRUCTURAL)
def test_a_swept_number_gives_the_same_as_a_study_of_its_own(name: str) -> None:
    path, listed, bed, carriage = STRUCTURAL[name]
    bed = bed if "kind" in bed else beam(supports=SPRINGS, damping_ratio=bed)
    changes: dict[str, Any] = {"sensor": {"midspan": fixed(0.5), "moment": fixed(0.4, "bending_moment")}}
    if name == "beta":
        changes["solver"] = {"scheme": "newmark", "beta": 0.25, "gamma": 0.55}
    if name == "delay":
        carriage = {"car": PASSING, "next": force(1.0, cruise(0.0, 1.0, 0.9))}
    given = swept(path, listed, carriage, bed, **changes)
    whole = run(given)
    names = [str(key) for key, array in whole.data_vars.items() if "axis" in array.dims]
    assert {"midspan_max", "moment_min", "status", "car_contact_force_min", "steps_used"} <= set(names)
    lines: set[tuple[float, float]] = set()
    for i, value in enumerate(listed):
        alone = run(given.without_sweep().with_values({path: value}))
        for key in names:
            assert whole[key].values[i].tobytes() == alone[key].values.tobytes(), (key, value)
        lines.add((float(alone.midspan_max), float(alone.midspan_rms)))
    assert len(lines) == len(listed)


def test_headway_keeps_one_scene_and_delay_does_not() -> None:
    """With a headway the timing scales with the speed, so all speeds share one table."""
    speed = {"speed": {"of": [f"carriage.{name}.motion.speed" for name in ("car", "next")], "values": [0.5, 0.7, 1.1]}}
    way = cruise(0.0, 1.0, 1.0)
    with_headway = {"car": PASSING, "next": mass(0.2, way, headway=0.3)}
    with_delay = {"car": PASSING, "next": mass(0.2, way, delay=0.3)}
    plans = [
        make_plan(study(beam(), riding, sweep=speed, solver={"steps": 100})) for riding in (with_headway, with_delay)
    ]
    assert [len(plan.groups) for plan in plans] == [1, 3]


def test_fixed_steps_are_over_one_passage_or_cycle() -> None:
    ds = run(study(beam(), RETURNING, solver={"steps": 60}, output={"histories": "all"}))
    assert ds.midspan.size == 2 * 60 + 1
    assert int(ds.steps_used) == 60
    every = run(study(beam(), RETURNING, solver={"steps": 60}, output={"histories": {"every": 7}}))
    np.testing.assert_array_equal(every.midspan.values, ds.midspan.values[::7])


def test_a_study_without_sensors_or_sweep() -> None:
    ds = run(study(beam(), PASSING, sensor={}))
    assert ds.status.dims == ()
    assert np.isfinite(float(ds.car_contact_force_min))


def test_nothing_moves() -> None:
    with pytest.raises(BadInput, match="nothing moves"):
        make_plan(study(beam(), {}))
