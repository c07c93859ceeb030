"""The archive of one study: one netCDF-4 file, written whole, checked before it is loaded.

`xarray.open_dataset` and Debian's `ncdump` read it as well; the functions here add the checks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from results_schema.errors import ArchiveError
from results_schema.lazy_imports import xr
from results_schema.status import Status, label
from results_schema.store import files
from results_schema.store.reading import SCHEMA_VERSION, checked, groups_of, read_small_tables, verify
from results_schema.store.tables import CONTENTS, DIGEST, from_dataset, to_dataset
from results_schema.store.writing import write_tables

REQUIRED_ATTRIBUTES = ("Conventions", "title", "history", "schema_version", "study_kind", "study", "study_sha256")

FILES = "study_files"  # the attribute that says what the files of the study held

OutputState = Literal["absent", "same study, finished", "same study, other files", "another study"]


@dataclass(frozen=True)
class Archive:
    """An archive in memory, but for large arrays of a large one: the gridded results, and the groups by path ("/audit",
    "/model/bed")."""

    path: Path
    root: xr.Dataset
    groups: Mapping[str, xr.Dataset]


@dataclass(frozen=True)
class VariableSummary:
    """One variable in the words of the archive itself."""

    name: str
    group: str
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: str
    units: str
    long_name: str
    meaning: str


@dataclass(frozen=True)
class Summary:
    """What is inside an archive, who made it, is it whole; `damage` says why not."""

    path: Path
    file_bytes: int
    damage: str
    dimensions: Mapping[str, int]
    variables: tuple[VariableSummary, ...]
    attributes: Mapping[str, Any]
    status_counts: Mapping[str, int]

    @property
    def whole(self) -> bool:
        """Whether everything in the file could be read and is what was written."""
        return not self.damage


def write_archive(
    path: Path | str,
    root: xr.Dataset,
    groups: Mapping[str, xr.Dataset] | None = None,
    look: Callable[[], None] = lambda: None,
) -> None:
    """Write an archive whole; the same datasets give the same bytes.

    root.attrs hold REQUIRED_ATTRIBUTES and whatever else the caller records. groups: dataset by path ("/audit",
    "model/bed"). look: called just before the archive takes its place; it may refuse what has come there meanwhile.
    Raises OutputFailed, and ValueError for datasets that an archive cannot hold.
    """
    missing = [name for name in REQUIRED_ATTRIBUTES if name not in root.attrs]
    if missing or "status" not in root:
        raise ValueError(f"expected `status` and the attributes {REQUIRED_ATTRIBUTES}; missing: {missing or 'status'}")
    if root.attrs["schema_version"] != SCHEMA_VERSION:
        raise ValueError(f"schema_version: expected {SCHEMA_VERSION}, received {root.attrs['schema_version']}")
    tables = {"/": from_dataset(root)}
    tables |= {"/" + name.strip("/"): from_dataset(dataset) for name, dataset in (groups or {}).items()}
    files.write_whole(path, partial(write_tables, tables=tables), look)


def open_archive(path: Path | str) -> Archive:
    """Load an archive into memory, but for large arrays of a large one, which are read when they are asked for.

    Raises BadInput (no such file, or it points at other files) and ArchiveError (truncated, flipped bits, foreign,
    newer schema, missing variables, impossible sizes), each naming the file.
    """
    path = Path(path)
    with checked(path) as dataset:
        tables = read_small_tables(path, dataset)
    datasets = {group: to_dataset(table) for group, table in tables.items()}
    root = datasets.pop("/")
    for name in (CONTENTS, DIGEST):
        root.attrs.pop(name, None)
    return Archive(path, root, datasets)


def files_text(hashes: Mapping[str, str]) -> str:
    """SHA-256 by path as archives hold them, one file in a line.

    >>> files_text({"bed.op4": "ab"})
    'ab  bed.op4'
    """
    return "\n".join(f"{digest}  {path}" for path, digest in sorted(hashes.items()))


def changed_files(path: Path | str, hashes: Mapping[str, str]) -> list[str]:
    """Those files, of SHA-256 by path, of which an archive was not made as they are. Raises as `open_archive`."""
    with checked(Path(path)) as dataset:
        known = set(str(getattr(dataset, FILES, "")).split("\n"))
    return [name for name in sorted(hashes) if files_text({name: hashes[name]}) not in known]


def study_text(path: Path | str) -> str:
    """The text of the study file of which an archive is. Raises ValueError for what is no archive, else as
    `open_archive`."""
    if not files.is_hdf5(Path(path)):
        raise ValueError(f"{path} is no archive")
    with checked(Path(path)) as dataset:
        return str(getattr(dataset, "study", ""))


def output_state(path: Path | str, study_sha256: str, hashes: Mapping[str, str] = MappingProxyType({})) -> OutputState:
    """What is at the place of the output: nothing, this study's finished archive, or something else.

    hashes: SHA-256 by path of the files that the study names. Raises ArchiveError when this study's archive is there
    but damaged, or when the file is newer.
    """
    path = Path(path)
    if not path.exists():
        return "absent"
    if not files.is_hdf5(path):
        return "another study"
    with checked(path) as dataset:
        if getattr(dataset, "study_sha256", "") != study_sha256:
            return "another study"
        if getattr(dataset, FILES, "") != files_text(hashes):
            return "same study, other files"
        verify(path, dataset)
    return "same study, finished"


def describe(path: Path | str) -> Summary:
    """A short summary for `wanderlast info`; everything is read once to see whether it is whole.

    Raises as `open_archive` where not even the summary can be made.
    """
    path = Path(path)
    with checked(path) as dataset:
        damage = _damage(path, dataset)
        places = list(groups_of(dataset))
        return Summary(
            path,
            path.stat().st_size,
            damage,
            {name: len(dimension) for name, dimension in dataset.dimensions.items()},
            tuple(_summary(group, name, v) for group, place in places for name, v in place.variables.items()),
            {key: dataset.getncattr(key) for key in dataset.ncattrs() if key not in (CONTENTS, DIGEST)},
            {} if damage else _status_counts(dataset),
        )


def _damage(path: Path, dataset: Any) -> str:
    try:
        verify(path, dataset)
    except ArchiveError as error:
        return str(error)
    return ""


def _summary(group: str, name: str, variable: Any) -> VariableSummary:
    attributes = {key: variable.getncattr(key) for key in variable.ncattrs()}
    return VariableSummary(
        name,
        group,
        variable.dimensions,
        variable.shape,
        "text" if variable.dtype is str else variable.dtype.name,
        str(attributes.get("units", "")),
        str(attributes.get("long_name", "")),
        str(attributes.get("comment", "")),
    )


def _status_counts(dataset: Any) -> dict[str, int]:
    by_status = dataset.variables.get("status_count")
    if by_status is not None:
        counts = np.asarray(by_status[...]).reshape(-1, len(Status)).sum(axis=0)
        return {label(status): int(count) for status, count in zip(Status, counts, strict=True) if count}
    values, counts = np.unique(np.asarray(dataset.variables["status"][...]), return_counts=True)
    known = {int(status): label(status) for status in Status}
    return {known.get(int(value), str(value)): int(count) for value, count in zip(values, counts, strict=True)}
