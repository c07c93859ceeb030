"""Sensors at nodes, members and points off the track: statics against a frame assembled by hand, marches against the
unreduced model."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import engine
from engine.batch.plan import make_plan
from engine.bodies.imported import imported
from engine.bodies.reduced.body import save_body
from engine.model.distinct_models import base_scene
from engine.model.station_path import frozen
from engine.observation.signals import build_sensors
from engine.scene.study import Study
from engine.scene.variants import VariantValues
from engine.statics.static_response import static_values
from engine.unreduced.march import march_unreduced
from engine.unreduced.scene import unreduced_model
from engine.unreduced.statics import unreduced_statics
from results_schema.arrays import Array
from results_schema.errors import BadInput
from results_schema.status import Status
from tests.bodies.frames import LENGTH, body, straight
from tests.bodies.models import Files, in_process
from tests.engine.build import beam, course_of, mass, shuttle, swing
from tests.observation.plane_frame import PlaneFrame
from tests.unreduced.test_unreduced import apart

GRAVITY, WEIGHT = 9.81, 2000.0
SECTION = {"area": 0.01, "second_moment": 8e-6, "youngs_modulus": 2.1e11, "density": 7850.0}
HEIGHT, SPAN, MIDDLE, LEG, BEAM = 3.0, 4.0, 1.8, 1.3, 1.45
PORTAL: dict[str, Any] = {
    "kind": "frame",
    "plane": "xz",
    "node": {"a": [0.0, 0.0], "b": [0.0, HEIGHT], "c": [SPAN, HEIGHT], "d": [SPAN, 0.0], "m": [MIDDLE, HEIGHT]},
    "section": {"all": SECTION},
    "member": {
        "left": {"nodes": ["a", "b"], "section": "all", "elements": 3},
        "first": {"nodes": ["m", "c"], "section": "all", "elements": 2},
        "second": {"nodes": ["m", "b"], "section": "all", "elements": 2},
        "right": {"nodes": ["c", "d"], "section": "all", "elements": 3},
    },
    "supports": {"a": "clamped", "d": "pinned"},
    "point": {"knee": {"node": "c", "direction": [1.0, 0.0, 0.0]}},
    "track": {"members": ["first", "second"]},
    "damping_ratio": 0.01,
    "modes": 12,
}
SKEW = [1.0, 0.0, -2.0]
SENSORS: dict[str, Any] = {
    "sway": {"node": "b", "direction": "x"},
    "leg": {"member": "left", "at": LEG, "direction": "x"},
    "down": {"member": "right", "at": 0.4},
    "skew": {"member": "first", "at": SPAN - MIDDLE - BEAM, "direction": SKEW},
    "knee": {"point": "knee"},
}
PLACES = [0.3, BEAM, 1.2, 2.0, 3.7]  # the track runs from c by m to b, against its first member


def study(sensors: dict[str, Any], bed: dict[str, Any] | None = None, **more: Any) -> Study:
    motion = {"kind": "cruise", "start": 0.0, "end": SPAN, "speed": 2.0}
    car = {"on": "portal", "kind": "mass", "mass": WEIGHT / GRAVITY, "motion": motion}
    read = {name: {"body": "portal"} | sensor for name, sensor in sensors.items()}
    tables = {"gravity": GRAVITY, "body": {"portal": bed or PORTAL}, "carriage": {"car": car}, "sensor": read}
    return Study(schema_version=1, kind="passage", **(tables | more))


def statics(given: Study, places: Any = PLACES) -> Array:
    """(P, J) readings with the carriage at places."""
    model = base_scene(given)
    return static_values(
        model, build_sensors(model), VariantValues(model.study, {}, 1), frozen(model, np.array(places))
    ).sensors[0]


def by_hand(place: float, gravity: float = 0.0) -> list[float]:
    frame = PlaneFrame(2.1e9, 1.68e6, 78.5)
    frame.member((0.0, 0.0), (0.0, HEIGHT), [LEG])
    frame.member((SPAN, HEIGHT), (0.0, HEIGHT), [place, BEAM])
    frame.member((SPAN, HEIGHT), (SPAN, 0.0), [0.4])
    frame.hold(0.0, 0.0, 0, 1, 2)
    frame.hold(SPAN, 0.0, 0, 1)
    moved = frame.moved(SPAN - place, HEIGHT, WEIGHT, gravity)
    skew = np.array([SKEW[0], SKEW[2]]) / np.hypot(SKEW[0], SKEW[2])
    return [
        moved[frame.node(0.0, HEIGHT), 0],
        moved[frame.node(0.0, LEG), 0],
        -moved[frame.node(SPAN, HEIGHT - 0.4), 1],
        float(skew @ moved[frame.node(SPAN - BEAM, HEIGHT), :2]),
        moved[frame.node(SPAN, HEIGHT), 0],
    ]


@pytest.mark.parametrize("weighs", [False, True])
def test_statics_are_those_of_a_frame_assembled_by_hand(weighs: bool) -> None:
    """Sway, columns, and a place of the track itself, a load on its own element among others."""
    found = statics(study(SENSORS, PORTAL | {"own_weight": weighs}))
    expected = np.array([by_hand(place, GRAVITY * weighs) for place in PLACES])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    few = statics(study(SENSORS, PORTAL | {"own_weight": weighs}, solver={"static_correction": False}))
    assert (np.abs(few - expected).max(axis=0) > 1e-5 * np.abs(expected).max()).all()


@pytest.mark.parametrize("weighs", [False, True])
def test_the_unreduced_model_reads_the_same_at_rest(weighs: bool) -> None:
    given = study(SENSORS, PORTAL | {"own_weight": weighs})
    found, _ = unreduced_statics(unreduced_model(given), PLACES)
    np.testing.assert_allclose(found, statics(given), rtol=1e-9, atol=1e-9 * np.abs(found).max())


#: What bends within elements, which the mass of a march feels and not the unreduced model, is a sixteenth of it.
FINER = PORTAL | {"member": {name: one | {"elements": 2 * one["elements"]} for name, one in PORTAL["member"].items()}}


def marched(steps: int, motion: dict[str, Any]) -> dict[str, Any]:
    car = {"car": mass(WEIGHT / GRAVITY, motion, on="portal")}
    solver = {"steps": steps, "static_correction": motion["kind"] != "sinusoidal"}
    return {"carriage": car, "solver": solver, "output": {"histories": "all"}}


def test_both_marches_agree() -> None:
    found = apart(study(SENSORS, FINER, **marched(2000, shuttle(0.8, 3.1, 2.0, 0.3, 1))))
    assert max(found.values()) < 1e-4, found


@pytest.mark.parametrize("name", ["sway", "leg", "skew", "knee"])
def test_rates_are_those_of_the_displacement(name: str) -> None:
    """Average acceleration steps by x' = x + h (v + v')/2 and v' = v + h (a + a')/2, to the last digits; so does the
    unreduced model, at a node."""
    quantities = ("displacement", "velocity", "acceleration")
    read = {quantity: SENSORS[name] | {"quantity": quantity} for quantity in quantities}
    given = study(read, **marched(400, swing(2.0, 1.2, 0.5, 1)))
    dataset, model = engine.run(given), unreduced_model(given)
    course = course_of(model, 400)
    whole = march_unreduced(model, course, np.arange(401)).sensors.T
    own, step = [dataset[quantity].values.ravel() for quantity in quantities], 2.0 / 400
    for (x, v, a), everywhere in ((own, True), (whole, name in ("sway", "knee"))):
        between = [0.5 * step * (rate[1:] + rate[:-1]) for rate in (v, a)]
        assert not everywhere or np.abs(np.diff(x) - between[0]).max() < 1e-10 * np.ptp(x)
        assert np.abs(np.diff(v) - between[1]).max() < 1e-9 * np.ptp(v)


def test_the_track_itself_reads_as_a_sensor_along_it() -> None:
    """To rounding, marched and at rest."""
    sensors = {"along": {"at": BEAM}, "here": {"member": "first", "at": SPAN - MIDDLE - BEAM}, "m": {"node": "m"}}
    sensors["middle"] = {"at": SPAN - MIDDLE}
    dataset = engine.run(
        study(sensors, PORTAL | {"own_weight": True}, solver={"steps": 400}, output={"histories": "all"})
    )
    for one, other in (("along", "here"), ("middle", "m")):
        np.testing.assert_allclose(dataset[other].values, dataset[one].values, rtol=1e-11, atol=1e-14)


def one_span() -> dict[str, Any]:
    """The portal with one member from c to b under its track."""
    members = {"span": {"nodes": ["c", "b"], "section": "all", "elements": 8}}
    members |= {name: PORTAL["member"][name] for name in ("left", "right")}
    nodes = {name: place for name, place in PORTAL["node"].items() if name != "m"}
    return PORTAL | {"node": nodes, "member": members, "track": {"members": ["span"]}}


def sag_of(files: Files) -> Array:
    """Motions of the same places under the weight of the rows that the files have."""
    assembly = files.assembly
    size = 6 * len(assembly.mesh.points)
    down = np.zeros(size)
    down[2::6] = -GRAVITY
    whole = np.zeros(size)
    whole[assembly.free] = np.linalg.solve(assembly.stiffness.toarray(), assembly.mass @ down[assembly.free])
    nodes = whole.reshape(-1, 6)[:, :3]
    return np.array([nodes[1, 0], nodes[2] @ np.array(SKEW) / np.linalg.norm(SKEW), nodes[2, 0]])


NODES = {"b": {"node": "b", "direction": "x"}, "c": {"node": "c", "direction": SKEW}, "knee": {"point": "knee"}}
NUMBERS = {"b": {"node": 2, "direction": "x"}, "c": {"node": 3, "direction": SKEW}, "knee": {"point": "knee"}}


def test_bodies_out_of_files_read_nodes_by_their_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At places where the model has nodes, the interpolation between them is exact."""
    monkeypatch.setattr(imported, "read_files", in_process)
    knee = {"knee": {"node": 3, "direction": [1.0, 0.0, 0.0]}}
    files = Files(tmp_path, one_span())
    portal = files.table(point=knee, modes=12, damping_ratio=0.01)
    places = np.linspace(0.0, SPAN, 9)
    read = [statics(study(*case), places) for case in ((NODES, one_span()), (NUMBERS, portal))]
    np.testing.assert_allclose(read[1], read[0], rtol=1e-9, atol=1e-9 * np.abs(read[0]).max())
    heavy = statics(study(NUMBERS, portal | {"own_weight": True}), places) - read[1]
    np.testing.assert_allclose(heavy, np.broadcast_to(sag_of(files), heavy.shape), rtol=1e-9)
    marched = [engine.run(study(*case, solver={"steps": 400})) for case in ((NODES, one_span()), (NUMBERS, portal))]
    for name in NODES:
        assert float(marched[1][f"{name}_max"]) == pytest.approx(float(marched[0][f"{name}_max"]), rel=1e-3)
    for sensor, words in (
        ({"node": "b"}, r"sensor\.read\.node: there is no such node"),
        ({"node": 1, "direction": "x"}, r"sensor\.read\.direction: node 1 does not move"),
        ({"member": "span", "at": 1.0}, r"sensor\.read\.member: a body out of files has no members"),
        ({"point": "toe"}, r"sensor\.read\.point: no such point.*knee"),
    ):
        with pytest.raises(BadInput, match=words):
            study({"read": sensor}, portal)
    shut = portal | {"supports": {"2": ["x"]}}
    with pytest.raises(BadInput, match="node 2 does not move in this direction"):
        study({"read": NUMBERS["b"]}, shut)


