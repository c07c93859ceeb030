"""What pieces take is told from the shortest of them, computed as a run does."""

import time
from functools import partial

import pytest

from studies.commands.sampled import SECONDS, sampled
from studies.protocol.parts import Piece, Work


def piece(name: str, takes: float, says: float) -> Piece:
    """A piece that does nothing for some seconds, and says that it takes others."""
    return Piece(name, "", partial(_wait, takes), says)  # type: ignore[arg-type]


def _wait(takes: float, work: Work) -> None:
    end = time.perf_counter() + takes
    while time.perf_counter() < end:
        work.check()


def test_pieces_take_what_they_are_seen_to_take() -> None:
    """Both short ones are computed; the long one takes as many times what it says as these do."""
    found = sampled([piece("long", 60.0, 100.0), piece("one", 0.05, 0.5), piece("two", 0.1, 0.5)], 1)
    assert list(found) == ["long", "one", "two"]
    assert found["one"] >= 0.05 and found["two"] >= 0.1
    assert found["long"] == pytest.approx(100.0 * (found["one"] + found["two"]), rel=0.2)


def test_what_the_first_piece_loads_counts_once() -> None:
    """A first piece that takes 0.5 s, and hardly any after that."""
    takes = [0.5, 0.01]
    first = Piece("first", "", lambda work: _wait(takes.pop(0), work), 0.5)  # type: ignore[arg-type, return-value]
    found = sampled([first, piece("long", 60.0, 500.0)], 1)
    assert found["first"] >= 0.5 and found["long"] < 250.0


def test_where_all_pieces_are_long_their_word_is_taken() -> None:
    begun = time.perf_counter()
    assert sampled([piece("long", 60.0, 100.0 + SECONDS)], 1) == {"long": 100.0 + SECONDS}
    assert time.perf_counter() < begun + 0.5 * SECONDS
