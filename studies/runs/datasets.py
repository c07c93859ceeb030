"""A dataset that `studies.run` gave, as the archive that the command `run` would have written, without its audit."""

from __future__ import annotations

from pathlib import Path

from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from results_schema.errors import BadInput
from results_schema.lazy_imports import xr
from results_schema.store import files
from results_schema.store.archive import Archive, write_archive
from results_schema.validate import findings_of
from studies.protocol.study import kind_of
from studies.results.results import Results
from studies.runs.archived import with_first_frequency
from studies.runs.identity import run_key
from studies.runs.provenance import attributes


def archive_of(dataset: xr.Dataset, path: Path | str, study: Study | None = None) -> Archive:
    """An archive in memory: the dataset with what an archive says of its making, and the bodies beside it.

    study: the one that gave the dataset, needed where it names files that are not below the working folder; else it
    is read from the dataset. Raises BadInput where that is no study, or the dataset holds what is not its own.
    """
    from engine.batch.dataset import model_groups

    dataset = _without_fill_values(dataset)
    results = Results.of(dataset) if study is None else Results(dataset, study)
    _check_declared(dataset, results.study)
    key = run_key(results.study, kind_of(results.study).parts(results.study).names)
    root = dataset.assign_attrs(attributes(results.study, key, float(dataset.attrs["run_seconds"])))
    models = model_groups(base_scene(results.study))
    marched = bool(results.study.carriage) and results.study.output.keeps_variants
    return Archive(Path(path), root, with_first_frequency(models, results) if marched else models)


def _check_declared(dataset: xr.Dataset, study: Study) -> None:
    """Refuse what no archive of the study can hold."""
    declared = study.results(study.results_kind)
    if found := list(findings_of(dataset, study.kind, declared)):
        what, remedy = (
            "this is not the dataset of its study",
            "drop_vars, and keep variables of your own in another file",
        )
        raise BadInput(what, where="dataset", received="; ".join(found[:3]), remedy=remedy)


def _without_fill_values(dataset: xr.Dataset) -> xr.Dataset:
    """A dataset whose coordinates carry no fill value, which xarray adds to those of files that it writes itself."""
    found = dataset.copy()
    for name in found.coords:
        found[name].encoding.pop("_FillValue", None)
        found[name].attrs.pop("_FillValue", None)
    return found


def write(dataset: xr.Dataset, path: Path | str, study: Study | None = None) -> Path:
    """Write a dataset of `studies.run` as an archive, which every command reads; the archive's path.

    study: as of `archive_of`. Raises BadInput where there is something at that place, and OutputFailed.
    """
    path = Path(path)
    files.check_new_place(path)
    archive = archive_of(dataset, path, study)
    write_archive(path, archive.root, archive.groups)
    return path
