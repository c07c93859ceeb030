"""The unreduced finite-element model: against closed forms, influence lines, and the march of modes."""

from typing import Any

import numpy as np
import pytest

from engine import run
from engine.bodies.build import build_body
from engine.scene.study import Study
from engine.unreduced import march as unreduced_march
from engine.unreduced.march import march_unreduced
from engine.unreduced.scene import Unreduced, unreduced_model
from engine.unreduced.statics import unreduced_frequencies, unreduced_statics
from results_schema.errors import BadInput
from tests.engine.build import beam, course_of, cruise, fixed, force, mass, oscillator, shuttle, swing, under
from tests.engine.build import study_of_steps as study

GRAVITY = 9.81
SECTION = {"area": 1.0, "second_moment": 1.0, "youngs_modulus": 1.0, "density": 1.0, "fibre_distance": 0.1}
TABLE_SECTION = SECTION | {"second_moment": 0.02, "density": 0.5}
RIGID = {"kind": "rigid", "length": 0.4, "mass": 0.3, "inertia": 0.004, "centre": 0.23}
SOLVER = {"steps": 1000}  # the same scheme and steps, so that only the models differ
SPRINGS = {"left": {"node": "a", "stiffness": [0, 0, 200.0]}, "right": {"node": "b", "stiffness": [0, 0, 100.0]}}


def frame(elements: int, length: float = 1.0, **more: Any) -> dict[str, Any]:
    """A straight plane frame, pinned unless told."""
    return {
        "kind": "frame",
        "plane": "xz",
        "node": {"a": [0.0, 0.0], "b": [length, 0.0]},
        "section": {"all": SECTION},
        "member": {"all": {"nodes": ["a", "b"], "section": "all", "elements": elements}},
        "supports": {"a": ["x", "z"], "b": ["z"]},
        "track": {"members": ["all"]},
        "damping_ratio": 0.01,
        "modes": 40,
    } | more


TABLE = frame(8, 0.4, section={"all": TABLE_SECTION}, supports={}, damping_ratio=0.02)
POINTED = TABLE | {"point": {"shoe": {"node": "b"}}}


def riding(motion: dict[str, Any], stiffness: Any = 200.0, damping: float = 1.0, **more: Any) -> dict[str, Any]:
    """A table on two shoes, the front one 0.15 m ahead of the middle."""
    shoe = {"stiffness": stiffness, "damping": damping}
    contacts = {"front": shoe | {"at": 0.35}, "rear": shoe | {"at": 0.05}}
    return {"on": "bed", "kind": "body", "body": "table", "motion": motion, "contacts": contacts} | more


READ = {"place": fixed(0.61), "moment": fixed(0.3713, "bending_moment"), "below": under("car")}
ABOARD = READ | {
    "aboard": fixed(0.23, body="table"),
    "front": {"carriage": "car", "contact": "front", "quantity": "contact_force"},
    "all": {"carriage": "car", "quantity": "contact_force"},
}


def scene(bed: dict[str, Any], carriages: Any, **changes: Any) -> Study:
    table = {"body": {"bed": bed}, "sensor": READ, "solver": SOLVER, "output": {"histories": "all"}}
    return study({"length": 1.0}, carriages, **(table | changes))


def with_table(table: dict[str, Any], motion: dict[str, Any], sensors: Any = ABOARD, **more: Any) -> Study:
    bodies = {"bed": frame(24), "table": table}
    return scene(frame(24), {"car": riding(motion, **more)}, body=bodies, sensor=sensors)


