"""What supports carry: statics by closed forms and by hand, forces of inertia, and marches of the unreduced model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from engine.bodies.imported import imported
from engine.bodies.reduced.body import save_body
from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from engine.unreduced.scene import unreduced_model
from engine.unreduced.statics import unreduced_statics
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.status import Status
from tests.bodies.frames import body
from tests.bodies.models import Files, in_process
from tests.engine.build import beam, cruise, fixed, force, mass, shuttle, study, swing
from tests.observation.plane_frame import PlaneFrame
from tests.observation.test_off_track import FINER, GRAVITY, HEIGHT, PLACES, PORTAL, SPAN, WEIGHT, one_span, statics
from tests.observation.test_off_track import study as portal_study
from tests.unreduced.test_unreduced import apart

REACTION, MOMENT = "support_reaction", "support_moment"
MIDDLE_SPRING = [{"at": 0.0, "stiffness": 2e2}, {"at": 0.4, "stiffness": 5e2}, {"at": 1.0, "stiffness": 1e2}]
DAMPED = [{"at": 0.1, "stiffness": 300.0, "damping": 2.0}, {"at": 0.8, "stiffness": 100.0, "damping": 5.0}]
ONE = [{"at": 0.6, "stiffness": 200.0}]  # about which the beam turns freely
SIDE = [0.6, 0.0, -0.8]


def at(*places: float) -> dict[str, Any]:
    """Supports of the bed, named after their number."""
    return {f"support_{number}": fixed(place, REACTION) for number, place in enumerate(places)}


def at_rest(bed: dict[str, Any], sensors: dict[str, Any], places: Any = PLACES) -> Array:
    """(P, J) readings under a force of 3 N at places of a beam of 1 m."""
    question = {"positions": [float(place) / SPAN for place in places]}
    table = {"kind": "influence", "question": question, "gravity": GRAVITY, "sensor": sensors}
    dataset = studies.run(study(bed, force(3.0, cruise(0.0, 1.0, 1.0)), **table))
    return np.stack([dataset[name].values for name in sensors], axis=1)


def on_springs(load: float, weight: float) -> Array:
    """(3,) reactions of the bed on its springs, by force and moment balance and one compatible deflection: the beam of
    L = E I = 1 cut free of the middle spring bends by the textbook's pinned beam."""
    places, rates = (np.array([spring[key] for spring in MIDDLE_SPRING]) for key in ("at", "stiffness"))
    middle = places[1]

    def pinned(x: float, a: float) -> float:
        x, a = (x, a) if x <= a else (1.0 - x, 1.0 - a)
        return float((1.0 - a) * x * (1.0 - (1.0 - a) ** 2 - x**2) / 6.0)

    ends, rise = np.array([1.0 - middle, middle]), np.array([1.0 - load, load])
    sink = ends**2 @ (1.0 / rates[[0, 2]])
    bends = 3.0 * pinned(middle, load) + weight * middle * (1.0 - 2.0 * middle**2 + middle**3) / 24.0
    outer = 3.0 * rise + 0.5 * weight
    free = bends + ends @ (outer / rates[[0, 2]])
    carried = free / (1.0 / rates[1] + pinned(middle, middle) + sink)
    return np.array([outer[0] - carried * ends[0], carried, outer[1] - carried * ends[1]])


