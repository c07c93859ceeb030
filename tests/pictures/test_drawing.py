"""Drawings: every study has one, what it shows stands where it should, and shapes move as the modes do."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csc_array

import engine
from engine.bodies.files.model import FileModel
from engine.bodies.imported.outline import _neighbours
from engine.bodies.modal.description import Spot
from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from results_schema.errors import BadInput
from studies.commands import catalogue
from studies.commands.preview import FREQUENCIES_SHOWN, preview
from studies.pictures.common.figures import MUTED
from studies.pictures.moving_shapes import FRONT, SIDE, SPACE, Piece, moving, view_of
from studies.pictures.scene import pictures
from studies.pictures.scene_layout import Layout, in_a_row, layout, starts
from studies.protocol.library import find_study
from studies.protocol.study import kind_of
from studies.reporting.drawing import PAGE, page_of, write_drawing
from studies.results.formatting import number
from tests.bodies import models
from tests.bodies.frames import straight
from tests.engine import gantries
from tests.engine.build import Table, beam, cruise, force, mass, shuttle, study, under
from tests.floating.scenes import ARM, history, steps
from tests.floating.studies.scenes import driven
from tests.pictures.test_report import HOSTILE, MINUS, check_standing_alone
from tests.robots.scenes import marched, scene
from tests.studies import scenes

STUDIES = {f"built-in {name}": path for name, path in catalogue.built_in().items()}
STARTS = {f"start {kind}": catalogue.start_text(kind) for kind in catalogue.starts()}


CAR = mass(0.1, cruise(0.0, 1.0, 1.0))


def laid_out(scene: Study) -> Layout:
    model = base_scene(scene)
    return layout(model, starts(model))


def test_where_nothing_rides_and_nothing_is_read_there_is_nothing_to_draw(tmp_path: Path) -> None:
    body = {"arm": ARM | {"own_weight": True}}
    scene = Study(kind="moving-frames", gravity=9.81, body=body, question={"duration": 1})
    with pytest.raises(BadInput, match="nothing to draw"):
        write_drawing(scene, tmp_path / "drawing")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", [*STUDIES, *STARTS])
def test_every_study_is_drawn(name: str, tmp_path: Path) -> None:
    """With its bodies, carriages, sensors and the frequencies that `check` shows; one page is all that is written."""
    found = engine.load(STUDIES[name] if name in STUDIES else STARTS[name])
    page = write_drawing(found, tmp_path / "drawing")
    assert [path.name for path in page.parent.iterdir()] == [PAGE]
    text = page.read_text(encoding="utf-8")
    reader = check_standing_alone(text)
    shown = reader.text.partition("schema_version")[0].replace(MINUS, "-")
    for part in (one for one in base_scene(found).bodies if one.modal.omega.any() or one.name not in found.frame):
        rest = shown.partition(f"Mode shapes of {part.name}")[2]
        for mode, omega in enumerate(part.modal.omega[:FREQUENCIES_SHOWN], start=1):
            assert f"mode {mode}: {number(omega / (2.0 * np.pi))} Hz" in rest
    for word in (*found.carriage, *found.sensor, found.title, *(one.way_in_words for one in found.sensor.values())):
        assert word in shown
    modes = sum(part.modal.omega.size for part in base_scene(found).bodies)
    assert text.count("<animate ") >= min(2, modes)


@pytest.mark.fault(39)
def test_a_hostile_title_stays_text(tmp_path: Path) -> None:
    hostile = engine.load(find_study("asymmetry")).with_values({"title": HOSTILE})
    page = write_drawing(hostile, tmp_path).read_text(encoding="utf-8")
    assert HOSTILE in check_standing_alone(page).text


def test_bad_places_are_refused_before_anything_is_computed(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    found = engine.load(find_study("asymmetry"))
    for folder in (tmp_path / "file", tmp_path / "missing" / "folder"):
        with pytest.raises(BadInput, match="folder"):
            write_drawing(found, folder)


def test_studies_that_check_refuses_are_refused(tmp_path: Path) -> None:
    found = engine.load(find_study("machine-bed-frequencies"))
    with pytest.raises(BadInput, match="off its body"):
        write_drawing(found.with_values({"question.positions": [-1.0, 1.0]}), tmp_path / "drawing")
    assert not (tmp_path / "drawing").exists()


@pytest.mark.parametrize(
    "supports", ["pinned-pinned", [{"at": 0.2, "stiffness": 50.0}, {"at": 0.8, "rotational": 1.0, "stiffness": 9.0}]]
)
def test_outlines_move_as_the_modes(supports: object) -> None:
    body = laid_out(study(beam(supports=supports), CAR)).bodies["bed"]
    (line,) = body.outline.lines
    modal = body.part.modal
    assert_allclose(-line.motion[:, 2], modal.shape(line.points[:, 0]))
    assert len(body.outline.held) + len(body.outline.springs) == 2


def test_members_move_as_the_track() -> None:
    """Between the ends of elements too, and along it."""
    found = engine.load(find_study("machine-bed-run"))
    body = laid_out(found).bodies["bed"]
    for line in body.outline.lines:
        exact = body.part.modal.shape(line.points[:, 0])
        assert_allclose(-line.motion[:, 2, :6], exact[:, :6], atol=1e-4 * np.abs(exact).max())
    assert found.body["bed"].spot_place(Spot(member="span_1", at=0.4)) == pytest.approx([0.6, 0.0, 0.0])


def test_imported_nodes_move_as_the_track(tmp_path: Path) -> None:
    table = models.Files(tmp_path, straight({"a": "clamped"})).table()
    body = laid_out(models.study(table)).bodies["bed"]
    cloud = body.outline.cloud
    assert cloud is not None
    assert len(body.outline.lines) == len(cloud.points) - 1  # the track, and all elements but the first, which is held
    along = (cloud.points - body.outline.track[0]) @ np.diff(body.outline.track, axis=0)[0] / body.part.modal.length
    shapes = np.einsum("i,pin->pn", body.outline.down, cloud.motion)
    assert_allclose(shapes, body.part.modal.shape(along), atol=1e-9 * np.abs(shapes).max())
    assert body.outline.counts["nodes"] == len(cloud.points)


def test_diagonals_of_elements_are_not_drawn() -> None:
    """Of 4 x 3 square elements, whose matrices join all their corners."""
    places = np.array([[float(x), float(y), 0.0] for x in range(5) for y in range(4)])
    joined = np.linalg.norm(places[:, None] - places, axis=2) < 1.5
    owner = np.arange(len(places))
    model = FileModel(csc_array(joined * 1.0), None, owner + 1, places, owner, 0 * owner, owner < 0)
    edges = _neighbours(model, places)
    assert len(edges) == 4 * 4 + 3 * 5
    assert {float(np.linalg.norm(np.diff(model.places[edge], axis=0))) for edge in edges} == {1.0}


@pytest.mark.parametrize(
    ("body", "wheels", "side"), [(gantries.GIRDER, gantries.PAIRS, -1.0), (gantries.FRAME, gantries.CORNERS, 1.0)]
)
def test_a_gantry_stands_over_its_beams(body: Table, wheels: Table, side: float) -> None:
    """A beam's places count from the left; a frame stands as its points do."""
    scene = laid_out(gantries.gantry(wheels=wheels, body=body))
    left, right, girder = (scene.bodies[name] for name in ("left", "right", "gantry"))
    assert_allclose(left.along(0.0), 0.0)
    assert_allclose(right.along(np.array([0.0, 0.9])), [[0.0, 0.6 * side, 0.0], [0.9, 0.6 * side, 0.0]], atol=1e-12)
    assert_allclose(girder.along(np.array([0.1, 0.7]))[:, :2], [[0.3, 0.0], [0.3, 0.6 * side]], atol=1e-12)
    below = {one.name: one.below[:2].round(9).tolist() for one in scene.contacts["crane"]}
    assert below["right_front"] == [0.45, 0.6 * side]
    assert_allclose(scene.touched("trolley")[:2], [0.3, (scene.positions["trolley"] - 0.1) * side], atol=1e-12)
    assert view_of(scene.points) is SPACE


