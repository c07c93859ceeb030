"""What a march makes of every unit state: transition matrices of a passage, of a period, and of steps at a station
where the carriage is held.

Without weights and gravity the kernels of the march are linear in the state. Marching the unit states side by side, one
to a lane, gives the matrix that they apply, whatever the scheme; what grows from passage to passage, from period to
period or from step to step is its spectral radius (Floquet; mechanics section 7).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from engine.kernels.layout import LANES, STATISTICS, Alpha, Lanes, Record, State, Ties
from engine.kernels.stepping.start import solve_initial_acceleration
from engine.march.march import prepare, step_kernel
from engine.march.tables import SceneTables
from engine.methods.comparison import ComparisonScheme, frozen_track, propagate_comparison
from engine.model.lane_table import LaneTable, from_blocks, lane_table, padded, to_blocks
from engine.model.scene_model import SceneModel
from engine.model.station_path import Along, StationPath
from engine.model.track import tabulate_ties
from engine.observation.contact_forces import ContactForce
from engine.observation.signals import tabulate_watch
from engine.scene.variants import VariantValues
from results_schema.arrays import Array


@dataclass(frozen=True, eq=False)
class Frozen:
    """A scene with every carriage held at one place (m), marched by the study's scheme.

    advance: m per step, of the speed whose terms are kept; a variant of step h has those of the speed advance/h.
    """

    model: SceneModel
    place: float
    advance: float = 0.0

    @property
    def parts(self) -> int:
        """How many arrays of the state the scheme carries on."""
        return 4 if isinstance(self.model.scheme.coefficients, Alpha) else 3

    def march(self, lanes: Lanes, state: State, steps: int) -> State:
        """The state of all lanes after some steps; the given one is used up."""
        watch = tabulate_watch(self.model, (ContactForce(0),), self._along(steps))
        blocks = lanes.step.shape[0]
        statistics, history = np.zeros((blocks, 1, STATISTICS, LANES)), np.zeros((blocks, 0, 0, LANES))
        record = Record(statistics, np.full(steps + 1, -1, dtype=np.int64), history)
        ties = self.ties(steps)
        step_kernel(ties)(ties, lanes, state, watch, record, self.model.scheme.coefficients, 0)
        return state

    def ties(self, steps: int) -> Ties:
        """The ties along so many steps."""
        return tabulate_ties(self.model, self._along(steps), self.model.scheme.coefficients)

    def _along(self, steps: int) -> Along:
        """The ways of all carriages at the stations 0..steps."""
        still = np.zeros(steps + 1)
        way = StationPath(still + self.place, still + self.advance, still, active=True)
        return tuple(way for _ in self.model.riders)


@dataclass(frozen=True, eq=False)
class FrozenCompared(Frozen):
    """The same marched by a scheme that is offered for comparison."""

    scheme: ComparisonScheme = field(kw_only=True)

    @property
    def parts(self) -> int:
        return 3

    def march(self, lanes: Lanes, state: State, steps: int) -> State:
        track = frozen_track(self.scheme, self.model, self.place, steps, self.advance)
        return propagate_comparison(self.scheme, track, lanes, state).state


def transitions(tables: SceneTables, values: VariantValues) -> Array:
    """(V, 2N, 2N) matrices of a scene from its start to its end, one passage or one period, on (q, q'/omega).

    Accelerations are those of the equations of motion at the start, and an alpha scheme starts without memory.
    Entries of a march that overflows are not finite.

    >>> from engine.model.scene_model import build_model
    >>> from engine.scene.study import Study  # a carriage that weighs next to nothing, omega_1 T = pi/2: a quarter turn
    >>> bed = dict(kind="beam", length=1, area=1, second_moment=1, youngs_modulus=1, density=1, modes=1,
    ...            supports="pinned-pinned")
    >>> crossing = dict(kind="cruise", start=0, end=1, speed=2.0 * np.pi)
    >>> study = Study(kind="passage", body={"bed": bed}, carriage={"car": dict(on="bed", kind="mass", mass=1e-9,
    ...               motion=crossing)}, solver=dict(static_correction=False))
    >>> tables = SceneTables(build_model(study, {}, {}), 1000, "whole")
    >>> transitions(tables, VariantValues(study, {}, 1))[0].round(3) + 0.0
    array([[ 0.,  1.],
           [-1.,  0.]])
    """
    spread = values.part(_variants(values.size, 2 * tables.model.omega.size))
    scales = _velocities(tables.model, spread.size)
    ready = prepare(tables, spread, np.zeros(0, dtype=np.int64))
    _fill(ready.state, scales)
    replace(ready, lanes=_unloaded(ready.lanes)).go()
    return _matrices(ready.state, scales, values.size)


def held_transitions(frozen: Frozen, values: VariantValues, step: Array, steps: int) -> Array:
    """(V, 2N, 2N) matrices of several steps (V,) in s at a frozen station, on (q, q'/omega), as `transitions`."""
    model = frozen.model
    lanes = _held_lanes(model, values, 2 * model.omega.size, step)
    scales = _velocities(model, lanes.step.size)
    state = _unit_states(lanes, scales)
    solve_initial_acceleration(frozen.ties(0), lanes, state)
    return _matrices(frozen.march(lanes, state, steps), scales, values.size)


def step_matrices(frozen: Frozen, values: VariantValues, step: Array, steps: int = 1) -> Array:
    """(V, M, M) matrices of one step (V,) in s, or several, at a frozen station, on all that the scheme carries on.

    (q, h q', h^2 q''), so that M = 3N, and h^2 memory of an alpha scheme, M = 4N. What follows from the rest, as the
    acceleration does in most schemes, adds zeros to the spectrum.
    """
    parts, modes = frozen.parts, frozen.model.omega.size
    lanes = _held_lanes(frozen.model, values, parts * modes, step)
    h = from_blocks(lanes.step, lanes.step.size)
    scales = np.broadcast_to(h ** -np.array([0.0, 1.0, 2.0, 2.0])[:parts, None, None], (parts, modes, h.size))
    return _matrices(frozen.march(lanes, _unit_states(lanes, scales), steps), scales, values.size)


def spectral_radius(matrices: Array) -> Array:
    """(...,) largest magnitude of the eigenvalues of matrices (..., M, M); infinite where they are not finite.

    >>> spectral_radius(np.array([[[0.0, 2.0], [2.0, 0.0]], [[np.nan, 0.0], [0.0, 1.0]]]))
    array([ 2., inf])
    """
    finite = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))
    found = np.abs(np.linalg.eigvals(np.where(finite[..., None, None], matrices, 0.0))).max(axis=-1)
    return np.where(finite, found, np.inf)


