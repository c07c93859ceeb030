"""The largest of values that are known at equal steps, and what may be missed between these."""

import numpy as np

from engine.kernels.jit import kernel


@kernel
def largest(values, own, stretch, value, missed):
    """The largest (C,) of values (T, C), of those among them that are its ``own`` (T, C), whole stretches, with a
    parabola through the three highest of a stretch (T,); missed (C,): what that adds."""
    most = np.full(value.size, -np.inf)
    value[:] = -np.inf
    last = stretch.size - 1
    for t in range(last + 1):
        inside = 0 < t < last and stretch[t - 1] == stretch[min(t + 1, last)]
        for c in range(value.size):
            top = values[t, c]
            if own[t, c]:
                most[c] = max(most[c], top)
                if inside:
                    low, high = values[t - 1, c], values[t + 1, c]
                    bent = 2.0 * top - low - high
                    if top >= low and top >= high and bent > 0.0:
                        value[c] = max(value[c], top + (low - high) ** 2 / (8.0 * bent))
    for c in range(value.size):
        value[c] = max(value[c], most[c])
        missed[c] = value[c] - most[c] if most[c] > -np.inf else 0.0
        if most[c] == -np.inf:
            value[c] = np.nan
