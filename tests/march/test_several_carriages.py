"""Several carriages at once, on each other too: the engine against the scene's differential equations, by scipy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from engine.march.richardson import march_scheme
from engine.march.tables import SceneTables
from engine.model.lane_table import padded
from engine.scene.study import Study
from results_schema.errors import BadInput
from tests.engine.bodies_on_contacts import RIGID as TABLE
from tests.engine.bodies_on_contacts import TWO
from tests.engine.build import Table, beam, cruise, fixed, force, mass, oscillator, shuttle, study, swing
from tests.engine.carriages_by_scipy import Company

UNEVEN: Table = TABLE | {"centre": 0.13, "mass": 0.3}
SMALL: Table = {"kind": "rigid", "length": 0.2, "mass": 0.1, "inertia": 0.001}
UNDAMPED: Table = {"rear": {"at": 0.05, "stiffness": 400.0}, "front": {"at": 0.35, "stiffness": 500.0}}
SPRINGS = [{"at": 0.0, "stiffness": 40.0}, {"at": 1.0, "stiffness": 60.0}]


def table(body: str, motion: Table, contacts: Table = TWO, on: str = "bed", **changes: Any) -> Table:
    return {"on": on, "kind": "body", "body": body, "contacts": contacts, "motion": motion} | changes


def scene(carriages: Table, bodies: Table, bed: Table | None = None, **changes: Any) -> Study:
    """A study read on all bodies and at all contacts."""
    whole = {"bed": beam(damping_ratio=0.02, modes=3) if bed is None else bed} | bodies
    sensors: Table = {"place": fixed(0.61)} | {f"on_{name}": fixed(0.1, body=name) for name in bodies}
    for name, carriage in carriages.items():
        if carriage["kind"] == "mass":
            sensors[f"{name}_force"] = {"carriage": name, "quantity": "contact_force"}
        for contact in carriage.get("contacts", ()):
            sensors[f"{name}_{contact}"] = {"carriage": name, "contact": contact, "quantity": "contact_force"}
    solver = {"steps": 4000, "static_correction": False, "scheme": "richardson", "tolerance": 0.5}
    return study(whole["bed"], carriages, body=whole, sensor=sensors, solver=solver, **changes)


OUT_AND_BACK = shuttle(0.3, 0.7, 0.8, 0.1, 1)
SHOES: Table = {"x": {"at": 0.05, "stiffness": 100.0, "damping": 0.1}, "y": {"at": 0.15, "stiffness": 130.0}}
SCENES: dict[str, Callable[[], Study]] = {
    "two tables that pass each other": lambda: scene(
        {"a": table("t", cruise(-0.4, 1.4, 0.8)), "b": table("u", cruise(1.4, -0.4, 0.5), UNDAMPED, delay=0.7)},
        {"t": TABLE, "u": UNEVEN},
    ),
    "a table behind a mass, on a bed that bends by itself": lambda: scene(
        {"m": mass(0.2, cruise(-0.4, 1.4, 0.8)), "a": table("t", cruise(-0.4, 1.4, 0.8), headway=0.3, delay=0.25)},
        {"t": TABLE},
        beam(own_weight=True, modes=3),
    ),
    "onto a bed whose ends give way": lambda: scene(
        {"a": table("t", cruise(1.4, -0.4, 1.6))}, {"t": TABLE}, beam(damping_ratio=0.02, modes=3, supports=SPRINGS)
    ),
    "a mass onto the table, named first": lambda: scene(
        {"m": mass(0.1, cruise(-0.1, 0.5, 0.6), on="t"), "a": table("t", swing(0.5, 0.2, 0.7, 1))}, {"t": TABLE}
    ),
    "a table on a table": lambda: scene(
        {"a": table("t", OUT_AND_BACK), "b": table("u", shuttle(0.15, 0.25, 0.4, 0.1, 1), SHOES, "t")},
        {"t": TABLE, "u": SMALL},
    ),
    "a force over the table, no gravity": lambda: scene(
        {"a": table("t", swing(0.5, 0.2, 0.7, 1)), "m": force(1.2, cruise(-0.1, 0.5, 0.6), on="t", delay=0.1)},
        {"t": TABLE},
        gravity=0.0,
    ),
    "from one end of the bed to the other": lambda: scene(
        {"a": table("t", shuttle(0.15, 0.85, 0.8, 0.1, 1))}, {"t": TABLE}, beam(modes=3, supports=SPRINGS)
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_engine_agrees_with_the_differential_equations(name: str) -> None:
    case = SCENES[name]()
    (group,) = make_plan(case).groups
    tables = group.tables
    values = make_plan(case).values(group, padded(group.variants))
    scale = float(values.time_scale(next(iter(case.carriage)))[0])
    events = sorted({segment.start * scale for segment in tables.timeline.segments if segment.fresh})
    events.append(tables.timeline.segments[-1].end * scale)
    counts = np.linspace(0, tables.timeline.steps, 31).astype(np.int64)
    times = tables.timeline.moments(counts.astype(np.float64))[1] * scale
    apart = np.array([min(abs(time - event) for event in events) > 1e-9 for time in times])
    marched = march_scheme(tables, values, counts, 1)
    twin = Company(case)
    states, touching = twin.march(times[apart], events)
    for j, sensor in enumerate(tables.sensors):
        found = marched.history[apart, j, 0]
        whole = zip(times[apart], states, touching, strict=True)
        right = np.array([twin.reading(case.sensor[sensor.name], *one) for one in whole])
        seen = np.isfinite(found)
        assert np.array_equal(seen, [twin.reads(case.sensor[sensor.name], now) for now in touching]), sensor.name
        assert seen.sum() >= 8, sensor.name
        assert np.abs(found - right)[seen].max() <= 2e-4 * np.abs(right[seen]).max(), sensor.name


def test_a_contact_at_the_very_end_touches() -> None:
    """0.15 + (0.05 - 0.2) is not 0, but that is where the rear contact stands; it never leaves the bed."""
    (group,) = make_plan(SCENES["from one end of the bed to the other"]()).groups
    assert all(all(segment.active) for segment in group.tables.timeline.segments)


def test_bodies_that_ride_on_each_other_are_refused() -> None:
    shoes = {"x": {"at": 0.1, "stiffness": 100.0}, "y": {"at": 0.3, "stiffness": 100.0}}
    way = shuttle(0.15, 0.25, 0.4, 0.1, 1)
    with pytest.raises(BadInput, match=r"carriage\.a\.body: a body cannot ride on itself"):
        scene({"a": table("t", way, shoes, "u"), "b": table("u", way, shoes, "t")}, {"t": TABLE, "u": TABLE})


@pytest.mark.parametrize("steps", ["auto", 100000])
@pytest.mark.parametrize("kind", ["oscillator", "body"])
def test_free_vibration_with_springs_needs_a_stable_scheme(steps: Any, kind: str) -> None:
    """A conditionally stable scheme would need the springs' own steps, which vary from variant to variant."""
    other = oscillator(0.1, 1e5, OUT_AND_BACK) if kind == "oscillator" else table("t", OUT_AND_BACK)
    carriages = {"m": mass(0.01, cruise(-0.1, 1.1, 0.8, after=3.0)), "a": other}
    changes: Table = {"body": {"bed": beam(), "t": TABLE}, "solver": {"steps": steps, "scheme": "linear-acceleration"}}
    with pytest.raises(BadInput, match=r"carriage\.m\.motion\.after: free vibration with springs"):
        make_plan(study(beam(), carriages, **changes))


