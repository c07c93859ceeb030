"""The dataset of variants that converge one by one, from pieces of some of them each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array, Counts
from results_schema.lazy_imports import xr
from results_schema.variable import Variable
from results_schema.variables import axes
from studies.protocol.parts import usual

if TYPE_CHECKING:
    from engine.scene.sweep import Cases

HISTORY = "history:"  # before the names of histories in a piece, which only the variants of `kept` have


class Told(NamedTuple):
    """What a study tells of its variants: all its variables by name, the results whose errors are told and their
    tolerances, and the labels of the other dimensions."""

    cases: Cases
    declared: dict[str, Variable]
    results: Sequence[str]
    tolerance: Array
    labels: Mapping[str, Sequence[str] | Sequence[int]]


def labelled(pieces: Sequence[xr.Dataset], told: Told) -> xr.Dataset:
    """All pieces in one. Each has `number`, the flat numbers of its variants, and `kept`, those of its variants with
    histories, where there are some; `status`, `fidelity_used`, `modes_used`, `steps_used`, `estimated_error` and other
    results, the variants first."""
    cases, declared = told.cases, told.declared
    rows = _joined(pieces)
    order, kept = np.argsort(rows.pop("number")), rows.pop("kept", np.zeros(0, dtype=np.int64))
    histories = {name.removeprefix(HISTORY): rows.pop(name) for name in list(rows) if name.startswith(HISTORY)}
    rows = {name: rows[name][order] for name in list(rows)}
    dataset = _empty(told)
    used = {"status": rows.pop("status"), "fidelity": rows.pop("fidelity_used")}
    used |= {"modes": rows.pop("modes_used"), "steps": rows.pop("steps_used")}
    for name, entry in usual(cases.dims, **{key: part.reshape(cases.shape) for key, part in used.items()}).items():
        dataset[name] = entry
    held = np.isfinite(told.tolerance)
    worst = rows["estimated_error"][:, held].max(axis=1) if held.any() else np.full(cases.size, np.nan)
    dataset["error_estimate"] = declared["error_estimate"].holding(worst.reshape(cases.shape), cases.dims)
    for name in sorted(rows, key=list(declared).index):  # what matters most is declared first
        inner = ("result",) if name == "estimated_error" else declared[name].dims
        values = rows.pop(name)
        shape = (*cases.shape, *values.shape[1:])
        dataset[name] = declared[name].holding(values.reshape(shape), (*cases.dims, *inner))
    return _with_histories(dataset, histories, kept, told) if kept.size else dataset


def _joined(pieces: Sequence[xr.Dataset]) -> dict[str, NDArray[Any]]:
    names = dict.fromkeys(str(name) for piece in pieces for name in piece.data_vars)
    return {name: np.concatenate([piece[name].values for piece in pieces if name in piece]) for name in names}


def _empty(told: Told) -> xr.Dataset:
    """The coordinates and the tolerances."""
    from engine.batch.dataset import coordinates

    known = axes() | told.declared
    dataset = xr.Dataset(coords=coordinates(told.cases))
    dataset = dataset.assign_coords(result=known["result"].holding(np.array(told.results), ("result",)))
    dataset["tolerance"] = told.declared["tolerance"].holding(told.tolerance, ("result",))
    for label, names in told.labels.items():
        dataset = dataset.assign_coords({label: known[label].holding(np.array(names), (label,))})
    return dataset


def _with_histories(dataset: xr.Dataset, histories: Mapping[str, NDArray[Any]], kept: Counts, told: Told) -> xr.Dataset:
    """Histories on the whole grid where every variant has one, else along ``history``."""
    cases, order = told.cases, np.argsort(kept)
    everyone = kept.size == cases.size
    lead: Sequence[str] = cases.dims if everyone else ("history",)
    shape = cases.shape if everyone else (kept.size,)
    stations = histories["elapsed"].shape[1]
    dataset = dataset.assign_coords(station=axes()["station"].holding(np.arange(stations), ("station",)))
    if not everyone:
        dataset = dataset.assign_coords(history=axes()["history"].holding(kept[order], ("history",)))
    for name, values in histories.items():
        variable = (axes() | told.declared)[name]
        inner = ("station", *variable.dims[1:])
        entry = variable.holding(values[order].reshape((*shape, *values.shape[1:])), (*lead, *inner))
        dataset = dataset.assign_coords(elapsed=entry) if name == "elapsed" else dataset.assign({name: entry})
    return dataset
