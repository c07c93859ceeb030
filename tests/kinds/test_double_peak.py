"""What a double-peak study samples, and how two of its answers are compared."""

import numpy as np
import pytest
import xarray as xr

import studies
from engine.observation.cycle_reduction import Compared
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from studies.findings.indices import harmonics
from studies.findings.peaks import peaks
from studies.kinds.double_peak import SAME_PEAK, DoublePeakReduction
from tests.engine.build import beam, mass, study, swing

PHASE = np.linspace(0.0, 1.0, 801)


def answers(*cycles: Array) -> dict[str, Array]:
    """What the study reports of cycles (801,), each a variant with one sensor."""
    found = peaks(PHASE, np.stack(cycles, axis=1)[:, None])
    return {"peaks_per_cycle": found.number.T, "peak_value": found.value.T, "peak_phase": found.phase.T}


def gaps(one: Array, other: Array) -> tuple[float, tuple[float, float]]:
    """How far the peaks of two cycles are apart by what the study reports, and how many both have."""
    here, there = (answers(cycle) | {"harmonic": np.zeros((1, 1, 1))} for cycle in (one, other))
    values = VariantValues(study(beam(), mass(0.2, swing(0.5, 0.4, 0.2, 4)), kind="double-peak"), {}, 1)
    compared = Compared(here, there, np.ones((1, 1)), np.zeros((1, 1)), values)
    numbers = float(here["peaks_per_cycle"][0, 0]), float(there["peaks_per_cycle"][0, 0])
    return float(DoublePeakReduction().differences(compared)["peak_value"][0, 0]), numbers


def bump(at: float, height: float, width: float = 0.02) -> Array:
    """A bell round the cycle."""
    away = np.mod(PHASE - at + 0.5, 1.0) - 0.5
    return height * np.exp(-((away / width) ** 2))


TWO = bump(0.2, 1.0, 0.1) + bump(0.7, 0.8, 0.1)


def test_a_peak_that_is_off_is_told() -> None:
    off, numbers = gaps(TWO, TWO + bump(0.7, 0.008, 0.1))
    assert numbers == (2.0, 2.0) and off == pytest.approx(0.008, rel=1e-3)


def test_bumps_that_are_not_the_same_are_no_error() -> None:
    """As many peaks in both, but another small one: compared in their order, they would be off by a third."""
    off, numbers = gaps(TWO + bump(0.45, 0.1), TWO + bump(0.95, 0.1))
    assert numbers == (3.0, 3.0) and off < 1e-3


def test_neighbours_on_a_slope_are_not_taken_for_each_other() -> None:
    """Crests of ringing 0.04 of a cycle apart, each missing in the other: a value between them would be off by 0.1."""
    slope = bump(0.5, 1.0, 0.2)
    crests = [bump(0.22 + 0.04 * n, 0.2, 0.008) for n in range(4)]
    off, numbers = gaps(slope + crests[0] + crests[1] + crests[3], slope + crests[0] + crests[2] + crests[3])
    assert numbers[0] == numbers[1] and off < 2e-3


def test_a_peak_that_begins_the_cycle_may_end_the_other() -> None:
    off, numbers = gaps(bump(0.001, 1.0, 0.1), bump(0.999, 1.01, 0.1))
    assert numbers == (1.0, 1.0) and off == pytest.approx(0.01, rel=1e-3)


def test_a_flat_top_whose_maximum_wanders_is_no_error() -> None:
    flat = np.tanh(20.0 * (PHASE - 0.2)) * np.tanh(20.0 * (0.8 - PHASE))
    off, numbers = gaps(flat + 1e-5 * PHASE, flat - 1e-5 * PHASE)
    assert numbers == (1.0, 1.0) and off < 2e-5


def test_what_is_further_apart_than_a_peak_moves_is_another_one() -> None:
    one = bump(0.5, 1.0, 0.05)
    assert gaps(one, bump(0.5 + 0.9 * SAME_PEAK, 1.2, 0.05))[0] == pytest.approx(0.2, rel=1e-3)
    assert gaps(one, bump(0.5 + 1.1 * SAME_PEAK, 1.2, 0.05))[0] == 0.0


def test_a_peak_that_is_missing_is_told_by_harmonics() -> None:
    """A bump of a tenth of the range, 0.05 of a cycle wide, is worth 0.1 x 0.05 x sqrt(pi) of twice the mean."""
    scene = study(beam(), mass(0.2, swing(0.5, 0.4, 0.2, 4)), kind="double-peak")
    cycles = [TWO, TWO + bump(0.45, 0.1, 0.05)]
    one, other = (answers(cycle) | {"harmonic": harmonics(cycle[:, None, None]).T} for cycle in cycles)
    compared = Compared(one, other, np.ones((1, 1)), np.zeros((1, 1)), VariantValues(scene, {}, 1))
    found = DoublePeakReduction().differences(compared)
    assert found["harmonic"][0, 0] == pytest.approx(2.0 * 0.1 * 0.05 * np.sqrt(np.pi), rel=0.05)


def test_peaks_are_told_no_less_than_half_of_what_histories_differ_by() -> None:
    """Of two cycles that are shifted the peaks are the same by chance."""
    scene = study(beam(), mass(0.2, swing(0.5, 0.4, 0.2, 4)), kind="double-peak")
    same = answers(TWO) | {"harmonic": np.zeros((1, 1, 1))}
    compared = Compared(same, same, np.full((1, 1), 2.0), np.full((1, 1), 0.3), VariantValues(scene, {}, 1))
    assert DoublePeakReduction().differences(compared)["peak_value"].tolist() == [[pytest.approx(0.3 / 2.0 / 2.0)]]


def test_histories_of_different_steps_stand_on_stations_filled_up_with_nothing() -> None:
    rates = {"rate": {"of": "carriage.car.motion.frequency", "values": [0.01, 0.35]}}
    shuttle = mass(0.2, swing(0.5, 0.4, 0.1, 4))

    def found(histories: object, **solver: object) -> xr.Dataset:
        own = {"audit": 0} | solver
        output = {"histories": histories}
        return studies.run(study(beam(), shuttle, kind="double-peak", sweep=rates, output=output, solver=own))

    whole, tenth = found("all"), found({"every": 10})
    assert whole.midspan.dims == ("rate", "station")
    few, many = sorted(range(2), key=lambda i: int(np.isfinite(whole.midspan[i]).sum()))
    kept = np.isfinite(whole.midspan[few].values)
    assert kept[: kept.sum()].all() and not kept.all() and np.isfinite(whole.midspan[many]).all()
    np.testing.assert_array_equal(np.isfinite(whole.elapsed[few]), kept)
    for i in range(2):
        thinned = whole.midspan[i].values[::10]
        np.testing.assert_array_equal(tenth.midspan[i].values[: thinned.size], thinned)
    assert found("auto").midspan.dims == found("all", steps=1600).midspan.dims == ("rate", "phase")


def test_a_swing_starts_in_the_centre_at_its_largest_speed() -> None:
    given = study(beam(), mass(0.2, swing(0.5, 0.4, 0.1, 4)), kind="double-peak")
    start = given.carriage["car"].motion.path(np.zeros(1))
    assert (start.S[0], start.dS[0]) == (0.5, pytest.approx(2.0 * np.pi * 0.4))
