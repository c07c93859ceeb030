"""Prescribed motions as tuples of phases with exact derivatives."""

import math
from collections.abc import Sequence

from tests.naive.scene import Phase


def cruise(start: float, end: float, speed: float, begin: float = 0.0) -> tuple[Phase, ...]:
    """Constant speed > 0 (m/s) from start to end (m), backward where end < start, beginning at time `begin`."""
    velocity = math.copysign(speed, end - start)
    return (
        Phase(
            begin,
            begin + abs(end - start) / speed,
            lambda t: start + velocity * (t - begin),
            lambda t: velocity,
            lambda t: 0.0,
        ),
    )


def sinusoidal(centre: float, amplitude: float, circular: float, cycles: float) -> tuple[Phase, ...]:
    """s = centre + amplitude sin(Om t) with Om in rad/s."""
    return (
        Phase(
            0.0,
            2.0 * math.pi * cycles / circular,
            lambda t: centre + amplitude * math.sin(circular * t),
            lambda t: amplitude * circular * math.cos(circular * t),
            lambda t: -amplitude * circular**2 * math.sin(circular * t),
        ),
    )


def _turn(at: float, depth: float, speed: float, begin: float, middle: float) -> Phase:
    """Half a turn at the end `at`: s = at + depth (1 - cos(pi u / t_r)), u from the turn's middle, t_r = pi |depth|/v.

    depth is signed into the stroke; the half lasts t_r/2, and at its outer edge the speed is v and s'' is 0.
    """
    rate = speed / abs(depth)
    return Phase(
        begin,
        begin + 0.5 * math.pi / rate,
        lambda t: at + depth * (1.0 - math.cos(rate * (t - middle))),
        lambda t: depth * rate * math.sin(rate * (t - middle)),
        lambda t: depth * rate**2 * math.cos(rate * (t - middle)),
    )


def out_and_back(start: float, end: float, speed: float, turn: float, cycles: int) -> tuple[Phase, ...]:
    """There and back `cycles` times; at each end the speed turns as a cosine over `turn` (> 0) of the stroke.

    It begins at rest at `start`, in the middle of a turn. One cycle lasts 2 (stroke - 2 d)/v + 2 pi d/v with
    d = turn x stroke, and the two halves of a turn are separate phases without a jump between them.
    """
    depth = turn * (end - start)
    half = 0.5 * math.pi * abs(depth) / speed
    phases: list[Phase] = []
    t = 0.0
    for _ in range(cycles):
        for here, there, into in ((start, end, depth), (end, start, -depth)):
            phases.append(_turn(here, into, speed, t, t))
            t += half
            phases.extend(cruise(here + into, there - into, speed, t))
            t = phases[-1].end
            phases.append(_turn(there, -into, speed, t, t + half))
            t += half
    return joined(phases)


def point_to_point(start: float, end: float, parts: Sequence[tuple[float, float, float]]) -> tuple[Phase, ...]:
    """From start to end by parts of some length (s), each with the acceleration of a move of unit length at its
    beginning and its jerk, added up one after the other."""
    phases: list[Phase] = []
    way, t, s, v = end - start, 0.0, 0.0, 0.0
    for length, a, j in parts:
        phases.append(
            Phase(
                t,
                t + length,
                lambda x, t=t, s=s, v=v, a=a, j=j: (
                    start + way * (s + v * (x - t) + a * (x - t) ** 2 / 2 + j * (x - t) ** 3 / 6)
                ),
                lambda x, t=t, v=v, a=a, j=j: way * (v + a * (x - t) + j * (x - t) ** 2 / 2),
                lambda x, t=t, a=a, j=j: way * (a + j * (x - t)),
            )
        )
        s, v = s + v * length + a * length**2 / 2 + j * length**3 / 6, v + a * length + j * length**2 / 2
        t += length
    return joined(phases)


def instant_out_and_back(start: float, end: float, speed: float, cycles: int) -> tuple[Phase, ...]:
    """There and back `cycles` times at constant speed; s' changes its sign at once at both ends."""
    phases: list[Phase] = []
    t = 0.0
    for _ in range(cycles):
        phases.extend(cruise(start, end, speed, t))
        phases.extend(cruise(end, start, speed, phases[-1].end))
        t = phases[-1].end
    return joined(phases)


def shifted(phase: Phase, delay: float) -> Phase:
    """The same piece of motion `delay` seconds later."""
    return Phase(
        phase.start + delay,
        phase.end + delay,
        lambda t: phase.s(t - delay),
        lambda t: phase.ds(t - delay),
        lambda t: phase.dds(t - delay),
    )


def joined(phases: Sequence[Phase]) -> tuple[Phase, ...]:
    """Phases whose ends are bitwise the starts of the next, so that no instant falls between two of them."""
    ends = [after.start for after in phases[1:]] + [phases[-1].end]
    return tuple(Phase(p.start, end, p.s, p.ds, p.dds) for p, end in zip(phases, ends, strict=True))
