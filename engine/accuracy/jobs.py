"""Work on some variants, cut into jobs that any thread of this process, or another process, can do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from results_schema.arrays import Counts

T = TypeVar("T")
Halted = Callable[[], bool]


@dataclass(frozen=True)
class Job(Generic[T]):
    """Work on some variants of a subject. function: of the subject, the lanes and what tells whether to give up;
    pickle knows it by its name. lanes: numbers of the variants, whatever the subject counts them by; what is found of
    parts of them, one part after the other, is worth as much as what is found of all."""

    function: Callable[[Any, Counts, Halted], T]
    lanes: Counts


class Share(Protocol):
    """What does jobs: in turn, on threads, or in other processes."""

    def __call__(self, subject: Any, jobs: Sequence[Job[T]]) -> Iterable[T]:
        """What jobs on a subject find, in any order, each finding saying what it is of. A job may be cut. Raises
        Halted, and Crashed where some variants end the process that computes them."""


class Crashed(Exception):
    """Some variants end every process that computes them. lanes: as their jobs number them."""

    def __init__(self, lanes: Counts) -> None:
        super().__init__(lanes)
        self.lanes = lanes


@dataclass(frozen=True)
class InTurn:
    """Jobs one after the other, where they are asked for."""

    halted: Halted = lambda: False

    def __call__(self, subject: Any, jobs: Sequence[Job[T]]) -> list[T]:
        """What the jobs find, in their order."""
        return [job.function(subject, job.lanes, self.halted) for job in jobs]
