"""Files of models for the tests of bodies, read in the tests' own process."""

import pytest

from engine.bodies.imported import imported
from tests.bodies.frames import PINNED, straight
from tests.bodies.models import Files, in_process


@pytest.fixture
def own_process() -> None:
    """Asked for by tests of the process that reads files."""


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Other tests read files here, as a process for each takes a second or more."""
    if "own_process" not in request.fixturenames:
        monkeypatch.setattr(imported, "read_files", in_process)


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """A pinned frame of 16 elements, which nothing may change."""
    return Files(tmp_path_factory.mktemp("held"), straight(PINNED, elements=16))
