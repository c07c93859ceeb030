"""Bodies whose frames move, against SciPy's Radau method on the same equations: CPU seconds at equal accuracy.

python -m tests.measure.radau. A hull that floats free, six coordinates of its frame and five of its modes, with a
carriage that goes along it; 64 variants of it by the march, one by Radau, whose right-hand side and Jacobian are
compiled: the march's own equations, accelerations of sixteen states at once, so that two calls make a Jacobian.
"""

import time
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

from engine.floating.lanes import in_blocks, lanes
from engine.floating.march import march
from engine.floating.model import FloatingModel, build
from engine.kernels.floating.layout import STATISTICS, Lane, Record
from engine.kernels.floating.march import room_to_march
from engine.kernels.floating.motions import motions_at
from engine.kernels.floating.newton import solve_accelerations
from engine.kernels.layout import LANES
from engine.kernels.vector import lanes_at
from engine.linear_algebra import one_thread
from engine.scene.study import load
from engine.scene.variants import VariantValues
from results_schema.arrays import Array
from studies.commands.catalogue import built_in
from tests.floating.scenes import FOX_GOODWIN

DURATION, VARIANTS = 30.0, 64
STEPS = (1600, 3200, 6400, 12_800, 25_600)
TOLERANCES = (1e-3, 1e-4, 1e-5)
FINEST = 102_400
SEEN = 50  # instants at which both are compared
CHANGE = 1e-7  # of a coordinate, for differences


@numba.njit
def accelerations(system: Any, lane: Any, room: Any, times: Array, states: Array, found: Array) -> None:
    """Rates (Z, LANES) of states (Z, LANES): coordinates without those of the rotation, the attitude, velocities."""
    state, solver = room.state, room.solver
    N = state.weight.shape[0]
    for lane_number in range(LANES):
        for k in range(N):
            turns = 3 <= k < 6
            row = k - 3 if k >= 6 else k
            state.now.y[k, lane_number] = 0.0 if turns else states[row, lane_number]
            state.now.u[k, lane_number] = states[N + 6 + k, lane_number]
        for e in range(9):
            solver.work.base[3, e, lane_number] = states[N - 3 + e, lane_number]
        for row in range(solver.memory.shape[0]):
            solver.memory[row, lane_number] = 0.0
    t = lanes_at(times, (0,))
    motions_at(lane.motions, t, t, solver.work.piece, solver.work.motions)
    solve_accelerations(system, lane, t >= 0.0, state, solver)
    for lane_number in range(LANES):
        for k in range(N):
            row = k - 3 if k >= 6 else k
            if not 3 <= k < 6:
                found[row, lane_number] = state.now.u[k, lane_number]
            found[N + 6 + k, lane_number] = state.now.a[k, lane_number]
        w = state.now.u[3:6, lane_number]
        for i in range(3):
            a, b, c = states[N - 3 + 3 * i : N + 3 * i, lane_number]
            found[N - 3 + 3 * i, lane_number] = b * w[2] - c * w[1]
            found[N - 2 + 3 * i, lane_number] = c * w[0] - a * w[2]
            found[N - 1 + 3 * i, lane_number] = a * w[1] - b * w[0]


class Equations:
    """The same equations as SciPy takes them, with their Jacobian by differences, and the state at time 0."""

    def __init__(self, model: FloatingModel) -> None:
        table = lanes(model, VariantValues(model.study, {}, 1), np.full(1, DURATION))
        self.lane = Lane(*(in_blocks(part)[0] for part in table))
        self.lane.step[:] = self.lane.step[0, 0]
        blank = np.zeros((1, 1, STATISTICS, LANES))
        self.model, self.calls, N = model, 0, model.size
        self.room = room_to_march(model.system, self.lane, Record(np.zeros(1), *[blank] * 6))
        self.states, self.found = np.zeros((2, 2 * N + 6, LANES))
        start = self.lane.start[:, :, 0]
        self.start = np.concatenate([np.delete(start[0], [3, 4, 5]), np.eye(3).ravel(), start[1]])

    def evaluate(self, t: float) -> Array:
        self.calls += 1
        accelerations(self.model.system, self.lane, self.room, np.full((1, LANES), t), self.states, self.found)
        return self.found

    def rates(self, t: float, z: Array) -> Array:
        self.states[:] = z[:, None]
        return self.evaluate(t)[:, 0].copy()

    def jacobian(self, t: float, z: Array) -> Array:
        changes, found = CHANGE * np.maximum(1.0, np.abs(z)), np.zeros((z.size, z.size))
        own = self.rates(t, z)
        for first in range(0, z.size, LANES):
            columns = np.arange(first, min(first + LANES, z.size))
            self.states[:] = z[:, None]
            self.states[columns, columns - first] += changes[columns]
            found[:, columns] = (self.evaluate(t)[:, : columns.size] - own[:, None]) / changes[columns]
        return found


def seen(model: FloatingModel, values: VariantValues, steps: int) -> Array:
    """(V, stations, 3) of the march: deflection of the middle, and the frame's x and z."""
    stations, duration = np.linspace(0, steps, SEEN + 1).astype(np.int64), np.full(values.size, DURATION)
    history = march(model, values, duration, steps, stations, FOX_GOODWIN).history
    first = model.signal_of("frames")
    return history[:, :, [0, first, first + 2]]


def off_by(found: Array, exact: Array) -> float:
    """The largest difference of what is seen, over its largest value."""
    return float((np.abs(found - exact).max(axis=0) / np.abs(exact).max(axis=0)).max())


@one_thread()
def main() -> None:
    more = {"body.hull.modes": 3, "frame.hull.lateral_modes": 2, "question.duration": DURATION}
    study = load(built_in()["free-flyer"]).without_sweep().with_values(more)
    model, equations = build(study), Equations(build(study))
    one = VariantValues(study, {}, 1)
    many = VariantValues(study, {"carriage.payload.mass": np.linspace(20.0, 60.0, VARIANTS)}, VARIANTS)
    exact, rows = seen(model, one, FINEST)[0], []
    for steps in STEPS:
        off = off_by(seen(model, one, steps)[0], exact)
        begun = time.process_time()
        seen(model, many, steps)
        rows.append((off, (time.process_time() - begun) / VARIANTS))
        print(f"march, {steps} steps: off by {off:.1e}, {rows[-1][1] * 1e3:.3f} ms a variant", flush=True)
    equations.jacobian(0.0, equations.start)
    begun = time.process_time()
    for _ in range(100):
        equations.rates(0.0, equations.start)
    each, times = (time.process_time() - begun) / 100, np.linspace(0.0, DURATION, SEEN + 1)
    for tolerance in TOLERANCES:
        equations.calls, begun = 0, time.process_time()
        how = {"rtol": tolerance, "atol": 1e-2 * tolerance, "jac": equations.jacobian, "max_step": 0.5}
        y = solve_ivp(equations.rates, (0.0, DURATION), equations.start, "Radau", times, **how).y
        seconds, coordinates = time.process_time() - begun, np.insert(y[: model.size - 3], 3, np.zeros((3, 1)), axis=0)
        found = np.stack([model.system.readings[0] @ coordinates, y[0], y[2]], axis=1)
        off, known = off_by(found, exact), np.log(np.array(rows)[::-1])
        own = float(np.exp(np.interp(np.log(off), known[:, 0], known[:, 1])))
        print(
            f"Radau, rtol {tolerance:.0e}: off by {off:.1e}, {seconds * 1e3:.0f} ms, of which its equations "
            f"{equations.calls * each * 1e3:.0f} ms: {seconds / own:.0f} times as long",
            flush=True,
        )


if __name__ == "__main__":
    main()
