"""By what it is known whether somebody has changed the numbers of a dataset since it was computed."""

from __future__ import annotations

from zlib import crc32

import numpy as np

from results_schema.lazy_imports import xr

VALUES = "values_crc32"  # the attribute of datasets in memory; archives have their own


def checksum_of_values(dataset: xr.Dataset) -> str:
    """CRC-32 over all numbers of a dataset, in whatever order its dimensions and variables are."""
    found = 0
    for name in sorted(map(str, dataset.variables)):
        array = dataset[name].transpose(*sorted(map(str, dataset[name].dims)))
        if array.dtype.kind == "f":
            found = crc32(np.ascontiguousarray(array.values).data, crc32(name.encode(), found))
    return f"{found:08x}"
