"""What a study may compute from the histories of a chunk while they are in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engine.law import Motion
from engine.scene import Study

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Cycle:
    """Histories of one chunk over the last cycle of a periodic motion, or over the whole run.

    phase (H,): 0 <= phase < 1, equidistant where the step count allows;  position (H,): of the first carriage, m;
    history (H, J, V): sensors in the study's order, SI, V variants;  static (H, J, V): static response of the same
    model at the same positions;  static_slope (H, J, V): its derivative by the first carriage's position.
    """

    phase: Array
    position: Array
    history: Array
    static: Array
    static_slope: Array
    motion: Motion


class Reduction(Protocol):
    """A study's results of one variant, from its cycle alone; called on chunks of variants."""

    @property
    def stations(self) -> int:
        """Stations per cycle that are wanted at least, where there are so many steps."""

    def outputs(self, study: Study) -> Mapping[str, tuple[str, ...]]:
        """Names of the results with the dimensions beyond the variant."""

    def sizes(self, study: Study) -> Mapping[str, int]:
        """Lengths of those dimensions."""

    def __call__(self, cycle: Cycle) -> dict[str, Array]:
        """The results, each (V, ...)."""
