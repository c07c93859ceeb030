"""Jobs in processes of this machine that get them through pipes, which nobody else can reach.

For studies of many scenes: most of what such a march takes is Python, in which threads wait for each other.
"""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import numpy as np

from engine.accuracy.jobs import Halted, Job
from engine.batch.handshake import own_computer
from engine.batch.queues import WAITING, next_of, put
from results_schema.arrays import Counts
from results_schema.errors import WorkersGaveUp

T = TypeVar("T")
KEPT = "finished work is kept"


class Found(NamedTuple):
    """What a job found in its process."""

    what: Any

    def value(self) -> Any:
        """It."""
        return self.what


class Raised(NamedTuple):
    """What a job raised in its process."""

    error: BaseException

    def value(self) -> Any:
        """Raise it."""
        raise self.error


@contextmanager
def on_cores(count: int) -> Iterator[Cores]:
    """So many processes, as long as the block lasts. Raises WorkersGaveUp where they cannot be started."""
    own_computer()  # compiles kernels, if they are not, once for all
    found = Cores(count)
    try:
        for number in range(count):
            found.process(number)
        yield found
    finally:
        found.end()


@dataclass(eq=False)
class Cores:
    """As of `engine.batch.executors.Place`; each process has one thread."""

    slots: int
    beside: int = 1
    threads: int = 1
    _running: dict[int, subprocess.Popen[bytes]] = field(default_factory=dict)

    @property
    def apart(self) -> Cores:
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
        """As of `Place`; jobs in flight are not waited for, and what ends a process ends the run."""
        blob, left, ended = pickle.dumps(subject, protocol=pickle.HIGHEST_PROTOCOL), deque(jobs), threading.Event()
        results = queue.Queue[Any](maxsize=WAITING * self.slots)
        given = blob, left, results, ended.is_set
        talkers = [threading.Thread(target=self._talk, args=(n, *given), daemon=True) for n in range(self.slots)]
        for talker in talkers:
            talker.start()
        missing = len(jobs)
        try:
            while missing:
                found = next_of(results, halted).value()
                missing -= 1
                sink(found)
        finally:
            ended.set()
            if missing:
                self.end()
            for talker in talkers:
                talker.join()
        return ()

    def _talk(self, number: int, blob: bytes, left: deque[Job[T]], results: queue.Queue[Any], ended: Halted) -> None:
        """Hand jobs to one process, one after another."""
        try:
            process = self.process(number)
            assert process.stdin is not None and process.stdout is not None
            send(process.stdin, blob)
            while not ended():
                try:
                    job = left.popleft()
                except IndexError:
                    return
                send(process.stdin, (job.function, job.lanes))
                put(results, pickle.load(process.stdout), ended)
        except BaseException as error:
            what = f"a process of this machine has ended ({type(error).__name__}: {error})"
            remedy = f"run with --workers {self.slots}, which finds the variant that ends one; {KEPT}"
            put(results, Raised(WorkersGaveUp(what, where="processes", remedy=remedy)), ended)

    def process(self, number: int) -> subprocess.Popen[bytes]:
        """One of the processes, started anew where it has ended. Raises WorkersGaveUp."""
        if number not in self._running:
            command, pipe = [sys.executable, "-m", "engine.batch.core_process"], subprocess.PIPE
            ways: dict[str, Any] = {"stdin": pipe, "stdout": pipe, "stderr": subprocess.DEVNULL}
            try:  # in a session of its own: Ctrl-C goes to all processes of a terminal, and is this one's to hear
                self._running[number] = subprocess.Popen(command, env=environment(), start_new_session=True, **ways)
            except (OSError, TypeError) as error:  # TypeError: a Python inside another program has no executable
                what = f"processes cannot be started ({error})"
                raise WorkersGaveUp(what, where="processes", remedy="run with --threads 1") from error
        return self._running[number]

    def end(self) -> None:
        """End them at once: nothing of theirs is wanted any more."""
        for process in self._running.values():
            process.kill()
        for process in self._running.values():
            process.communicate()
        self._running.clear()


def environment() -> Mapping[str, str]:
    """That of a process beside this one, whose libraries keep to one thread, and which finds the same packages."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    known = os.pathsep.join(os.path.abspath(folder) for folder in sys.path)
    return os.environ | threads | {"PYTHONPATH": known}


def send(stream: Any, what: object) -> None:
    pickle.dump(what, stream, protocol=pickle.HIGHEST_PROTOCOL)
    stream.flush()
