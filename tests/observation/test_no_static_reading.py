"""Sensors that read something while loads move, and nothing where they stand still."""

from typing import Any

import numpy as np
import pytest

import engine
import studies
from engine.batch.plan import make_plan
from engine.batch.plausibility import remarks
from engine.scene.study import Study
from tests.bodies.frames import CLAMPED_FREE, LENGTH, straight
from tests.engine.build import Table, cruise, fixed, force, shuttle, steel, study, under

CANTILEVERS = {
    "beam": steel(LENGTH, supports="clamped-free", damping_ratio=0.02),
    "frame": straight(CLAMPED_FREE, elements=30, damping_ratio=0.02),
}


def cantilever(body: str, **changes: Any) -> Study:
    """The moment where a load stands on a cantilever is that of what is beyond it, of which nothing is at rest."""
    moving = force(300.0, shuttle(2.0, 12.0, 2.0, 0.2, 1))
    sensor = {"moment": under("car", "bending_moment")}
    return study(steel(LENGTH), moving, sensor=sensor, body={"bed": CANTILEVERS[body] | changes})


@pytest.mark.parametrize("body", list(CANTILEVERS))
def test_errors_are_told_over_what_is_read_where_nothing_is_read_at_rest(body: str) -> None:
    """Of beams they were told to be 0, and frames, whose 1e-12 N m at rest are rounding, were said to have diverged."""
    found = studies.run(cantilever(body))
    finer = studies.run(cantilever(body, modes=48).with_values({"solver.steps": 51_200, "solver.tolerance": 0.5}))
    assert int(found.status) == 0 and np.isnan(found.dynamic_amplification).all()
    largest = float(finer.moment_max)
    assert largest == pytest.approx(90.3, rel=2e-3)
    told = float(found.estimated_error.sel(result="moment_max"))
    assert abs(float(found.moment_max) - largest) <= told * largest and 0.0 < told <= 1e-3


SILENT: dict[str, Table] = {
    "support": fixed(0.0),
    "end": fixed(LENGTH, "bending_moment"),
    "rate": fixed(LENGTH, "velocity"),
}


def test_rounding_at_supports_and_ends_is_zero() -> None:
    """Of it an amplification was told that exceeded limits; beside it what is read elsewhere stays."""
    passage = study(
        steel(LENGTH, damping_ratio=0.02), force(300.0, cruise(0.1, LENGTH - 0.1, 5.0)), output={"histories": "all"}
    )
    found = studies.run(passage.with_values({"sensor": SILENT | {"middle": fixed(0.5 * LENGTH)}}))
    for name in SILENT:
        assert not any(found[f"{name}{end}"].values.any() for end in ("", "_max", "_min", "_rms"))
        assert np.isnan(found.dynamic_amplification.sel(sensor=name))
        assert f"{name}: it reads nothing but rounding." in studies.answer(found)
    alone = studies.run(passage.with_values({"sensor": {"middle": fixed(0.5 * LENGTH)}}))
    assert float(found.middle_max) == pytest.approx(float(alone.middle_max), rel=1e-3)
    assert found.dynamic_amplification.sel(sensor="middle") > 1.0


@pytest.mark.parametrize("modes", [2, 6])
def test_what_no_kept_mode_says_but_what_pushes_does_is_no_rounding(modes: int) -> None:
    """The axial force by which 50 kg are braked with 2 m/s2, on modes that bend alone: its error was told to be 0."""
    rail = straight({"a": ["x", "z"], "b": ["z"]}, plane="xz", damping_ratio=0.02, modes=modes)
    motion = {"kind": "point-to-point", "start": 2.0, "end": 12.0, "speed": 2.0, "acceleration": 2.0, "dwell": 1.0}
    car = {"on": "portal", "kind": "mass", "mass": 50.0, "motion": motion, "inertia_along": True}
    axial = {"body": "portal", "at": 1.0, "quantity": "axial_force"}
    given = Study(kind="passage", body={"portal": rail}, carriage={"car": car}, sensor={"axial": axial})
    assert not any("reads 0" in remark for remark in remarks(make_plan(given)))
    found = engine.run(given)
    assert [float(found.axial_max), float(found.axial_min)] == pytest.approx([100.0, -100.0], rel=0.05)
    assert float(found.estimated_error.sel(result="axial_max")) > 0.1
