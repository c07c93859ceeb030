"""Datasets in Python, from a run to an archive or a page: what is taken, and what is refused in words."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import engine
import studies
from results_schema.errors import BadInput
from tests.engine.build import beam, cruise, fixed, mass, study

GIVEN = study(beam(), mass(0.2, cruise(0.0, 1.0, 0.5)), kind="passage", sensor={"midspan": fixed(0.5)})


def test_a_dataset_that_xarray_has_written_and_read_is_taken(tmp_path: Path) -> None:
    """Although coordinates of such files carry a fill value."""
    studies.run(engine.load(GIVEN.toml() + SWEEP)).to_netcdf(tmp_path / "raw.nc")
    with xr.open_dataset(tmp_path / "raw.nc") as again:
        assert again["speed"].encoding.get("_FillValue") is not None
        studies.write(again, tmp_path / "own.nc")
    with xr.open_dataset(tmp_path / "own.nc") as archived:
        assert "_FillValue" not in archived["speed"].encoding


SWEEP = """
[sweep.speed]
of = "carriage.car.motion.speed"
values = [0.3, 0.6]
"""


def test_variables_of_ones_own_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    found = studies.run(GIVEN)
    with pytest.raises(BadInput, match=r"mine: expected a declared name.*drop_vars"):
        studies.write(found.assign(mine=2.0 * found.midspan_max), tmp_path / "own.nc")
    assert not (tmp_path / "own.nc").exists()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: studies.answer(engine.run(GIVEN)), "does not say which study gave it.*studies.run"),
        (lambda: studies.run("bridge.toml"), "this is no study; received str; remedy: engine.load"),
        (lambda: studies.run({"kind": "passage"}), "this is no study; received dict"),
        (lambda: studies.run(GIVEN, nthreads=2), "no such option; expected .*threads.*received nthreads"),
    ],
)
def test_calls_of_a_slip_are_refused_in_words(call: Any, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        call()


def test_many_samples_of_ones_own_are_read_again() -> None:
    """As the text of a study that a dataset carries."""
    values = np.random.default_rng(1).uniform(0.1, 0.2, 60_000)
    swept = study(
        beam(), mass(0.2, cruise(0.0, 1.0, 0.5)), sweep={"load": {"of": "carriage.car.mass", "values": values}}
    )
    text = swept.toml()
    assert len(text) > 1_000_000
    assert engine.load(text).sweep.axes["load"].size == values.size


def test_more_samples_than_are_read_again_are_refused_before_they_run() -> None:
    values = np.random.default_rng(1).uniform(0.1, 0.2, 600_000)
    sweep = {"load": {"of": "carriage.car.mass", "values": values}}
    with pytest.raises(BadInput, match=r"the study is too large; expected a text of at most 10000000 bytes.*sobol"):
        study(beam(), mass(0.2, cruise(0.0, 1.0, 0.5)), sweep=sweep)


def test_completion_offers_what_is_imported_late() -> None:
    assert {"run", "load", "Study"} <= set(dir(engine)) and {"run", "write", "report"} <= set(dir(studies))
