"""Sweeps of passages for the tests of what is measured."""

from typing import Any

from engine.accuracy.grids import SceneGrid
from engine.batch.plan import make_plan
from engine.scene.study import Study
from tests.engine.build import Table, beam, cruise, mass, study

OPEN = beam(modes="auto", damping_ratio=0.02)
SPEED, WEIGHT, ZETA = "carriage.car.motion.speed", "carriage.car.mass", "body.bed.damping_ratio"


def axis(path: str, low: float, high: float, count: int) -> Table:
    """An axis of a sweep."""
    return {"of": path, "from": low, "to": high, "count": count}


def passages(*counts: int, **changes: Any) -> Study:
    """A mass crosses a beam, with so many speeds and masses (and nothing swept without any)."""
    ends = {"speed": (SPEED, 0.3, 1.2), "weight": (WEIGHT, 0.05, 0.25)}
    sweep = {name: axis(*end, count) for (name, end), count in zip(ends.items(), counts, strict=False)}
    bed, car = changes.pop("bed", OPEN), changes.pop("car", mass(0.2, cruise(0.0, 1.0, 0.9)))
    return study(bed, car, **({"sweep": sweep} | changes))


def only_grid(given: Study) -> SceneGrid:
    """The grid of a study of one scene."""
    (grid,) = make_plan(given).grids
    return grid