def _held_lanes(model: SceneModel, values: VariantValues, units: int, step: Array) -> Lanes:
    """Lanes without loads: every variant, with its step (V,) in s, once for each of so many unit states."""
    table = _unloaded(lane_table(model, values.part(_variants(values.size, units))))
    scaled_from = model.scheme.scaled_from
    return table.steps_of(to_blocks(step[_variants(values.size, units)]), scaled_from=scaled_from)


def _unit_states(lanes: Lanes, scales: Array) -> State:
    """See `_fill`."""
    state = State(*(np.zeros_like(lanes.stiffness) for _ in State._fields))
    _fill(state, scales)
    return state


def _variants(size: int, units: int) -> NDArray[np.int64]:
    """(lanes,) which variant is in which lane: each once per unit state, the last also in what fills up a block."""
    return padded(np.repeat(np.arange(size), units))


def _unloaded(lanes: LaneTable) -> LaneTable:
    """The same lanes without weights and gravity."""
    return replace(lanes, weight=np.zeros_like(lanes.weight), gravity=np.zeros_like(lanes.gravity))


def _velocities(model: SceneModel, lanes: int) -> Array:
    """(2, N, lanes) sizes of unit states: 1 m in modal displacement, the mode's frequency in velocity (the first
    elastic one's for a rigid mode)."""
    omega = np.where(model.omega > 0.0, model.omega, model.first_omega)
    return np.broadcast_to(np.stack([np.ones_like(omega), omega])[:, :, None], (2, omega.size, lanes))


def _fill(state: State, scales: Array) -> None:
    """Put unit states into the lanes: scales (parts, N, lanes) are their sizes, part by part of the state."""
    parts, modes, lanes = scales.shape
    number = np.arange(parts * modes).reshape(parts, modes, 1)
    for part, values in zip(state, np.where(np.arange(lanes) % (parts * modes) == number, scales, 0.0), strict=False):
        part[:] = to_blocks(values)


def _matrices(state: State, scales: Array, variants: int) -> Array:
    """(V, M, M) what became of the unit states in their own sizes, M = parts x N: a column for each of them."""
    parts, modes, _ = scales.shape
    size = parts * modes
    used = variants * size
    found = np.stack([from_blocks(part, used) for part in state[:parts]]) / scales[:, :, :used]
    return np.ascontiguousarray(np.moveaxis(found.reshape(size, variants, size), 1, 0))
