"""Pace of the march by the number of ties, beside a twin in C: `python -m tests.measure.many_ties`, with gcc.

The scene is that of `wanderlast bench --ties`, on one thread. The twin has one output, the largest midspan deflection;
the march observes the contact forces too. Times are of the processor, so that other programs count less.
"""

import ctypes
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from engine.batch.plan import make_plan
from engine.kernels.layout import CLOSED, CURVE, FORCE, RATE, Lanes
from engine.kernels.stepping.start import solve_initial_acceleration
from engine.march.march import prepare
from engine.march.step_rules import allow_any_steps
from results_schema.arrays import Array
from studies.commands.bench import MIDSPAN, Scene

SOURCE = Path(__file__).with_name("many_ties.c")
ABREAST, BEST_OF = 8, 15
FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-ffp-contract=fast", "-shared", "-fPIC")


def built(ties: int, modes: int, folder: Path) -> ctypes.CDLL:
    """The twin, compiled for a number of ties and modes."""
    library = folder / f"{ties}_{modes}.so"
    sizes = (f"-DTIES={ties}", f"-DMODES={modes}")
    subprocess.run(["gcc", *FLAGS, *sizes, str(SOURCE), "-o", str(library)], check=True)
    twin = ctypes.CDLL(str(library))
    pointer = ctypes.c_void_p
    twin.march.argtypes = [ctypes.c_int, ctypes.c_double, ctypes.c_double, *[pointer] * 8]
    twin.march.restype = None
    return twin


def aligned(values: Array) -> Array:
    """A copy that begins where a row of eight may."""
    room = np.zeros(values.size + ABREAST)
    first = (-(room.ctypes.data // 8)) % ABREAST
    room[first : first + values.size] = np.ascontiguousarray(values).reshape(-1)
    return room[first : first + values.size].reshape(values.shape)


def eights(values: Array) -> Array:
    """(blocks, n, LANES) as (blocks of eight, n, 8)."""
    cut = values.reshape(*values.shape[:2], -1, ABREAST)
    return aligned(np.moveaxis(cut, 2, 1).reshape(-1, values.shape[1], ABREAST))


def twin_march(scene: Scene, folder: Path) -> tuple[float, Array]:
    """Seconds of the best of several runs, and every variant's largest midspan deflection."""
    plan = make_plan(scene.study(), check_steps=allow_any_steps)
    (group,) = plan.groups
    (segment,) = group.tables.timeline.segments
    table = group.tables.table(segment)
    march = prepare(group.tables, plan.values(group, group.variants), np.zeros(0, dtype=np.int64))
    lanes: Lanes = march.lanes.steps_of(march.lanes.time_scale * segment.step)
    rows = np.ascontiguousarray(table.ties.rows[..., [FORCE, CLOSED, RATE, CURVE]].transpose(0, 2, 1, 3))
    observed = np.ascontiguousarray(table.watch.on_q[0, 0, : scene.modes])
    solve_initial_acceleration(table.ties, lanes, march.state)
    start = march.state.a * lanes.step[:, None] ** 2
    prescribed = [eights(part) for part in (lanes.stiffness, lanes.damping, start, lanes.coupling_mass, lanes.load)]
    peaks = aligned(np.zeros((prescribed[0].shape[0], ABREAST)))
    twin, best = built(scene.ties, scene.modes, folder), np.inf
    for _ in range(BEST_OF):
        begun = time.thread_time()
        for block in range(peaks.shape[0]):
            parts = [part[block].ctypes.data for part in prescribed]
            twin.march(
                rows.shape[0], 0.25, 0.5, rows.ctypes.data, observed.ctypes.data, *parts, peaks[block].ctypes.data
            )
        best = min(best, time.thread_time() - begun)
    found = np.empty(scene.variants)
    found[group.variants] = peaks.reshape(-1)[: scene.variants]
    return best, found


def engine_march(scene: Scene) -> tuple[float, Array]:
    """The same by the march that `run` uses."""
    plan = make_plan(scene.study(), check_steps=allow_any_steps)
    (group,) = plan.groups
    best, found = np.inf, np.empty(scene.variants)
    for _ in range(BEST_OF):
        march = prepare(group.tables, plan.values(group, group.variants), np.zeros(0, dtype=np.int64))
        begun = time.thread_time()
        codes = march.go()
        best = min(best, time.thread_time() - begun)
    statistics = march.result(codes, scene.variants).statistics[[s.name for s in group.tables.sensors].index(MIDSPAN)]
    found[group.variants] = np.maximum(statistics[0], -statistics[2])
    return best, found


def main() -> None:
    """Print a table: ties, modes x steps x variants per second of both, their ratio, multiply-adds per second."""
    print("ties  march 1e9/s  twin 1e9/s  ratio  march, multiply-adds 1e9/s")
    with tempfile.TemporaryDirectory() as folder:
        for ties in (1, 2, 3, 4, 6, 8, 12):
            scene = Scene(variants=128, ties=ties)
            (ours, found), (theirs, expected) = engine_march(scene), twin_march(scene, Path(folder))
            np.testing.assert_allclose(found, expected, rtol=1e-9)
            work = scene.modes * scene.steps * scene.variants
            # of a mode and step: products, sums, push, correction; of a step: elimination
            each = ties * ties + 4 * ties + 8 + (ties**3 / 3.0 + 2.0 * ties**2) / scene.modes
            rates = (work / ours / 1e9, work / theirs / 1e9)
            print(f"{ties:4d}  {rates[0]:11.3f}  {rates[1]:10.3f}  {rates[0] / rates[1]:5.2f}  {rates[0] * each:10.1f}")


if __name__ == "__main__":
    main()
