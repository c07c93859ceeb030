"""What pilots found is kept while a study runs, for the run that goes on."""

import signal
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from engine.accuracy.choice import Pilots
from engine.accuracy.jobs import Job
from engine.accuracy.ladder import Rungs
from engine.accuracy.reference import Marches
from engine.batch.executors import Threads
from engine.scene.study import Study
from results_schema.errors import Interrupted
from results_schema.store.parts import PartStore
from results_schema.store.tables import Table
from studies.protocol.kept_pilots import NAME
from studies.protocol.parts import Variants, Work
from studies.protocol.stopping import Stop
from studies.protocol.study import kind_of
from tests.accuracy.chosen import LENGTHS, SPEEDS, WEIGHTS, sweep

SWEEPS = {"one scene": sweep(), "three scenes": sweep(sweep=LENGTHS | SPEEDS | WEIGHTS)}


@dataclass(frozen=True)
class Told(Threads):
    """Two threads that tell on whom their jobs were."""

    threads: int = 2
    subjects: list[Any] = field(default_factory=list)

    def share_out(self, subject: Any, jobs: Sequence[Job[Any]], sink: Callable[[Any], object], *others: Any) -> Any:
        """As threads do."""
        self.subjects.append(subject)
        return super().share_out(subject, jobs, sink, *others)

    @property
    def measured(self) -> bool:
        """Whether pilots were marched."""
        return any(isinstance(subject, Marches | Rungs | Pilots) for subject in self.subjects)


class StopsThere(PartStore):
    """Somebody asks to stop as soon as what pilots found is kept."""

    stop: Stop

    def write(self, name: str, part: Mapping[str, Table]) -> Path:
        """Keep a part."""
        if name == NAME:
            self.stop.ask(signal.SIGINT)
        return super().write(name, part)


def computed(store: PartStore, given: Study, work: Work) -> Any:
    """All results."""
    parts = Variants(kind_of(given), given)
    parts.compute(store, work)
    return parts.gather(store)


@pytest.mark.parametrize("name", SWEEPS)
def test_a_run_that_goes_on_measures_no_pilots_again(name: str, tmp_path: Path) -> None:
    given, whole, first, second = SWEEPS[name], Told(), Told(), Told()
    with PartStore(tmp_path / "whole.nc", "key") as store:
        expected = computed(store, given, Work(place=whole))
    with StopsThere(tmp_path / "stopped.nc", "key") as store:
        store.stop = Stop()
        with pytest.raises(Interrupted):
            computed(store, given, Work(place=first, stop=store.stop))
    with PartStore(tmp_path / "stopped.nc", "key") as store:
        assert list(store.finished()) == [NAME]
        found = computed(store, given, Work(place=second))
    assert whole.measured and first.measured and not second.measured
    assert found.identical(expected)
