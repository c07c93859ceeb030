"""Along lines through the parameter space no result of a study jumps where another model is chosen."""

from __future__ import annotations

import numpy as np
import pytest

from engine.execution import run
from engine.lanes import LaneValues
from engine.plan import make_plan
from engine.reduction import Compared, Reduction
from studies.kinds.asymmetry import AsymmetryReduction
from studies.kinds.double_peak import DoublePeakReduction
from tests.engine.build import Table, beam, mass, shuttle, study, swing
from tests.engine.test_choice import Array, bracketed

BED = beam(modes="auto", damping_ratio=0.05)
OUT_AND_BACK = mass(0.3, shuttle(0.1, 0.9, 0.3, 0.1, 4))
SWUNG = mass(0.3, swing(0.5, 0.4, 0.15, 4))
LINES: dict[str, tuple[str, Table, Reduction, str, float, float]] = {
    "lag by speed": ("asymmetry", OUT_AND_BACK, AsymmetryReduction(), "carriage.car.motion.speed", 0.05, 0.5),
    "lag by damping": ("asymmetry", OUT_AND_BACK, AsymmetryReduction(), "body.bed.damping_ratio", 0.02, 0.1),
    "peaks by pace": ("double-peak", SWUNG, DoublePeakReduction(), "carriage.car.motion.frequency", 0.05, 0.25),
    "peaks by mass": ("double-peak", SWUNG, DoublePeakReduction(), "carriage.car.mass", 0.01, 1.0),
}


def sides(kind: str, carriage: Table, reduction: Reduction, path: str, values: tuple[Array, Array]) -> Compared:
    """The results next to both sides of every change."""
    given = study(BED, carriage, kind=kind)
    found = [
        run(given.with_values({"sweep": {"line": {"of": path, "values": side.tolist()}}}), reduction=reduction)
        for side in values
    ]
    one, two = ({name: side[name].values for name in reduction.outputs(given)} for side in found)
    scale = np.stack([found[0][f"{sensor}_static"].values for sensor in given.sensor], axis=1)
    return Compared(one, two, scale, LaneValues(given, {path: values[0]}, values[0].size))


@pytest.mark.parametrize("name", LINES)
def test_no_jumps_where_the_choice_changes(name: str) -> None:
    kind, carriage, reduction, path, low, high = LINES[name]
    given = study(BED, carriage, kind=kind)
    values = bracketed(given, path, low, high, lambda one: make_plan(one, reduction=reduction))
    assert values[0].size >= 2
    for jump in reduction.differences(sides(kind, carriage, reduction, path, values)).values():
        assert np.all(jump <= 2.0 * given.solver.tolerance)


def test_peaks_where_the_cycle_is_closed() -> None:
    """Two numbers of steps tell the same peaks, within what both say of their errors."""
    pace = mass(0.3, swing(0.5, 0.4, 0.228777, 2))
    bed = beam(modes=12, damping_ratio=0.02)
    one, two = (
        run(study(bed, pace, kind="double-peak", solver={"steps": steps}), reduction=DoublePeakReduction())
        for steps in (3200, 2400)
    )
    gap = np.nanmax(np.abs(one.peak_value.values - two.peak_value.values)) / float(one.midspan_static)
    assert gap <= 2.0 * float(one.error_estimate + two.error_estimate)
