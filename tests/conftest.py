"""What tests run in: one thread of linear algebra, whose matrices are small here, and whose idle threads spin; bytecode
that is kept, without which every command that a test starts compiles some 200 files again, a twentieth of the time.

And with NO_SKIPS set in the environment a skipped test fails.
"""

import gc
import os
from collections.abc import Generator
from pathlib import Path

import pytest

from results_schema.garbage import collect_seldom

collect_seldom()
for _library in ("OPENBLAS", "OMP", "MKL"):  # before numpy is imported, and for processes that tests start
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # as images of containers often set it


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish() -> None:
    """pytest looks at all objects there are ten times after its last test, for what failed while it was deleted: once
    tells that."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, and a screen wide enough for sentences."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "300")
    return tmp_path


def _failed(report: pytest.CollectReport | pytest.TestReport) -> None:
    if os.environ.get("NO_SKIPS") and report.skipped:
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid} was skipped: {report.longrepr}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    _failed(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    _failed(report)
    return report
