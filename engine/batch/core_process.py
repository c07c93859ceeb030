"""A process of a core of this machine: `python -m engine.batch.core_process`.

It ends when its standard input closes, as that of the process that started it does when this ends.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from typing import Any, TypeVar

from engine.accuracy.jobs import Halted
from engine.batch.processes import Found, Raised, send
from engine.linear_algebra import one_thread
from results_schema.arrays import Counts
from results_schema.garbage import collect_seldom

T = TypeVar("T")


def main() -> None:
    """Do jobs as they come through standard input, until that closes; subjects come as their pickled bytes."""
    jobs, found = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints
    collect_seldom()
    subject: Any = None
    with one_thread():
        while True:
            try:
                given = pickle.load(jobs)
            except EOFError:
                return
            if isinstance(given, bytes):
                subject = pickle.loads(given)
            else:
                send(found, _done(subject, *given))


def _done(subject: Any, function: Callable[[Any, Counts, Halted], T], lanes: Counts) -> Found | Raised:
    """What a job finds, or raises."""
    try:
        return Found(function(subject, lanes, lambda: False))
    except BaseException as error:
        return Raised(error)


if __name__ == "__main__":
    main()
