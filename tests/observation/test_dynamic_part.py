"""The dynamic part of what sensors read: a closed form, the whole less statics, the unreduced model, refusals."""

import itertools
from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from engine.march.outcome import used
from engine.scene.study import Study
from engine.unreduced.comparison import Compared, compare_variant
from results_schema.errors import BadInput
from studies.reporting import summary
from studies.results.results import Results
from tests.engine.bodies_on_contacts import riding
from tests.engine.build import Table, beam, cruise, fixed, force, mass, study, study_of_steps, under
from tests.unreduced.test_unreduced import ABOARD, SPRINGS, TABLE_SECTION, frame, scene, with_table

FORCE, SPEED, MODES = 0.7, 0.6, 4
EVERYWHERE = cruise(0.0, 1.0, SPEED)


def parts(sensors: dict[str, Table]) -> dict[str, Table]:
    """Sensors, and their dynamic parts, whose names end in "_part"."""
    return sensors | {f"{name}_part": sensor | {"part": "dynamic"} for name, sensor in sensors.items()}


def test_a_force_that_crosses_a_pinned_beam() -> None:
    """Mode after mode, Fryba 1999: the response to F sin(k pi v t), less F sin(k pi v t)/omega^2."""
    sensor = {"part": fixed(0.3) | {"part": "dynamic"}}
    solver = {"steps": 4000, "scheme": "fox-goodwin"}
    told = {"sensor": sensor, "solver": solver, "output": {"histories": "all"}}
    found = engine.run(study_of_steps(beam(modes=MODES), force(FORCE, EVERYWHERE), **told))
    k, t = np.arange(1, MODES + 1)[:, None] * np.pi, found.elapsed.values.ravel()
    omega, driven = k**2, k * SPEED
    whole = (np.sin(driven * t) - driven / omega * np.sin(omega * t)) / (omega**2 - driven**2)
    expected = 2.0 * FORCE * np.sum(np.sin(0.3 * k) * (whole - np.sin(driven * t) / omega**2), axis=0)
    assert found.part.values.ravel() == pytest.approx(expected, abs=2e-6 * np.abs(expected).max())
    assert float(found.part_max) == pytest.approx(expected.max(), rel=1e-5)
    modes = np.arange(1, 200)[:, None] * np.pi
    line = 2.0 * FORCE * np.sum(np.sin(0.3 * modes) * np.sin(modes * np.linspace(0.0, 1.0, 2001)) / modes**4, axis=0)
    assert float(found.part_static) == pytest.approx(line.max(), rel=1e-5)


def compared(given: Study) -> tuple[Compared, list[str]]:
    """The march and the unreduced model of a study's only variant, and the names of its sensors."""
    plan = make_plan(given)
    (group,) = plan.groups
    return compare_variant(plan, 0, used(group.tables, 1)), list(given.sensor)


RIDING = with_table(
    frame(8, 0.4, section={"all": TABLE_SECTION}, supports={}, damping_ratio=0.02), EVERYWHERE, sensors=parts(ABOARD)
)
TWO_MASSES = scene(
    frame(24),
    {"one": mass(0.2, EVERYWHERE), "two": mass(0.1, cruise(1.0, 0.0, SPEED))},
    sensor=parts({"place": fixed(0.61), "moment": fixed(0.3713, "bending_moment"), "below": under("two")}),
)
SCENES = {
    "a body on springs": RIDING,
    "two masses and own weight": TWO_MASSES.with_values({"body.bed.own_weight": True}),
    "on springs": TWO_MASSES.with_values({"body.bed.supports": {"a": ["x"]}, "body.bed.spring": SPRINGS}),
}


@pytest.mark.parametrize("name", list(SCENES))
def test_it_is_the_whole_less_statics_by_both_models(name: str) -> None:
    """Statics are read apart here, and the unreduced model has its own."""
    found, names = compared(SCENES[name].with_values({"solver.steps": 2000, "solver.tolerance": 0.5}))
    for place, sensor in enumerate(names):
        if not sensor.endswith("_part"):
            continue
        whole = names.index(sensor.removesuffix("_part"))
        size = np.nanmax(np.abs(found.marched_static[whole]))
        left = found.marched[whole] - found.marched_static[whole]
        assert np.nanmax(np.abs(left)) > 1e-2 * size
        assert found.marched[place] == pytest.approx(left, abs=1e-9 * size, nan_ok=True)
        other = found.unreduced[whole] - found.unreduced_static[whole]
        assert found.unreduced[place] == pytest.approx(other, abs=1e-9 * size, nan_ok=True)
        assert other == pytest.approx(left, abs=2e-2 * size, nan_ok=True)  # most where loads come at once
        assert not np.nan_to_num(found.marched_static[place]).any()
        assert not np.nan_to_num(found.unreduced_static[place]).any()


