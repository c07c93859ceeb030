"""What happens at one instant: consistent accelerations, impulses, and the observation of a segment's first station.

These run once per segment, so they are written lane by lane for reading, not for pace.
"""

import numpy as np

from engine.kernels.jit import kernel, piece
from engine.kernels.layout import CURVE, FORCE, LANES, RATE, SQUARES, STATISTICS
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
    copy_statistics,
    keep,
    load_weights,
    observe,
)


@piece
def solve_in_place(matrix, x):
    """Gauss with partial pivoting of a small dense system, the solution left in x."""
    count = x.shape[0]
    for r in range(count):
        pivot = r
        for s in range(r + 1, count):
            if abs(matrix[s, r]) > abs(matrix[pivot, r]):
                pivot = s
        for t in range(count):
            matrix[r, t], matrix[pivot, t] = matrix[pivot, t], matrix[r, t]
        x[r], x[pivot] = x[pivot], x[r]
        for s in range(r + 1, count):
            ratio = matrix[s, r] / matrix[r, r]
            for t in range(r, count):
                matrix[s, t] -= ratio * matrix[r, t]
            x[s] -= ratio * x[r]
    for r in range(count - 1, -1, -1):
        for s in range(r + 1, count):
            x[r] -= matrix[r, s] * x[s]
        x[r] /= matrix[r, r]


@piece
def tie_row(rows, k, r):
    """P, A, B of mode k in tie r at station 0; P is what w holds there, for no step is implicit at an instant."""
    return rows[0, k, r, 1], rows[0, k, r, RATE], rows[0, k, r, CURVE]


@piece
def yield_to(force, matrix, unknown, i, ties, stiffness):
    """Add the residual's part of the gap of reactive tie i to its equation; stiffness: k of its spring."""
    r = ties.reactive[i]
    for t in range(ties.reactive.shape[0]):
        matrix[i, t] += stiffness * ties.residual[0, r, ties.reactive[t]]
    for s in ties.prescribed:
        unknown[i] -= stiffness * ties.residual[0, r, s] * force[s]


@piece
def forces_at_start(force, matrix, unknown, ties, lanes, state, at):
    """Forces of all ties of one lane at station 0, in step units, for the given displacements and velocities; at: its
    block and lane. matrix, unknown: room for the system of the ties that react.

    The row w of station 0 holds P alone. unity F = load - m (P.a + A.v + B.u + drive) - k (p.u + level +
    residual F/h^2),  a = inverse_modal_mass p F - c v - k u.
    """
    rows, reactive, (block, j) = ties.rows, ties.reactive.shape[0], at
    h, gravity = lanes.step[block, j], lanes.gravity[block, j]
    for r in range(rows.shape[2]):
        force[r] = lanes.load[block, r, j]
    for i in range(reactive):
        r = ties.reactive[i]
        coupling_mass = lanes.coupling_mass[block, r, j]
        total, gap = -ties.drive[0, r] * gravity, ties.level[0, r] * gravity
        for t in range(reactive):
            matrix[i, t] = ties.unity[r] if i == t else 0.0
        for k in range(rows.shape[1]):
            inertial, rate, curve = tie_row(rows, k, r)
            u, v = state.q[block, k, j], state.v[block, k, j] * h
            elastic = lanes.damping[block, k, j] * v + lanes.stiffness[block, k, j] * u
            mobile = lanes.inverse_modal_mass[block, k, j]
            for s in ties.prescribed:
                elastic -= mobile * rows[0, k, s, FORCE] * force[s]
            total += inertial * elastic - rate * v - curve * u
            gap += rows[0, k, r, FORCE] * u
            for t in range(reactive):
                matrix[i, t] += coupling_mass * inertial * mobile * rows[0, k, ties.reactive[t], FORCE]
        unknown[i] = lanes.load[block, r, j] + coupling_mass * total - lanes.coupling_stiffness[block, r, j] * gap
        if ties.residual.shape[0] > 0:
            yield_to(force, matrix, unknown, i, ties, lanes.coupling_stiffness[block, r, j] / (h * h))
    solve_in_place(matrix, unknown)
    for i in range(reactive):
        force[ties.reactive[i]] = unknown[i]


