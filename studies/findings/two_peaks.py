"""Where the pattern of two peaks per cycle breaks."""

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


def first_break(results: Results, sensor: str) -> Index | None:
    """The variant with another number of peaks at the lowest frequency ratio; None where there is none, or none has two
    below it."""
    counts, ratio = results.numbers("peaks_per_cycle", sensor), results.everywhere(theory.frequency_ratio(results))
    known = np.isfinite(counts)
    other = known & (counts != EXPECTED)
    first = float(ratio[other].min()) if other.any() else -np.inf
    if (slowest(results, ratio) & other).any() or not (known & (ratio < first)).any():
        return None
    return tuple(int(i) for i in np.argwhere(other & (ratio == first))[0])
