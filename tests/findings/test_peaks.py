"""The vectorised peaks against their plain twins, closed forms, and against themselves in other company."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from results_schema.arrays import Array
from studies.findings.peaks import PEAKS, Peaks, peaks
from tests.findings.test_indices import waves
from tests.naive import indices as naive


def closed(cycle: Array) -> Array:
    """A cycle (H, ...) with the station at phase 1, where it begins again."""
    return np.concatenate([cycle, cycle[:1]])


def evenly_spaced(cycle: Array) -> Peaks:
    """Peaks of a cycle (H + 1, ...) at equidistant phases."""
    return peaks(np.linspace(0.0, 1.0, len(cycle)), cycle)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), stations=st.sampled_from([40, 64, 201, 400]), ringing=st.sampled_from([0.0, 0.3]))
def test_peaks_are_those_of_the_twin(seed: int, stations: int, ringing: float) -> None:
    cycles = waves(seed, stations, 5)
    cycles += ringing * np.sin(2 * np.pi * (stations // 5) * np.linspace(0.0, 1.0, stations + 1))[:, None, None]
    found = evenly_spaced(cycles)
    for lane in range(5):
        expected = naive.peaks(cycles[:-1, 0, lane].tolist())
        assert found.number[0, lane] == len(expected) > 0
        kept = sorted(sorted(expected, key=lambda peak: -peak.value)[:PEAKS])
        for peak in kept:
            # a parabola moves a peak by up to half a station, the lines of a kink by one, and never down
            away = abs(found.phase[:, 0, lane] - peak.phase)
            nearest = int(np.nanargmin(np.minimum(away, 1.0 - away)))
            assert min(away[nearest], 1.0 - away[nearest]) <= 1.0 / stations + 1e-12
            assert found.value[nearest, 0, lane] >= peak.value - 1e-12
        assert np.isfinite(found.value[:, 0, lane]).sum() == len(kept)


@settings(max_examples=30, deadline=None)
@given(levels=st.lists(st.integers(0, 6), min_size=3, max_size=60))
def test_plateaus_count_once_as_in_the_twin(levels: list[int]) -> None:
    cycle = np.array(levels, dtype=np.float64)
    assert evenly_spaced(closed(cycle)[:, None]).number[0] == len(naive.peaks(cycle.tolist()))


def test_a_parabola_finds_a_peak_between_stations() -> None:
    at = 0.12345
    found = evenly_spaced(np.cos(2 * np.pi * (np.linspace(0.0, 1.0, 401) - at))[:, None, None])
    assert found.number[0, 0] == 1
    assert found.phase[0, 0, 0] == pytest.approx(at, abs=1e-6)
    assert found.value[0, 0, 0] == pytest.approx(1.0, abs=1e-8)
    assert np.isnan(found.value[1:]).all()


@pytest.mark.parametrize("at", [0.003, 0.41, 0.999])
def test_stations_need_not_be_equidistant(at: float) -> None:
    """A parabola is found exactly, also round the end of the cycle."""
    phase = np.sort(np.random.default_rng(3).random(60))
    phase = np.concatenate([[0.0], phase, [1.0]])
    away = np.mod(phase - at + 0.5, 1.0) - 0.5
    found = peaks(phase, (2.0 - away**2)[:, None])
    assert found.number[0] == 1
    assert found.phase[0, 0] == pytest.approx(at, abs=1e-12)
    assert found.value[0, 0] == pytest.approx(2.0, abs=1e-13)


@pytest.mark.parametrize("at", [0.3, 0.30125, 0.3031, 0.9999])
@pytest.mark.parametrize("left", [0.5, 3.0])
def test_a_kink_between_stations_is_found(at: float, left: float) -> None:
    """Two smooth branches that meet, as a moment where the load passes: of second order, not of first."""
    phase, errors = np.linspace(0.0, 1.0, 1601), []
    for stride in (4, 1):
        away = np.mod(phase[::stride] - at + 0.5, 1.0) - 0.5
        branches = np.where(away < 0.0, left * away, -2.0 * away) + 0.1 * np.cos(2.0 * np.pi * away)
        found = peaks(phase[::stride], branches[:, None])
        assert abs(np.mod(found.phase[0, 0] - at + 0.5, 1.0) - 0.5) < 1e-4
        errors.append(abs(found.value[0, 0] - 0.1))
    assert errors[0] < 2e-5 and errors[1] < 2e-6


@pytest.mark.parametrize("waves_per_cycle", [3, 5, 8, 10])
def test_waves_of_few_stations_have_no_kinks(waves_per_cycle: int) -> None:
    """Of 5 to 16 stations each: a parabola is off by little, where the lines of a kink would rise a third beyond."""
    phase, shift = np.linspace(0.0, 1.0, 49), 2 * np.pi * np.linspace(0.0, 1.0, 9)
    found = peaks(phase, np.sin(2 * np.pi * waves_per_cycle * phase[:, None] + shift))
    assert np.nanmin(found.value) > 0.9 and np.nanmax(found.value) < 1.02


@pytest.mark.parametrize(("height", "count"), [(0.019, 1), (0.021, 2)])
def test_a_bump_counts_from_two_percent_of_the_range_on(height: float, count: int) -> None:
    """A triangle from 0 to 1 with a bump on its falling side."""
    cycle = np.interp(np.arange(401), [0, 100, 200, 210, 220, 400], [0, 1, 0.5, 0.5 + height, 0.45, 0])
    assert evenly_spaced(cycle[:, None]).number[0] == count
    assert len(naive.peaks(cycle[:-1].tolist())) == count


def test_flat_tops_constant_cycles_and_those_without_values() -> None:
    flat = np.array([0.0, 1.0, 1.0, 0.0, 0.5, 0.5, 0.5, 0.0])
    assert evenly_spaced(closed(flat)[:, None]).number[0] == len(naive.peaks(flat.tolist())) == 2
    assert evenly_spaced(np.full((17, 1), 3.0)).number[0] == 0
    rounding = 3.0 + 1e-12 * np.sin(np.arange(17.0))
    assert evenly_spaced(rounding[:, None]).number[0] == 0
    lanes = np.stack([closed(flat), np.full(9, np.nan), closed(flat)], axis=1)
    found = evenly_spaced(lanes)
    assert found.number.tolist() == [2.0, 0.0, 2.0] and np.isnan(found.value[:, 1]).all()


def test_of_many_peaks_the_highest_are_kept_by_phase() -> None:
    heights = np.array([5, 9, 1, 8, 2, 7, 6, 3, 4, 10, 12, 11], dtype=np.float64)
    cycle = np.stack([np.zeros(12), heights], axis=1).ravel()
    found = evenly_spaced(closed(cycle)[:, None])
    assert found.number[0] == 12
    np.testing.assert_allclose(found.value[:, 0], [5, 9, 8, 7, 6, 10, 12, 11], rtol=0.02)
    assert np.all(np.diff(found.phase[:, 0]) > 0.0)


def test_ends_of_a_cycle_that_does_not_close_are_no_peaks() -> None:
    phase = np.linspace(0.0, 1.0, 401)
    settled = np.sin(4.0 * np.pi * phase)
    growing = settled + 0.8 * phase  # ends far above where it began, on its way up
    assert evenly_spaced(settled[:, None]).number.tolist() == [2.0]
    found = evenly_spaced(growing[:, None])
    assert found.number.tolist() == [2.0]
    assert np.all(np.nan_to_num(found.phase[:, 0], nan=0.2) < 0.9)


def test_a_peak_where_a_cycle_nearly_closes_is_no_guess_of_stations() -> None:
    """The cycle ends 1.5 % of its range higher than it begins, on its way up: the end is the peak's value."""
    for stations in (401, 3201):
        phase = np.linspace(0.0, 1.0, stations)
        found = evenly_spaced((np.cos(2.0 * np.pi * phase) + 0.03 * phase)[:, None])
        assert found.number[0] == 1
        assert found.value[0, 0] == pytest.approx(1.03, abs=1e-4)
