"""Displacements and rotations along the track of a body in a floating frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from results_schema.arrays import Array

AXES = 6  # displacements x, y, z and rotations about them
X, Y, Z, ABOUT_X, ABOUT_Y, ABOUT_Z = range(AXES)


class Along(Protocol):
    """Displacements and rotations along a track."""

    def fields(self, x: Array, orders: Sequence[int]) -> Array:
        """(orders, S, 6, N) derivatives by x of displacements and rotations of every mode at places (S,) m."""
