"""The march of robots on rails: Newmark's scheme with every step solved by Newton's method, whose matrix is made
anew in each: where a robot goes on by a hundredth of a track, the old one may drive apart what moves least, such as the
twist of a girder under a load far below; events fall on step boundaries."""

import numpy as np

from engine.kernels.floating.vectors import add, cross, shared_vector, times
from engine.kernels.jit import called, kernel
from engine.kernels.layout import NOT_CONVERGED, SOUND
from engine.kernels.robots.dynamics import evaluate, plan_at, prepare, room, solve
from engine.kernels.robots.equilibrium import settle
from engine.kernels.robots.layout import (
    ACTUAL_TOOL,
    ALONG,
    BEFORE,
    BEGUN,
    CHANGE,
    DRIVE,
    ELEMENT,
    EXTRA,
    FALLS_OVER,
    GRIP,
    INTO,
    JOINTS,
    MISSED_THERE,
    MISSING,
    MOMENTUM,
    OF_GRIP,
    OFF,
    PASSED,
    PASSED_GRIPS,
    PAYLOAD,
    PHASE,
    PLACE,
    PLANNED,
    PLANNED_TOOL,
    PUSH,
    RATE,
    SEEN_ACTUAL,
    SEEN_PLANNED,
    SEEN_WRENCH,
    SOFT,
    SUNK,
    UP_THERE,
    WRENCH,
    Pace,
)
from engine.kernels.robots.timing import number_of
from engine.kernels.robots.tracks import give

RESTING = 1e-20  # of the largest elastic energy of a coordinate: what a correction may still do before the march
MOST_CORRECTIONS, STARTING = 12, 3
GROWS = 2.0  # from step to step, by which corrections may fall less than those last seen
#: Of the limit of a scheme's step: the inertia of robots changes while they move. With 0.6 no march of the portal grew;
#: where joints and modes were judged one by one one did, at 12 steps a period. Powers are taken after the last to go.
WITHIN, POWERS = 0.6, 6
REUSED = 3  # corrections of a step after which its matrix is made anew


@kernel
def march(system, stretches, newmark, record):
    """From equilibrium at the first time through all stretches, observing into ``record``; a code of `layout`."""
    work, N = room(system), system.springs.shape[0]
    state, left = np.zeros((N, 3)), np.zeros(N)
    load_at(system, stretches.start[0], work)
    plan_at(system, stretches.start[0], work)
    code, station, passed = np.int64(settle(system, RESTING, state, work, left)), np.int64(0), np.int64(0)
    energy = elastic_energy(system, state)
    if code == FALLS_OVER:
        return code
    for p in range(stretches.start.shape[0]):
        start, h = stretches.start[p], stretches.step[p]
        until = h * stretches.steps[p]
        pace = Pace(h, newmark.gamma * h, newmark.beta * h * h, lacking(newmark) * h * h, until, stretches.close)
        if p > 0:
            strike(system, start, state, work, left)
        begin(system, start, pace, state, work, left)
        for n in range(stretches.steps[p] + 1):
            if record.stop[0] != 0:
                return code
            if n > 0:
                energy, close = step(system, start + n * h, pace, state, work, left, energy)
                if not close:
                    code = np.int64(NOT_CONVERGED)
                if not np.isfinite(energy):
                    return np.int64(NOT_CONVERGED)
            observe(system, start + n * h, state, work, left, record, station)
            pass_by(state, record, station, passed)
            passed += 1
            if n % stretches.every == 0:  # what is no station is written over
                station += 1
    return code


@kernel
def rest(system, stretches, record):
    """Where everything would rest with joints held where they are told to be, at the stations of `march`, up to one at
    which nothing does as a joint falls over; a code."""
    work, N = room(system), system.springs.shape[0]
    state, left = np.zeros((N, 3)), np.zeros(N)
    code, station = np.int64(SOUND), np.int64(0)
    for p in range(stretches.start.shape[0]):
        start, h = stretches.start[p], stretches.step[p]
        load_at(system, start, work)
        for n in range(0, stretches.steps[p] + 1, stretches.every):
            t = start + n * h
            if record.stop[0] != 0:
                return code
            if plan_at(system, t, work):
                hold(work)
                code = max(code, np.int64(settle(system, stretches.close, state, work, left)))
                if code == FALLS_OVER:
                    return code
                observe(system, t, state, work, left, record, station)
            else:
                record.coordinates[station, :, :3], record.coordinates[station, :, 3] = state, t
                record.robots[station], record.drive[station] = record.robots[station - 1], record.drive[station - 1]
                record.grips[station] = record.grips[station - 1]
            station += 1
    return code


@called
def hold(work):
    """Joints stand still where they are told to be."""
    for r in range(work.links.shape[0]):
        for j in range(work.links.shape[1]):
            work.links[r, j, PLANNED + RATE], work.links[r, j, PLANNED + PUSH] = 0.0, 0.0


