"""How to run a study: nothing that changes a result."""

from __future__ import annotations

from dataclasses import dataclass

from results_schema.errors import BadInput


@dataclass(frozen=True)
class RunOptions:
    """threads: None takes all cores. scheduler: address of a dask scheduler. Raises BadInput for what cannot be."""

    overwrite: bool = False
    threads: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.scheduler is not None:
            what, where, received = "running on a dask scheduler is not built yet", "--scheduler", self.scheduler
            raise BadInput(what, where=where, received=received, remedy="leave it out: the study runs on this machine")
