"""Average acceleration by jax.vmap over variants and lax.scan over steps, where jax happens to be installed.

A plain transcription of mechanics section 2 for comparison with the march's kernels, which never use it.
"""

import time
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from engine.kernels.layout import CLOSED, CURVE, FORCE, LANES, RATE
from engine.march.initial_state import initial_state
from engine.march.tables import SceneTables
from engine.model.lane_table import lane_table
from engine.scene.variants import VariantValues
from results_schema.arrays import Array

BATCH = 256
BEST_OF = 3
MOST_STEPS = 4096  # of one table
BETA, GAMMA = 0.25, 0.5


def is_there() -> bool:
    """Whether jax can be imported."""
    return find_spec("jax") is not None


def march(tables: SceneTables) -> tuple[Array, float]:
    """The sensors (S, J) of one variant at all stations but the first, and seconds per variant of a batch.

    tables: of average acceleration, one segment or equal ones of a path that repeats itself.
    """
    jax = import_module("jax")
    jax.config.update("jax_enable_x64", True)
    segments = tables.timeline.segments
    rows, sensors, static = (np.concatenate(parts) for parts in zip(*(_rows(tables, s) for s in segments), strict=True))
    lanes = lane_table(tables.model, VariantValues(tables.model.study, {}, LANES))
    step = lanes.steps_of(lanes.time_scale * segments[0].step)
    stiffness, damping = step.stiffness[0, :, 0], step.damping[0, :, 0]
    mass, load = step.coupling_mass[0, 0, 0], step.load[0, 0, 0]
    start, first = initial_state(tables.model, lanes).q[0, :, 0], tables.table(segments[0]).ties.rows[0, :, 0]
    weight = 1.0 / step.step[0, 0] ** 2
    numpy = jax.numpy

    def marched(mass: Any) -> Any:
        """(S, J) of one variant of this mass; its weight goes with it."""
        loaded, loose = load * mass / lanes.mass[0, 0, 0], 1.0 / (1.0 + GAMMA * damping + BETA * stiffness)
        elastic = stiffness * start
        force = (loaded - mass * first[:, CURVE] @ start + mass * first[:, FORCE] @ elastic) / (
            1.0 + mass * first[:, FORCE] @ first[:, FORCE]
        )

        def advance(state: Any, station: Any) -> Any:
            (u, v, a), (row, sensor, missed) = state, station
            u, v = u + v + (0.5 - BETA) * a, v + (1.0 - GAMMA) * a
            c = (damping * v + stiffness * u) * loose
            moved = row[:, RATE] @ v + row[:, CURVE] @ u - row[:, CLOSED] @ c
            force = (loaded - mass * moved) / (1.0 + mass * row[:, CLOSED] @ (loose * row[:, FORCE]))
            a = loose * row[:, FORCE] * force - c
            u, v = u + BETA * a, v + GAMMA * a
            return (u, v, a), sensor @ u + missed * force * weight

        state = (start, numpy.zeros_like(start), first[:, FORCE] * force - elastic)
        return jax.lax.scan(advance, state, (rows, sensors, static))[1]

    readings = np.asarray(jax.jit(marched)(mass))
    batch = jax.jit(jax.vmap(lambda one: numpy.abs(marched(one)).max(axis=0)))
    return readings, _seconds(batch, numpy.full(BATCH, mass)) / BATCH


def _seconds(batch: Any, masses: Any) -> float:
    """The best of a few, compiling left out."""
    batch(masses).block_until_ready()
    found = []
    for _ in range(BEST_OF):
        start = time.perf_counter()
        batch(masses).block_until_ready()
        found.append(time.perf_counter() - start)
    return min(found)


def _rows(tables: SceneTables, segment: Any) -> tuple[Array, Array, Array]:
    """Rows of the tie (S, N, 4), of the sensors (S, J, N), and what they miss per force (S, J), without station 0."""
    table, modes = tables.table(segment), tables.model.omega.size
    sensors = len(tables.sensors)
    on_q = table.watch.on_q[:, :sensors, :modes]
    spread = np.broadcast_to(on_q, (segment.steps + 1, *on_q.shape[1:]))
    return table.ties.rows[1:, :, 0], spread[1:], table.watch.static[1:, :sensors, 0]
