"""Tables into one netCDF-4 file: the same tables give the same bytes."""

import math
import zlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from results_schema.blocks import CHUNK_BYTES, chunk_shape, slices
from results_schema.store import files
from results_schema.store.tables import Checksum, Column, Table, checksum, seal

PLAIN: Mapping[str, Any] = {}  # of parts, which are read soon, and whose whole files have a SHA-256
GUARDED: Mapping[str, Any] = {"fletcher32": True}
PACKED: Mapping[str, Any] = {"compression": "zlib", "complevel": 1, "shuffle": True, "fletcher32": True}
# What keeps more than this part of its bytes is left as it is: results of a march keep two thirds, axes of samples a
# half. To pack all that keeps up to 0.6 took a third longer with a million variants, for a tenth less on the disk.
WORTH_PACKING = 0.3
TRIED_BYTES = 2**17  # of the first chunk: to try all of it in 27 columns took as long as to write them


def write_tables(path: Path, tables: Mapping[str, Table], filters: Mapping[str, Any] = PACKED) -> None:
    """Write tables by group ("/", "/model/bed") into a new file, and seal it."""
    import netCDF4

    with files.NETCDF_LOCK, netCDF4.Dataset(path, "w", format="NETCDF4") as dataset:
        written = {
            group: _write_table(dataset if group == "/" else dataset.createGroup(group), table, filters)
            for group, table in tables.items()
        }
        dataset.setncatts(seal(written))


def _write_table(place: Any, table: Table, filters: Mapping[str, Any]) -> Table:
    """The table, its columns with the checksums of what was written."""
    for name, size in table.sizes.items():
        place.createDimension(name, size)
    place.setncatts({key: _attribute(value) for key, value in table.attributes.items()})
    further = [name for name, column in table.columns.items() if column.is_coordinate and column.dims != (name,)]
    named, sums = set[str](), dict[str, str]()
    for name, column in table.columns.items():
        # CF wants those coordinates named with a variable that lie over some of its dimensions.
        along = [one for one in further if set(table.columns[one].dims) <= set(column.dims)]
        beside = [] if column.is_coordinate else along
        named.update(beside)
        named_beside = {"coordinates": " ".join(beside)} if beside else {}
        told = replace(column, attributes={**column.attributes, **named_beside})
        sums[name] = _write_column(place, name, told, filters)
    rest = [name for name in further if name not in named]
    if rest:
        place.setncattr("coordinates", " ".join(rest))
    return replace(table, columns={name: replace(one, checksum=sums[name]) for name, one in table.columns.items()})


def _write_column(place: Any, name: str, column: Column, filters: Mapping[str, Any]) -> str:
    """The checksum of what was written: data on the disk are read once."""
    options: dict[str, Any] = {"fill_value": False}
    if column.data.dtype.kind == "f" and not column.is_coordinate:
        options["fill_value"] = column.data.dtype.type(np.nan)
    if column.is_chunked:
        shape = chunk_shape(column.data.shape, column.data.dtype.itemsize)
        hard = filters is PACKED and not _shrinks(column.data, shape)
        options |= {**(GUARDED if hard else filters), "chunksizes": shape}
    variable = place.createVariable(name, str if column.is_text else column.data.dtype, column.dims, **options)
    variable.set_auto_maskandscale(False)
    if column.is_chunked:
        # Chunks are written whole, one after the other: a cache per variable would only take memory.
        variable.set_var_chunk_cache(CHUNK_BYTES)
    variable.setncatts({key: _attribute(value) for key, value in column.attributes.items() if key != "_FillValue"})
    if not column.is_chunked:
        variable[...] = column.data if column.dims else column.data.item()
        return checksum(column.data)
    found = Checksum(column.data.dtype)
    for part in slices(column.data.shape, column.data.dtype.itemsize):
        numbers = np.asarray(column.data[part])
        variable[part] = numbers
        found.add(numbers)
    return str(found)


def _shrinks(data: Any, shape: tuple[int, ...]) -> bool:
    """Whether the beginning of an array's first chunk says that it is worth packing; arrays of a chunk are."""
    if data.nbytes <= CHUNK_BYTES:
        return True
    size = data.dtype.itemsize
    rows = max(1, TRIED_BYTES // (size * math.prod(shape[1:])))
    first = np.asarray(data[: min(rows, shape[0])])[tuple(slice(length) for length in shape)]
    shuffled = np.ascontiguousarray(first).view(np.uint8).reshape(-1, size).T.tobytes()
    return len(zlib.compress(shuffled, PACKED["complevel"])) < WORTH_PACKING * len(shuffled)


def _attribute(value: Any) -> Any:
    return value[0] if isinstance(value, np.ndarray) and value.size == 1 else value
