"""Datasets as plain tables (what a netCDF group holds), and what is sealed about them in the archive.

fletcher32 guards the chunks of arrays on disk, but neither their index (a chunk that cannot be found is read as fill
values) nor scalars, strings and attributes: a digest over all of them, with a CRC of each array, is stored in the
archive, together with the list of its variables.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from results_schema.blocks import BLOCK_BYTES, slices
from results_schema.lazy_imports import xr

CONTENTS = "contents"
DIGEST = "contents_sha256"
_ADDED = (CONTENTS, DIGEST)
_NUMBER_KINDS = "iuf"


Numbers = Any  # np.ndarray, or what has its shape and type and gives it by slices of the first axis


@dataclass(frozen=True)
class Column:
    """One variable: data of shape `dims`; str for text (an object array of str), numbers otherwise, which may be on the
    disk (a variable of xarray, of which slices are asked for).

    checksum: of data that were read and let go; "" where they are in `data`.
    """

    dims: tuple[str, ...]
    data: Numbers
    attributes: Mapping[str, Any]
    is_coordinate: bool = False
    checksum: str = ""

    @property
    def is_text(self) -> bool:
        """Whether the values are strings."""
        return bool(self.data.dtype.kind == "O")

    @property
    def is_chunked(self) -> bool:
        """Whether the values lie in compressed chunks on disk (arrays of numbers)."""
        return bool(self.dims) and not self.is_text


@dataclass(frozen=True)
class Table:
    """One group: sizes of its dimensions, its variables in order, its attributes."""

    sizes: Mapping[str, int]
    columns: Mapping[str, Column]
    attributes: Mapping[str, Any] = field(default_factory=dict)


def from_arrays(arrays: Mapping[str, np.ndarray]) -> Table:
    """Arrays of numbers by name, each over dimensions of its own."""
    sizes, columns = dict[str, int](), dict[str, Column]()
    for name, array in arrays.items():
        dims = tuple(f"{name}_{axis}" for axis in range(array.ndim))
        sizes |= dict(zip(dims, array.shape, strict=True))
        columns[name] = Column(dims, array, {})
    return Table(sizes, columns)


def from_dataset(dataset: xr.Dataset) -> Table:
    """A dataset as a table, coordinates first. Raises ValueError for what a netCDF-4 file of ours cannot hold."""
    sizes = {str(name): int(size) for name, size in dataset.sizes.items()}
    empty = [name for name, size in sizes.items() if size == 0]
    if empty:
        raise ValueError(f"dimension {empty[0]}: expected at least one entry, received none")
    names = [*dataset.coords, *dataset.data_vars]
    columns = {str(name): _column(str(name), dataset[name].variable, name in dataset.coords) for name in names}
    return Table(sizes, columns, {str(key): canonical(value) for key, value in dataset.attrs.items()})


def _column(name: str, variable: xr.Variable, is_coordinate: bool) -> Column:
    data: Numbers = variable if variable.nbytes > BLOCK_BYTES else np.asarray(variable.values)
    if data.dtype.kind in "UTO":
        data = np.asarray(data).astype(object)
        if not all(isinstance(value, str) for value in data.ravel()):
            raise ValueError(f"{name}: expected text or numbers, received objects")
    elif data.dtype.kind not in _NUMBER_KINDS:
        raise ValueError(f"{name}: expected text or numbers, received {data.dtype}")
    attributes = {str(key): canonical(value) for key, value in variable.attrs.items() if key != "_FillValue"}
    if "flag_values" in attributes:
        # CF wants the flags in the type of their variable.
        attributes["flag_values"] = np.atleast_1d(attributes["flag_values"]).astype(data.dtype)
    return Column(tuple(map(str, variable.dims)), data, attributes, is_coordinate)


def to_dataset(table: Table) -> xr.Dataset:
    """A table as a dataset; text becomes fixed-width unicode."""
    variables = {
        name: xr.Variable(
            column.dims, column.data.astype(str) if column.is_text else column.data, dict(column.attributes)
        )
        for name, column in table.columns.items()
    }
    coordinates = [name for name, column in table.columns.items() if column.is_coordinate]
    return xr.Dataset(variables, attrs=dict(table.attributes)).set_coords(coordinates)


def canonical(value: Any) -> Any:
    """An attribute in the form in which netCDF-4 gives it back: text, list of text, or numbers (n,).

    >>> canonical(True), canonical(["one"]), canonical([1, 2])
    (array([1], dtype=int8), 'one', array([1, 2]))
    """
    if isinstance(value, str):
        return value
    array = np.atleast_1d(np.asarray(value))
    if array.dtype.kind in "UTO":
        texts = [str(text) for text in array]
        return texts[0] if len(texts) == 1 else texts
    if array.dtype.kind == "b":
        return array.astype(np.int8)
    if array.dtype.kind not in _NUMBER_KINDS or array.ndim != 1 or array.size == 0:
        raise ValueError(f"attribute: expected text or numbers, received {value!r}")
    return array


def seal(tables: Mapping[str, Table]) -> dict[str, Any]:
    """The attributes that let a reader see whether the archive is whole; tables by group ("/", "/audit")."""
    return {CONTENTS: contents(tables), DIGEST: digest(tables)}


def contents(tables: Mapping[str, Table]) -> str:
    """One line per variable: path, type, shape.

    >>> contents({"/audit": Table({"n": 2}, {"x": Column(("n",), np.zeros(2), {})})})
    '/audit/x float64 2'
    """
    lines = []
    for group, table in tables.items():
        for name, column in table.columns.items():
            shape = "x".join(str(size) for size in column.data.shape) or "scalar"
            kind = "text" if column.is_text else column.data.dtype.name
            lines.append(f"{group.rstrip('/')}/{name} {kind} {shape}")
    return "\n".join(sorted(lines))


def digest(tables: Mapping[str, Table]) -> str:
    """SHA-256 over all attributes and a checksum of all values, independent of the order of variables."""
    total = hashlib.sha256()
    for piece in sorted(_pieces(tables)):
        total.update(piece.encode("utf-8", "surrogatepass") + b"\0")
    return total.hexdigest()


def _pieces(tables: Mapping[str, Table]) -> Iterator[str]:
    for group, table in tables.items():
        kept = {key: value for key, value in table.attributes.items() if group != "/" or key not in _ADDED}
        yield from _attribute_texts(f"{group}@", kept)
        for name, column in table.columns.items():
            place = f"{group}:{name}"
            yield f"{place} {column.dims} {column.is_coordinate} {column.checksum or checksum(column.data)}"
            yield from _attribute_texts(f"{place}@", column.attributes)


def checksum(data: Numbers) -> str:
    """CRC-32 of numbers (fast; beside fletcher32 it only has to notice lost and exchanged chunks), or text itself.

    >>> checksum(np.array([1, 2], np.int8)), checksum(np.array(["a"], object))
    ('int8 b6cc4292', "['a']")
    """
    if data.dtype.kind == "O":
        return repr(data.tolist())
    found = Checksum(data.dtype)
    for part in slices(data.shape, data.dtype.itemsize) if data.shape else [...]:
        found.add(data[part])
    return str(found)


class Checksum:
    """That of numbers of a type, which come part after part."""

    def __init__(self, dtype: np.dtype[Any]) -> None:
        self._dtype, self._found = dtype, 0

    def add(self, part: Numbers) -> None:
        """Take the numbers that come next."""
        little = np.ascontiguousarray(part, self._dtype.newbyteorder("<"))
        self._found = zlib.crc32(little.reshape(-1).view(np.uint8).data, self._found)

    def __str__(self) -> str:
        return f"{self._dtype.name} {self._found:08x}"


def _attribute_texts(place: str, attributes: Mapping[str, Any]) -> Iterator[str]:
    for key, value in attributes.items():
        found = canonical(value)
        text = found if isinstance(found, str | list) else (found.dtype.name, found.tolist())
        yield f"{place}{key} {text!r}"
