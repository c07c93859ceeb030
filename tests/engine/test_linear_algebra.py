"""Linear algebra keeps to one thread while something of ours computes, and has its own threads again afterwards."""

import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

import studies
from engine.linear_algebra import one_thread
from tests.floating.scenes import sliding_mass

AFTER_A_RUN = """
import scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits
import engine.batch.chunk, engine.batch.execution
from engine.bodies.beam import dimensionless_modes
from tests.engine.build import beam, cruise, mass, study

def threads():
    return {part["num_threads"] for part in threadpool_info() if part["user_api"] == "blas"}

seen = []
decompose, march = dimensionless_modes._jacobi_svd, engine.batch.chunk.march_chunk
dimensionless_modes._jacobi_svd = lambda matrix: seen.append(threads()) or decompose(matrix)
engine.batch.chunk.march_chunk = lambda *given, **more: seen.append(threads()) or march(*given, **more)
given = study(beam(modes=3, supports="clamped-clamped"), mass(0.3, cruise(0.0, 1.0, 1.0)), solver={"steps": 40})
with threadpool_limits(3, user_api="blas"):
    engine.batch.execution.run(given, threads=2)
    assert threads() == {3}, threads()
assert len(seen) >= 2 and all(part == {1} for part in seen), seen
"""


def threads() -> set[int]:
    """Of all libraries of linear algebra, numpy's at least."""
    assert np.linalg.norm(np.eye(2) @ np.ones(2)) > 1.0
    return {library.num_threads for library in ThreadpoolController().select(user_api="blas").lib_controllers}


@pytest.fixture(autouse=True)
def three_threads() -> Iterator[None]:
    with ThreadpoolController().limit(limits=3, user_api="blas"):
        yield


def test_holds_may_overlap() -> None:
    first, second = one_thread(), one_thread()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert threads() == {1}
    second.__exit__(None, None, None)
    assert threads() == {3}


def test_given_back_after_an_error() -> None:
    with pytest.raises(ZeroDivisionError), one_thread():
        assert threads() == {1}
        raise ZeroDivisionError
    assert threads() == {3}


def test_studies_of_frames_that_move_are_computed_by_one_thread() -> None:
    """Whatever computes them; a progress is told between pieces."""
    seen = []
    studies.run(sliding_mass(), progress=lambda done, size: seen.append(threads()))
    assert seen and all(part == {1} for part in seen) and 3 in threads()


def test_a_run_from_python_gives_the_process_its_threads_back() -> None:
    subprocess.run([sys.executable, "-c", AFTER_A_RUN], check=True, timeout=300)
