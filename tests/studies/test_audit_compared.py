"""What audits compare: extremes and what the kinds of study make of histories, over which size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import studies
from engine.lanes import LaneValues
from engine.reduction import Compared
from studies.audit import (
    Pair,
    Verdict,
    _differences,
    _scale,
)
from studies.kinds import asymmetry, double_peak
from studies.kinds.double_peak import _peak_gap
from tests.engine.build import beam, fixed, mass, shuttle, study, swing
from tests.studies.audits import FINE, POOR, SWEEP, again, crossing, group_of, outcome


@pytest.mark.parametrize("solver", [{"steps": 300}, {"fidelity": "static"}, {"fidelity": "force", "steps": 300}])
def test_observed_errors_are_those_of_two_runs(solver: dict[str, Any], tmp_path: Path) -> None:
    """Extremes of a displacement over the static one by the closed form, m g L^3/(48 E I)."""
    given = crossing(beam(modes=3), solver | {"audit": 3}, gravity=9.81)
    found = outcome(given, tmp_path)
    group = group_of(found)
    for place in range(3):
        sample = group.isel(sample=place)
        finer = again(given, sample, 6)
        own = found.results.sel(speed=sample["speed"], mass=sample["mass"])
        gaps = [abs(float(own[name]) - float(finer[name])) for name in ("midspan_max", "midspan_min")]
        static = float(sample["mass"]) * 9.81 / 48.0
        assert float(sample["observed_error"]) == pytest.approx(max(gaps) / static, rel=2e-5)
        assert int(sample["modes_used"]) == 6 and int(sample["steps_used"]) >= 800
        assert str(sample["worst_result"].values) == f"midspan_{'max' if gaps[0] > gaps[1] else 'min'}"
    if "fidelity" in solver:
        assert Verdict.of(group).worst > 0.02


def test_velocities_count_by_their_own_size(tmp_path: Path) -> None:
    given = crossing(beam(modes=3), {"steps": 600, "audit": 2}, sensor={"fast": fixed(0.5, "velocity")})
    found = outcome(given, tmp_path)
    for place in range(2):
        sample = group_of(found).isel(sample=place)
        finer, own = again(given, sample, 6), found.results.sel(speed=sample["speed"], mass=sample["mass"])
        size = max(abs(float(finer["fast_max"])), abs(float(finer["fast_min"])))
        gap = max(abs(float(own[name]) - float(finer[name])) for name in ("fast_max", "fast_min"))
        assert float(sample["observed_error"]) == pytest.approx(gap / size, rel=1e-9)


def test_an_asymmetry_compares_its_indices(tmp_path: Path) -> None:
    sensors = {"midspan": fixed(0.5), "quarter": fixed(0.3)}
    motion = shuttle(0.5, 0.9, 0.4, 0.1, 3)
    given = study(
        beam(modes=2, damping_ratio=0.05),
        mass(0.2, motion),
        kind="asymmetry",
        sensor=sensors,
        solver={"steps": 400, "audit": 2},
        sweep=SWEEP,
    )
    found = outcome(given, tmp_path)
    for place in range(2):
        sample = group_of(found).isel(sample=place)
        finer, own = again(given, sample, 4), found.results.sel(speed=sample["speed"], mass=sample["mass"])
        gaps = {name: np.abs(own[name].values - finer[name].values) for name in ("lag", "odd_rms", "even_excess")}
        gaps["lag"] = gaps["lag"] / (0.4 * 0.8)
        extremes = []
        for x in (0.5, 0.3):
            name, static = {0.5: "midspan", 0.3: "quarter"}[x], float(sample["mass"]) * 9.81 * _largest(x)
            extremes += [
                abs(float(own[f"{name}_{end}"]) - float(finer[f"{name}_{end}"])) / static for end in ("max", "min")
            ]
        expected = max(*extremes, *(float(gap.max()) for gap in gaps.values()))
        assert float(sample["observed_error"]) == pytest.approx(expected, rel=1e-3)


def _largest(x: float) -> float:
    """Largest deflection at x per newton anywhere from 0.5 to 0.9 of a pinned beam with L = E I = 1."""
    s = np.linspace(0.5, 0.9, 40001)
    near, far = np.minimum(x, s), np.maximum(x, s)
    return float((near * (1 - far) * (1 - near**2 - (1 - far) ** 2) / 6).max())


def test_a_double_peak_compares_peaks_and_harmonics(tmp_path: Path) -> None:
    given = study(
        beam(modes=2, damping_ratio=0.05),
        mass(0.2, swing(0.5, 0.4, 0.2, 4)),
        kind="double-peak",
        solver={"steps": 300, "audit": 1},
    )
    found = outcome(given, tmp_path)
    finer = studies.run(
        given.with_values(
            {"body.bed.modes": 4, "solver.audit": 0, "solver.steps": int(group_of(found)["steps_used"][0])}
        )
    )
    static = 0.2 * 9.81 / 48.0
    gaps = [abs(float(found.results[name]) - float(finer[name])) for name in ("midspan_max", "midspan_min")]
    for name in ("peak_value", "harmonic"):
        gaps.append(float(np.nanmax(np.abs(found.results[name].values - finer[name].values))))
    assert float(group_of(found)["observed_error"][0]) == pytest.approx(max(gaps) / static, rel=2e-5)


def test_what_the_kinds_add_is_relative_as_it_should_be() -> None:
    """By hand: a cruise of (1 - 2 x 0.1) times the stroke, which the sweep makes 0.4 and 0.25 m; a scale of 2 and 4."""
    scene = study(beam(), mass(0.2, shuttle(0.5, 0.9, 0.4, 0.1, 3)), kind="asymmetry")
    values = LaneValues(scene, {"carriage.car.motion.end": np.array([0.9, 0.25])}, 2)
    scale, loud = np.array([[2.0], [4.0]]), np.zeros((2, 1), dtype=np.bool_)
    reported = {name: np.zeros((2, 1)) for name in ("lag", "odd_rms", "even_excess")}
    once_more = {
        "lag": np.array([[0.032], [-0.02]]),
        "odd_rms": np.full((2, 1), 0.3),
        "even_excess": np.full((2, 1), 0.7),
    }
    kind = asymmetry.KIND.reduction(scene)
    found = kind.differences(Compared(reported, once_more, scale, values))
    np.testing.assert_allclose(found["lag"], [[0.1], [0.1]], rtol=1e-12)
    np.testing.assert_allclose([found["odd_rms"][0, 0], found["even_excess"][1, 0]], [0.3, 0.7])
    ends = {f"midspan_{end}": np.array([1.0, 2.0]) for end in ("max", "min")}
    whole = Pair(("midspan",), reported | ends, once_more | ends, scale, loud, values)
    every = _differences(whole, kind)
    np.testing.assert_array_equal(every["lag"], found["lag"])
    assert set(every) == {"max", "min", "lag", "odd_rms", "even_excess"} and not every["max"].any()
    assert not _differences(replace(whole, silent=~loud), kind)["odd_rms"].any()


def test_harmonics_and_peaks_count_over_the_static_value() -> None:
    scene = study(beam(), mass(0.2, swing(0.5, 0.4, 0.2, 4)), kind="double-peak")
    scale, values = np.array([[2.0], [4.0]]), LaneValues(scene, {}, 2)
    number = np.array([[2.0], [1.0]])
    reported = {"peak_value": np.array([[[1.0, 2.0]], [[1.0, np.nan]]]), "harmonic": np.zeros((2, 1, 3))}
    once_more = {
        "peak_value": np.array([[[1.2, 2.1]], [[1.4, np.nan]]]),
        "harmonic": np.array([[[0.0, -0.6, 0.2]], [[0.8, np.nan, 0.0]]]),
    }
    reported["harmonic"][1, 0, 1] = np.nan
    both = {"peaks_per_cycle": number, "peak_phase": np.array([[[0.2, 0.7]], [[0.4, np.nan]]])}
    compared = Compared(reported | both, once_more | both, scale, values)
    found = double_peak.KIND.reduction(scene).differences(compared)
    np.testing.assert_allclose(found["peak_value"], [[0.1], [0.1]])
    np.testing.assert_allclose(found["harmonic"], [[0.3], [0.2]])


def test_peaks_fit_round_the_cycle_and_differ_in_number_without_error() -> None:
    one = np.array([[[1.0, 2.0, 3.0, np.nan]], [[1.0, 2.0, np.nan, np.nan]], [[np.nan] * 4]])
    other = np.array([[[3.1, 1.0, 2.0, np.nan]], [[1.0, 2.0, 0.5, np.nan]], [[np.nan] * 4]])
    phase = np.array([[[0.2, 0.5, 0.99, np.nan]], [[0.2, 0.5, np.nan, np.nan]], [[np.nan] * 4]])
    again = np.array([[[0.01, 0.2, 0.5, np.nan]], [[0.2, 0.5, 0.8, np.nan]], [[np.nan] * 4]])
    here, there = {"peak_value": one, "peak_phase": phase}, {"peak_value": other, "peak_phase": again}
    compared = Compared(here, there, np.ones((3, 1)), LaneValues(crossing(POOR, {}), {}, 3))
    np.testing.assert_allclose(_peak_gap(compared), [[0.1], [0.0], [0.0]], atol=1e-12)


def test_what_has_no_number_is_known_not_to_have_one() -> None:
    values = LaneValues(crossing(POOR, {}), {}, 3)
    reported = {"lag": np.array([[1.0], [np.nan], [np.nan]])}
    once_more = {"lag": np.array([[1.5], [np.nan], [2.0]])}
    compared = Compared(reported, once_more, np.array([[2.0], [0.0], [0.0]]), values)
    np.testing.assert_array_equal(compared.gap("lag"), [[0.5], [0.0], [np.nan]])
    np.testing.assert_array_equal(compared.relative(np.array([[0.5], [0.0], [1.0]])), [[0.25], [0.0], [np.nan]])


@pytest.mark.parametrize(
    ("supports", "at", "quantity"),
    [
        ("pinned-pinned", 1.0, "displacement"),
        ("clamped-pinned", 0.0, "velocity"),
        ("pinned-pinned", 0.0, "bending_moment"),
        ("clamped-free", 1.0, "bending_moment"),
    ],
)
def test_rounding_has_no_relative_error(supports: str, at: float, quantity: str, tmp_path: Path) -> None:
    """A sensor where nothing can be read, with and without one that reads."""
    bed = beam(modes=12, damping_ratio=0.02, supports=supports)
    for more in ({}, {"middle": fixed(0.5)}):
        given = crossing(bed, FINE | {"audit": 1}, sensor={"nothing": fixed(at, quantity)} | more, sweep={})
        (tmp_path / str(len(more))).mkdir()
        found = group_of(outcome(given, tmp_path / str(len(more))))
        assert (float(found["observed_error"][0]) > 0.0) == bool(more) and Verdict.of(found).held


def test_a_sensor_that_statics_leave_at_rest_counts_by_itself() -> None:
    """A static value that is but rounding is nothing to divide by."""
    arrays = {"x_static": np.array([1e-14, 0.0, 2.0]), "x_max": np.array([0.5, 0.5, 3.0]), "x_min": -np.ones(3)}
    np.testing.assert_array_equal(_scale(["x"], arrays), [[1.0], [1.0], [2.0]])
