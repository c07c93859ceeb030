"""Asymmetry and double peak through `studies.run`, against the reference numbers and against the plain twins.

Unit beam (L = rho A = E I = 1), weight 48 whatever the mass, so that the static midspan deflection is 1.
"""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import engine
import studies
from tests.engine.build import beam
from tests.naive import indices
from tests.reference import values

UNIT_BODY = beam(modes=6)
MODES_ONLY = {"static_correction": False, "fidelity": "full", "tolerance": 2e-5}


def unit_study(kind: str, mu: float, body: dict[str, Any], motion: dict[str, Any], **tables: Any) -> engine.Study:
    """A mass on the unit beam with a sensor at midspan."""
    return engine.Study(
        kind=kind,
        gravity=values.WEIGHT / mu,
        body={"beam": {**UNIT_BODY, **body}},
        carriage={"mass": {"on": "beam", "kind": "mass", "mass": mu, "motion": motion}},
        sensor={"midspan": {"body": "beam", "at": 0.5}},
        **tables,
    )


@cache
def out_and_back(mu: float, zeta: float) -> Any:
    """The shuttle of the references, one variant."""
    motion = {
        "kind": "out-and-back",
        "start": values.ASYMMETRY_START,
        "end": values.ASYMMETRY_END,
        "speed": math.pi * values.ASYMMETRY_ALPHA,
        "turn": values.ASYMMETRY_TURN,
        "cycles": values.ASYMMETRY_CYCLES,
    }
    output = {"histories": {"every": 1}}
    return studies.run(
        unit_study("asymmetry", mu, {"damping_ratio": zeta}, motion, solver=MODES_ONLY, output=output)
    ).sel(sensor="midspan")


@pytest.mark.parametrize("case", values.ASYMMETRY, ids=str)
def test_lags_within_a_thousandth(case: values.AsymmetryCase) -> None:
    assert float(out_and_back(case.mu, case.zeta).lag) == pytest.approx(case.lag, rel=1e-3)


def test_odd_even_and_area_within_five_thousandths() -> None:
    found = out_and_back(0.3, 0.02)
    assert float(found.odd_rms) == pytest.approx(values.ASYMMETRY_ODD_RMS, rel=5e-3)
    assert float(found.even_excess) == pytest.approx(values.ASYMMETRY_EVEN_EXCESS, rel=5e-3)
    assert abs(float(found.loop_area)) == pytest.approx(values.ASYMMETRY_LOOP_AREA, rel=5e-3)


def test_the_twin_finds_the_same_in_the_whole_history() -> None:
    """Every step of the last cycle and the static deflection as a sum of six modes, into the plain indices."""
    found = out_and_back(0.3, 0.02)
    s, w = found.mass_position.values, found.midspan.values
    half = (len(s) - 1) // 2
    assert s[half] == pytest.approx(values.ASYMMETRY_END)
    turn = values.ASYMMETRY_TURN * (values.ASYMMETRY_END - values.ASYMMETRY_START)
    on = [i for i in range(half + 1) if values.ASYMMETRY_START + turn <= s[i] <= values.ASYMMETRY_END - turn]
    n = np.arange(1, 7)
    size = 2.0 * values.WEIGHT * np.sin(0.5 * n * np.pi) / (n * np.pi) ** 4
    place = s[on, None] * n * np.pi
    static, slope = (size * np.sin(place)).sum(axis=1), (size * n * np.pi * np.cos(place)).sum(axis=1)
    legs = indices.Legs(*(a.tolist() for a in (s[on], w[on], w[[2 * half - i for i in on]], static, slope)))
    expected = indices.asymmetry(legs)
    for name, value in expected._asdict().items():
        assert float(found[name]) == pytest.approx(value, rel=2e-3), name


@cache
def shuttle(frequency_ratio: float) -> Any:
    """The sinusoidal shuttle of the references, after 20 cycles."""
    motion = {
        "kind": "sinusoidal",
        "centre": 0.5,
        "amplitude": 0.49,
        "frequency": frequency_ratio * math.pi / 2.0,
        "cycles": 21,
    }
    study = unit_study("double-peak", 0.1, {"damping_ratio": 0.02}, motion, solver=MODES_ONLY)
    return studies.run(study)


@pytest.mark.parametrize("case", values.DOUBLE_PEAK, ids=str)
def test_double_peak(case: values.DoublePeak) -> None:
    found = shuttle(case.frequency_ratio)
    own = found.sel(sensor="midspan")
    assert float(found.frequency_ratio) == pytest.approx(case.frequency_ratio, rel=1e-4)
    if case.peaks is not None:
        assert int(own.peaks_per_cycle) == case.peaks
        assert np.isfinite(own.peak_value.values).sum() == case.peaks
    if case.largest is not None:
        assert float(found.midspan_max) == pytest.approx(case.largest, abs=1e-3)
        assert np.nanmax(own.peak_value.values) == pytest.approx(float(found.midspan_max), abs=2e-5)
    for order, amplitude in case.harmonics.items():
        assert float(own.harmonic.sel(harmonic_number=order)) == pytest.approx(amplitude, abs=1e-3)
    assert float(own.odd_even_ratio) < 1e-3


def test_peaks_of_the_history_are_those_of_the_twin() -> None:
    found = shuttle(0.25)
    history = found.midspan.values
    expected = indices.peaks(history.tolist())
    own = found.sel(sensor="midspan")
    assert len(expected) == int(own.peaks_per_cycle)
    phases = own.peak_phase.values[: len(expected)]
    assert sorted(phases) == pytest.approx(sorted(peak.phase for peak in expected), abs=1.0 / len(history))


@pytest.mark.parametrize(("springs", "peaks"), [(values.END_SPRINGS, 2), (values.END_SPRINGS_ONE_PEAK, 1)])
def test_unequal_end_springs(springs: tuple[float, float], peaks: int) -> None:
    ends = [{"at": at, "stiffness": stiffness} for at, stiffness in zip((0.0, 1.0), springs, strict=True)]
    motion = {"kind": "sinusoidal", "centre": 0.5, "amplitude": 0.49, "frequency": 2e-3, "cycles": 1}
    body = {"supports": ends, "damping_ratio": 0.02}
    found = studies.run(unit_study("double-peak", 0.1, body, motion)).sel(sensor="midspan")
    assert int(found.peaks_per_cycle) == peaks
    if peaks == 2:
        first, second = (float(found.harmonic.sel(harmonic_number=k)) for k in (1, 2))
        assert first / second == pytest.approx(values.END_SPRINGS_FIRST_OVER_SECOND, abs=1e-3)
        assert float(found.odd_even_ratio) == pytest.approx(values.END_SPRINGS_ODD_OVER_EVEN, abs=1e-3)


def test_amplification_of_a_moving_force() -> None:
    """Against the tabulated largest midspan value over the static one, converged in modes."""
    study = engine.Study(
        kind="passage",
        body={"beam": {**UNIT_BODY, "modes": 40}},
        carriage={
            "load": {
                "on": "beam",
                "kind": "force",
                "force": values.WEIGHT,
                "motion": {"kind": "cruise", "start": 0.0, "end": 1.0, "speed": 0.5 * math.pi},
            }
        },
        sensor={"midspan": {"body": "beam", "at": 0.5}, "rate": {"body": "beam", "at": 0.5, "quantity": "velocity"}},
        solver={"steps": 2000},
    )
    found = studies.run(study)
    assert float(found.dynamic_amplification.sel(sensor="midspan")) == pytest.approx(values.MOVING_FORCE[0.5], abs=2e-5)
    assert np.isnan(float(found.dynamic_amplification.sel(sensor="rate")))