@pytest.mark.parametrize("weighs", [False, True])
def test_statics_of_uniform_beams_are_those_of_the_textbook(weighs: bool) -> None:
    """Pinned, clamped and propped, and on three springs; a load on the support itself too; the beam weighs 1 kg."""
    a, weight = np.array([0.0, 0.3, 0.62, 1.0]), GRAVITY * weighs
    expected = {
        "pinned-pinned": 3.0 * (1.0 - a) + 0.5 * weight,
        "clamped-clamped": 3.0 * (1.0 - a) ** 2 * (1.0 + 2.0 * a) + 0.5 * weight,
        "clamped-pinned": 1.5 * (1.0 - a) * (2.0 + 2.0 * a - a**2) + 0.625 * weight,
    }
    for supports, left in expected.items():
        found = at_rest(beam(supports=supports, own_weight=weighs), at(0.0, 1.0), SPAN * a)
        np.testing.assert_allclose(found, np.stack([left, 3.0 + weight - left], axis=1), rtol=0.0, atol=1e-12)
    alone = at_rest(beam(supports="clamped-free", own_weight=weighs), at(0.0), SPAN * a)
    np.testing.assert_allclose(alone, 3.0 + weight, rtol=0.0, atol=1e-12)
    springs = at_rest(beam(supports=MIDDLE_SPRING, own_weight=weighs), at(0.0, 0.4, 1.0), SPAN * a)
    np.testing.assert_allclose(springs, [on_springs(place, weight) for place in a], rtol=0.0, atol=1e-11)


def by_hand(place: float, gravity: float) -> list[float]:
    """Forces of the portal on its feet: across and down of the clamped one, down and aslant of the pinned one, and the
    moment of the clamped one about y, which points into the plane of x and z."""
    frame = PlaneFrame(2.1e9, 1.68e6, 78.5)
    frame.member((0.0, 0.0), (0.0, HEIGHT), [])
    frame.member((SPAN, HEIGHT), (0.0, HEIGHT), [place])
    frame.member((SPAN, HEIGHT), (SPAN, 0.0), [])
    frame.hold(0.0, 0.0, 0, 1, 2)
    frame.hold(SPAN, 0.0, 0, 1)
    moved = frame.moved(SPAN - place, HEIGHT, WEIGHT, gravity).reshape(-1)
    stiffness, weight = frame.matrices()
    load = (gravity * weight - stiffness @ moved).reshape(-1, 3)
    clamped, pinned = load[frame.node(0.0, 0.0)], load[frame.node(SPAN, 0.0)]
    return [clamped[0], -clamped[1], -pinned[1], SIDE[0] * pinned[0] + SIDE[2] * pinned[1], -clamped[2]]


FEET: dict[str, Any] = {
    "across": {"node": "a", "direction": "x", "quantity": REACTION},
    "down": {"node": "a", "quantity": REACTION},
    "pinned": {"node": "d", "quantity": REACTION},
    "aslant": {"node": "d", "direction": SIDE, "quantity": REACTION},
    "clamping": {"node": "a", "direction": "y", "quantity": MOMENT},
}


@pytest.mark.parametrize("weighs", [False, True])
def test_statics_of_frames_are_those_of_a_frame_assembled_by_hand(weighs: bool) -> None:
    found = statics(portal_study(FEET, PORTAL | {"own_weight": weighs}))
    expected = np.array([by_hand(place, GRAVITY * weighs) for place in PLACES])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8 * WEIGHT)
    whole = WEIGHT + GRAVITY * weighs * 78.5 * (2.0 * HEIGHT + SPAN)
    np.testing.assert_allclose(found[:, 1] + found[:, 2], whole, rtol=1e-9)
    unreduced, _ = unreduced_statics(unreduced_model(portal_study(FEET, PORTAL | {"own_weight": weighs})), PLACES)
    np.testing.assert_allclose(unreduced, expected, rtol=0.0, atol=1e-8 * WEIGHT)


