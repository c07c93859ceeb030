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
    """Tell once if a kernel is compiled meanwhile, as the cache on the disk does not hold it. Yields what says for how
    many seconds kernels have been compiled so far."""
    from numba.core import event

    class Compiling(event.Listener):
        """Tells of the first one; kernels compile those that they call."""

        told, depth, begun, seconds = False, 0, 0.0, 0.0

        def on_start(self, _: object) -> None:
            if not self.told:
                self.told = True
                tell(WORDS)
            if self.depth == 0:
                self.begun = time.perf_counter()
            self.depth += 1

        def on_end(self, _: object) -> None:
            self.depth -= 1
            if self.depth == 0:
                self.seconds += time.perf_counter() - self.begun

    listener = Compiling()
    with event.install_listener("numba:compile", listener):
        yield lambda: listener.seconds


@contextmanager
def clock_without_compiling() -> Iterator[Callable[[], float]]:
    """A clock, s, that stands still while kernels are compiled."""
    from numba.core import event

    compiling = event.TimingListener()
    with event.install_listener("numba:compile", compiling):
        yield lambda: time.perf_counter() - (compiling.duration if compiling.done else 0.0)
