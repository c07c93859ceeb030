"""Whether a resonance under loads in a row may lie between the speeds of a sweep."""

from collections import Counter

import numpy as np

from studies.results.axes import VARIANT, Axis
from studies.results.formatting import ALIKE, percent
from studies.results.results import Results

FEWEST = 3  # loads from which on a row of them builds a resonance up


def told_between_speeds(results: Results) -> str:
    """That peaks may be higher between swept speeds, as a sentence behind another; "" where no loads in a row cross a
    body of known damping, or speeds stand no farther apart than a resonance is wide: between its half-power points
    2 zeta of its speed, zeta the lowest damping ratio of the sweep."""
    axis = results.axis(".motion.speed")
    if axis is None or axis.dim == VARIANT or not (ratios := _damping(results, axis)):
        return ""
    zeta, speeds = min(ratios), np.unique(axis.values)
    apart = np.diff(speeds)
    if zeta <= 0.0 or (apart <= (1.0 + ALIKE) * zeta * (speeds[1:] + speeds[:-1])).all():
        return ""
    even = np.ptp(apart) <= ALIKE * apart.max()
    return (
        f" Speeds stand {'' if even else 'up to '}{axis.in_words(float(apart.max()))} apart; a resonance at "
        f"{percent(zeta)} damping is about {percent(2.0 * zeta)} of its speed wide, so peaks between them may be "
        "higher: sweep more closely around the highest."
    )


def _damping(results: Results, speed: Axis) -> list[float]:
    """The lowest damping ratio of every body that a row of loads crosses whose speed an axis sets; none where each mode
    has its own."""
    moved = [results.study.carriage[path.split(".")[1]] for path in speed.paths if path.startswith("carriage.")]
    loads = Counter(carriage.on for carriage in moved if carriage.motion.passes)
    crossed = [name for name, count in loads.items() if count >= FEWEST]
    known = [name for name in crossed if isinstance(results.study.body[name].damping_ratio, float)]
    return [float(np.min(results.parameter(f"body.{name}.damping_ratio"))) for name in known]
