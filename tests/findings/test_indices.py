"""The vectorised indices against their plain twins, closed forms, and against themselves in other company."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from results_schema.arrays import Array
from studies.findings import indices
from tests.naive import indices as naive


def waves(seed: int, stations: int, lanes: int) -> Array:
    """Cycles (stations + 1, 1, lanes) of a few harmonics, which close."""
    rng = np.random.default_rng(seed)
    phase = np.arange(stations + 1) / stations % 1.0
    orders = np.arange(1, 9)
    angle = 2 * np.pi * (phase[:, None] * orders + rng.random((lanes, 1, len(orders))))
    size = rng.normal(size=(lanes, 1, len(orders))) / orders
    return np.ascontiguousarray((size * np.cos(angle)).sum(axis=-1).T[:, None, :])


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_harmonics_are_those_of_the_twin(seed: int) -> None:
    cycles = waves(seed, 100, 3)
    found = indices.harmonics(cycles)
    for lane in range(3):
        cycle = cycles[:-1, 0, lane].tolist()
        np.testing.assert_allclose(found[:, 0, lane], naive.harmonics(cycle), rtol=0, atol=1e-13)
        assert indices.odd_even_ratio(found)[0, lane] == pytest.approx(naive.odd_even_ratio(cycle), rel=1e-10)


def test_harmonics_that_too_few_stations_cannot_tell_are_nan() -> None:
    found = indices.harmonics(waves(1, 12, 1))[:, 0, 0]
    assert np.isfinite(found[:6]).all() and np.isnan(found[6:]).all() and len(found) == 17
    assert np.isnan(indices.odd_even_ratio(indices.harmonics(np.zeros(17))))


def integral_of_unclosed(k: int, rate: complex) -> complex:
    """The integral of exp(rate x) exp(-2 pi i k x) over [0, 1]."""
    whole = rate - 2j * math.pi * k
    return (cmath.exp(whole) - 1.0) / whole


@pytest.mark.parametrize("omega", [0.3, 7.3, 61.0])
def test_harmonics_of_a_cycle_that_does_not_close_are_of_second_order(omega: float) -> None:
    """w = exp(-x) cos(omega x): closed-form Fourier integrals; a mean over stations alone would be of first order."""
    rates = (complex(-1.0, omega), complex(-1.0, -omega))
    exact = [abs(integral_of_unclosed(k, rates[0]) + integral_of_unclosed(k, rates[1])) for k in range(17)]
    counts, errors = np.array([400, 800, 1600, 3200]), []
    for count in counts:
        phase = np.linspace(0.0, 1.0, count + 1)
        found = indices.harmonics((np.exp(-phase) * np.cos(omega * phase))[:, None])[:, 0]
        errors.append(np.abs(found - exact).max())
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] > 1.9
    assert errors[0] < 1e-3 / 2.0 * (omega / 61.0) + 1e-5


def out_and_back(stations: int, edge: float, shift: float) -> tuple[Array, Array, Array, Array]:
    """Cycle of an out-and-back path whose cruise is from `edge` to 1/2 - edge: position, response, static and slope.

    The static response is a cubic of the position; the response is late by `shift` in position on both ways.
    """
    phase = np.arange(stations + 1) / stations
    half = np.minimum(phase, 1.0 - phase)
    position = 1.0 + 4.0 * half
    way = np.where(phase < 0.5, 1.0, -1.0)

    def static(s: Array) -> Array:
        return s**3 - 2.0 * s**2

    slope = 3.0 * position**2 - 4.0 * position
    return position, static(position - way * shift), static(position), slope


@pytest.mark.parametrize("stations", [200, 401, 800])
@pytest.mark.parametrize("edge", [0.0123, 0.0371, 0.1])
def test_asymmetry_is_that_of_the_twin(stations: int, edge: float) -> None:
    """The twin gets a fine cycle that ends exactly where the cruise does."""
    cycle = [field[:, None, None] for field in out_and_back(stations, edge, -0.01)[1:]]
    cruise = (edge, 0.5 - edge)
    found = indices.asymmetry(indices.folded(cruise, *cycle), 1.0)
    s = np.linspace(1.0 + 4.0 * edge, 3.0 - 4.0 * edge, 20001)
    forward, backward, static = ((x**3 - 2.0 * x**2).tolist() for x in (s + 0.01, s - 0.01, s))
    expected = naive.asymmetry(naive.Legs(s.tolist(), forward, backward, static, (3 * s**2 - 4 * s).tolist()))
    for name in ("lag", "loop_area", "odd_rms", "even_excess"):
        value = float(getattr(found, name)[0, 0])
        assert value == pytest.approx(getattr(expected, name), rel=20.0 / stations**2 + 1e-9), name


def test_a_pure_delay_is_a_lag_of_that_length() -> None:
    cycle = [field[:, None, None] for field in out_and_back(400, 0.1, 1e-4)[1:]]
    forward = indices.asymmetry(indices.folded((0.1, 0.4), *cycle), 1.0)
    assert forward.lag[0, 0] == pytest.approx(-1e-4, rel=1e-6)
    # a cycle whose way out runs against the position trails in the other direction
    assert indices.asymmetry(indices.folded((0.1, 0.4), *cycle), -1.0).lag[0, 0] == pytest.approx(1e-4, rel=1e-6)


def test_no_lag_where_the_static_response_does_not_vary() -> None:
    zeros = np.zeros((41, 1, 2))
    assert all(
        np.isnan(value).all() for value in indices.asymmetry(indices.folded((0.1, 0.4), zeros, zeros, zeros), 1.0)
    )
    weight = 1000.0 + 1e-9 * np.random.default_rng(0).standard_normal((41, 1, 2))  # constant but for rounding
    assert all(
        np.isnan(value).all() for value in indices.asymmetry(indices.folded((0.1, 0.4), weight, weight, zeros), 1.0)
    )


def test_no_lag_of_what_carries_nothing_at_rest() -> None:
    """A suspension force: its static response is rounding, beside what it swings by; 2e16 % were told."""
    phase = np.linspace(0.0, 1.0, 65)[:, None, None]
    swings, rounding = 700.0 * np.sin(9.0 * phase), 1e-12 * np.cos(40.0 * phase)
    found = indices.asymmetry(indices.folded((0.1, 0.4), swings, rounding, 40.0 * rounding), 1.0)
    assert all(np.isnan(value).all() for value in found)
    known = indices.asymmetry(indices.folded((0.1, 0.4), swings, 1e14 * rounding, 4e15 * rounding), 1.0)
    assert all(np.isfinite(value).all() for value in known)


def test_the_way_back_ends_where_the_cycle_does() -> None:
    """A cycle that does not close: the way back comes from the value at phase 1, not from that at phase 0."""
    field = np.linspace(0.0, 3.0, 41)[:, None]
    legs = indices.folded((0.0, 0.5), field, field, field)
    np.testing.assert_array_equal(legs.backward[:, 0], field[::-1, 0][:21])


def test_uneven_phases_are_made_even() -> None:
    even = np.linspace(0.0, 1.0, 401)
    phase = even + np.where(np.arange(401) % 2, 0.2 / 400, 0.0)
    field = np.sin(2 * np.pi * phase)[:, None]
    np.testing.assert_allclose(indices.evenly(phase, field)[:, 0], np.sin(2 * np.pi * even), atol=1e-4)
    assert indices.evenly(even, field) is field


@pytest.mark.parametrize("stations", [200, 350])
def test_a_lane_has_the_same_bits_in_any_company(stations: int) -> None:
    cycles = np.concatenate([waves(3, stations, 37), waves(4, stations, 37)], axis=1)
    whole = (indices.harmonics(cycles),)
    legs = indices.asymmetry(indices.folded((0.05, 0.45), cycles, cycles[::-1], np.roll(cycles, 3, 0)), 1.0)
    for lanes in (slice(0, 1), slice(5, 12), slice(36, 37)):
        part = np.ascontiguousarray(cycles[..., lanes])
        alone = (indices.harmonics(part),)
        own = indices.asymmetry(indices.folded((0.05, 0.45), part, part[::-1], np.roll(part, 3, 0)), 1.0)
        for expected, found in zip((*whole, *legs), (*alone, *own), strict=True):
            assert np.array_equal(expected[..., lanes], found, equal_nan=True)
    assert not math.isnan(float(legs.lag[0, 0]))
