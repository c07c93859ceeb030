"""Every reference number, typed, with the conventions it was made under.

Moving mass, force, asymmetry and double peak: pinned beam with L = rho A = E I = 1, omega_n = (n pi)^2, weight
P = m g = 48 whatever the mass, so that P L^3/48EI = 1; mu = m/(rho A L), alpha = v/pi. Modes only, no static
correction, unless said otherwise. Extremes are over time. The numbers are printed to their last digit, so they hold
within half a unit of it at best.
"""

from typing import NamedTuple

WEIGHT = 48.0
MODES_MOVING_MASS = 20


class MovingMass(NamedTuple):
    """A mass enters a resting beam at s = 0; N = 20, all convective terms, zeta = 0; response until s = L.

    under: w under the mass at s = 1/4, 1/2, 3/4. smallest_force: F/mg on s <= 0.95, at smallest_force_at.
    """

    mu: float
    alpha: float
    largest: float
    largest_at: float
    under: tuple[float, float, float]
    at_exit: float
    smallest_force: float
    smallest_force_at: float


MOVING_MASS = (
    MovingMass(0.1, 0.10, 1.07591875, 0.568721, (0.50250091, 0.95050973, 0.58861341), 0.09834753, 0.976086, 0.2803),
    MovingMass(0.1, 0.25, 1.28718586, 0.423439, (0.58057409, 1.17913607, 0.49382824), 0.14304485, 0.925342, 0.1755),
    MovingMass(0.1, 0.50, 1.76291107, 0.710632, (0.25551996, 1.25275687, 1.30945919), 0.27371122, 0.641405, 0.9483),
    MovingMass(0.5, 0.10, 1.07219840, 0.428854, (0.51675890, 0.99327000, 0.57320699), -0.07621049, 0.919779, 0.0729),
    MovingMass(0.5, 0.50, 2.02213025, 0.854506, (0.21939033, 1.01624633, 1.47838917), 1.39501692, -0.705452, 0.95),
)


class LargestMidspan(NamedTuple):
    """Largest midspan w of the same passage in a variation; N = 20."""

    mu: float
    alpha: float
    largest: float


MOVING_MASS_DAMPED_2_PERCENT = (LargestMidspan(0.1, 0.25, 1.26490951), LargestMidspan(0.5, 0.5, 1.97229338))
MOVING_MASS_WITHOUT_CONVECTIVE = (LargestMidspan(0.1, 0.25, 1.30392291), LargestMidspan(0.5, 0.5, 1.88835201))

MOVING_FORCE: dict[float, float] = {
    0.05: 1.048248,
    0.25: 1.257610,
    0.5: 1.705445,
    0.617034: 1.731674,
    0.75: 1.701613,
    1.0: 1.548074,
}
"""alpha -> largest midspan over static during the passage; converged in modes (N >= 63), zeta = 0."""
MOVING_FORCE_LARGEST_ALPHA = 0.617034
MOVING_FORCE_N20_ERROR = 6e-6
MOVING_FORCE_ONE_MODE_MAXIMUM = 1.743

RESIDUAL_ZERO_ALPHAS = (1.0 / 3.0, 0.2)
RESIDUAL_AT_QUARTER = 0.533333
RESIDUAL_MAXIMUM = 1.715509
RESIDUAL_MAXIMUM_ALPHA = 0.731399
"""Amplitude of mode 1 after the exit over w0 = 2 P L^3/(pi^4 E I)."""

TRAIN_FORCES = 8
TRAIN_GAIN_DAMPED = 5.3694
"""zeta = 0.02 and v = f1 d, so that omega_1 d/v = 2 pi."""


class SprungMass(NamedTuple):
    """A body of `mass` on one spring at constant speed; SI, undamped; enters at rest, its spring carrying its weight.

    g = 9.81. results: number of modes -> value.
    """

    length: float
    youngs_modulus: float
    second_moment: float
    mass_per_length: float
    mass: float
    stiffness: float
    speed: float
    largest_midspan: dict[int, float]


YANG_YAU = SprungMass(25.0, 2.87e9, 2.9, 2303.0, 5750.0, 1595e3, 100.0 / 3.6, {1: 2.383889e-3, 20: 2.407301e-3})
YANG_YAU_OMEGA_1 = 30.0201
YANG_YAU_OMEGA_BODY = 16.6551
YANG_YAU_STATIC = 2.206154e-3
YANG_YAU_BODY_ACCELERATION = {1: 0.183614, 20: 0.147973}

VBI_2D = SprungMass(25.0, 3.5e10, 1.3901, 18358.0, 5750.0, 1595e3, 25.0, {40: 4.185306e-4})
VBI_2D_STEPS = 1000
"""VBI_2D.largest_midspan belongs to average acceleration with this many steps, as the program takes; it is not
converged in time. The limit of ever smaller steps is VBI_2D_CONVERGED."""
VBI_2D_CONVERGED = {10: 4.186670e-4, 40: 4.186271e-4}
VBI_2D_FILE = 4.185303e-4
VBI_2D_LARGEST_AT = 0.436


