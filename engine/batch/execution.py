"""Run a plan: pilots, then chunks of variants, shared out to threads or workers."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Unpack

import numpy as np

from engine.accuracy.choice import Kept
from engine.accuracy.grids import SceneGrid
from engine.accuracy.jobs import NOBODY, Crashed, Halted, Told, untold
from engine.batch.executors import Place, Shared, Threads, Where, check_chunk, check_options, place, run_jobs
from engine.batch.plan import EVERY_MARCH, Plan, check_memory, make_plan
from engine.linear_algebra import one_thread
from engine.march.march import March, prepare
from engine.march.richardson import march_pair, march_scheme
from engine.march.stepper import Halted as Gone
from engine.march.tables import SceneTables
from engine.model.lane_table import in_whole_blocks, padded
from engine.observation.cycle_reduction import Reduction
from engine.scene.study import Study, study_of
from results_schema.arrays import Counts
from results_schema.cores import cores
from results_schema.errors import Interrupted, Remark
from results_schema.lazy_imports import xr
from results_schema.store.rows import Chunk, Collector

Sink = Callable[[Chunk], object]
Progress = Callable[[int, int], object]


@one_thread()
def run(
    study: Study | str | Path,
    *,
    chunk: int | None = None,
    reduction: Reduction | None = None,
    results: str = EVERY_MARCH,
    progress: Progress | None = None,
    **where: Unpack[Where],
) -> xr.Dataset:
    """Run a study, or that of a file, in memory and return the march's dataset. Raises BadInput, and WorkersGaveUp.
    What is allowed and yet often a mistake is a warning, a `Remark`.

    chunk: variants per task, chosen by time and memory otherwise; results do not depend on it, nor on where they are
    computed, bit for bit. reduction, results: as of `make_plan`. threads: default all processors. workers: processes of
    this machine to run on. scheduler: the address of a dask scheduler whose workers to run on. Until it returns, linear
    algebra keeps to one thread in the whole process.
    """
    from engine.batch.dataset import build
    from engine.batch.plausibility import remarks

    check_options({**where, "progress": progress}, "chunk", "reduction", "results", "progress")
    check_chunk(chunk)
    study = study_of(study)
    plan = make_plan(study, reduction=reduction, results=results)
    check_memory(study, plan.size, plan.disk_bytes)
    for remark in remarks(plan):
        warnings.warn(remark, Remark, stacklevel=3)  # of who called what `one_thread` wraps
    collector = Collector(plan.size)
    with place(**where) as here:
        execute(plan, collector.add, here, chunk=chunk, progress=progress)
    return build(plan, collector.arrays, collector.selected)


@one_thread()
def execute(
    plan: Plan,
    sink: Sink,
    here: Place | None = None,
    *,
    chunk: int | None = None,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
    done: Counts | None = None,
) -> None:
    """March everything that is not ``done`` and hand chunk after chunk to ``sink``, always on the calling thread.

    Raises what a chunk or the sink raised, after the chunks in flight have ended; Interrupted when ``stop`` is set.
    """
    from engine.batch.chunk import crashed_chunks, jobs_of

    here = here or Threads(cores())
    warm_up(plan)
    choose(plan, here, stop)
    tasks = jobs_of(plan, done, chunk, here.beside)
    finished = 0 if done is None else int(done.size)

    def take(found: Chunk) -> None:
        nonlocal finished
        sink(found)
        finished += found.rows.variants.size
        if progress is not None:
            progress(finished, plan.size)

    with _interrupted():
        crashed = here.share_out(plan, tasks, take, _asked(stop))
        for found in crashed_chunks(plan, crashed, Shared(here, _asked(stop))):
            take(found)


def warm_up(plan: Plan) -> None:
    """Load or compile the kernels once."""
    for grid in {min(grid.scene.ties, 2): grid for grid in plan.grids}.values():
        _first_steps(grid)


def choose(
    plan: Plan, here: Place, stop: threading.Event | None, kept: Kept | None = None, told: Told = untold
) -> None:
    """What the variants are computed with, measured by pilots, unless what these found is ``kept``; those that end
    every process are left out. told: of how many scenes of pilots are done. Raises Interrupted when ``stop`` is set."""
    without = NOBODY
    with _interrupted():
        while True:
            try:
                return plan.choose(Shared(here, _asked(stop)), without=without, kept=kept, told=told)
            except Crashed as crashed:
                without = np.union1d(without, crashed.lanes)


@contextmanager
def _interrupted() -> Iterator[None]:
    """Whatever is given up because somebody asked to stop is an interruption."""
    try:
        yield
    except Gone:
        raise Interrupted("stopped; finished work is kept", remedy="run again to go on") from None


def _asked(stop: threading.Event | None) -> Halted:
    """Whether somebody asked to stop."""
    return (lambda: False) if stop is None else stop.is_set


def march_seconds(plan: Plan, threads: int | None = None, repeats: int = 1) -> float:
    """Wall time of marching every variant once with the study's sensors alone, without compiling, tabulating, and
    gathering results; the mean over ``repeats`` marches in a row."""
    nothing, stride = np.zeros(0, dtype=np.int64), plan.base.scheme.stride
    groups, workers = plan.groups, threads or cores()
    tables = [SceneTables(b.scene, b.steps, plan.asked.window, "sensors", stride) for b in groups]
    chunks = list(plan.chunks(None, -(-plan.size // (4 * workers)))) * repeats
    if stride > 1:
        pairs = [(tables[n], plan.values(groups[n], padded(part)), nothing, part.size) for n, part in chunks]
        return seconds_of_jobs([partial(march_pair, *pair) for pair in pairs], workers) / repeats
    marches = [prepare(tables[n], plan.values(groups[n], padded(part)), nothing) for n, part in chunks]
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


def _first_steps(grid: SceneGrid) -> None:
    """March one variant over the first segment of a scene with hardly any steps."""
    tables = SceneTables(grid.scene, 4, grid.asked.window, refinement=2)
    with suppress(Gone):
        values = in_whole_blocks(grid.values.part(np.zeros(1, dtype=np.int64)))
        march_scheme(tables, values, np.zeros(0, dtype=np.int64), 1, lambda: True)
