"""Jobs on the workers of a dask scheduler: processes of this machine, or whatever has joined a scheduler elsewhere.

The only file that knows `distributed`. A subject is sent to every worker once, jobs carry names and lanes alone, and
what they find comes back to this process, the only one that writes. A job whose worker died is done again, alone, and
cut in two, down to the variant that ends every process.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import dask
import numpy as np
from distributed import Client, Future, KilledWorker, LocalCluster, Worker, WorkerPlugin
from distributed.security import Security

from engine.accuracy.jobs import Halted, Job
from engine.batch.addresses import is_here
from engine.batch.handshake import Computer, check_computer, own_computer
from engine.batch.processes import environment
from engine.linear_algebra import one_thread
from engine.march.stepper import Halted as Gone
from results_schema.arrays import Counts
from results_schema.errors import BadInput, WorkersGaveUp

T = TypeVar("T")

MOST_DEATHS = 3  # of processes in which a variant was alone, until it is what ends them
AHEAD = 2  # jobs per thread that are handed out at once, so that none waits for the next
ANSWER_SECONDS = 10.0  # for a scheduler to answer at first
LOST_SECONDS = 60.0  # without any worker: one that died is back after two or three
LOOK_SECONDS = 1.0  # between two looks at who is there
QUIET = {
    "distributed.scheduler.allowed-failures": 0,  # deaths are counted here
    "distributed.scheduler.http.routes": [],  # no pages: its web server, which cannot be left out, answers nothing
    "distributed.admin.large-graph-warning-threshold": "1TB",
}
KEPT = "finished work is kept, run again to resume"


@contextmanager
def on_this_machine(count: int, threads: int, memory: int | None = None) -> Iterator[Workers]:
    """So many processes of this machine with so many threads each, that listen on its loopback alone. memory: bytes
    that each may take, an equal part of the machine's unless given."""
    memory = memory or os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // count
    for talker in ("asyncio", "distributed.batched"):  # what they have to say is said below
        logging.getLogger(talker).setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        try:
            stack.enter_context(dask.config.set(QUIET))
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=0,
                    host="127.0.0.1",
                    protocol="tcp",
                    dashboard_address="127.0.0.1:0",
                    scheduler_kwargs={"dashboard": False},
                    silence_logs=logging.CRITICAL,
                )
            )
            client = stack.enter_context(Client(cluster, set_as_default=False))
            processes = Processes((cluster.scheduler_address, str(threads), str(memory)))
            stack.callback(processes.end)
            processes.keep(count)
        except (OSError, RuntimeError) as error:
            what, remedy = str(error) or type(error).__name__, "allow more open files (ulimit -n), or use threads"
            raise WorkersGaveUp(f"they cannot be started ({what})", where="workers", remedy=remedy) from error
        own_computer()  # compiles kernels, if they are not, once for all
        with _answers(cluster.scheduler_address):
            _wait_for(client, count, processes)
        yield Workers(client, threads, partial(processes.keep, count))


class Processes:
    """Worker processes of this machine. arguments: of `engine.batch.worker_process`."""

    def __init__(self, arguments: tuple[str, ...]) -> None:
        self._command = [sys.executable, "-m", "engine.batch.worker_process", *arguments]
        self._environment = environment()
        self._running: list[subprocess.Popen[bytes]] = []

    def keep(self, count: int) -> None:
        """Start as many as there are to be, those that have ended anew."""
        self._running = [one for one in self._running if one.poll() is None]
        for _ in range(count - len(self._running)):
            quiet = subprocess.DEVNULL
            self._running.append(
                subprocess.Popen(
                    self._command, env=self._environment, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet
                )
            )

    def end(self) -> None:
        """End them at once: nothing of theirs is wanted any more."""
        for one in self._running:
            one.kill()
        for one in self._running:
            one.communicate()


def _wait_for(client: Client, count: int, processes: Processes) -> None:
    """Wait until so many have joined, or any in as much time as they have; those that end meanwhile are started anew.
    Raises TimeoutError."""
    end = time.monotonic() + LOST_SECONDS
    while len(there := client.nthreads()) < count and (not there or time.monotonic() < end):
        if time.monotonic() > end:
            raise TimeoutError
        processes.keep(count)
        time.sleep(0.1)


