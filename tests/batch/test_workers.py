"""Workers: the same bits, whatever dies; what ends every process is found; whom a study is not given to."""

import errno
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.accuracy.jobs import Halted, Job
from engine.batch import chunk as chunk_of_plan
from engine.batch.chunk import march_chunk
from engine.batch.execution import execute
from engine.batch.executors import Place, Threads
from engine.batch.handshake import check_computer, own_computer
from engine.batch.plan import Plan, make_plan
from engine.batch.workers import Processes, Workers, of_scheduler, on_this_machine
from engine.scene.study import Study
from results_schema.arrays import Counts
from results_schema.errors import BadInput, WorkersGaveUp
from results_schema.status import Status
from results_schema.store.archive import open_archive
from results_schema.store.rows import Chunk, Collector
from tests.accuracy.chosen import sweep
from tests.engine.build import beam, cruise, mass, study
from tests.studies.every_way import assert_same_archives
from tests.studies.small import ROOT, finish, write

POISON = 11


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with on_this_machine(2, 1) as found:
        yield found


def small() -> Study:
    """48 variants of two scenes, a few of which keep histories."""
    sweep = {
        "weight": {"of": "carriage.car.mass", "from": 0.05, "to": 1.0, "count": 24},
        "length": {"of": "body.bed.length", "values": [1.0, 1.1]},
    }
    everything = {"steps": 100, "fidelity": "full", "scheme": "average-acceleration", "tolerance": 0.5}
    return study(
        beam(modes=2), mass(0.5, cruise(0.0, 1.0, 1.0)), sweep=sweep, solver=everything, output={"histories": "auto"}
    )


@cache
def on_threads() -> Collector:
    """Its results, found here."""
    return marched(Threads(1))


def marched(here: Place, chunk: int | None = None) -> Collector:
    """The study, run there."""
    plan = make_plan(small())
    found = Collector(plan.size)
    execute(plan, found.add, here, chunk=chunk)
    return found


def assert_same_bits(found: Collector, besides: tuple[int, ...] = ()) -> None:
    """As on threads, but for some variants."""
    whole, rest = on_threads(), np.setdiff1d(np.arange(48), besides)
    assert set(found.arrays) == set(whole.arrays) and found.finished.all()
    for name, array in whole.arrays.items():
        assert found.arrays[name][rest].tobytes() == array[rest].tobytes(), name


@pytest.mark.fault(20)
def test_workers_find_the_same_bits(workers: Workers) -> None:
    found = marched(workers)
    assert_same_bits(found)
    mine, theirs = on_threads().selected, found.selected
    assert mine is not None and theirs is not None and mine.variants.size == 48
    for name, array in mine.arrays.items():
        assert np.ascontiguousarray(theirs.arrays[name]).tobytes() == np.ascontiguousarray(array).tobytes(), name


def pids(here: Workers) -> list[int]:
    """Of the processes that are there."""
    return list(here.client.run(os.getpid).values())


def nap(subject: None, lanes: Counts, halted: Halted) -> int:
    """A job that takes its time."""
    time.sleep(0.3)
    return int(lanes.sum())


NAPS = [Job(nap, np.array([number])) for number in range(40)]


@pytest.mark.fault(31)
@pytest.mark.slow
def test_what_a_killed_worker_had_is_done_again(workers: Workers) -> None:
    """Of two, one dies twice, after 2 s, while jobs of 12 s are done, and once others have done some since, as workers
    may take longer to start; what is found later has the same bits."""
    ended, killed, had = threading.Event(), list[int](), 0

    def kill() -> None:
        nonlocal had
        while len(killed) < 2 and not ended.wait(2.0):
            if len(found) == had:
                continue
            had = len(found)
            with suppress(OSError, ProcessLookupError):  # it may be gone already
                killed.append(pids(workers)[0])
                os.kill(killed[-1], signal.SIGKILL)

    killer, found = threading.Thread(target=kill), list[int]()
    killer.start()
    try:
        crashed = workers.share_out(None, NAPS, found.append, lambda: False)
    finally:
        ended.set()
        killer.join()
    assert len(set(killed)) >= 2 and not crashed
    assert sorted(found) == list(range(40))
    assert_same_bits(marched(workers, 7))


