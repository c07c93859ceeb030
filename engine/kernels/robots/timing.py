"""What robots are told at a time: joints with their rates and accelerations, what they do, and what they carry."""

from engine.kernels.jit import called
from engine.kernels.robots.layout import (
    HOLDS,
    JERK,
    MOVES,
    MOVES_TOLD,
    PLANNED,
    PUSH,
    RAMP,
    RATE,
    START,
    STEADY,
    UP,
    VALUE,
    WORKS,
)


@called
def speeding_up(profile, t):
    """Way, rate and acceleration at a time in the first half of a move of unit length."""
    jerk, ramp, up = profile[JERK], profile[RAMP], profile[UP]
    push = jerk * ramp
    if t <= ramp:
        return jerk * t**3 / 6.0, jerk * t**2 / 2.0, jerk * t
    way, rate = jerk * ramp**3 / 6.0, jerk * ramp**2 / 2.0
    if t <= up - ramp:
        s = t - ramp
        return way + rate * s + push * s**2 / 2.0, rate + push * s, push
    s = up - 2.0 * ramp
    way, rate = way + rate * s + push * s**2 / 2.0, rate + push * s
    s = min(t, up) - (up - ramp)
    way, rate, push = (
        way + rate * s + push * s**2 / 2.0 - jerk * s**3 / 6.0,
        rate + push * s - jerk * s**2 / 2.0,
        push - jerk * s,
    )
    if t > up:
        return way + rate * (t - up), rate, 0.0
    return way, rate, push


@called
def moved(profile, t):
    """The same at any time of the move, whose second half mirrors the first."""
    whole = 2.0 * profile[UP] + profile[STEADY]
    if t <= 0.5 * whole:
        return speeding_up(profile, t)
    way, rate, push = speeding_up(profile, max(whole - t, 0.0))
    return 1.0 - way, rate, -push


@called
def number_of(system, r, t):
    """How many moves of a robot have begun."""
    begun = 0
    while begun < system.counts[r, MOVES_TOLD] and t >= system.moves[r, begun, START]:
        begun += 1
    return begun


@called
def planned(system, r, t, begun, links):
    """Joints of a robot at a time, of whose moves ``begun`` have, into columns of links (J, COLUMNS); what it does."""
    J, stays = links.shape[0], system.stays[r]
    for j in range(J):
        links[j, PLANNED + VALUE], links[j, PLANNED + RATE], links[j, PLANNED + PUSH] = stays[begun, j], 0.0, 0.0
    if begun > 0:
        move = system.moves[r, begun - 1]
        since = t - move[START]
        if since < 2.0 * move[UP] + move[STEADY]:
            way, rate, push = moved(move, since)
            for j in range(J):
                before = stays[begun - 1, j]
                apart = stays[begun, j] - before
                links[j, PLANNED + VALUE] = before + apart * way
                links[j, PLANNED + RATE], links[j, PLANNED + PUSH] = apart * rate, apart * push
            return MOVES
    return WORKS if t <= stays[begun, J + 1] else HOLDS
