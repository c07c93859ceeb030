"""One step of each comparison scheme, and the pieces that they share; `comparison` says what the rules are.

Everything is counted in steps, as in `march`. With predictors u*, v*, D = 1/(1 + gamma c + beta k) and
c* = (c v* + k u*) D a mode's new acceleration is D p F - c*, so the motion of the contact point is known but for F:
P.a + A.v + B.u  =  free part + F times part per unit force.  Rows are P, A, B and p of ``layout.Ties``.
"""

from typing import NamedTuple

import numpy as np

from engine.kernels.jit import chosen_for, piece
from engine.kernels.layout import CLOSED, CURVE, FORCE, LANES, RATE, Alpha, FloatArray
from engine.kernels.stepping.one_mode import first_predictors
from engine.kernels.stepping.record import A_NOW, GRAVITY, Q_NOW, RATE_1, RATE_2, TIE, V_NOW

# fields of the per-mode work array
D, C, U, V, E = range(5)
STAGE_Q, STAGE_V, STAGE_A, SUM_Q, SUM_V = range(5)
FIELDS = 5
# fourth field of the array of corrected modes: what an alpha scheme remembers
MEMORY = 3
# sums of the contact's equation: its motion at the last station, and at the new one the free part and the part per
# unit force, each in its inertial term and its convective ones; and the place of the contact point
LAST_INERTIAL, LAST_CONVECTIVE, FREE_INERTIAL, FREE_CONVECTIVE, UNIT_INERTIAL, UNIT_CONVECTIVE, PLACE = range(7)
SUMS = 7
# rows of what a rule keeps besides the modes: counts of iterations and of steps whose iteration did not converge, and
# the rigidly tied mass's own displacement, velocity, acceleration and memory (SI)
ITERATIONS, UNCONVERGED, OWN_Q, OWN_V, OWN_A, OWN_MEMORY = range(6)
KEPT = 6


class Scratch(NamedTuple):
    """Arrays of one block: modes as they are (modes in fours, 4, LANES), fields of the step (modes, FIELDS, LANES),
    sums of the contact's equation (SUMS, LANES), and the rows of `record` with the force times h^2 in TIE."""

    now: FloatArray
    work: FloatArray
    sums: FloatArray
    b: FloatArray


def remembered(scheme, x, e):
    """The memory of an alpha scheme after a step whose new acceleration is x."""
    return _REMEMBERED[isinstance(scheme, Alpha)](scheme, x, e)


_REMEMBERED = (lambda scheme, x, e: 0.0, lambda scheme, x, e: (scheme.kappa - 1.0) * x + e)
chosen_for(remembered)(lambda scheme, *others: _REMEMBERED[scheme.instance_class is Alpha])


@piece
def release(weights, work, lanes, block, k, j):
    """Diagonal and free acceleration of a mode whose predictors are there, for the weights of the new one."""
    c, s = lanes.damping[block, k, j], lanes.stiffness[block, k, j]
    d = 1.0 / (1.0 + weights.gamma * c + weights.beta * s)
    work[k, D, j] = d
    work[k, C, j] = (c * work[k, V, j] + s * work[k, U, j]) * d


@piece
def predict(scheme, now, work, lanes, block):
    """Predictors of every mode by a scheme of the march."""
    for k in range(work.shape[0]):
        for j in range(LANES):
            u, v, e = first_predictors(scheme, now[k, Q_NOW, j], now[k, V_NOW, j], now[k, A_NOW, j], now[k, MEMORY, j])
            work[k, U, j] = u
            work[k, V, j] = v
            work[k, E, j] = e
            release(scheme, work, lanes, block, k, j)


@piece
def correct(scheme, now, work, b, row):
    """New state of every mode from the contact force."""
    for k in range(work.shape[0]):
        p = row[k, FORCE]
        for j in range(LANES):
            x = work[k, D, j] * p * b[TIE, j] - work[k, C, j]
            now[k, Q_NOW, j] = work[k, U, j] + scheme.beta * x
            now[k, V_NOW, j] = work[k, V, j] + scheme.gamma * x
            now[k, A_NOW, j] = x
            now[k, MEMORY, j] = remembered(scheme, x, work[k, E, j])


@piece
def gather(weights, sums, work, b, row, drive):
    """Motion of the contact at the new station: the free part, and per unit force; and its place but for the force."""
    beta, gamma = weights.beta, weights.gamma
    for j in range(LANES):
        sums[FREE_INERTIAL, j] = 0.0
        sums[FREE_CONVECTIVE, j] = drive * b[GRAVITY, j]
        sums[UNIT_INERTIAL, j] = 0.0
        sums[UNIT_CONVECTIVE, j] = 0.0
        sums[PLACE, j] = 0.0
    for k in range(work.shape[0]):
        p, inertial, rate, curve = row[k, FORCE], row[k, CLOSED], row[k, RATE], row[k, CURVE]
        for j in range(LANES):
            c, dp = work[k, C, j], work[k, D, j] * p
            v, u = work[k, V, j] - gamma * c, work[k, U, j] - beta * c
            sums[FREE_INERTIAL, j] -= inertial * c
            sums[FREE_CONVECTIVE, j] += rate * v + curve * u
            sums[UNIT_INERTIAL, j] += inertial * dp
            sums[UNIT_CONVECTIVE, j] += (gamma * rate + beta * curve) * dp
            sums[PLACE, j] += p * u


