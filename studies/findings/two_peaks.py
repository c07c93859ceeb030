"""Where the pattern of a slow cycle, two peaks or as many as all slow variants have, breaks."""

import numpy as np

from results_schema.arrays import Array, Mask
from studies.findings import theory
from studies.results.axes import PACES
from studies.results.places import Index
from studies.results.results import Results

EXPECTED = 2  # peaks of a shuttle between both ends, seen at midspan


def slowest(results: Results, ratio: Array) -> Mask:
    """Variants at the lowest frequency of the motion; ratio: to the first natural one, in the sweep's shape."""
    axis = results.axis(*PACES)
    along = ratio if axis is None else results.everywhere(results.dataset[axis.name])
    return np.asarray(along == along.min())


def pattern(results: Results, sensor: str) -> int:
    """The number of peaks of all variants at the lowest frequency; two where these differ."""
    counts, ratio = results.numbers("peaks_per_cycle", sensor), results.everywhere(theory.frequency_ratio(results))
    found = np.unique(counts[slowest(results, ratio) & np.isfinite(counts)])
    return int(found[0]) if found.size == 1 else EXPECTED


def peaks_in_words(count: int) -> str:
    """A number of peaks.

    >>> peaks_in_words(1), peaks_in_words(2), peaks_in_words(3)
    ('one peak', 'two peaks', '3 peaks')
    """
    return {1: "one peak", 2: "two peaks"}.get(count, f"{count} peaks")


def first_break(results: Results, sensor: str) -> Index | None:
    """The variant with another number of peaks at the lowest frequency ratio; None where there is none, or none has as
    many as the slowest below it."""
    counts, ratio = results.numbers("peaks_per_cycle", sensor), results.everywhere(theory.frequency_ratio(results))
    known = np.isfinite(counts)
    other = known & (counts != pattern(results, sensor))
    first = float(ratio[other].min()) if other.any() else -np.inf
    if (slowest(results, ratio) & other).any() or not (known & (ratio < first)).any():
        return None
    return tuple(int(i) for i in np.argwhere(other & (ratio == first))[0])