def test_gravity_points_down() -> None:
    """Whatever the coordinates of a frame are."""
    frame = straight({"a": "clamped"}) | {"gravity_direction": [0.0, 1.0, 0.0]}
    body = laid_out(models.study(frame)).bodies["bed"]
    assert_allclose(body.turn @ [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], atol=1e-12)
    assert_allclose(body.turn @ body.turn.T, np.eye(3), atol=1e-12)


def test_views() -> None:
    assert view_of(np.eye(3)[[0, 2]]) is SIDE
    assert view_of(np.eye(3)[[1, 2]] - np.eye(3)[1]) is FRONT


def test_shapes_swing_from_one_side_to_the_other() -> None:
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    text = moving([Piece(line, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -3.0], [0.0, 0.0, 0.0]]))], SIDE, "mode 1")
    rest, out = (
        np.array(re.findall(r"[\d.]+", d), dtype=float).reshape(-1, 2) for d in re.findall(r' d="(.*?)"', text)
    )
    ends = [
        np.array(re.findall(r"[\d.]+", d), dtype=float).reshape(-1, 2)
        for d in re.findall(r'values="(.*?)"', text)[0].split(";")
    ]
    assert_allclose(ends[0], out)
    assert_allclose(ends[2], out)
    assert_allclose(0.5 * (ends[0] + ends[1]), rest, atol=0.06)
    assert out[1, 1] > rest[1, 1]  # down on the page


