"""What section forces of beams and frames have beyond those of their modes: the part of all others, which follow at
once what loads the body (mode acceleration: Williams 1945), by its carriages, by loads and springs, and by its own mass
as its frame moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from engine.kernels.floating.layout import MISSED, MISSED_PLACE, MISSED_UNIFORM
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from engine.floating.attachments import Grip
    from engine.floating.bodies.elastic import ElasticBody
    from engine.floating.model import FloatingModel
    from results_schema.quantities import Quantity

#: Cells of either side of the place: with 64 modes tables are off by 4e-6 of the moment of a force on a whole length.
CELLS = 128
STEP = 1e-4  # of the length, for the slope of what is missed: with 32 modes it is off by 2e-5 of itself
NODES = np.array([-0.75, -0.25, 0.25, 0.75])  # of a cell: forces jump and bend at the place, which is none of them


def missed_sections(model: FloatingModel, grips: Sequence[Grip]) -> tuple[Counts, Array, Array, Array]:
    """Of K section forces that sensors read: sensors and bodies (K, 2), numbers (K, MISSED), lines (K, 2, CELLS,
    4), grips and twists (2, K, P), see `engine.kernels.floating.layout`. None without `solver.static_correction`."""
    found = list(_read(model)) if model.study.solver.static_correction else []
    of = np.array([(number, list(model.bodies).index(name)) for number, name in found], dtype=np.int64).reshape(-1, 2)
    numbers, lines = np.zeros((len(found), MISSED)), np.zeros((len(found), 2, CELLS, NODES.size))
    gripped = np.zeros((2, len(found), len(grips)))
    for k, (row, line, (number, name)) in enumerate(zip(numbers, lines, found, strict=True)):
        sensor, body = list(model.study.sensor.values())[number], model.bodies[name]
        x = float(sensor.at or 0.0)
        assert body.inertial is not None
        row[MISSED_PLACE], row[MISSED_UNIFORM:] = x, body.inertial(body, sensor.reads, x)
        for side, (low, high) in enumerate(((0.0, x), (x, body.length))):
            if high > low:
                line[side] = _line(body, sensor.reads, x, low, high)
        for p, grip in enumerate(grips):
            if grip.body == of[k, 1]:
                gripped[0, k, p] = grip.weights @ body.missed_at(sensor.reads, x, grip.x)
                gripped[1, k, p] = grip.weights @ _by_twist(body, sensor.reads, x, grip.x)
    return of, numbers, lines, gripped


def _read(model: FloatingModel) -> list[tuple[int, str]]:
    """Sensors of section forces at a place of what tells what its modes miss, by number, with the names of bodies."""
    placed = [
        (k, str(sensor.body), sensor) for k, sensor in enumerate(model.study.sensor.values()) if sensor.at is not None
    ]
    known = {name for name, body in model.bodies.items() if body.inertial is not None and body.omega.size}
    return [(k, name) for k, name, sensor in placed if name in known and sensor.reads.of_section]


def _by_twist(body: ElasticBody, quantity: Quantity, x: float, s: Array) -> Array:
    """(S,) of a quantity at x (m) per unit torque about y at s (S,) m, which the track turns by less its slope."""
    low, high = (np.clip(s + way * STEP * body.length, 0.0, body.length) for way in (-1.0, 1.0))
    return -(body.missed_at(quantity, x, high) - body.missed_at(quantity, x, low)) / (high - low)


def _line(body: ElasticBody, quantity: Quantity, x: float, low: float, high: float) -> Array:
    """(CELLS, 4) polynomials in places from -1 to 1 of equal cells between two places, constant first."""
    width = (high - low) / CELLS
    s = low + width * (np.arange(CELLS)[:, None] + 0.5 * (NODES + 1.0))
    values = body.missed_at(quantity, x, s.reshape(-1)).reshape(s.shape)
    return np.asarray(np.linalg.solve(np.vander(NODES, increasing=True), values.T).T)
