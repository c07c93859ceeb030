"""Where jobs are done: on threads of this process, or in other processes."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from numbers import Integral
from typing import Any, Protocol, TypedDict, TypeVar

import numpy as np

from engine.accuracy.jobs import Crashed, Halted, Job, Told, untold
from engine.batch.queues import WAITING, next_of, put
from engine.linear_algebra import one_thread
from results_schema.arrays import Counts
from results_schema.cores import cores
from results_schema.errors import BadInput, WorkersGaveUp

T = TypeVar("T")


class Place(Protocol):
    """Where jobs are done. slots: so many at once. beside: so many of them in one process. apart: where jobs are done
    that use so many ``threads`` themselves."""

    @property
    def slots(self) -> int: ...

    @property
    def beside(self) -> int: ...

    @property
    def threads(self) -> int: ...

    @property
    def apart(self) -> Place: ...

    def share_out(
        self,
        subject: Any,
        jobs: Sequence[Job[T]],
        sink: Callable[[T], object],
        halted: Halted,
        *,
        grace: float = np.inf,
    ) -> Sequence[Counts]:
        """Do jobs on a subject, and hand what they find to ``sink`` as it comes, on the calling thread; the lanes that
        end every process.

        Raises what a job or the sink raised, and Halted, after the jobs in flight have ended or so many seconds of
        ``grace``; WorkersGaveUp.
        """


class Where(TypedDict, total=False):
    """Where a study is run. threads: all cores unless given; of each worker one. workers: processes of this machine;
    none unless given. scheduler: the address of a dask scheduler whose workers are taken."""

    threads: int | None
    workers: int
    scheduler: str | None


@contextmanager
def place(threads: int | None = None, workers: int = 0, scheduler: str | None = None) -> Iterator[Place]:
    """The place, as of `Where`, while the block lasts. Raises BadInput and WorkersGaveUp.

    Its linear algebra keeps to one thread: by several, modes of a portal differ by rounding, and what is told of its
    robots' errors by a tenth and more.
    """
    check_place(threads, workers, scheduler)
    if scheduler is not None:
        from engine.batch.workers import of_scheduler

        with of_scheduler(scheduler) as found:
            yield found
    elif workers:
        from engine.batch.workers import on_this_machine

        with on_this_machine(workers, threads or 1) as found:
            yield found
    else:
        with one_thread():
            yield Threads(threads or cores())


@contextmanager
def in_processes(where: Where) -> Iterator[Place]:
    """The place, as of `Where`; where nobody says, a process for every core, and threads where none can be started."""
    from engine.batch.processes import on_cores

    with ExitStack() as stack:
        found: Place | None = None
        if cores() > 1 and not any(where.values()):
            with suppress(WorkersGaveUp):
                found = stack.enter_context(on_cores(cores()))
        yield found or stack.enter_context(place(**where))


def check_place(threads: int | None = None, workers: int = 0, scheduler: str | None = None) -> None:
    """Refuse what cannot be. Raises BadInput."""
    if threads is not None and not _counts_threads(threads):
        raise BadInput("no threads to run on", where="threads", expected="a whole number >= 1", received=repr(threads))
    if workers < 0:
        raise BadInput("no number of processes", where="workers", expected=">= 0", received=str(workers))
    if scheduler is not None and (workers or threads):
        what = "workers of a scheduler are there already, with threads of their own"
        raise BadInput(what, where="scheduler", remedy="leave out the numbers of workers and threads")
    if scheduler is not None:
        from engine.batch.addresses import check_address

        check_address(scheduler)


def _counts_threads(given: object) -> bool:
    return isinstance(given, Integral) and int(given) >= 1


def check_options(given: Mapping[str, Any], *known: str) -> None:
    """Refuse options that are neither known nor say where to run, and a progress that cannot be told. Raises BadInput
    with the nearest one, or how a study says that."""
    from engine.scene.settings import setting_named
    from engine.study_file.spec import nearest

    options = (*known, *Where.__annotations__)
    for name in given:
        if name not in options:
            expected = f"one of {', '.join(options)}"
            key = setting_named(name)
            remedy = f'the study says that: study.with_values({{"{key}": ...}})' if key else nearest(name, options)
            raise BadInput("unknown option", where=name, expected=expected, remedy=remedy)
    progress = given.get("progress")
    if progress is not None and not callable(progress):
        expected = "a function of what is finished, progress=print say"
        raise BadInput("this cannot be called", where="progress", expected=expected, received=repr(progress))


def check_chunk(chunk: object) -> None:
    """Refuse a number of variants that is none. Raises BadInput."""
    if chunk is not None and (isinstance(chunk, bool) or not isinstance(chunk, int) or chunk < 1):
        raise BadInput("this is no number of variants", where="chunk", expected="1 or more", received=str(chunk))


@dataclass(frozen=True)
class Shared:
    """Shares jobs out to a place, as of `engine.accuracy.jobs.Share`."""

    place: Place
    halted: Halted = lambda: False

    def __call__(self, subject: Any, jobs: Sequence[Job[T]], told: Told = untold) -> list[T]:
        """What the jobs find, in the order in which they end."""
        found: list[T] = []

        def take(one: T) -> None:
            found.append(one)
            told(min(len(found), len(jobs)), len(jobs))  # a job may have been cut

        crashed = self.place.share_out(subject, jobs, take, self.halted)
        if crashed:
            raise Crashed(np.concatenate(crashed))
        return found


@dataclass(frozen=True)
class Threads:
    """So many threads of this process, beside the calling one."""

    threads: int

    @property
    def slots(self) -> int:
        """As many as threads."""
        return self.threads

    @property
    def beside(self) -> int:
        """All of them."""
        return self.threads

    @property
    def apart(self) -> Threads:
        """One after the other: a job takes all threads."""
        return Threads(1)

    def share_out(
        self,
        subject: Any,
        jobs: Sequence[Job[T]],
        sink: Callable[[T], object],
        halted: Halted,
        *,
        grace: float = np.inf,
    ) -> Sequence[Counts]:
        """As of `Place`; what ends a thread ends this process."""
        halt, results = threading.Event(), queue.Queue[Any](maxsize=WAITING * self.threads)
        given_up = partial(_any_of, halt.is_set, halted)
        calls = [partial(_do, partial(job.function, subject, job.lanes, given_up), results, given_up) for job in jobs]
        beside = threading.Thread(target=run_jobs, args=(calls, self.threads), daemon=True)
        beside.start()
        try:
            for _ in jobs:
                found = next_of(results, halted)
                if isinstance(found, BaseException):
                    raise found
                sink(found)
        finally:
            halt.set()
            end = time.monotonic() + grace
            while beside.is_alive() and time.monotonic() < end:
                _drain(results)
                beside.join(0.01)
        return ()


def run_jobs(jobs: Sequence[Callable[[], object]], threads: int) -> None:
    """Jobs on threads, begun in their order; on the caller's own thread where that is to be the only one."""
    if threads == 1:
        for job in jobs:
            job()
        return
    pool = ThreadPoolExecutor(threads)
    try:
        for done in [pool.submit(job) for job in jobs]:
            done.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _do(job: Callable[[], object], results: queue.Queue[Any], given_up: Halted) -> None:
    """One job; what it raises travels to the caller as its result."""
    if given_up():
        return
    try:
        found: object = job()
    except BaseException as error:
        found = error
    put(results, found, given_up)


def _drain(results: queue.Queue[Any]) -> None:
    while not results.empty():
        results.get_nowait()


def _any_of(*asked: Halted) -> bool:
    return any(ask() for ask in asked)