def test_vehicles_longer_than_their_body_have_no_shapes_of_the_whole() -> None:
    wheels = {"rear": {"at": 0.0, "stiffness": 9.0}, "front": {"at": 3.0, "stiffness": 9.0}}
    body = {"bed": beam(), "cart": {"kind": "rigid", "length": 3.0, "mass": 1.0, "inertia": 1.0}}
    carriage = {"on": "bed", "kind": "body", "body": "cart", "contacts": wheels, "motion": cruise(-3.0, 3.0, 1.0)}
    page = page_of(study(beam(), {"cart": carriage}, body=body), ())
    assert [shapes.heading for shapes in page.shapes] == ["Mode shapes of bed", "Mode shapes of cart"]


def test_a_deflection_is_said_to_be_of_one_point_where_the_weight_has_several() -> None:
    wheels = {"rear": {"at": 0.0, "stiffness": 9.0}, "front": {"at": 0.1, "stiffness": 9.0}}
    body = {"bed": beam(), "cart": {"kind": "rigid", "length": 0.1, "mass": 1.0, "inertia": 1.0}}
    rides = {"on": "bed", "kind": "body", "body": "cart", "contacts": wheels, "motion": cruise(0.0, 0.9, 1.0)}
    page = page_of(study(beam(), {"cart": rides, "car": CAR}, body=body, gravity=1.0), ())
    (table,) = (table for table in page.tables if table.title == "Carriages")
    sags = [row[table.headings.index("largest static deflection under it")] for row in table.rows]
    assert [sag.endswith(" of its weight at one point") for sag in sags] == [True, False] and all(sags)


