"""What travels into the kernels of bodies whose frames move: tables of numbers by named columns, few arrays in all, as
every call hands them on.

Vectors of a body are resolved in its floating frame. Coordinates of the whole system, N of them: those of all joints
that are free to move, the elastic ones of all bodies, the places of carriages that slide freely, and the deflections of
what is sprung. n is the largest number of modes of a body.
"""

from typing import NamedTuple

from engine.kernels.layout import BoolArray, FloatArray, IntArray

#: Kinds of joints. A spherical joint has three coordinates, a rotation vector within each step.
REVOLUTE, PRISMATIC, SPHERICAL = 0, 1, 2
#: What happened to a lane: the last, a carriage went over an end of its track, where the lane's march ends.
SOUND, NOT_CONVERGED, DIVERGED, OVER_THE_END = 0, 1, 2, 3
#: Rows of the statistics of a signal.
LARGEST, LARGEST_AT, SMALLEST, SMALLEST_AT, SQUARES, STATISTICS = 0, 1, 2, 3, 4, 5

# columns of System.tree: the parent, -1 for the ground; first elastic coordinate and their number; first joint, and the
# one behind the last; 1 where nothing moves the frame; along how many axes, x first, places come nearer by 1/2 q G q
PARENT, FIRST, MODES, FIRST_JOINT, END_JOINT, RESTS, SHORTENED, TREE = 0, 1, 2, 3, 4, 5, 6, 7
# columns of System.bodies: integrals of dm, c dm, c c^T dm; where it hangs on the parent's undeformed body, and the
# axes there; length of the track and where that begins
MASS, MOMENT, SECOND, PLACE, TURNED, LENGTH, ORIGIN, BODY = 0, 1, 4, 13, 16, 25, 26, 29
# columns of System.modes, row b n + i: integrals of phi_i dm and c phi_i^T dm; displacement and rotation, by mode i of
# the parent, of the place where body b hangs
TRANSLATION, FIRST_ORDER, HANGING_SHAPE, HANGING_TURN, MODE = 0, 3, 12, 15, 18
# columns of System.pairs, row (b n + i) n + j: integral of phi_i phi_j^T dm; stiffness; integrals of G dm and G c^T dm;
# modal mass
SECOND_ORDER, STIFFNESS, NEARING, NEARING_MOMENT, MODAL_MASS, PAIR = 0, 9, 10, 13, 22, 23
# columns of System.joint_table: kind, first coordinate or -1 where its motion is given, the number of that motion or
# -1; a joint with both is controlled towards the motion
KIND, COORDINATE, MOTION = 0, 1, 2
# columns of System.riders: body; coordinate of its place and motion as of a joint; coordinate of its sprung mass or -1
RIDDEN, PLACE_COORDINATE, PLACE_MOTION, SPRUNG_COORDINATE = 0, 1, 2, 3
# columns of Lane.carriages: mass, inertia about its centre, height of that below the track; sprung mass, stiffness and
# damping; drive force along the track, viscous friction, Coulomb's coefficient, the speed over which that sets in
OWN_MASS, INERTIA, HEIGHT, SPRUNG_MASS, SPRING, DAMPER, DRIVE, VISCOUS, COULOMB, SLIP, CARRIAGE = (
    0, 1, 4, 5, 6, 7, 8, 9, 10, 11, 12,
)  # fmt: skip
# columns of System.grips: weight, and place times weight; of System.grip_modes, row p n + i: displacement times weight,
# and rotation, by mode i of its body; of System.load_table: grip, whether it is resolved in the body's axes, and the
# number of the motion that is its factor or -1
WEIGHT, ARM, GRIPS = 0, 1, 4
PUSHED, TWISTED, GRIP_MODE = 0, 3, 6
GRIP, IN_BODY, COURSE = 0, 1, 2
# columns of System.missed_sections: the reading, and its body; of System.missed: its place, and what is missed per unit
# a_z, alpha_y and w_x w_z of the body's frame
MISSED_READING, MISSED_BODY = 0, 1
MISSED_PLACE, MISSED_UNIFORM, MISSED_TURNING, MISSED_SPUN, MISSED = 0, 1, 2, 3, 4
# columns of System.shortening
SHORTER, AXIS, ONE, OTHER = 0, 1, 2, 3
# columns of System.smooth: the signal, and the tip whose vector's length it is, else -1
SIGNAL, TIP = 0, 1
# columns of System.tips: the sensor, and the body; of System.tip_places: the undeformed place in the frame, the
# direction over the ground in which it is read, zero where the length is, and displacements by the modes, one after the
# other
TIP_SENSOR, TIP_BODY = 0, 1
TIP_PLACE, TIP_WAY, TIP_SHAPES = 0, 3, 6
# columns of a piece of a motion: its start (s), a polynomial of degree 5, and amplitude, rate and phase of a sine
PIECE = 10


