"""The modal equations of one mass on its way, for SciPy's solvers: a second source for the march, and a reference.

Only scenes without events inside: one carriage, a mass in full, on its body from the start to the end, no dampers.
q'' = phi F - 2 zeta omega q' - omega^2 q  with  F (1 + m phi.phi) = m (g - A.q' - B.q + phi.(2 zeta omega q' +
omega^2 q)),  A = 2 s' phi',  B = s'^2 phi'' + s'' phi' (mechanics section 2, solved for F).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from engine.kernels.layout import LANES
from engine.march.initial_state import initial_state
from engine.march.tables import SceneTables
from engine.model.lane_table import lane_table, moving_mass, weight
from engine.model.scene_model import SceneModel
from engine.model.station_path import standing
from engine.model.timeline import Segment, build_timeline
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts
from results_schema.errors import Interrupted

DEGREE = 7  # of the polynomials between which the track's rows are looked up
CELL_PHASE = 0.25  # rad of the highest mode's wave that a polynomial covers: the rows are exact within 1e-13
LEAST_CELLS = 32  # per unit of scene time
_NODES = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
_TO_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True))
_POWERS = np.arange(DEGREE + 1)


Solution = Callable[[Array], Array]  # of scene times (S,): modal displacements above velocities (2 N, S)


@dataclass(frozen=True, eq=False)
class ModalEquations:
    """The equations of a scene's first variant as y' = f(t, y), y = (q, q') and t in s."""

    model: SceneModel

    @cached_property
    def _segments(self) -> tuple[Segment, ...]:
        return build_timeline(self.model.riders, 1, "whole").segments

    @cached_property
    def _values(self) -> VariantValues:
        return VariantValues(self.model.study, {}, LANES)

    @cached_property
    def time_scale(self) -> float:
        """Seconds per unit of scene time."""
        return float(self._values.scene_time_scale[0])

    @cached_property
    def mass(self) -> float:
        """Of the carriage, kg."""
        return float(moving_mass(self.model, self._values, 0)[0])

    @cached_property
    def weight(self) -> float:
        """Of the carriage, N."""
        return float(weight(self.model, self._values, 0)[0])

    @cached_property
    def _rates(self) -> Array:
        """(N,) 2 zeta omega."""
        return np.array(lane_table(self.model, self._values).rates[0, :, 0])

    @cached_property
    def start(self) -> Array:
        """(2 N,) y at time 0."""
        state = initial_state(self.model, lane_table(self.model, self._values))
        return np.concatenate([state.q[0, :, 0], state.v[0, :, 0]])

    @cached_property
    def _cells(self) -> tuple[Array, Array]:
        """Ends of all cells in s (cells + 1,), and coefficients of phi, A and B in them (cells, DEGREE + 1, 3 N)."""
        ends, coefficients = [np.zeros(1)], []
        for segment in self._segments:
            span = segment.end - segment.start
            phase = float(self._body.modal.wave_number.max()) * self.model.carriages[0].rider.top_speed * span
            edges = np.linspace(segment.start, segment.end, math.ceil(max(phase / CELL_PHASE, LEAST_CELLS * span)) + 1)
            middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (edges[1:] - edges[:-1])
            tau = middle[:, None] + half[:, None] * _NODES
            rows = self.rows(segment, tau.reshape(-1)).reshape(*tau.shape, -1)
            coefficients.append(np.einsum("pn,cnk->cpk", _TO_POWERS, rows))
            ends.append(edges[1:])
        return np.concatenate(ends) * self.time_scale, np.concatenate(coefficients)

    @property
    def _body(self) -> Any:
        return self.model.bodies[self.model.carriages[0].body]

    def rows(self, segment: Segment, tau: Array) -> Array:
        """(S, 3 N) phi, A and B of the carriage at scene times in a segment, in SI units."""
        path = self.model.carriages[0].rider.path(tau, segment.start, segment.end)
        place = np.clip(path.S, 0.0, self.model.carriages[0].rider.length)
        speed, bend = (path.dS / self.time_scale)[:, None], (path.ddS / self.time_scale**2)[:, None]
        found = np.zeros((tau.size, 3, self.model.omega.size))
        phi, slope, curve = (self._body.modal.shape(place, derivative) for derivative in range(3))
        found[:, 0, self._body.modes] = phi
        found[:, 1, self._body.modes] = 2.0 * speed * slope
        found[:, 2, self._body.modes] = speed**2 * curve + bend * slope
        return found.reshape(tau.size, -1)

    def right_hand_side(self, halted: Callable[[], bool] = lambda: False) -> Callable[[float, Array], Array]:
        """f(t, y). Raises Interrupted, when it is called, where somebody asks to stop."""
        ends, coefficients = self._cells
        modes, rates, stiffness = self.model.omega.size, self._rates, self.model.omega**2
        mass, weight = self.mass, self.weight

        def slope(t: float, y: Array) -> Array:
            if halted():
                raise Interrupted("stopped")
            cell = min(max(int(np.searchsorted(ends, t)) - 1, 0), len(coefficients) - 1)
            z = (2.0 * t - ends[cell] - ends[cell + 1]) / (ends[cell + 1] - ends[cell])
            rows = z**_POWERS @ coefficients[cell]
            phi, q, v = rows[:modes], y[:modes], y[modes:]
            elastic = rates * v + stiffness * q
            moved = rows[modes : 2 * modes] @ v + rows[2 * modes :] @ q
            force = (weight + mass * (phi @ elastic - moved)) / (1.0 + mass * (phi @ phi))
            return np.concatenate([v, phi * force - elastic])

        return slope

    def solve(self, method: str, tolerance: float, halted: Callable[[], bool] = lambda: False) -> Solution:
        """Solve over the whole scene with a solver of SciPy; absolute tolerance: that part of the static deflection.

        Raises Interrupted where somebody asks to stop, RuntimeError where the solver gives up.
        """
        from scipy.integrate import solve_ivp

        omega, slope = self.model.omega, self.right_hand_side(halted)
        # of a mode: its deflection by the weight where its shape is largest
        size = self.weight * np.abs(self.rows(self._segments[0], np.linspace(*self._span, 65))).max() / omega**2
        absolute = tolerance * np.concatenate([size, size * omega])
        span = tuple(self.time_scale * end for end in self._span)
        found = solve_ivp(slope, span, self.start, method=method, rtol=tolerance, atol=absolute, dense_output=True)
        if not found.success:
            raise RuntimeError(found.message)
        return lambda tau: np.asarray(found.sol(tau * self.time_scale))

    @property
    def _span(self) -> tuple[float, float]:
        return self._segments[0].start, self._segments[-1].end

    def readings(self, tables: SceneTables, counts: Counts, states: Array) -> Array:
        """(S, signals) of states (2 N, S) at stations of tables by their count: sensors, then the contact force, which
        is NaN where it does not count."""
        modes, along = self.model.omega.size, standing(tables.timeline, counts)
        force = self.forces(tables, counts, states)
        found = np.zeros((counts.size, len(tables.signals)))
        for number, signal in enumerate(tables.signals):
            for channel in signal.channels(self.model, along):
                found[:, number] += np.sum(channel.rows * states[:modes].T, axis=1)
            found[:, number] += signal.missed(self.model, along)[:, 0] * force
            if not signal.is_summed:
                found[~signal.counted(self.model, along), number] = np.nan
        return found

    def forces(self, tables: SceneTables, counts: Counts, states: Array) -> Array:
        """(S,) the contact force, N."""
        modes = self.model.omega.size
        index, tau = tables.timeline.moments(counts)
        rows = np.zeros((counts.size, 3 * modes))
        for number in np.unique(index):
            here = index == number
            rows[here] = self.rows(tables.timeline.segments[number], tau[here])
        phi, rate, curve = rows[:, :modes], rows[:, modes : 2 * modes], rows[:, 2 * modes :]
        q, v = states[:modes].T, states[modes:].T
        elastic = self._rates * v + self.model.omega**2 * q
        reacted = np.sum(phi * elastic - rate * v - curve * q, axis=1)
        return np.asarray((self.weight + self.mass * reacted) / (1.0 + self.mass * np.sum(phi**2, axis=1)))


def check_smooth(model: SceneModel, static: Sequence[str]) -> None:
    """Refuse scenes that these equations do not describe. static: quantities that sensors may read. Raises BadInput."""
    study = model.study
    if model.ties != 1 or model.carriages[0].inertia != "mass":
        _refuse(model, "carriage", "exactly one carriage, a mass with all of its terms, and no dampers")
    if any(part.own_weight for part in model.bodies) or len(model.bodies) != 1:
        _refuse(model, "body", "one body, whose own weight does not act")
    segments = build_timeline(model.riders, 1, "whole").segments
    if any(s.free or s.strikes or not s.active[0] for s in segments) or any(s.fresh for s in segments[1:]):
        name = model.carriages[0].name
        _refuse(model, f"carriage.{name}.motion", "one smooth motion from start to end, all of it on the body")
    for name, sensor in study.sensor.items():
        if sensor.quantity not in static:
            _refuse(model, f"sensor.{name}.quantity", " | ".join(static))


def _refuse(model: SceneModel, key: str, expected: str) -> None:
    raise model.study.source.fault(key, "errors are measured on simpler scenes than this", expected=expected)
