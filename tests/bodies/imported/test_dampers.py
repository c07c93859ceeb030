"""Dampers at nodes of bodies out of files: beside those of the frame that the files are of, and what refuses them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import studies
from engine.batch.plan import make_plan
from engine.scene.study import Study
from results_schema.errors import BadInput
from studies.reporting.drawing import write_drawing
from tests.bodies.frames import LENGTH, straight
from tests.bodies.models import Files, study

HELD = {"a": "pinned", "b": "pinned"}
MIDDLE = 8  # the node in the middle of twelve elements
DAMPING = [1.0, 2e4, 3e5]  # N s/m; the last holds the middle nearly still
SOLVER = {"solver": {"tolerance": 1e-4}}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return Files(tmp_path_factory.mktemp("damped"), straight(HELD, elements=12))


def damped(files: Files, damping: float = 0.0) -> dict[str, Any]:
    return files.table(point={"mount": {"node": MIDDLE, "damping": damping}}, modes=20)


def swept(body: dict[str, Any], key: str) -> Study:
    return study(body, sweep={"damping": {"of": f"body.bed.{key}", "values": DAMPING}}, **SOLVER)


def test_a_damper_does_what_it_does_on_the_frame(files: Files) -> None:
    halves = {
        name: {"nodes": nodes, "section": "rail", "elements": 6}
        for name, nodes in (("left", ["a", "m"]), ("right", ["m", "b"]))
    }
    whole = straight(HELD, modes=20) | {"member": halves, "track": {"members": ["left", "right"]}}
    whole |= {
        "node": whole["node"] | {"m": [0.5 * LENGTH, 0.0, 0.0]},
        "spring": {"mount": {"node": "m", "damping": [0.0, 0.0, 1.0]}},
    }
    case = swept(damped(files), "point.mount.damping")
    assert len(make_plan(case).grids) == 1
    found, told = studies.run(case), studies.run(swept(whole, "spring.mount.damping.2"))
    for name in ("middle_max", "middle_rms"):
        assert found[name].values == pytest.approx(told[name].values, rel=2e-3), name
    assert np.ptp(found.middle_max.values) > 0.1 * found.middle_max.values.max()


def test_each_variant_is_what_it_is_alone(files: Files) -> None:
    found = studies.run(swept(damped(files), "point.mount.damping"))
    alone = studies.run(study(damped(files, DAMPING[1]), **SOLVER))
    assert float(found.middle_max[1]) == pytest.approx(float(alone.middle_max), rel=1e-4)


def test_frames_that_move_have_no_dampers(files: Files) -> None:
    """Springs of a frame at its nodes bend with it; its dampers did nothing, and nothing said so."""
    shake = {"kind": "swing", "amplitude": 0.05, "frequency": 3.0}
    moved = {"bed": {"joints": [{"kind": "prismatic", "axis": [1, 0, 0], "motion": shake}]}}
    spring = {"mount": {"node": "b", "stiffness": [0.0, 0.0, 1e5], "damping": [0.0, 0.0, 1e3]}}
    frame = straight(HELD | {"b": ["x", "y"]}, spring=spring, modes=4)
    for body, key in ((damped(files, 1e3), "point.mount.damping"), (frame, "spring.mount.damping.2")):
        case = Study(kind="moving-frames", body={"bed": body}, frame=moved, question={"duration": 0.1})
        with pytest.raises(BadInput, match=f"body.bed.{key}: dampers of a body in a frame that moves"):
            studies.run(case)


def test_drawings_show_them(files: Files, tmp_path: Path) -> None:
    assert "<td>damper</td>" not in write_drawing(study(damped(files)), tmp_path / "none").read_text(encoding="utf-8")
    text = write_drawing(study(damped(files, 1e3)), tmp_path / "one").read_text(encoding="utf-8")
    assert "point mount" in text and "<td>damper</td>" in text
