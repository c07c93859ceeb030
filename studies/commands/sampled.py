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

SECONDS = 3.0  # that measuring may take, as far as pieces say beforehand how long they are
PATIENCE = 10.0  # the same of pieces that take longer than they say


@one_thread()
def sampled(pieces: Sequence[Piece], threads: int) -> Mapping[str, float]:
    """Seconds of all pieces by name: the shortest are computed as a run does, one after another, as long as there is
    time; others take as much longer or shorter than they say as these."""
    begun, took, said = time.perf_counter(), dict[str, float](), 0.0
    work = Work(threads, AskedElsewhere(lambda: time.perf_counter() > begun + PATIENCE))
    for piece in sorted(pieces, key=lambda piece: piece.seconds):
        ratio, started = sum(took.values()) / said if said else 1.0, time.perf_counter()
        if started + ratio * piece.seconds > begun + SECONDS:
            break
        try:
            piece.compute(work)
        except (Halted, Interrupted):
            break
        took[piece.name] = time.perf_counter() - started
        said += piece.seconds
    ratio = sum(took.values()) / said if said else 1.0
    return {piece.name: took.get(piece.name, ratio * piece.seconds) for piece in pieces}
