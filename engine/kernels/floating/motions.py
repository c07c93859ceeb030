"""Motions and forces that are given in time: pieces of polynomials and sines."""

import numpy as np

from engine.kernels.jit import called


@called
def motions_at(pieces, t, within, out):
    """Value, rate and acceleration (M, 3) of motions (M, pieces, 10) at a time, by the pieces that hold at ``within``,
    which lies on that side of the time from which a limit is wanted."""
    for m in range(pieces.shape[0]):
        first, last = 0, pieces.shape[1]
        while last - first > 1:
            middle = (first + last) // 2
            if pieces[m, middle, 0] <= within:
                first = middle
            else:
                last = middle
        c = pieces[m, first]
        x = max(t - c[0], 0.0)
        sine, cosine, rate = c[7] * np.sin(c[8] * x + c[9]), c[7] * np.cos(c[8] * x + c[9]), c[8]
        out[m, 0] = c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * (c[5] + x * c[6])))) + sine
        out[m, 1] = c[2] + x * (2.0 * c[3] + x * (3.0 * c[4] + x * (4.0 * c[5] + x * 5.0 * c[6]))) + rate * cosine
        out[m, 2] = 2.0 * c[3] + x * (6.0 * c[4] + x * (12.0 * c[5] + x * 20.0 * c[6])) - rate * rate * sine