@piece
def gather_now(sums, now, b, row, drive, modes):
    """Motion of the contact by the modes as they stand."""
    for j in range(LANES):
        sums[LAST_INERTIAL, j] = 0.0
        sums[LAST_CONVECTIVE, j] = drive * b[GRAVITY, j]
    for k in range(modes):
        inertial, rate, curve = row[k, CLOSED], row[k, RATE], row[k, CURVE]
        for j in range(LANES):
            sums[LAST_INERTIAL, j] += inertial * now[k, A_NOW, j]
            sums[LAST_CONVECTIVE, j] += rate * now[k, V_NOW, j] + curve * now[k, Q_NOW, j]


@piece
def coupled_force(rule, sums, load, coupling_mass, kept, block, j):
    """Contact force of one lane; NaN where the iteration did not converge.

    F = load - m (motion), each term of the motion new or old. The iteration puts the last force into the right
    side; it contracts where r = m times the inertial part per unit force is below 1.
    """
    last = load - coupling_mass * (sums[LAST_INERTIAL, j] + sums[LAST_CONVECTIVE, j])
    inertial = rule.inertial * sums[FREE_INERTIAL, j] + (1.0 - rule.inertial) * sums[LAST_INERTIAL, j]
    convective = rule.convective * sums[FREE_CONVECTIVE, j] + (1.0 - rule.convective) * sums[LAST_CONVECTIVE, j]
    unit = coupling_mass * (rule.inertial * sums[UNIT_INERTIAL, j] + rule.convective * sums[UNIT_CONVECTIVE, j])
    known = load - coupling_mass * (inertial + convective)
    force = known / (1.0 + unit)
    if rule.iterations > 0:
        share = 1.0 / (1.0 + rule.relaxed * coupling_mass * sums[UNIT_INERTIAL, j])
        force, done = last, 0
        while done < rule.iterations:
            change = share * (known - unit * force - force)
            force += change
            done += 1
            if abs(change) <= rule.tolerance * max(abs(load), abs(force)):
                break
        else:
            force = np.nan
            kept[block, UNCONVERGED, j] += 1.0
        kept[block, ITERATIONS, j] += done
    return force


def step_coupled(rule, scratch, track, lanes, kept, block, n):
    """Offsets 0 and 1."""
    now, work, sums, b = scratch
    gather_now(sums, now, b, track.rows[0, n], track.drive[0, n], work.shape[0])
    predict(rule.scheme, now, work, lanes, block)
    gather(rule.scheme, sums, work, b, track.rows[1, n], track.drive[1, n])
    for j in range(LANES):
        b[TIE, j] = coupled_force(rule, sums, lanes.load[block, 0, j], lanes.coupling_mass[block, 0, j], kept, block, j)
    correct(rule.scheme, now, work, b, track.rows[1, n])


def step_wilson(rule, scratch, track, lanes, kept, block, n):
    """Offsets theta and 1 (Wilson 1968). The force that is recorded is m (g - D2w) of the station."""
    now, work, sums, b = scratch
    theta = rule.theta
    for k in range(work.shape[0]):
        for j in range(LANES):
            q, v, a = now[k, Q_NOW, j], now[k, V_NOW, j], now[k, A_NOW, j]
            work[k, U, j] = q + theta * v + theta * theta / 3.0 * a
            work[k, V, j] = v + 0.5 * theta * a
            release(rule, work, lanes, block, k, j)
    gather(rule, sums, work, b, track.rows[0, n], track.drive[0, n])
    for j in range(LANES):
        coupling_mass = lanes.coupling_mass[block, 0, j]
        known = lanes.load[block, 0, j] - coupling_mass * (sums[FREE_INERTIAL, j] + sums[FREE_CONVECTIVE, j])
        b[TIE, j] = known / (1.0 + coupling_mass * (sums[UNIT_INERTIAL, j] + sums[UNIT_CONVECTIVE, j]))
    for k in range(work.shape[0]):
        p = track.rows[0, n, k, FORCE]
        for j in range(LANES):
            q, v, a = now[k, Q_NOW, j], now[k, V_NOW, j], now[k, A_NOW, j]
            x = a + (work[k, D, j] * p * b[TIE, j] - work[k, C, j] - a) / theta
            now[k, Q_NOW, j] = q + v + (2.0 * a + x) / 6.0
            now[k, V_NOW, j] = v + 0.5 * (a + x)
            now[k, A_NOW, j] = x
    gather_now(sums, now, b, track.rows[1, n], track.drive[1, n], work.shape[0])
    for j in range(LANES):
        motion = sums[LAST_INERTIAL, j] + sums[LAST_CONVECTIVE, j]
        b[TIE, j] = lanes.load[block, 0, j] - lanes.coupling_mass[block, 0, j] * motion


