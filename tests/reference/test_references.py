"""Every number of `values` against an integration or closed form of its own; nothing here imports the engine."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from results_schema.arrays import Array
from tests.naive import indices, motions
from tests.reference import closed_forms, passages, sliding, sprung, values
from tests.reference.closed_forms import PinnedBeam

WEIGHT = values.WEIGHT


@cache
def passage(alpha: float, rows: tuple[tuple[float, float, float], ...]) -> passages.Passage:
    """One integration of all variants of a speed, with the neighbourhoods of the tabulated extremes."""
    table = [row for row in values.MOVING_MASS if row.alpha == alpha]
    focus = [at for row in table for at in (row.largest_at, row.smallest_force_at)]
    case = passages.variants(values.MODES_MOVING_MASS, list(rows))
    return passages.cruise(case, alpha, focus)


SLOW = 0.2  # below this speed a passage takes seconds to integrate

ROWS: dict[float, tuple[tuple[float, float, float], ...]] = {
    0.1: ((0.1, 0.0, 1.0), (0.5, 0.0, 1.0)),
    0.25: ((0.1, 0.0, 1.0), (0.1, 0.02, 1.0), (0.1, 0.0, 0.0)),
    0.5: ((0.1, 0.0, 1.0), (0.5, 0.0, 1.0), (0.5, 0.02, 1.0), (0.5, 0.0, 0.0)),
}


def largest_midspan(mu: float, alpha: float, zeta: float, convective: float) -> tuple[float, float]:
    """Position and value of the largest midspan displacement of the passage."""
    result = passage(alpha, ROWS[alpha])
    t, w = passages.largest(result.t, result.midspan[:, ROWS[alpha].index((mu, zeta, convective))])
    return math.pi * alpha * t, w


@pytest.mark.parametrize(
    "row",
    [pytest.param(row, marks=[pytest.mark.slow] * (row.alpha < SLOW)) for row in values.MOVING_MASS],
    ids=lambda row: f"mu={row.mu}-alpha={row.alpha}",
)
def test_moving_mass_table(row: values.MovingMass) -> None:
    at, largest = largest_midspan(row.mu, row.alpha, 0.0, 1.0)
    assert largest == pytest.approx(row.largest, abs=1.1e-8)
    assert at == pytest.approx(row.largest_at, abs=2e-6)
    result = passage(row.alpha, ROWS[row.alpha])
    c = ROWS[row.alpha].index((row.mu, 0.0, 1.0))
    for s, expected in zip((0.25, 0.5, 0.75), row.under, strict=True):
        n = int(np.argmin(np.abs(result.s - s)))
        assert result.under[n, c] == pytest.approx(expected, abs=1.1e-8)
    assert result.midspan[-1, c] == pytest.approx(row.at_exit, abs=1.1e-8)
    kept = result.s <= 0.95 + 1e-12
    t, negative = passages.largest(result.t[kept], -result.contact_force[kept, c] / WEIGHT)
    assert -negative == pytest.approx(row.smallest_force, abs=1e-6)
    assert math.pi * row.alpha * t == pytest.approx(row.smallest_force_at, abs=6e-5)


@pytest.mark.parametrize("row", values.MOVING_MASS_DAMPED_2_PERCENT)
def test_damped_mass(row: values.LargestMidspan) -> None:
    assert largest_midspan(row.mu, row.alpha, 0.02, 1.0)[1] == pytest.approx(row.largest, abs=1.1e-8)


@pytest.mark.parametrize("row", values.MOVING_MASS_WITHOUT_CONVECTIVE)
def test_mass_without_convective_terms(row: values.LargestMidspan) -> None:
    assert largest_midspan(row.mu, row.alpha, 0.0, 0.0)[1] == pytest.approx(row.largest, abs=1.1e-8)


def force_amplification(alpha: float, modes: int) -> float:
    """Largest midspan over exact static midspan of a moving force."""
    speed = math.pi * alpha
    t = np.linspace(0.0, 1.0 / speed, 20001)
    return passages.largest(t, closed_forms.moving_force(PinnedBeam(modes), WEIGHT, speed, 0.5, t))[1]


@pytest.mark.parametrize(("alpha", "expected"), values.MOVING_FORCE.items())
def test_moving_force_table(alpha: float, expected: float) -> None:
    assert force_amplification(alpha, 63) == pytest.approx(expected, abs=1e-6)
    assert force_amplification(alpha, 200) == pytest.approx(expected, abs=6e-7)
    assert abs(force_amplification(alpha, 20) - expected) < 1.1 * values.MOVING_FORCE_N20_ERROR


def test_largest_amplification_of_a_moving_force() -> None:
    found = minimize_scalar(lambda a: -force_amplification(a, 101), bounds=(0.6, 0.63), method="bounded")
    # the maximum is flat: its position is good to the root of the value's error
    assert found.x == pytest.approx(values.MOVING_FORCE_LARGEST_ALPHA, abs=2e-5)
    assert -found.fun == pytest.approx(values.MOVING_FORCE[0.617034], abs=6e-7)
    one = minimize_scalar(lambda a: -force_amplification(a, 1), bounds=(0.6, 0.63), method="bounded")
    assert -one.fun == pytest.approx(values.MOVING_FORCE_ONE_MODE_MAXIMUM, abs=5e-4)


@cache
def gauss() -> tuple[Array, Array]:
    """Places on (-1, 1) and weights of a rule that is exact far beyond what is integrated here."""
    t, weights = np.polynomial.legendre.leggauss(400)
    return t, weights


def free_amplitude(alpha: float, forces: int, spacing: float, zeta: float) -> float:
    """Mode-1 amplitude after the last exit of forces `spacing` apart, by quadrature of Duhamel's integral.

    Amplitude of the complex coordinate c' = (-zeta + i sqrt(1 - zeta^2)) omega c + f, over 2 P L^3/(pi^4 E I).
    """
    omega, speed = math.pi**2, math.pi * alpha
    rate = complex(-zeta, math.sqrt(1.0 - zeta**2)) * omega
    t, weights = gauss()
    t, weights = 0.5 * (t + 1.0) / speed, 0.5 * weights / speed
    end = 1.0 / speed + (forces - 1) * spacing / speed
    total = sum(
        np.sum(weights * np.sin(math.pi * speed * t) * np.exp(rate * (end - t - n * spacing / speed)))
        for n in range(forces)
    )
    return float(abs(total)) * omega


def test_residual_vibration() -> None:
    for alpha in (0.15, 0.25, 0.4, 0.731399, 1.0, 1.4):
        assert closed_forms.residual_amplitude(alpha) == pytest.approx(free_amplitude(alpha, 1, 0.0, 0.0), rel=1e-9)
    for alpha in values.RESIDUAL_ZERO_ALPHAS:
        assert closed_forms.residual_amplitude(alpha) < 1e-12
    assert closed_forms.residual_amplitude(0.25) == pytest.approx(values.RESIDUAL_AT_QUARTER, abs=5e-7)
    found = minimize_scalar(lambda a: -closed_forms.residual_amplitude(a), bounds=(0.6, 0.9), method="bounded")
    assert found.x == pytest.approx(values.RESIDUAL_MAXIMUM_ALPHA, abs=1e-5)
    assert -found.fun == pytest.approx(values.RESIDUAL_MAXIMUM, abs=5e-7)


def test_train_gain() -> None:
    count, alpha = values.TRAIN_FORCES, 0.3
    first_frequency, speed = 0.5 * math.pi, math.pi * alpha
    for zeta, per_spacing in ((0.0, 1.0), (0.0, 0.5), (0.02, 1.0), (0.05, 1.3)):
        spacing = per_spacing * speed / first_frequency
        one = free_amplitude(alpha, 1, spacing, zeta)
        gain = free_amplitude(alpha, count, spacing, zeta) / one
        assert gain == pytest.approx(closed_forms.train_gain(count, zeta, per_spacing), abs=1e-9)
    assert closed_forms.train_gain(count, 0.0, 1.0) == pytest.approx(count)
    assert closed_forms.train_gain(count, 0.0, 0.5) == pytest.approx(0.0, abs=1e-12)
    assert closed_forms.train_gain(count, 0.02, 1.0) == pytest.approx(values.TRAIN_GAIN_DAMPED, abs=5e-5)


def test_influence_lines_are_sums_over_modes() -> None:
    beam = PinnedBeam(4000)
    for x, s in ((0.5, 0.5), (0.2, 0.7), (0.9, 0.35)):
        modal = float(np.sum(beam.phi(x, 0) * beam.phi(s, 0) / beam.omega**2))
        assert closed_forms.influence_pinned(x, s) == pytest.approx(modal, abs=1e-12)
    own = float(np.sum(beam.own_weight * beam.phi(0.3, 0) / beam.omega**2))
    assert closed_forms.own_weight_pinned(0.3) == pytest.approx(own, abs=1e-12)
    assert WEIGHT * closed_forms.influence_pinned(0.5, 0.5) == pytest.approx(1.0)


def test_characteristic_values() -> None:
    clamped, free, pinned = closed_forms.CLAMPED, closed_forms.FREE, closed_forms.PINNED
    for b in closed_forms.characteristic_values(clamped, clamped, 5):
        assert math.cos(b) == pytest.approx(1.0 / math.cosh(b), abs=1e-10)
    for b in closed_forms.characteristic_values(clamped, free, 5):
        assert math.cos(b) == pytest.approx(-1.0 / math.cosh(b), abs=1e-10)
    for b in closed_forms.characteristic_values(clamped, pinned, 5):
        assert math.tan(b) == pytest.approx(math.tanh(b), rel=1e-9)
    exact = closed_forms.characteristic_values(clamped, clamped, 5)
    assert closed_forms.characteristic_values(free, free, 5) == pytest.approx(exact, rel=1e-11)
    assert closed_forms.characteristic_values(pinned, pinned, 64) == pytest.approx(
        [k * math.pi for k in range(1, 65)], rel=1e-12
    )
    stiff = closed_forms.characteristic_values(closed_forms.End(1e9, 0.0), closed_forms.End(1e9, 0.0), 3)
    assert stiff == pytest.approx([math.pi, 2 * math.pi, 3 * math.pi], rel=1e-5)
    soft = closed_forms.characteristic_values(closed_forms.End(1e-2, 0.0), closed_forms.End(1e-2, 0.0), 1)
    assert soft[0] ** 4 == pytest.approx(0.02, rel=1e-3)  # a rigid beam on two springs: omega^2 = 2 k/m


def test_sprung_mass_yang_yau() -> None:
    case = values.YANG_YAU
    stiffness = case.youngs_modulus * case.second_moment
    omega = (math.pi / case.length) ** 2 * math.sqrt(stiffness / case.mass_per_length)
    assert omega == pytest.approx(values.YANG_YAU_OMEGA_1, abs=5e-5)
    assert math.sqrt(case.stiffness / case.mass) == pytest.approx(values.YANG_YAU_OMEGA_BODY, abs=5e-5)
    static = case.mass * 9.81 * case.length**3 / (48.0 * stiffness)
    assert static == pytest.approx(values.YANG_YAU_STATIC, abs=5e-10)
    for modes, expected in case.largest_midspan.items():
        result = sprung.cross(case, modes, 4001, 1e-10)
        assert passages.largest(result.t, result.midspan)[1] == pytest.approx(expected, abs=6e-10)
        body = passages.largest(result.t, np.abs(result.body_acceleration))[1]
        assert body == pytest.approx(values.YANG_YAU_BODY_ACCELERATION[modes], abs=6e-7)


def test_sprung_mass_vbi_2d() -> None:
    """The published number belongs to its own step of 1 ms, not to the limit of small steps."""
    at, largest = sprung.march(values.VBI_2D, 40, values.VBI_2D_STEPS)
    assert largest == pytest.approx(values.VBI_2D.largest_midspan[40], abs=6e-11)
    assert largest == pytest.approx(values.VBI_2D_FILE, abs=4e-10)
    assert at == pytest.approx(values.VBI_2D_LARGEST_AT)
    fine = sprung.cross(values.VBI_2D, 10, 4001, 1e-9)
    assert passages.largest(fine.t, fine.midspan)[1] == pytest.approx(values.VBI_2D_CONVERGED[10], abs=6e-10)


def test_stem_moving_force() -> None:
    case = values.STEM
    beam = PinnedBeam(100, case.length, case.bending_stiffness, case.mass_per_length)
    t = np.linspace(1.2, 1.45, 25001)
    at, largest = passages.largest(t, closed_forms.moving_force(beam, case.force, case.speed, 12.5, t))
    assert closed_forms.midspan_static(beam, case.force) == pytest.approx(values.STEM_STATIC, abs=5e-8)
    assert largest == pytest.approx(values.STEM_LARGEST, abs=6e-8)
    assert at == pytest.approx(values.STEM_LARGEST_AT, abs=5e-4)


@pytest.mark.parametrize(("modes", "expected"), values.BIGGS_MIDSPAN.items())
def test_biggs_moving_force(modes: int, expected: tuple[float, ...]) -> None:
    case = values.BIGGS
    beam = PinnedBeam(modes, case.length, case.bending_stiffness, case.mass_per_length)
    found = closed_forms.moving_force(beam, case.force, case.speed, 240.0, np.array(values.BIGGS_TIMES))
    assert found == pytest.approx(np.array(expected), abs=5e-6)


def test_small_limit_of_the_contact_force() -> None:
    found = closed_forms.quasi_static_contact_force(values.SMALL_LIMIT_MU, values.SMALL_LIMIT_ALPHA) - 1.0
    assert found == pytest.approx(values.SMALL_LIMIT, abs=5e-8)
    # the same from differences of the static deflection under the load
    under = [closed_forms.influence_pinned(s, s) * WEIGHT for s in (0.499, 0.5, 0.501)]
    curvature = (under[0] - 2.0 * under[1] + under[2]) / 1e-6
    speed = math.pi * values.SMALL_LIMIT_ALPHA
    assert -values.SMALL_LIMIT_MU * speed**2 * curvature / WEIGHT == pytest.approx(found, rel=1e-4)


@cache
def asymmetry_indices(stations: int = 401) -> dict[tuple[float, float], indices.Asymmetry]:
    """Indices of the third cycle's cruise on equally spaced stations, modal static response, for every row."""
    law = motions.out_and_back(
        values.ASYMMETRY_START,
        values.ASYMMETRY_END,
        math.pi * values.ASYMMETRY_ALPHA,
        values.ASYMMETRY_TURN,
        values.ASYMMETRY_CYCLES,
    )

    def motion(t: float) -> tuple[float, float, float]:
        phase = next(phase for phase in law if t <= phase.end)
        return phase.s(t), phase.ds(t), phase.dds(t)

    out, back = law[-5], law[-2]  # a cycle is turn, cruise, turn, turn, cruise, turn
    runs = [np.linspace(run.start, run.end, stations) for run in (out, back)]
    case = passages.variants(values.ASYMMETRY_MODES, [(row.mu, row.zeta, 1.0) for row in values.ASYMMETRY])
    start = passages.equilibrium(case, values.ASYMMETRY_START)
    result = passages.integrate(case, motion, np.concatenate([[0.0], *runs]), start, rtol=1e-9)
    s = result.s[1 : stations + 1]
    beam = PinnedBeam(values.ASYMMETRY_MODES)
    flexibility = WEIGHT * beam.phi(0.5, 0) / beam.omega**2
    static = [float(flexibility @ beam.phi(x, 0)) for x in s]
    slope = [float(flexibility @ beam.phi(x, 1)) for x in s]
    forward, backward = result.midspan[1 : stations + 1], result.midspan[stations + 1 :][::-1]
    return {
        (row.mu, row.zeta): indices.asymmetry(
            indices.Legs(list(s), list(forward[:, c]), list(backward[:, c]), static, slope)
        )
        for c, row in enumerate(values.ASYMMETRY)
    }


