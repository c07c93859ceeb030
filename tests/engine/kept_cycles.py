"""A reduction that keeps the cycles it is given, for tests of what studies are handed."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from engine.observation.cycle_reduction import Compared, Cycle
from engine.scene.study import Study
from results_schema.arrays import Array
from results_schema.status import Fidelity


@dataclass
class Kept:
    """cycles: one after the other, the march's own before those that it is compared with. largest: of every sensor."""

    stations: int
    cycles: list[Cycle] = field(default_factory=list)
    least_fidelity: Fidelity = Fidelity.STATIC
    compared: tuple[str, ...] = ()

    def outputs(self, study: Study) -> Mapping[str, tuple[str, ...]]:
        return {"largest": ("sensor",)}

    def sizes(self, study: Study) -> Mapping[str, int]:
        return {"sensor": len(study.sensor)}

    def differences(self, compared: Compared) -> dict[str, Array]:
        return {}

    def __call__(self, cycle: Cycle) -> dict[str, Array]:
        self.cycles.append(cycle)
        return {"largest": cycle.history.max(axis=0).T}