def test_that_of_a_contact_counts_from_its_own_static_force_wherever_the_place_that_moves_is() -> None:
    """With the reference off the bed its whole force was told as the dynamic part of a contact on it."""
    for reference in (0.2, 0.0, 0.4):
        way = cruise(reference - 0.35, 1.0 + reference - 0.05, 0.6)
        given = riding(way).with_values({"carriage.car.reference": reference, "initial": "equilibrium"})
        contacts = {name: sensor for name, sensor in given.data["sensor"].items() if "contact" in sensor}
        found = engine.run(given.with_values({"sensor": parts(contacts)}))
        for name, end in itertools.product(("rear", "front"), ("max", "min")):
            part = float(found[f"{name}_{end}"]) - 0.25 * given.gravity
            assert float(found[f"{name}_part_{end}"]) == pytest.approx(part, rel=1e-9)


def test_nothing_is_left_where_loads_rest() -> None:
    """Of the lowest model, in which every reading is static, and of what swings after the way."""
    sensor = parts({"place": fixed(0.61)})
    crossing = study_of_steps(
        beam(damping_ratio=0.9),
        force(
            FORCE, {"kind": "point-to-point", "start": 0.2, "end": 0.5, "speed": 0.1, "acceleration": 1.0, "dwell": 9.0}
        ),
        sensor=sensor,
        solver={"steps": 4000},
        output={"histories": "all"},
    )
    found = engine.run(crossing)
    assert abs(float(found.place_part[-1])) < 1e-9 * float(found.place_static)
    assert float(found.place_part_static) == float(found.place_static)
    at_rest = engine.run(crossing.with_values({"solver": {"fidelity": "static", "tolerance": 0.5}}))
    assert not at_rest.place_part.values.any() and float(at_rest.place_max) > 0.0


SLOW = study(
    beam(damping_ratio=0.02, modes="auto"),
    {"car": force(FORCE, cruise(0.0, 1.0, SPEED))},
    sensor=parts({"place": fixed(0.5)}),
    sweep={"speed": {"of": "carriage.car.motion.speed", "values": [0.05, 0.1, 0.2]}},
    question={"dynamic_part": {"displacement": 2e-4}, "displacement": 1.0},
)


def test_answers_tell_it_beside_statics_and_judge_it_by_a_limit_of_its_own() -> None:
    """An amplification of 1.05 is told of the whole, though it is off its static way by more elsewhere."""
    found = studies.run(SLOW)
    told = " ".join(studies.answer(found))
    assert "the largest dynamic part of the displacement at 500 mm of bed" in told
    assert "Its absolute value exceeds 200 µm" in told and "Its absolute value exceeds 1 m nowhere" in told
    largest = np.maximum(found.place_part_max, -found.place_part_min)
    part, whole = (found.dynamic_amplification.sel(sensor=name) for name in ("place_part", "place"))
    assert (part / whole).values == pytest.approx((largest / found.place_max).values)
    assert 'part = "dynamic"' not in told
    alone = studies.run(SLOW.with_values({"sensor": {"place": fixed(0.5)}, "question": {}}))
    hint = 'nowhere from 0.05 to 0.2 m/s. It compares largest values; a sensor with part = "dynamic" reads'
    assert hint in " ".join(studies.answer(alone))


def test_what_swings_on_is_told_of_the_whole_alone() -> None:
    """At rest both swing alike; without the whole beside it that of the part is told. Limits along what is swept."""
    motion = {"kind": "point-to-point", "start": 0.2, "end": 0.6, "speed": 1.0, "acceleration": 4.0, "dwell": 2.0}
    stop = study(
        beam(damping_ratio=0.05),
        force(FORCE, motion),
        sensor=parts({"place": fixed(0.5)}),
        output={"residual": True},
        question={"dynamic_part": {"displacement": 3e-3}},
        sweep={"acceleration": {"of": "carriage.car.motion.acceleration", "values": [2.0, 4.0, 8.0, 16.0]}},
    )
    found = studies.run(stop)
    told = " ".join(studies.answer(found))
    assert found.place_part_residual.values == pytest.approx(found.place_residual.values, rel=1e-2)
    assert "place: after the stop it still swings" in told and "place_part: after" not in told
    named = [one.name for one in summary.in_tables(Results.of(found))]
    assert "place_residual" in named and "place_part_residual" not in named
    assert "Its absolute value exceeds 3 mm from 4 m/s² to the end of the sweep, 16 m/s²." in told
    alone = studies.run(stop.with_values({"sensor": {"part": fixed(0.5) | {"part": "dynamic"}}}))
    assert "part: after the stop it still swings" in " ".join(studies.answer(alone))


@pytest.mark.parametrize(
    ("sensor", "changes", "message"),
    [
        (under("car", "velocity"), {}, "statics have no velocity, all of it is dynamic"),
        (fixed(0.5), {"kind": "influence"}, "at rest nothing has a dynamic part"),
        (fixed(0.5), {"kind": "work-precision"}, "a study of work and precision reads the whole"),
        (
            fixed(0.5),
            {"kind": "moving-frames", "frame": {"bed": {}}, "question": {"duration": 1.0}},
            "its dynamic part",
        ),
    ],
)
def test_what_has_none_is_refused(sensor: Table, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        studies.run(
            study(
                beam(own_weight=True),
                mass(0.1, EVERYWHERE),
                sensor={"part": sensor | {"part": "dynamic"}},
                **changes,
            )
        )
