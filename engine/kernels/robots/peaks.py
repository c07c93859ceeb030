"""The largest of values that are known at equal steps, and what may be missed between these."""

import numpy as np

from engine.kernels.jit import kernel


@kernel
def largest(values, own, stretch, value, missed):
    """The largest (C,) of values (T, C), of those among them that are its ``own`` (T, C), with a parabola through the
    three highest of a stretch (T,); missed (C,): above."""
    most, beyond = np.full(value.size, -np.inf), np.full(value.size, -np.inf)
    value[:] = -np.inf
    last = stretch.size - 1
    for t in range(last + 1):
        goes_on = t < last and stretch[min(t + 1, last)] == stretch[t]
        inside = goes_on and t > 0 and stretch[t - 1] == stretch[t]
        for c in range(value.size):
            top = values[t, c]
            if own[t, c]:
                most[c] = max(most[c], top)
                if inside and own[t - 1, c] and own[t + 1, c]:
                    low, high = values[t - 1, c], values[t + 1, c]
                    bent = 2.0 * top - low - high
                    if top >= low and top >= high and bent > 0.0:
                        value[c] = max(value[c], top + (low - high) ** 2 / (8.0 * bent))
            if goes_on and own[t, c] != own[t + 1, c]:
                beyond[c] = max(beyond[c], top, values[t + 1, c])
    for c in range(value.size):
        value[c] = max(value[c], most[c])
        missed[c] = max(value[c], beyond[c]) - most[c] if most[c] > -np.inf else 0.0
        if most[c] == -np.inf:
            value[c] = np.nan
