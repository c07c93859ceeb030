"""A netCDF-4 file back into tables, with every check that is possible before its data are loaded."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from results_schema.blocks import CHUNK_BYTES, IN_MEMORY
from results_schema.errors import ArchiveError, BadInput, WanderlastError, did_you_mean
from results_schema.lazy_imports import xr
from results_schema.store import files
from results_schema.store.links import refuse_pointers
from results_schema.store.tables import CONTENTS, DIGEST, Column, Numbers, Table, checksum, contents, digest

SCHEMA_VERSION = 2  # archives of version 1 are of before `estimated_error`

# zlib cannot shrink anything by more than 1032; a file that claims more was never written in full.
_LARGEST_COMPRESSION = 1100
_TEXT_BYTES = 16

_Loaded = tuple[Numbers, str]


@contextmanager
def checked(path: Path) -> Iterator[Any]:
    """An open netCDF4.Dataset of an archive that is ours, of a known schema and of a credible size.

    Raises BadInput (no such file, or it points at other files) and ArchiveError (damaged, foreign, newer).
    """
    with opened(path) as dataset:
        _check_schema(path, dataset)
        check_sizes(path, dataset)
        _check_contents(path, dataset)
        yield dataset


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """An open netCDF4.Dataset of any netCDF-4 file that points at no others. Raises BadInput and ArchiveError."""
    import netCDF4

    _check_signature(path)
    with files.NETCDF_LOCK:
        refuse_pointers(path)
        with _as_archive_error(path), netCDF4.Dataset(path, "r") as dataset:
            yield dataset


def read_tables(path: Path, dataset: Any) -> dict[str, Table]:
    """Everything in the file, by group. Raises ArchiveError where data or attributes are damaged."""
    return _read(path, dataset, _all_of)


def read_small_tables(path: Path, dataset: Any) -> dict[str, Table]:
    """The same, but the large arrays of a large file are read when they are asked for."""
    return _read(path, dataset, _all_of if _claimed(dataset) <= IN_MEMORY else _Left(path, _state(path)))


def verify(path: Path, dataset: Any) -> None:
    """Read everything once, a block at a time. Raises ArchiveError where something is damaged."""
    _read(path, dataset, _checksum_only)


def _read(path: Path, dataset: Any, load: Callable[[Any], _Loaded]) -> dict[str, Table]:
    with _as_archive_error(path):
        tables = {group: _read_table(place, load) for group, place in groups_of(dataset)}
        if digest(tables) != getattr(dataset, DIGEST, ""):
            what = "damaged: values or attributes are not those that were written"
            raise ArchiveError(what, where=str(path), remedy="run the study again with --overwrite")
    return tables


def groups_of(dataset: Any) -> Iterator[tuple[str, Any]]:
    """The groups that hold something, as (path, netCDF4 group), the root first."""
    yield "/", dataset
    pending = list(dataset.groups.values())
    while pending:
        place = pending.pop(0)
        if place.variables or place.ncattrs():
            yield place.path, place
        pending.extend(place.groups.values())


@contextmanager
def _as_archive_error(path: Path) -> Iterator[None]:
    try:
        yield
    except WanderlastError:
        raise
    except (OSError, RuntimeError, ValueError, LookupError, AttributeError, TypeError, MemoryError) as error:
        what = f"damaged or truncated ({error})"
        raise ArchiveError(what, where=str(path), remedy="run the study again with --overwrite") from error


def _check_signature(path: Path) -> None:
    if not path.exists():
        alike = {own.stem: str(own) for own in path.parent.glob("*.nc")}  # all have the same ending
        remedy = did_you_mean(path.name.removesuffix(".nc"), alike)
        raise BadInput("no such file", where=str(path), remedy=remedy)
    if not path.is_file():
        raise BadInput("not a file", where=str(path), expected="an archive (.nc)")
    try:
        with path.open("rb") as stream:
            start = stream.read(len(files.SIGNATURE))
    except OSError as error:
        raise BadInput(f"cannot be read ({error.strerror})", where=str(path)) from error
    if start != files.SIGNATURE:
        raise ArchiveError("not a netCDF-4 file", where=str(path), expected="an archive of wanderlast")


def _check_schema(path: Path, dataset: Any) -> None:
    version = getattr(dataset, "schema_version", None)
    if not isinstance(version, int | np.integer) or not isinstance(getattr(dataset, "study_kind", None), str):
        expected, received = "attributes schema_version and study_kind", ", ".join(dataset.ncattrs()) or "no attributes"
        what, remedy = "a netCDF file of another program", "of a dataset studies.write(dataset, path) makes an archive"
        raise ArchiveError(what, where=str(path), expected=expected, received=received, remedy=remedy)
    if version > SCHEMA_VERSION:
        what, expected = "written by a newer version", f"schema_version up to {SCHEMA_VERSION}"
        raise ArchiveError(what, where=str(path), expected=expected, received=str(version), remedy="update wanderlast")
    if version < SCHEMA_VERSION:
        raise ArchiveError(
            "written before archives held estimated_error of every reported number",
            where=str(path),
            expected=f"schema_version {SCHEMA_VERSION}",
            received=str(version),
            remedy="run the study again with --overwrite",
        )


def check_sizes(path: Path, dataset: Any) -> None:
    """Refuse a file that claims more data than it can hold, or none, or of foreign types. Raises ArchiveError."""
    for group, place in groups_of(dataset):
        if place.vltypes or place.cmptypes or place.enumtypes:
            raise ArchiveError("holds types that archives do not have", where=str(path), received=f"group {group}")
        for name, variable in place.variables.items():
            if math.prod(variable.shape) == 0:
                raise ArchiveError("a variable has no rows", where=str(path), received=name)
    present, claimed = path.stat().st_size, _claimed(dataset)
    if claimed > _LARGEST_COMPRESSION * present:
        expected, received = f"at most {_LARGEST_COMPRESSION} times its {present} bytes", f"{claimed} bytes"
        raise ArchiveError("claims more data than it can hold", where=str(path), expected=expected, received=received)


def _claimed(dataset: Any) -> int:
    """Bytes of all variables."""
    variables = (variable for _, place in groups_of(dataset) for variable in place.variables.values())
    return sum(math.prod(v.shape) * (_TEXT_BYTES if v.dtype is str else v.dtype.itemsize) for v in variables)


def _check_contents(path: Path, dataset: Any) -> None:
    outlines = {group: _read_table(place, _outline) for group, place in groups_of(dataset)}
    stated = set(str(getattr(dataset, CONTENTS, "")).split("\n"))
    found = set(contents(outlines).split("\n"))
    if stated != found or "status" not in dataset.variables:
        missing = sorted(stated - found) or sorted(found - stated) or ["status"]
        word = "missing" if stated - found or stated == found else "not listed in its contents"
        expected = f"{len(stated)} variables, as its attribute {CONTENTS!r} says"
        received = f"without {'; '.join(missing)}" if word == "missing" else "; ".join(missing)
        raise ArchiveError(f"variables are {word}", where=str(path), expected=expected, received=received)


def _all_of(variable: Any) -> _Loaded:
    data = np.asarray(variable[...])
    return (data.astype(object) if variable.dtype is str else data), ""


def _checksum_only(variable: Any) -> _Loaded:
    if variable.dtype is str:
        return _outline(variable)[0], checksum(_all_of(variable)[0])
    return _outline(variable)[0], checksum(variable)


@dataclass(frozen=True)
class _Left:
    """Leaves large arrays of a file where they are."""

    path: Path
    state: tuple[int, ...]

    def __call__(self, variable: Any) -> _Loaded:
        """The array, or what reads it when it is asked for, with the checksum of what is there now."""
        if variable.dtype is str or math.prod(variable.shape) * variable.dtype.itemsize <= CHUNK_BYTES:
            return _all_of(variable)
        from results_schema.store.arrays_on_disk import on_disk

        place = f"{variable.group().path.rstrip('/')}/{variable.name}"
        data = on_disk(variable.shape, variable.dtype, partial(self._part, place))
        return xr.Variable(variable.dimensions, data), checksum(variable)

    def _part(self, place: str, rows: slice, at: tuple[int | slice, ...]) -> np.ndarray:
        """Some of an array. Raises ArchiveError where it is not the file that was checked any more."""
        with opened(self.path) as dataset:
            if _state(self.path) != self.state:
                raise ArchiveError("has changed while it was read", where=str(self.path), remedy="try again")
            variable = dataset[place]
            _set_up(variable)
            return np.asarray(variable[(rows, *at)])


def _state(path: Path) -> tuple[int, ...]:
    """What changes where a file is replaced or written."""
    found = path.stat()
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


def _outline(variable: Any) -> _Loaded:
    """An array of the right type and shape without memory of its own, and no checksum."""
    is_text = variable.dtype is str
    one = np.array("" if is_text else 0, object if is_text else variable.dtype)
    return np.broadcast_to(one, variable.shape), ""


def _read_table(place: Any, load: Callable[[Any], _Loaded] = _all_of) -> Table:
    attributes = {key: place.getncattr(key) for key in place.ncattrs()}
    beside = set(str(attributes.pop("coordinates", "")).split())
    columns: dict[str, tuple[Any, dict[str, Any]]] = {}
    for name, variable in place.variables.items():
        _set_up(variable)
        own = {key: variable.getncattr(key) for key in variable.ncattrs() if key != "_FillValue"}
        beside |= set(str(own.pop("coordinates", "")).split())
        columns[name] = (variable, own)
    return Table(
        {name: len(dimension) for name, dimension in place.dimensions.items()},
        {
            name: _column(name, variable, own, name in beside, load(variable))
            for name, (variable, own) in columns.items()
        },
        attributes,
    )


def _set_up(variable: Any) -> None:
    """Values as they are; and whole chunks one after the other: a larger cache, which every variable has until the file
    is closed, would only take memory."""
    variable.set_auto_maskandscale(False)
    if variable.dimensions and variable.dtype is not str:
        variable.set_var_chunk_cache(CHUNK_BYTES)


def _column(name: str, variable: Any, attributes: dict[str, Any], is_named: bool, loaded: _Loaded) -> Column:
    data, found = loaded
    return Column(variable.dimensions, data, attributes, is_named or variable.dimensions == (name,), found)