@pytest.mark.parametrize("scheme", ["fox-goodwin", "linear-acceleration"])
def test_free_vibration_with_soft_springs_goes_by_any_scheme(scheme: str) -> None:
    """Of order 2, all towards the same."""
    car = oscillator(0.1, 4.0, cruise(0.0, 1.0, 0.4, after=3.0), damping=0.05)
    cars = {"front": car, "rear": car | {"headway": 0.3, "wheel_mass": 0.05}}

    def at(steps: int, scheme: str) -> Any:
        return engine.run(study(beam(modes=4), cars, solver={"steps": steps, "scheme": scheme, "audit": 0}))

    truth, found = at(32_000, "fox-goodwin"), [at(steps, scheme) for steps in (1000, 2000)]
    for name in ("midspan_max", "midspan_min", "midspan_rms"):
        coarse, fine = (abs(float(one[name] - truth[name]) / float(truth.midspan_max)) for one in found)
        assert 0.0 < 2.5 * fine < coarse < 1e-4, name


def test_segments_tabulated_together_are_what_each_is_alone() -> None:
    """Asked for backwards, every segment is the first of those that are tabulated with it, and the last one alone."""
    cars: Table = {
        "m": mass(0.2, cruise(-0.4, 1.4, 0.8)),
        "o": oscillator(0.3, 200.0, cruise(0.0, 1.0, 0.5), damping=0.5, delay=0.2),
        "a": table("t", cruise(-0.4, 1.4, 0.7), headway=0.3),
        "f": force(1.0, cruise(1.2, -0.2, 0.6)),
    }
    sensor = {
        "moment": fixed(0.4, "bending_moment"),
        "under": {"under": "o", "quantity": "acceleration"},
        "contact": {"carriage": "a", "contact": "rear", "quantity": "contact_force"},
    }
    plan = make_plan(study(beam(own_weight=True), cars, body={"bed": beam(own_weight=True), "t": TABLE}, sensor=sensor))
    model = plan.grids[0].scene
    forth, back = (SceneTables(model, 200, "whole", kept_bytes=0) for _ in range(2))
    segments = forth.timeline.segments
    assert len({segment.active for segment in segments}) > 5
    together = [forth.table(segment) for segment in segments]
    for segment, expected in zip(reversed(segments), reversed(together), strict=True):
        for one, other in zip(back.table(segment), expected, strict=True):
            for left, right in zip(one, other, strict=True):
                np.testing.assert_array_equal(left, right)