@pytest.mark.parametrize("row", values.ASYMMETRY, ids=lambda row: f"mu={row.mu}-zeta={row.zeta}")
def test_asymmetry_lag(row: values.AsymmetryCase) -> None:
    lag = asymmetry_indices()[row.mu, row.zeta].lag
    assert lag == pytest.approx(row.lag, rel=2e-4)
    assert lag == pytest.approx(values.ASYMMETRY_THEORY[row.zeta], rel=0.021)


def test_asymmetry_odd_even_and_loop_area() -> None:
    found = asymmetry_indices()[0.3, 0.02]
    assert found.odd_rms == pytest.approx(values.ASYMMETRY_ODD_RMS, rel=5e-4)
    assert found.even_excess == pytest.approx(values.ASYMMETRY_EVEN_EXCESS, rel=5e-4)
    assert found.loop_area == pytest.approx(values.ASYMMETRY_LOOP_AREA, rel=2e-4)


@pytest.mark.parametrize("row", values.DOUBLE_PEAK, ids=lambda row: f"ratio={row.frequency_ratio}")
def test_double_peak(row: values.DoublePeak) -> None:
    case = passages.variants(6, [(0.1, 0.02, 1.0)])
    circular = row.frequency_ratio * math.pi**2
    coarse = passages.periodic(case, circular, 0.49, 151)[:, 0]
    # trigonometric interpolation, so that peaks fall on samples
    cycle = np.fft.irfft(np.fft.rfft(coarse), 2048) * 2048 / len(coarse)
    if row.peaks is not None:
        assert len(indices.peaks(list(cycle))) == row.peaks
    if row.largest is not None:
        assert cycle.max() == pytest.approx(row.largest, abs=6e-5)
    for k, expected in row.harmonics.items():
        assert indices.harmonics(list(coarse))[k] == pytest.approx(expected, abs=6e-5)
    assert indices.odd_even_ratio(list(coarse)) < 1e-3


