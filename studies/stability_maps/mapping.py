"""What a map is: a question about a method, computed by running it, with the theory beside."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, Field, Strict

from engine.study_file.spec import Spec, distinct
from results_schema.lazy_imports import xr
from results_schema.variables import Variable, axes
from studies.protocol.parts import Work
from studies.results.formatting import number
from studies.stability_maps.map_scene import Ground

Part = Annotated[float, Field(gt=0, le=100)]
Parts = Annotated[tuple[Part, ...], Strict(False), Field(min_length=1, max_length=40), AfterValidator(distinct)]
ModeCount = Annotated[int, Field(ge=1, le=40)]
ModeCounts = Annotated[
    tuple[ModeCount, ...], Strict(False), Field(min_length=1, max_length=40), AfterValidator(distinct)
]
Names = Annotated[tuple[str, ...], Strict(False), Field(min_length=1)]


class Asked(Spec):
    """The table [question]: which maps, over what, and how finely.

    mass_ratios: carriage over body mass, for separation. mode_counts, relative_steps: for lagged inertia, omega_1 h.
    alias_mode_counts, speed_ratios: for the alias rule, speeds over omega_1 L/pi. fineness: of the axes that are
    scanned, 1 for the built-in number of points.
    """

    maps: Names = ("schemes", "lagged-inertia", "alias", "shuttle", "frozen", "separation", "overshoot", "rigid-tie")
    mass_ratios: Parts = (0.1, 0.25, 0.5, 1.0, 2.0)
    speed_ratios: Parts = (0.02, 0.05, 0.1, 0.2, 0.3)
    mode_counts: ModeCounts = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20)
    alias_mode_counts: ModeCounts = (5, 8, 12, 16)
    relative_steps: Parts = (0.01, 0.1, 1.0)
    fineness: Annotated[float, Field(gt=0, le=4)] = 1.0

    def points(self, count: int) -> int:
        """So many points of a scanned axis, by the fineness, at least 5."""
        return max(5, round(count * self.fineness))


@dataclass(frozen=True)
class Map:
    """One map.

    name: as in the study file. words: what it does. seconds: expected, as two fast cores took. outputs: what its
    dataset holds, besides the axes that several kinds of study have. compute: the dataset. sentences: what it says,
    from its own dataset.
    """

    name: str
    words: str
    seconds: Callable[[Asked], float]
    outputs: tuple[Variable, ...]
    compute: Callable[[Ground, Asked, Work], xr.Dataset]
    sentences: Callable[[xr.Dataset], list[str]]


def dataset_of(
    declared: tuple[Variable, ...], along: Mapping[str, Any], values: Mapping[str, Any], marched: tuple[int, int]
) -> xr.Dataset:
    """The dataset of a map from its declarations, the values along its axes and those over them, by name.

    What is infinite becomes NaN. marched: the largest numbers of modes and steps, kept as the attributes most_modes and
    most_steps.
    """
    known = axes() | {variable.name: variable for variable in declared}
    coords = {name: known[name].holding(found, (name,)) for name, found in along.items()}
    data = {name: known[name].holding(_finite(found)) for name, found in values.items()}
    return xr.Dataset(data, coords, dict(zip(("most_modes", "most_steps"), marched, strict=True)))


def times(growth: float, digits: int = 3) -> str:
    """A growth in words.

    >>> times(1.234567), times(float("inf"))
    ('1.23 times', 'beyond all numbers')
    """
    return f"{number(growth, digits)} times" if math.isfinite(growth) else "beyond all numbers"


def _finite(values: Any) -> Any:
    """Numbers with NaN in place of what a march has blown up beyond all numbers."""
    import numpy as np

    array = np.asarray(values, dtype=np.float64)
    return np.where(np.isinf(array), np.nan, array)
