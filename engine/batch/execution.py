"""Run a plan: chunks of variants as dask tasks on threads. The only file that knows dask and threads."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

import numpy as np

from engine.accuracy.grids import SceneGrid
from engine.accuracy.groups import Group
from engine.batch.plan import EVERY_MARCH, Plan, make_plan
from engine.linear_algebra import one_thread
from engine.march.march import March, prepare
from engine.march.richardson import march_pair, march_scheme
from engine.march.stepper import Halted as Gone
from engine.march.tables import SceneTables
from engine.model.lane_table import in_whole_blocks, padded
from engine.observation.cycle_reduction import Reduction
from engine.scene.study import Study
from results_schema.arrays import Counts
from results_schema.errors import BadInput, Interrupted
from results_schema.late import xr
from results_schema.store.rows import Chunk, Collector, Rows

T = TypeVar("T")
Halted = Callable[[], bool]
Sink = Callable[[Chunk], object]
Progress = Callable[[int, int], object]

_COUNTING = threading.Lock()
WAITING = 4  # finished chunks per thread that may wait for the sink


@one_thread()
def run(
    study: Study,
    *,
    threads: int | None = None,
    chunk: int | None = None,
    reduction: Reduction | None = None,
    results: str = EVERY_MARCH,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Run a study in memory and return the march's dataset. Raises BadInput.

    threads: default all processors. chunk: variants per task, chosen by time and memory otherwise; results do not
    depend on either, bit for bit. reduction, results: as of `make_plan`. Until it returns, linear algebra keeps to
    one thread in the whole process.
    """
    from engine.batch.dataset import build

    plan = make_plan(study, reduction=reduction, results=results)
    collector = Collector(plan.size)
    execute(plan, collector.add, threads=threads, chunk=chunk, progress=progress)
    return build(plan, collector.arrays, collector.selected)


@one_thread()
def execute(
    plan: Plan,
    sink: Sink,
    *,
    threads: int | None = None,
    chunk: int | None = None,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
    done: Counts | None = None,
) -> None:
    """March everything that is not ``done`` and hand chunk after chunk to ``sink``, always on the calling thread.

    Raises what a chunk or the sink raised, after the chunks in flight have ended; Interrupted when ``stop`` is set.
    """
    if threads is not None and threads < 1:
        raise BadInput("no threads to run on", where="threads", expected=">= 1", received=str(threads))
    warm_up(plan)
    choose(plan, threads, stop)
    tasks = list(plan.chunks(done, chunk))
    left = Counter(id(group) for group, _ in tasks)
    finished = 0 if done is None else int(done.size)

    def take(found: Chunk) -> None:
        nonlocal finished
        sink(found)
        finished += found.rows.variants.size
        if progress is not None:
            progress(finished, plan.size)

    share_out([partial(_task, plan, task, left) for task in tasks], threads or cores(), take, stop=stop)


def warm_up(plan: Plan) -> None:
    """Load or compile the kernels once."""
    for grid in {min(grid.scene.ties, 2): grid for grid in plan.grids}.values():
        _first_steps(grid)


def choose(plan: Plan, threads: int | None, stop: threading.Event | None) -> None:
    """What the variants are computed with, measured on threads. Raises Interrupted when ``stop`` is set."""
    try:
        plan.choose(partial(run_jobs, threads=threads or cores()), partial(_any_set, (stop,)))
    except Gone:
        raise Interrupted("stopped; finished work is kept", remedy="run again to go on") from None


