"""When what swings on after a stop has come within a band for good, and how far that is known."""

import numpy as np

from results_schema.arrays import Array, Mask

#: Parts of a band by which readings may be off, of which errors of times are told. Of 4,800 passages at 1e-2 and 1e-3
#: 0 to 2.6 % were further off than told; by neighbours' own, which know nothing of a swing more or less, 1 to 9 %.
WIDER = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
STILL = 1e-9  # of its band: what a sensor is off where nothing swings is rounding
MOST_OF_TIMES = 1.0  # of a settling time: a larger error says no more than that there is no estimate


def names_of_times(sensor: str) -> tuple[str, str]:
    """The results that tell when a sensor has settled: after the stop, and since time 0."""
    return f"{sensor}_settling_time", f"{sensor}_move_and_settle_time"


def parts_of_bands() -> Array:
    """(1 + 2 W,) a band itself, those that are wider, and those that are narrower, as parts of it."""
    wider = np.array(WIDER)
    return np.concatenate([[1.0], 1.0 + wider, 1.0 - wider])


def split(times: Array) -> tuple[Array, Array]:
    """Times (1 + 2 W, V) in these bands: (V,) in the band itself, and (V, 2, W) in the others."""
    own, *others = times
    return own, np.moveaxis(np.reshape(others, (2, len(WIDER), -1)), 2, 0)


def change_within(others: Array, parts: Array, took: Array) -> Array:
    """(V,) by how much a settling time changes at most where its band is wider or narrower by parts of it (V,), from
    the times in `others` (V, 2, W); NaN where that is more than is known, or it has not settled in the narrower one."""
    times = np.concatenate([others, np.full((took.size, 2, 1), np.nan)], axis=2)
    place = np.searchsorted(WIDER, np.where(np.isnan(parts), np.inf, parts))
    return np.asarray(np.abs(times[np.arange(took.size), :, place] - took[:, None]).max(axis=1))


def told_part(change: Array, took: Array, stays: Mask) -> Array:
    """(V,) the error of a time as a part of it: 0 of what surely stays within its band from the stop on, NaN where no
    estimate exists: also of what stays within, of a rest that is too short to tell."""
    part = np.divide(change, took, out=np.where(change == 0.0, 0.0, np.inf), where=took > 0.0)
    part[stays] = 0.0
    return np.where((part <= MOST_OF_TIMES) & ~np.isnan(took), part, np.nan)
