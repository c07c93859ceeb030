"""Queues between those that do jobs and the one that takes what they find."""

from __future__ import annotations

import queue
from contextlib import suppress
from typing import Any

from engine.accuracy.jobs import Halted
from engine.march.stepper import Halted as Gone

WAITING = 4  # findings per thread that may wait for the sink


def put(results: queue.Queue[Any], found: object, given_up: Halted) -> None:
    """Wait for room in a queue, unless the caller has gone."""
    while not given_up():
        with suppress(queue.Full):
            results.put(found, timeout=0.05)
            return


def next_of(results: queue.Queue[Any], halted: Halted) -> Any:
    """What the next job found. Raises Halted."""
    while True:
        if halted():
            raise Gone
        try:
            return results.get(timeout=0.05)
        except queue.Empty:
            continue
