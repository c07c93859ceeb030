"""Work on some variants, cut into jobs that any thread of this process, or another process, can do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from results_schema.arrays import Counts

T = TypeVar("T")
NOBODY: Counts = np.zeros(0, dtype=np.int64)
Halted = Callable[[], bool]
Told = Callable[[int, int], object]  # how many are done, and of how many


def untold(done: int, of: int) -> None:
    """Nobody asks how many are done."""


@dataclass(frozen=True)
class Job(Generic[T]):
    """Work on some variants of a subject. function: of the subject, the lanes and what tells whether to give up;
    pickle knows it by its name. lanes: numbers of the variants, whatever the subject counts them by; what is found of
    parts of them, one part after the other, is worth as much as what is found of all."""

    function: Callable[[Any, Counts, Halted], T]
    lanes: Counts


class Share(Protocol):
    """What does jobs: in turn, on threads, or in other processes."""

    def __call__(self, subject: Any, jobs: Sequence[Job[T]], told: Told = untold) -> Iterable[T]:
        """What jobs on a subject find, in any order, each finding saying what it is of. A job may be cut. told: of how
        many are done. Raises Halted, and Crashed where some variants end the process that computes them."""


class Crashed(Exception):
    """Some variants end every process that computes them. lanes: as their jobs number them."""

    def __init__(self, lanes: Counts) -> None:
        super().__init__(lanes)
        self.lanes = lanes


def over_scenes(
    share: Share, subject: Any, function: Callable[..., T], parts: Sequence[Counts], told: Told = untold
) -> list[T]:
    """What a function of the subject, some variants, what shares their jobs out and their scene finds of every scene's
    part of the variants, in any order. told: of how many of several scenes are done.

    The marches of a single scene are shared out, several scenes are as wholes, as jobs that wait for jobs would hold
    threads."""
    scenes = [(scene, part) for scene, part in enumerate(parts) if part.size]
    if len(scenes) == 1:
        return [function(subject, part, share, scene) for scene, part in scenes]
    jobs = [Job(partial(_whole_scene, function=function, scene=scene), part) for scene, part in scenes]
    return list(share(subject, jobs, told))


def _whole_scene(subject: Any, lanes: Counts, halted: Halted, function: Callable[..., T], scene: int) -> T:
    return function(subject, lanes, InTurn(halted), scene)


@dataclass(frozen=True)
class InTurn:
    """Jobs one after the other, where they are asked for."""

    halted: Halted = lambda: False

    def __call__(self, subject: Any, jobs: Sequence[Job[T]], told: Told = untold) -> list[T]:
        """What the jobs find, in their order."""
        found = list[T]()
        for job in jobs:
            found.append(job.function(subject, job.lanes, self.halted))
            told(len(found), len(jobs))
        return found
