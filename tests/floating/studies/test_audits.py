"""When variants of frames that move are computed again: not where that takes much longer than all of them did."""

import numpy as np
import pytest
import xarray as xr

from studies.kinds.moving_frames import KIND
from studies.moving.preview import _audits_are_too_dear
from studies.protocol.parts import Piece, Pieces
from tests.floating.studies.scenes import driven


def used(modes: int, steps: int, variants: int = 64) -> xr.Dataset:
    """What variants were computed with."""
    return xr.Dataset({"modes_used": ("v", np.full(variants, modes)), "steps_used": ("v", np.full(variants, steps))})


@pytest.mark.parametrize(
    ("dataset", "audited"),
    [(used(4, 20_000), True), (used(64, 100_000, 8), False), (used(64, 1_000, 8), True), (used(64, 100_000), True)],
)
def test_one_that_would_take_much_longer_than_the_run_is_left_out(dataset: xr.Dataset, audited: bool) -> None:
    """A variant alone fills lanes of eight, with twice the steps and modes; what is asked for is done."""
    swept = {"rate": {"of": "body.arm.damping_ratio", "from": 0.01, "to": 0.02, "count": dataset.sizes["v"]}}
    study = driven(sweep=swept)
    parts = Pieces(KIND, study)
    assert parts.audited > 0 and (parts.audited_of(dataset) > 0) == audited
    asked = Pieces(KIND, study.with_values({"solver.audit": 2}))
    assert asked.audited_of(dataset) == 2


def test_check_foresees_that_of_some_pieces() -> None:
    """Of eight variants, and of a piece like it besides, in which as many more share the audit."""
    pieces = [Piece(name, "", lambda work: xr.Dataset(), 1.0) for name in ("one", "two")]
    found = {0: used(64, 100_000, 8)}
    assert _audits_are_too_dear(pieces[:1], found) and not _audits_are_too_dear(pieces, found)
    assert not _audits_are_too_dear(pieces, {})
