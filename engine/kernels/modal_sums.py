"""Sums over modes at stations of a track."""

from engine.kernels.jit import kernel


@kernel
def sums_over_modes(left, right, soft, found):
    """found (stations,): at each station the sum over the modes of left times right (stations or 1, modes) times soft
    (modes,), in four parts."""
    modes = soft.size
    for s in range(found.size):
        i, j = min(s, left.shape[0] - 1), min(s, right.shape[0] - 1)
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for k in range(0, modes - 3, 4):
            a += left[i, k] * right[j, k] * soft[k]
            b += left[i, k + 1] * right[j, k + 1] * soft[k + 1]
            c += left[i, k + 2] * right[j, k + 2] * soft[k + 2]
            d += left[i, k + 3] * right[j, k + 3] * soft[k + 3]
        for k in range(modes - modes % 4, modes):
            a += left[i, k] * right[j, k] * soft[k]
        found[s] = (a + b) + (c + d)
