"""The finished chunks of a run: one immutable netCDF-4 file each, from which a killed run goes on.

Beside an archive `a.nc` lie `a.nc.lock`, held by the run, and the folder `a.nc.parts` with a file `key` (what the
parts were computed from), the parts, and the SHA-256 of each part. A part counts when its SHA-256 does and it carries
the same key.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from results_schema.errors import ArchiveError
from results_schema.store import files
from results_schema.store.run_folder import RunFolder, folder_of, stored_key

Arrays = dict[str, np.ndarray]

_SELECTED = "selected"
_VARIANTS = "variants"
_KEY = "run_key"
_SUFFIX = ".nc"
_CHUNK_BYTES = 1 << 20


class Rows(NamedTuple):
    """Results of some variants: `variants` (n,) int64, and arrays (n, ...) by name."""

    variants: np.ndarray
    arrays: Mapping[str, np.ndarray]


def joined(parts: Sequence[Rows]) -> Rows | None:
    """Rows of different variants as one, ascending; None of none. All must have the same arrays; shorter histories are
    filled up with NaN."""
    if not parts:
        return None
    variants = np.concatenate([part.variants for part in parts])
    order = np.argsort(variants)
    names = parts[0].arrays
    return Rows(variants[order], {name: _stacked([part.arrays[name] for part in parts])[order] for name in names})


def _stacked(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays (n, ...) one after another, those with shorter rows filled up with NaN."""
    longest = max((array.shape[1] for array in arrays if array.ndim > 1), default=0)
    if all(array.ndim < 2 or array.shape[1] == longest for array in arrays):
        return np.concatenate(arrays)
    return np.concatenate([np.pad(a, ((0, 0), (0, longest - a.shape[1])), constant_values=np.nan) for a in arrays])


class PartStore(RunFolder):
    """The parts of one archive, locked while the `with` block lasts. Entering raises as `RunFolder`."""

    def __init__(self, archive_path: Path | str, key: str, look: Callable[[], object] = lambda: None) -> None:
        super().__init__(archive_path, key, look)
        self._valid: dict[Path, np.ndarray] | None = None

    def write(self, variants: np.ndarray, arrays: Mapping[str, np.ndarray], selected: Rows | None = None) -> Path:
        """Store one finished chunk: variants (n,), arrays (n, ...), and rows of a few variants of it (histories).

        Raises OutputFailed when the disk cannot take it, ValueError when the arrays do not fit the variants.
        """
        tables = {"/": _checked(Rows(variants, arrays))}
        if selected is not None and len(selected.variants):
            tables[_SELECTED] = _checked(selected)
        indices = tables["/"].variants
        path = self._folder / (hashlib.sha1(indices.tobytes()).hexdigest() + _SUFFIX)

        def fill(temporary: Path) -> None:
            _write_tables(temporary, tables, self._key)

        files.write_whole(path, fill)
        files.write_sidecar(path)
        if self._valid is not None:
            self._valid[path] = indices
        return path

    def finished(self) -> np.ndarray:
        """The variants (ascending, int64) of all valid parts; whatever else lies in the folder is deleted."""
        self._valid = {}
        for path in sorted(self._folder.iterdir()):
            if path.suffix == _SUFFIX and files.sidecar_matches(path):
                self._admit(path)
            elif path != self._key_file and not self._is_sidecar(path):
                files.remove_file(path)
        for path in sorted(self._folder.iterdir()):
            if self._is_sidecar(path) and path.with_suffix("") not in self._valid:
                files.remove_file(path)
        return np.unique(np.concatenate([np.empty(0, np.int64), *self._valid.values()]))

    def _is_sidecar(self, path: Path) -> bool:
        return path.name.endswith(_SUFFIX + ".sha256")

    def _admit(self, path: Path) -> None:
        assert self._valid is not None
        try:
            self._valid[path] = _read_tables(path, self._key, [_VARIANTS])["/"].variants
        except ArchiveError:
            files.remove_file(path)

    def assemble(self, n_variants: int) -> Arrays:
        """All results, arrays (n_variants, ...) by name; one part is in memory beside them at a time.

        Raises ArchiveError when variants are missing, or when a part turns out damaged (it is deleted: run again).
        """
        result: Arrays = {}
        covered = np.zeros(n_variants, bool)
        for path, tables in self._parts():
            rows = tables["/"]
            if rows.variants.max() >= n_variants:
                raise ArchiveError(
                    "a part holds variants that the study does not have",
                    where=str(path),
                    expected=f"below {n_variants}",
                    received=str(rows.variants.max()),
                )
            if not result:
                result = {name: np.empty((n_variants, *a.shape[1:]), a.dtype) for name, a in rows.arrays.items()}
            _require_same_arrays(path, result, rows.arrays)
            for name, array in rows.arrays.items():
                result[name][rows.variants] = array
            covered[rows.variants] = True
        if not covered.all():
            raise ArchiveError(
                "variants are not computed yet",
                where=str(self._folder),
                expected=f"{n_variants} finished variants",
                received=str(int(covered.sum())),
                remedy="run again to resume",
            )
        return result

    def assemble_selected(self) -> Rows:
        """The rows given as `selected`, by ascending variant; no variants and no arrays where there are none."""
        found = [tables[_SELECTED] for _, tables in self._parts() if _SELECTED in tables]
        if not found:
            return Rows(np.empty(0, np.int64), {})
        variants, first = np.unique(np.concatenate([rows.variants for rows in found]), return_index=True)
        names = found[0].arrays
        arrays = {name: _stacked([rows.arrays[name] for rows in found])[first] for name in names}
        return Rows(variants, arrays)

    def _parts(self) -> Iterator[tuple[Path, dict[str, Rows]]]:
        if self._valid is None:
            self.finished()
        for path in sorted(self._valid or {}):
            try:
                tables = _read_tables(path, self._key)
            except ArchiveError:
                files.remove_file(path)
                raise
            yield path, tables

    def remove(self) -> None:
        """Remove all parts: the archive is written."""
        super().remove()
        self._valid = {}