@contextmanager
def of_scheduler(address: str) -> Iterator[Workers]:
    """The workers of a scheduler. Raises BadInput where one of them computes otherwise than this process or is met
    without TLS on another host, WorkersGaveUp where none answers."""
    try:
        security = Security(require_encryption=True) if address.startswith("tls:") else Security()
        client = Client(address, timeout=ANSWER_SECONDS, security=security, set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise WorkersGaveUp("no scheduler answers there", where=address, remedy="start one, or wait for it") from error
    with client, dask.config.set(QUIET):
        with _answers(address):
            client.wait_for_workers(1, timeout=LOST_SECONDS)
        threads = client.nthreads()
        if address.startswith("tcp:"):
            _check_hosts(threads)
        yield Workers(client, max(threads.values()))


@contextmanager
def _answers(address: str) -> Iterator[None]:
    """Raises WorkersGaveUp where no worker joins in time."""
    try:
        yield
    except (OSError, TimeoutError) as error:
        raise WorkersGaveUp("no worker has joined the scheduler", where=address) from error


def _check_hosts(workers: Sequence[str] | Any) -> None:
    for worker in workers:
        host = worker.partition("://")[2].rpartition(":")[0].strip("[]")
        if not is_here(host):
            what = "a worker on another host is met by TLS alone"
            raise BadInput(what, where="scheduler", expected="workers at 127.0.0.1, or tls://", received=worker)


@dataclass(frozen=True)
class _Try:
    """A job on its way, after so many deaths of workers that had it."""

    job: Job[Any]
    deaths: int = 0

    @property
    def halves(self) -> list[_Try]:
        """The same in two parts."""
        return [_Try(replace(self.job, lanes=part), 1) for part in np.array_split(self.job.lanes, 2)]


class Workers:
    """Workers of a scheduler, as a place. slots: threads of all of them. beside: threads of each. revive: starts those
    anew that have ended."""

    threads = 1  # dask gives a worker a job for each of its threads

    def __init__(self, client: Client, beside: int, revive: Callable[[], object] = lambda: None) -> None:
        self.beside = beside
        self.client, self._revive = client, revive
        self.slots, self._looked, self._seen = 0, -np.inf, time.monotonic()
        self._key = ""
        self._subject: Any = object()  # nobody has sent it, whatever a subject is
        self._check_computers()

    @property
    def apart(self) -> Workers:
        """As all are."""
        return self

    def share_out(
        self,
        subject: Any,
        jobs: Sequence[Job[T]],
        sink: Callable[[T], object],
        halted: Halted,
        *,
        grace: float = np.inf,
    ) -> Sequence[Counts]:
        """As of `engine.batch.executors.Place`; jobs in flight are not waited for."""
        self._send(subject)
        key = self._key
        waiting, suspects = deque(map(_Try, jobs)), deque[_Try]()
        running, ended = dict[str, tuple[_Try, Future[Any]]](), queue.SimpleQueue[tuple[str, Any]]()
        crashed: list[Counts] = []
        try:
            while waiting or suspects or running:
                if halted():
                    raise Gone
                self._look()
                while one := self._next(waiting, suspects, len(running)):
                    future = self._submit(key, one, ended)
                    running[str(future.key)] = one, future
                with suppress(queue.Empty):
                    name, found = ended.get(timeout=0.05)
                    one = running.pop(name)[0]
                    if isinstance(found, KilledWorker):
                        _after_death(one, suspects, crashed)
                    elif isinstance(found, MemoryError):
                        suspects.extend(_in_less_memory(one))
                    elif isinstance(found, BaseException):
                        raise _told(found)
                    else:
                        sink(found)
        finally:
            if running:
                self._give_up(key, [future for _, future in running.values()])
        return crashed

    def _next(self, waiting: deque[_Try], suspects: deque[_Try], running: int) -> _Try | None:
        """What to hand out now: suspects alone, so that a death is theirs."""
        if suspects:
            return suspects.popleft() if not running else None
        return waiting.popleft() if waiting and running < AHEAD * self.slots else None

    def _submit(self, key: str, one: _Try, ended: queue.SimpleQueue[tuple[str, Any]]) -> Future[Any]:
        work = pickle.dumps((one.job.function, one.job.lanes))
        future = self.client.submit(_do, own_computer(), key, work, pure=False, retries=0)
        future.add_done_callback(partial(_fetch, ended))
        return future

    def _send(self, subject: Any) -> None:
        """Give a subject to every worker, those too that join later, in place of the last one."""
        if subject is self._subject:
            return
        if self._key:
            with suppress(OSError, ValueError):  # a worker that ends meanwhile forgets it too
                self.client.unregister_worker_plugin(f"wanderlast-{self._key}", nanny=False)
        blob = pickle.dumps(subject, protocol=pickle.HIGHEST_PROTOCOL)
        self._key, self._subject = hashlib.sha256(blob).hexdigest(), subject
        sent = Sent(self._key, blob)
        self._asked(partial(self.client.register_plugin, sent, name=f"wanderlast-{self._key}"))

    def _give_up(self, key: str, futures: list[Future[Any]]) -> None:
        """Let those jobs end."""
        if self.client.status == "running":
            with suppress(Exception):
                self.client.run(_halt, key, wait=False)
                self.client.cancel(futures)

    def _look(self) -> None:
        """See who is there. Raises WorkersGaveUp where nobody is any more."""
        if self.client.status != "running":
            raise WorkersGaveUp("the connection to the scheduler is lost", remedy=KEPT)
        self._revive()
        now = time.monotonic()
        if now < self._looked + LOOK_SECONDS:
            return
        self._looked = now
        with suppress(OSError):
            self.slots = sum(self.client.nthreads().values())
        if self.slots:
            self._seen = now
        elif now > self._seen + LOST_SECONDS:
            raise WorkersGaveUp(f"no worker has been there for {LOST_SECONDS:.0f} s", remedy=KEPT)

    def _asked(self, question: Callable[[], T]) -> T:
        """The answer to what is asked of all workers; again where one of them ends meanwhile."""
        while True:
            self._look()
            try:
                return question()
            except OSError:  # of dask's too
                time.sleep(LOOK_SECONDS)

    def _check_computers(self) -> None:
        """Refuse workers that compute otherwise. Raises BadInput."""
        try:
            found = self._asked(partial(self.client.run, own_computer))
        except ImportError as error:
            what = f"this program is not installed where a worker is ({error})"
            raise BadInput(what, where="scheduler", remedy="install the same version there") from error
        for address, computer in found.items():
            check_computer(computer, address)


def _after_death(one: _Try, suspects: deque[_Try], crashed: list[Counts]) -> None:
    """What becomes of a job whose worker died: once it may have been another's fault."""
    again = replace(one, deaths=one.deaths + 1)
    if one.job.lanes.size > 1 and one.deaths:
        suspects.extend(again.halves)
    elif one.deaths < MOST_DEATHS:
        suspects.append(again)
    else:
        crashed.append(one.job.lanes)


def _in_less_memory(one: _Try) -> list[_Try]:
    if one.job.lanes.size > 1:
        return one.halves
    what = "the memory of a worker is too small for a single variant"
    raise WorkersGaveUp(what, remedy="fewer workers; finished work is kept")


def _told(error: BaseException) -> BaseException:
    """What else went wrong in a worker, as the caller is to know it."""
    if type(error).__name__ in ("CancelledError", "FutureCancelledError", "CommClosedError"):
        return WorkersGaveUp("the connection to the scheduler is lost", remedy=KEPT)
    return error


def _fetch(ended: queue.SimpleQueue[tuple[str, Any]], future: Future[Any]) -> None:
    """What a job found, or what it raised."""
    try:
        found: Any = future.result()
    except BaseException as error:
        found = error
    ended.put((str(future.key), found))


# What follows happens in workers.

_HALTED: set[str] = set()
_BLOBS: dict[str, bytes] = {}
_SUBJECTS: dict[str, Any] = {}
_LOCK = threading.Lock()


def _do(expected: Computer, key: str, work: bytes) -> Any:
    """One job."""
    if expected != own_computer():
        raise WorkersGaveUp("a worker came later that computes with other versions", remedy=KEPT)
    function, lanes = pickle.loads(work)
    with one_thread():
        return function(_subject(key), lanes, lambda: key in _HALTED)


def _subject(key: str) -> Any:
    with _LOCK:
        if key not in _SUBJECTS:
            _SUBJECTS[key] = pickle.loads(_BLOBS[key])
        return _SUBJECTS[key]


def _halt(key: str) -> None:
    _HALTED.add(key)


class Sent(WorkerPlugin):
    """A subject on a worker; made of its text when the first job asks for it."""

    def __init__(self, key: str, blob: bytes) -> None:
        self.key, self.blob = key, blob

    def setup(self, worker: Worker) -> None:
        """Keep it."""
        _HALTED.discard(self.key)
        _BLOBS[self.key] = self.blob

    def teardown(self, worker: Worker) -> None:
        """Forget it."""
        _HALTED.add(self.key)
        _BLOBS.pop(self.key, None)
        _SUBJECTS.pop(self.key, None)
