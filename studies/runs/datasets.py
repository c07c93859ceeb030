"""A dataset that `studies.run` gave, as the archive that the command `run` would have written, without its audit."""

from __future__ import annotations

from pathlib import Path

from engine.model.distinct_models import base_scene
from engine.scene.study import Study
from results_schema.errors import BadInput, shortened
from results_schema.lazy_imports import xr
from results_schema.store import files
from results_schema.store.archive import Archive, write_archive
from studies.protocol.checksum import VALUES, checksum_of_values
from studies.protocol.study import kind_of
from studies.results.results import Results
from studies.runs.archived import findings, with_first_frequency
from studies.runs.identity import run_key
from studies.runs.not_audited import PYTHON, WHY
from studies.runs.provenance import attributes

TABLES = ".csv", ".parquet"  # ends of names of tables


def archive_of(dataset: xr.Dataset, path: Path | str, study: Study | None = None) -> Archive:
    """An archive in memory: the dataset with what an archive says of its making, and the bodies beside it.

    study: the one that gave the dataset, needed where it names files that are not below the working folder; else it
    is read from the dataset. Raises BadInput where that is no study, and for variables that are none of its results.
    """
    from engine.batch.dataset import model_groups

    results = Results.of(dataset, study)
    kind = kind_of(results.study)  # which declares its results
    _check_own(results)
    key = run_key(results.study, kind.parts(results.study).names)
    seconds = float(dataset.attrs.get("run_seconds", 0.0))
    marched = bool(results.study.carriage) and results.study.output.keeps_variants
    why = {WHY: dataset.attrs.get(WHY, PYTHON)} if results.study.solver.audit != 0 and marched else {}
    root = results.dataset.assign_attrs({**attributes(results.study, key, seconds), **why})
    root.attrs.pop(VALUES, None)
    models = model_groups(base_scene(results.study))
    return Archive(Path(path), root, with_first_frequency(models, results) if marched else models)


def write(dataset: xr.Dataset, path: Path | str, study: Study | None = None, *, overwrite: bool = False) -> Path:
    """Write a dataset of `studies.run` as an archive, which every command reads; the archive's path.

    study: as of `archive_of`. overwrite: an archive that is there is replaced. Raises BadInput where there is anything
    else at that place, or where the dataset is no longer what its study gives, and OutputFailed.
    """
    path = Path(path)
    if path.suffix in TABLES:
        what, remedy = "an archive is a netCDF file", f'studies.export(dataset, "{path.name}")'
        raise BadInput(what, where=str(path), expected="a name that ends with .nc", remedy=remedy)
    files.check_output_place(path)
    if overwrite:
        files.check_replaceable(path)
    elif path.exists():
        remedy = "overwrite=True, where that is an archive, or another name"
        raise BadInput("there is a file already", where=str(path), remedy=remedy)
    archive = archive_of(dataset, path, study)
    if found := next(findings(archive, study or Results.of(dataset).study), ""):
        raise BadInput(
            f"this dataset is no longer what its study gives: {found}",
            where="dataset",
            remedy="write what studies.run gives; a dataset of your own goes to a file by its to_netcdf",
        )
    if VALUES in dataset.attrs and dataset.attrs[VALUES] != checksum_of_values(dataset):
        what = "values of this dataset were changed, or variables dropped"
        remedy = "what is your own goes to a file by its to_netcdf"
        raise BadInput(what, where="dataset", expected="the numbers that studies.run gave", remedy=remedy)
    write_archive(path, archive.root, archive.groups)
    return path


def _check_own(results: Results) -> None:
    """Refuse variables that users have added: every variable of an archive is a declared one. Raises BadInput."""
    declared = results.study.results(results.study.results_kind)
    own = [str(name) for name in results.dataset.data_vars if name not in declared]
    if own:
        raise BadInput(
            "this is none of the results of its study",
            where=own[0],
            expected="the variables of studies.run alone",
            received=shortened(own),
            remedy=f"dataset.drop_vars({shortened(own)}); what is your own goes to a file by to_netcdf",
        )
