"""The dynamic part of what a sensor reads: less what it would read if all carriages stood still where they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from engine.observation.readings import Sensor
from results_schema.arrays import Array, Mask

if TYPE_CHECKING:
    from engine.model.scene_model import SceneModel
    from engine.model.station_path import Along
    from engine.observation.readings import Channel


@dataclass(frozen=True, eq=False)
class DynamicPart(Sensor):
    """What a sensor reads of the modes and of forces; tables leave the ``whole``'s static reading out, so that it reads
    nothing at rest."""

    whole: Sensor

    @classmethod
    def of(cls, whole: Sensor) -> DynamicPart:
        """That of a sensor."""
        return cls(whole.name, whole.quantity, whole.body, whole.at, whole.under, whole, limit=whole.limit)

    @property
    def reads_whole(self) -> Sensor:
        return self.whole

    def channels(self, model: SceneModel, along: Along) -> list[Channel]:
        return self.whole.channels(model, along)

    def missed(self, model: SceneModel, along: Along) -> Array:
        return self.whole.missed(model, along)

    def offset(self, model: SceneModel, along: Along) -> Array:
        return self.whole.offset(model, along)

    def counted(self, model: SceneModel, along: Along) -> Mask:
        return self.whole.counted(model, along)

    def rides(self, model: SceneModel) -> int | None:
        return self.whole.rides(model)

    def silent(self, model: SceneModel) -> bool:
        return self.whole.silent(model)

    def largest_influence(self, model: SceneModel, places: Array) -> float:
        return self.whole.largest_influence(model, places)

    def unit_static(self, model: SceneModel, along: Along) -> Array:
        return np.zeros((along[0].s.size, model.ties))

    def loose(self, model: SceneModel, along: Along) -> Array:
        return np.zeros((1, model.omega.size))

    def sagging(self, model: SceneModel, along: Along) -> Array:
        return np.zeros(along[0].s.size)