def apart(given: Study, refinement: int = 1) -> dict[str, float]:
    """Largest differences of march and unreduced march over the range, by sensor."""
    dataset, model = run(given), unreduced_model(given)
    steps = int(given.solver.steps)  # type: ignore[arg-type]
    course = course_of(model, refinement * steps)
    counts = refinement * np.arange(course.timeline.steps // refinement + 1)
    found = march_unreduced(model, course, counts).sensors
    gaps = {}
    for place, name in enumerate(given.sensor):
        one, other = dataset[name].values.ravel(), found[:, place]
        np.testing.assert_array_equal(np.isnan(one), np.isnan(other))
        gaps[name] = float(np.nanmax(np.abs(one - other)) / (np.nanmax(one) - np.nanmin(one)))
    return gaps


SPRUNG = {"wheel_mass": 0.2, "damping": 1.5}
MARCHED: dict[str, tuple[Study, float]] = {
    "force": (scene(beam(modes=30), force(3.0, cruise(0.0, 1.0, 0.5))), 1e-4),
    "mass": (scene(beam(modes=30), mass(0.3, cruise(0.0, 1.0, 0.5))), 3e-4),
    "mass, out and back": (scene(frame(24), mass(0.3, shuttle(0.2, 0.8, 0.5, 0.2, 1))), 2e-4),
    "sprung mass": (scene(beam(modes=30), oscillator(0.6, 40.0, cruise(0.0, 1.0, 0.5), **SPRUNG)), 3e-4),
    "arrives on springs": (
        scene(frame(12, spring=SPRINGS, supports={"a": ["x"]}), mass(0.3, cruise(-0.1, 1.1, 0.5))),
        1e-2,
    ),
    "own weight": (scene(beam(modes=25, own_weight=True), mass(0.3, shuttle(0.2, 0.8, 0.5, 0.2, 1))), 1e-3),
    "Rayleigh": (scene(frame(24, damping_ratio={"rayleigh": [0.1, 1e-4]}), mass(0.3, swing(0.5, 0.3, 0.3, 1))), 3e-4),
    "rigid table": (with_table(RIGID, swing(0.5, 0.2, 0.5, 1)), 1e-3),
    "table enters and leaves": (with_table(TABLE, cruise(-0.3, 1.3, 0.8)), 2e-3),
    "table on points": (
        with_table(
            POINTED,
            shuttle(0.3, 0.7, 0.8, 0.2, 1),
            contacts={
                "front": {"point": "shoe", "offset": 0.2, "stiffness": 200.0, "damping": 1.0},
                "rear": {"at": 0.05, "stiffness": 200.0},
            },
        ),
        4e-4,
    ),
    "rigid contacts": (with_table(TABLE, shuttle(0.3, 0.7, 0.8, 0.2, 1), stiffness="rigid", damping=0.0), 6e-3),
}


@pytest.mark.parametrize("name", MARCHED)
def test_both_marches_agree(name: str) -> None:
    given, tolerance = MARCHED[name]
    assert max(apart(given).values()) < tolerance


TERMS = {"slope": (1, MARCHED["sprung mass"][0]), "curve": (2, MARCHED["mass, out and back"][0])}


@pytest.mark.parametrize("term", TERMS)
def test_convective_terms_count(term: str, monkeypatch: pytest.MonkeyPatch) -> None:
    order, given = TERMS[term]
    whole = unreduced_march.tie_rows

    def without(model: Unreduced, along: Any, derivative: int = 0) -> Any:
        found = whole(model, along, derivative)
        return found._replace(values=0.0 * found.values) if derivative == order else found

    monkeypatch.setattr(unreduced_march, "tie_rows", without)
    assert max(apart(given).values()) > 3e-3


@pytest.mark.parametrize("part", ["damping", "weight", "stiffness", "damping of modes"])
def test_contacts_count(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    given = MARCHED["table on points"][0]
    changed = {
        "damping": {"carriage.car.contacts.front.damping": 0.0},
        "weight": {"gravity": 0.0},
        "stiffness": {"carriage.car.contacts.rear.stiffness": 220.0},
        "damping of modes": {"body.bed.damping_ratio": 0.0},
    }
    other = unreduced_model(given.with_values(changed[part]))
    monkeypatch.setattr("tests.unreduced.test_unreduced.unreduced_model", lambda study: other)
    assert max(apart(given).values()) > 1e-3


def histories(model: Unreduced, steps: int, every: int) -> np.ndarray:
    course = course_of(model, steps)
    return march_unreduced(model, course, np.arange(0, course.timeline.steps + 1, every)).sensors


def test_the_error_falls_with_the_square_of_the_step() -> None:
    model = unreduced_model(with_table(TABLE, shuttle(0.3, 0.7, 0.8, 0.2, 1)))
    coarse, middle, fine = (histories(model, 400 * by, by)[:, [0, 2, 3]] for by in (1, 2, 4))
    ratio = np.abs(coarse - middle).max(axis=0) / np.abs(middle - fine).max(axis=0)
    assert (ratio > 3.5).all() and (ratio < 4.6).all()


def test_a_table_waits_on_level_ground() -> None:
    """Nothing moves before the table comes, and the table not for being there."""
    model = unreduced_model(with_table(TABLE, cruise(-0.9, 0.2, 1.0)))
    found = histories(model, 100, 1)[:40]
    np.testing.assert_allclose(found[:, [0, 1, 3]], 0.0, atol=1e-12)


def test_static_deflection_is_the_influence_line() -> None:
    """Under a force, and of a table whose shoes carry the shares of the lever."""
    at, places = np.array([0.61, 0.3713]), np.array([0.29, 0.5, 0.6101])
    quantities = ("displacement", "bending_moment", "shear_force", "stress")
    sensors = {f"{q}{i}": fixed(x, q) for q in quantities for i, x in enumerate(at)}
    given = scene(frame(7), {"car": force(3.0, cruise(0.0, 1.0, 0.5))}, sensor=sensors)
    body = build_body(given.body["bed"])
    assert body.sections is not None
    lines = [body.influence(at, places), *(body.sections.influence_at(q, at[:, None], places) for q in quantities[1:])]
    found = unreduced_statics(unreduced_model(given), places)[0]
    expected = 3.0 * np.concatenate(lines).T
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())


def test_a_rigid_table_stands_by_the_lever_rule() -> None:
    model = unreduced_model(with_table(RIGID, swing(0.5, 0.2, 0.5, 1)))
    sensors, forces = unreduced_statics(model, [0.3, 0.5])
    weight = RIGID["mass"] * GRAVITY
    front, rear = weight * (0.23 - 0.05) / 0.3, weight * (0.35 - 0.23) / 0.3
    np.testing.assert_allclose(forces, [[front, rear]] * 2, rtol=1e-12)
    body = build_body(model.study.body["bed"])
    line = body.influence([0.61, 0.3 + 0.15, 0.3 - 0.15], [0.3 + 0.15, 0.3 - 0.15]) @ [front, rear]
    np.testing.assert_allclose(sensors[0, 0], line[0], rtol=1e-10)
    aboard = line[2] + (line[1] - line[2]) * (0.23 - 0.05) / 0.3  # a straight line through both shoes
    np.testing.assert_allclose(sensors[0, 3], aboard, rtol=1e-10)


def test_frequencies_of_a_rigid_table_on_a_beam() -> None:
    """Against all exact modes of the beam, coupled with heave and pitch."""
    given = scene(beam(), {"car": riding(swing(0.5, 0.2, 0.5, 1))}, body={"bed": beam(), "table": RIGID}, sensor=READ)
    found = unreduced_frequencies(unreduced_model(given), [0.37], 6)[0]
    body = build_body(given.body["bed"].model_copy(update={"modes": 60}))
    shapes = body.shape([0.37 + 0.15, 0.37 - 0.15])
    rows = np.hstack([shapes, -np.array([[1.0, 0.12], [1.0, -0.18]]) / np.sqrt([RIGID["mass"], RIGID["inertia"]])])
    whole = np.diag(np.concatenate([body.omega**2, [0.0, 0.0]])) + 200.0 * rows.T @ rows
    expected = np.sqrt(np.linalg.eigvalsh(whole)[:6]) / (2.0 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=2e-6)


@pytest.mark.parametrize("elements", [24, 160])
def test_frequencies_with_masses(elements: int) -> None:
    """A mass and a sprung mass at frozen places, few and many degrees of freedom, against the kept modes."""
    carriages = {"car": mass(0.3, cruise(0.0, 1.0, 0.5)), "next": oscillator(0.6, 40.0, cruise(0.0, 1.0, 0.5))}
    given = scene(frame(elements), carriages)
    found = unreduced_frequencies(unreduced_model(given), [[0.37, 0.6]], 5)[0]
    body = build_body(given.body["bed"])
    row, spring = np.append(body.shape([0.37])[0], 0.0), np.append(body.shape([0.6])[0], -1.0)
    inertia = np.diag(np.append(np.ones(body.omega.size), 0.6)) + 0.3 * np.outer(row, row)
    whole = np.diag(np.append(body.omega**2, 0.0)) + 40.0 * np.outer(spring, spring)
    turned = np.linalg.inv(np.linalg.cholesky(inertia))
    expected = np.sqrt(np.linalg.eigvalsh(turned @ whole @ turned.T)[:5]) / (2.0 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    assert (found < expected * (1.0 + 1e-9)).all()  # the whole model is the softer one


REFUSED = {
    "lumped mass": ({"bed": frame(8, mass_matrix="lumped")}, "body.bed.mass_matrix"),
    "no rigid-body modes": ({"bed": frame(8, rigid_body_modes="drop")}, "body.bed.rigid_body_modes"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_whole_model_is_refused(name: str) -> None:
    bodies, where = REFUSED[name]
    with pytest.raises(BadInput) as caught:
        unreduced_model(scene(beam(), mass(0.3, cruise(0.0, 1.0, 0.5)), body=bodies))
    assert caught.value.where.endswith(where)


def test_other_fidelities_are_refused() -> None:
    given = scene(beam(), mass(0.3, cruise(0.0, 1.0, 0.5)), solver={"fidelity": "force"})
    with pytest.raises(BadInput, match=r"solver\.fidelity"):
        unreduced_model(given)


def test_a_free_bed_has_no_equilibrium() -> None:
    model = unreduced_model(scene(beam(supports="free-free"), mass(0.3, cruise(0.0, 1.0, 0.5))))
    with pytest.raises(BadInput, match="static equilibrium"):
        unreduced_statics(model, [0.5])


def test_one_shoe_carries_no_table() -> None:
    shoe = {"only": {"at": 0.1, "stiffness": 200.0}}
    sensors = READ | {"aboard": fixed(0.23, body="table")}
    given = with_table(RIGID, swing(0.5, 0.2, 0.5, 1), sensors, contacts=shoe)
    with pytest.raises(BadInput, match="cannot carry"):
        unreduced_statics(unreduced_model(given), [0.5])


def test_positions_are_checked() -> None:
    model = unreduced_model(scene(beam(), mass(0.3, cruise(0.0, 1.0, 0.5))))
    with pytest.raises(BadInput, match="positions"):
        unreduced_statics(model, [[0.5, 0.6]])