@pytest.mark.parametrize("read", [False, True])
def test_a_segment_has_the_ties_of_the_carriages_on_their_bodies_alone(read: bool) -> None:
    """Carriages 1.3 lengths apart are on the body one after the other, a sprung one's spring with it, always where its
    sprung mass is read."""
    motion = cruise(0.0, 1.0, 0.8)
    follow = {"b": mass(0.1, motion, headway=1.3), "c": oscillator(0.1, 40.0, motion, headway=2.6)}
    sensor = {"c": {"carriage": "c"}} if read else {}
    scene = study(beam(modes=3), {"a": mass(0.2, motion)} | follow, solver={"steps": 64}, sensor=sensor)
    (group,) = make_plan(scene).groups
    tables = SceneTables(group.scene, 64, "whole")
    found = {part.active[:3]: tables.table(part) for part in tables.timeline.segments if not part.free}
    none, on = (False, False, False), {tuple(k == r for k in range(3)): r for r in range(3)}
    assert found.keys() == {none, *on}
    for active, table in found.items():
        one = on.get(active, 0)
        assert table.numbers.tolist() == ([one, 3] if read or one == 2 else [one])
        assert table.ties.rows.shape[2] == table.watch.static.shape[2] == len(table.numbers)


def test_one_that_has_crossed_before_the_last_cycle_has_no_place_in_it() -> None:
    """Its history, NaN throughout, ended the whole run after the march."""
    crossing = {"car": mass(0.3, shuttle(0.2, 0.8, 0.5, 0.1, 2)), "other": mass(0.1, cruise(0.0, 1.0, 0.7))}
    case = study(beam(modes=3), crossing, kind="asymmetry", sensor={"middle": fixed(0.5)}, output={"histories": "all"})
    found = studies.run(case)
    assert np.isnan(found.other_position).all() and np.isfinite(found.car_position).all()
