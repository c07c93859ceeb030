"""A gantry on two beams and what crosses on it: against dense saddle systems, and the whole finite-element model."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import engine
from engine.batch.plan import make_plan
from engine.march.step_rules import contact_omega
from engine.model.numerics import open_bodies
from engine.model.station_path import frozen
from engine.observation import kinks
from engine.observation.contact_forces import ContactForce
from engine.observation.signals import build_sensors
from engine.scene.study import Study, load
from engine.scene.variants import VariantValues
from engine.statics.coupled_modes import coupled_frequencies
from engine.statics.static_response import static_values
from engine.unreduced.scene import unreduced_model
from engine.unreduced.statics import unreduced_frequencies, unreduced_statics
from results_schema.errors import BadInput
from studies.at_rest.positions import way_of
from studies.pictures.at_rest import places, way_title
from tests.engine.build import Table, beam, cruise, shuttle
from tests.engine.gantries import CORNERS, CROSSING, FRAME, PAIRS, TRACKS, TROLLEY, gantry
from tests.march.contacts.test_bodies_on_contacts import histories
from tests.test_readme import examples

SHOES = {"rear": {"at": 0.02, "stiffness": 500.0, "damping": 0.1}, "front": {"at": 0.08, "stiffness": 450.0}}
CART: Table = {"on": "gantry", "kind": "body", "body": "cart", "contacts": SHOES, "motion": CROSSING}
BOX: Table = {"cart": {"kind": "rigid", "length": 0.1, "mass": 0.2, "inertia": 3e-4, "centre": 0.06}}
ENDS = [{"at": 0.0, "stiffness": 300.0}, {"at": 0.9, "stiffness": 200.0}]
HEAVY = {"left": beam(modes=4, own_weight=True), "right": beam(modes=6, length=0.9, supports=ENDS)}
LATE = {"delay": 0.1, "motion": shuttle(0.2, 0.6, 0.9, 0.5, 2)}


def rail(length: float, elements: int, held: Table, **track: object) -> Table:
    """A straight frame in space."""
    member = {"all": {"nodes": ["p", "q"], "section": "all", "elements": elements}}
    nodes = {"p": [0.0, 0.0, 0.0], "q": [length, 0.0, 0.0]}
    changes = {"node": nodes, "member": member, "supports": held, "track": {"members": ["all"]} | track}
    return {key: value for key, value in FRAME.items() if key != "point"} | changes


HELD: Table = {"p": "clamped", "q": "clamped"}
RIGID = {name: {k: v for k, v in w.items() if k != "damping"} | {"stiffness": "rigid"} for name, w in CORNERS.items()}
SCENES: dict[str, Callable[[], Study]] = {
    "girder": gantry,
    "frame that pitches": lambda: gantry(wheels=CORNERS, body=FRAME),
    "trolley first": lambda: gantry(TROLLEY | LATE, trolley_first=True),
    "cart on few elements": lambda: gantry(CART, body=rail(0.8, 2, {}), more=BOX),
    "off the shorter beam first": lambda: gantry(motion=cruise(-0.2, 1.2, 1.0), initial="equilibrium"),
    "own weight": lambda: gantry(more=HEAVY),
    "rigid wheels": lambda: gantry(wheels=RIGID, body=FRAME),
    "without static correction": lambda: gantry(solver={"steps": 200, "static_correction": False}),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_march_agrees_with_the_dense_twin(name: str) -> None:
    found, twin, (x, force, where), inner = histories(SCENES[name]())
    study, crane = twin.study, [tie.carriage == "crane" for tie in twin.ties]
    pairs = {wheel: force[:, crane][:, n] for n, wheel in enumerate(study.carriage["crane"].riding_contacts)}
    pairs["trolley_force"] = force[:, np.logical_not(crane)].sum(axis=1)
    for sensor, right in pairs.items():
        seen = inner & np.isfinite(found[sensor])
        assert seen.sum() > 80
        assert np.abs(found[sensor] - right)[seen].max() <= 1e-9 * np.abs(force).max(), sensor
    stations = np.flatnonzero(inner)[::10]
    for body in ("left", "right", "gantry"):
        at = float(study.sensor[body].at or 0.0)
        right = np.array([twin.displacement(body, at, x[h], force[h], where[h]) for h in stations])
        assert np.abs(found[body][stations] - right).max() <= 1e-9 * np.abs(found[body]).max(), body


@pytest.mark.parametrize("cross", [0.1412, 0.4])
@pytest.mark.parametrize("name", ["girder", "frame that pitches", "cart on few elements", "own weight"])
def test_statics_are_those_of_finite_elements(name: str, cross: float) -> None:
    """All sensors and contact forces against the whole finite-element model, at 1e-6; frequencies as modes allow."""
    tool = {
        "sensor.tool": {"under": "trolley"}
    }  # counts from where the gantry stands on level ground, as all of it does
    study = SCENES[name]().with_values({"carriage.trolley.motion.centre": cross} | tool)
    model, values, whole = make_plan(study).base, VariantValues(study, {}, 1), unreduced_model(study)
    places = np.array([0.3, 0.45, 0.7, 0.8])  # where the last one is off the shorter beam with one wheel
    both, along = np.stack([places, np.full(4, cross)], axis=1), frozen(model, places)
    found, right = (
        static_values(model, build_sensors(model), values, along).sensors[0],
        unreduced_statics(whole, both)[0],
    )
    assert (np.abs(found - right).max(axis=0) <= 1e-6 * np.abs(right).max(axis=0)).all()
    omega, hertz = coupled_frequencies(model, values, along, 4)[0], unreduced_frequencies(whole, both, 4)
    np.testing.assert_allclose(omega / (2.0 * np.pi), hertz, rtol=5e-4)


def test_the_documented_gantry_carries_its_weights() -> None:
    """Slowly, its wheels carry girder and trolley by the lever; the softer beam deflects further."""
    (text,) = (block for _, block in examples("toml") if "[carriage.gantry]" in block)
    study = load(text)
    model, values = make_plan(study).base, VariantValues(study, {}, 1)
    force = static_values(model, build_sensors(model), values, frozen(model, np.array([4.0]))).contacts[0, 0]
    weight, trolley, cross = 0.03 * 10.0 * 7850.0 * study.gravity, 3000.0 * study.gravity, 1.5
    right = 0.5 * weight + trolley * (cross - 0.5) / 9.0
    assert [force[0] + force[1], force[2] + force[3]] == pytest.approx([weight + trolley - right, right], rel=1e-9)
    found = engine.run(study.with_values({"solver.steps": 4000}))
    assert int(found.status) == 0 and float(found.right_max) > float(found.left_max) > 0.0


def test_where_a_gantry_stands_and_is_drawn() -> None:
    """All its wheels are on their tracks from 0.15 m to 0.75 m, as the shorter track allows, and it lies across."""
    whole = gantry(kind="influence", question={"positions": [0.2, 0.7]})
    assert way_of(whole) == pytest.approx((0.15, 0.75), abs=1e-12)
    assert open_bodies(gantry(more={"right": {k: v for k, v in TRACKS["right"].items() if k != "modes"}})) == ("right",)
    data = xr.Dataset(coords={"body_place": [0.0, 0.5, 1.0], "on_body": ["left", "gantry"]})
    results = SimpleNamespace(study=whole, dataset=data, carriage=whole.carriage["crane"])
    left, girder = places(results)  # type: ignore[arg-type]
    assert left.at(0.3).tolist() == [0.0, 0.5, 1.0] and girder.at(0.3).tolist() == [0.0, 0.4, 0.8]
    assert "across" in way_title(results)  # type: ignore[arg-type]


def test_a_contact_counts_on_its_own_body() -> None:
    """Kinks of moments, the held ends of its span and the frequency on its spring are those of what it stands on."""
    free = {"right": beam(modes=4, length=0.9, supports="clamped-free")}
    whole = gantry(more=free, sensor={"moment": {"body": "right", "at": 0.5, "quantity": "bending_moment"}})
    model = make_plan(whole).base
    (moment,) = build_sensors(model)
    passing = list(kinks.passes(model, moment))
    assert len(passing) == 4  # two wheels, there and back
    places = np.array([0.3, 0.74])
    front = next(rider for rider, name in model.contact_names(0).items() if name == "right_front")
    counted = ContactForce(0, front).counted(model, frozen(model, places))
    assert counted.tolist() == [True, True]  # 0.89 m is near the end of 0.9 m, which is free
    every = np.linspace(0.0, 1.0, 257)
    square = 0.0
    for wheel in PAIRS.values():
        below = model.bodies[[part.name for part in model.bodies].index(wheel.get("on", "left"))].modal
        mobility = np.max(np.sum(below.shape(every * below.length) ** 2, axis=1))
        own = np.sum(model.bodies[-1].modal.shape([wheel["at"]])[0] ** 2)
        square += wheel["stiffness"] * (own + mobility)
    assert float(contact_omega(model, VariantValues(whole, {}, 1))[0]) == pytest.approx(np.sqrt(square), rel=1e-3)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("contacts.right_rear.on", "middle", r"contacts\.right_rear\.on: no such body"),
        ("contacts.right_rear.on", "gantry", r"crane\.body: a body cannot ride on itself"),
        ("contacts", {name: wheel | {"on": "right"} for name, wheel in PAIRS.items()}, r"no contact stands on left"),
        ("contacts.left_rear", {"at": 0.1, "stiffness": 1.0}, r"lies along the way or across it"),
        (
            "motion.end",
            0.8,
            r"right_front: this contact leaves the body that it rides; expected a way within 0 to 0\.9",
        ),
    ],
)
def test_refused(path: str, value: object, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        make_plan(gantry().with_values({f"carriage.crane.{path}": value}))


def test_as_many_rigid_contacts_as_the_modes_of_all_bodies_meet() -> None:
    """One mode of each track, rise and roll of a rigid body: four."""
    box = {"kind": "rigid", "length": 0.8, "mass": 0.5, "inertia": 0.02}
    one = {name: track | {"modes": 1} for name, track in TRACKS.items()}
    wheels = {name: {"at": 0.1, "offset": ahead, "stiffness": "rigid"} for name, ahead in (("a", 0.0), ("b", 0.1))}
    wheels |= {name + name: wheel | {"at": 0.7, "on": "right"} for name, wheel in wheels.items()}
    make_plan(gantry(wheels=wheels, body=box, more=one))
    with pytest.raises(BadInput, match=r"crane\.contacts: .*at most 4 of them rigid"):
        make_plan(gantry(wheels=wheels | {"c": wheels["a"] | {"offset": 0.05}}, body=box, more=one))


def test_bodies_that_ride_on_each_other_are_refused() -> None:
    cart = {"kind": "rigid", "length": 0.1, "mass": 0.2, "inertia": 3e-4}
    trolley = CART | {"contacts": SHOES}
    wheels = PAIRS | {"right_rear": PAIRS["right_rear"] | {"on": "cart"}}
    with pytest.raises(BadInput, match=r"crane\.body: a body cannot ride on itself"):
        gantry(trolley, wheels, more={"cart": cart})


def test_all_of_them_deflect_along_gravity_alike() -> None:
    """A frame whose track is loaded aslant does not carry wheels together with a beam."""
    aslant = rail(0.9, 8, HELD, direction=[0.0, 0.6, -0.8])
    with pytest.raises(BadInput, match=r"crane\.contacts: .*different directions; .*1 of gravity.*0\.8 of gravity"):
        make_plan(gantry(more={"right": aslant}))
    with pytest.raises(BadInput, match=r"expected a track whose loads act along gravity"):
        unreduced_model(gantry(more={"right": aslant}))
    make_plan(gantry(more={"right": rail(0.9, 8, HELD)}))
