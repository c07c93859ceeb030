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
from engine.batch.plausibility import REMARKS, remarks
from engine.march.step_rules import MOST_STEPS
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.engine.build import beam, cruise, fixed, force, mass, oscillator, shuttle, study
from tests.studies.at_rest import PORTAL

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


# ---- what is allowed and yet often a mistake is remarked ----


WAY = cruise(0.0, 1.0, 0.5)


def passing(bed: Any = None, car: Any = None, **changes: Any) -> Study:
    return study(bed or beam(), car or mass(0.1, WAY), gravity=0.1, **changes)


def on_portal(**more: Any) -> Study:
    """A mass over a portal that sways."""
    car = mass(20.0, shuttle(1.0, 3.0, 0.5, 0.2, 1), on="portal") | more
    return Study(schema_version=1, kind="passage", body={"portal": PORTAL}, carriage={"car": car})


STOP = {"kind": "point-to-point", "start": 0.1, "end": 0.9, "speed": 1.0, "acceleration": 2.0, "dwell": 5.0}
ON_THREE = beam(supports=[{"at": at, "stiffness": 300.0} for at in (0.0, 0.45, 1.0)])
LOW = fixed(0.5, "velocity") | {"frequency_limit": "1 Hz"}
CASES = {
    "210 GPa": passing(beam(youngs_modulus=210.0, density=7850.0)),
    "move away": passing(beam(supports="free-free")),
    "released undeformed": passing(beam(own_weight=True)),
    "leaves its body": passing(
        car=mass(0.1, {"kind": "waypoints", "times": [0.0, 2.0, 5.0], "positions": [0.1, 0.99, 0.99]})
    ),
    "critical speed": passing(car=mass(0.1, cruise(0.0, 1.0, 50.0))),
    "carriage car runs at speeds up to 350 m/s (1,260 km/h): were km/h meant?": passing(
        beam(youngs_modulus=1e8),
        sweep={"speed": {"of": "carriage.car.motion.speed", "from": 100, "to": 350, "count": 2}},
    ),
    "up to 300 m/s (1,080 km/h): are the units right?": passing(
        beam(youngs_modulus=1e8), car=mass(0.1, {"kind": "waypoints", "times": [0.0, 5e-3], "positions": [0.0, 1.0]})
    ),
    "times its body": passing(car=mass(5.0, WAY)),
    "the load of carriage car presses with 0.0004 N, 0.4 % of the weight of bed, 0.1 N: were kilonewtons": passing(
        car=force(4e-4, WAY)
    ),
    "the loads of train tram together press with 0.0004 N, 0.4 % of the weight of bed, 0.1 N: are the units": study(
        beam(), {}, train={"tram": mass(2e-3, WAY, axles=2, spacing=0.1)}, gravity=0.1
    ),
    "no structure bends so far": passing(car=mass(1.9, WAY), bed=beam(youngs_modulus=0.0005)),
    "small-deflection": passing(car=mass(1.9, WAY), bed=beam(youngs_modulus=0.01)),
    "swings at 0.092 Hz on its spring: were kilonewtons per metre meant?": passing(car=oscillator(0.3, 0.1, WAY)),
    "sensor low reads 0 in some variants: the first frequency of bed, up to 1.571 Hz, is above": swept(
        "body.bed.youngs_modulus", [0.25, 1.0], force(3.0, WAY), sensor={"low": LOW}
    ),
    "sensor end reads 0: its body has no bending moment there, as at a support or a free end": passing(
        sensor={"end": fixed(1.0, "bending_moment")}
    ),
    "no place of envelope all is at 0.45 m of bed where bending_moment has a kink": passing(
        ON_THREE, envelope={"all": {"body": "bed", "quantity": "bending_moment", "places": 6}}
    ),
    "force that brakes car, up to 0.2 N, does not push bed along its track, so residual vibration": passing(
        car=mass(0.1, STOP), output={"residual": True}
    ),
    "acceleration of carriage car is not reached in 2 of 4 variants: it gets to 4 m/s2 there": swept(
        "carriage.car.motion.acceleration", [2.0, 4.0, 5.0, 6.0], mass(0.1, STOP | {"jerk": 16.0})
    ),
    "in a first period": passing(beam(modes=1), solver={"steps": 30}),
    "lasts 0.25 first periods of the body, so that residual": passing(
        beam(modes=1), mass(0.1, cruise(0.0, 1.0, 0.5, after=0.25)), output={"residual": True}
    ),
    "does not act along or across its track: if it did (carriage.car.inertia_along = true": on_portal(),
}


@pytest.mark.parametrize("words", CASES)
def test_remarked(words: str) -> None:
    assert any(words in sentence for sentence in remarks(make_plan(CASES[words])))


def test_an_ordinary_study_is_not_remarked() -> None:
    assert remarks(make_plan(passing())) == []
    assert remarks(make_plan(passing(car=mass(0.1, WAY | {"after": 1.0}), output={"residual": True}))) == []
    quick = passing(beam(youngs_modulus=1e8), car=mass(0.1, cruise(0.0, 1.0, 145.0)))
    assert not any("at speeds up to" in remark for remark in remarks(make_plan(quick)))
    assert remarks(make_plan(on_portal(inertia_along=True, inertia_across=True))) == []


STRAIGHT = {
    **{"kind": "frame", "plane": "xz", "node": {"a": [0, 0], "b": [1, 0], "c": [2, 0]}},
    "section": {"box": {"area": 1.0, "second_moment": 0.1, "youngs_modulus": 1.0, "density": 1.0}},
    "member": {name: {"nodes": [*name], "section": "box"} for name in ("ab", "bc")},
    **{"supports": {"a": "pinned", "b": ["z"], "c": ["z"]}, "track": {"members": ["ab", "bc"]}},
}


