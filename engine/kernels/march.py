"""The march: implicit steps of every lane along one segment, one fused pass over the modes per step.

Derivation (mechanics section 2), in step units: with predictors u*, v* and D = 1/(1 + gamma c + beta k),
c_k* = (c v* + k u*) D, an equation of mode k gives  a_k = p_k D_k F - c_k*.  Put into the tie's kinematics
G = P.a + A.(v* + gamma a) + B.(u* + beta a) this is  G = w.(D p) F - (w.c* - A.v* - B.u*),  and with
F = load - gain (G + drive):

    F = (load + gain (w.c* - A.v* - B.u* - drive)) / (1 + gain w.(D p))        one tie; r ties: an r x r system

A spring reads its gap  p.u = beta p.(D p) F - p.(beta c* - u*)  in the same way (section 4):

    F = load - gain (G + drive) - stiff (p.u + level)

``mobility`` multiplies D where it meets a force. The pass over the modes corrects step n, observes it, predicts step
n + 1 and gathers the sums of its tie equation.
"""

import numpy as np

from engine.kernels.jit import kernel, piece
from engine.kernels.layout import CLOSED, CURVE, FORCE, LANES, RATE
from engine.kernels.record import (
    A_NOW,
    CD,
    FACTOR,
    GAIN,
    GRAVITY,
    KD,
    LEAD,
    LOAD,
    PUSH,
    Q_NOW,
    RATE_0,
    RATE_1,
    RATE_2,
    SECOND,
    SUM,
    TIE,
    V_NOW,
    VALUE,
    C,
    D,
    U,
    V,
    copy_marks,
    keep,
    observe,
)
from engine.kernels.stepping import advance, corrected, fields_of, first_predictors, remember
from engine.kernels.ties import Sums, gather_ties, push_four, push_on_mode, set_ties, solve_ties


@piece
def load_block(work, b, lanes, state, scheme, block):
    """Coefficients of the step, and the predictors of the first one, of one block of lanes."""
    beta, gamma = scheme.beta, scheme.gamma
    for j in range(LANES):
        h = lanes.step[block, j]
        b[GRAVITY, j] = lanes.gravity[block, j]
        b[RATE_0, j] = 1.0
        b[RATE_1, j] = 1.0 / h
        b[RATE_2, j] = 1.0 / (h * h)
    for k in range(lanes.stiffness.shape[1]):
        for j in range(LANES):
            h = lanes.step[block, j]
            c = lanes.damping[block, k, j]
            s = lanes.stiffness[block, k, j]
            d = 1.0 / (1.0 + gamma * c + beta * s)
            m = lanes.mobility[block, k, j]
            q, v, a = state.q[block, k, j], state.v[block, k, j] * h, state.a[block, k, j] * h * h
            u, v, e = first_predictors(scheme, q, v, a, state.memory[block, k, j] * h * h)
            work[k, D, j] = m * d
            work[k, CD, j] = c * d
            work[k, KD, j] = s * d
            work[k, U, j] = u
            work[k, V, j] = v
            work[k, C, j] = c * d * v + s * d * u
            remember(scheme, work, k, j, e)


@piece
def store_mode(work, b, state, scheme, block, k):
    """Corrected state of mode k in SI units; b[PUSH] is the sum of p F of the step just solved."""
    for j in range(LANES):
        x = work[k, D, j] * b[PUSH, j] - work[k, C, j]
        q, v, a, memory = corrected(scheme, work, b, k, j, x)
        state.q[block, k, j] = q
        state.v[block, k, j] = v
        state.a[block, k, j] = a
        state.memory[block, k, j] = memory


