"""Statuses of many variants at once."""

import numpy as np
from numpy.typing import NDArray

from results_schema.status import GRAVEST, LOST, Status

_PLACES = np.argsort(GRAVEST)  # of each status among them


def gravest(*statuses: NDArray[np.int8] | Status) -> NDArray[np.int8]:
    """The status that counts, where several of each variant apply.

    >>> gravest(np.array([7, 7, 5]), np.array([0, 1, 3])).tolist()
    [7, 1, 5]
    """
    places = np.minimum.reduce(np.broadcast_arrays(*(_PLACES[np.asarray(status)] for status in statuses)))
    return np.array(GRAVEST, dtype=np.int8)[places]


def lost(status: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Where no values are kept.

    >>> lost(np.array([3, 4, 7])).tolist()
    [False, True, False]
    """
    return np.isin(status, LOST)