def test_frames_and_beams_on_the_same_springs_carry_the_same() -> None:
    """A rail whose nodes stand on springs to ground; its loads stand on a support too."""
    nodes = {f"n{number}": [spring["at"], 0.0] for number, spring in enumerate(MIDDLE_SPRING)}
    section = dict.fromkeys(("area", "second_moment", "youngs_modulus", "density"), 1.0)
    rail = {
        "kind": "frame",
        "plane": "xz",
        "node": nodes,
        "section": {"all": section},
        "member": {"m0": {"nodes": ["n0", "n1"], "section": "all"}, "m1": {"nodes": ["n1", "n2"], "section": "all"}},
        "supports": {"n0": ["x"]},
        "spring": {
            f"s{k}": {"node": f"n{k}", "stiffness": [0, 0, s["stiffness"]]} for k, s in enumerate(MIDDLE_SPRING)
        },
        "track": {"members": ["m0", "m1"]},
        "own_weight": True,
    }
    feet = {f"support_{k}": {"body": "bed", "node": f"n{k}", "quantity": REACTION} for k in range(3)}
    places = np.array([0.0, 0.25, 0.4, 0.9]) * SPAN
    expected = at_rest(beam(supports=MIDDLE_SPRING, own_weight=True), at(0.0, 0.4, 1.0), places)
    motion = cruise(0.0, 1.0, 1.0)
    question = {"positions": [float(place) / SPAN for place in places]}
    table = {"kind": "influence", "question": question, "gravity": GRAVITY, "sensor": feet, "body": {"bed": rail}}
    dataset = studies.run(study({"length": 1.0}, force(3.0, motion), **table))
    found = np.stack([dataset[name].values for name in feet], axis=1)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


def test_moments_of_springs_and_of_clamped_beams() -> None:
    """A cantilever that stands on a stiff and on a soft rotational spring carries the same at its foot: what the load
    has over its arm; that of a uniform beam is its bending moment there."""
    rail: dict[str, Any] = {
        "kind": "frame",
        "plane": "xz",
        "node": {"n0": [0.0, 0.0], "n1": [1.0, 0.0]},
        "section": {"all": dict.fromkeys(("area", "second_moment", "youngs_modulus", "density"), 1.0)},
        "member": {"m0": {"nodes": ["n0", "n1"], "section": "all"}},
        "track": {"members": ["m0"]},
        "own_weight": True,
    }
    sprung = {"foot": {"node": "n0", "stiffness": [1e3, 0, 1e3], "rotational": [0, 30.0, 0]}}
    places = np.array([0.0, 0.25, 1.0]) * SPAN
    for held in ({"supports": {"n0": "clamped"}}, {"spring": sprung}):
        read = {"foot": {"body": "bed", "node": "n0", "direction": "y", "quantity": MOMENT}}
        question = {"positions": [float(place) / SPAN for place in places]}
        table = {
            "kind": "influence",
            "question": question,
            "gravity": GRAVITY,
            "sensor": read,
            "body": {"bed": rail | held},
        }
        dataset = studies.run(study({"length": 1.0}, force(3.0, cruise(0.0, 1.0, 1.0)), **table))
        arm = 3.0 * places / SPAN + 0.5 * GRAVITY
        np.testing.assert_allclose(dataset.foot.values, arm, rtol=0.0, atol=1e-9)
    bed = beam(supports="clamped-free", own_weight=True)
    found = at_rest(bed, {"foot": fixed(0.0, "bending_moment")}, places)
    np.testing.assert_allclose(found[:, 0], -arm, rtol=0.0, atol=1e-9)


def test_supports_carry_the_load_less_what_speeds_up() -> None:
    """The sum of both reactions of a beam on unequal springs, stiff against them, under a load that swings: load and
    weight less the mass times the acceleration of the middle."""
    springs = [{"at": 0.0, "stiffness": 30.0}, {"at": 1.0, "stiffness": 200.0}]
    bed = beam(supports=springs, youngs_modulus=1e5, own_weight=True, modes=4)
    read = at(0.0, 1.0) | {"middle": fixed(0.5, "acceleration")}
    table = {"sensor": read, "solver": {"steps": 4000, "tolerance": 0.5}, "output": {"histories": "all"}}
    dataset = engine.run(study(bed, force(3.0, swing(0.5, 0.4, 1.2, 3)), **table))
    middle = dataset.middle.values
    both = dataset.support_0.values + dataset.support_1.values
    assert np.abs(middle).max() > 0.3  # m/s2, of 1 kg under 3 N
    assert np.abs(both - (3.0 + 9.81 - middle)).max() < 1e-2 * np.abs(middle).max()