class System(NamedTuple):
    """All that lanes share; the columns are those above.

    tree (B, TREE), bodies (B, BODY), modes (B n, MODE), pairs (B n n, PAIR): bodies, each after its parent.
    joint_table (J, 3), axes (J, 3): joints, those of a body side by side, from its parent outward.
    track (B, cells, 6, 6, n): displacements and rotations of each mode along straight tracks, as polynomials of degree
    5 in equal cells; bends (B, 6, n): which of them are not zero. shortening (K, 4): a body with carriages, an axis and
    two modes, each pair once, whose G is not zero; foreshortening (K, cells, 6): that likewise;
    hanging_shorter (B, A, n, n): G, of the parent's modes, where each body hangs. riders (C, 4).
    gripped (P): bodies of grips, -1 for the ground; grips (P, GRIPS), grip_modes (P n, GRIP_MODE); grip_shorter
    (P, A, n, n): G there times weight. load_table (Q, 3); links (K, 2): grips between which springs are.
    points (P, 3 + 3 n), pointed (P): places whose position over the ground is observed, and their bodies;
    point_shorter (P, A, n, n): G there.
    readings (S, N): of sensors, per coordinate; read_under (S, 3): the carriage under which one reads, or -1; the
    component that it reads there; 0, 1 or 2 for coordinates, velocities or accelerations. missed_sections (K, 2),
    missed (K, MISSED): readings of section forces, and what their modes miss; missed_lines (K, 2, cells, 4): that by a
    unit force across the track, in equal cells before and beyond the place; missed_grips (K, P): that at grips, times
    weight, and missed_twists (K, P) that by a unit torque about y. smooth (K, 2): signals that have extremes between
    stations, and the tips whose lengths they are, or -1.
    tips (T, 2), tip_places (T, 6 + 3 n): places whose distance from the rigid arm is read; tip_shorter (T, A, n, n): G
    there; carrying (L): the bodies of these arms, each after its parent. bands (T, K), m: of each tip, within which it
    is told when what is left after a stop stays; none where no study asks.
    drives (D, 2): sensors that read what drives exert, and their joints.
    leans (B, 3): whether a body's modes move it along its x, y and z; pairing (K, 3): bodies, and two of their modes
    that act on each other. given: whether steps take frames and places of carriages as given in time, and need no
    iteration. settles: whether marches begin in static equilibrium.
    """

    tree: IntArray
    bodies: FloatArray
    modes: FloatArray
    pairs: FloatArray
    joint_table: IntArray
    axes: FloatArray
    track: FloatArray
    bends: BoolArray
    shortening: IntArray
    foreshortening: FloatArray
    hanging_shorter: FloatArray
    riders: IntArray
    gripped: IntArray
    grips: FloatArray
    grip_modes: FloatArray
    grip_shorter: FloatArray
    load_table: IntArray
    links: IntArray
    pointed: IntArray
    points: FloatArray
    point_shorter: FloatArray
    readings: FloatArray
    read_under: IntArray
    missed_sections: IntArray
    missed: FloatArray
    missed_lines: FloatArray
    missed_grips: FloatArray
    missed_twists: FloatArray
    smooth: IntArray
    tips: IntArray
    tip_places: FloatArray
    tip_shorter: FloatArray
    carrying: IntArray
    bands: FloatArray
    drives: IntArray
    leans: BoolArray
    pairing: IntArray
    given: bool
    settles: bool


class Coordinates(NamedTuple):
    """Coordinates, velocities and accelerations of a block of lanes, (N, LANES) each."""

    y: FloatArray
    u: FloatArray
    a: FloatArray


class Lane(NamedTuple):
    """Numbers of variants: their axis is the first one, L; in blocks it is the first and, in each, the last.

    gravity (3) m/s2, of the ground. damping (B n): 2 zeta omega. joints (J, 2): stiffness and damping about 0 or
    about the given motion. carriages, light (C, CARRIAGE): as they are, and of next to no mass. motions (M,
    pieces, PIECE). events (E): ascending times (s) at which a motion goes on as another piece, infinite from
    the last on. start (2, N): coordinates and velocities. loads (Q, 6): forces and torques. links (K, 3):
    stiffness, damping, free length. stops (T): times (s) at which the joints that carry a tip have come to
    their ends, infinite where they never do. step: s.
    """

    gravity: FloatArray
    damping: FloatArray
    joints: FloatArray
    carriages: FloatArray
    light: FloatArray
    motions: FloatArray
    events: FloatArray
    start: FloatArray
    loads: FloatArray
    links: FloatArray
    stops: FloatArray
    step: FloatArray


class Weights(NamedTuple):
    """A scheme: Newmark's beta and gamma, and generalized-alpha's alpha_m and alpha_f (0 of Newmark's family); raised:
    whether beta is larger for each coordinate that is too fast for it."""

    beta: float
    gamma: float
    alpha_m: float
    alpha_f: float
    raised: bool = False


class Record(NamedTuple):
    """What a march leaves of blocks of lanes: stations (S): ascending numbers of those whose signals are kept;
    statistics (blocks, signals, STATISTICS, LANES) of all stations, history (blocks, S, signals, LANES); settled
    (blocks, T, K, LANES): steps after which tips are within their bands for good; codes and last stations
    (blocks, LANES). Where stop (1,) is not 0 it ends at once."""

    stations: IntArray
    statistics: FloatArray
    history: FloatArray
    settled: FloatArray
    codes: IntArray
    last: IntArray
    stop: IntArray