def test_a_mast_is_as_high_as_it_is_long_and_sags_under_nothing() -> None:
    """A track that leans sags by the part of the weight across it."""
    found = {}
    for turned in (0.0, 60.0, 90.0):
        frame = {"arm": {"turned": [0, f"{turned} deg", 0]}}
        page = page_of(driven(joints=(), frame=frame, gravity=9.81), ())
        rows = {table.title: dict(zip(table.headings, table.rows[0], strict=True)) for table in page.tables}
        found[turned] = rows["Bodies"]["extent x, y, z"], rows["Carriages"].get("largest static deflection under it")
    assert found[0.0][0] == "10 x 0 x 0 m" and found[90.0] == ("0 x 0 x 10 m", None)
    level, leaning = (float(str(found[turned][1]).split(" ")[0]) for turned in (0.0, 60.0))
    assert leaning == pytest.approx(0.5 * level, rel=2e-2)


def test_what_follows_stands_behind() -> None:
    """By its headway, or by its delay times its speed; not where that is far off the body."""
    axles = {"a": CAR, "b": CAR | {"headway": 0.5}, "c": mass(0.1, cruise(1.0, 0.0, 2.0), delay=0.25)}
    model = base_scene(study(beam(), axles))
    assert in_a_row(model) == pytest.approx({"a": 0.0, "b": -0.5, "c": 1.5})
    assert in_a_row(base_scene(study(beam(), axles | {"d": CAR | {"delay": 9.0}})))["b"] == 0.0


@pytest.mark.parametrize(("start", "end", "behind"), [(0.0, 1.0, -0.25), (1.0, 0.0, 0.25)])
def test_axles_swing_where_their_frequencies_have_them(start: float, end: float, behind: float) -> None:
    """The second one behind the first, which is half-way; both swing as far as the mode moves them there."""
    tram = mass(0.3, cruise(start, end, 1.0)) | {"spacing": [0.25]}
    shapes = page_of(study(beam(), {}, train={"tram": tram}), ()).shapes[-1]
    assert "with tram_1 at 0.5 m of its track, the other axles of its train in their row" in shapes.note
    rest = re.search(r'class="rest"[^>]* d="([^"]*)"', shapes.pictures[0].remark)
    assert rest is not None
    bed, *blocks = (
        np.array([float(x) for x in re.findall(r"(-?[\d.]+) -?[\d.]+", line)]) for line in rest[1].split("M")[1:]
    )
    middle = [0.5 * float(x.min() + x.max()) for x in blocks]
    assert (np.array(middle) - bed[0]) / np.ptp(bed) == pytest.approx([0.5, 0.5 + behind], abs=1e-3)


SWEPT = {"speed": {"of": "train.tram.motion.speed", "values": ["9 km/h", "18 km/h", "14.4 km/h"]}}


def hauled(own: Table, **changes: Any) -> Study:
    """A train of five axles at 0, 0.5, 0.75, 1.5 and 2.5 m over a body of 1 m, to which it has half a metre to go."""
    table = force(2.0, cruise(-0.5, 1.0, 4.0)) | {"spacing": [0.5, 0.25, 0.75, 1.0]} | own
    return study(beam(), {}, **({"train": {"tram": table}, "sensor": {"under": under("tram_5")}} | changes))


@pytest.mark.parametrize(
    ("own", "places"),
    [
        ({}, [1.0, 0.5, 0.25, -0.5]),
        ({"spacing_scale": 0.2}, [0.5, 0.4, 0.35, 0.2, 0.0]),
        ({"motion": cruise(1.0, 0.0, 4.0)}, [0.0, 0.5, 0.75, 1.5]),
    ],
)
def test_a_train_stands_on_its_body_as_far_as_it_goes(own: Table, places: list[float]) -> None:
    """Its first axle at the end, or where the last one has just come on; axles that are far off are left out."""
    row = in_a_row(base_scene(hauled(own)))
    assert row == pytest.approx({f"tram_{axle}": place for axle, place in enumerate(places, 1)})


