"""A frame in a study file: every key mutated, every refusal with its place, and the march on it."""

from typing import Any

import numpy as np
import pytest

import engine
import engine.batch.plan
from engine.batch.plan import make_plan
from engine.batch.plausibility import remarks
from engine.bodies.build import build_body
from engine.bodies.frame.frame import Frame, Point
from engine.scene.study import Study, load
from engine.scene.sweep import expand
from engine.study_file.document import write_document
from results_schema.errors import BadInput
from studies.commands.preview import preview
from studies.protocol.study import kind_of
from tests.bodies.frames import AREA, DENSITY, LENGTH, MODULUS, SECOND_MOMENT, straight
from tests.engine.build import beam
from tests.scene.mutations import HOW, How, Mutation, mutations, survives

BRIDGE: dict[str, Any] = {
    "kind": "frame",
    "gravity_direction": [0.0, 0.0, -1.0],
    "mass_matrix": "consistent",
    "damping_ratio": 0.01,
    "modes": 10,
    "own_weight": False,
    "interface": ["b"],
    "fixed_interface_modes": 8,
    "leave_out": [9],
    "rigid_body_modes": "keep",
    "node": {"a": [0.0, 0.0, 0.0], "b": [4.0, 0.0, 0.0], "c": [8.0, 0.0, 0.0], "d": [8.0, 0.0, -3.0]},
    "section": {
        "deck": {
            "area": 0.02,
            "second_moment": 5e-5,
            "second_moment_lateral": 2e-5,
            "torsion_constant": 3e-5,
            "youngs_modulus": "210 GPa",
            "poissons_ratio": 0.3,
            "density": 7850,
            "shear_area": 0.015,
            "shear_area_lateral": 0.015,
            "fibre_distance": 0.1,
            "fibre_distance_lateral": 0.05,
        },
        "leg": {
            "area": 0.02,
            "second_moment": 5e-5,
            "second_moment_lateral": 2e-5,
            "torsion_constant": 3e-5,
            "youngs_modulus": "210 GPa",
            "shear_modulus": "80 GPa",
            "density": 7850,
        },
    },
    "member": {
        "left": {"nodes": ["a", "b"], "section": "deck", "elements": 3, "theory": "timoshenko"},
        "right": {"nodes": ["c", "b"], "section": "deck", "elements": 3, "up": [0.0, 0.0, 1.0]},
        "column": {
            "nodes": ["d", "c"],
            "section": "leg",
            "elements": 2,
            "up": [1.0, 0.0, 0.0],
            "offsets": [[0.0, 0.0, 0.0], [0.0, 0.0, -0.2]],
        },
    },
    "point_mass": {"motor": {"node": "b", "mass": 20.0, "inertia": [1.0, 2.0, 2.0], "offset": [0.0, 0.2, 0.1]}},
    "spring": {
        "mount": {"node": "a", "stiffness": ["1 kN/mm", 1e6, 5e6], "rotational": [1e6, 0.0, 0.0]},
        "brace": {"node": "a", "to": "d", "stiffness": [1e5, 0.0, 0.0]},
    },
    "point": {"shoe": {"node": "b", "direction": [0.0, 0.6, -0.8], "offset": [0.0, 0.0, 0.2]}},
    "supports": {"d": "clamped", "a": ["y"]},
    "track": {"members": ["left", "right"], "offset": [0.0, 0.3, 0.0], "direction": [0.0, 0.0, -1.0]},
}
TROLLEY: dict[str, Any] = {
    "on": "bridge",
    "kind": "mass",
    "mass": 200.0,
    "motion": {"kind": "cruise", "start": 0.0, "end": 8.0, "speed": 4.0},
}
SENSORS: dict[str, Any] = {"middle": {"body": "bridge", "at": 4.0}, "here": {"under": "trolley"}}
STUDY: dict[str, Any] = {
    "schema_version": 1,
    "kind": "passage",
    "body": {"bridge": BRIDGE},
    "carriage": {"trolley": TROLLEY},
    "sensor": SENSORS,
    "sweep": {"area": {"of": "body.bridge.section.deck.area", "values": [0.02, 0.03]}},
}
TEXT = write_document(STUDY)
MUTATIONS = [mutation for mutation in mutations(TEXT) if mutation.path[0] == "body"]


