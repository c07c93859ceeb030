"""What travels into the kernels of robots on rails: few float64 tables, as every one makes kernels longer to compile.

Axes are those of the ground, z up. R robots of up to J joints, that along the rail first; B bodies; N coordinates: the
modes of all bodies, then the joints that have a stiffness, as what they are away from their plan. Motions and wrenches
of six: translation and rotation, force and moment.
"""

from typing import NamedTuple

from engine.kernels.layout import FloatArray, IntArray

# columns of System.counts: joints, moves, and whether drives are told the forces of the whole plan
JOINTS, MOVES_TOLD, WHOLE = range(3)
# columns of System.chain: whether a joint slides; its axis, place and turn in the axes of the link before; the link
SLIDES, JOINT_AXIS, JOINT_PLACE, JOINT_TURN, MASS, CENTRE, INERTIA, LINK = 0, 1, 4, 7, 16, 17, 20, 23
# columns of System.robots: the tool centre point on the last link, and the base point at place 0
TOOL, BASE = 0, 3
# columns of System.tracks
FIRST, MODES, ELEMENTS = range(3)
# columns of System.moves
START, JERK, RAMP, UP, STEADY, MOVE = 0, 1, 2, 3, 4, 5

# columns of Work.links, by joint: link in space; joint as it is and as planned (value, rate, acceleration); what its
# drive is told, and exerts
PLACE, TURN, AXIS, FORCE, MOMENT, ACTUAL, PLANNED, TOLD, DRIVE, COLUMNS = 0, 3, 12, 15, 18, 21, 24, 27, 28, 29
VALUE, RATE, PUSH = range(3)
# columns of Work.robots: tool centre points, motion of the base per unit rate of joint 0, wrench on it (of its moment
# what does work along the rotation vector), payload, rotation vector of the base
PLANNED_TOOL, ACTUAL_TOOL, AHEAD, WRENCH, PAYLOAD, TILT, ROBOT = 0, 3, 6, 12, 18, 19, 22
# columns of Work.doing
BEGUN, PHASE = range(2)
# columns of Work.grips, by rail: wrench on the robot, motion that the modes miss, loads on the ends of an element, the
# motion by those of the ends (6, 12), the element with the distance from its beginning, what the modes go up there,
# and what they miss of the ends' motion
GRIP, MISSING, LOADS, BY_ENDS, ELEMENT, INTO, UP_THERE, GIVEN, GRIPPED = 0, 6, 12, 24, 96, 97, 98, 99, 111
# rows of Work.six: what modes miss at the base, the inertia of a solid (10 in two rows)
MISSED_THERE, SOLID, SIXES = 0, 1, 3
# rows of Work.motions: six of the axis of a track, and what becomes of them at the base
MOVED = 6
# rows of Work.vectors: of a correction; momenta, and a vector to begin with; inertia by which the scheme has no
# limit of its step, and that of coordinates which go without; accelerations of the step before; the direction in which
# weight is the stiffest beside springs
CHANGE, MOMENTUM, EXTRA, SOFT, BEFORE, LIKELY, VECTORS = 0, 1, 2, 3, 4, 5, 6
# rows of Work.cubics, six of whose lanes are used: sums of modes' cubics times y, y' and y'', power by power; a load
# for such cubics
POWERS = 4  # of a cubic, from the constant on
CUBIC, LOADED, CUBICS = 0, 3 * POWERS, 4 * POWERS

# what a robot does at a time: moves, holds, works
MOVES, HOLDS, WORKS = range(3)

FALLS_OVER = 3  # beside the codes of `kernels.layout`: a joint is softer than the weight that it has to hold up