def quasi_static_cycle(springs: tuple[float, float]) -> list[float]:
    """Static midspan response over one cycle of the shuttle on end springs."""
    phase = 2.0 * math.pi * np.arange(1000) / 1000
    return [WEIGHT * closed_forms.influence_end_springs(0.5, 0.5 + 0.49 * math.sin(p), springs) for p in phase]


def test_end_springs() -> None:
    cycle = quasi_static_cycle(values.END_SPRINGS)
    harmonic = indices.harmonics(cycle)
    assert harmonic[1] / harmonic[2] == pytest.approx(values.END_SPRINGS_FIRST_OVER_SECOND, abs=5e-4)
    assert indices.odd_even_ratio(cycle) == pytest.approx(values.END_SPRINGS_ODD_OVER_EVEN, abs=5e-4)
    assert len(indices.peaks(cycle)) == 2
    assert len(indices.peaks(quasi_static_cycle(values.END_SPRINGS_ONE_PEAK))) == 1


def test_free_sliding_model() -> None:
    expected = values.FREE_SLIDING
    assert pytest.approx(expected.amplitude, abs=5e-9) == sliding.AMPLITUDE
    assert pytest.approx(expected.omega, abs=6e-7) == sliding.OMEGA
    assert pytest.approx(expected.weight_coefficient, abs=6e-7) == sliding.WEIGHT_COEFFICIENT


