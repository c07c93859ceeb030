"""Workers: the same bits, whatever dies; what ends every process is found; whom a study is not given to."""

from __future__ import annotations

import os
import random
import signal
import threading
import time
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from engine.accuracy.jobs import Halted
from engine.batch import chunk as chunk_of_plan
from engine.batch.chunk import march_chunk
from engine.batch.execution import execute
from engine.batch.places import Place, Threads
from engine.batch.plan import Plan, make_plan
from engine.batch.workers import Workers, on_this_machine
from engine.scene.study import Study
from results_schema.arrays import Counts
from results_schema.status import Status
from results_schema.store.rows import Chunk, Collector
from tests.engine.build import beam, cruise, mass, study

POISON = 11


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with on_this_machine(2, 1) as found:
        yield found


def small() -> Study:
    """48 variants of two scenes, a few of which keep histories."""
    sweep = {
        "weight": {"of": "carriage.car.mass", "from": 0.05, "to": 1.0, "count": 24},
        "stiffness": {"of": "body.bed.youngs_modulus", "values": [1.0, 1.1]},
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


@pytest.mark.fault(31)
def test_what_a_killed_worker_had_is_done_again(workers: Workers) -> None:
    """Every other second one of them dies."""
    ended = threading.Event()

    def kill() -> None:
        while not ended.wait(2.0):
            for one in random.sample(own := pids(workers), min(1, len(own))):
                os.kill(one, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        assert_same_bits(marched(workers, 7))
    finally:
        ended.set()
        killer.join()


def poisoned(plan: Plan, variants: Counts, halted: Halted, group: int, beside: int) -> Chunk:
    """A chunk that ends its process where a certain variant is among its own."""
    if POISON in variants:
        os.kill(os.getpid(), signal.SIGKILL)
    return march_chunk(plan, variants, halted, group, beside)


@pytest.mark.fault(32)
def test_a_variant_that_ends_every_process_is_found(workers: Workers, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunk_of_plan, "march_chunk", poisoned)
    found = marched(workers)
    assert_same_bits(found, (POISON,))
    assert np.flatnonzero(found.arrays["status"] == Status.CRASHED).tolist() == [POISON]
    numbers = [array[POISON] for array in found.arrays.values() if array.dtype.kind == "f"]
    assert len(numbers) > 10 and all(np.isnan(number).all() for number in numbers)