@pytest.mark.parametrize("direction", [None, "x"])
def test_what_moves_along_a_straight_bridge_alone_is_not_remarked(direction: str | None) -> None:
    """Unless a sensor reads that way: a mass that acted along it would lower frequencies of these shapes alone."""
    sensor = {"end": {"body": "straight", "member": "ab", "at": 0.5} | ({"direction": direction} if direction else {})}
    car = mass(0.1, cruise(0.0, 2.0, 0.1), on="straight")
    found = Study(schema_version=1, kind="passage", body={"straight": STRAIGHT}, carriage={"car": car}, sensor=sensor)
    told = [text for text in remarks(make_plan(found)) if "does not act along its track" in text]
    assert len(told) == (direction is not None)


@pytest.mark.parametrize("speed", [145.0, "720 km/h"], ids=["not so fast", "with its unit"])
def test_speeds_are_not_always_remarked(speed: float | str) -> None:
    fast = passing(beam(youngs_modulus=1e8), car=mass(0.1, WAY | {"speed": speed}))
    assert not any("runs at speeds" in sentence for sentence in remarks(make_plan(fast)))


BRAKING = "the force that brakes car"
ON_CONTACTS = {
    **{"on": "bed", "kind": "body", "body": "table", "motion": STOP | {"start": 0.3, "end": 0.7}},
    "contacts": {"a": {"at": 0.0, "stiffness": 50.0}, "b": {"at": 0.2, "stiffness": 50.0}},
}
TABLE = beam(length=0.2, supports="free-free")


@pytest.mark.parametrize(
    ("braked", "words"),
    [
        (swept("carriage.car.motion.acceleration", [2.0, 4.0], mass(0.1, STOP), output={"residual": True}), "0.4 N"),
        (passing(car=mass(0.1, STOP), output={"residual": True}), "frames take it with inertia_along = true"),
        (
            study(beam(), ON_CONTACTS, body={"bed": beam(), "table": TABLE}, output={"residual": True}),
            "bodies on contacts never push along",
        ),
        (passing(car=mass(0.1, STOP)), ""),
        (passing(car=force(0.1, STOP), output={"residual": True}), ""),
        (passing(car=mass(0.1, STOP), output={"residual": True}, solver={"fidelity": "force"}), ""),
    ],
    ids=["swept", "on a beam", "a body on contacts", "no residual", "a plain force", "loads alone"],
)
def test_forces_that_brake_and_do_not_push_are_remarked(braked: Study, words: str) -> None:
    """Where residual vibration is asked for: it would be larger by what rings along the track."""
    told = [sentence for sentence in remarks(make_plan(braked)) if sentence.startswith(BRAKING)]
    assert len(told) == bool(words) and all(words in sentence for sentence in told)


def test_braking_on_frames_is_remarked_once() -> None:
    """Where frequencies would be lower that is told; on a straight bridge held along the key is named."""

    def told(body: Any, end: float, **more: Any) -> list[str]:
        car = mass(20.0, STOP | {"start": 0.5, "end": end}, on="frame") | more
        sensor = {"end": {"under": "car"}}
        tables = {"body": {"frame": body}, "carriage": {"car": car}, "sensor": sensor, "output": {"residual": True}}
        return remarks(make_plan(Study(schema_version=1, kind="passage", **tables)))

    (whole,) = (text for text in told(PORTAL, 3.0) if "its track" in text)
    assert f"; {BRAKING}, up to 40 N, does not push along it either" in whole
    (alone,) = (text for text in told(STRAIGHT, 1.5) if BRAKING in text)
    assert "carriage.car.inertia_along = true brings it" in alone
    assert not any(BRAKING in text for text in told(STRAIGHT, 1.5, inertia_along=True))


@pytest.mark.parametrize(
    ("key", "values", "jerk", "words"),
    [
        ("acceleration", [1.0, 4.0], 16.0, ""),
        ("acceleration", [1.0, 900.0], None, ""),
        ("jerk", [1.0, 4.0], 4.0, ""),
        ("speed", [0.5, 2.0, 3.0], None, "of carriage car is not reached in 2 of 3 variants: it gets to 1.265"),
    ],
)
def test_swept_limits_that_are_not_reached_are_remarked(
    key: str, values: list[float], jerk: float | None, words: str
) -> None:
    """0.8 m from rest to rest: the speed gets to sqrt(a d), the acceleration to sqrt(v j) with a jerk alone."""
    given = swept(f"carriage.car.motion.{key}", values, mass(0.1, STOP | ({"jerk": jerk} if jerk else {})))
    told = [sentence for sentence in remarks(make_plan(given)) if "is not reached" in sentence]
    assert len(told) == bool(words) and all(words in sentence for sentence in told)


SWEPT_LOAD = {"of": "carriage.car.force"}


@pytest.mark.parametrize(
    "light",
    [
        passing(car=force(0, WAY) | {"force": "0.4 mN"}),
        passing(car=force(4e-4, WAY), sweep={"load": SWEPT_LOAD | {"values": [4e-4, 0.02]}}),
        passing(car=force(4e-4, WAY), sweep={"load": SWEPT_LOAD | {"from": "0.1 mN", "to": "0.4 mN", "count": 2}}),
        study(beam(), mass(1e-6, WAY), gravity=0.0),
    ],
    ids=["with its unit", "heavier in another variant", "swept with its unit", "without gravity"],
)
def test_light_loads_are_not_always_remarked(light: Study) -> None:
    assert remarks(make_plan(light)) == []


def test_every_remark_has_its_case() -> None:
    assert len(CASES) > len(REMARKS)