def read(text: str) -> object:
    """All that a run does before it marches: the frame is reduced too."""
    study = load(text)
    return expand(study), [build_body(body) for body in study.body.values()]


def test_the_frame_is_valid() -> None:
    assert read(TEXT)
    assert len(MUTATIONS) > 350


@pytest.mark.fault(2, 3, 4)
@pytest.mark.parametrize("how", HOW)
def test_every_key(how: How) -> None:
    chosen = [mutation for mutation in MUTATIONS if mutation.how == how]
    assert len(chosen) > 20
    for mutation in chosen:
        _survives(mutation)


def _survives(mutation: Mutation) -> None:
    """Retyped vectors of words, and names of parts that nobody mentions, may stand."""
    free = mutation.path[2:3] in (("point_mass",), ("point",), ("spring",)) or mutation.path[2:] == ("member", "column")
    if mutation.how == "misspell" and len(mutation.path) == 4 and free:
        read(mutation.text)
    else:
        survives(mutation, read)


REFUSED: dict[str, tuple[dict[str, Any], list[str]]] = {
    "unknown node": ({"member.left.nodes": ["a", "bb"]}, ["member.left.nodes.1", "no such node", 'did you mean "b"?']),
    "unknown section": ({"member.left.section": "dek"}, ["member.left.section", 'did you mean "deck"?']),
    "unknown support": ({"supports.dd": "clamped"}, ["supports.dd", "no such node"]),
    "unknown direction": ({"supports.a": ["yy"]}, ["supports.a.0", "one of x, y, z, rx, ry, rz"]),
    "direction twice": ({"supports.a": ["y", "y"]}, ["supports.a", "twice"]),
    "unknown interface": ({"interface": ["q"]}, ["interface.0", "no such node"]),
    "unknown track": ({"track.members": ["left", "rihgt"]}, ["track.members.1", 'did you mean "right"?']),
    "interrupted track": ({"track.members": ["left", "column"]}, ["track.members.1", "interrupted", "node b"]),
    "bent track": ({"track.members": ["right", "column"]}, ["track.members.1"]),
    "zero length": ({"node.a": [4.0, 0.0, 0.0]}, ["member.left.nodes", "no length"]),
    "two coordinates": ({"node.a": [0.0, 0.0]}, ["node.a", "three"]),
    "lonely node": ({"node.e": [9.0, 9.0, 0.0]}, ["node.e", "no member"]),
    "no orientation": ({"member.column.up": None}, ["member.column.up", "not defined"]),
    "up along": ({"member.left.up": [2.0, 0.0, 0.0]}, ["member.left.up", "not defined"]),
    "no direction": ({"track.direction": [0.0, 0.0, 0.0]}, ["track.direction", "not all zero"]),
    "load along": ({"track.direction": [1.0, 0.0, 0.0]}, ["track.direction", "along the track"]),
    "offset along": ({"track.offset": [0.5, 0.0, 0.0]}, ["track.offset", "square"]),
    "offset of an oblique load": ({"track.direction": [0.5, 0.0, -1.0]}, ["track.direction", "square"]),
    "no torsion": ({"section.leg.torsion_constant": None}, ["section.leg.torsion_constant", "missing"]),
    "no shear modulus": ({"section.leg.shear_modulus": None}, ["section.leg.shear_modulus", "missing"]),
    "two shear moduli": ({"section.deck.shear_modulus": 8e10}, ["section.deck", "twice"]),
    "no shear area": ({"section.deck.shear_area": None}, ["section.deck.shear_area", "missing"]),
    "too fine a track": (
        {"member.left.elements": 600, "member.right.elements": 600},
        ["track.members", "at most 1000", "1200"],
    ),
    "empty spring": ({"spring.brace.stiffness": [0.0, 0.0, 0.0]}, ["spring.brace", "holds nothing"]),
    "spring to itself": ({"spring.brace.to": "a"}, ["spring.brace.to", "another node"]),
    "mode left out": ({"leave_out": [11]}, ["leave_out.0", "modes = 10"]),
    "nothing left": ({"leave_out": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]}, ["leave_out", "no mode is left"]),
    "a roller": ({"supports.a": "roller"}, ["supports.a", 'did you mean ["z"]?']),
    "off the plane": ({"plane": "xz"}, ["off the plane"]),
    "unit": ({"section.deck.area": "2 kg"}, ["section.deck.area", "area"]),
}


