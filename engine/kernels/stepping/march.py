"""The march: implicit steps of every lane along one segment, one fused pass over the modes per step.

Derivation (mechanics section 2), in step units: with predictors u*, v* and D = 1/(1 + gamma c + beta k),
c_k* = (c v* + k u*) D, an equation of mode k gives  a_k = p_k D_k F - c_k*.  Put into the tie's kinematics
G = P.a + A.(v* + gamma a) + B.(u* + beta a) this is  G = w.(D p) F - (w.c* - A.v* - B.u*),  and with
F = load - m (G + drive):

    F = (load + m (w.c* - A.v* - B.u* - drive)) / (1 + m w.(D p))        one tie; r ties: an r x r system

A spring reads its gap  p.u = beta p.(D p) F - p.(beta c* - u*)  in the same way (section 4):

    F = load - m (G + drive) - k (p.u + level + residual F/h^2)

A rigid tie has 0 in place of F on the left. Where there are several ties, what dead loads give is taken from c* first.
``inverse_modal_mass`` multiplies D where it meets a force. The pass over the modes corrects step n, observes it,
predicts step n + 1 and gathers the sums of its tie equation.
"""

import numpy as np

from engine.kernels.jit import kernel, piece
from engine.kernels.layout import CLOSED, CURVE, FORCE, LANES, RATE, STATISTICS
from engine.kernels.stepping.one_mode import advance, corrected, fields_of, first_predictors, remember
from engine.kernels.stepping.record import (
    CD,
    FACTOR,
    GAIN,
    GRAVITY,
    KD,
    LOAD,
    PUSH,
    RATE_0,
    RATE_1,
    RATE_2,
    SUM,
    TIE,
    C,
    D,
    U,
    V,
    close_statistics,
    judge_lanes,
    keep,
    leading,
    load_weights,
    observe,
    open_statistics,
    put_leads,
    put_modes,
)
from engine.kernels.stepping.ties import (
    Twos,
    couple_gaps,
    couple_motions,
    load_dead,
    load_own,
    load_ties,
    miss,
    note_members,
    note_pushing,
    note_shared,
    push_ties,
    pushed,
    solve_ties,
)
from engine.kernels.vector import all_lanes, lanes_at, put_lanes


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
    load_weights(b, lanes, block)
    for k in range(lanes.stiffness.shape[1]):
        for j in range(LANES):
            h = lanes.step[block, j]
            c = lanes.damping[block, k, j]
            s = lanes.stiffness[block, k, j]
            d = 1.0 / (1.0 + gamma * c + beta * s)
            m = lanes.inverse_modal_mass[block, k, j]
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


@piece
def load_tie(b, work, lanes, rows, block):
    """What the one tie of a block has to itself, and the sums of its equation at station 1."""
    put_lanes(b, (GAIN,), lanes_at(lanes.coupling_mass, (block, 0)))
    put_lanes(b, (LOAD,), lanes_at(lanes.load, (block, 0)))
    motion, moved, factor = all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)
    for k in range(work.shape[0]):
        p, w, rate, curve = tie_row(rows, 1, k)
        motion = motion + w * lanes_at(work, (k, C))
        moved = moved + rate * lanes_at(work, (k, V)) + curve * lanes_at(work, (k, U))
        factor = factor + (w * p) * lanes_at(work, (k, D))
    put_lanes(b, (SUM,), motion - moved)
    put_lanes(b, (FACTOR,), factor)


@piece
def tie_row(rows, n, k):
    """p, w, A and B of mode k in the one tie at station n."""
    return rows[n, k, 0, FORCE], rows[n, k, 0, CLOSED], rows[n, k, 0, RATE], rows[n, k, 0, CURVE]


@piece
def solve_tie(b, drive):
    """The one tie's force, which stays in b[TIE] too; drive: that of the station."""
    driven = lanes_at(b, (SUM,)) - drive * lanes_at(b, (GRAVITY,))
    # what the tie yields does not hang on the state: so divided, the force does not wait for the division
    yielding = 1.0 / (1.0 + lanes_at(b, (GAIN,)) * lanes_at(b, (FACTOR,)))
    force = (lanes_at(b, (LOAD,)) + lanes_at(b, (GAIN,)) * driven) * yielding
    put_lanes(b, (TIE,), force)
    return force


