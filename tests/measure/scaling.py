"""What studies cost against their size: `python -m tests.measure.scaling`, which prints the tables of docs/scaling.md.

Passages of random speed, mass and damping with fixed modes and steps and without an audit, each run by the command in a
process of its own. CPU times depend little on what else runs on the machine; wall times do.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import chdir
from pathlib import Path
from typing import NamedTuple

import numpy as np

from results_schema.store.parts import bytes_so_far
from tests.studies.small import ROOT

TEXT = """\
schema_version = 1
kind = "passage"

[body.beam]
kind = "beam"
length = 20.0
area = 0.05
second_moment = 1e-3
youngs_modulus = "210 GPa"
density = 7850.0
supports = "pinned-pinned"
damping_ratio = 0.02
modes = {modes}

[carriage.load]
on = "beam"
kind = "mass"
mass = 1000.0
motion = {{ kind = "cruise", start = 0.0, end = 20.0, speed = 20.0 }}

[sensor.midspan]
body = "beam"
at = 10.0

[sweep]
speed = {{ of = "carriage.load.motion.speed", sobol = {variants}, from = 5, to = 60 }}
mass = {{ of = "carriage.load.mass", sobol = {variants}, from = 100, to = 2000 }}
damping = {{ of = "body.beam.damping_ratio", sobol = {variants}, from = 0.005, to = 0.05 }}

[solver]
steps = {steps}
audit = 0

[output]
keep = "{keep}"
"""
MODES, STEPS = 10, 500  # of all studies but those in which they vary
WORKERS, VARIANTS = 100, 10**9  # of the plan on paper
HOSTS = 10  # that have these workers as threads: a hundred hosts in one process are in their own way
TASK_SECONDS = 0.4  # of a chunk of variants, at most: that of the scheduler's load
PROGRAM = 300 * 2**20  # bytes of a process that has planned a small study


class Size(NamedTuple):
    """A study's size."""

    variants: int
    modes: int = MODES
    steps: int = STEPS
    keep: str = "extremes"


class Cost(NamedTuple):
    """What a command took: wall and CPU seconds (of all its processes), peak bytes of its largest process, bytes of the
    archive, and the most bytes that its parts took."""

    wall: float
    cpu: float
    peak: int
    archive: int
    parts: int


def cost(size: Size, *options: str) -> Cost:
    """Run a study of a size in this folder and remove its archive."""
    Path("study.toml").write_text(TEXT.format(**size._asdict()), encoding="utf-8")
    environment, started = os.environ | {"PYTHONPATH": str(ROOT)}, time.monotonic()
    command = [sys.executable, "-m", "studies", "run", "study.toml", "-o", "study.nc", *options]
    quiet = subprocess.DEVNULL
    running, parts = subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet), [0]
    ended = threading.Event()
    watch = threading.Thread(target=_watch, args=(ended, parts))
    watch.start()
    _, status, used = os.wait4(running.pid, 0)
    wall = time.monotonic() - started
    ended.set()
    watch.join()
    if os.waitstatus_to_exitcode(status) not in (0, 3):
        raise SystemExit(f"{' '.join(command)} of {size} ended with {os.waitstatus_to_exitcode(status)}")
    found = Cost(
        wall, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, Path("study.nc").stat().st_size, max(parts)
    )
    Path("study.nc").unlink()
    return found


def _watch(ended: threading.Event, parts: list[int]) -> None:
    while not ended.wait(1.0):
        parts.append(bytes_so_far("study.nc"))


def sizes(variants: Sequence[int], middle: int) -> Iterator[Size]:
    """The studies that are measured: all numbers of variants, and a middle one with other modes and steps."""
    yield from (Size(count) for count in variants)
    yield from (Size(middle, modes, steps) for modes, steps in ((5, 500), (10, 1000), (10, 2000), (20, 2000)))


def fitted(found: Sequence[tuple[Size, Cost]]) -> np.ndarray:
    """a, b, c of CPU seconds = a + b variants + c variants x modes x steps, by least squares of relative errors."""
    rows = np.array([[1.0, s.variants, float(s.variants) * s.modes * s.steps] for s, _ in found])
    seconds = np.array([cost.cpu for _, cost in found])
    scaled = rows / seconds[:, None]
    weights = np.abs(scaled).max(axis=0)
    return np.linalg.lstsq(scaled / weights, np.ones(seconds.size), rcond=None)[0] / weights


def efficiency(seconds: float, law: np.ndarray) -> str:
    """Two workers of one thread each against one, by a study that takes one so many seconds at least."""
    a, b, c = law
    variants = int(max(seconds - a, 1.0) / (b + c * MODES * STEPS))
    one, two = (cost(Size(variants), "--workers", str(count)) for count in (1, 2))
    return (
        f"{variants:,} variants: 1 worker {one.wall:.0f} s (CPU {one.cpu:.0f} s), 2 workers {two.wall:.0f} s (CPU "
        f"{two.cpu:.0f} s): efficiency {one.wall / (2 * two.wall):.2f}"
    )