@pytest.mark.fault(7)
@pytest.mark.parametrize("name", REFUSED)
def test_refusals_name_the_place(name: str) -> None:
    changes, words = REFUSED[name]
    body = write_copy(BRIDGE)
    for path, value in changes.items():
        put(body, path.split("."), value)
    text = write_document(STUDY | {"body": {"bridge": body}, "sensor": {}} | {"sweep": {}})
    with pytest.raises(BadInput) as caught:
        engine.run(load(text))
    message = str(caught.value)
    assert "bridge" in message or "carriage" in message
    for word in words:
        assert word in message, message


def test_a_support_that_holds_nothing_in_a_plane_is_refused() -> None:
    """It was taken, and the lowest frequency of a bridge was 0.81 Hz in place of 2.52."""
    rail = straight({"a": ["x", "z"], "b": ["y"]}, plane="xz")
    with pytest.raises(
        BadInput, match=r"supports\.b: in a frame of the plane xz no node moves.*expected some of x, z, ry"
    ):
        load(write_document(STUDY | {"body": {"bridge": rail}}))


def test_a_key_of_another_kind_of_body_is_told_as_that() -> None:
    with pytest.raises(BadInput, match=r'body\.bridge\.node: unknown key.*node is a key of the kind "frame"'):
        load(write_document(STUDY | {"body": {"bridge": UNIFORM | {"node": {"a": [0.0, 0.0, 0.0]}}}}))


def test_modes_that_loads_do_not_move_stand_in_brackets() -> None:
    """An axial mode, by an area that was made up, was taken for the third bending frequency of a bridge."""
    rail = straight({"a": ["x", "z"], "b": ["z"]}, plane="xz", section={"area": 2e-4})
    given = load(write_document(STUDY | {"body": {"bridge": rail}, "sweep": {}}))
    tables = preview(kind_of(given).parts(given), 1).tables
    table = next(one for one in tables if one.title.startswith("Bodies"))
    assert table.title == "Bodies (in brackets: loads on the track do not move these modes)"
    frequencies = table.rows[0][3]
    assert 1 <= frequencies.count("(") < 6 and not frequencies.startswith("(")


def test_directions_are_vectors_or_axes_by_their_names() -> None:
    """As those of sensors."""
    named, written = (
        load(
            write_document(STUDY | {"body": {"bridge": BRIDGE | {"point": {"shoe": {"node": "b", "direction": way}}}}})
        )
        for way in ("y", [0.0, 1.0, 0.0])
    )
    assert named.body == written.body
    assert {"enum": ["x", "y", "z"], "type": "string"} in Point.model_json_schema()["properties"]["direction"]["anyOf"]
    with pytest.raises(BadInput, match=r"point\.shoe\.direction"):
        load(
            write_document(STUDY | {"body": {"bridge": BRIDGE | {"point": {"shoe": {"node": "b", "direction": "w"}}}}})
        )


def test_unconnected_frames_are_refused() -> None:
    body = write_copy(BRIDGE)
    body["node"] |= {"e": [0.0, 5.0, 0.0], "f": [4.0, 5.0, 0.0]}
    body["member"]["alone"] = body["member"]["left"] | {"nodes": ["e", "f"]}
    with pytest.raises(BadInput, match=r"node\.e: nothing connects"):
        load(write_document(STUDY | {"body": {"bridge": body}}))


def test_a_frame_that_nothing_holds() -> None:
    body = {key: value for key, value in BRIDGE.items() if key not in ("supports", "spring")} | {"own_weight": True}
    with pytest.raises(BadInput, match="nothing holds this body fully"):
        engine.run(load(write_document(STUDY | {"body": {"bridge": body}})))
    hinged = body | {"supports": {next(iter(BRIDGE["supports"])): "pinned"}, "own_weight": False}
    with pytest.raises(BadInput, match="nothing holds this body against 3 rigid motions, so"):
        engine.run(load(write_document(STUDY | {"initial": "equilibrium", "body": {"bridge": hinged}})))


def test_a_sensor_off_the_track() -> None:
    sensor = {"far": {"body": "bridge", "at": 8.1}}
    with pytest.raises(BadInput, match=r"sensor\.far\.at: a sensor off its body"):
        load(write_document(STUDY | {"sensor": sensor}))


