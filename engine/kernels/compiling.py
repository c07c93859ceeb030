"""Telling people that kernels are compiled, which else would be half a minute of silence."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

WORDS = "compiling kernels for this kind of scene, once on this machine: up to half a minute"


def log(words: str) -> None:
    """Tell who uses the package from Python, on standard error unless logging is set up otherwise."""
    logging.getLogger("wanderlast").warning(words)


@contextmanager
def told_of_compiling(tell: Callable[[str], object] = log) -> Iterator[Callable[[], float]]:
    """Tell once if a kernel is compiled meanwhile, as the cache on the disk does not hold it; yields the seconds, as of
    `seconds_of_compiling`."""
    from numba.core import event

    class First(event.Listener):
        """Tells of the first one."""

        told = False

        def on_start(self, _: object) -> None:
            if not self.told:
                self.told = True
                tell(WORDS)

        def on_end(self, _: object) -> None:
            """Nothing to say."""

    with event.install_listener("numba:compile", First()), seconds_of_compiling() as seconds:
        yield seconds


@contextmanager
def seconds_of_compiling() -> Iterator[Callable[[], float]]:
    """What tells for how many seconds kernels have been compiled meanwhile."""
    from numba.core import event

    compiling = event.TimingListener()
    with event.install_listener("numba:compile", compiling):
        yield lambda: compiling.duration if compiling.done else 0.0


@contextmanager
def clock_without_compiling() -> Iterator[Callable[[], float]]:
    """A clock, s, that stands still while kernels are compiled."""
    with seconds_of_compiling() as seconds:
        yield lambda: time.perf_counter() - seconds()
