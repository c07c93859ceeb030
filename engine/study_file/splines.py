"""Cubic splines that are at rest at both ends, for whole columns of positions."""

from __future__ import annotations

from typing import Any

import numpy as np

from results_schema.arrays import Array


def spline_at_rest(times: Array, positions: Array) -> Any:
    """The C2 cubic spline through positions (K,) or (K, V) at ascending times (K,), of zero slope at both ends."""
    from scipy.interpolate import CubicSpline

    return CubicSpline(times, positions, bc_type="clamped")


def spline_range(times: Array, positions: Array) -> tuple[Array, Array]:
    """Smallest and largest value of splines at rest at both ends: times (K,), positions (K, V) -> (V,), (V,).

    The extremes lie at knots or where the quadratic derivative of a piece is zero.
    """
    spline = spline_at_rest(times, positions)
    low, high = positions.min(axis=0), positions.max(axis=0)
    c3, c2, c1, c0 = spline.c
    spans = np.diff(times)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(c2**2 - 3.0 * c3 * c1)
        stable = -(c2 + np.copysign(root, c2))
        for inner in (stable / (3.0 * c3), c1 / stable):
            value = ((c3 * inner + c2) * inner + c1) * inner + c0
            valid = (inner > 0.0) & (inner < spans)
            low = np.minimum(low, np.where(valid, value, np.inf).min(axis=0))
            high = np.maximum(high, np.where(valid, value, -np.inf).max(axis=0))
    return low, high


def spline_touches(length: Any, *numbers: Any) -> Any:
    """Whether splines through positions at times, both as columns, have a part on the body."""
    columns = np.broadcast_arrays(length, *numbers)
    shape, flat = columns[0].shape, np.array([column.ravel() for column in columns], dtype=np.float64)
    places, times = np.split(flat[1:], 2)
    verdict = np.zeros(flat.shape[1], dtype=bool)
    sets, member = np.unique(times, axis=1, return_inverse=True)
    for index in range(sets.shape[1]):
        chosen = np.flatnonzero(np.ravel(member) == index)
        low, high = spline_range(sets[:, index], places[:, chosen])
        verdict[chosen] = (high > 0.0) & (low < flat[0, chosen])
    return verdict.reshape(shape)