@kernel
def solve_initial_acceleration(ties, lanes, state):
    """Accelerations that satisfy the equations of motion at station 0, for the given displacements and velocities."""
    rows = ties.rows
    modes, many, reactive = rows.shape[1], rows.shape[2], ties.reactive.shape[0]
    force, matrix, unknown = np.empty(many), np.empty((reactive, reactive)), np.empty(reactive)
    for block in range(lanes.step.shape[0]):
        for j in range(LANES):
            h = lanes.step[block, j]
            forces_at_start(force, matrix, unknown, ties, lanes, state, (block, j))
            for k in range(modes):
                u, v = state.q[block, k, j], state.v[block, k, j] * h
                a = -lanes.damping[block, k, j] * v - lanes.stiffness[block, k, j] * u
                for r in range(many):
                    a += lanes.inverse_modal_mass[block, k, j] * rows[0, k, r, FORCE] * force[r]
                state.a[block, k, j] = a / (h * h)
                state.memory[block, k, j] = 0.0


@kernel
def strike(blow, gravity, inverse_modal_mass, state):
    """Impulses of ties: dq' = -(M + m phi phi^T)^-1 m phi jump (mechanics section 5), all ties at once.

    The jump of tie r is the velocity that its contact point has and the carriage has not: ``arrives`` phi.q' +
    ``speed`` (phi'.q + g sag'), speed in m/s being that of an arriving carriage or the change of a reversing one.
    """
    many, modes = blow.shape.shape
    matrix = np.empty((many, many))
    impulse = np.empty(many)
    for block in range(gravity.shape[0]):
        for j in range(LANES):
            for r in range(many):
                rate, slope = 0.0, blow.sag_slope[r] * gravity[block, j]
                for k in range(modes):
                    rate += blow.shape[r, k] * state.v[block, k, j]
                    slope += blow.slope[r, k] * state.q[block, k, j]
                for s in range(many):
                    matrix[r, s] = 0.0
                    for k in range(modes):
                        mobile = inverse_modal_mass[block, k, j]
                        matrix[r, s] += blow.mass[block, r, j] * blow.shape[r, k] * (mobile * blow.shape[s, k])
                matrix[r, r] += 1.0
                impulse[r] = -blow.mass[block, r, j] * (blow.arrives[r] * rate + blow.speed[block, r, j] * slope)
            solve_in_place(matrix, impulse)
            for k in range(modes):
                for r in range(many):
                    mobile = inverse_modal_mass[block, k, j]
                    state.v[block, k, j] += mobile * (blow.shape[r, k] * impulse[r])


@kernel
def watch_start(ties, lanes, state, watch, record, count):
    """Observe station 0 of a segment: extremes and samples, but not the sums of squares."""
    modes, many, reactive = ties.rows.shape[1], ties.rows.shape[2], ties.reactive.shape[0]
    force, matrix, unknown = np.empty(many), np.empty((reactive, reactive)), np.empty(reactive)
    now = np.zeros((4 * ((modes + 3) // 4), 3, LANES))
    b = np.zeros((TIE + many + lanes.weight.shape[1], LANES))
    statistics = np.zeros((watch.offset.shape[1], STATISTICS, LANES))
    for block in range(lanes.step.shape[0]):
        copy_statistics(statistics, record.statistics[block])
        load_weights(b, lanes, block)
        for j in range(LANES):
            h = lanes.step[block, j]
            b[GRAVITY, j] = lanes.gravity[block, j]
            b[RATE_0, j] = 1.0
            b[RATE_1, j] = 1.0 / h
            b[RATE_2, j] = 1.0 / (h * h)
            for k in range(modes):
                now[k, Q_NOW, j] = state.q[block, k, j]
                now[k, V_NOW, j] = state.v[block, k, j] * h
                now[k, A_NOW, j] = state.a[block, k, j] * h * h
            forces_at_start(force, matrix, unknown, ties, lanes, state, (block, j))
            for r in range(many):
                b[TIE + r, j] = force[r]
        observe(statistics, now, b, watch, 0, KEPT)
        keep(statistics, record.history[block], watch, record.sample[0], 0, float(count))
        for i in range(statistics.shape[0]):
            for j in range(LANES):
                statistics[i, SQUARES, j] = record.statistics[block, i, SQUARES, j]
        copy_statistics(record.statistics[block], statistics)