def test_saved_bodies_read_their_points(tmp_path: Path) -> None:
    save_body(body(PORTAL), tmp_path / "body.nc")
    reduced = {"kind": "reduced", "file": str(tmp_path / "body.nc"), "damping_ratio": 0.01}
    knee, solver = {"knee": SENSORS["knee"]}, {"solver": {"steps": 400}}
    found = [float(engine.run(study(knee, bed, **solver)).knee_max) for bed in (PORTAL, reduced)]
    assert found[0] == found[1]
    for sensor, words in ((SENSORS["sway"], "read point = its name"), ({"point": "toe"}, "no such point.*one of knee")):
        with pytest.raises(BadInput, match=words):
            study({"read": sensor}, reduced)


def test_beams_are_read_on_their_track() -> None:
    with pytest.raises(BadInput, match=r"sensor\.read\.node: this body has no node to read.*metres along its track"):
        study({"read": {"node": "b"}}, beam(length=SPAN))


def test_places_and_directions_are_swept() -> None:
    """Each makes a scene of its own; one off its member is refused before anything runs."""
    axis = {"of": "sensor.leg.at", "values": [0.5, LEG]}
    dataset = engine.run(study({"leg": SENSORS["leg"]}, sweep={"place": axis}, solver={"steps": 400}))
    alone = engine.run(study({"leg": SENSORS["leg"]}, solver={"steps": 400}))
    assert float(dataset.leg_max[1]) == float(alone.leg_max) != float(dataset.leg_max[0])
    with pytest.raises(BadInput, match="a sensor off its member"):
        make_plan(study({"leg": SENSORS["leg"]}, sweep={"place": axis | {"values": [0.5, 3.5]}}))


