"""What few pilots tell of errors that nothing else is measured of, such as those by modes that a study fixes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from engine.accuracy.neighbour_errors import margin_of, nearest_others
from engine.kernels.nearest_pilots import nearest
from results_schema.arrays import Array

# Measured over 114 scenes with 2 or 6 to 8 swept numbers (see `tests.calibration.fixed_modes`): by 3 or 6 of 16 pilots
# as many errors were told too small; up to twice the largest a tenth fewer, by a median that is 7 to 18 % larger.
NEAREST = 4  # pilots that tell a variant
MOST = 1.5  # times the largest error of all pilots, beyond which nothing is told


@dataclass(frozen=True, eq=False)
class FewPilots:
    """Swept numbers (P,) of pilots by dotted key, and their errors (R, P), NaN where one has no estimate."""

    columns: Mapping[str, Array]
    error: Array

    def told(self, columns: Mapping[str, Array], size: int) -> Array:
        """(R, V) errors of so many variants by their swept numbers: the largest of their nearest pilots' times what
        pilots' own are larger than their neighbours tell, but for a few; NaN where no pilot has an estimate. Of what is
        a pilot itself its own."""
        near, places = np.empty((size, min(NEAREST, self.error.shape[1])), dtype=np.int32), self._places(columns, size)
        nearest(places, self._pilots, near)
        largest = np.fmax.reduce(self.error, axis=1)[:, None]
        found = np.fmin(self._margin * np.fmax.reduce(self.error[:, near], axis=2), MOST * largest)
        own = self.error[:, near[:, 0]]
        is_pilot = np.all(places == self._pilots.T[near[:, 0]], axis=1) & ~np.isnan(own)
        return np.asarray(np.where(is_pilot, own, found))

    @cached_property
    def _pilots(self) -> Array:
        """(D, P) their places."""
        return np.ascontiguousarray(self._places(self.columns, self.error.shape[1]).T)

    @cached_property
    def _margin(self) -> float:
        """One for all results, as few pilots tell little of each."""
        others = nearest_others(self._pilots, NEAREST)
        if not others.shape[1]:
            return 1.0
        return margin_of(self.error, np.fmax.reduce(self.error[:, others], axis=2))

    def _places(self, columns: Mapping[str, Array], size: int) -> Array:
        """(V, D) places from 0 to 1 between those of the pilots, by cube roots as in `engine.accuracy.choice`."""
        found = [np.zeros(size)]
        for path, column in self.columns.items():
            own, roots = np.cbrt(column), np.cbrt(np.asarray(columns[path], dtype=np.float64))
            low, high = own.min(), own.max()
            if low < high:
                found.append((roots - low) / (high - low))
        return np.stack(found, axis=1)
