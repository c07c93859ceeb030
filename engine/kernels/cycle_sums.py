"""Sums over both ways of a cycle, of which asymmetry is made."""

from engine.kernels.jit import kernel


@kernel
def add_legs(weight, forward, backward, static, rise, sums):
    """Add to sums (5, V) the weighted sums over stations of  rise^2, odd rise, 2 odd, odd^2 and excess^2.

    weight (H,);  forward, backward f and b, static w_s and its rise w_s' (H, V):  odd = (f - b)/2,
    excess = (f + b)/2 - w_s.
    """
    for n in range(weight.shape[0]):
        for j in range(sums.shape[1]):
            odd = 0.5 * (forward[n, j] - backward[n, j])
            excess = 0.5 * (forward[n, j] + backward[n, j]) - static[n, j]
            sums[0, j] += weight[n] * (rise[n, j] * rise[n, j])
            sums[1, j] += weight[n] * (odd * rise[n, j])
            sums[2, j] += weight[n] * (2.0 * odd)
            sums[3, j] += weight[n] * (odd * odd)
            sums[4, j] += weight[n] * (excess * excess)