def test_what_no_load_moves_is_rounding() -> None:
    """Along a straight beam nothing moves, whatever its modes: that is no error of the study."""
    read = {"along": {"member": "span", "at": 5.0, "direction": "x"}, "middle": {"at": 0.5 * LENGTH}}
    motion = {"kind": "cruise", "start": 0.0, "end": LENGTH, "speed": 5.0}
    car = {"car": {"on": "portal", "kind": "mass", "mass": 50.0, "motion": motion}}
    rail = straight({"a": ["x", "z"], "b": ["z"]}, plane="xz", damping_ratio=0.05)
    dataset = engine.run(study(read, rail, carriage=car))
    assert int(dataset.status) == Status.OK and float(dataset.error_estimate) < 1e-3
    assert abs(float(dataset.along_max)) < 1e-12 * float(dataset.middle_max)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "two places": ({"node": "b", "at": 1.0}, r"sensor\.read: a sensor has exactly one place"),
    "no place": ({"direction": "x"}, "exactly one place"),
    "member without a place": ({"member": "left"}, "metres from the member's first node"),
    "direction along the track": ({"at": 1.0, "direction": "x"}, "only nodes and members are read in a direction"),
    "direction of a point": ({"point": "knee", "direction": "x"}, "read in the direction that its own table names"),
    "unknown axis": ({"node": "b", "direction": "w"}, r"sensor\.read\.direction.*one of x, y, z"),
    "no direction": ({"node": "b", "direction": [0.0, 0.0, 0.0]}, "not all zero"),
    "moment": ({"node": "b", "quantity": "bending_moment"}, "at = metres along the track"),
    "unknown node": ({"node": "bb"}, r"sensor\.read\.node: no such node.*did you mean"),
    "number of a node": ({"node": 2}, r"sensor\.read\.node: no such node.*one of a, b"),
    "unknown member": ({"member": "lefd", "at": 1.0}, r"sensor\.read\.member: no such member.*did you mean"),
    "unknown point": ({"point": "toe"}, r"sensor\.read\.point: no such point.*one of knee"),
    "off its member": ({"member": "left", "at": 3.1}, r"sensor\.read\.at: a sensor off its member.*0 to 3 m"),
    "held": ({"node": "d", "direction": "x"}, r"sensor\.read\.direction: nothing moves here"),
    "across the plane": ({"node": "b", "direction": "y"}, "nothing moves here"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_name_the_place(name: str) -> None:
    sensor, words = REFUSED[name]
    with pytest.raises(BadInput, match=words):
        study({"read": sensor})
