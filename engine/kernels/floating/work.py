"""Room for the equations of motion of bodies whose frames move, by named columns."""

from typing import NamedTuple

import numpy as np

from engine.kernels.floating.layout import PIECE
from engine.kernels.floating.tracks import AT_PLACE, GATHERED
from engine.kernels.jit import called, copied
from engine.kernels.layout import LANES, FloatArray, IntArray
from engine.kernels.vector import lanes_at, put_lanes

# columns of Work.frames: attitude to the ground and position over it; velocity, spin, acceleration less gravity and
# angular acceleration, resolved in the frame; force, and torque about its origin, that the body needs; the place where
# it hangs on its parent, the rotation vector there and its matrix
ATTITUDE, POSITION, VELOCITY, SPIN, ACCELERATION, ANGULAR, FORCE, TORQUE = 0, 9, 12, 15, 18, 21, 24, 27
HANGING_PLACE, HANGING, HANGING_TURNED, FRAME = 30, 33, 36, 45
RIGID = 12  # of Work.rigid: attitude and position alone
# columns of Work.joints: its rotation, or its shift; the torque or force about or along its axis behind it
JOINT_TURNED, JOINT_SHIFT, JOINT_DRIVE, JOINT = 0, 9, 12, 13
# columns of Work.contacts: force of the track on a carriage, and acceleration of the point that it touches less gravity
CONTACT, TOUCHED, CONTACTS = 0, 3, 6
# columns of Work.turning: of a frame that is given, what rates and values of a place do to its acceleration
RATES, VALUES, TURNING = 0, 9, 18


class Work(NamedTuple):
    """Room for a block of lanes, the last axis of each, of frames (B, FRAME), joints (J, JOINT), contacts (C,
    CONTACTS), modes at a place (n, AT_PLACE) and first moments of a body's modes (n, 9); the motions (M, 3) as given
    now: value, rate and acceleration; base (J, 9): attitudes of spherical joints at the start of the step; cells, and
    gathered (GATHERED): those of tracks that are looked up; piece (PIECE + 1): of a motion; turning (B, TURNING), and
    implied (C (n + 1), 3): what each mode and the sprung mass add to the acceleration at a contact; rigid (B, RIGID):
    attitudes and positions of the frames of the rigid arm, as in frames; tips (T, 3): how far tips are from there."""

    frames: FloatArray
    joints: FloatArray
    contacts: FloatArray
    modes: FloatArray
    moments: FloatArray
    motions: FloatArray
    base: FloatArray
    cells: IntArray
    gathered: FloatArray
    piece: FloatArray
    turning: FloatArray
    implied: FloatArray
    rigid: FloatArray
    tips: FloatArray


@copied
def room(system, lane):
    """Work for a block of lanes, the joints not turned yet."""
    widest = system.track.shape[4]
    base = np.zeros((system.axes.shape[0], 9, LANES))
    base[:, 0], base[:, 4], base[:, 8] = 1.0, 1.0, 1.0
    return Work(
        np.zeros((system.tree.shape[0], FRAME, LANES)),
        np.zeros((system.axes.shape[0], JOINT, LANES)),
        np.zeros((system.riders.shape[0], CONTACTS, LANES)),
        np.zeros((widest, AT_PLACE, LANES)),
        np.zeros((widest, 9, LANES)),
        np.zeros((lane.motions.shape[0], 3, LANES)),
        base,
        np.zeros(LANES, np.int64),
        np.zeros((GATHERED, LANES)),
        np.zeros((PIECE + 1, LANES)),
        np.zeros((system.tree.shape[0], TURNING, LANES)),
        np.zeros((system.riders.shape[0] * (widest + 1), 3, LANES)),
        np.zeros((system.tree.shape[0], RIGID, LANES)),
        np.zeros((system.tips.shape[0], 3, LANES)),
    )


@called
def add_to(out, k, row):
    """A row of lanes added to another."""
    put_lanes(out, (k,), lanes_at(out, (k,)) + row)


@called
def three_at(x, k):
    """Rows k to k + 2."""
    return lanes_at(x, (k,)), lanes_at(x, (k + 1,)), lanes_at(x, (k + 2,))