def write_copy(value: Any) -> Any:
    """A deep copy of plain data."""
    return {key: write_copy(item) for key, item in value.items()} if isinstance(value, dict) else value


def put(table: dict[str, Any], keys: list[str], value: Any) -> None:
    for key in keys[:-1]:
        table = table.setdefault(key, {})
    if value is None:
        del table[keys[-1]]
    else:
        table[keys[-1]] = value


UNIFORM = beam(length=LENGTH, area=AREA, second_moment=SECOND_MOMENT, youngs_modulus=MODULUS, density=DENSITY)


def passage(body: dict[str, Any], mass: float, speed: float) -> Study:
    motion = {"kind": "cruise", "start": 0.0, "end": LENGTH, "speed": speed}
    return Study(
        kind="passage",
        body={"bed": body},
        carriage={"table": {"on": "bed", "kind": "mass", "mass": mass, "motion": motion}},
        sensor={"midspan": {"body": "bed", "at": LENGTH / 2.0}, "below": {"under": "table"}},
        solver={"steps": 2000, "scheme": "fox-goodwin", "fidelity": "mass"},
    )


def test_a_passage_over_a_straight_frame_is_one_over_a_beam() -> None:
    frame = straight({"a": "pinned", "b": ["z"]}, elements=24, modes=5, plane="xz", own_weight=True)
    uniform = UNIFORM | {"modes": 5, "own_weight": True}
    expected, found = (engine.run(passage(body, 600.0, 8.0)) for body in (uniform, frame))
    assert int(found.status) == 0
    for name in ("midspan_max", "midspan_min", "below_max", "midspan_rms", "table_contact_force_max"):
        np.testing.assert_allclose(float(found[name]), float(expected[name]), rtol=1e-4, err_msg=name)
    # The span that counts for contact forces ends where the frame is held.
    assert float(found.table_contact_force_min) == pytest.approx(float(expected.table_contact_force_min), rel=1e-3)


def test_a_mass_weighs_by_its_share_of_gravity() -> None:
    """Along w acts what gravity has of that direction: nothing sideways, the cosine on a slope."""
    found = {}
    for name, direction in {"down": [0, 0, -1.0], "aside": [0, 1.0, 0], "oblique": [0, 0.6, -0.8]}.items():
        track = {"members": ["left", "right"], "direction": direction}
        study = STUDY | {"body": {"bridge": write_copy(BRIDGE) | {"track": track}}, "sweep": {}}
        found[name] = engine.run(load(write_document(study)))
    weight = float(found["down"].trolley_contact_force_max)
    assert float(np.abs(found["aside"].trolley_contact_force_max)) <= 1e-12 * weight
    assert 0.75 < float(found["oblique"].trolley_contact_force_max) / weight < 0.85


@pytest.mark.fault(45)
@pytest.mark.parametrize("value", [1e-300, 1e-30, 1e30, 1e300])
def test_numbers_of_absurd_size_never_crash(value: float) -> None:
    """Each number of the frame in turn: the frame is refused, or all that a march asks of it is finite."""
    table = write_copy(BRIDGE) | {"interface": [], "leave_out": []}
    for path in _numbers((), table):
        changed = _with(table, path, value)
        try:
            modal = build_body(Frame.model_validate(changed))
        except (BadInput, ValueError):  # pydantic's errors are ValueErrors; a study turns them into BadInput
            continue
        assert np.isfinite(modal.omega).all() and np.isfinite(modal.shape([0.0, 1.0])).all(), path


def _numbers(here: tuple[Any, ...], value: Any) -> list[tuple[Any, ...]]:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return [here]
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path for key, item in items for path in _numbers((*here, key), item)]


def _with(table: Any, path: tuple[Any, ...], value: float) -> Any:
    if not path:
        return value
    copy = dict(table) if isinstance(table, dict) else list(table)
    copy[path[0]] = _with(copy[path[0]], path[1:], value)
    return copy