def test_free_sliding() -> None:
    expected = values.FREE_SLIDING
    found = sliding.slide(2.0 * 0.02 * sliding.OMEGA, 60.0, 120001)
    assert found.crossings == pytest.approx(expected.crossings, abs=6e-5)
    assert found.s.min() == pytest.approx(expected.smallest_s, abs=1e-6)
    assert found.s.max() == pytest.approx(expected.largest_s, abs=1e-6)
    assert found.along.min() == pytest.approx(expected.smallest_along, abs=1e-6)
    assert found.along.max() == pytest.approx(expected.largest_along, abs=6e-6)
    across = np.abs(found.across)
    assert across.max() == pytest.approx(expected.largest_across, abs=4e-6)
    assert found.t[across.argmax()] == pytest.approx(expected.largest_across_at, abs=6e-4)


@pytest.mark.parametrize(
    ("rate", "expected"),
    [(0.0, values.FREE_SLIDING.undamped_across), (0.02, values.FREE_SLIDING.rate_damped_across)],
)
def test_free_sliding_with_less_damping(rate: float, expected: float) -> None:
    found = sliding.slide(rate, 60.0, 60001)
    assert np.abs(found.across).max() == pytest.approx(expected, abs=5.1e-3)


def test_equation_30_as_printed_throws_the_mass_off() -> None:
    assert sliding.slide_as_printed(5.0) == pytest.approx(values.FREE_SLIDING.wrong_sign_leaves_at, abs=5e-4)