def test_with_a_train_what_passes_stands_where_it_is_then() -> None:
    """After 1.5 m at 4 m/s; what stays on its body is where it starts."""
    riding = {
        "quick": force(1.0, cruise(0.0, 1.0, 8.0)),
        "late": force(1.0, cruise(1.0, 0.0, 4.0), delay=0.25),
        "stays": force(1.0, shuttle(0.25, 0.75, 1.0, 0.1, 1)),
    }
    row = in_a_row(base_scene(hauled({}, carriage=riding)))
    assert {name: row[name] for name in riding} == pytest.approx({"quick": 3.0, "late": 0.5, "stays": 0.25})
    far = in_a_row(base_scene(hauled({}, carriage=riding | {"far": force(1.0, cruise(0.0, 1.0, 80.0))})))
    assert {name: far[name] for name in riding} == {"quick": 0.0, "late": 1.0, "stays": 0.25}
    assert far["tram_1"] == row["tram_1"]


def test_a_train_is_one_row_with_the_speeds_of_its_sweep() -> None:
    """And no carriage; what a sensor reads under an axle that is left out is not shown."""
    found = hauled({"force": [3e3, 1e3, 2e3, 2e3, 2e3]}, sweep=SWEPT)
    page = page_of(found, ())
    tables = {table.title: table for table in page.tables}
    assert "Carriages" not in tables
    row = dict(zip(tables["Trains"].headings, *tables["Trains"].rows, strict=True))
    assert [row[key] for key in ("axles", "length", "load per axle")] == ["5", "2.5 m", "1 kN to 3 kN"]
    assert (row["in all"], row["speed"]) == ("10 kN", "9 km/h to 18 km/h")
    assert "stand as tram_1 has come to 1 m, 1 axle further off left out;" in page.figures[0].caption


def test_axles_are_drawn_with_their_loads_and_the_way_to_those_behind() -> None:
    """A line goes on beyond the end of the body, to the last axle that is shown."""
    model = base_scene(hauled({"force": [3e3, 1e3, 2e3, 2e3, 2e3]}))
    axes = pictures(layout(model, in_a_row(model)))[0].drawing.axes[0]
    names = {text.get_text() for text in axes.texts}
    assert {"tram_1 (3 kN)", "tram_4 (2 kN)"} <= names and not any("tram_5" in name for name in names)
    ends = [
        np.asarray(line.get_xdata(), dtype=float).tolist() for line in axes.get_lines() if line.get_color() == MUTED
    ]
    assert any(one == pytest.approx([0.0, -0.5]) for one in ends if len(one) == 2)


def test_top_speeds_are_those_of_the_sweep() -> None:
    """Of the slowest and the fastest variant, whatever else is swept."""
    sweep = {
        "far": {"of": "carriage.car.motion.end", "values": [0.5, 1.0]},
        "speed": {"of": "carriage.car.motion.speed", "values": [2.0, 3.0, 1.0]},
    }
    (table,) = (table for table in page_of(study(beam(), CAR, sweep=sweep), ()).tables if table.title == "Carriages")
    assert table.rows[0][-1] == "1 m/s to 3 m/s"


@pytest.mark.parametrize("damping", [0.0, 2e3])
def test_it_is_said_that_dampers_come_on_top_of_damping_ratios(damping: float) -> None:
    """By drawings and by `check`, where there are such."""
    mounts = ", ".join(f"{{ at = {at}, stiffness = 1e6, damping = {damping} }}" for at in (0.0, 10.0))
    given = engine.load(scenes.text_of("passage").replace('"pinned-pinned"', f"[{mounts}]"))
    words = "Damping is of the body alone: its dampers come on top."
    assert (words in page_of(given, []).shapes[0].note) == (damping > 0.0)
    tables = {table.title: table for table in preview(kind_of(given).parts(given), 1).tables}
    assert (tables["Bodies"].rows[0][-1] == "0.03 without its dampers") == (damping > 0.0)


def test_bodies_that_nothing_uses_are_told() -> None:
    found = study(beam(), CAR, body={"bed": beam(), "other": beam()})
    assert any("other" in remark for remark in page_of(found, ()).remarks)


