"""Time integration schemes for comparison only: known for their failures, or for a price that the march does not pay.

They take one contact and are outside the fast path. A scheme is a rule: the class of its numbers chooses the step when
the kernel is compiled. The pieces that observe and keep are those of the march.
"""

from typing import NamedTuple

import numpy as np

from engine.kernels.jit import chosen_for, kernel, piece
from engine.kernels.layout import LANES, NOT_CONVERGED, STATISTICS, Alpha, FloatArray, Newmark
from engine.kernels.stepping.comparison_steps import (
    FIELDS,
    MEMORY,
    SUMS,
    UNCONVERGED,
    Scratch,
    step_coupled,
    step_rigid,
    step_runge_kutta,
    step_wilson,
)
from engine.kernels.stepping.record import (
    A_NOW,
    GRAVITY,
    KEPT,
    Q_NOW,
    RATE_0,
    RATE_1,
    RATE_2,
    TIE,
    V_NOW,
    close_statistics,
    judge_lanes,
    keep,
    load_weights,
    observe,
    open_statistics,
)


class Track(NamedTuple):
    """The contact where a rule asks for it: its places of step n lie by the rule's offsets behind station n.

    rows (offsets, steps, modes, 4): as in `layout.Ties`, the column w holding P alone;  drive (offsets, steps).
    """

    rows: FloatArray
    drive: FloatArray


class Carried(NamedTuple):
    """What goes from step to step: the modes as in `layout.State`, and kept (blocks, KEPT, LANES), what a rule keeps
    besides them."""

    q: FloatArray
    v: FloatArray
    a: FloatArray
    memory: FloatArray
    kept: FloatArray


class Coupling(NamedTuple):
    """Implicit modes, while the contact force takes its terms from the new step (1) or the last one (0).

    scheme: of the modes. inertial, convective: 1 or 0. iterations: at most so many fixed-point iterations up to a
    change of ``tolerance`` of the force; with 0 the force is solved for directly. relaxed: 1 divides the changes by
    1 + r, 0 does not.
    """

    scheme: Newmark
    inertial: float
    convective: float
    iterations: int
    tolerance: float
    relaxed: float


class WilsonTheta(NamedTuple):
    """Linear acceleration over theta h, where the equations hold. beta, gamma: weights of the acceleration there."""

    theta: float
    beta: float
    gamma: float


class RungeKutta(NamedTuple):
    """The classic method of order 4. middle: where its second and third stages stand, 1/2."""

    middle: float


class RigidTie(NamedTuple):
    """The mass is a body of its own, tied to the moving contact point by its place: an index-3 system."""

    scheme: Newmark | Alpha


def take_step(rule, scratch, track, lanes, kept, block, n):
    """One step of one block by a rule, the modes of the scratch in place."""
    _STEPS[type(rule)](rule, scratch, track, lanes, kept, block, n)


_STEPS = {Coupling: step_coupled, WilsonTheta: step_wilson, RungeKutta: step_runge_kutta, RigidTie: step_rigid}


chosen_for(take_step)(lambda rule, *others: _STEPS[rule.instance_class])


@piece
def load_modes(now, b, lanes, carried, block):
    """The state of a block in step units, and the powers of 1/h."""
    for j in range(LANES):
        h = lanes.step[block, j]
        b[GRAVITY, j] = lanes.gravity[block, j]
        b[RATE_0, j] = 1.0
        b[RATE_1, j] = 1.0 / h
        b[RATE_2, j] = 1.0 / (h * h)
        for k in range(carried.q.shape[1]):
            now[k, Q_NOW, j] = carried.q[block, k, j]
            now[k, V_NOW, j] = carried.v[block, k, j] * h
            now[k, A_NOW, j] = carried.a[block, k, j] * h * h
            now[k, MEMORY, j] = carried.memory[block, k, j] * h * h


@piece
def store_modes(now, b, carried, block):
    """The state of a block in SI units."""
    for k in range(carried.q.shape[1]):
        for j in range(LANES):
            carried.q[block, k, j] = now[k, Q_NOW, j]
            carried.v[block, k, j] = now[k, V_NOW, j] * b[RATE_1, j]
            carried.a[block, k, j] = now[k, A_NOW, j] * b[RATE_2, j]
            carried.memory[block, k, j] = now[k, MEMORY, j] * b[RATE_2, j]


@kernel
def note(statistics, scratch, watch, record, block, n, count):
    """Observe and keep station n; a function of its own, so that it is compiled once and not for every rule."""
    observe(statistics, scratch.now, scratch.b, watch, n, KEPT)
    keep(statistics, record.history[block], watch, record.sample[n], n, float(count + n))


@kernel
def march_by_rule(rule, track, lanes, carried, watch, record, count):
    """March one segment with a single tie by a rule; what is carried and the record are updated in place.

    ``count`` is the number of the scene's stations before this segment's station 0. Returns the code of every lane.
    """
    modes = carried.q.shape[1]
    status = np.zeros((lanes.step.shape[0], LANES), np.int8)
    work = np.zeros((modes, FIELDS, LANES))
    now = np.zeros((4 * ((modes + 3) // 4), MEMORY + 1, LANES))
    sums = np.zeros((SUMS, LANES))
    b = np.zeros((TIE + 1 + lanes.weight.shape[1], LANES))
    statistics = np.zeros((watch.offset.shape[1], STATISTICS, LANES))
    scratch = Scratch(now, work, sums, b)
    for block in range(lanes.step.shape[0]):
        load_modes(now, b, lanes, carried, block)
        load_weights(b, lanes, block)
        open_statistics(statistics, record.statistics[block])
        for n in range(track.rows.shape[1]):
            take_step(rule, scratch, track, lanes, carried.kept, block, n)
            note(statistics, scratch, watch, record, block, n + 1, count)
        store_modes(now, b, carried, block)
        close_statistics(record.statistics[block], statistics, watch, lanes.step[block], track.rows.shape[1])
        judge_lanes(status, statistics, carried.q, carried.v, block)
        for j in range(LANES):
            if carried.kept[block, UNCONVERGED, j] > 0.0:  # and so nothing is finite
                status[block, j] = NOT_CONVERGED
    return status