class System(NamedTuple):
    """A whole scene.

    counts (R, 3), chain (R, J, LINK), robots (R, 6): columns above; link 0 is the carriage;  gravity: m/s2, down;
    coordinate (R, J): of joints, -1 for those that follow their plan;  springs (N, 2): stiffness and damping of all
    coordinates, of modes omega^2 and 2 zeta omega.
    body (R, 2): that a robot stands on, -1 for none;  share (R, 2, 7, 6): motion of the base by that of the track's
    axis, and in the first of row 6 its place on that track less that of the robot;  tracks (B, 3): columns above;
    ends (B, E + 1): ends of a track's elements, m;  shapes (B, E, n, POWERS, LANES): the six motions of the axis per
    mode, cubics in the distance from an end;  missed (B, 6 (E + 1), 6 (E + 1)): motions of the ends per unit load on
    them that the modes miss.
    moves (R, M, MOVE): columns above;  stays (R, M + 1, J + 2): joints before and after moves, the payload from the
    beginning of a move on, and s up to which a robot works after it.
    """

    counts: IntArray
    chain: FloatArray
    robots: FloatArray
    gravity: float
    coordinate: IntArray
    springs: FloatArray
    body: IntArray
    share: FloatArray
    tracks: IntArray
    ends: FloatArray
    shapes: FloatArray
    missed: FloatArray
    moves: FloatArray
    stays: FloatArray


class Work(NamedTuple):
    """What an evaluation leaves behind: links (R, J, COLUMNS), robots (R, ROBOT), doing (R, 2), grips (R, 2, GRIPPED),
    six (SIXES, 6), vectors (VECTORS, N), cubics (CUBICS, LANES), motions (12, LANES): above;  newton (1): by what
    factor the work of corrections falls. Of the matrix: lower (R, J, J + 6), of joints, and across to the base; bases
    (R, 2, n, LANES): motion of bases per mode, six in units in which their inertia is 1; inverse (n of all): one over
    what modes have without robots; pushed (6 R) and between (6 R, 6 R): of all bases; inertia (6 + J, 6 + J) of a
    robot. tangent (N, N): factors of the stiffness of springs and weight."""

    links: FloatArray
    robots: FloatArray
    doing: IntArray
    grips: FloatArray
    six: FloatArray
    vectors: FloatArray
    cubics: FloatArray
    motions: FloatArray
    newton: FloatArray
    lower: FloatArray
    bases: FloatArray
    inverse: FloatArray
    pushed: FloatArray
    between: FloatArray
    inertia: FloatArray
    tangent: FloatArray


class Stretch(NamedTuple):
    """Times between events: start (P), step (P): s;  steps (P): how many;  every: steps between observed stations;
    close: of the largest elastic energy, what a step's corrections may leave."""

    start: FloatArray
    step: FloatArray
    steps: IntArray
    every: int
    close: float


class Pace(NamedTuple):
    """A step (s), what a change of the acceleration at its end is there to rate and place (Newmark), the inertia per
    stiffness that lets any step be stable, the time (s) that such steps go on, and how close corrections come."""

    step: float
    of_rate: float
    of_place: float
    lacking: float
    until: float
    close: float


class Record(NamedTuple):
    """What is observed at stations: coordinates (S, N, 4): y, y', y'' and the time;  robots (S, R, OBSERVED) and grips
    (S, R, 2, OF_GRIP): columns below;  drive (S, R, J): what drives exert. And after every step of a march: passed
    (T, R, PASSED + J), columns below, and bent (T, n of all): y of modes. Where stop (1,) is not 0 it ends at once."""

    coordinates: FloatArray
    robots: FloatArray
    drive: FloatArray
    grips: FloatArray
    passed: FloatArray
    bent: FloatArray
    stop: IntArray


# columns of Record.robots: planned and actual tool centre point (m), wrench that carries the base about its point; of
# Record.grips: of that wrench what each rail carries about its axis, m by which the rail is down, and the place along
# it (m)
SEEN_PLANNED, SEEN_ACTUAL, SEEN_WRENCH, OBSERVED = 0, 3, 6, 12
VERTICAL, SUNK, ALONG, OF_GRIP = 2, 6, 7, 8
# columns of Record.passed: actual less planned tool centre point (m), what `grips` has of both rails; then what each of
# J drives exerts
OFF, PASSED_GRIPS, PASSED = 0, 3, 3 + 2 * OF_GRIP