def scheduler_load(seconds: float, tasks: int) -> tuple[float, float]:
    """What a dask scheduler of this machine hands out to threads of this process, as many as the plan has workers,
    which sleep so long in each task: tasks per second, and CPU seconds of a task, those of its worker among them."""
    import logging

    from distributed import Client, LocalCluster

    options = {"processes": False, "dashboard_address": None, "silence_logs": logging.CRITICAL}
    with (
        LocalCluster(n_workers=HOSTS, threads_per_worker=WORKERS // HOSTS, **options) as cluster,
        Client(cluster) as client,
    ):
        client.gather(client.map(time.sleep, [0.0] * WORKERS, pure=False))
        started, cpu = time.monotonic(), time.process_time()
        client.gather(client.map(time.sleep, [seconds] * tasks, pure=False))
        return tasks / (time.monotonic() - started), (time.process_time() - cpu) / tasks


def chunk_of(size: Size) -> int:
    """Variants of a task in a study of a size."""
    import engine
    from studies.protocol.study import kind_of

    study = engine.load(TEXT.format(**size._asdict()))
    plan = kind_of(study).parts(study).plan  # type: ignore[attr-defined]
    return int(next(plan.chunks(None, None))[1].size)


def plan(law: np.ndarray, largest: Cost, of: Size, cpu: float) -> Iterator[str]:
    """The plan on paper for very many variants on very many workers, by the largest study. cpu: of the scheduler, s a
    task."""
    each = law[1] + law[2] * MODES * STEPS
    chunk = chunk_of(of)
    task, tasks = chunk * each, VARIANTS / chunk
    needed = WORKERS * cpu / each
    peak = (largest.peak - PROGRAM) / of.variants
    yield f"{VARIANTS:,} variants on {WORKERS} workers of one thread:"
    yield f"- CPU: {VARIANTS * each / 3600:,.0f} h on one core, {VARIANTS * each / WORKERS / 3600:.2f} h on all workers"
    yield f"- tasks: {tasks:,.0f} of {chunk:,} variants, {task:.2f} s each, {WORKERS / task:.0f} a second"
    yield f"- the scheduler, alone on a core: {1 / cpu:.0f} tasks a second, so at least {needed:,.0f} variants a task"
    yield f"- parts, reduced on the workers: {largest.parts / of.variants * VARIANTS / 1e9:,.0f} GB"
    yield f"- memory of the process that plans and gathers: {peak:.0f} bytes a variant, {peak * VARIANTS / 1e9:,.0f} GB"


def main(arguments: Sequence[str]) -> None:
    """The tables."""
    parser = argparse.ArgumentParser(prog="python -m tests.measure.scaling", description=__doc__)
    parser.add_argument("--variants", type=int, nargs="+", default=[10**k for k in range(3, 8)])
    parser.add_argument("--middle", type=int, default=300_000, help="variants of studies with other modes and steps")
    parser.add_argument("--seconds", type=float, default=60.0, help="of the study by which workers are compared")
    parser.add_argument("--tasks", type=int, default=5000, help="of the scheduler's load")
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        cost(Size(1000))  # compiles kernels, where they are not
        print("| variants | modes | steps | keep | wall (s) | CPU (s) | peak (MB) | parts (MB) | archive (MB) |")
        print("|---|---|---|---|---|---|---|---|---|", flush=True)
        found = []
        for size in sizes(chosen.variants, chosen.middle):
            found.append((size, cost(size)))
            _show(*found[-1])
        _show(Size(chosen.middle, keep="all"), cost(Size(chosen.middle, keep="all")))
        law = fitted(found)
        print(f"\nCPU seconds = {law[0]:.2g} + {law[1]:.3g} variants + {law[2]:.3g} variants x modes x steps")
        for size, one in found:
            told = law @ [1.0, size.variants, float(size.variants) * size.modes * size.steps]
            print(f"  {size.variants:>12,} x {size.modes} x {size.steps}: {one.cpu:.1f} s, fitted {told:.1f} s")
        print(efficiency(chosen.seconds, law), flush=True)
    loads = [(seconds, *scheduler_load(seconds, chosen.tasks)) for seconds in (0.0, TASK_SECONDS)]
    for seconds, pace, cpu in loads:
        ideal = f", {100 * pace * seconds / WORKERS:.0f} % of the ideal" if seconds else ""
        print(
            f"scheduler, {WORKERS} threads, tasks of {seconds:.1f} s: {pace:.0f}/s{ideal}, CPU {1e3 * cpu:.2f} ms each"
        )
    largest = max(found, key=lambda pair: pair[0].variants)
    print("\n".join(plan(law, largest[1], largest[0], loads[-1][2])))


def _show(size: Size, one: Cost) -> None:
    print(
        f"| {size.variants:,} | {size.modes} | {size.steps} | {size.keep} | {one.wall:.1f} | {one.cpu:.1f} | "
        f"{one.peak / 1e6:.0f} | {one.parts / 1e6:.1f} | {one.archive / 1e6:.2f} |",
        flush=True,
    )


if __name__ == "__main__":
    main(sys.argv[1:])