def test_balance_of_a_beam_that_bends() -> None:
    """To rounding, with the modes that it has: load less the inertia of all of them, part of the mass by part, and less
    what damps them."""
    given = study(
        beam(modes=6, damping_ratio=0.03),
        force(3.0, cruise(0.0, 1.0, 0.7)),
        sensor=at(0.0, 1.0) | {f"w{k}": fixed((k + 0.5) / 6.0) for k in range(6)},
        solver={"steps": 500, "static_correction": False},
        output={"histories": "all"},
    )
    dataset, modal = engine.run(given), base_scene(given).bodies[0].modal
    shapes = modal.shape([(k + 0.5) / 6.0 for k in range(6)])
    q = np.linalg.solve(shapes, np.stack([dataset[f"w{k}"].values.ravel() for k in range(6)]))
    both = dataset.support_0.values + dataset.support_1.values
    np.testing.assert_allclose(both.ravel(), (modal.omega**2 * modal.participation) @ q, rtol=0.0, atol=1e-8)


def marched(bed: dict[str, Any], carriage: dict[str, Any], sensors: dict[str, Any]) -> Study:
    table = {
        "sensor": sensors,
        "body": {"bed": bed},
        "solver": {"steps": 1000, "tolerance": 0.5},
        "output": {"histories": "all"},
    }
    return study({"length": 1.0}, carriage, **table)


@pytest.mark.parametrize(
    ("supports", "places"),
    [("pinned-pinned", (0.0, 1.0)), ("clamped-free", (0.0,)), (DAMPED, (0.1, 0.8)), (ONE, (0.6,))],
)
def test_marches_of_beams_agree_with_the_unreduced_model(supports: Any, places: Any) -> None:
    """Of a mass that stays on a beam, and of one that passes over springs and dampers."""
    motion = cruise(0.0, 1.0, 0.5) if isinstance(supports, list) else shuttle(0.2, 0.8, 0.5, 0.2, 1)
    found = apart(marched(beam(modes=24, damping_ratio=0.01, supports=supports), mass(0.3, motion), at(*places)))
    assert max(found.values()) < 3e-3, found


def test_marches_of_frames_agree_with_the_unreduced_model() -> None:
    car = {"car": mass(WEIGHT / GRAVITY, shuttle(0.8, 3.1, 2.0, 0.3, 1), on="portal")}
    more = {"carriage": car, "solver": {"steps": 2000, "tolerance": 0.5}, "output": {"histories": "all"}}
    found = apart(portal_study(FEET, FINER | {"modes": 20}, **more))
    assert max(found.values()) < 1e-3, found
    loose = FINER | {"supports": {"a": "clamped"}, "spring": {"foot": {"node": "d", "stiffness": [0, 0, 4e6]}}}
    loose["spring"]["foot"]["damping"] = [0.0, 0.0, 2e4]
    feet = {name: FEET[name] for name in ("down", "pinned")}
    found = apart(portal_study(feet, loose | {"modes": 20}, **more))
    assert max(found.values()) < 1e-3, found