@called
def elastic_energy(system, state):
    """1/2 sum k y^2."""
    found = 0.0
    for k in range(state.shape[0]):
        found += 0.5 * system.springs[k, 0] * state[k, 0] ** 2
    return found


@called
def payload_of(system, r, begun):
    """kg that robot r carries once so many of its moves have begun."""
    return system.stays[r, begun, system.coordinate.shape[1]]


@called
def load_at(system, t, work):
    """The moves that have begun at a time, and what is carried then."""
    for r in range(work.robots.shape[0]):
        work.doing[r, BEGUN] = number_of(system, r, t)
        work.robots[r, PAYLOAD] = payload_of(system, r, work.doing[r, BEGUN])
        work.doing[r, PHASE] = -1


@called
def strike(system, t, state, work, left):
    """Velocities where payloads change: what is picked up is at rest until then, what is put down takes its momentum
    along."""
    plan_at(system, t, work)
    for k in range(left.shape[0]):
        work.vectors[MOMENTUM, k], work.vectors[EXTRA, k] = 0.0, 0.0
    add_momenta(system, 1.0, state, work, left)
    for r in range(work.robots.shape[0]):
        payload = payload_of(system, r, number_of(system, r, t))
        if payload < work.robots[r, PAYLOAD]:
            add_momenta(system, -1.0, state, work, left)
            work.robots[r, PAYLOAD] = payload
            add_momenta(system, 1.0, state, work, left)
        work.robots[r, PAYLOAD] = payload
    evaluate(system, state, work, left)
    prepare(system, 0.0, 0.0, work)
    solve(system, work, work.vectors[MOMENTUM])
    for k in range(left.shape[0]):
        state[k, 1] = work.vectors[MOMENTUM, k]


@called
def add_momenta(system, sign, state, work, left):
    """work.momentum += sign M y', as the difference of what is left of two accelerations."""
    for there in (0.0, 1.0):
        for k in range(left.shape[0]):
            state[k, 2] += there * state[k, 1]
        evaluate(system, state, work, left)
        for k in range(left.shape[0]):
            work.vectors[MOMENTUM, k] += sign * (2.0 * there - 1.0) * left[k]
    for k in range(left.shape[0]):
        state[k, 2] -= state[k, 1]


@called
def lacking(newmark):
    """How far beta of a scheme of Newmark's is below that which has no limit of its step."""
    return max(0.0, 0.25 * (newmark.gamma + 0.5) ** 2 - newmark.beta)


@called
def begin(system, t, pace, state, work, left):
    """The moves that begin at a time, and accelerations for their loads."""
    load_at(system, t, work)
    for k in range(left.shape[0]):
        work.vectors[EXTRA, k] = 0.0
        work.vectors[SOFT, k] = pace.lacking * system.springs[k, 0]
    if pace.lacking > 0.0:
        for when in (t + pace.until, t):
            plan_at(system, when, work)
            evaluate(system, state, work, left)
            prepare(system, 0.0, 0.0, work)
            hold_back(system, work)
    for k in range(left.shape[0]):
        work.vectors[EXTRA, k] = pace.lacking * system.springs[k, 0] - work.vectors[SOFT, k]
    plan_at(system, t, work)
    evaluate(system, state, work, left)
    prepare(system, 0.0, 0.0, work)
    for _ in range(STARTING):
        evaluate(system, state, work, left)
        solve(system, work, left)
        for k in range(left.shape[0]):
            state[k, 2] -= left[k]
    for k in range(left.shape[0]):
        work.vectors[BEFORE, k] = state[k, 2]
    work.newton[0] = 1.0


@called
def hold_back(system, work):
    """Take coordinates out of those that are slow enough for the step, one after another, until these are stable
    together: lacking h^2 k of them, SOFT, has no eigenvalue above ``WITHIN`` beside the inertia that is prepared."""
    soft, vector, change = work.vectors[SOFT], work.vectors[MOMENTUM], work.vectors[CHANGE]
    for k in range(soft.shape[0]):
        vector[k] = 1.0 / (1.0 + k % 7)
    steady = 0
    while steady < POWERS:
        for k in range(soft.shape[0]):
            change[k] = soft[k] * vector[k]
        solve(system, work, change)
        above, below, worst, most = 0.0, 0.0, 0, -1.0
        for k in range(soft.shape[0]):
            above += change[k] * soft[k] * change[k]
            below += change[k] * soft[k] * vector[k]
            if soft[k] * change[k] ** 2 > most:
                worst, most = k, soft[k] * change[k] ** 2
        if above > WITHIN * below:  # a quotient of Rayleigh's: the eigenvalue is no smaller
            soft[worst], steady = 0.0, -1
        size = np.sqrt(above)
        if size == 0.0:
            return
        for k in range(soft.shape[0]):
            vector[k] = change[k] / size
        steady += 1


