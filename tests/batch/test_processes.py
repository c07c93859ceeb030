"""Processes for studies of many scenes: the same bits as threads; what jobs raise, and what ends one."""

import os
import signal
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

import studies
from engine.accuracy.jobs import Halted, Job
from engine.batch import executors
from engine.batch.chunk import MOST_IN_JOB, jobs_of
from engine.batch.execution import choose
from engine.batch.executors import Threads, in_processes
from engine.batch.plan import FEW_CLIMBING, FEW_CONVERGING, FEW_SCENES, make_plan
from engine.batch.processes import Cores, on_cores
from engine.march.stepper import Halted as Gone
from engine.scene.study import Study
from results_schema.arrays import Counts
from results_schema.errors import BadInput, WorkersGaveUp
from studies.protocol.study import kind_of
from tests.engine.build import beam, cruise, mass, study


@pytest.fixture(scope="module")
def cores() -> Iterator[Cores]:
    with on_cores(2) as found:
        yield found


def of_many_scenes(count: int = FEW_SCENES + 12) -> Study:
    """So many scenes of two variants, whose numerics are fixed so that pilots are cheap."""
    fixed = {"steps": 100, "fidelity": "full", "scheme": "average-acceleration", "tolerance": 0.5, "audit": 2}
    sweep = {
        "length": {"of": "body.bed.length", "from": 1.0, "to": 1.5, "count": count},
        "weight": {"of": "carriage.car.mass", "values": [0.1, 0.4]},
    }
    return study(beam(modes=2), mass(0.5, cruise(0.0, 1.0, 1.0)), kind="passage", solver=fixed, sweep=sweep)


def of_many_variants(scenes: int) -> Study:
    """So many scenes for which pilots choose."""
    weights = {"of": "carriage.car.mass", "from": 0.1, "to": 0.4, "count": 300}
    return of_many_scenes(scenes).with_values({"sweep.weight": weights})


def test_many_scenes_are_run_in_processes_and_give_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nobody says otherwise; a machine may have one core."""
    monkeypatch.setattr(executors, "cores", lambda: 2)
    given = of_many_scenes()
    parts = kind_of(given).parts(given)
    with parts.place({}) as here:
        assert type(here).__name__ == "Cores" and here.slots == 2
    with parts.place({"threads": 1}) as here:
        assert type(here).__name__ == "Threads" and here.threads == 1
    for few in (of_many_scenes(FEW_CONVERGING), of_many_variants(FEW_CLIMBING)):
        with kind_of(few).parts(few).place({}) as here:
            assert type(here).__name__ == "Threads" and here.threads == 2
    for more in (of_many_scenes(FEW_CONVERGING + 1), of_many_variants(FEW_CLIMBING + 1)):
        assert make_plan(more).many_scenes and make_plan(more).memory_bytes > 800 * 2**20
    assert_same_by_processes(given)


def assert_same_by_processes(given: Study) -> None:
    by_processes, by_thread = studies.run(given), studies.run(given, threads=1)
    for name in by_thread.variables:
        np.testing.assert_array_equal(by_processes[name].values, by_thread[name].values, err_msg=str(name))


def test_what_is_marched_without_its_units_is_told_in_these_by_processes_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes did not know what kinds of studies declare: a swept modulus told moments and forces as of another one,
    with status ok."""
    monkeypatch.setattr(executors, "cores", lambda: 2)
    moduli = {"of": "body.bed.youngs_modulus", "values": [1.0, 4.0]}
    moment = {"body": "bed", "at": 0.4, "quantity": "bending_moment"}
    given = of_many_scenes().with_values({"sweep.weight": moduli, "sensor.moment": moment})
    assert make_plan(given).many_scenes
    assert_same_by_processes(given)


def test_short_chunks_are_put_together_and_each_variant_is_in_one_job() -> None:
    given = of_many_scenes()
    plan = make_plan(given)
    choose(plan, Threads(1), None)
    jobs = jobs_of(plan, np.arange(10, dtype=np.int64), None, 2)
    found = np.sort(np.concatenate([job.lanes for job in jobs]))
    np.testing.assert_array_equal(found, np.arange(10, plan.size))
    chunks = sum(1 for _ in plan.chunks(np.arange(10, dtype=np.int64), None))
    assert 32 <= len(jobs) <= chunks / 2 and max(job.lanes.size for job in jobs) <= 2 * MOST_IN_JOB


def squares(subject: float, lanes: Counts, halted: Halted) -> list[float]:
    """A job."""
    if lanes[0] == subject:
        raise BadInput("one of them is bad", where="here")
    return [float(lane) ** 2 for lane in lanes]


def deadly(subject: float, lanes: Counts, halted: Halted) -> list[float]:
    """A job whose variant 3 ends its process."""
    if lanes[0] == subject:
        os.kill(os.getpid(), signal.SIGKILL)
    return squares(-1.0, lanes, halted)


def shared(cores: Cores, subject: float, function: Any, halted: Halted = lambda: False) -> list[list[float]]:
    found: list[list[float]] = []
    jobs = [Job(partial(function), np.array([number])) for number in range(8)]
    cores.share_out(subject, jobs, found.append, halted)
    return sorted(found)


def test_jobs_find_and_raise_as_in_this_process(cores: Cores) -> None:
    """On one subject after another; after an error others are done."""
    assert shared(cores, -1.0, squares) == [[float(n) ** 2] for n in range(8)]
    with pytest.raises(BadInput, match="here: one of them is bad"):
        shared(cores, 3.0, squares)
    assert shared(cores, -2.0, squares) == [[float(n) ** 2] for n in range(8)]


def test_who_asks_to_stop_does_not_wait_for_jobs(cores: Cores) -> None:
    with pytest.raises(Gone):
        shared(cores, -1.0, squares, lambda: True)
    assert len(shared(cores, -1.0, squares)) == 8


@pytest.mark.fault(32)
def test_what_ends_a_process_ends_the_run_with_its_remedy(cores: Cores) -> None:
    """Work that is finished is kept; workers find the variant that does it."""
    with pytest.raises(WorkersGaveUp, match="a process of this machine has ended") as caught:
        shared(cores, 3.0, deadly)
    assert "run with --workers 2, which finds the variant" in str(caught.value) and "work is kept" in str(caught.value)
    assert len(shared(cores, -1.0, squares)) == 8


def test_where_none_can_be_started_threads_do_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any, **__: Any) -> None:
        raise OSError("no more processes")

    monkeypatch.setattr(executors, "cores", lambda: 2)
    monkeypatch.setattr("engine.batch.processes.subprocess.Popen", refused)
    with in_processes({}) as here:
        assert type(here).__name__ == "Threads"