class MovingForceCase(NamedTuple):
    """A constant force crossing a pinned beam, zeta = 0, in the units of its source."""

    length: float
    bending_stiffness: float
    mass_per_length: float
    speed: float
    force: float


STEM = MovingForceCase(25.0, 210e9 * 1e-4, 7850.0 * 0.01, 10.0, 1000.0)
STEM_STATIC = 15.5010e-3
STEM_LARGEST = 18.1594e-3
STEM_LARGEST_AT = 1.3265

BIGGS = MovingForceCase(480.0, 2.4e11 * 0.083333, 0.1, 600.0, 8680.6)
BIGGS_TIMES = (0.04, 0.08, 0.12)
BIGGS_MIDSPAN = {1: (0.01469, 0.10718, 0.30963), 50: (0.01046, 0.09933, 0.29941)}

SMALL_LIMIT_ALPHA, SMALL_LIMIT_MU, SMALL_LIMIT = 0.01, 0.5, 1.645e-4
"""F/mg - 1 at midspan, quasi-static."""


class AsymmetryCase(NamedTuple):
    """Out and back from s = 0.5 to 0.98, cosine turns over 0.1 of the stroke, from static equilibrium at s = 0.5.

    alpha 0.02, N = 6, sensor at midspan, third of three cycles, cruise part only (s from 0.548 to 0.932), static
    response of the same six modes.
    """

    mu: float
    zeta: float
    lag: float


ASYMMETRY_ALPHA, ASYMMETRY_MODES, ASYMMETRY_CYCLES = 0.02, 6, 3
ASYMMETRY_START, ASYMMETRY_END, ASYMMETRY_TURN = 0.5, 0.98, 0.1
ASYMMETRY = (
    AsymmetryCase(0.3, 0.01, -1.2475e-4),
    AsymmetryCase(0.3, 0.02, -2.5043e-4),
    AsymmetryCase(0.3, 0.05, -6.2925e-4),
    AsymmetryCase(0.3, 0.1, -1.26078e-3),
    AsymmetryCase(1.0, 0.05, -6.3020e-4),
)
ASYMMETRY_THEORY = {0.01: -1.273e-4, 0.02: -2.546e-4, 0.05: -6.366e-4, 0.1: -1.2732e-3}
ASYMMETRY_ODD_RMS, ASYMMETRY_EVEN_EXCESS, ASYMMETRY_LOOP_AREA = 7.016e-4, 6.007e-4, 1.2873e-3
"""At mu 0.3, zeta 0.02. The loop area is the signed integral of forward minus backward."""


class DoublePeak(NamedTuple):
    """Sinusoidal shuttle, centre 0.5, amplitude 0.49, zeta 0.02, mu 0.1, N = 6, steady state; None: not given."""

    frequency_ratio: float
    peaks: int | None
    largest: float | None
    harmonics: dict[int, float]


DOUBLE_PEAK = (
    DoublePeak(0.05, 2, 1.0074, {2: 0.4861, 4: 0.0361, 6: 0.0043}),
    DoublePeak(0.1, None, 1.0342, {}),
    DoublePeak(0.25, 4, None, {}),
)

END_SPRINGS = (100.0, 20.0)
"""k_a, k_b over E I/L^3 at the ends of a pinned beam; quasi-static, the shuttle above, sensor at midspan."""
END_SPRINGS_FIRST_OVER_SECOND = 0.979
END_SPRINGS_ODD_OVER_EVEN = 0.976
END_SPRINGS_ONE_PEAK = (100.0, 7.3)


class FreeSliding(NamedTuple):
    """Mass 100 kg sliding without friction from s = 2 m at rest on the one-mode beam below, 60 s, own weight acting.

    L = 15 m, A = 0.01 m2, I = 8.33e-6 m4, E = 2.1e11 Pa, rho = 7850 kg/m3, zeta = 0.02, g = 9.81 m/s2.
    """

    amplitude: float = 0.04121303
    omega: float = 6.5480886
    weight_coefficient: float = 30.894102
    crossings: tuple[float, ...] = (4.2128, 13.5532, 23.0755, 32.6171, 42.1598, 51.7024)
    smallest_s: float = 1.528204
    largest_s: float = 13.471477
    smallest_along: float = -0.992761
    largest_along: float = 1.658276
    largest_across: float = 16.750712
    largest_across_at: float = 3.478
    undamped_across: float = 20.84
    rate_damped_across: float = 20.24
    wrong_sign_leaves_at: float = 2.407


FREE_SLIDING = FreeSliding()
