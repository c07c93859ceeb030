"""Types of arrays, as annotations name them, and the parts of one that have equal codes."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Mask = NDArray[np.bool_]


def split(items: Counts, codes: NDArray[np.signedinteger[Any]]) -> Iterator[Counts]:
    """Items by equal codes, both in ascending order."""
    if items.size and np.all(codes == codes[0]):
        yield items
        return
    order = np.argsort(codes, kind="stable")
    yield from np.split(items[order], np.flatnonzero(np.diff(codes[order])) + 1)
