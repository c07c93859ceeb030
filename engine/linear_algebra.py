"""Linear algebra on one thread: its matrices are small here, its threads wait for each other longer than they work, and
the march has threads of its own.

The command tells OpenBLAS so before numpy loads it. From Python the process is the user's: its libraries are held to
one thread only as long as ours computes, and then get back what they had.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class _Held:
    """The libraries that are held, with the threads that they had, and how many hold them."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.holders = 0
        self.threads: dict[str, tuple[Any, int]] = {}
        self.loaded: list[Any] = []
        self.modules = 0

    def take(self) -> None:
        """Hold all libraries that are loaded by now to one thread."""
        with self.lock:
            self.holders += 1
            for library in self._libraries():
                if library.filepath not in self.threads:
                    self.threads[library.filepath] = library, library.num_threads
                    library.set_num_threads(1)

    def _libraries(self) -> list[Any]:
        """Those that are loaded by now. They come with modules, and to look through all of a process takes long."""
        from threadpoolctl import ThreadpoolController

        if self.modules != len(sys.modules):
            self.loaded = ThreadpoolController().select(user_api="blas").lib_controllers
            self.modules = len(sys.modules)
        return self.loaded

    def give_back(self) -> None:
        """The last holder gives all libraries the threads that they had."""
        with self.lock:
            self.holders -= 1
            if self.holders == 0:
                for library, threads in self.threads.values():
                    library.set_num_threads(threads)
                self.threads.clear()


_HELD = _Held()


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold the libraries of linear algebra that are loaded by now to one thread, in the whole process; those that are
    loaded later need a hold of their own. Holds may overlap, in one thread or in several."""
    _HELD.take()
    try:
        yield
    finally:
        _HELD.give_back()
