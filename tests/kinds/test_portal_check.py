"""What `check` tells of studies of robots, against what their runs take."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import studies
from engine.robots.march import march, stretches
from engine.robots.model import build
from engine.robots.modes import with_open_modes
from engine.scene.study import Study
from engine.scene.sweep import expand
from results_schema.errors import BadInput
from studies.commands.preview import preview, size
from studies.protocol.study import kind_of
from tests.robots.scenes import AVERAGE_ACCELERATION, GANTRY, scene

SWEEP = {"acceleration": {"of": ["robot.portal.acceleration_scale"], "values": [0.5, 1.0, 3.0]}}


def study(**more: Any) -> Study:
    return scene({"modes": "auto"}, solver={"tolerance": 2e-2, **more}, sweep=SWEEP, question={"after": 0.1})


def shown(own: Study) -> tuple[dict[str, Any], str]:
    found = preview(kind_of(own).parts(own), 2)
    return {table.title: table for table in found.tables}, found.cost


def test_check_tells_what_robots_are_and_when_they_move() -> None:
    own = study()
    tables, _ = shown(own)
    title = next(name for name in tables if name.startswith("Robots"))
    found = studies.run(own, threads=2)
    cycles = found["cycle_time"].values
    assert title == f"Robots: a cycle of all of them takes {cycles.min():.4g} to {cycles.max():.4g} s"
    portal, hanging = tables[title].rows
    assert portal[:3] == ("portal", "left and right", "1355 kg") and portal[4] == "0 to 80 kg"
    assert hanging[:3] == ("hanging", "right", "350 kg") and hanging[4] == "0 kg"
    model = build(with_open_modes(own.without_sweep()))
    assert [row[-1] for row in (portal, hanging)] == [f"{done:.4g} s" for done in model.done]
    times = {row[0]: row[1] for row in tables["Moves (s), without sweep"].rows}
    starts = model.system.moves[0, :, 0]
    assert [float(part.split(" to ")[0]) for part in times["portal"].split(", ")] == pytest.approx(starts, rel=5e-3)


def test_reach_is_that_of_planned_tools() -> None:
    """Against the tools of a march: from the base point, which goes along by joint 0 and stands still else."""
    from engine.robots.plans import reach

    own = scene()
    model = build(own)
    record, _ = march(model, stretches(model, float(model.done.max()), 0.02, 1), AVERAGE_ACCELERATION)
    for r, robot in enumerate(own.robot.values()):
        planned = record.robots[:, r, :3]
        joint = _places(model, r, record.coordinates[:, 0, 3])
        base = model.system.robots[r, 3:6] + np.stack([joint, 0.0 * joint, 0.0 * joint], axis=1)
        far = np.linalg.norm(planned - base, axis=1).max()
        assert reach(own.arm[robot.arm], robot) == pytest.approx(far, rel=1e-2)


def _places(model: Any, r: int, times: Any) -> Any:
    """Along the rail, by jerks integrated on a grid."""
    from tests.naive.robots_as_particles import Scene

    return np.array([float(Scene(model, t + 1e-9).plans[r][0][0]) for t in times])


@pytest.mark.parametrize("more", [{}, {"tolerance": 5e-2}, {"steps": 600}])
def test_modes_and_disk_are_those_of_the_run(more: dict[str, Any], tmp_path: Path) -> None:
    own = study(**more)
    tables, cost = shown(own)
    taken = next(table for title, table in tables.items() if title.endswith("as in a run"))
    archive = studies.write(found := studies.run(own, threads=2), tmp_path / "found.nc", own)
    modes, steps = found["modes_used"].values, found["steps_used"].values
    assert [(row[1], row[2]) for row in taken.rows] == [
        (str(modes[int(row[0])]), f"{steps[int(row[0])]:,}") for row in taken.rows
    ]
    assert len(taken.rows) == 3
    most = [int(row[2]) for row in tables["Bodies"].rows]
    assert sum(most) == modes.max()
    told = re.search(r"about ([\d.]+) (KiB|MiB) for the archive", cost)
    assert told is not None
    told_bytes = float(told[1]) * {"KiB": 2**10, "MiB": 2**20}[told[2]]
    assert 1 / 1.5 < told_bytes / (tmp_path / "found.nc").stat().st_size < 1.5, (size(int(told_bytes)), archive)
    assert re.match(r"About [\d.]+ (s|min) on 2 threads", cost)


def test_nothing_is_forecast_where_no_variant_ends_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.robots.preview.PATIENCE", 0.0)
    own = study()
    found = preview(kind_of(own).parts(own), 2)
    assert any("not enough for a variant to converge" in remark for remark in found.remarks)


def test_drives_take_units_of_their_joints() -> None:
    """That along the rail slides; others as they are."""
    links = [dict(link) for link in GANTRY["links"]]
    links[0] |= {"stiffness": "6 kN/mm", "damping": "20 kN s/m", "jerk": "10 m/s^3"}
    links[2] |= {"stiffness": "300 kN m/rad", "damping": "800 N m s/rad", "speed": "86 deg/s"}
    arm = GANTRY | {"links": links, "rail": GANTRY["rail"] | {"speed": "90 m/min", "acceleration": "2000 mm/s^2"}}
    found = scene(arm={**scene().data["arm"], "gantry": arm}).arm["gantry"]
    plain = scene().arm["gantry"]
    assert found.rail == plain.rail and found.links[0] == plain.links[0]
    assert found.links[2].stiffness == 3e5 and found.links[2].speed == pytest.approx(np.radians(86.0))
    swept = scene(sweep={"stiffness": {"of": ["arm.gantry.links.2.stiffness"], "values": ["250 kN m/rad", 3e5]}})
    np.testing.assert_array_equal(expand(swept).columns_of(np.arange(2))["arm.gantry.links.2.stiffness"], [2.5e5, 3e5])
    for number, text in ((0, "250 N m/rad"), (2, "6 kN/mm")):
        wrong = [dict(link) for link in GANTRY["links"]]
        wrong[number]["stiffness"] = text
        with pytest.raises(BadInput) as caught:
            scene(arm={**scene().data["arm"], "gantry": GANTRY | {"links": wrong}})
        assert caught.value.where.endswith(f"arm.gantry.links.{number}.stiffness")
