"""Members of frames that are cut into too few elements, of which no estimated error knows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.batch.plan import Plan
from engine.bodies.build import build_body
from engine.bodies.modal.modal_body import ModalBody
from results_schema.arrays import Array

LOWEST = 4  # frequencies that are looked at: those of a first and a second half wave of two spans
MISSED = 2.0  # times the tolerance: the tables of built-in studies are off by 1.3e-3
FELT = 1e-6  # of the largest displacement under loads by any mode
PLACES = 65  # of the track
LEFT = 16.0 / 15.0  # of what twice the elements change: the frequencies of beam elements converge by their fourth power


def coarse(plan: Plan) -> Iterator[str]:
    """One sentence for every frame of the scene without sweep whose lowest frequencies miss the tolerance."""
    for part in plan.base.bodies:
        body = plan.study.body[part.name]
        if not body.is_meshed:
            continue
        own, finer = _felt(part.modal), _felt(build_body(body.finer()))
        known = min(own.size, finer.size)
        off = LEFT * np.abs(own[:known] / finer[:known] - 1.0).max(initial=0.0)
        if off > MISSED * plan.study.solver.tolerance:
            yield (
                f"the lowest frequencies of {part.name} are up to {100.0 * off:.2g} % off, as twice the elements tell, "
                "and no estimated error has that: its members need more elements"
            )


def _felt(modal: ModalBody) -> Array:
    """The lowest frequencies of modes by which loads move the track, rad/s."""
    moved = np.abs(modal.shape(np.linspace(0.0, modal.length, PLACES), 0)).max(axis=0)
    return np.asarray(modal.omega[(modal.omega > 0.0) & (moved > FELT * moved.max())][:LOWEST])