@kernel
def march_one(ties, lanes, state, watch, record, scheme, count):
    """March one segment with a single tie.

    Shapes as in ``layout``; ``count`` is the number of the scene's stations before this segment's station 0. The
    state and the record are updated in place.
    """
    rows = ties.rows
    stations, modes = rows.shape[0], rows.shape[1]
    # one or two sums over displacements are gathered in the pass itself, others from the corrected modes kept for them
    channels = watch.signal.shape[0]
    leads = channels if channels <= 2 and watch.on_q.shape[1] == channels else 0
    lead_moves = 0 if watch.on_q.shape[0] == 1 else 1
    # allocated here and not in a piece: only so does the compiler know their strides
    work = np.zeros((modes, fields_of(scheme), LANES))
    now = np.zeros((4 * ((modes + 3) // 4), 3, LANES))
    b = np.zeros((TIE + 1, LANES))
    marks = np.zeros((watch.offset.shape[1], VALUE + 1, LANES))
    for block in range(lanes.step.shape[0]):
        load_block(work, b, lanes, state, scheme, block)
        copy_marks(marks, record.marks[block])
        history = record.history[block]
        for j in range(LANES):
            b[GAIN, j] = lanes.gain[block, 0, j]
            b[LOAD, j] = lanes.load[block, 0, j]
            b[SUM, j] = 0.0
            b[FACTOR, j] = 0.0
        for k in range(modes):
            p, w, rate, curve = rows[1, k, 0, FORCE], rows[1, k, 0, CLOSED], rows[1, k, 0, RATE], rows[1, k, 0, CURVE]
            for j in range(LANES):
                b[SUM, j] += w * work[k, C, j] - (rate * work[k, V, j] + curve * work[k, U, j])
                b[FACTOR, j] += w * p * work[k, D, j]
        for n in range(1, stations):
            drive = ties.drive[n, 0]
            for j in range(LANES):
                b[TIE, j] = (b[LOAD, j] + b[GAIN, j] * (b[SUM, j] - drive * b[GRAVITY, j])) / (
                    1.0 + b[GAIN, j] * b[FACTOR, j]
                )
                b[SUM, j] = 0.0
                b[FACTOR, j] = 0.0
                b[LEAD, j] = 0.0
                b[SECOND, j] = 0.0
            if n == stations - 1:
                for k in range(modes):
                    for j in range(LANES):
                        b[PUSH, j] = rows[n, k, 0, FORCE] * b[TIE, j]
                    store_mode(work, b, state, scheme, block, k)
            m = min(n + 1, stations - 1)
            at = lead_moves * n
            for k in range(modes):
                p_now = rows[n, k, 0, FORCE]
                p, w, rate, curve = (
                    rows[m, k, 0, FORCE],
                    rows[m, k, 0, CLOSED],
                    rows[m, k, 0, RATE],
                    rows[m, k, 0, CURVE],
                )
                wp = w * p
                if leads == 2:
                    row, second = watch.on_q[at, 0, k], watch.on_q[at, 1, k]
                    for j in range(LANES):
                        a = p_now * (work[k, D, j] * b[TIE, j]) - work[k, C, j]
                        q, v, q_next, v_next, c = advance(scheme, work, k, j, a)
                        b[LEAD, j] += row * q
                        b[SECOND, j] += second * q
                        b[SUM, j] += w * c - (rate * v_next + curve * q_next)
                        b[FACTOR, j] += wp * work[k, D, j]
                elif leads == 1:
                    row = watch.on_q[at, 0, k]
                    for j in range(LANES):
                        a = p_now * (work[k, D, j] * b[TIE, j]) - work[k, C, j]
                        q, v, q_next, v_next, c = advance(scheme, work, k, j, a)
                        b[LEAD, j] += row * q
                        b[SUM, j] += w * c - (rate * v_next + curve * q_next)
                        b[FACTOR, j] += wp * work[k, D, j]
                else:
                    for j in range(LANES):
                        a = p_now * (work[k, D, j] * b[TIE, j]) - work[k, C, j]
                        q, v, q_next, v_next, c = advance(scheme, work, k, j, a)
                        now[k, Q_NOW, j] = q
                        now[k, V_NOW, j] = v
                        now[k, A_NOW, j] = a
                        b[SUM, j] += w * c - (rate * v_next + curve * q_next)
                        b[FACTOR, j] += wp * work[k, D, j]
            observe(marks, now, b, watch, n, leads)
            keep(marks, history, watch, record.sample[n], n, float(count + n))
        copy_marks(record.marks[block], marks)


@kernel
def march_many(ties, lanes, state, watch, record, scheme, count):
    """March one segment with any number of ties; otherwise as ``march_one``."""
    rows = ties.rows
    stations, modes, many = rows.shape[0], rows.shape[1], rows.shape[2]
    reacting = ties.reacting.shape[0]
    still = watch.on_q.shape[1] == watch.signal.shape[0]  # only displacements are observed
    # allocated here and not in a piece: only so does the compiler know their strides
    work = np.zeros((modes, fields_of(scheme), LANES))
    now = np.zeros((4 * ((modes + 3) // 4), 3, LANES))
    b = np.zeros((TIE + many + 4, LANES))  # ties are pushed in fours
    marks = np.zeros((watch.offset.shape[1], VALUE + 1, LANES))
    pairs = 2 * ((many + 1) // 2)
    sums = Sums(
        np.zeros((reacting, LANES)),
        np.zeros((reacting, LANES)),
        np.zeros((reacting, pairs, LANES)),
        np.zeros((reacting, pairs, LANES)),
    )
    for block in range(lanes.step.shape[0]):
        load_block(work, b, lanes, state, scheme, block)
        copy_marks(marks, record.marks[block])
        history = record.history[block]
        for n in range(stations):
            if n > 0:
                set_ties(b, sums, ties, lanes, scheme.beta, block, n)
                solve_ties(b, sums.factor, ties, lanes, block)
                if n == stations - 1:
                    for k in range(modes):
                        push_on_mode(b, rows, n, k, 0)
                        store_mode(work, b, state, scheme, block, k)
                for k in range(modes):
                    p0, p1, p2, p3 = push_four(rows, n, k, 0)
                    if many > 4 or n == stations - 1:
                        push_on_mode(b, rows, n, k, 4)
                    if still:
                        for j in range(LANES):
                            push = (p0 * b[TIE, j] + p1 * b[TIE + 1, j]) + (p2 * b[TIE + 2, j] + p3 * b[TIE + 3, j])
                            a = work[k, D, j] * (push + b[PUSH, j]) - work[k, C, j]
                            q, _, _, _, _ = advance(scheme, work, k, j, a)
                            now[k, Q_NOW, j] = q
                    else:
                        for j in range(LANES):
                            push = (p0 * b[TIE, j] + p1 * b[TIE + 1, j]) + (p2 * b[TIE + 2, j] + p3 * b[TIE + 3, j])
                            a = work[k, D, j] * (push + b[PUSH, j]) - work[k, C, j]
                            q, v, _, _, _ = advance(scheme, work, k, j, a)
                            now[k, Q_NOW, j] = q
                            now[k, V_NOW, j] = v
                            now[k, A_NOW, j] = a
                observe(marks, now, b, watch, n, 0)
                keep(marks, history, watch, record.sample[n], n, float(count + n))
            if n < stations - 1:
                gather_ties(sums, work, ties, scheme.beta, n + 1)
        copy_marks(record.marks[block], marks)