def march_seconds(plan: Plan, threads: int | None = None, repeats: int = 1) -> float:
    """Wall time of marching every variant once with the study's sensors alone, without compiling, tabulating, and
    gathering results; the mean over ``repeats`` marches in a row."""
    nothing, stride = np.zeros(0, dtype=np.int64), plan.base.scheme.stride
    tables = {id(b): SceneTables(b.scene, b.steps, plan.asked.window, "sensors", stride) for b in plan.groups}
    workers = threads or cores()
    chunks = list(plan.chunks(None, -(-plan.size // (4 * workers)))) * repeats
    if stride > 1:
        pairs = [(tables[id(group)], plan.values(group, padded(part)), nothing, part.size) for group, part in chunks]
        return seconds_of_jobs([partial(march_pair, *pair) for pair in pairs], workers) / repeats
    marches = [prepare(tables[id(group)], plan.values(group, padded(part)), nothing) for group, part in chunks]
    return seconds_of(marches, workers) / repeats


def seconds_of(marches: Sequence[March], threads: int) -> float:
    """Wall time of marches that are ready to go, on threads, without tabulating; each can go once."""
    for march in marches:
        for segment in march.tables.timeline.segments:
            march.tables.table(segment)
        for part in march.state:
            part += 0.0  # the operating system hands memory out at the first touch
    return seconds_of_jobs([march.go for march in marches], threads)


def seconds_of_jobs(jobs: Sequence[Callable[[], object]], threads: int) -> float:
    """Wall time of jobs on threads."""
    start = time.perf_counter()
    run_jobs(jobs, threads)
    return time.perf_counter() - start


def cores() -> int:
    """Threads where nobody says how many."""
    return os.cpu_count() or 1


def run_jobs(jobs: Sequence[Callable[[], object]], threads: int) -> None:
    """Jobs on threads; on the caller's own where that is to be the only one. The only place that shares out work."""
    if threads == 1:
        for job in jobs:
            job()
        return
    import dask.threaded

    graph = {("job", i): (job,) for i, job in enumerate(jobs)}
    dask.threaded.get(graph, list(graph), num_workers=threads)


def share_out(
    jobs: Sequence[Callable[[Halted], T]],
    threads: int,
    sink: Callable[[T], object],
    *,
    stop: threading.Event | None = None,
    grace: float = np.inf,
) -> None:
    """Jobs on threads beside the calling one, which hands result after result to ``sink``, in the order they finish.

    A job is given what tells whether to give up. Raises what a job or the sink raised, and Interrupted when ``stop`` is
    set, after the jobs in flight have ended or so many seconds of ``grace``.
    """
    halt, results = threading.Event(), queue.Queue[Any](maxsize=WAITING * threads)
    halted = partial(_any_set, (halt, stop))
    worker = threading.Thread(
        target=run_jobs, args=([partial(_do, job, results, halted) for job in jobs], threads), daemon=True
    )
    worker.start()
    try:
        for _ in jobs:
            found = _next(results, stop)
            if isinstance(found, BaseException):
                raise found
            sink(found)
    finally:
        halt.set()
        end = time.monotonic() + grace
        while worker.is_alive() and time.monotonic() < end:
            _drain(results)
            worker.join(0.01)


def _do(job: Callable[[Halted], object], results: queue.Queue[Any], halted: Halted) -> None:
    """One job; what it raises travels to the caller as its result."""
    if halted():
        return
    try:
        found: object = job(halted)
    except BaseException as error:
        found = error
    while not halted():  # wait for room in the queue, unless the caller has gone
        with suppress(queue.Full):
            results.put(found, timeout=0.05)
            return


def _first_steps(grid: SceneGrid) -> None:
    """March one variant over the first segment of a scene with hardly any steps."""
    tables = SceneTables(grid.scene, 4, grid.asked.window, refinement=2)
    with suppress(Gone):
        values = in_whole_blocks(grid.values.part(np.zeros(1, dtype=np.int64)))
        march_scheme(tables, values, np.zeros(0, dtype=np.int64), 1, lambda: True)


def _task(plan: Plan, task: tuple[Group, Counts], left: Counter[int], halted: Halted) -> Chunk:
    """One chunk. The last of a scene drops its tables."""
    from engine.batch.chunk import run_chunk

    group, variants = task
    try:
        arrays, selected = run_chunk(plan, group, variants, halted)
    finally:
        with _COUNTING:
            left[id(group)] -= 1
            last = left[id(group)] == 0
        if last:
            group.forget()
    return Chunk(Rows(variants, arrays), selected)


def _next(results: queue.Queue[Any], stop: threading.Event | None) -> Any:
    """The next finished chunk, or Interrupted."""
    while True:
        if stop is not None and stop.is_set():
            raise Interrupted("stopped; finished work is kept", remedy="run again to go on")
        try:
            return results.get(timeout=0.05)
        except queue.Empty:
            continue


def _drain(results: queue.Queue[Any]) -> None:
    while not results.empty():
        results.get_nowait()


def _any_set(events: tuple[threading.Event | None, ...]) -> bool:
    return any(event is not None and event.is_set() for event in events)
