"""An archive as a table: one row per variant (and position), or per cell and result, for programs that read CSV or
Parquet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain, product
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from results_schema.errors import BadInput, did_you_mean
from results_schema.lazy_imports import xr
from results_schema.store import files
from studies.protocol.study import kind_of
from studies.results.axes import Axis
from studies.results.formatting import typed_unit
from studies.results.results import Results

if TYPE_CHECKING:
    import pandas as pd

SWEPT = "swept"  # the dimension along which cells name the swept numbers of a variant
MOST_COLUMNS = 64  # of one result
ERRORS = ("result",)  # of estimated errors, one for each result however many there are
ROWS_AT_ONCE = 2**17  # variants, of which a table is in memory


def _write_csv(path: Path, tables: Iterable[pd.DataFrame]) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        for number, table in enumerate(tables):
            table.to_csv(stream, index=False, header=number == 0)


def _write_parquet(path: Path, tables: Iterable[pd.DataFrame]) -> None:
    import pandas as pd

    pd.concat(list(tables), ignore_index=True).to_parquet(path, index=False)


WRITERS = {".csv": _write_csv, ".parquet": _write_parquet}


def export(
    dataset: xr.Dataset, path: Path | str, results: Sequence[str] | str = (), *, overwrite: bool = False
) -> Path:
    """Write the table of a dataset as a CSV file, or as Parquet, as the command `export` does; its path.

    results: one or some of those that it has beside the swept numbers and the status, with commas between them or as a
    list; all where none is named. Raises as `write_table`, and BadInput for what is no whole dataset of a study.
    """
    found = Results.of(dataset)
    kind_of(found.study)  # which declares its results
    write_table(found, Path(path), results.split(",") if isinstance(results, str) else results, overwrite=overwrite)
    return Path(path)


def write_table(results: Results, path: Path, chosen: Sequence[str] = (), *, overwrite: bool = False) -> list[str]:
    """Write the table of an archive as the path's ending asks; the results that have no place in it.

    chosen: as of `table_of`. Raises BadInput (unknown ending, no such place or result, a file is there and not to be
    replaced, pyarrow is not installed) and OutputFailed.
    """
    if path.suffix not in WRITERS:
        expected = f"a name that ends in {' or '.join(WRITERS)}"
        raise BadInput("unknown sort of table", where=str(path), expected=expected, received=path.suffix or "no ending")
    files.check_place(path, overwrite=overwrite)
    parts = _parts(results)
    table, left_out = table_of(next(parts), chosen)
    if nowhere := [name for name in chosen if name in left_out]:
        what, expected = f"{nowhere[0]} has other dimensions than a table's rows", "results with one number a variant"
        ends = [name for name in (f"{nowhere[0]}_max", f"{nowhere[0]}_min") if name in results.dataset]
        remedy = f"its extremes, {','.join(ends)}" if ends else ""
        raise BadInput(what, where="results", expected=expected, received=nowhere[0], remedy=remedy)
    tables = chain([table], (table_of(part, chosen)[0] for part in parts))
    try:
        files.write_whole(path, partial(WRITERS[path.suffix], tables=tables))
    except ImportError:
        what = "Parquet needs a package that is not installed"
        raise BadInput(what, where=str(path), remedy="pip install pyarrow, or write a .csv") from None
    return left_out


def _parts(results: Results) -> Iterator[Results]:
    """The results in parts of neighbouring variants."""
    if not results.dims:
        yield results
        return
    along, count = results.dims[0], results.shape[0]
    step = max(1, ROWS_AT_ONCE * count // results.size)
    for first in range(0, count, step):
        part = results.dataset.isel({along: slice(first, first + step)})
        yield Results(part, results.study, results.models)


def table_of(results: Results, chosen: Sequence[str] = ()) -> tuple[pd.DataFrame, list[str]]:
    """The table, and the results that have no place in it: histories, shapes, and what belongs to no variant.

    Swept numbers in the units of the study file, results in those of the archive; units stand in the headings, flags as
    words. chosen: results that it has beside the swept numbers and the status; all where none is named, but for contact
    forces of carriages that are forces. Raises BadInput for a name that is none.
    """
    import pandas as pd

    dataset = _chosen(results, chosen) if chosen else _without_constants(results)
    along = "position" if results.study.output.keeps_variants else "result"
    rows = (*results.dims, *((along,) if along in dataset.dims else ()))
    like = xr.zeros_like(dataset["status"], dtype=float)
    if len(rows) > len(results.dims):
        like = like.expand_dims({along: dataset[along]}).transpose(*rows)
    columns, left_out, swept = {}, [], {axis.name: axis for axis in results.axes}
    declared = results.study.results(results.study.kind)
    of_none = {name for name, variable in declared.items() if variable.lead == "none"} | set(dataset.coords)
    for name, array in [*((n, dataset[n]) for n in (*dataset.coords, "status")), *dataset.data_vars.items()]:
        own = tuple(dim for dim in array.dims if dim not in rows)
        nowhere = own and (not set(array.dims) & set(rows) if rows else name in of_none)
        many = own != ERRORS and prod(dataset.sizes[dim] for dim in own) > MOST_COLUMNS
        if many or nowhere:
            left_out += [str(name)] if name in dataset.data_vars else []
            continue
        parts = [_as_typed(swept[str(name)], array)] if name in swept else _columns(str(name), array, own)
        if own == (SWEPT,):
            parts = list(_where(results, str(name), array))
        for heading, one in parts:
            columns[heading] = _words(xr.broadcast(one, like)[0].transpose(*rows).values.reshape(-1), array.attrs)
    return pd.DataFrame(columns), left_out


def _chosen(results: Results, names: Sequence[str]) -> xr.Dataset:
    """The dataset with these results alone, the swept numbers and the status."""
    dataset = results.dataset
    known = [str(name) for name in (*dataset.data_vars, *dataset.coords) if name not in dataset.dims]
    for name in names:
        if name not in known:
            swept = "leave it out: swept numbers are always in the table, beside the results that are named"
            remedy = swept if name in dataset.dims else did_you_mean(name, known)
            expected = f"one of {len(known)} results, which info --all lists"
            raise BadInput("no such result", where="results", expected=expected, received=name, remedy=remedy)
    kept = {*names, *(axis.name for axis in results.axes), *dataset.dims, "status"}
    return dataset.drop_vars([name for name in dataset.variables if name not in kept])


def _without_constants(results: Results) -> xr.Dataset:
    """The dataset without contact forces of carriages that are forces, which press as they are written."""
    forces = tuple(f"{name}_contact_force_" for name, one in results.study.carriage.items() if not one.inertial)
    lost = {f"{name}_separation_position" for name, one in results.study.carriage.items() if not one.inertial}
    dataset = results.dataset.drop_vars(
        [name for name in results.dataset.data_vars if str(name).startswith(forces) or name in lost]
    )
    if "result" not in dataset.dims or not results.study.output.keeps_variants:
        return dataset
    return dataset.sel(result=[name for name in dataset["result"].values if not str(name).startswith(forces)])


def _as_typed(axis: Axis, array: xr.DataArray) -> tuple[str, xr.DataArray]:
    """A swept number in the unit of the study file, with its heading; without the last digits of the conversion."""
    if axis.typed is None:
        return _columns(axis.name, array, ())[0]
    values = [_short(value) for value in axis.shown]
    return f"{axis.name} ({axis.typed.unit})", array.copy(data=values)


def _short(value: float) -> float:
    return float(f"{value:.12g}")


def _where(results: Results, name: str, array: xr.DataArray) -> Iterator[tuple[str, xr.DataArray]]:
    """Swept numbers of the variants that cells tell of, each in the unit of the study file, with its heading."""
    for place, axis in enumerate(array[SWEPT].values.tolist()):
        own, typed = array.isel({SWEPT: place}).drop_vars(SWEPT), typed_unit(results.study, axis)
        unit = typed.unit if typed else str(array["swept_unit"].values[place])
        if typed:
            own = own.copy(data=np.vectorize(_short, otypes=[float])(own.values * typed.factor))
        yield f"{name} {axis}{f' ({unit})' if unit not in ('', '1') else ''}", own


def _words(values: NDArray[Any], attributes: Mapping[str, Any]) -> NDArray[Any]:
    """Flags as the words that the archive has for them; other values as they are."""
    if "flag_meanings" not in attributes:
        return values
    words = dict(zip(np.atleast_1d(attributes["flag_values"]), attributes["flag_meanings"].split(), strict=True))
    return np.array([words[value].replace("_", "-") for value in values])


def _columns(name: str, array: xr.DataArray, own: tuple[str, ...]) -> list[tuple[str, xr.DataArray]]:
    """A result by the labels of the dimensions that are not those of the rows, with its heading."""
    units = str(array.attrs.get("units", "1"))
    unit = "" if units in ("1", "") else f" ({units})"
    found = []
    for places in product(*(range(array.sizes[dim]) for dim in own)):
        at = dict(zip(own, places, strict=True))
        labels = "".join(f" {array[dim].values[place]}" for dim, place in at.items())
        found.append((f"{name}{labels}{unit}", array.isel(at).drop_vars(own, errors="ignore")))
    return found
