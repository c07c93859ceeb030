"""Who is told what a run does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple


def _unheard(*what: object) -> None:
    """Nobody wants to know."""


class Listener(NamedTuple):
    """Who is told of a run: progress of what is done and of how much, stage in words of what is being done, note of how
    far that is where nothing is counted yet, remark of what is worth knowing before anything is computed."""

    progress: Callable[[int, int], object] = _unheard
    stage: Callable[[str], object] = _unheard
    note: Callable[[str], object] = _unheard
    remark: Callable[[Sequence[str]], object] = _unheard


NOBODY = Listener()
