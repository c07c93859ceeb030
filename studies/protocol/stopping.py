"""Ctrl-C and SIGTERM: the first asks the run to stop and gives it a moment, the second ends it at once.

A thread of its own hears them, as the main one may be in compiled code for long, the compiler's above all. Ending at
once is safe at any time: whatever is written is written whole or not at all.
"""

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
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
        self.told = False  # that it was interrupted, which then need not be said again

    def ask(self, number: int = signal.SIGINT.value) -> None:
        """Ask for a stop, as this signal does."""
        self._signal = number
        self.event.set()

    @property
    def asked(self) -> bool:
        """Whether somebody asked."""
        return self.event.is_set()

    @property
    def exit_code(self) -> int:
        """Exit code of a command that this signal stopped: 130 or 143."""
        return 128 + self._signal

    def check(self) -> None:
        """Raise Interrupted if somebody asked."""
        if self.asked:
            error = Interrupted(f"interrupted; {KEPT}")
            error.exit_code = self.exit_code
            raise error


class AskedElsewhere(Stop):
    """A stop that another thread or process hears of by asking."""

    def __init__(self, halted: Callable[[], bool]) -> None:
        super().__init__()
        self._halted = halted

    @property
    def asked(self) -> bool:
        """Whether somebody asked there."""
        return self._halted()


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Turn SIGINT and SIGTERM into a request to stop while the block lasts; from the main thread only.

    A process that is asked to stop, and has nothing to do but this, ends within the time that it is given: whatever its
    threads do after the block.
    """
    stop = Stop()
    ear, mouth = socket.socketpair()
    mouth.setblocking(False)
    former_mouth = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
    former = {number: signal.signal(number, _leave_it_to_the_thread) for number in _SIGNALS}
    threading.Thread(target=_hear, args=(ear, stop), daemon=True).start()
    try:
        yield stop
    finally:
        if _whole_process.is_set() and stop.event.is_set():
            stop.told = True
            mouth.detach()  # open to the end
        else:
            for number, handler in former.items():
                signal.signal(number, handler)
            signal.set_wakeup_fd(former_mouth)
            mouth.close()


def _leave_it_to_the_thread(number: int, frame: FrameType | None) -> None:
    """Python calls this when the main thread comes to it; the number has gone to the other thread long before."""


def _hear(ear: socket.socket, stop: Stop) -> None:
    """Ask for a stop at the first signal; end the process at the second, or when its time is over."""
    with ear, suppress(TimeoutError):
        for number in iter(partial(_next_signal, ear), None):
            if stop.event.is_set():
                break
            stop.ask(number)
            ear.settimeout(GRACE_SECONDS)
        else:
            return
    _end_at_once(stop)


def _next_signal(ear: socket.socket) -> int | None:
    """The number of the next of our signals, None where no more will come."""
    while heard := ear.recv(1):
        if heard[0] in _SIGNALS:
            return heard[0]
    return None


def own_process() -> None:
    """Say that the command is the whole process: asked to stop it ends in time, whatever its threads still do."""
    _whole_process.set()


def end_undisturbed() -> None:
    """Hear no more signals: the process is on its way out with the right exit code, which a second Ctrl-C in the
    interpreter's last moments would change."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _end_at_once(stop: Stop) -> None:
    # A terminal may have lost its cursor to a progress bar.
    ending = _SHOW_CURSOR if sys.stderr.isatty() else ""
    words = "" if stop.told else f"\nwanderlast: ended at once; {KEPT}\n"
    os.write(2, f"{ending}{words}".encode())
    os._exit(stop.exit_code)
