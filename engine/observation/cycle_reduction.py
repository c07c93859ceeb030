"""What a study may compute from the histories of a chunk while they are in memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.scene.motions.base import Motion
    from engine.scene.study import Study
    from engine.scene.variants import VariantValues
    from results_schema.status import Fidelity


@dataclass(frozen=True, eq=False)
class Cycle:
    """Histories of one chunk over the last cycle of a periodic motion, or over the whole run.

    phase (H,): from 0 to 1, both with their own values, equidistant where the step count allows;  position (H,): of the
    first carriage, m;
    history (H, J, V): sensors in the study's order, SI, V variants.  find_static, find_slope: of what costs as much as
    a march where there are many stations, so that only those who want it pay for it.
    """

    phase: Array
    position: Array
    history: Array
    motion: Motion
    find_static: Callable[[], Array]
    find_slope: Callable[[], Array]

    @cached_property
    def static(self) -> Array:
        """(H, J, V) static response of the same model at the same positions."""
        return self.find_static()

    @cached_property
    def static_slope(self) -> Array:
        """(H, J, V) its derivative by the first carriage's position."""
        return self.find_slope()


#: Of what histories differ by that values on them may be off without differing: with none of it 40 % of the estimated
#: errors of 300 passages were too small, as two extremes agree by chance.
HISTORY_PART = 0.5


@dataclass(frozen=True, eq=False)
class Compared:
    """The results of V variants by two marches, by name. scale (V, J): the largest static value of every sensor. apart
    (J, V): by how much their histories differ, of which values on them count as off by a part. values: the study's
    numbers in these variants."""

    one: Mapping[str, NDArray[Any]]
    other: Mapping[str, NDArray[Any]]
    scale: Array
    apart: Array
    values: VariantValues
    part: float = HISTORY_PART

    def gap(self, name: str) -> Array:
        """|difference| of a result; 0 where neither has a number, NaN where only one has."""
        one, other = (np.asarray(part[name], dtype=np.float64) for part in (self.one, self.other))
        return np.where(np.isnan(one) & np.isnan(other), 0.0, np.abs(one - other))

    def of_readings(self, gap: Array) -> Array:
        """(V, J) a gap of values on histories over the scale, no less than a part of what these differ by."""
        return self.relative(np.maximum(gap, self.part * self.apart.T))

    def relative(self, gap: Array) -> Array:
        """(V, J) a gap (V, J) in the sensors' units over the scale; NaN where that is 0 and the gap is not."""
        flat = np.where(gap > 0.0, np.nan, gap)
        return np.divide(gap, self.scale, out=flat, where=self.scale > 0.0)


class Reduction(Protocol):
    """A study's results of one variant, from its cycle alone; called on chunks of variants."""

    @property
    def stations(self) -> int:
        """Stations per cycle that are wanted at least, besides the last, where there are so many steps."""

    @property
    def least_fidelity(self) -> Fidelity:
        """The lowest model that tells these results at all."""

    @property
    def compared(self) -> tuple[str, ...]:
        """Names of the results whose differences are told, in the order of `differences`."""

    def outputs(self, study: Study) -> Mapping[str, tuple[str, ...]]:
        """Names of the results with the dimensions beyond the variant."""

    def sizes(self, study: Study) -> Mapping[str, int]:
        """Lengths of those dimensions."""

    def __call__(self, cycle: Cycle) -> dict[str, Array]:
        """The results, each (V, ...)."""

    def differences(self, compared: Compared) -> Mapping[str, Array]:
        """How far two answers are apart, in the unit of the tolerance, (V, J) by the result's name; NaN where only one
        of them is a number."""
