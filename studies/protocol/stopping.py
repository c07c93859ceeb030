"""Ctrl-C and SIGTERM: the first asks the run to stop and gives it a moment, the second ends it at once.

Ending at once is safe at any time: whatever is written is written whole or not at all.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from results_schema.errors import Interrupted

GRACE_SECONDS = 1.7
KEPT = "finished work is kept, run again to resume"

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_whole_process = threading.Event()
_SHOW_CURSOR = "\x1b[?25h"


class Stop:
    """Whether somebody asked to stop: an event for the workers, the signal for the exit code."""

    def __init__(self) -> None:
        self.event = threading.Event()
        self._signal = signal.SIGINT.value

    def ask(self, number: int = signal.SIGINT.value) -> None:
        """Ask for a stop, as this signal does."""
        self._signal = number
        self.event.set()

    @property
    def exit_code(self) -> int:
        """Exit code of a command that this signal stopped: 130 or 143."""
        return 128 + self._signal

    def check(self) -> None:
        """Raise Interrupted if somebody asked."""
        if self.event.is_set():
            error = Interrupted(f"interrupted; {KEPT}")
            error.exit_code = self.exit_code
            raise error


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Turn SIGINT and SIGTERM into a request to stop while the block lasts; from the main thread only."""
    stop = Stop()
    deadline = threading.Timer(GRACE_SECONDS, _end_at_once, [stop])
    deadline.daemon = True

    def on_signal(number: int, frame: FrameType | None) -> None:
        if stop.event.is_set():
            _end_at_once(stop)
        stop.ask(number)
        deadline.start()

    former = {number: signal.signal(number, on_signal) for number in _SIGNALS}
    try:
        yield stop
    finally:
        deadline.cancel()
        leaving = _whole_process.is_set() and stop.event.is_set()
        for number, handler in former.items():
            signal.signal(number, signal.SIG_IGN if leaving else handler)


def own_process() -> None:
    """Say that the command is the whole process: once it is asked to stop it hears no second signal on its way out."""
    _whole_process.set()


def end_undisturbed() -> None:
    """Hear no more signals: the process is on its way out with the right exit code, which a second Ctrl-C in the
    interpreter's last moments would change."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _end_at_once(stop: Stop) -> None:
    # A terminal may have lost its cursor to a progress bar.
    ending = _SHOW_CURSOR if sys.stderr.isatty() else ""
    os.write(2, f"{ending}\nwanderlast: ended at once; {KEPT}\n".encode())
    os._exit(stop.exit_code)
