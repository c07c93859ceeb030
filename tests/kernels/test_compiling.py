"""People are told once when kernels are compiled, and not where the cache holds them."""

import numba
import pytest

import studies
from engine.kernels.compiling import WORDS, told_of_compiling
from tests.engine.build import beam, cruise, mass, study


def test_it_is_told_once_and_only_when_something_is_compiled() -> None:
    said: list[str] = []
    with told_of_compiling(said.append):
        assert said == []
        for step in (1.0, 2.0):
            numba.njit(lambda x, step=step: x + step)(1.0)
    assert said == [WORDS] and "for this kind of scene" in WORDS  # others have kernels of their own


def test_who_runs_a_study_from_python_is_told(caplog: pytest.LogCaptureFixture) -> None:
    """A first run took half a minute without a word; here something is compiled when progress is told."""
    given = study(beam(modes=2), mass(0.1, cruise(0.0, 1.0, 0.1)), kind="passage", solver={"steps": 100, "audit": 0})
    studies.run(given, threads=1, progress=lambda *_: numba.njit(lambda x: x + 3.0)(1.0))
    assert [record.message for record in caplog.records if record.name == "wanderlast"] == [WORDS]