@pytest.mark.fault(31)
def test_a_worker_killed_as_it_starts_is_started_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    keep, killed = Processes.keep, list[int]()

    def kill_the_first(self: Processes, count: int) -> None:
        keep(self, count)
        if not killed:
            killed.append(self._running[0].pid)
            self._running[0].kill()

    monkeypatch.setattr(Processes, "keep", kill_the_first)
    with on_this_machine(1, 1) as here:
        assert killed and pids(here)[0] != killed[0]


@pytest.mark.fault(34)
@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("LocalCluster", RuntimeError("Cluster failed to start")),
        ("Client", TimeoutError()),
        ("subprocess.Popen", OSError(errno.EMFILE, "Too many open files")),
    ],
)
def test_workers_that_cannot_be_started_are_given_up(
    name: str, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where few files may be open, say."""

    def fails(*arguments: Any, **options: Any) -> None:
        raise error

    monkeypatch.setattr(f"engine.batch.workers.{name}", fails)
    with pytest.raises(WorkersGaveUp, match="cannot be started") as found, on_this_machine(1, 1):
        pass
    assert (str(error) or "TimeoutError") in str(found.value)


def greedy(most: int, lanes: Counts, halted: Halted) -> int:
    """A job that finds no memory for more than so many variants."""
    if lanes.size > most:
        raise MemoryError
    return int(lanes.sum())


@pytest.mark.fault(33)
def test_jobs_without_memory_are_cut_smaller_down_to_a_variant(workers: Workers) -> None:
    found, jobs = list[int](), [Job(greedy, np.arange(12))]
    assert not workers.share_out(3, jobs, found.append, lambda: False)
    assert len(found) == 4 and sum(found) == 66
    with pytest.raises(WorkersGaveUp, match="memory of a worker is too small"):
        workers.share_out(0, jobs, found.append, lambda: False)


@pytest.fixture
def scheduler() -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A scheduler of its own, with one worker: its address and process."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    host, port = address.split(":")
    first = ["scheduler", "--host", host, "--port", port, "--no-dashboard"]
    second = ["worker", f"tcp://{address}", "--host", host, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    folder = Path(__file__).parents[2]
    started = [
        subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            env=os.environ | {"PYTHONPATH": str(folder)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        for arguments in (first, second)
    ]
    yield f"tcp://{address}", started[0]
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.fault(34)
def test_a_scheduler_that_is_lost_ends_the_run_with_what_is_finished(
    scheduler: tuple[str, subprocess.Popen[str]],
) -> None:
    address, process = scheduler
    found = list[int]()

    def lose_after_three(number: int) -> None:
        found.append(number)
        if len(found) == 3:
            process.kill()

    with of_scheduler(address) as here:
        assert_same_bits(marched(here))
        with pytest.raises(WorkersGaveUp, match="scheduler is lost"):
            here.share_out(None, NAPS, lose_after_three, lambda: False)
    assert 3 <= len(found) < 40


@pytest.mark.fault(35)
@pytest.mark.parametrize("name", ["numpy", "the program", "the arithmetic of a sample"])
def test_a_worker_that_computes_otherwise_is_refused(name: str) -> None:
    check_computer(own_computer(), "tcp://127.0.0.1:1")
    with pytest.raises(BadInput, match=f"{name} of this worker is not as here"):
        check_computer({**own_computer(), name: "other"}, "tcp://127.0.0.1:1")


def poisoned(plan: Plan, variants: Counts, halted: Halted, group: int, beside: int) -> Chunk:
    """A chunk that ends its process where a certain variant is among its own."""
    if POISON in variants:
        os.kill(os.getpid(), signal.SIGKILL)
    return march_chunk(plan, variants, halted, group, beside)


@pytest.mark.fault(32)
@pytest.mark.slow
def test_a_variant_that_ends_every_process_is_found(workers: Workers, monkeypatch: pytest.MonkeyPatch) -> None:
    on_threads()  # of this process, which is not to end
    monkeypatch.setattr(chunk_of_plan, "march_chunk", poisoned)
    found = marched(workers, 4)
    assert_same_bits(found, (POISON,))
    assert np.flatnonzero(found.arrays["status"] == Status.CRASHED).tolist() == [POISON]
    numbers = [array[POISON] for array in found.arrays.values() if array.dtype.kind == "f"]
    assert len(numbers) > 10 and all(np.isnan(number).all() for number in numbers)


class Fatal(Threads):
    """Threads of which every variant is said to end every process."""

    def share_out(self, subject: Any, jobs: Sequence[Job[Any]], *rest: Any, **grace: float) -> Sequence[Counts]:
        return [job.lanes for job in jobs]


@pytest.mark.fault(32)
@pytest.mark.parametrize("make", [small, sweep], ids=["marched at once", "with pilots before"])
def test_a_study_of_which_every_variant_ends_its_process_is_given_up(make: Callable[[], Study]) -> None:
    with pytest.raises(WorkersGaveUp, match="ends the process that computes it"):
        execute(make_plan(make()), Collector(48).add, Fatal(1))


# ---- a scheduler and its worker that speak TLS alone, as docs/workers.md says: certificates by openssl ----


WHOSE = ("SCHEDULER", "WORKER", "CLIENT")


def certificate(folder: Path, name: str) -> dict[str, str]:
    """A certificate signed by itself, as dask's configuration names it in environment variables."""
    own, key = folder / f"{name}.pem", folder / f"{name}-key.pem"
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", f"/CN={name}"]
    subprocess.run([*made, "-out", str(own), "-keyout", str(key)], check=True, capture_output=True)
    start = "DASK_DISTRIBUTED__COMM__"
    found = {f"{start}REQUIRE_ENCRYPTION": "true", f"{start}TLS__CA_FILE": str(own)}
    for one in WHOSE:
        found |= {f"{start}TLS__{one}__CERT": str(own), f"{start}TLS__{one}__KEY": str(key)}
    return found


@contextmanager
def running(environment: Mapping[str, str], *arguments: str) -> Iterator[None]:
    """A program of dask, while the block lasts."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments, "--no-dashboard"],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | dict(environment),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.fault(40)
def test_a_scheduler_that_speaks_tls_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own, other = certificate(tmp_path, "own"), certificate(tmp_path, "other")
    write(tmp_path)
    assert finish(tmp_path, "run", "small.toml", "-o", "whole.nc").returncode == 0
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        place, port = f"127.0.0.1:{free.getsockname()[1]}", str(free.getsockname()[1])
    with ExitStack() as stack:
        stack.enter_context(running(own, "scheduler", "--host", "127.0.0.1", "--port", port))
        stack.enter_context(running(own, "worker", f"tls://{place}", "--nthreads", "1", "--no-nanny"))
        for name, address, known, code in (
            ("trusted", f"tls://{place}", own, 0),
            ("in clear", f"tcp://{place}", {}, 70),
            ("without a certificate", f"tls://{place}", {}, 2),
            ("not trusted", f"tls://{place}", other, 70),
        ):
            with monkeypatch.context() as patched:
                for key, value in known.items():
                    patched.setenv(key, value)
                done = finish(tmp_path, "run", "small.toml", "-o", f"{name}.nc", "--scheduler", address)
            assert (done.returncode, (tmp_path / f"{name}.nc").exists()) == (code, code == 0), (name, done.stderr)
    assert_same_archives(open_archive(tmp_path / "trusted.nc"), open_archive(tmp_path / "whole.nc"))
