"""Marches in one go, of robots and of frames that move, that end where somebody asks them to: between their levels, and
within kernels, which look at a flag. Marches segment by segment ask after each (`engine.march.stepper.go`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Event, Thread

import numpy as np
from numpy.typing import NDArray

from engine.march.stepper import Halted

#: s between looks whether somebody asks: nobody waits for it, and to look takes 0.15 ms of a march, its thread with it.
EVERY = 0.1

_asked: ContextVar[Callable[[], bool] | None] = ContextVar("asked", default=None)


@contextmanager
def stoppable(asked: Callable[[], bool]) -> Iterator[None]:
    """Marches of this thread raise Halted once ``asked`` says so.

    >>> with stoppable(lambda: True):
    ...     stop_if_asked()
    Traceback (most recent call last):
        ...
    engine.march.stepper.Halted
    """
    before = _asked.set(asked)
    try:
        yield
    finally:
        _asked.reset(before)


def stop_if_asked() -> None:
    """Raise Halted if somebody has asked to stop."""
    asked = _asked.get()
    if asked is not None and asked():
        raise Halted


@contextmanager
def flagged() -> Iterator[NDArray[np.int64]]:
    """(1,) 0, and 1 once somebody asks to stop: a kernel that sees it may leave its work as it is, as Halted is raised
    in the end."""
    asked, flag, done = _asked.get(), np.zeros(1, dtype=np.int64), Event()
    if asked is None:
        yield flag
        return

    def watch() -> None:
        while not (flag[0] or done.wait(EVERY)):
            flag[0] = asked()

    watcher = Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield flag
    finally:
        done.set()
        watcher.join()
    if flag[0]:
        raise Halted