@kernel
def march_one(ties, lanes, state, watch, record, scheme, count):
    """March one segment with a single tie.

    Shapes as in ``layout``; ``count`` is the number of the scene's stations before this segment's station 0. The
    state and the record are updated in place. Returns the code of every lane.
    """
    rows = ties.rows
    stations, modes = rows.shape[0], rows.shape[1]
    leads, lead_moves = leading(watch), 0 if watch.on_q.shape[0] == 1 else 1
    # allocated here and not in a piece: only so does the compiler know their strides
    status = np.zeros((lanes.step.shape[0], LANES), np.int8)
    work = np.zeros((modes, fields_of(scheme), LANES))
    now = np.zeros((4 * ((modes + 3) // 4), 3, LANES))
    b = np.zeros((TIE + 1 + lanes.weight.shape[1], LANES))
    statistics = np.zeros((watch.offset.shape[1], STATISTICS, LANES))
    for block in range(lanes.step.shape[0]):
        load_block(work, b, lanes, state, scheme, block)
        open_statistics(statistics, record.statistics[block])
        history = record.history[block]
        load_tie(b, work, lanes, rows, block)
        for n in range(1, stations):
            force = solve_tie(b, ties.drive[n, 0])
            if n == stations - 1:
                for k in range(modes):
                    put_lanes(b, (PUSH,), rows[n, k, 0, FORCE] * force)
                    store_mode(work, b, state, scheme, block, k)
            m = min(n + 1, stations - 1)
            at = lead_moves * n
            motion, moved, factor = all_lanes(0.0), all_lanes(0.0), all_lanes(0.0)
            first, second = all_lanes(0.0), all_lanes(0.0)
            for k in range(modes):
                p, w, rate, curve = tie_row(rows, m, k)
                d = lanes_at(work, (k, D))
                a = rows[n, k, 0, FORCE] * (d * force) - lanes_at(work, (k, C))
                q, v, u_next, v_next, c = advance(scheme, work, k, a)
                motion = motion + w * c
                moved = moved + rate * v_next + curve * u_next
                factor = factor + (w * p) * d
                if leads == 2:
                    first = first + watch.on_q[at, 0, k] * q
                    second = second + watch.on_q[at, 1, k] * q
                elif leads == 1:
                    first = first + watch.on_q[at, 0, k] * q
                elif leads < 0:
                    put_modes(now, k, q, v, a)
            put_lanes(b, (SUM,), motion - moved)
            put_lanes(b, (FACTOR,), factor)
            put_leads(b, leads, first, second)
            observe(statistics, now, b, watch, n, leads)
            keep(statistics, history, watch, record.sample[n], n, float(count + n))
        close_statistics(record.statistics[block], statistics, watch, lanes.step[block], stations - 1)
        judge_lanes(status, statistics, state.q, state.v, block)
    return status


@kernel
def march_many(ties, lanes, state, watch, record, scheme, count):
    """March one segment with any number of ties; otherwise as ``march_one``."""
    rows, reactive, prescribed, reaches = ties.rows, ties.reactive, ties.prescribed, ties.reaches
    stations, modes, many = rows.shape[0], rows.shape[1], rows.shape[2]
    half = (reactive.shape[0] + 1) // 2
    leads, lead_moves = leading(watch), 0 if watch.on_q.shape[0] == 1 else 1
    # allocated here and not in a piece: only so does the compiler know their strides
    status = np.zeros((lanes.step.shape[0], LANES), np.int8)
    work = np.zeros((modes, fields_of(scheme), LANES))
    now = np.zeros((4 * ((modes + 3) // 4), 3, LANES))
    b = np.zeros((TIE + many + lanes.weight.shape[1], LANES))
    statistics = np.zeros((watch.offset.shape[1], STATISTICS, LANES))
    own = np.zeros((many, 4, LANES))
    matrix = np.zeros((2 * half, 2 * half, LANES))
    # filled before they are put together: the compiler drops what is written into a local tuple's arrays where it is
    # not read again under that name
    member, moves, springs = np.zeros(2 * half, np.int64), np.zeros(half, np.bool_), np.zeros(half, np.bool_)
    shared, shares = np.zeros((half, half, modes), np.int64), np.zeros((half, half), np.int64)
    pushing, pushes = np.zeros((modes, reactive.shape[0]), np.int64), np.zeros(modes, np.int64)
    note_members(member, moves, springs, ties)
    note_shared(shared, shares, member, reaches)
    note_pushing(pushing, pushes, reactive, reaches)
    twos = Twos(member, moves, springs, shared, shares, pushing, pushes)
    for block in range(lanes.step.shape[0]):
        load_block(work, b, lanes, state, scheme, block)
        load_own(own, b, ties, lanes, block)
        open_statistics(statistics, record.statistics[block])
        history = record.history[block]
        for n in range(1, stations):
            load_dead(work, b, rows, prescribed, reaches, n)
            load_ties(b, own, reactive, ties.drive[n], ties.level[n])
            push_ties(b, work, rows, own, twos, n, scheme.beta)
            couple_motions(matrix, work, rows, own, twos, n)
            couple_gaps(matrix, work, rows, own, twos, n, scheme.beta)
            if ties.residual.shape[0] > 0:
                miss(matrix, b, ties, own, n)
            solve_ties(b, matrix, reactive)
            if n == stations - 1:
                for k in range(modes):
                    put_lanes(b, (PUSH,), pushed(b, rows, twos, n, k))
                    store_mode(work, b, state, scheme, block, k)
            at = lead_moves * n
            first, second = all_lanes(0.0), all_lanes(0.0)
            for k in range(modes):
                a = lanes_at(work, (k, D)) * pushed(b, rows, twos, n, k) - lanes_at(work, (k, C))
                q, v, _, _, _ = advance(scheme, work, k, a)
                if leads == 2:
                    first = first + watch.on_q[at, 0, k] * q
                    second = second + watch.on_q[at, 1, k] * q
                elif leads == 1:
                    first = first + watch.on_q[at, 0, k] * q
                elif leads < 0:
                    put_modes(now, k, q, v, a)
            put_leads(b, leads, first, second)
            observe(statistics, now, b, watch, n, leads)
            keep(statistics, history, watch, record.sample[n], n, float(count + n))
        close_statistics(record.statistics[block], statistics, watch, lanes.step[block], stations - 1)
        judge_lanes(status, statistics, state.q, state.v, block)
    return status
