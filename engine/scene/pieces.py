"""The tables of pieces that a scene is made of, and which pieces a study uses."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from engine.bodies import BODIES
from engine.scene.carriages import CARRIAGES
from engine.scene.motions import MOTIONS
from engine.scene.settings import ALL_SCHEMES
from engine.scene.study import Study
from results_schema.pieces import Pieces
from results_schema.quantities import QUANTITIES


def used(study: Study) -> Iterator[tuple[Pieces[Any], str]]:
    """Every piece of a study's scene: its table and its name."""
    yield from ((BODIES, body.kind) for body in study.body.values())
    for carriage in study.carriage.values():
        yield from ((CARRIAGES, carriage.kind), (MOTIONS, carriage.motion.kind))
    yield from ((QUANTITIES, sensor.quantity) for sensor in study.sensor.values())
    yield from ((QUANTITIES, envelope.quantity) for envelope in study.envelope.values())
    yield ALL_SCHEMES, study.solver.scheme