def test_reactions_are_held_to_the_tolerance_by_estimates_that_are_kept() -> None:
    given = study(
        beam(damping_ratio=0.02, modes="auto"),
        mass(0.3, cruise(-0.2, 1.2, 0.5)),
        sensor=at(0.0, 1.0),
        sweep={"speed": {"of": "carriage.car.motion.speed", "values": [0.2, 0.5, 1.0]}},
    )
    dataset = engine.run(given)
    finest = engine.run(given.with_values({"solver.tolerance": 1e-4}))
    assert (dataset.status.values == Status.OK).all()
    assert dataset.support_0_max.attrs["units"] == "N"
    for name in ("support_0", "support_1"):
        gap = np.abs(dataset[f"{name}_max"].values - finest[f"{name}_max"].values) / (0.3 * 9.81)
        told = dataset.estimated_error.sel(result=f"{name}_max").values
        assert (gap <= told + 1e-4).all() and (told <= 1e-3).all()


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no support": (fixed(0.5, REACTION), r"sensor\.read\.at: no support stands here; expected 0\.1 m or 0\.8 m"),
    "a damper alone": (fixed(0.9, REACTION), "no support stands here"),
    "under a carriage": ({"under": "car", "quantity": REACTION}, "a support is a place of a beam, or a node"),
    "a node of a beam": (
        {"body": "bed", "node": "a", "quantity": REACTION},
        r"sensor\.read\.node: supports of a uniform beam have no nodes",
    ),
    "a moment of a beam": (
        {"body": "bed", "at": 0.1, "quantity": MOMENT},
        'one about a direction at a node.*"bending_moment" at its clamped end',
    ),
    "another word": (fixed(0.1, "reaction"), 'did you mean "support_reaction"'),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_of_beams_name_the_place(name: str) -> None:
    sensor, words = REFUSED[name]
    with pytest.raises(BadInput, match=words):
        bed = beam(supports=[*DAMPED, {"at": 0.9, "damping": 1.0}])
        study(bed, force(1.0, cruise(0.0, 1.0, 1.0)), sensor={"read": sensor})


def test_refusals_of_frames_and_of_other_bodies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(imported, "read_files", in_process)
    save_body(body(PORTAL), tmp_path / "body.nc")
    reduced = {"kind": "reduced", "file": str(tmp_path / "body.nc")}
    roller = PORTAL | {"supports": {"a": "clamped", "d": ["z"]}}
    files = Files(tmp_path, one_span()).table()
    for bed, sensor, words in (
        (PORTAL, FEET["down"] | {"node": "b"}, r"sensor\.read\.node: no support stands here; expected one of a, d"),
        (PORTAL, {"at": 0.0, "quantity": REACTION}, r"sensor\.read\.at: no support stands here; expected one of a, d"),
        (PORTAL, {"point": "knee", "quantity": REACTION}, "a support is a place of a beam, or a node"),
        (roller, FEET["pinned"] | {"direction": "x"}, r"sensor\.read\.direction: nothing holds node d"),
        (PORTAL, FEET["clamping"] | {"node": "d"}, "nothing holds node d against turns about this direction"),
        (PORTAL, {"node": "a", "quantity": MOMENT}, "one about a direction at a node"),
        (reduced, FEET["down"], r"sensor\.read\.quantity: this body does not tell what its supports carry"),
        (files, FEET["down"] | {"node": 1}, "does not tell what its supports carry"),
    ):
        with pytest.raises(BadInput, match=words):
            portal_study({"read": sensor}, bed)
    with pytest.raises(BadInput, match="unknown name"):
        portal_study({}, envelope={"all": {"body": "portal", "quantity": REACTION}})


def test_supports_are_swept_with_their_sensors() -> None:
    axis = {"of": ["sensor.support_0.at", "body.bed.supports.0.at"], "values": [0.1, 0.2]}
    given = study(beam(supports=DAMPED), force(3.0, cruise(0.0, 1.0, 0.01)), sensor=at(0.1), sweep={"place": axis})
    given = given.with_values({"solver.fidelity": "static"})
    found = engine.run(given).support_0_max.values
    np.testing.assert_allclose(found, [3.0 * 0.8 / 0.7, 3.0 * 0.8 / 0.6], rtol=1e-12)
    alone = axis | {"of": "body.bed.supports.0.at"}
    with pytest.raises(BadInput, match="no support stands here"):
        make_plan(study(beam(supports=DAMPED), force(3.0, cruise(0.0, 1.0, 1.0)), sensor=at(0.1), sweep={"p": alone}))
