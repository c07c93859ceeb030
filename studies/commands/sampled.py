"""What a study in pieces will take, from those of its pieces that some seconds are enough for."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from engine.linear_algebra import one_thread
from engine.march.stepper import Halted
from results_schema.errors import Interrupted
from studies.protocol.parts import Work
from studies.protocol.stopping import AskedElsewhere

if TYPE_CHECKING:
    from studies.protocol.parts import Piece

SECONDS = 2.0  # that measuring may take, as far as pieces say beforehand how long they are
PATIENCE = 10.0  # the same of pieces that take longer than they say


@one_thread()
def sampled(pieces: Sequence[Piece], threads: int) -> Mapping[str, float]:
    """Seconds of all pieces by name: the shortest are computed as a run does, one after another, as long as there is
    time; others take as much longer or shorter than they say as these. The first is computed twice: what it loads
    others find loaded."""
    begun = time.perf_counter()
    work = Work(threads, AskedElsewhere(lambda: time.perf_counter() > begun + PATIENCE))
    by_length, took = sorted(pieces, key=lambda piece: piece.seconds), dict[str, float]()
    loaded = _took(by_length[0], work) if by_length[0].seconds <= SECONDS else None
    end, ratio = time.perf_counter() + SECONDS, 1.0
    for piece in by_length if loaded is not None else []:
        seconds = _took(piece, work) if time.perf_counter() + ratio * piece.seconds <= end else None
        if seconds is None:
            break
        took[piece.name] = seconds
        ratio = sum(took.values()) / sum(piece.seconds for piece in by_length[: len(took)])
    found = {piece.name: took.get(piece.name, ratio * piece.seconds) for piece in pieces}
    if loaded is not None:
        first = by_length[0].name
        found[first] = max(found[first], loaded)
    return found


def _took(piece: Piece, work: Work) -> float | None:
    """Seconds of a piece; None where there was no time for it."""
    started = time.perf_counter()
    try:
        piece.compute(work)
    except (Halted, Interrupted):
        return None
    return time.perf_counter() - started
