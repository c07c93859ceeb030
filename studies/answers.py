"""What a finished study says, from its dataset alone: in sentences and in figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from studies.results import Results
from studies.study import kind_named

if TYPE_CHECKING:
    import xarray as xr

    from studies.figures import Figure


def findings(dataset: xr.Dataset) -> list[str]:
    """The answer in sentences, the most important first."""
    results = Results.of(dataset)
    return kind_named(results.study.kind).findings(results)


def figures(dataset: xr.Dataset) -> list[Figure]:
    """The figures of the report, the most important first."""
    results = Results.of(dataset)
    return kind_named(results.study.kind).figures(results)