def finished_so_far(archive_path: Path | str) -> int | None:
    """Number of variants in the valid parts of an archive, None where it has no parts.

    Only reads: another run may be at work there.
    """
    folder = folder_of(archive_path)
    if not folder.is_dir():
        return None
    key = stored_key(folder)
    found = [np.empty(0, np.int64)]
    for path in sorted(folder.glob(f"*{_SUFFIX}")):
        with suppress(ArchiveError):
            if files.sidecar_matches(path):
                found.append(_read_tables(path, key, [_VARIANTS])["/"].variants)
    return int(np.unique(np.concatenate(found)).size)


def _checked(rows: Rows) -> Rows:
    variants = np.ascontiguousarray(rows.variants, np.int64)
    if variants.ndim != 1 or variants.size == 0 or variants.min() < 0:
        raise ValueError(f"variants: expected (n > 0,) numbers >= 0, received shape {variants.shape}")
    if _VARIANTS in rows.arrays:
        raise ValueError(f"an array is called {_VARIANTS!r}, the name of the numbers of the variants")
    for name, array in rows.arrays.items():
        if array.ndim == 0 or array.shape[0] != variants.size or array.size == 0 or array.dtype.kind not in "iuf":
            raise ValueError(f"{name}: expected numbers ({variants.size}, ...), received {array.dtype} {array.shape}")
    return Rows(variants, rows.arrays)


def _require_same_arrays(path: Path, result: Arrays, arrays: Mapping[str, np.ndarray]) -> None:
    def described(found: Mapping[str, np.ndarray]) -> str:
        return ", ".join(f"{name} {found[name].dtype} {found[name].shape[1:]}" for name in sorted(found))

    if described(result) != described(arrays):
        raise ArchiveError(
            "parts of one run hold different results",
            where=str(path),
            expected=described(result),
            received=described(arrays),
            remedy="discard the parts with --overwrite",
        )


def _write_tables(path: Path, tables: Mapping[str, Rows], key: str) -> None:
    import netCDF4

    with files.NETCDF_LOCK, netCDF4.Dataset(path, "w", format="NETCDF4") as dataset:
        dataset.setncattr(_KEY, key)
        for group, rows in tables.items():
            place = dataset if group == "/" else dataset.createGroup(group)
            _store(place, _VARIANTS, rows.variants)
            for name, array in rows.arrays.items():
                _store(place, name, array)


def _store(place: Any, name: str, array: np.ndarray) -> None:
    dims = tuple(f"n{size}" for size in array.shape)
    for dim, size in zip(dims, array.shape, strict=True):
        if dim not in place.dimensions:
            place.createDimension(dim, size)
    row_bytes = array.itemsize * int(np.prod(array.shape[1:], dtype=np.int64))
    rows = min(array.shape[0], max(1, _CHUNK_BYTES // row_bytes))
    variable = place.createVariable(
        name, array.dtype, dims, fletcher32=True, chunksizes=(rows, *array.shape[1:]), fill_value=False
    )
    variable.set_auto_maskandscale(False)
    variable[...] = array


def _read_tables(path: Path, key: str, names: list[str] | None = None) -> dict[str, Rows]:
    """The tables of a part, or only the arrays called `names`. Raises ArchiveError naming a part that is damaged, or
    that belongs to another run than that of the key."""
    import netCDF4

    try:
        with files.NETCDF_LOCK, netCDF4.Dataset(path, "r") as dataset:
            if getattr(dataset, _KEY, "") != key:
                raise ValueError("it belongs to another run")
            dataset.set_auto_maskandscale(False)
            tables = {"/": _read_rows(dataset, names)}
            if _SELECTED in dataset.groups:
                tables[_SELECTED] = _read_rows(dataset.groups[_SELECTED], names)
    except (OSError, RuntimeError, KeyError, IndexError, ValueError) as error:
        raise ArchiveError(
            f"this part cannot be used ({error})", where=str(path), remedy="run again: it is computed again"
        ) from error
    return tables


def _read_rows(place: Any, names: list[str] | None) -> Rows:
    arrays = {
        name: np.asarray(variable[...]) for name, variable in place.variables.items() if names is None or name in names
    }
    variants = arrays.pop(_VARIANTS)
    if variants.size == 0:
        raise ValueError("no rows")
    return Rows(variants, arrays)