def test_bodies_in_frames_that_move_stand_where_they_are_marched_from(tmp_path: Path) -> None:
    """Ends of tracks at time 0, with a joint that is driven, one that is turned and one that slid; springs between."""
    swing = {"kind": "swing", "centre": 0.4, "amplitude": 0.3, "frequency": 1.0}
    rod = {"kind": "rigid", "length": 1.0, "mass": 2.0, "inertia": 0.2, "own_weight": True}
    frame = {
        "arm": {"position": [1, 2, -3], "joints": [{"kind": "revolute", "axis": [0, 2, 1], "motion": swing}]},
        "rod": {
            "on": "arm",
            "at": 7.0,
            "turned": [0.3, 0.2, -0.5],
            "joints": [
                {"kind": "prismatic", "axis": [0, 1, 1], "start": 0.3},
                {"kind": "revolute", "axis": [1, 1, 0], "start": -0.8},
            ],
        },
    }
    more = {
        "spring": {"cable": {"ends": [{"on": "rod"}, {"position": [0, 0, 4]}], "stiffness": 5.0, "length": 1.0}},
        "load": {
            "wind": {"on": "arm", "between": [1.0, 3.0], "force_per_metre": [0, 0, 2.0]},
            "push": {"on": "rod", "at": 0.5, "force": [1.0, 0, 0], "axes": "body"},
            "turn": {"on": "rod", "torque": [0, 1.0, 0]},
        },
    }
    body, question = {"arm": ARM | {"own_weight": True}, "rod": rod}, {"duration": 1.0}
    scene = Study(kind="moving-frames", gravity=9.81, body=body, frame=frame, question=question, **more)
    model, marched = steps(scene, 1e-9, 1)
    placed = laid_out(scene)
    for place, (name, length) in enumerate((("arm", 10.0), ("rod", 1.0))):
        x, y, z = history(model, marched, "ends", 3 * place, 3)[0]
        np.testing.assert_allclose(placed.bodies[name].along(length), [x, -y, -z], atol=1e-9)
    np.testing.assert_allclose(placed.springs["cable"], [placed.bodies["rod"].along(1.0), [0, 0, -4]], atol=1e-12)
    np.testing.assert_allclose(placed.loaded("wind")[[0, -1]], placed.bodies["arm"].along(np.array([1.0, 3.0])))
    text = write_drawing(scene, tmp_path / "drawing").read_text(encoding="utf-8")
    assert "their springs and loads" in text
    assert "Mode shapes of arm" in text and "Mode shapes of rod" not in text  # rigid: it moves as its frame does


def test_robots_stand_where_their_plans_begin() -> None:
    record = marched(scene(), 0.05, 0.1)[1]
    placed = laid_out(scene())
    for place, line in enumerate(placed.robots.values()):
        np.testing.assert_allclose(line[-1], record.robots[0, place, :3], atol=1e-9)
    assert [len(placed.feet(name)) for name in placed.robots] == [2, 1]


def test_a_body_with_nothing_but_a_load_or_a_spring_is_drawn(tmp_path: Path) -> None:
    """Fixed to the ground, as it has no frame of its own."""
    bodies = {name: ARM | {"own_weight": True} for name in ("pushed", "tied")}
    push = {"on": "pushed", "force": [0, 0, 5.0]}
    cable = {"ends": [{"on": "tied"}, {"position": [10, 0, 3]}], "stiffness": 5.0, "length": 1.0}
    more = {"load": {"push": push}, "spring": {"cable": cable}, "question": {"duration": 1.0}}
    scene = Study(kind="moving-frames", gravity=9.81, body=bodies, **more)
    placed = laid_out(scene)
    np.testing.assert_allclose(placed.loaded("push"), [[10, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(placed.springs["cable"], [[10, 0, 0], [10, 0, -3]], atol=1e-12)
    assert "their springs and loads" in write_drawing(scene, tmp_path / "drawing").read_text(encoding="utf-8")
