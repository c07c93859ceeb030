"""Modes that are too fast for a step take mass: what that mass acts on, where it changes, and what it saves."""

from dataclasses import replace

import numpy as np
import pytest

from engine.batch.execution import run
from engine.batch.plan import make_plan
from engine.march.march import march
from engine.march.tables import SceneTables
from engine.methods.transition import spectral_radius, transitions
from engine.model.scene_model import build_model
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from tests.engine.build import Table, beam, cruise, fixed, mass, study
from tests.engine.twin import march_twin
from tests.naive import newmark
from tests.naive.scene import State

SCALED = {"scheme": "scaled-fox-goodwin"}
SPRINGS = [{"at": 0.0, "stiffness": 60.0}, {"at": 1.0, "stiffness": 90.0}]
HALF = mass(0.5, cruise(0.0, 1.0, 0.8))
ARRIVING = {"car": HALF, "next": mass(0.4, cruise(1.2, 0.0, 1.0))}


def given(steps: int, carriages: Table = HALF, bed: Table | None = None, **changes: object) -> Study:
    solver = SCALED | {"steps": steps, "static_correction": False, "tolerance": 0.5}
    bed = bed or beam(damping_ratio=0.02)
    return study(bed, carriages, sensor={"place": fixed(0.3713)}, solver=solver, **changes)


def off(found: Study, readings: np.ndarray, t: np.ndarray) -> float:
    """The largest difference of readings at instants t from the naive march, over its largest one."""
    twin = march_twin(found, "bed", t)
    wanted = twin.history.displacement(twin.bed.phi(0.3713, 0))
    return float(np.abs(readings - wanted).max() / np.abs(wanted).max())


def own_masses(scene: newmark.Scene, scheme: object, h: float) -> newmark.Scene:
    return scene


def struck_alone(scene: newmark.Scene, t: float, state: State) -> np.ndarray:
    return newmark_impulse(replace(scene, modal_mass=None), t, state)


def derivatives(scene: newmark.Scene, scheme: object, t: float, v: np.ndarray, h: object) -> np.ndarray:
    return v


newmark_impulse = newmark.impulse
PARTS = {
    "in the steps": ("slowed", own_masses, 24),
    "in impulses": ("impulse", struck_alone, 30),
    "in velocities": ("velocity_after", derivatives, 30),
}


@pytest.mark.parametrize("part", PARTS)
def test_the_mass_of_fast_modes_is_felt(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name, change, steps = PARTS[part]
    one = given(steps, ARRIVING, beam(supports=SPRINGS, modes=6), output={"histories": "all"})
    found = run(one)
    assert off(one, found.place.values, found.elapsed.values) < 1e-9
    monkeypatch.setattr(newmark, name, change)
    assert off(one, found.place.values, found.elapsed.values) > 1e-4


def test_accelerations_are_solved_anew_where_steps_become_longer() -> None:
    """On a way that is cut where the load passes a sensor; no event is there."""
    one = given(17)
    sensors = {"place": fixed(0.3713), "moment": fixed(0.07, "bending_moment")}
    model = build_model(Study(**(one.data | {"sensor": sensors})), {}, {})
    tables = SceneTables(model, 17, "whole", stops="kinks")
    segments = tables.timeline.segments
    assert len(segments) > 1 and not any(segment.fresh for segment in segments[1:])
    assert max(segment.step for segment in segments) > 1.05 * min(segment.step for segment in segments)
    counts = np.arange(tables.timeline.window[1] + 1)
    values = VariantValues(model.study, {}, 8)
    t = tables.timeline.moments(counts)[1] * float(values.scene_time_scale[0])
    assert off(one, march(tables, values, counts, 1).history[:, 0, 0], t) < 1e-9


def test_passages_need_no_steps_for_modes_that_follow_their_load() -> None:
    """Twelve modes in 200 steps, of which Fox-Goodwin alone would need 700: three times closer than by
    average acceleration."""
    bed = beam(modes=12, damping_ratio=0.02)

    def history(scheme: str, steps: int) -> np.ndarray:
        one = given(steps, HALF, bed, output={"histories": {"every": steps // 100}})
        return np.asarray(run(one.with_values({"solver.scheme": scheme})).place)

    truth = history("fox-goodwin", 20_000)
    scaled, plain = (
        float(np.abs(history(scheme, 200) - truth).max() / truth.max())
        for scheme in ("scaled-fox-goodwin", "average-acceleration")
    )
    assert scaled < 1e-3
    assert 3.0 * scaled < plain


def test_fast_modes_follow_their_load_as_late_as_their_damping_has_them() -> None:
    """Damping that grows with frequency holds back moments; with the damping ratio kept they were 3 % off."""
    bed = beam(supports="clamped-pinned", modes=16, damping_ratio={"rayleigh": [0.0, 0.02]})
    load = {"on": "bed", "kind": "force", "force": 0.3, "motion": cruise(0.0, 1.0, 0.5)}
    found = [
        run(study(bed, load, sensor={"m": fixed(0.35, "bending_moment")}, solver=solver, output={"histories": "all"})).m
        for solver in (SCALED | {"steps": 400, "tolerance": 0.5}, {"steps": 12_800, "tolerance": 0.5})
    ]
    few, many = found[0].values, found[1].values
    assert np.abs(few - many[:: (many.size - 1) // (few.size - 1)]).max() < 5e-4 * np.abs(many).max()


@pytest.mark.parametrize("steps", [20, 48, 64, 100])
def test_steps_of_many_lengths_make_nothing_swing_further(steps: int) -> None:
    """Between the axles of a train, that come and leave at 42 instants; with velocities that are the same in steps of
    any length the growth by a passage is 21, 1.3, 1 and 2.1."""
    train = {"on": "bed", "kind": "force", "force": 1.0, "spacing": [0.045, 0.28, 0.045, 0.1] * 5}
    trains = {"train": {"motion": cruise(0.0, 1.0, 0.4)} | train}
    plan = make_plan(
        study(beam(modes=16), {}, sensor={"place": fixed(0.5)}, solver=SCALED | {"steps": steps}, train=trains)
    )
    tables = SceneTables(plan.grids[0].scene, steps, "whole")
    assert len({round(segment.step, 9) for segment in tables.timeline.segments}) > 1
    values = plan.grids[0].values.part(np.zeros(8, dtype=np.int64))
    assert float(spectral_radius(transitions(tables, values))[0]) < 1.1
