"""The variants that an answer names have a history in the archive, the same as if all had one."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

import engine
import studies
from engine.scene.study import Study
from studies.results.results import Results
from tests.engine.build import beam, cruise, mass, shuttle, study, swing

SPEEDS = np.linspace(0.5, 3.0, 25).tolist()


def swept(kind: str, motion: dict[str, Any], **output: Any) -> Study:
    """100 variants of a mass, which converge by themselves."""
    pace = "frequency" if kind == "double-peak" else "speed"
    sweep = {
        "speed": {"of": f"carriage.car.motion.{pace}", "values": SPEEDS},
        "mass": {"of": "carriage.car.mass", "values": [0.05, 0.1, 0.2, 0.3]},
    }
    bed = beam(damping_ratio=0.05, modes=2)
    return study(bed, mass(0.1, motion), kind=kind, sweep=sweep, solver={"steps": 400}, output=output)


@pytest.fixture(autouse=True)
def _few_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.batch.plan.SHOWN", 4)


KINDS = {
    "passage": cruise(0.0, 1.0, 1.0),
    "asymmetry": shuttle(0.5, 0.9, 1.0, 0.1, 4),
    "double-peak": swing(0.5, 0.45, 0.5, 4),
}


@pytest.mark.parametrize("kind", KINDS)
def test_named_variants_have_the_histories_that_all_would_have(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    given = swept(kind, KINDS[kind])
    found = studies.run(given)
    monkeypatch.setattr("engine.batch.plan.SHOWN", 100)
    whole = studies.run(given)
    results = Results(found, given)
    named = studies.protocol.study.kind_of(given).named(results)
    kept = results.traced()
    assert named and set(named) <= set(kept) and 4 < len(kept) < 10
    for index in named:
        place = dict(zip(results.dims, index, strict=True))
        flat = int(np.ravel_multi_index(index, results.shape))
        one, other = found["midspan"].sel(history=flat), whole["midspan"].isel(place)
        assert np.isfinite(one).sum() > 100 and np.array_equal(one, other, equal_nan=True)


def test_they_do_not_depend_on_threads_and_chunks() -> None:
    given = swept("asymmetry", KINDS["asymmetry"])
    one, other = studies.run(given, threads=1), studies.run(given, threads=2, chunk=8)
    assert isinstance(one, xr.Dataset) and one.drop_attrs().identical(other.drop_attrs())


def test_none_are_added_where_the_study_says_which() -> None:
    assert "history" not in studies.run(swept("passage", KINDS["passage"], histories="none")).dims
    assert "history" not in engine.run(swept("passage", KINDS["passage"], histories="all")).dims
