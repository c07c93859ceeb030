"""What stands in drawings of scenes, and what is said of it: nothing of what is not there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from studies.pictures.scene import pictures
from studies.pictures.scene_layout import in_a_row, layout
from studies.pictures.scene_names import Label, in_rows, write
from studies.reporting.drawing import page_of
from tests.bodies.frames import PINNED, straight
from tests.engine.build import Table, beam, cruise, fixed, mass, study
from tests.robots.scenes import scene

CAR = mass(0.1, cruise(0.0, 1.0, 1.0))


def drawn(found: Study) -> Any:
    model = base_scene(found)
    return pictures(layout(model, in_a_row(model)))[0]


def short(supports: Table) -> Table:
    """A frame of one member of half a metre."""
    return straight(supports, node={"a": [0.0, 0.0, 0.0], "b": [0.5, 0.0, 0.0]})


@pytest.mark.parametrize(("held", "is_wall"), [(["y", "z", "rx"], False), (["y", "z", "rx", "ry"], True)])
def test_held_against_twist_alone_a_member_stands_on_triangles(held: list[str], is_wall: bool) -> None:
    """It bends freely there; a wall is upright, and begins and ends beyond the member."""
    axes = drawn(study(beam(), CAR, body={"bed": short({"a": ["x", *held], "b": held})})).drawing.axes[0]
    outlines = [np.asarray(patch.get_xy()) for patch in axes.patches if hasattr(patch, "get_xy")]
    upright = [
        xy for xy in outlines if len(xy) == 2 and np.ptp(xy[:, 0]) < 1e-9 and xy[:, 1].min() < 0.0 < xy[:, 1].max()
    ]
    assert bool(upright) == is_wall


@pytest.mark.parametrize("places", [[0.0, 0.075], [0.0, 0.01, 0.02], [0.98, 1.0]])
def test_lines_to_names_do_not_cross(places: list[float]) -> None:
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    names = [Label(np.array([x, 0.0]), f"vehicle_{number} (1200 kg)", "red") for number, x in enumerate(places)]
    rows = in_rows(names, (-0.05, 1.05))
    write(rows, axes, 0.1, 0.05)
    assert len({name.row for name in rows}) == len(places)
    for line, x in zip(axes.get_lines(), places, strict=True):
        assert line.get_xdata() == pytest.approx([x, x])


def test_captions_tell_what_is_there() -> None:
    both = drawn(study(beam(), {"car": CAR}, sensor={"middle": fixed(0.5)})).caption
    assert "Carriages (dark orange) stand where they start" in both and "green: sensors" in both
    assert "dashed" not in both and "red" not in both
    assert "sensors" not in drawn(study(beam(), {"car": CAR}, sensor={})).caption


def test_robots_alone_are_no_frames_that_move() -> None:
    caption = drawn(scene()).caption
    assert "Robots (dark orange, the tool a triangle) are as at time 0." in caption
    assert "Frames that move" not in caption and "Carriages" not in caption


def test_columns_in_which_nothing_stands_are_left_out() -> None:
    """A beam is not made of parts."""
    (bodies,) = (table for table in page_of(study(beam(), {"car": CAR}), ()).tables if table.title == "Bodies")
    assert "made of" not in bodies.headings and "mass" in bodies.headings
    assert len(bodies.rows[0]) == len(bodies.headings)


def test_of_modes_along_a_member_it_is_said_that_nothing_is_seen() -> None:
    """Of those alone that do not move across."""
    found = study(beam(), CAR, body={"bed": short(PINNED)})
    bed = layout(base_scene(found), {"car": 0.0}).bodies["bed"]
    motion = np.abs(np.concatenate([line.motion for line in bed.outline.lines])).max(axis=0)[:, :6]
    still = motion < 1e-6 * motion.max()
    told = [shape.value for shape in page_of(found, ()).shapes[0].pictures]
    assert ["along the member" in text for text in told] == (still[1] & still[2] & ~still[0]).tolist()
    assert ["twists" in text for text in told] == still.all(axis=0).tolist()
    assert sum("along" in text for text in told) == 1 and sum("twists" in text for text in told) == 2
