"""What travels into the kernels: NamedTuples of float64 arrays, one row per meaning.

Times are counted in steps: a velocity is a displacement per step, an acceleration one per step squared, so the
step itself never appears in the inner loop. Variants are marched in lanes: every array of theirs is cut into blocks
of ``LANES``, the block its first axis and the lane its last, so that no index in a loop over lanes is computed.
"""

from typing import NamedTuple

import numpy as np

FloatArray = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
IntArray = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

#: Lanes of variants marched together: one 512-bit or two 256-bit vectors. By 16 one mass on 4, 10, 20 and 40 modes was
#: marched at 0.86, 0.77, 0.74 and 0.61 of the pace (three masses at 1.08, 1.00, 0.94, 0.87), and lone variants at half;
#: by 4 at 0.88, 1.05, 1.16 and 1.21, but springs between bodies at 0.7.
LANES = 8

# columns of Ties.rows
FORCE, CLOSED, RATE, CURVE = 0, 1, 2, 3


class Ties(NamedTuple):
    """The contacts along one segment: row n belongs to station n, station 0 is where the segment starts.

    rows:  (stations, modes, ties, 4): p, w, A, B of mechanics section 2; the tie's force enters the modes through
           p, and its kinematics read  P.q'' + A.q' + B.q  in step units, of which w = P + gamma A + beta B is the
           implicit part. A spring reads the gap  p.q.
    drive: (stations, ties): the same kinematics of the track's own unevenness (per unit gravity where it is the
           body's sag).
    level: (stations, ties): likewise its gap.
    reactive, prescribed: numbers of the ties whose force depends on the motion, and of those that are dead loads.
    moves, springs (ties): whether a tie's force depends on its kinematics, and whether on its gap.
    residual: (stations, ties, ties), m/N: what the kept modes miss of the gap of a spring (row) per unit force of any
           tie (column); (0, 0, 0) where they miss nothing.
    unity: (ties): 1, or 0 for a rigid tie, whose force is what makes its kinematics and drive add up to zero.
    reaches: (modes, ties): whether the rows of a mode and a tie are other than zero anywhere.
    """

    rows: FloatArray
    drive: FloatArray
    level: FloatArray
    reactive: IntArray
    prescribed: IntArray
    moves: BoolArray
    springs: BoolArray
    residual: FloatArray
    unity: FloatArray
    reaches: BoolArray


class Lanes(NamedTuple):
    """What differs from variant to variant.

    stiffness (blocks, modes, LANES): (omega h)^2;  damping (blocks, modes, LANES): 2 zeta omega h;
    inverse_modal_mass (blocks, modes, LANES): acceleration per unit modal force, 1 for a mode of unit modal mass, 1/m
    for a coordinate that is the place of a mass m;
    coupling_mass (blocks, ties, LANES): m (kg), or c h for a damper;
    coupling_stiffness (blocks, ties, LANES): k h^2 of a spring;
    load (blocks, ties, LANES): the tie's dead load times h^2;  weight (blocks, carriages, LANES): N, and
    times what contacts are softer by than their model's, as many more for each of these;
    gravity, step (blocks, LANES): m/s^2, and h in s.
    """

    stiffness: FloatArray
    damping: FloatArray
    inverse_modal_mass: FloatArray
    coupling_mass: FloatArray
    coupling_stiffness: FloatArray
    load: FloatArray
    weight: FloatArray
    gravity: FloatArray
    step: FloatArray


class State(NamedTuple):
    """Modal displacement, velocity and acceleration, each (blocks, modes, LANES), in SI units; updated in place.

    memory: what an alpha scheme's auxiliary acceleration differs by from ``a``; zero for Newmark's family.
    """

    q: FloatArray
    v: FloatArray
    a: FloatArray
    memory: FloatArray


class Observation(NamedTuple):
    """Which sums of the modal coordinates are observed at every step, and how they make signals.

    Channels are ordered by what they multiply: displacement, velocity, acceleration. A row array has one station
    (a fixed sensor) or as many as the segment (a sensor under a carriage). Channel 0 is a displacement channel.

    on_q, on_v, on_a (1 or stations, modes, channels);  signal (channels): which signal a channel adds to;
    order (channels): the power of 1/h that makes it SI;  static (stations, signals, ties): deflection per unit
    force that the kept modes miss, and where signals are dynamic parts as many columns more as there are weights:
    less what they leave out per unit of each;  offset (stations, signals): per unit gravity, in step units of
    offset_order (signals), the power of 1/h that makes it SI;
    counted (stations, signals): whether the station enters extremes.
    summed (signals): whether squares are summed over time, which wants a signal that counts all along the segment.
    """

    on_q: FloatArray
    on_v: FloatArray
    on_a: FloatArray
    signal: IntArray
    order: IntArray
    static: FloatArray
    offset: FloatArray
    offset_order: IntArray
    counted: BoolArray
    summed: BoolArray


class Record(NamedTuple):
    """What is kept of the signals; updated in place.

    statistics (blocks, signals, STATISTICS, LANES): the columns named below; counts are -1 where there is none.
    sample (stations): row of ``history`` that a station fills, or -1.
    history (blocks, rows, sensors, LANES): of the first signals, as many as it has room for; NaN where a signal
    does not count.
    """

    statistics: FloatArray
    sample: IntArray
    history: FloatArray


# columns of Record.statistics: extremes and the counts of the stations where they occur, the first count with a
# negative value, the integral of the square over time and how long it took (s), the magnitude beyond which a variant
# has diverged, the first count where it had, the value at the station observed last
LARGEST, LARGEST_AT, SMALLEST, SMALLEST_AT, BELOW_AT, SQUARES, SECONDS, BOUND, DIVERGED_AT, VALUE = range(10)
STATISTICS = 10

# what a kernel returns of every lane (blocks, LANES), the worst last: the values may be used; the iteration of a step
# did not converge; a signal is beyond its bound or the state is not finite
SOUND, NOT_CONVERGED, DIVERGED = range(3)


class Impulse(NamedTuple):
    """An impulse on the body: ties that arrive or reverse at one instant, and all that are in contact then.

    shape, slope (ties, modes): phi and phi' where each touches;  sag_slope (ties): slope of the body's own sag per
    unit gravity;  arrives (ties): 1 for a carriage that has just come;  mass (blocks, ties, LANES): kg;
    speed (blocks, ties, LANES): m/s.
    """

    shape: FloatArray
    slope: FloatArray
    sag_slope: FloatArray
    arrives: FloatArray
    mass: FloatArray
    speed: FloatArray


class Newmark(NamedTuple):
    """Coefficients of Newmark's family (1959)."""

    beta: float
    gamma: float


class Alpha(NamedTuple):
    """Coefficients of generalized-alpha, derived in `schemes.AlphaScheme`.

    beta, gamma: weights of the new true acceleration x in u and u', as in `Newmark`. The auxiliary acceleration is
    a = kappa x + e; the memory e of the step before starts as  start_x x + start_a a  and goes on as
    next_x x + next_e e. newmark_beta, newmark_gamma: weights of a. velocity_, displacement_: weights of x and e in
    the predictors of the next step.
    """

    beta: float
    gamma: float
    kappa: float
    start_x: float
    start_a: float
    newmark_beta: float
    newmark_gamma: float
    next_x: float
    next_e: float
    velocity_x: float
    velocity_e: float
    displacement_x: float
    displacement_e: float