@called
def step(system, t, pace, state, work, left, energy):
    """One step to a time: the largest elastic energy so far, and whether Newton's method came close enough."""
    plan_at(system, t, work)
    before = 0.0
    foretell(pace, state, work)
    for corrected in range(MOST_CORRECTIONS + 1):
        evaluate(system, state, work, left)
        if corrected in (0, REUSED):
            prepare(system, pace.of_rate, pace.of_place, work)
        done = correct(system, state, pace, work, left)
        energy = max(energy, elastic_energy(system, state))
        if corrected > 0:
            work.newton[0] = done / before
        if done * min(1.0, work.newton[0]) <= pace.close * energy:
            work.newton[0] *= GROWS
            return energy, True
        if not np.isfinite(done):
            return done, False
        before = done
    return energy, False


@called
def foretell(pace, state, work):
    """Coordinates a step on, with accelerations that go on as they did."""
    h = pace.step
    for k in range(state.shape[0]):
        now = state[k, 2]
        more = now - work.vectors[BEFORE, k]
        work.vectors[BEFORE, k] = now
        state[k, 0] += h * state[k, 1] + 0.5 * h * h * now + pace.of_place * more
        state[k, 1] += h * now + pace.of_rate * more
        state[k, 2] += more


@called
def correct(system, state, pace, work, left):
    """One correction by what is left; the work that it does."""
    for k in range(state.shape[0]):
        work.vectors[CHANGE, k] = left[k]
    solve(system, work, work.vectors[CHANGE])
    done = 0.0
    for k in range(state.shape[0]):
        done += abs(work.vectors[CHANGE, k] * left[k])
        state[k, 2] -= work.vectors[CHANGE, k]
        state[k, 1] -= pace.of_rate * work.vectors[CHANGE, k]
        state[k, 0] -= pace.of_place * work.vectors[CHANGE, k]
    return done * pace.of_place


@called
def observe(system, t, state, work, left, record, station):
    """A station of the record."""
    evaluate(system, state, work, left)
    if system.missed.shape[1] > 0:
        give(system, work.grips)
    for k in range(state.shape[0]):
        record.coordinates[station, k, 3] = t
        for order in range(3):
            record.coordinates[station, k, order] = state[k, order]
    for r in range(work.robots.shape[0]):
        seen, robot = record.robots[station, r], work.robots[r]
        for j in range(system.counts[r, JOINTS]):
            record.drive[station, r, j] = work.links[r, j, DRIVE]
        missing, turn = sink(system, r, work, record.grips[station, r])
        lever = add(shared_vector(work.robots, r, ACTUAL_TOOL), times(-1.0, shared_vector(work.links[r], 0, PLACE)))
        beyond = add(missing, cross(turn, lever))
        for k in range(3):
            seen[SEEN_PLANNED + k] = robot[PLANNED_TOOL + k]
            seen[SEEN_ACTUAL + k] = robot[ACTUAL_TOOL + k] + beyond[k]
        for k in range(work.six.shape[1]):
            seen[SEEN_WRENCH + k] = robot[WRENCH + k]


@called
def pass_by(state, record, station, passed):
    """What is kept of every step, out of what is observed."""
    for k in range(record.bent.shape[1]):
        record.bent[passed, k] = state[k, 0]
    for r in range(record.passed.shape[1]):
        own, seen, grips = record.passed[passed, r], record.robots[station, r], record.grips[station, r]
        for k in range(3):
            own[OFF + k] = seen[SEEN_ACTUAL + k] - seen[SEEN_PLANNED + k]
        for g in range(2):
            for k in range(OF_GRIP):
                own[PASSED_GRIPS + OF_GRIP * g + k] = grips[g, k]
        for j in range(record.drive.shape[2]):
            own[PASSED + j] = record.drive[station, r, j]


@called
def sink(system, r, work, seen):
    """What rails do under robot r, into seen (2, OF_GRIP); motion and rotation of its base that their modes miss."""
    base = work.six[MISSED_THERE]
    for o in range(work.six.shape[1]):
        base[o] = 0.0
    for g in range(2):
        grip = work.grips[r, g]
        if system.body[r, g] >= 0:
            seen[g, SUNK] = -(grip[MISSING + 2] + grip[UP_THERE])
            seen[g, ALONG] = system.ends[system.body[r, g], int(grip[ELEMENT])] + grip[INTO]
            for o in range(work.six.shape[1]):
                seen[g, o] = grip[GRIP + o]
                for i in range(work.six.shape[1]):
                    base[o] += system.share[r, g, o, i] * grip[MISSING + i]
    return (base[0], base[1], base[2]), (base[3], base[4], base[5])
