"""Results of very many variants, part after part through a file: memory holds those of a part, and of all variants one
array at a time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from results_schema.lazy_imports import xr
from results_schema.store.rows import Chunk, Rows, RowsOnDisk, joined
from studies.results.axes import VARIANT
from studies.results.results import Results

if TYPE_CHECKING:
    from engine.batch.plan import Plan
    from engine.scene.study import Study
    from studies.protocol.study import Kind


def summarised(kind: Kind, dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """The march's dataset of some variants with the results of their kind of study."""
    dataset = kind.summarise(dataset, study)
    declared = study.results(kind.name)
    # The engine offers static values to every summary; they are results only where the kind says so.
    offered = [name for sensor in study.sensor if (name := f"{sensor}_static") not in declared]
    return dataset.drop_vars(offered, errors="ignore")


def with_coordinates(kind: Kind, dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """The dataset of all variants with the coordinates that its kind has over the sweep."""
    found = kind.along(Results(dataset, study))
    return dataset.assign_coords({name: value for name, value in found.items() if name not in study.sweep.axes})


def streamed(kind: Kind, plan: Plan, parts: Iterable[Chunk], rows: RowsOnDisk) -> tuple[xr.Dataset, Rows | None]:
    """The dataset of all variants, by way of `rows`, whose results are read when they are asked for; and histories."""
    from engine.batch.dataset import results_over

    dataset, selected = xr.Dataset(), list[Rows]()
    for part, more in parts:
        own = results_over(plan, plan.cases.part(part.variants), dict(part.arrays))
        dataset = summarised(kind, own, plan.study)
        rows.add(Rows(part.variants, {name: dataset[name].values for name in _of_variants(dataset)}))
        selected += [] if more is None else [more]
    assert rows.finished.all(), "variants are missing"
    return _whole(plan, dataset, rows), joined(selected)


def _of_variants(dataset: xr.Dataset) -> list[str]:
    """The results that every variant has of its own."""
    return [str(name) for name, array in dataset.data_vars.items() if array.dims[:1] == (VARIANT,)]


def _whole(plan: Plan, part: xr.Dataset, rows: RowsOnDisk) -> xr.Dataset:
    """The dataset of all variants, made as that of some is."""
    from engine.batch.dataset import coordinates

    labels = coordinates(plan.cases)
    labels |= {str(n): array.variable for n, array in part.coords.items() if VARIANT not in array.dims}
    found = {str(name): array.variable for name, array in part.data_vars.items()}
    for name in _of_variants(part):
        own = found[name]
        dims = (*plan.cases.dims, *own.dims[1:])
        found[name] = xr.Variable(dims, rows.array(name, plan.cases.shape), own.attrs)
    return xr.Dataset(found, labels, part.attrs)
