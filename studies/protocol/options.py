"""How to run a study: nothing that changes a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from engine.batch.executors import Where


@dataclass(frozen=True)
class RunOptions:
    """threads, workers, scheduler: as of `engine.batch.executors.Where`. Raises BadInput for what cannot be."""

    overwrite: bool = False
    threads: int | None = None
    workers: int = 0
    scheduler: str | None = None

    def __post_init__(self) -> None:
        from engine.batch.executors import check_place

        check_place(**self.where)

    @property
    def where(self) -> Where:
        """Where to run."""
        return {"threads": self.threads, "workers": self.workers, "scheduler": self.scheduler}