@piece
def accelerate(work, sums, b, row, drive, lanes, block):
    """Accelerations of a stage, the contact force solved from its displacements and velocities."""
    for j in range(LANES):
        sums[FREE_INERTIAL, j] = 0.0
        sums[FREE_CONVECTIVE, j] = drive * b[GRAVITY, j]
        sums[UNIT_INERTIAL, j] = 0.0
    for k in range(work.shape[0]):
        p, inertial, rate, curve = row[k, FORCE], row[k, CLOSED], row[k, RATE], row[k, CURVE]
        for j in range(LANES):
            u, v = work[k, STAGE_Q, j], work[k, STAGE_V, j]
            a = -lanes.damping[block, k, j] * v - lanes.stiffness[block, k, j] * u
            work[k, STAGE_A, j] = a
            sums[FREE_INERTIAL, j] += inertial * a
            sums[FREE_CONVECTIVE, j] += rate * v + curve * u
            sums[UNIT_INERTIAL, j] += inertial * p
    for j in range(LANES):
        coupling_mass = lanes.coupling_mass[block, 0, j]
        known = lanes.load[block, 0, j] - coupling_mass * (sums[FREE_INERTIAL, j] + sums[FREE_CONVECTIVE, j])
        b[TIE, j] = known / (1.0 + coupling_mass * sums[UNIT_INERTIAL, j])
    for k in range(work.shape[0]):
        p = row[k, FORCE]
        for j in range(LANES):
            work[k, STAGE_A, j] += p * b[TIE, j]


@piece
def start_stages(now, work):
    """The first stage is the state as it stands, its accelerations known from the step before."""
    for k in range(work.shape[0]):
        for j in range(LANES):
            work[k, STAGE_Q, j] = now[k, Q_NOW, j]
            work[k, STAGE_V, j] = now[k, V_NOW, j]
            work[k, STAGE_A, j] = now[k, A_NOW, j]
            work[k, SUM_Q, j] = 0.0
            work[k, SUM_V, j] = 0.0


@piece
def next_stage(now, work, weight, reach):
    """Add a stage's slopes with its weight, and go from the state as far along them as the next stage stands."""
    for k in range(work.shape[0]):
        for j in range(LANES):
            u_slope, v_slope = work[k, STAGE_V, j], work[k, STAGE_A, j]
            work[k, SUM_Q, j] += weight * u_slope
            work[k, SUM_V, j] += weight * v_slope
            work[k, STAGE_Q, j] = now[k, Q_NOW, j] + reach * u_slope
            work[k, STAGE_V, j] = now[k, V_NOW, j] + reach * v_slope


def step_runge_kutta(rule, scratch, track, lanes, kept, block, n):
    """Offsets 1/2 and 1."""
    now, work, sums, b = scratch
    start_stages(now, work)
    for stage in range(3):
        at = 0 if stage < 2 else 1
        next_stage(now, work, 1.0 / 6.0 if stage == 0 else 1.0 / 3.0, rule.middle if stage < 2 else 1.0)
        accelerate(work, sums, b, track.rows[at, n], track.drive[at, n], lanes, block)
    next_stage(now, work, 1.0 / 6.0, 0.0)
    for k in range(work.shape[0]):
        for j in range(LANES):
            work[k, STAGE_Q, j] += work[k, SUM_Q, j]
            work[k, STAGE_V, j] += work[k, SUM_V, j]
    accelerate(work, sums, b, track.rows[1, n], track.drive[1, n], lanes, block)
    for k in range(work.shape[0]):
        for j in range(LANES):
            now[k, Q_NOW, j] = work[k, STAGE_Q, j]
            now[k, V_NOW, j] = work[k, STAGE_V, j]
            now[k, A_NOW, j] = work[k, STAGE_A, j]


def step_rigid(rule, scratch, track, lanes, kept, block, n):
    """Offsets 0, for the start, and 1. The new place of the mass, y* + beta (load - F)/m, is the contact point's."""
    now, work, sums, b = scratch
    scheme = rule.scheme
    predict(scheme, now, work, lanes, block)
    gather(scheme, sums, work, b, track.rows[1, n], track.drive[1, n])
    for j in range(LANES):
        rate, rate_2 = b[RATE_1, j], b[RATE_2, j]
        load, m = lanes.load[block, 0, j], lanes.coupling_mass[block, 0, j]
        y, v, a = kept[block, OWN_Q, j], kept[block, OWN_V, j] / rate, kept[block, OWN_A, j] / rate_2
        y, v, e = first_predictors(scheme, y, v, a, kept[block, OWN_MEMORY, j] / rate_2)
        gap = sums[PLACE, j] - (y + scheme.beta * load / m)
        b[TIE, j] = -gap / (scheme.beta * (sums[UNIT_INERTIAL, j] + 1.0 / m))
        x = (load - b[TIE, j]) / m
        kept[block, OWN_Q, j] = y + scheme.beta * x
        kept[block, OWN_V, j] = (v + scheme.gamma * x) * rate
        kept[block, OWN_A, j] = x * rate_2
        kept[block, OWN_MEMORY, j] = remembered(scheme, x, e) * rate_2
    correct(scheme, now, work, b, track.rows[1, n])
