"""Swept numbers: where their values lie in a dataset, in the units that people typed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from results_schema.arrays import Array
from studies.results.formatting import Scale, axis_title, listed, swept_quantity, telling_digits, typed_unit

if TYPE_CHECKING:
    from engine.scene import sweep
    from engine.scene.study import Study

VARIANT = "variant"
PACES = (".motion.frequency", ".motion.speed")
DIRECTION = ".motion.direction"


def direction_in_words(value: float) -> str:
    """What a swept direction of a motion is called."""
    return "forward" if value > 0.0 else "backward"


@dataclass(frozen=True, eq=False)
class Axis:
    """One swept number: its dimension in the dataset, and its values (n,) along it, in SI units.

    targets: the numbers of the scene that it sets, by dotted key, each with the factor of the value.
    typed: the unit in which the study file has it, in which people read it again; None where it was typed without one.
    """

    name: str
    dim: str
    targets: Mapping[str, float]
    values: Array
    units: str
    typed: Scale | None = None

    @classmethod
    def of_scene(cls, study: Study, axis: sweep.Axis) -> Axis:
        """That of a study's sweep."""
        values = np.asarray(axis.values, dtype=np.float64)
        return cls(axis.name, axis.dim, axis.targets, values, axis.units, typed_unit(study, axis.name))

    @property
    def paths(self) -> tuple[str, ...]:
        """Dotted keys of the numbers that it sets."""
        return tuple(self.targets)

    def columns(self, entry: int) -> dict[str, float]:
        """What it sets at an entry of its values, by dotted key."""
        return {path: self.values[entry].item() * factor for path, factor in self.targets.items()}

    @property
    def noun(self) -> str:
        """Its name as a word; of the key of a place one that stands behind "at"."""
        return "place" if self.name == "at" else self.name.replace("_", " ")

    @property
    def title(self) -> str:
        """Name and unit as on a figure's axis."""
        return f"{self.noun} ({self.typed.unit})" if self.typed else axis_title(self.noun, self.units)

    @property
    def shown(self) -> Array:
        """(n,) its values in the unit of its title."""
        return self.values * self.factor

    @property
    def factor(self) -> float:
        """What turns its values (SI) into those of its title."""
        return self.typed.factor if self.typed else 1.0

    def in_words(self, value: float) -> str:
        """A value (SI) with its unit, or what it stands for."""
        if self.sets(DIRECTION):
            return direction_in_words(value)
        return swept_quantity(value, self.units, self.typed, self.digits)

    @cached_property
    def digits(self) -> int:
        """Significant digits of its values, where they are few enough to be told apart."""
        return 3 if self.dim == VARIANT else telling_digits(self.shown)

    @property
    def span(self) -> str:
        """Its smallest and largest value, or its one value, with their unit."""
        return self.spans([np.array([self.values.min(), self.values.max()])])

    def spans(self, parts: Sequence[Array]) -> str:
        """From the first to the last of each of some parts of its values, with their unit behind the last alone, where
        it is that of all."""
        ends = [[self.in_words(float(part[place])) for place in (0, -1)] for part in parts]
        units = {word.partition(" ")[2] for words in ends for word in words}
        unit = f" {units.pop()}" if units != {""} and len(units) == 1 else ""
        return listed([" to ".join(dict.fromkeys(word.removesuffix(unit) for word in words)) for words in ends]) + unit

    def value(self, index: int) -> str:
        """One value with its unit."""
        return self.in_words(float(self.values[index]))

    def at(self, index: int) -> str:
        """One value with name and unit."""
        return f"{self.noun} {self.value(index)}"

    @property
    def sets_motion(self) -> bool:
        """Whether it sets a number of a motion, or when one begins: what is there to choose."""
        return any(".motion." in path for path in self.paths) or self.sets("delay", "headway")

    def sets(self, *endings: str) -> bool:
        """Whether one of the keys that it sets ends so."""
        return any(f".{path}".endswith(ending) for path in self.paths for ending in endings)