def test_dampers_at_nodes_are_those_of_the_beam() -> None:
    """Both ends and the middle on springs with dampers; the sweep of a damper shares one reduction."""
    ends, middle = {"stiffness": 1e6, "damping": 300.0}, {"stiffness": 1e3, "damping": 2000.0}
    supports = [ends | {"at": 0.0}, middle | {"at": LENGTH / 2.0}, ends | {"at": LENGTH}]
    frame = straight({"a": ["x"]}, elements=12, modes=7, plane="xz")
    frame["node"]["m"] = [LENGTH / 2.0, 0.0, 0.0]
    half = frame["member"].pop("span")
    frame["member"] = {"left": half | {"nodes": ["a", "m"]}, "right": half | {"nodes": ["m", "b"]}}
    frame["track"] = {"members": ["left", "right"]}
    frame["spring"] = {
        name: {"node": name, "stiffness": [0.0, 0.0, one["stiffness"]], "damping": [0.0, 0.0, one["damping"]]}
        for name, one in (("a", ends), ("m", middle), ("b", ends))
    }
    found = []
    for table, key in (
        (UNIFORM | {"supports": supports, "modes": 7}, "supports.1.damping"),
        (frame, "spring.m.damping.2"),
    ):
        data = passage(table, 600.0, 8.0).data
        sweep = {"damping": {"of": f"body.bed.{key}", "values": [0.0, 500.0, 4000.0]}}
        study = Study(**(data | {"sweep": sweep, "solver": data["solver"] | {"steps": 4000}}))
        assert len(engine.batch.plan.make_plan(study).groups) == 1
        found.append(engine.run(study))
    for name in ("midspan_max", "midspan_min", "below_max", "below_min"):
        one, other = (dataset[name].values for dataset in found)
        np.testing.assert_allclose(other, one, rtol=1e-4, atol=1e-5 * found[0].below_max.values.max(), err_msg=name)
        if name == "below_min":  # at the entrance, where the dampers have not yet moved
            continue
        assert np.ptp(one) > 0.01 * np.abs(one).max()


@pytest.mark.parametrize(
    ("changes", "one"),
    [
        ({}, True),
        ({"track": BRIDGE["track"] | {"members": ["right", "left"]}}, True),
        ({"supports": BRIDGE["supports"] | {"b": ["z"]}}, False),
        ({"supports": BRIDGE["supports"] | {"b": ["rx"]}}, True),
        ({"spring": {"pier": {"node": "b", "stiffness": [0.0, 0.0, 1e9]}}}, False),
        ({"spring": {"pier": {"node": "b", "rotational": [0.0, 1e9, 0.0]}}}, True),
        ({"spring": {"brace": {"node": "b", "to": "d", "stiffness": [0.0, 0.0, 1e9]}}}, True),
        ({"node": BRIDGE["node"] | {"d": [6.0, 0.0, -3.0]}}, False),
    ],
)
def test_whether_it_is_one_span(changes: dict[str, Any], one: bool) -> None:
    assert Frame.model_validate(BRIDGE | changes).is_one_span is one


@pytest.mark.parametrize(("members", "ends"), [(["left", "right"], ("a", "c")), (["right", "left"], ("c", "a"))])
def test_check_tells_where_a_track_begins(members: list[str], ends: tuple[str, str]) -> None:
    """Whichever way its members run: `right` runs against the one track, and `left` against the other."""
    bridge = BRIDGE | {"track": {"members": members}}
    given = Study(**STUDY | {"body": {"bridge": bridge}, "solver": {"steps": 200, "audit": 0}})
    tables = preview(kind_of(given).parts(given), 1).tables
    assert [table.rows for table in tables if table.title == "Tracks"] == [[("bridge", *ends, "8 m")]]


def test_a_track_of_one_member_runs_as_its_nodes_do() -> None:
    alone = Study(**STUDY | {"body": {"bridge": BRIDGE | {"track": {"members": ["right"]}}}})
    assert alone.body["bridge"].track_ends == ("c", "b")


@pytest.mark.parametrize(("places", "quantity"), [(6, "bending_moment"), (5, "bending_moment"), (6, "displacement")])
def test_envelopes_that_pass_over_the_end_of_a_member_are_told(places: int, quantity: str) -> None:
    """Of what has a kink there; of six places of 8 m none is in the middle."""
    envelope = {"deck": {"body": "bridge", "quantity": quantity, "places": places}}
    given = Study(**STUDY | {"envelope": envelope, "solver": {"steps": 2000, "audit": 0}})
    told = [
        text for text in remarks(make_plan(given)) if text.startswith("no place of envelope deck is at 4 m of bridge")
    ]
    assert len(told) == (places == 6 and quantity == "bending_moment")
