"""Which swept numbers change no more than the units of time and force, so that their variants share one scene.

E I and rho A, and nothing else of a uniform beam that nothing elastic holds but its own ends, say how stiff and heavy
it is. Counted in a s and f N, with f = E I/(E I)_0 and a^2 = rho A/(rho A)_0/f, each variant has (E I)_0 and (rho A)_0;
lengths stay (dimensional analysis, Buckingham 1914). So all share the modes, tables and pilots of one beam; only the
numbers of carriages, of gravity and of time are a variant's own.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from math import prod
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from results_schema.arrays import Array

if TYPE_CHECKING:
    from engine.scene.sensors import Envelope, Sensor
    from engine.scene.study import Study


Keys = tuple[str, ...]


class UnitKeys(NamedTuple):
    """Keys of a study's numbers with which, set to one value, all stiffness grows in proportion, and all mass."""

    stiffness: tuple[Keys, ...] = ()
    mass: tuple[Keys, ...] = ()

    @classmethod
    def of(cls, study: Study) -> UnitKeys:
        """None where anything else has a stiffness or a course in time of its own."""
        readers: list[Sensor | Envelope] = [*study.sensor.values(), *study.envelope.values()]
        others = (study.frame, study.load, study.spring, study.arm, study.robot)
        if len(study.body) != 1 or any(others):
            return cls()
        (name, body), *_ = study.body.items()
        by_fibre = any(one.reads.needs_fibre for one in readers)  # stress is M z/I

        def alike(groups: tuple[Keys, ...]) -> Iterator[Keys]:
            for group in groups:
                keys = tuple(f"body.{name}.{key}" for key in group)
                if len({study.value(key) for key in keys}) == 1 and not (by_fibre and group == ("second_moment",)):
                    yield keys

        return cls(*(tuple(alike(groups)) for groups in body.grows_with))

    def set_by(self, axes: Iterable[Collection[str]]) -> set[str]:
        """Those of them that axes set, each the keys of one axis, as one value."""
        groups = (*self.stiffness, *self.mass)
        return {key for paths in axes for keys in groups if set(keys) <= set(paths) for key in keys}


class Units(NamedTuple):
    """(V,) the s and the N in which variants are counted."""

    time: Array
    force: Array

    @classmethod
    def of(cls, study: Study, columns: Mapping[str, Array]) -> Units | None:
        """Of variants by their swept numbers, in which each has the stiffness and the mass of the study; None where all
        have them. What stands in the study as in every variant has no part in it."""
        keys = UnitKeys.of(study)
        own = [[group[0] for group in groups if group[0] in columns] for groups in keys]
        if not any(own):
            return None
        stiffness, mass = (prod(columns[key] / float(study.value(key)) for key in some) for some in own)
        return cls(np.sqrt(mass / stiffness), np.asarray(stiffness * np.ones_like(mass)))

    def unit(self, exponents: tuple[int, int, int]) -> Array | None:
        """(V,) one of its units in SI, by its exponents of m, kg and s; None where that is 1."""
        _, mass, time = exponents
        if not mass and not time:
            return None
        return np.asarray(self.force**mass * self.time ** (time + 2 * mass))
